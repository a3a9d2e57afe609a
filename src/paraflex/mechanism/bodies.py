"""Bodies: rigid ones, flexible beams and bars of assumed modes. Points are named and lie in the body frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import TypeVar

from paraflex.arguments import CheckedFields, given_as
from paraflex.errors import InputError
from paraflex.fem import (
    AssumedShapes,
    BeamMesh,
    PlacedLump,
    ReferenceCondition,
    ShapeFunction,
    ShapeIntegrals,
    SpanProperties,
    assumed_integrals,
    mesh_beam,
)
from paraflex.mechanism.damping import Damping
from paraflex.mechanism.modal import DeformableBody, ModalBody
from paraflex.mechanism.quantities import finite, in_unit, not_negative, positive
from paraflex.mechanism.sections import Section

T = TypeVar("T")
_ROD = ' (a rod without mass between two pins is a joint of type = "distance")'


@dataclass(frozen=True)
class Material(CheckedFields):
    """Linear elastic material.

    Attributes
    ----------
    youngs_modulus : float
        [Pa]
    density : float
        [kg/m^3]
    strength : float, optional
        Largest stress that it bears, for instance its yield strength [Pa]; safety factors are over it.
    """

    _table = "material"

    youngs_modulus: float = field(metadata=in_unit(positive, "Pa"))
    density: float = field(metadata=in_unit(positive, "kg/m^3"))
    strength: float | None = field(default=None, metadata=in_unit(positive, "Pa"))


class Curvature(Enum):
    """Continuity of a beam's curvature at a node with a lumped moment of inertia, where the true one jumps.

    SHARED
        The paper's element: one value for both sides, zero at the tip. Converges with the first power of the element
        there.
    SEPARATE
        A value on either side of such a node, and a free one at the tip, where a weld, a motor or a lump may bring in
        a moment. Converges with the eighth power; one coordinate more for each such node and for the tip.
    """

    SHARED = "shared"
    SEPARATE = "separate"


class BodyReduction(Enum):
    """Shapes that a beam keeps of all that its elements can have.

    MODAL
        The lowest modes in its frame. Where the frame does not clamp the beam they carry no moment there: too stiff at
        motors, springs and welds, unless many are kept.
    CRAIG_BAMPTON
        What forces at its points bend it to, static shapes of the coordinates that joints, motors, springs, loads and
        lumps act on, and the lowest modes with these coordinates held (Craig and Bampton 1968). The same in every
        reference condition.
    """

    MODAL = "modal"
    CRAIG_BAMPTON = "craig-bampton"


@dataclass(frozen=True)
class LumpedMass(CheckedFields):
    """A mass [kg] and moment of inertia [kg m^2] at a named point of a beam."""

    _table = "lump"

    point: str
    mass: float = field(metadata=in_unit(not_negative, "kg"))
    inertia: float = field(default=0.0, metadata=in_unit(not_negative, "kg m^2"))


@dataclass(frozen=True)
class RigidBody(CheckedFields):
    """A rigid body.

    Attributes
    ----------
    name : str
    mass : float
        [kg]
    inertia : float
        About the centre of mass [kg m^2].
    centre_of_mass : (x, y)
        In the body frame [m].
    points : mapping
        Named points in the body frame [m].
    """

    _table = "body"

    name: str
    mass: float = field(metadata=in_unit(positive, f"kg{_ROD}"))
    inertia: float = field(metadata=in_unit(positive, f"kg m^2{_ROD}"))
    centre_of_mass: tuple[float, float] = field(default=(0.0, 0.0), metadata={"check": finite})
    points: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class FlexibleBeam(DeformableBody):
    """A straight flexible beam along the x axis of its body frame, which starts at its first end.

    Attributes
    ----------
    name : str
    length : float
        [m]
    section : Section or tuple of Section
        One for the whole beam, or one per span between neighbouring points and ends.
    material : Material or tuple of Material
        Likewise.
    points : mapping
        Distance of each named point from the first end [m]; every one becomes a node.
    elements : int or tuple of int, optional
        Elements per span between neighbouring points and ends. By default 1, and where a joint of a mechanism slides
        along the beam so many that none is longer than a third of the beam (`mechanism.tracks`).
    lumps : tuple of LumpedMass
    reference : ReferenceCondition or str
        How the floating frame is fixed to the beam. Pinned by default: deflections count from the chord, and stay small
        where those from a tangent do not. The paper's is the cantilever.
    curvature : Curvature or str
        At nodes with a lumped moment of inertia, and at the tip. Separate by default; the paper's is shared. Where
        sections of different bending stiffness meet there is always one on either side.
    modes : int, optional
        Modes of lowest frequency kept as flexible coordinates; all by default.
    reduction : BodyReduction or str
        Of which kind these are: "modal", in its frame; or "craig-bampton", with the points held that something acts on,
        beside the static shapes of these.
    damping : RayleighDamping or ModalDamping, optional
        Of its material; none by default.
    flexible : bool
        False holds all flexible coordinates at zero: the same inertia, rigid.
    frames : int
        Floating frames of equal length, joined rigidly (`mechanism.frames`): with more of them large deflections
        converge to the exact beam. Results see one beam.
    """

    name: str
    length: float
    section: Section | tuple[Section, ...]
    material: Material | tuple[Material, ...]
    points: Mapping[str, float] = field(default_factory=dict)
    elements: int | tuple[int, ...] | None = None
    lumps: tuple[LumpedMass, ...] = ()
    reference: ReferenceCondition = ReferenceCondition.PINNED
    curvature: Curvature = Curvature.SEPARATE
    modes: int | None = None
    damping: Damping | None = None
    flexible: bool = True
    frames: int = 1
    reduction: BodyReduction = BodyReduction.MODAL

    @cached_property
    def mesh(self) -> BeamMesh:
        """Elements and nodes of the beam.

        Raises
        ------
        InputError
            See `fem.mesh_beam` and `spans`.
        """
        mesh = mesh_beam(self.length, self.points, self.counts)
        spans = self._spans_of(mesh)
        stiffness = [spans[span].bending_stiffness for span in mesh.spans]
        # At a step of E I the moment is continuous: a shared curvature would be wrong on one side at least.
        separate = {node for node in range(1, mesh.n_elements) if stiffness[node - 1] != stiffness[node]}
        if self.curvature is Curvature.SEPARATE:
            separate |= {mesh.points[lump.point] for lump in self.lumps if lump.inertia > 0.0} | {mesh.n_elements}
        return mesh.with_separate_curvature(separate)

    @property
    def spans(self) -> tuple[SpanProperties, ...]:
        """Mass and stiffness of every span.

        Raises
        ------
        InputError
            A number of sections or materials that is not that of the spans.
        """
        return self._spans_of(mesh_beam(self.length, self.points, self.counts))

    @property
    def counts(self) -> int | tuple[int, ...]:
        """Elements per span, 1 where they are not given."""
        return 1 if self.elements is None else self.elements

    def _spans_of(self, mesh: BeamMesh) -> tuple[SpanProperties, ...]:
        sections = _per_span(self.section, mesh.n_spans, "section")
        materials = _per_span(self.material, mesh.n_spans, "material")
        return tuple(map(span_properties, sections, materials))


def span_properties(section: Section, material: Material) -> SpanProperties:
    """Mass and stiffness of a bar of one section and material."""
    return SpanProperties(
        mass_per_length=material.density * section.area,
        axial_stiffness=material.youngs_modulus * section.area,
        bending_stiffness=material.youngs_modulus * section.second_moment,
    )


def _per_span(value: T | tuple[T, ...], count: int, field: str) -> tuple[T, ...]:
    if not isinstance(value, tuple):
        return (value,) * count
    if len(value) != count:
        raise InputError(
            f"the beam has {count} span(s) between its points and ends",
            field=field,
            value=len(value),
            remedy=f"give one {field} for all spans or one per span",
        )
    return value


@dataclass(frozen=True)
class AssumedModesBeam(DeformableBody):
    """A straight bar along the x axis of its body frame with shape functions of the user's choice.

    The functions fix the frame: they must contain no rigid motion of the bar. Its geometry is linear, whatever that of
    the mechanism.

    Attributes
    ----------
    name : str
    length : float
        [m]
    section : Section
    material : Material
    transverse : tuple of ShapeFunction
        Of x/L, `Sine` or `Polynomial`: transverse displacement per coordinate.
    axial : tuple of ShapeFunction
        Axial displacement per coordinate; none for a bar that does not stretch.
    points : mapping
        Distance of each named point from the first end [m].
    lumps : tuple of LumpedMass
    modes : int, optional
        Modes of lowest frequency kept as flexible coordinates; all by default.
    damping : RayleighDamping or ModalDamping, optional
        Of its material; none by default.
    flexible : bool
        False holds all flexible coordinates at zero: the same inertia, rigid.
    """

    name: str
    length: float
    section: Section
    material: Material
    transverse: tuple[ShapeFunction, ...] = ()
    axial: tuple[ShapeFunction, ...] = ()
    points: Mapping[str, float] = field(default_factory=dict)
    lumps: tuple[LumpedMass, ...] = ()
    modes: int | None = None
    damping: Damping | None = None
    flexible: bool = True

    @property
    def shapes(self) -> AssumedShapes:
        """Shape functions of the bar."""
        return AssumedShapes(self.length, self.transverse, self.axial)

    @property
    def integrals(self) -> ShapeIntegrals:
        """Shape integrals of the bar.

        Raises
        ------
        InputError
            See `fem.assumed_integrals`.
        """
        lumps = [PlacedLump(self.points[lump.point], lump.mass, lump.inertia) for lump in self.lumps]
        return assumed_integrals(self.shapes, span_properties(self.section, self.material), lumps)

    @property
    def n_flexible(self) -> int:
        """Number of flexible coordinates before any reduction."""
        return self.shapes.count


Body = RigidBody | FlexibleBeam | AssumedModesBeam | ModalBody
given_as("a body")(Body)


def given_shapes(bodies: Iterable[Body]) -> list[str]:
    """Names of the flexible bodies with shapes given by the user, which have no mesh to refine."""
    return [body.name for body in bodies if isinstance(body, AssumedModesBeam | ModalBody) and body.flexible]
