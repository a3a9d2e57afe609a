"""The pose of a mechanism's bodies, all rigid, that is nearest to a bent one: what magnified drawings bend from.

A beam held at three or more places in line bends between them as a curve through these places, so its base has to be
straight, and the bodies that hold it have to move with it. The end-effector then strays from its place by its elastic
deviation, magnified; so this is only for beams that something slides along, whose curve changes with the place.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paraflex.arrays import Array
from paraflex.dynamics import System, build_system
from paraflex.dynamics.joint_coordinates import joint_coordinate
from paraflex.dynamics.signals import no_signals
from paraflex.errors import InputError, NumericalError
from paraflex.kernel.constraints import constraint_values, fill_jacobian
from paraflex.kernel.packed import CONSTRAINT, make_scratch
from paraflex.mechanism import Mechanism
from paraflex.results.outlines import Outline

# Positions (k, 2) and angles (k,) of body frames.
Frames = dict[str, tuple[Array, Array]]

_MOST_STEPS = 8
# Gap of joints that is none: far below the rounding of stored places [sizes of the mechanism, rad].
_CLOSED = 1e-10
# Dependent rows: fraction of the mean diagonal entry that is added to all.
_DAMPING = 1e-11
# Moment of inertia of a body that is drawn as a point, as if it were this part of the mechanism's size.
_POINT = 0.01


def rigid_frames(
    mechanism: Mechanism,
    drawn: Sequence[Outline],
    shapes: Mapping[str, Array],
    angle: Callable[[str], Array],
    driven: Mapping[str, Array],
) -> Frames | None:
    """Frames of the rigid mechanism nearest to shapes, by squares of distances of stations; None if it does not close.

    Parameters
    ----------
    mechanism : Mechanism
    drawn : sequence of Outline
        Of all bodies, in order.
    shapes : mapping of str to (k, s, 2) array
        [m]
    angle : callable
        Of a body's frame (k,), within half a turn [rad].
    driven : mapping of str to (k,) array
        Coordinates of joints that are held as they are [rad, m]; left free if the mechanism does not close with them.
    """
    try:
        system = build_system(mechanism.rigid())
    except (InputError, NumericalError):
        return None
    start = np.zeros((len(next(iter(shapes.values()))), system.n))
    for one in drawn:
        body = system.body(one.body)
        start[:, body.position], start[:, body.angle] = _fitted_frame(one, shapes[one.body], angle(one.body))
    if not np.isfinite(start).all():
        return None
    for held in [driven, {}] if driven else [{}]:
        q = _closed(system, drawn, start, held)
        if q is not None:
            return {body.name: (q[:, body.position], q[:, body.angle]) for body in system.bodies}
    return None


def _fitted_frame(one: Outline, shape: Array, angle: Array) -> tuple[Array, Array]:
    """The frame in which the undeformed stations are nearest to a shape (k, s, 2)."""
    z, middle = one.places @ [1.0, 1j], np.mean(one.places @ [1.0, 1j])
    places = shape @ [1.0, 1j]
    centre = places.mean(axis=1)
    turn = np.sum(np.conj(z - middle) * (places - centre[:, None]), axis=1) * np.exp(-1j * angle)
    angle = angle + np.angle(turn)
    origin = centre - np.exp(1j * angle) * middle
    return np.stack([origin.real, origin.imag], axis=1), angle


def _closed(system: System, drawn: Sequence[Outline], q: Array, driven: Mapping[str, Array]) -> Array | None:
    """Newton's iteration at all instants at once, from coordinates (k, n), each step the least change of stations."""
    rows = (system.packed.rows["kind"] == CONSTRAINT) & (system.packed.rows["signal"] < 0)
    units = np.concatenate([
        system.row_units[rows], [system.size if system.mechanism.joint(name).slides else 1.0 for name in driven],
    ])  # fmt: skip
    if not units.size:
        return q
    inverse = _inverse_metric(system, drawn, q)
    for _ in range(_MOST_STEPS):
        gaps, jacobian = _rows(system, q, rows, driven)
        gaps, jacobian = gaps / units, jacobian / units[:, None]
        if np.max(np.abs(gaps)) < _CLOSED:
            return q
        weighted = inverse @ np.swapaxes(jacobian, 1, 2)
        schur = jacobian @ weighted
        damping = _DAMPING * np.trace(schur, axis1=1, axis2=2) / units.size
        schur += damping[:, None, None] * np.eye(units.size)
        try:
            q = q - (weighted @ np.linalg.solve(schur, gaps[..., None]))[..., 0]
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(q).all():
            return None
    return None


def _rows(system: System, q: Array, chosen: NDArray[np.bool_], driven: Mapping[str, Array]) -> tuple[Array, Array]:
    """Gaps (k, m) of joints and of the driven coordinates, and their derivatives (k, m, n)."""
    phi, jacobian = np.zeros((len(q), system.m)), np.zeros((len(q), system.m, system.n))
    signals, scratch = no_signals(system.packed), make_scratch(system.packed)
    rate, still = np.zeros(system.m), q[0] * 0.0
    for k, one in enumerate(np.ascontiguousarray(q)):
        constraint_values(system.packed, signals, 0.0, one, still, scratch, phi[k], rate)
        fill_jacobian(system.packed, one, jacobian[k])
    held = [(joint_coordinate(system, name, q), value) for name, value in driven.items()]
    return (
        np.concatenate([phi[:, chosen], *((one.value - value)[:, None] for one, value in held)], axis=1),
        np.concatenate([jacobian[:, chosen], *(one.rows[:, None] for one, _ in held)], axis=1),
    )


def _inverse_metric(system: System, drawn: Sequence[Outline], q: Array) -> Array:
    """Inverse (k, n, n) of the mean square displacement of each body's stations as a form of its coordinates."""
    metric = np.zeros((len(q), system.n, system.n))
    for one in drawn:
        body = system.body(one.body)
        x, y = body.position.start, body.position.start + 1
        arm = np.exp(1j * q[:, [body.angle]]) * (one.places @ [1.0, 1j])
        middle = arm.mean(axis=1)
        metric[:, x, x] = metric[:, y, y] = 1.0
        metric[:, x, body.angle] = metric[:, body.angle, x] = -middle.imag
        metric[:, y, body.angle] = metric[:, body.angle, y] = middle.real
        metric[:, body.angle, body.angle] = np.mean(np.abs(arm) ** 2, axis=1) + (_POINT * system.size) ** 2
    return np.linalg.inv(metric).astype(float)
