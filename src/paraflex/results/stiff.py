"""Pose of the rigid mechanism nearest to a deformed one, the base of drawings with magnified deflections.

A beam held at three or more places in line deforms to a curve through these places. Its base has to be straight, and
the bodies that hold the beam have to move with the base. The drawn end-effector is then off its position by the
magnified elastic deviation. This base is therefore used only if a joint slides along such a beam, whose curve changes
with the position of the joint.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from paraflex.arrays import Array, Mask
from paraflex.dynamics import System, build_system, joint_coordinate
from paraflex.dynamics.signals import no_signals
from paraflex.errors import InputError, NumericalError
from paraflex.kernel.constraints import constraint_values, fill_jacobian
from paraflex.kernel.packed import make_scratch
from paraflex.mechanism import Mechanism
from .outlines import Outline

_MOST_STEPS = 8
# Gap below which joints are closed, far below the rounding of stored positions [sizes of the mechanism, rad].
_CLOSED = 1e-10
# Fraction of the mean diagonal entry that is added to all diagonal entries, for dependent rows.
_DAMPING = 1e-11
# Radius of gyration added to each body, for bodies drawn as a point, as a fraction of the mechanism's size.
_POINT = 0.01


def rigid_frames(
    mechanism: Mechanism,
    drawn: Sequence[Outline],
    shapes: Mapping[str, Array],
    angle: Callable[[str], Array],
    driven: Mapping[str, Array],
) -> dict[str, tuple[Array, Array]] | None:
    """Return the body frames of the rigid mechanism nearest to shapes, in the least squares of station distances.

    They are positions (k, 2) and angles (k,) by body. Return None if the rigid mechanism does not close.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism as described.
    drawn : sequence of Outline
        Stations of all bodies, in order.
    shapes : mapping of str to (k, s, 2) array
        Positions of the stations of the deformed bodies [m].
    angle : callable
        Function that returns the angle (k,) of a body's frame, correct within half a turn [rad].
    driven : mapping of str to (k,) array
        Coordinates of joints that keep their values [rad, m]; they are free if the mechanism does not close with them.
    """
    try:
        system = build_system(mechanism.rigid())
    except (InputError, NumericalError):
        return None
    start = np.zeros((len(next(iter(shapes.values()))), system.n))
    for one in drawn:
        body = system.body(one.body)
        # The undeformed stations are nearest to the shape in this frame.
        rest, places = one.places @ [1.0, 1j], shapes[one.body] @ [1.0, 1j]
        centre, middle, phi = places.mean(axis=1), rest.mean(), angle(one.body)
        turn = np.sum(np.conj(rest - middle) * (places - centre[:, None]), axis=1) * np.exp(-1j * phi)
        start[:, body.angle] = phi + np.angle(turn)
        origin = centre - np.exp(1j * start[:, body.angle]) * middle
        start[:, body.position] = np.stack([origin.real, origin.imag], axis=1)
    if not np.isfinite(start).all():
        return None
    for held in [driven, {}] if driven else [{}]:
        if (q := _closed(system, drawn, start, held)) is not None:
            return {body.name: (q[:, body.position], q[:, body.angle]) for body in system.bodies}
    return None


def _closed(system: System, drawn: Sequence[Outline], q: Array, driven: Mapping[str, Array]) -> Array | None:
    """Close the joints by Newton's iteration at all instants at once, from coordinates q (k, n).

    Each step is the one of least displacement of the stations. Return None without convergence.
    """
    rows = system.constrained & (system.packed.rows["signal"] < 0)
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


def _rows(system: System, q: Array, chosen: Mask, driven: Mapping[str, Array]) -> tuple[Array, Array]:
    """Return the residuals (k, m) of joints and of driven coordinates, and their Jacobian (k, m, n)."""
    # The scratch of the kernels is made once for all poses.
    packed, scratch, signals = system.packed, make_scratch(system.packed), no_signals(system.packed)
    phi, jacobian = np.zeros((len(q), system.m)), np.zeros((len(q), system.m, system.n))
    rate, still = np.zeros(system.m), np.zeros(system.n)
    for k, pose in enumerate(np.ascontiguousarray(q)):
        constraint_values(packed, signals, 0.0, pose, still, scratch, phi[k], rate)
        fill_jacobian(packed, pose, jacobian[k])
    held = [(joint_coordinate(system, name, q), value) for name, value in driven.items()]
    return (
        np.concatenate([phi[:, chosen], *((one.value - value)[:, None] for one, value in held)], axis=1),
        np.concatenate([jacobian[:, chosen], *(one.rows[:, None] for one, _ in held)], axis=1),
    )


def _inverse_metric(system: System, drawn: Sequence[Outline], q: Array) -> Array:
    """Return the inverse (k, n, n) of the metric of coordinates: mean square displacements of each body's stations."""
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
