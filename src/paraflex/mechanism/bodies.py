"""Rigid bodies, flexible beams and bars of assumed modes, with named points in the body frame."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import TypeVar

from paraflex.arguments import CheckedFields, named_in_errors
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
from .damping import Damping
from .modal import DAMPING, MODES, DeformableBody, ModalBody
from .quantities import field_metadata, finite, not_negative, optional, positive
from .sections import Section

T = TypeVar("T")
_LENGTH = field_metadata("the length in m", positive)
_POINTS = "the distance of each named point from the start in m"
_LUMPS = "the name of a [lump.NAME] table for each point"


@dataclass(frozen=True)
class Material(CheckedFields):
    """Linear elastic material.

    Attributes
    ----------
    youngs_modulus : float
        Young's modulus [Pa].
    density : float
        Density [kg/m^3].
    strength : float, optional
        Admissible stress, such as the yield strength [Pa]; safety factors are relative to it.
    """

    _table = "material"

    youngs_modulus: float = field(metadata=field_metadata("Young's modulus in Pa", positive))
    density: float = field(metadata=field_metadata("the density in kg/m^3", positive))
    strength: float | None = optional(None, "the largest admissible stress in Pa", positive)


class Curvature(Enum):
    """Continuity of a beam's curvature at a node with a lumped moment of inertia, where the exact curvature jumps.

    SHARED
        The paper's element: one value for both sides of the node, zero at the tip. Convergence is of first order in
        the element length at such nodes.
    SEPARATE
        One value on either side of such a node, and a free value at the tip, where a weld, a motor or a lump may apply
        a moment. Convergence is of eighth order, with one more coordinate for each such node and for the tip.
    """

    SHARED = "shared"
    SEPARATE = "separate"


class ComponentModes(Enum):
    """Component modes that a beam keeps as its flexible coordinates (component mode synthesis).

    MODAL
        Lowest modes in the beam's frame. They have no moment at an end that the frame does not clamp, so the beam is
        too stiff at motors, springs and welds there unless many modes are retained.
    CRAIG_BAMPTON
        Static shapes of the coordinates that joints, motors, springs, loads and lumps act on, and the lowest modes with
        these coordinates held (Craig and Bampton 1968). The result is the same in every reference condition.
    """

    MODAL = "modal"
    CRAIG_BAMPTON = "craig-bampton"


@dataclass(frozen=True)
class LumpedMass(CheckedFields):
    """Lumped mass [kg] and moment of inertia [kg m^2] at a named point of a beam."""

    _table = "lump"

    point: str
    mass: float = field(metadata=field_metadata("the mass in kg", not_negative))
    inertia: float = optional(0.0, "the moment of inertia in kg m^2", not_negative)


@dataclass(frozen=True)
class RigidBody(CheckedFields):
    """Rigid body.

    Attributes
    ----------
    name : str
        Name of the body.
    mass : float
        Mass [kg]; by default none, which is enough for kinematics and drawings.
    inertia : float
        Moment of inertia about the centre of mass [kg m^2].
    centre_of_mass : (x, y)
        Centre of mass in the body frame [m]; the origin by default.
    points : mapping
        Named points in the body frame [m].
    """

    _table = "body"

    name: str
    mass: float = optional(0.0, "the mass in kg, which kinematics does without")
    inertia: float = optional(
        0.0, "the moment of inertia about the centre of mass in kg m^2, which kinematics does without"
    )
    centre_of_mass: tuple[float, float] = optional((0.0, 0.0), "[x, y] in the body frame in m", finite)
    points: Mapping[str, tuple[float, float]] = optional({}, "[x, y] of each named point in the body frame in m")


@dataclass(frozen=True)
class FlexibleBeam(DeformableBody):
    """Straight flexible beam along the x axis of its body frame, with the first end at the origin.

    Attributes
    ----------
    name : str
        Name of the body.
    length : float
        Length [m].
    section : Section or tuple of Section
        Cross-section of the whole beam, or one per span between neighbouring points and ends.
    material : Material or tuple of Material
        Material of the whole beam, or one per span.
    points : mapping
        Distance of each named point from the first end [m]; every point becomes a node.
    elements : int or tuple of int, optional
        Number of elements per span between neighbouring points and ends, for all spans or each. By default 1; on a
        beam that a joint slides along as many as keep each element below a third of the beam (`mechanism.tracks`).
    lumps : tuple of LumpedMass
        Lumped masses at named points.
    reference : ReferenceCondition or str
        Reference condition, which attaches the floating frame to the beam. Pinned by default: deflections are measured
        from the chord, where they are smaller than from a tangent. The paper uses the cantilever condition.
    curvature : Curvature or str
        Continuity of the curvature at nodes with a lumped moment of inertia and at the tip. Separate by default, shared
        in the paper. Curvature is always separate where sections of different bending stiffness meet.
    modes : int, optional
        Number of modes of lowest frequency retained as flexible coordinates; all by default.
    reduction : ComponentModes or str
        Kind of the retained modes: "modal" for modes in the beam's frame (default), or "craig-bampton" for modes with
        the loaded points held, in addition to the static shapes of these points.
    damping : RayleighDamping, ModalDamping or LossFactor, optional
        Structural damping; none by default.
    flexible : bool
        False holds all flexible coordinates at zero: a rigid beam of the same inertia.
    frames : int
        Number of floating frames of equal length, welded together (`mechanism.segments`), by default 1. With more
        frames large deflections converge to those of the exact beam. Results describe a single beam.
    """

    name: str
    length: float = field(metadata=_LENGTH)
    section: Section | tuple[Section, ...] = field(
        metadata=field_metadata("the name of a [section.NAME] table, or one per span")
    )
    material: Material | tuple[Material, ...] = field(
        metadata=field_metadata("the name of a [material.NAME] table, or one per span")
    )
    points: Mapping[str, float] = optional({}, _POINTS)
    elements: int | tuple[int, ...] | None = optional(
        None,
        "elements per span, one number or one per span; by default 1, and where a joint slides along the beam enough "
        "that none is longer than a third of it",
    )
    lumps: tuple[LumpedMass, ...] = optional((), _LUMPS)
    reference: ReferenceCondition = optional(
        ReferenceCondition.PINNED,
        'how its frame is fixed to the beam: "pinned", "cantilever" or "free"; the model\'s by default',
    )
    curvature: Curvature = optional(
        Curvature.SEPARATE,
        'curvature at lumped moments of inertia: "separate" or "shared"; the model\'s by default',
    )
    modes: int | None = optional(None, MODES)
    damping: Damping | None = optional(None, DAMPING)
    flexible: bool = optional(True, "false for a rigid beam")
    frames: int = optional(
        1, "the number of floating frames of equal length, joined rigidly: more for large deflections"
    )
    reduction: ComponentModes = optional(
        ComponentModes.MODAL,
        'the reduction basis with modes: "modal", modes in its frame; "craig-bampton", modes with its joints held, '
        "and static shapes of these",
    )

    @cached_property
    def mesh(self) -> BeamMesh:
        """Mesh of the beam.

        Raises
        ------
        InputError
            See `fem.mesh_beam` and `spans`.
        """
        mesh = mesh_beam(self.length, self.points, self.counts)
        spans = self._spans_of(mesh)
        stiffness = [spans[span].bending_stiffness for span in mesh.spans]
        # The moment is continuous at a step of E I, so a shared curvature would be wrong on one side at least.
        separate = {node for node in range(1, mesh.n_elements) if stiffness[node - 1] != stiffness[node]}
        if self.curvature is Curvature.SEPARATE:
            separate |= {mesh.points[lump.point] for lump in self.lumps if lump.inertia > 0.0} | {mesh.n_elements}
        return mesh.with_separate_curvature(separate)

    @cached_property
    def spans(self) -> tuple[SpanProperties, ...]:
        """Mass and stiffness of every span.

        Raises
        ------
        InputError
            The number of sections or materials differs from the number of spans.
        """
        return self._spans_of(mesh_beam(self.length, self.points, self.counts))

    @property
    def counts(self) -> int | tuple[int, ...]:
        """Number of elements per span, 1 if it is not given."""
        return 1 if self.elements is None else self.elements

    def _spans_of(self, mesh: BeamMesh) -> tuple[SpanProperties, ...]:
        sections = per_span(self.section, mesh.n_spans, "section")
        materials = per_span(self.material, mesh.n_spans, "material")
        return tuple(map(span_properties, sections, materials))


def span_properties(section: Section, material: Material) -> SpanProperties:
    """Return mass and stiffness of a bar of one section and material."""
    return SpanProperties(
        mass_per_length=material.density * section.area,
        axial_stiffness=material.youngs_modulus * section.area,
        bending_stiffness=material.youngs_modulus * section.second_moment,
    )


def per_span(value: T | tuple[T, ...], count: int, field: str) -> tuple[T, ...]:
    """Return one value per span, from one for all of them or one for each."""
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
    """Straight bar along the x axis of its body frame with user-defined shape functions.

    The functions define the frame, so they must not contain a rigid motion of the bar. The geometry of the bar is
    linear, whatever the geometry of the mechanism.

    Attributes
    ----------
    name : str
        Name of the body.
    length : float
        Length [m].
    section : Section
        Cross-section of the bar.
    material : Material
        Material of the bar.
    transverse : tuple of ShapeFunction
        Transverse displacement per coordinate, `Sine` or `Polynomial` in x/L.
    axial : tuple of ShapeFunction
        Axial displacement per coordinate, `Sine` or `Polynomial` in x/L; none for an inextensible bar (default).
    points : mapping
        Distance of each named point from the first end [m].
    lumps : tuple of LumpedMass
        Lumped masses at named points.
    modes : int, optional
        Number of modes of lowest frequency retained as flexible coordinates; all by default.
    damping : RayleighDamping, ModalDamping or LossFactor, optional
        Structural damping; none by default.
    flexible : bool
        False holds all flexible coordinates at zero: a rigid bar of the same inertia.
    """

    name: str
    length: float = field(metadata=_LENGTH)
    section: Section = field(metadata=field_metadata("the name of a [section.NAME] table"))
    material: Material = field(metadata=field_metadata("the name of a [material.NAME] table"))
    transverse: tuple[ShapeFunction, ...] = ()
    axial: tuple[ShapeFunction, ...] = ()
    points: Mapping[str, float] = optional({}, _POINTS)
    lumps: tuple[LumpedMass, ...] = optional((), _LUMPS)
    modes: int | None = optional(None, MODES)
    damping: Damping | None = optional(None, DAMPING)
    flexible: bool = optional(True, "false for a rigid bar")

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
# Kinds of bodies by their names in files.
BODY_KINDS: dict[str, type[Body]] = {
    "beam": FlexibleBeam, "rigid": RigidBody, "assumed-modes": AssumedModesBeam, "modal": ModalBody
}  # fmt: skip
named_in_errors("a body")(Body)


def given_shapes(bodies: Iterable[Body]) -> list[str]:
    """Return the names of the flexible bodies with user-defined shapes, which have no mesh to refine."""
    return [body.name for body in bodies if isinstance(body, AssumedModesBeam | ModalBody) and body.flexible]
