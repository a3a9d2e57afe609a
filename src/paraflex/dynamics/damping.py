"""Damping matrix of a flexible body from the damping ratios of its modes with its joints held.

Damping ratios belong to vibrations. How a body vibrates depends on how it is held, not on the frame in which its
deformation is described. Its points are held as its joints hold them, with the bodies on the other side at rest:

- A revolute joint holds the point. A weld holds the slope as well, and so does a prescribed angle.
- A rail (prismatic joint) holds the slope and the direction normal to the rail; with a prescribed travel, everything.
- A pin in another body's slot or on another beam is held across the body; if prescribed, in both directions.
- The pin of a massless rod (distance joint) is held across the body.
- Of several points held in both directions only the first is held along the line to the others: a bar can stretch
  between its joints.
- Members that slide along the body itself, motors, springs, dampers and gears hold nothing. Neither do joints to bodies
  that reach the ground through this body alone: they hang on it.

Let psi_k be the mass-normalised modes of the undeformed body so held, omega_k their frequencies and d_k their damping
coefficients. Then

    D = sum_k (d_k / omega_k^4) (K psi_k) (K psi_k)^T + c K_rest,   c = d_1 / omega_1^2,

where K_rest is the stiffness outside the span of all psi_k: that of the static shapes imposed by the joints of a body
with redundant supports. K psi_k is a force, which rigid motion does not change: D is the same matrix of the deformation
in every frame.
"""

from collections.abc import Iterator

import numpy as np

from paraflex.arrays import Array, Numbers
from paraflex.mechanism import GROUND, RigidBody, stiffness_proportional
from .coordinates import Marker, PlacedBodies
from .held import held_modes, place_rows, slope_rows

# An entry of the damping matrix below this fraction of the damping of its two modes is rounding.
_ROUNDED_ENTRY = 1e-9
# Squares of frequencies of the held body below this fraction of the largest one of its modes are rounding.
_ROUNDED_SQUARE = 1e-15


def damping_matrix(placed: PlacedBodies, name: str) -> Array:
    """Return the damping matrix of a body in its modal coordinates (nf, nf) [1/s].

    A matrix that is diagonal to rounding is returned exactly diagonal.

    Parameters
    ----------
    placed : PlacedBodies
        Bodies of the mechanism, whose joints hold the body.
    name : str
        Name of the body.

    Raises
    ------
    numpy.linalg.LinAlgError
        Frequencies of the held body are rounding.
    """
    body, described = placed.bodies[placed.index[name]], placed.mechanism.body(name)
    if isinstance(described, RigidBody) or described.damping is None or body.nf == 0:
        return np.zeros((body.nf, body.nf))
    squares = body.modes.omega**2
    beta = stiffness_proportional(described.damping)
    if beta is not None:
        return np.diag(beta * squares)
    held = np.array(list(_conditions(placed, name))).reshape(-1, 3 + body.nf)
    omega, modes = held_modes(body, held)
    if np.min(np.real(omega), initial=np.inf) ** 2 < _ROUNDED_SQUARE * np.max(np.real(squares)):
        raise np.linalg.LinAlgError("frequencies that are rounding")
    # Held modes are (nf, k), in coordinates with the stiffness diag(squares).
    lost = described.damping.coefficients(omega) / omega**2
    forces = squares[:, None] * modes / omega
    rest = lost[0] if lost.size else 0.0
    return _without_rounding((forces * (lost - rest)) @ forces.T + np.diag(rest * squares))


def _without_rounding(matrix: Numbers) -> Numbers:
    """Return the symmetric matrix with off-diagonal entries of the size of rounding set to zero."""
    sizes = np.sqrt(np.abs(np.real(np.diag(matrix))))
    small = np.abs(np.real(matrix)) <= _ROUNDED_ENTRY * np.outer(sizes, sizes)
    np.fill_diagonal(small, False)
    return np.where(small, 0.0, 0.5 * (matrix + matrix.T))


def _conditions(placed: PlacedBodies, name: str) -> Iterator[Numbers]:
    """Yield the conditions of a body's joints as rows on (r, phi, u), undeformed: see the module docstring."""
    mechanism = placed.mechanism
    pinned: list[Marker] = []
    across: list[Marker] = []
    driven = {prescribed.joint for prescribed in mechanism.prescribed}
    for joint in mechanism.joints:
        for here, there in ((joint.a, joint.b), (joint.b, joint.a)):
            if here.body != name or GROUND not in mechanism.reached(there.body, past=name):
                continue
            marker = placed.marker(here)
            turns_with = "angle" in joint.holds
            along_itself = joint.slides and not turns_with and here is joint.a
            if turns_with or (joint.name in driven and not joint.slides):
                yield from slope_rows(marker)
            if "points" in joint.holds or (joint.slides and joint.name in driven and not along_itself):
                pinned.append(marker)
            elif joint.slides and turns_with:
                angle = joint.direction if here is joint.a else joint.direction - joint.angle
                yield np.array([-np.sin(angle), np.cos(angle)]) @ place_rows(marker)
            elif "distance" in joint.holds or (joint.slides and not along_itself):
                across.append(marker)
    pinned.sort(key=lambda marker: np.real(marker.x0).tolist())
    if pinned:
        yield from place_rows(pinned[0])
    origin = pinned[0].x0 if pinned else None
    for marker in (*pinned[1:], *across):
        line = np.array([1.0, 0.0]) if origin is None else marker.x0 - origin
        if np.any(np.real(line)):
            yield np.array([-line[1], line[0]]) @ place_rows(marker)
