"""Section forces and stresses along beams, from the shape functions of the element.

At a station of a beam the bending moment is M = E I w'' and the axial force N = E A u', from deformations in the body
frame. Linear axial shape functions make N constant within an element, correct on average. Its change within the element
follows from the inertia of its mass, N'(x) = rho A (a - g) . e_x, with the same mean:

    N(x) = E A u' + c(x) - 1/l int_0^l c dx,    c(x) = int_0^x rho A (a - g) . e_x dx

with the acceleration a of the centre line, s'' + phi'' E s - phi'^2 s + 2 phi' E s' + r''. In second-order geometry u
is the stretch of the centre line, so that N is that of the element; the shortening by bending is neglected in a.

Two corrections complete the moment: for the inertia of the deflection (`dynamics.inertia_moments`), and for the force
of a joint that slides along the beam (`dynamics.contacts`). The section under such a joint is an additional, moving
station.

Cook, Malkus, Plesha, Witt (2002), Concepts and Applications of Finite Element Analysis, 4th ed., 2.9 and 3.12 (loads
between nodes superposed on the results of nodal displacements).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array, Brief
from paraflex.fem import BeamMesh
from paraflex.mechanism import AssumedModesBeam, FlexibleBeam, Material, Section
from paraflex.mechanism.bodies import per_span
from .completed import Completion
from .contacts import Contacts, contacts_of
from .coordinates import BodyCoordinates, piece_rows
from .inertia_moments import inertia_moments
from .system import System

# Fewest pieces between stations: per beam, and per element. Under a uniform load the largest moment between two
# stations exceeds that at the stations by at most 1/256 of itself.
_BEAM_PIECES, _ELEMENT_PIECES = 16, 4
# Coordinates with less than this fraction of the stretch under uniform tension do not give the axial force.
_STRETCHES = 0.95


class SectionLoads(NamedTuple):
    """Loads of sections (k, stations and contacts), real or with a complex step, and properties of these sections.

    All stations come first, then the sections under each joint that slides along a beam.

    Attributes
    ----------
    moment : array
        Bending moment, positive if it bends the beam anticlockwise in the direction from its first end to its last [N
        m].
    force : array
        Axial force, positive in tension; NaN for beams whose coordinates do not stretch [N].
    x : array
        Distance from the beam's first end [m].
    area, modulus, strength : arrays
        Section and material properties: see `Sections`.
    """

    moment: Array
    force: Array
    x: Array
    area: Array
    modulus: Array
    strength: Array

    @property
    def stress(self) -> Array:
        """Largest magnitude of the stress in each section, |N| / A + |M| c / I [Pa].

        It is due to bending alone where the axial force is NaN; NaN where the outermost fibre is not known.
        """
        # fmax ignores NaN.
        return np.fmax(np.abs(self.force), 0.0) / np.real(self.area) + np.abs(self.moment) / np.real(self.modulus)


@dataclass(frozen=True)
class Sections(Brief):
    """Stations along the flexible beams of a system: on both sides of every node, and between nodes.

    Attributes
    ----------
    bodies : tuple of str
        Body of each station.
    contacts : mapping of str to str
        Body of each joint that slides along a beam, in the order of their sections.
    x : (s,) array
        Distance from the beam's first end [m].
    area, modulus : (s,) arrays
        Area [m^2] and section modulus I / c [m^3]; the latter is NaN where the outermost fibre is not known.
    strength : (s,) array
        Strength of the material, NaN where it is not known [Pa].
    parts : tuple
        Data of each beam for `loads`.
    completion : Completion, optional
        Completion of motions of reduced bodies, whose `parts` are those with all coordinates.
    """

    bodies: tuple[str, ...]
    contacts: Mapping[str, str]
    x: Array
    area: Array
    modulus: Array
    strength: Array
    parts: "tuple[_Beam, ...]"
    completion: Completion | None = None

    def loads(self, system: System, q: Array, v: Array, a: Array, multipliers: Array) -> SectionLoads:
        """Return the loads of sections for coordinates (k, n), their derivatives, and the multipliers (k, m)."""
        still, moving = [], []
        for part, found in self._parts_loads(system, q, v, a, multipliers):
            still.append(SectionLoads(*(each[:, : len(part.moment)] for each in found)))
            moving.append(SectionLoads(*(each[:, len(part.moment) :] for each in found)))
        return SectionLoads(*(np.concatenate(each, axis=1) for each in zip(*still, *moving, strict=True)))

    def largest_stress(self, system: System, q: Array, v: Array, a: Array, multipliers: Array) -> Array:
        """Return the largest stress in any section (k,) [Pa]; sections without a known outermost fibre do not count."""
        found = self._parts_loads(system, q, v, a, multipliers)
        return np.max([np.fmax.reduce(loads.stress, axis=1, initial=0.0) for _, loads in found], axis=0)

    def stress_errors(self, system: System, errors: Array) -> Iterator[tuple[str, float]]:
        """Yield beams with bounds of the errors of their stresses [Pa], from those of the coordinates (n,).

        A vibration's acceleration is off by its squared frequency times the error of its deflection.
        """
        if self.completion is not None:
            system, errors = self.completion.whole, self.completion.errors(errors)
        for part, own in self._parts_stations():
            body = system.body(part.body)
            off = np.concatenate([errors[body.flexible], body.modes.omega**2 * errors[body.flexible]])
            # Without an acceleration's part, rows have no columns for it.
            moment, force = (
                0.0 if rows is None else np.abs(rows[:, : off.size]) @ off[: rows.shape[1]]
                for rows in (part.moment, part.force)
            )
            yield part.body, float(np.max(moment / self.modulus[own] + force / self.area[own]))

    def _parts_loads(
        self, system: System, q: Array, v: Array, a: Array, multipliers: Array
    ) -> "Iterator[tuple[_Beam, SectionLoads]]":
        if self.completion is not None:
            q, v, a = self.completion(q, v, a, multipliers)
            system = self.completion.whole
        for part, own in self._parts_stations():
            sections = tuple(each[own] for each in (self.x, self.area, self.modulus, self.strength))
            yield part, _loads(system, part, sections, q, v, a, multipliers)

    def _parts_stations(self) -> "Iterator[tuple[_Beam, slice]]":
        first = 0
        for part in self.parts:
            yield part, slice(first, first := first + len(part.moment))

    @property
    def owners(self) -> tuple[str, ...]:
        """Body of each section of `loads`."""
        return (*self.bodies, *self.contacts.values())


class _Beam(NamedTuple):
    """Loads of a beam at its stations, linear in the features of its motion: see `_features`.

    Attributes
    ----------
    x : (s,) array
        Distance from the beam's first end [m].
    bars : sequence of Section and Material
        Section and material at each of these places.
    moment : (s, features) array
        Bending moment per feature.
    force : (s, features) array, optional
        Axial force per feature; None if the coordinates do not stretch.
    contacts : Contacts, optional
        Joints that slide along the beam.
    """

    body: str
    x: Array
    bars: Sequence[tuple[Section, Material]]
    moment: Array
    force: Array | None
    contacts: Contacts | None = None


def sections_of(system: System) -> Sections | None:
    """Return the stations of a system's flexible beams; None if there are none.

    Rigid and modal bodies have no section forces: their internal structure is not known.
    """
    return system.once("sections", lambda: _sections(system))


def _sections(system: System) -> Sections | None:
    if system.mechanism.bases:
        completion = Completion(system)
        found = _sections(completion.whole)
        return None if found is None else replace(found, completion=completion)
    parts = tuple(
        _stations(described, system)
        for described in system.mechanism.bodies
        if isinstance(described, FlexibleBeam | AssumedModesBeam) and system.body(described.name).nf
    )
    if not parts:
        return None
    bars = [bar for part in parts for bar in part.bars]
    return Sections(
        bodies=tuple(part.body for part in parts for _ in part.bars),
        x=np.concatenate([part.x for part in parts]),
        area=np.array([one.area for one, _ in bars]),
        modulus=np.array([np.nan if one.outer_fibre is None else one.second_moment / one.outer_fibre
                          for one, _ in bars]),
        strength=np.array([np.nan if made.strength is None else made.strength for _, made in bars]),
        contacts={joint: part.body for part in parts if part.contacts is not None for joint in part.contacts.joints},
        parts=parts,
    )  # fmt: skip


class SectionAt(NamedTuple):
    """A section of a flexible beam, at a position (1,) slightly inside its element."""

    part: _Beam
    place: Array

    def loads(self, system: System, q: Array, v: Array, a: Array, multipliers: Array) -> tuple[Array, Array]:
        """Return bending moment and axial force (k,) for coordinates (k, n), their derivatives, and multipliers.

        The multipliers are those of joints sliding along the beam only, one for each of `sliding_joints`.
        """
        body, part, added = system.body(self.part.body), self.part, 0.0
        if part.contacts is not None:
            load = part.contacts.load(system, q, multipliers)
            added = part.contacts.moments(np.broadcast_to(self.place, (len(q), 1)), load)
            added = added - load.deflected @ part.moment[:, : body.nf].T
        moment, force = _linear_loads(part, _features(system, body, q, v, a))
        return (moment + added)[:, 0], force[:, 0]


def section_at(system: System, name: str, x: float) -> SectionAt | None:
    """Return the section of a beam at a distance from its first end, at a node in the next element; None if rigid."""
    described, body, place = system.mechanism.body(name), system.body(name), np.array([x])
    assert isinstance(described, FlexibleBeam | AssumedModesBeam)
    if not body.nf:
        return None
    if isinstance(described, AssumedModesBeam):
        return SectionAt(_assumed(described, body, place), place)
    nodes = described.mesh.nodes
    # A position at a node up to rounding is at the node.
    e = int(np.clip(np.searchsorted(nodes, x + 1e-12 * nodes[-1], side="right") - 1, 0, nodes.size - 2))
    z = min(max((x - nodes[e]) / (nodes[e + 1] - nodes[e]), 0.0), 1.0)
    part = _meshed(described, body, [z], slice(e, e + 1))
    contacts = contacts_of(system, described)
    if contacts is not None:
        place = contacts.inside(place, np.array([e]))
        part = part._replace(contacts=contacts._replace(rows=tuple(range(len(contacts.rows)))))
    return SectionAt(part, place)


def _stations(described: FlexibleBeam | AssumedModesBeam, system: System) -> _Beam:
    """Return the data of a beam at its stations."""
    body = system.body(described.name)
    if isinstance(described, FlexibleBeam):
        mesh = described.mesh
        pieces = max(_ELEMENT_PIECES, -(-_BEAM_PIECES // mesh.n_elements))
        at = np.linspace(0.0, 1.0, pieces + 1).tolist()
        # Equal beams share integrals and with them all but what their strength depends on.
        part = system.once(("stations", id(body.integrals)), lambda: _meshed(described, body, at))
        return part._replace(body=body.name, bars=_bars(described, len(at)), contacts=contacts_of(system, described))
    pieces = max(_BEAM_PIECES, _ELEMENT_PIECES * described.shapes.count)
    return _assumed(described, body, np.linspace(0.0, 1.0, pieces + 1) * described.length)


def _assumed(described: AssumedModesBeam, body: BodyCoordinates, x: Array) -> _Beam:
    """Return the data of a bar of assumed modes at positions x (s,)."""
    D, shapes, bent = body.integrals.D, described.shapes, len(described.transverse)
    E = described.material.youngs_modulus
    moment = E * described.section.second_moment * shapes.transverse_rows(x, derivative=2) @ D[:bent]
    strain = shapes.axial_rows(x, derivative=1) @ D[bent:]
    ends = shapes.axial_rows(np.array([0.0, 1.0]) * described.length) @ D[bent:]
    stiffness = E * described.section.area
    force = stiffness * strain if _stretches(body, ends[1] - ends[0], described.length / stiffness) else None
    return _Beam(body.name, x, [(described.section, described.material)] * x.size, moment, force)


def _meshed(beam: FlexibleBeam, body: BodyCoordinates, fractions: Sequence[float], which: slice = slice(None)) -> _Beam:
    """Return the data of a beam at fractions of its elements, or of some of them, without contacts."""
    mesh, D, spans = beam.mesh, body.integrals.D, beam.spans
    elements, count = np.arange(mesh.n_elements)[which], len(fractions)
    first, last = (mesh.shape_at_node(node)[0][0] @ D for node in (0, mesh.n_elements))
    bend, stretch, mass = (
        np.array([getattr(spans[span], name) for span in mesh.spans])
        for name in ("bending_stiffness", "axial_stiffness", "mass_per_length")
    )
    lengths = np.diff(mesh.nodes)
    z = np.array(fractions) * lengths[elements, None]
    curvature = mesh.transverse_at(fractions, 2)[which] @ D
    resisted = piece_rows(inertia_moments(beam, body), np.repeat(elements, count), z.ravel())
    part = _Beam(
        body.name, (mesh.nodes[elements, None] + z).ravel(), _bars(beam, count, which),
        np.hstack([(bend[elements, None, None] * curvature).reshape(z.size, -1), resisted]), None,
    )  # fmt: skip
    if not _stretches(body, last - first, np.sum(lengths / stretch)):
        return part
    strain = stretch[elements, None, None] * (mesh.axial_at(fractions, 1)[which] @ D)
    change = (mass[elements, None, None] * _change(mesh, D, fractions)[which]).reshape(z.size, -1)
    return part._replace(force=np.hstack([strain.reshape(z.size, -1), change]))


def _bars(beam: FlexibleBeam, count: int, which: slice = slice(None)) -> list[tuple[Section, Material]]:
    """Return section and material of a beam at so many places of each element, or of some of them."""
    mesh = beam.mesh
    sections = per_span(beam.section, mesh.n_spans, "section")
    materials = per_span(beam.material, mesh.n_spans, "material")
    return [(sections[span], materials[span]) for span in np.repeat(mesh.spans[which], count)]


def _stretches(body: BodyCoordinates, lengthened: Array, flexibility: float) -> bool:
    """Return whether the coordinates represent uniform tension: their compliance against the beam's."""
    part = np.sum(np.real(lengthened / body.modes.omega) ** 2)
    return bool(part >= _STRETCHES * np.real(flexibility))


def _change(mesh: BeamMesh, D: Array, fractions: Sequence[float]) -> Array:
    """Return c per mass per length and feature, less its mean over the element: (elements, fractions, features)."""
    nodes, lengths, z = mesh.nodes[:-1, None, None], np.diff(mesh.nodes)[:, None, None], np.array(fractions)[:, None]
    along, across = (
        (shape(fractions, -1) - shape((1.0,), -2) / lengths) @ D for shape in (mesh.axial_at, mesh.transverse_at)
    )
    place = nodes * lengths * (z - 0.5) + lengths**2 * (0.5 * z**2 - 1.0 / 6.0)
    return np.concatenate([along, -across, lengths * (z - 0.5), -place], axis=2)


def _features(system: System, body: BodyCoordinates, q: Array, v: Array, a: Array) -> Array:
    """Return the features of a beam's motion (k, 3 nf + 2) on which the loads of its sections depend linearly.

    These are the coordinates u, the accelerations u'' - phi'^2 u and phi'' u + 2 phi' u' of the deflection, that of the
    origin along the beam, less gravity, and phi'^2.
    """
    phi, w, dw = q[:, body.angle], v[:, body.angle, None], a[:, body.angle, None]
    u, du, ddu = (x[:, body.flexible] for x in (q, v, a))
    pulled = a[:, body.position] - np.array(system.mechanism.gravity)
    frame = np.cos(phi) * pulled[:, 0] + np.sin(phi) * pulled[:, 1]
    return np.hstack([u, ddu - w**2 * u, dw * u + 2.0 * w * du, frame[:, None], w**2])


def _linear_loads(part: _Beam, features: Array) -> tuple[Array, Array]:
    """Return moment and axial force (k, s) at a beam's stations, without those of joints that slide along it."""
    moment = features[:, : part.moment.shape[1]] @ part.moment.T
    if part.force is None:
        return moment, np.full(moment.shape, np.nan)
    return moment, features[:, : part.force.shape[1]] @ part.force.T


def _loads(
    system: System, part: _Beam, sections: Sequence[Array], q: Array, v: Array, a: Array, multipliers: Array
) -> SectionLoads:
    """Return the loads of a beam's stations, then of its sections under joints that slide along it."""
    x, *kinds = (np.broadcast_to(each, (len(q), each.size)) for each in sections)
    body, contacts = system.body(part.body), part.contacts
    features = _features(system, body, q, v, a)
    moment, force = _linear_loads(part, features)
    if contacts is None:
        return SectionLoads(moment, force, x, *kinds)
    load, nf = contacts.load(system, q, multipliers), body.nf
    place = load.place
    # Deflection without the quasi-static part of the contact forces, whose exact moments are added instead.
    moment = moment - load.deflected @ part.moment[:, :nf].T
    moment = np.hstack([moment, contacts.moment(place, features[:, :nf] - load.deflected, features[:, nf : 2 * nf])])
    elements = np.repeat(np.arange(len(contacts.stiffness)), len(sections[0]) // len(contacts.stiffness))
    inside = contacts.inside(sections[0], elements)
    moment += contacts.moments(np.hstack([np.broadcast_to(inside, x.shape), place]), load)
    left, weight = contacts.between(sections[0], place)
    before, after = (np.take_along_axis(force, at, 1) for at in (left, left + 1))
    kinds = [np.hstack([each, np.take_along_axis(each, left, 1)]) for each in kinds]
    force = np.hstack([force, (1.0 - weight) * before + weight * after])
    return SectionLoads(moment, force, np.hstack([x, place]), *kinds)
