"""The damping matrix of a flexible body: that of its modes with its joints held, in the coordinates of its frame.

Damping ratios belong to a vibration, and how a body vibrates is a matter of how it is held, not of the frame that its
deformation is described in. Its points are held as its joints hold them, the bodies on their other sides at rest:

- a revolute joint holds the point, a weld the slope there too, and so does a prescribed angle;
- a rail (prismatic joint) holds the slope and what is normal to the rail, with a prescribed travel all;
- a pin in another body's slot or on another beam is held across the body, and in both directions if prescribed;
- the pin of a rod without mass (distance joint) is held across the body;
- only the first of several points held in both directions is held along the line to the others: joints are not so far
  apart by force that a bar could not stretch;
- nothing is held by what slides along the body itself, by motors, springs, dampers or gears, or by a joint to bodies
  that reach the ground through this body alone: what hangs on it.

With the mass-normalised modes psi_k of the body so held, at rest and undeformed, their frequencies omega_k and damping
coefficients d_k,

    D = sum_k (d_k / omega_k^4) (K psi_k) (K psi_k)^T + c K_rest,   c = d_1 / omega_1^2,

K_rest being the stiffness that no psi_k has a share in: that of the static shapes which its joints force upon a body
that is held by more than it needs to be. K psi_k is a force, to which rigid motion is nothing: D is the same matrix of
the deformation in every frame.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from paraflex.arrays import Array, Numbers
from paraflex.dynamics.coordinates import BodyCoordinates, Marker, make_marker
from paraflex.dynamics.held import held_modes, place_rows, slope_rows
from paraflex.mechanism import GROUND, Mechanism, RigidBody, stiffness_proportional

# An entry of the damping matrix below this fraction of the damping of its two modes is rounding.
_ROUNDED_ENTRY = 1e-9


def damping_matrix(
    mechanism: Mechanism, bodies: tuple[BodyCoordinates, ...], index: dict[str, int], name: str
) -> Array:
    """Damping matrix of a body in its modal coordinates (nf, nf) [1/s], exactly diagonal if it is so to rounding.

    Parameters
    ----------
    mechanism : Mechanism
    bodies : tuple of BodyCoordinates
    index : dict
        Number of each body by name.
    name : str
    """
    body, described = bodies[index[name]], mechanism.body(name)
    if isinstance(described, RigidBody) or described.damping is None or body.nf == 0:
        return np.zeros((body.nf, body.nf))
    squares = body.modes.omega**2
    beta = stiffness_proportional(described.damping)
    if beta is not None:
        return np.diag(beta * squares)
    held = np.array(list(_conditions(mechanism, bodies, index, name))).reshape(-1, 3 + body.nf)
    omega, modes = held_modes(body, held)
    # Of the held modes (nf, k), in coordinates with stiffness diag(squares).
    lost = described.damping.coefficients(omega) / omega**2
    forces = squares[:, None] * modes / omega
    rest = lost[0] if lost.size else 0.0
    return _without_rounding((forces * (lost - rest)) @ forces.T + np.diag(rest * squares))


def _without_rounding(matrix: Numbers) -> Numbers:
    """The symmetric matrix, with zeros for off-diagonal entries of the size of rounding."""
    sizes = np.sqrt(np.abs(np.real(np.diag(matrix))))
    small = np.abs(np.real(matrix)) <= _ROUNDED_ENTRY * np.outer(sizes, sizes)
    np.fill_diagonal(small, False)
    return np.where(small, 0.0, 0.5 * (matrix + matrix.T))


def _conditions(
    mechanism: Mechanism, bodies: tuple[BodyCoordinates, ...], index: dict[str, int], name: str
) -> Iterator[Numbers]:
    """Conditions of a body's joints as rows on (r, phi, u) of the undeformed body: see the module."""
    pinned: list[Marker] = []
    across: list[Marker] = []
    driven = {prescribed.joint for prescribed in mechanism.prescribed}
    for joint in mechanism.joints:
        for here, there in ((joint.a, joint.b), (joint.b, joint.a)):
            if here.body != name or GROUND not in mechanism.reached(there.body, past=name):
                continue
            marker = make_marker(mechanism, bodies, index, here)
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
