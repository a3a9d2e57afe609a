"""Cross-sections of beams: area and second moment of area, given directly or by a shape."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

from paraflex.arguments import CheckedFields, checked_arguments, named_in_errors
from paraflex.errors import InputError
from .quantities import check_numbers, field_metadata, optional, positive

_WALL = field_metadata("the thickness of the wall of a hollow section in m", positive)


@named_in_errors("a shape", "Rectangle(...), Round(...) or Tube(...)")
@dataclass(frozen=True)
class Shape(CheckedFields, ABC):
    """Shape of a cross-section: the base class of all kinds. All fields are lengths, `wall` is a wall thickness [m]."""

    _table = "section"
    kind: ClassVar[str]

    def __post_init__(self) -> None:
        super().__post_init__()
        check_numbers(self, self._table)
        wall = getattr(self, "wall", None)
        if wall is not None and not wall < self.smallest / 2.0:
            raise InputError(
                f"as thick as half of the section, {self.smallest / 2.0:g} m, or thicker", field="section.wall",
                value=wall, remedy="give a thinner wall, or leave it out for a solid section",
            )  # fmt: skip

    @property
    @abstractmethod
    def smallest(self) -> float:
        """Smallest outer dimension [m]."""

    @property
    @abstractmethod
    def area(self) -> float:
        """Area [m^2]."""

    @property
    @abstractmethod
    def second_moment(self) -> float:
        """Second moment of area about the axis normal to the plane of motion [m^4]."""

    @property
    @abstractmethod
    def outer_fibre(self) -> float:
        """Distance of the outermost fibre from the neutral axis, in the plane of motion [m]."""


@dataclass(frozen=True)
class Rectangle(Shape):
    """Rectangle with a width out of the plane of motion and a thickness in it, hollow if it has a wall [m]."""

    kind: ClassVar[str] = "rectangle"

    width: float = field(metadata=field_metadata("the width out of the plane of motion in m", positive))
    thickness: float = field(metadata=field_metadata("the thickness in the plane of motion in m", positive))
    wall: float | None = field(default=None, metadata=_WALL)

    @property
    def smallest(self) -> float:
        """Smaller side [m]."""
        return min(self.width, self.thickness)

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return self.width * self.thickness - self._of_hole(1)

    @property
    def second_moment(self) -> float:
        """Second moment of area about the axis normal to the plane of motion [m^4]."""
        return self.width * self.thickness**3 / 12.0 - self._of_hole(3) / 12.0

    @property
    def outer_fibre(self) -> float:
        """Half the thickness [m]."""
        return self.thickness / 2.0

    def _of_hole(self, power: int) -> float:
        """Return the width of the hole times a power of its thickness; zero for a solid section."""
        if self.wall is None:
            return 0.0
        return (self.width - 2.0 * self.wall) * (self.thickness - 2.0 * self.wall) ** power


@dataclass(frozen=True)
class Round(Shape):
    """Solid circle with a diameter [m]."""

    kind: ClassVar[str] = "round"

    diameter: float = field(metadata=field_metadata("the outer diameter in m", positive))

    @property
    def smallest(self) -> float:
        """Outer diameter [m]."""
        return self.diameter

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return math.pi / 4.0 * self.diameter**2

    @property
    def second_moment(self) -> float:
        """Second moment of area about a diameter [m^4]."""
        return math.pi / 64.0 * self.diameter**4

    @property
    def outer_fibre(self) -> float:
        """Outer radius [m]."""
        return self.diameter / 2.0


@dataclass(frozen=True)
class Tube(Round):
    """Circular tube with an outer diameter and a wall thickness [m]."""

    kind: ClassVar[str] = "tube"

    wall: float = field(metadata=_WALL)

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return math.pi * self.wall * (self.diameter - self.wall)

    @property
    def second_moment(self) -> float:
        """Second moment of area about a diameter: area times the sum of both squared diameters over 16 [m^4]."""
        return self.area * (self.diameter**2 + (self.diameter - 2.0 * self.wall) ** 2) / 16.0


# Kinds of shapes by their names in files.
SHAPES: dict[str, type[Shape]] = {kind.kind: kind for kind in (Rectangle, Round, Tube)}


@dataclass(frozen=True)
class Section(CheckedFields):
    """Cross-section of a beam.

    Attributes
    ----------
    area : float
        Area [m^2].
    second_moment : float
        Second moment of area about the axis normal to the plane of motion [m^4].
    shape : Shape, optional
        Shape from which the other values were computed.
    outer_fibre : float, optional
        Distance of the outermost fibre from the neutral axis, in the plane of motion [m]; bending stresses are not
        available without it.
    """

    _table = "section"

    area: float = field(metadata=field_metadata("the area in m^2", positive))
    second_moment: float = field(metadata=field_metadata("the second moment of area in m^4", positive))
    shape: Shape | None = None
    outer_fibre: float | None = optional(
        None, "the distance of the outermost fibre from the neutral axis in m", positive
    )

    @classmethod
    def of(cls, shape: Shape) -> "Section":
        """Return the section of a shape."""
        return cls(shape.area, shape.second_moment, shape, shape.outer_fibre)

    @classmethod
    @checked_arguments()
    def rectangle(cls, width: float, thickness: float, wall: float | None = None) -> "Section":
        """Return a rectangular section with a width out of the plane of motion and a thickness in it [m].

        A wall thickness [m] makes it hollow.
        """
        return cls.of(Rectangle(width, thickness, wall))

    @classmethod
    @checked_arguments()
    def round(cls, diameter: float) -> "Section":
        """Return a solid circular section with a diameter [m]."""
        return cls.of(Round(diameter))

    @classmethod
    @checked_arguments()
    def tube(cls, diameter: float, wall: float) -> "Section":
        """Return the section of a circular tube with an outer diameter and a wall thickness [m]."""
        return cls.of(Tube(diameter, wall))
