"""Bodies: rigid ones and flexible beams. Points are named and lie in the body frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from paraflex.fem import BeamMesh, ReferenceCondition, mesh_beam


@dataclass(frozen=True)
class Section:
    """Cross-section of a beam.

    Attributes
    ----------
    area : float
        [m^2]
    second_moment : float
        Of area, about the axis normal to the plane of motion [m^4].
    """

    area: float
    second_moment: float

    @classmethod
    def rectangle(cls, width: float, thickness: float) -> Section:
        """A rectangle: width out of the plane of motion, thickness in it [m]."""
        return cls(area=width * thickness, second_moment=width * thickness**3 / 12.0)


@dataclass(frozen=True)
class Material:
    """Linear elastic material: Young's modulus [Pa] and density [kg/m^3]."""

    youngs_modulus: float
    density: float


class Curvature(Enum):
    """What becomes of a beam's curvature at a node with a lumped moment of inertia, where the true one jumps.

    SHARED
        The paper's element: one value for both sides, zero at the tip. Converges with the first power of the element
        there.
    SEPARATE
        A value on either side of such a node, and a free one at the tip, where a weld, a motor or a lump may bring in
        a moment. Converges with the eighth power; one coordinate more for each such node and for the tip.
    """

    SHARED = "shared"
    SEPARATE = "separate"


@dataclass(frozen=True)
class LumpedMass:
    """A mass [kg] and moment of inertia [kg m^2] sitting on a named point of a beam."""

    point: str
    mass: float
    inertia: float = 0.0


@dataclass(frozen=True)
class RayleighDamping:
    """Structural damping in proportion to mass and stiffness: D = mass M_ff + stiffness K.

    Attributes
    ----------
    mass : float
        [1/s]
    stiffness : float
        [s]
    """

    mass: float = 0.0
    stiffness: float = 0.0

    def coefficients(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of mass-normalised modes of these angular frequencies [1/s]."""
        return self.mass + self.stiffness * omega**2


@dataclass(frozen=True)
class ModalDamping:
    """Structural damping by a ratio for each mode of a beam in its frame; the last serves all that follow."""

    ratios: tuple[float, ...]

    def coefficients(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """2 ratio omega of each mode [1/s]."""
        last = len(self.ratios) - 1
        return 2.0 * omega * np.array([self.ratios[min(k, last)] for k in range(omega.size)])


Damping = RayleighDamping | ModalDamping


@dataclass(frozen=True)
class RigidBody:
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

    name: str
    mass: float
    inertia: float
    centre_of_mass: tuple[float, float] = (0.0, 0.0)
    points: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class FlexibleBeam:
    """A straight flexible beam along the x axis of its body frame, which starts at its first end.

    Attributes
    ----------
    name : str
    length : float
        [m]
    section : Section
    material : Material
    points : mapping
        Distance of each named point from the first end [m]; every one becomes a node.
    elements : int or tuple of int
        Elements per span between neighbouring points and ends.
    lumps : tuple of LumpedMass
    reference : ReferenceCondition
        How the floating frame is fixed to the beam; the paper's is the cantilever.
    curvature : Curvature
        At nodes with a lumped moment of inertia; the paper's is shared.
    modes : int, optional
        Modes of lowest frequency kept as flexible coordinates, in its frame; all by default.
    damping : RayleighDamping or ModalDamping, optional
        Of its material; none by default.
    flexible : bool
        False holds all flexible coordinates at zero: the same inertia, rigid.
    """

    name: str
    length: float
    section: Section
    material: Material
    points: Mapping[str, float] = field(default_factory=dict)
    elements: int | tuple[int, ...] = 1
    lumps: tuple[LumpedMass, ...] = ()
    reference: ReferenceCondition = ReferenceCondition.CANTILEVER
    curvature: Curvature = Curvature.SHARED
    modes: int | None = None
    damping: Damping | None = None
    flexible: bool = True

    @property
    def mesh(self) -> BeamMesh:
        """Its elements and nodes.

        Raises
        ------
        InputError
            See `fem.mesh_beam`.
        """
        mesh = mesh_beam(self.length, self.points, self.elements)
        if self.curvature is Curvature.SEPARATE:
            jumps = [mesh.points[lump.point] for lump in self.lumps if lump.inertia > 0.0]
            mesh = mesh.with_separate_curvature([*jumps, mesh.n_elements])
        return mesh

    def as_rigid(self) -> FlexibleBeam:
        """The same beam with its flexibility switched off."""
        return replace(self, flexible=False)


Body = RigidBody | FlexibleBeam
