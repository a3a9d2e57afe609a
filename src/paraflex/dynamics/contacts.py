"""Correction of section moments of a beam for forces that slide along it, beyond its shape functions.

The transverse force P of a sliding joint is the multiplier of its normal row. Within an element the moment has a kink
at the position x_c of the force. The shape functions do not represent it, and a beam reduced to few modes represents
even less of it. The missing part is quasi-static: the exact moment of the load with the statically determinate supports
of the body frame, less that of the flexible coordinates which the force deflects, u = W(x_c) P / omega^2,

    dM(x) = P G(x, x_c) - E I(x) W''(x) u,    G = (x_c - x)_+ - S(x, x_c)

where S is the contribution of the supports: 0 for a clamped first end (cantilever), x_c (L - x) / L for two pins, and
for a free frame the moment of the inertia of the beam accelerated by P. dM vanishes at a node of a full mesh.

Bisplinghoff, Ashley (1962), Principles of Aeroelasticity, 9.2 (mode acceleration: the static response of all modes).
"""

from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array, Indices
from paraflex.fem import ReferenceCondition
from paraflex.mechanism import FlexibleBeam, Joint, Mechanism
from .coordinates import BodyCoordinates, element_at, transverse_pieces, transverse_rows
from .inertia_moments import inertia_moments
from .joint_coordinates import place_along_beam
from .system import System

# Two points integrate the cubic, an arm times an acceleration, exactly.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(2)
# Offset towards the middle of its element that puts a station at a node with a lump on one side of the node.
_INSIDE = 1e-12


class ContactLoad(NamedTuple):
    """Forces that slide along a beam.

    Attributes
    ----------
    place : (k, contacts) array
        Distance from the beam's first end [m].
    force : (k, contacts) array
        Force across the beam [N].
    deflected : (k, nf) array
        Quasi-static deflection by the forces, in flexible coordinates.
    """

    place: Array
    force: Array
    deflected: Array


class Contacts(NamedTuple):
    """Joints that slide along a beam, and the data of the beam for their moments.

    Attributes
    ----------
    beam : FlexibleBeam
        Beam as described.
    body : BodyCoordinates
        Coordinates of the beam.
    joints : tuple of str
        Names of the sliding joints.
    rows : tuple of int
        Number of the multiplier of each joint.
    pieces : (elements, 6, nf) array
        Transverse displacement W: see `transverse_pieces`.
    resisted : (elements, 8, nf) array
        Inertia moments R: see `inertia_moments`.
    stiffness : (elements,) array
        Bending stiffness E I [N m^2].
    """

    beam: FlexibleBeam
    body: BodyCoordinates
    joints: tuple[str, ...]
    rows: tuple[int, ...]
    pieces: Array
    resisted: Array
    stiffness: Array

    def at(self, system: System, q: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return positions along the beam [m] and transverse forces on it [N], each (k, contacts).

        The force is zero beyond the ends of the beam, where the position is that of the nearer end, and where its
        multiplier is NaN.
        """
        place = np.stack([place_along_beam(system, name, q) for name in self.joints], axis=1)
        force = multipliers[:, self.rows]
        off = (np.real(place) < 0.0) | (np.real(place) > np.real(self.beam.length))
        nearest = np.where(np.real(place) < 0.0, 0.0, self.beam.length)
        return np.where(off, nearest, place), np.where(off | np.isnan(force), 0.0, force)

    def inside(self, x: Array, element: Indices) -> Array:
        """Return positions (s,) moved slightly into their elements, on their side of a node."""
        nodes = self.beam.mesh.nodes
        return x + _INSIDE * (0.5 * (nodes[element] + nodes[element + 1]) - x)

    def load(self, system: System, q: Array, multipliers: Array) -> ContactLoad:
        """Return the contact loads at coordinates (k, n) with multipliers (k, m)."""
        place, force = self.at(system, q, multipliers)
        deflected = np.einsum("kcj,kc->kj", self._rows(place, 0), force) / self.body.modes.omega**2
        return ContactLoad(place, force, deflected)

    def moments(self, x: Array, load: ContactLoad) -> Array:
        """Return the moments (k, s) of the contact forces at positions x (k, s)."""
        return np.einsum("ksc,kc->ks", self.exact(x[:, :, None], load.place[:, None, :]), load.force)

    def between(self, x: Array, place: Array) -> tuple[Indices, Array]:
        """Return per position the index of the preceding station of x (s,), and the fraction of the way to the next."""
        nodes = self.beam.mesh.nodes
        count, element = len(x) // len(self.stiffness), element_at(nodes, place)
        z = (place - nodes[element]) / (nodes[element + 1] - nodes[element])
        left = element * count + np.clip((np.real(z) * (count - 1)).astype(int), 0, count - 2)
        return left, (place - x[left]) / (x[left + 1] - x[left])

    def moment(self, place: Array, u: Array, across: Array) -> Array:
        """Return moments (k, contacts) at positions, from coordinates (k, nf) and accelerations across the beam."""
        bending = self.stiffness[element_at(self.beam.mesh.nodes, place)][..., None] * self._rows(place, 2)
        resisted = transverse_rows(self.beam.mesh.nodes, self.resisted, place, 0)
        return np.einsum("kcj,kj->kc", bending, u) + np.einsum("kcj,kj->kc", resisted, across)

    def _rows(self, place: Array, derivative: int) -> Array:
        """Return W or a derivative at positions (k, contacts): (k, contacts, nf)."""
        return transverse_rows(self.beam.mesh.nodes, self.pieces, place, derivative)

    def exact(self, x: Array, place: Array) -> Array:
        """Return the moment G at x of a unit force at each position, supported as the frame; arrays broadcast."""
        arm = place - x
        moment = np.where(np.real(arm) > 0.0, arm, 0.0)
        if self.beam.reference is ReferenceCondition.PINNED:
            return moment - place * (1.0 - x / self.beam.length)
        if self.beam.reference is ReferenceCondition.FREE:
            return moment - self._inertia(x, place)
        return moment

    def _inertia(self, x: Array, place: Array) -> Array:
        """Return the moment at x of the inertia of the free beam under a unit force at each position."""
        beam, whole = self.beam, self.body.integrals
        centre = whole.S1[0] / whole.m
        turn = (place - centre) / (whole.I0 + whole.J - whole.m * centre**2)
        moment = np.zeros(np.broadcast_shapes(x.shape, place.shape), np.result_type(x, place, centre))
        knots = beam.mesh.knots
        for start, end, span in zip(knots, knots[1:], beam.spans, strict=False):
            begin = np.where(np.real(x) > np.real(start), np.where(np.real(x) < np.real(end), x, end), start)
            for point, weight in zip(0.5 * (_POINTS + 1.0), 0.5 * _WEIGHTS, strict=True):
                there = begin + point * (end - begin)
                accelerated = 1.0 / whole.m + turn * (there - centre)
                moment = moment + weight * (end - begin) * span.mass_per_length * (there - x) * accelerated
        for lump in beam.lumps:
            there = beam.mesh.nodes[beam.mesh.points[lump.point]]
            resists = lump.mass * (there - x) * (1.0 / whole.m + turn * (there - centre)) + lump.inertia * turn
            moment = moment + np.where(np.real(there) > np.real(x), resists, 0.0)
        return moment


def sliding_joints(mechanism: Mechanism, beam: str) -> list[Joint]:
    """Return the joints that slide along a beam."""
    return [one for one in mechanism.joints if one.follows_beam and one.a.body == beam]


def contacts_of(system: System, beam: FlexibleBeam) -> Contacts | None:
    """Return the contacts of a beam of a system; None if nothing slides along it."""
    joints = tuple(one.name for one in sliding_joints(system.mechanism, beam.name))
    if not joints:
        return None
    body, spans = system.body(beam.name), beam.spans
    rows = tuple(system.rows.index(f"{name} normal") for name in joints)
    stiffness = np.array([spans[span].bending_stiffness for span in beam.mesh.spans])
    return Contacts(beam, body, joints, rows, transverse_pieces(body), inertia_moments(beam, body), stiffness)
