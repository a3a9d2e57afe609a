"""Laws of forces and torques over the motion: expressions of joints, points and the time, and tables over these."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from paraflex.arguments import CheckedFields
from paraflex.errors import InputError, listed
from paraflex.expressions.evaluate import expressed_in, names_in
from paraflex.expressions.program import QUANTITY, TIME, Operation, operations_of
from .joints import PointRef
from .profiles import TabulatedProfile

# Quantities of a joint, of a spring between points, and of a point, by their words.
JOINT_WORDS, SPRING_WORDS, POINT_WORDS = ("angle", "travel", "rate"), ("length", "length_rate"), ("x", "y", "vx", "vy")


@dataclass(frozen=True)
class MotionQuantity:
    """Quantity of a motion on which a force depends: "slider.travel", "stage.T.y".

    Attributes
    ----------
    word : str
        "angle", "travel" or "rate" of a joint; "length" or "length_rate" of a spring between points; "x", "y", "vx" or
        "vy" of a point in the ground frame.
    joint, spring : str
        Name of the joint or of the spring; empty for others.
    point : PointRef, optional
        Point.
    """

    word: str
    joint: str = ""
    point: PointRef | None = None
    spring: str = ""

    @classmethod
    def named(cls, name: str, field: str) -> "MotionQuantity":
        """Return the quantity of a name.

        Raises
        ------
        InputError
            There is none of this form.
        """
        owner, _, word = name.rpartition(".")
        body, _, point = owner.partition(".")
        words = POINT_WORDS if point else JOINT_WORDS + SPRING_WORDS
        if word not in words or not body or "." in point:
            of_point = f"{owner or 'body.point'} has {listed(POINT_WORDS)}"
            of_joint = f"a joint has {listed(JOINT_WORDS)}, a point body.point has {listed(POINT_WORDS)}, "
            of_joint += f"a spring between points {listed(SPRING_WORDS)}"
            raise InputError(
                "no quantity of a joint or point", field=field, value=name, remedy=of_point if point else of_joint
            )
        if point:
            return cls(word, point=PointRef(body, point))
        return cls(word, spring=body) if word in SPRING_WORDS else cls(word, body)


@dataclass(frozen=True)
class ForceLaw(CheckedFields):
    """Force or torque as an expression of the motion: "-k * slider.travel - c * slider.rate".

    Attributes
    ----------
    text : str
        Expression of parameters, of the time t, and of the quantities JOINT.angle [rad], JOINT.travel [m], JOINT.rate
        [rad/s or m/s], BODY.POINT.x, .y [m], .vx and .vy [m/s], and of springs between points SPRING.length [m] and
        SPRING.length_rate [m/s]. Besides the functions of profiles in time it may have abs(x), min(x, y) and max(x, y).
    parameters : mapping of str to float
        Values of the parameters.
    table : TabulatedProfile, optional
        Table over the value of the expression, whose first and last values hold beyond its ends.
    places : mapping of PointRef to PointRef
        Points in place of those of the expression, in a mechanism derived from the one described.
    field : str
        Field of the file, for errors.

    Raises
    ------
    InputError
        The expression is not valid, or has quantities of another form.
    """

    _table = "load"

    text: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    table: TabulatedProfile | None = None
    places: Mapping[PointRef, PointRef] = field(default_factory=dict, compare=False, repr=False)
    field: str = field(default="force", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        with expressed_in(self.field, self.text):
            names = names_in(self.text)
        if not self.quantities and self.table is not None:
            raise InputError(
                "contains no joint and no point", field=self.field, value=self.text,
                remedy="name one, say slider.travel, stage.T.y or spring.length",
            )  # fmt: skip
        used = {name: value for name, value in self.parameters.items() if name in names}
        object.__setattr__(self, "parameters", used)

    def __str__(self) -> str:
        return self.text if self.table is None else f"table over {self.text}"

    @cached_property
    def operations(self) -> tuple[Operation, ...]:
        """Operations of the expression."""
        with expressed_in(self.field, self.text):
            return operations_of(self.text, self.parameters)

    @cached_property
    def quantities(self) -> dict[str, MotionQuantity]:
        """Quantities by their names in the expression."""
        named = [one.quantity for one in self.operations if one.name == QUANTITY]
        found = {name: MotionQuantity.named(name, self.field) for name in named}
        return {
            name: replace(one, point=self.places.get(one.point, one.point)) if one.point else one
            for name, one in found.items()
        }

    @property
    def in_time(self) -> bool:
        """Whether the expression contains the time."""
        return any(one.name == TIME for one in self.operations)

    def scaled(self, factor: float) -> "ForceLaw":
        """Return the law times a number."""
        if self.table is None:
            return self if factor == 1.0 else replace(self, text=f"{factor!r} * ({self.text})")
        return replace(self, table=replace(self.table, values=tuple(factor * value for value in self.table.values)))

    def moved(self, points: Mapping[PointRef, PointRef]) -> "ForceLaw":
        """Return the law with points replaced by others, where `points` has them."""
        return replace(self, places={**points, **{old: points.get(new, new) for old, new in self.places.items()}})
