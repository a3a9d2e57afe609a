"""Schema of the model file in pydantic: its fields, their types and units.

Numbers are in SI units and radians; a number with another unit is a text, "80 mm". Conditions beyond the type of a
field (positive lengths, points that exist) are checked once, in `mechanism.checks` and by the paths themselves.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from enum import Enum
from functools import reduce
from math import inf
from operator import or_
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetCoreSchemaHandler,
    Tag,
    ValidationInfo,
    WrapValidator,
    create_model,
)
from pydantic_core import PydanticCustomError

from paraflex.control.laws.described import ControllerDescription, References
from paraflex.control.laws.kinds import LAWS
from paraflex.control.shaping.shapers import Shaper
from paraflex.equilibria.conditions import StaticsDefaults
from paraflex.expressions.evaluate import CONSTANTS, ExpressionError, check_in_time, evaluate
from paraflex.expressions.program import operations_of
from paraflex.limits import LARGEST, TEXT_LETTERS, WHOLE
from paraflex.mechanism import (
    JOINT_KINDS,
    AssumedModesBeam,
    Damping,
    Deflection,
    EndEffector,
    FlexibleBeam,
    ForceLaw,
    LumpedMass,
    Material,
    Mechanism,
    ModalBody,
    ModalPoint,
    Motor,
    Payload,
    PointRef,
    RigidBody,
    Section,
    ShapeFunction,
    groups_of,
)
from paraflex.mechanism.bodies import BODY_KINDS
from paraflex.mechanism.loads import InMotion, InTime
from paraflex.mechanism.quantities import joint_pair
from paraflex.mechanism.sections import SHAPES
from paraflex.paths import Circle, Line, Path, PointPath, Polygon, SequencePath, TabulatedPath
from paraflex.units import QuantityName
from .study import StudyDefaults


def _number(value: Any, info: ValidationInfo) -> Any:
    """Return the value of an expression; anything but a text is returned unchanged and checked by its type."""
    if not isinstance(value, str):
        return value
    try:
        return evaluate(value, _parameters(info))
    except ExpressionError as error:
        raise _refused(error.problem, error.remedy) from None


def _function(value: Any, info: ValidationInfo) -> Any:
    """Return a finite number as a float, or an expression of the time t after a check of its syntax."""
    return _checked_function(value, lambda text: check_in_time(text, _parameters(info)))


def _law(value: Any, info: ValidationInfo) -> Any:
    """Return a number or an expression as `_function`, which may contain quantities of the motion as well."""
    return _checked_function(value, lambda text: operations_of(text, _parameters(info)))


def _checked_function(value: Any, check: Callable[[str], Any]) -> Any:
    example = 'write "0.2 * sin(3 * t)"'
    if isinstance(value, str):
        try:
            check(value)
        except ExpressionError as error:
            raise _refused(error.problem, error.remedy) from None
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise _refused("neither a number nor an expression", example)
    if not abs(value) <= LARGEST:
        raise _refused("not a finite number" if value != value or abs(value) == inf else "too large a number", example)
    return float(value)


class NumberOfText(float):
    """Value of an expression, with its text, because its unit can be checked only where the field is known."""

    text: str = ""


def _with_text(value: Any, number: Callable[[Any], float]) -> float:
    found = number(value)
    if isinstance(value, str):
        found = NumberOfText(found)
        found.text = value
    return found


def _parameters(info: ValidationInfo) -> dict[str, float]:
    return (info.context or {}).get("parameters", {})


def _refused(problem: str, remedy: str) -> PydanticCustomError:
    return PydanticCustomError("expression", "{problem}", {"problem": problem, "remedy": remedy})


class _Once:
    """Annotation by which pydantic makes the schema of a type once, not for each of the fields that have the type."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        if "schema" not in vars(self):
            self.schema = handler(source)
        return self.schema.copy()


# A number, or an expression of parameters and numbers with units in quotes.
Number = Annotated[
    float,
    Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST),
    BeforeValidator(_number, json_schema_input_type=float | str),
    _Once(),
]
# A number of a study that stands for fields of a mechanism's file.
NumberOfFields = Annotated[Number, WrapValidator(_with_text)]
# A number, or an expression of parameters and the time t in quotes.
FunctionOfTime = Annotated[Any, BeforeValidator(_function, json_schema_input_type=float | str)]
# The same, and joints and points: "-k * slider.travel".
FunctionOfMotion = Annotated[Any, BeforeValidator(_law, json_schema_input_type=float | str)]
Count = Annotated[int, Field(strict=True, ge=-WHOLE, le=WHOLE)]
Text = Annotated[str, Field(strict=True, max_length=TEXT_LETTERS)]
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]
# Rows of two or three numbers. A file may give the name of another file; `rows.with_rows` replaces it by its rows.
Rows = Annotated[list[Pair], BeforeValidator(lambda value: value, json_schema_input_type=list[Pair] | str)]
Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
PathRows = Annotated[
    list[Annotated[list[Number], Field(min_length=2, max_length=3)]],
    BeforeValidator(lambda value: value, json_schema_input_type=list[Pair] | list[Triple] | str),
]
ForceRows = Annotated[list[Triple], BeforeValidator(lambda value: value, json_schema_input_type=list[Triple] | str)]


class _Table(BaseModel):
    model_config: ClassVar[ConfigDict] = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    if TYPE_CHECKING:
        # Fields that follow from a class are known at run time only.
        def __getattr__(self, name: str) -> Any: ...


def _optional(description: str, default: Any = None) -> Any:
    """Return a field that may be omitted in a file."""
    return Field(default=default, description=description)


_UNTIL = _optional("the time in s at which the next piece takes over")
_INTERPOLATION = _optional('the interpolation of a table: "spline", smooth, by default, or "linear"')
InterpolationName = Literal["spline", "linear"]
_PAIR_IN_TIME = Annotated[list[FunctionOfTime], Field(min_length=2, max_length=2)]
_PAIR_OF_MOTION = Annotated[list[FunctionOfMotion], Field(min_length=2, max_length=2)]


class ForcePiece(_Table):
    """One piece of a force."""

    until: Number | None = _UNTIL
    force: _PAIR_IN_TIME = Field(description="[x, y] in the ground frame in N, numbers or expressions of the time t")


class TorquePiece(_Table):
    """One piece of a torque."""

    until: Number | None = _UNTIL
    torque: FunctionOfTime = Field(description="the torque in N m, a number or an expression of the time t")


# Schema of one component, or of two, that may be time profiles: a function, pieces, rows of a table, and the columns.
_IN_TIME: dict[Any, tuple[Any, Any, Any, str]] = {
    InTime: (FunctionOfTime, TorquePiece, Rows, "[t, torque] in s and N m, or the name of a file with two"),
    InMotion: (FunctionOfMotion, TorquePiece, Rows, "[t, torque] in s and N m, or the name of a file with two"),
    tuple[InMotion, InMotion]: (
        _PAIR_OF_MOTION, ForcePiece, ForceRows, "[t, x, y] in s, N and N, or the name of a file with three"
    ),
}  # fmt: skip
_OVER = _optional(
    "the quantity in place of the time t in a table, an expression of joints and points such as slider.travel"
)


def _in_time(hint: Any, name: str, description: str) -> dict[str, Any]:
    """Return the fields of a table for a quantity that may be a time profile."""
    written, piece, rows, columns = _IN_TIME[hint]
    pieces: Any = Annotated[list[piece], Field(min_length=1)]
    example = f"a list of {{ until = s, {name} = ... }}, the last without until"
    over: dict[str, Any] = {} if hint is InTime else {"over": (_written(str | None), _OVER)}
    return over | {
        name: (written | None, _optional(description)),
        "pieces": (pieces | None, _optional(example)),
        "table": (rows | None, _optional(f"a list of {columns} such columns")),
        "interpolation": (InterpolationName | None, _INTERPOLATION),
    }


TwoPoints = TwoJoints = Annotated[list[Text], Field(min_length=2, max_length=2)]
Yes = Annotated[bool, Field(strict=True)]
# Schema type of a field by the type annotation of a member's class.
_WRITTEN: dict[Any, Any] = {
    float: Number, int: Count, str: Text, bool: Yes, PointRef: Text, tuple[float, float]: Pair, NoneType: NoneType,
    Mapping[str, float]: dict[Text, Number], ForceLaw: FunctionOfMotion,
}  # fmt: skip


def _number_or_word(words: Sequence[str]) -> Any:
    """Return the type of a number, an expression or one of the words; without words, of any name but a parameter's."""

    def read(value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, str) or value in words:
            return value
        if value.isidentifier() and value not in {*_parameters(info), *CONSTANTS}:
            if not words:
                return value
            raise _refused("neither a known word nor a number", 'an angle may have a unit, "30 deg"')
        return _number(value, info)

    numbers: Any = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
    return Annotated[numbers | (Literal[tuple(words)] if words else Text),
                     BeforeValidator(read, json_schema_input_type=float | str)]  # fmt: skip


def _written(hint: Any) -> Any:
    origin, inner = get_origin(hint), get_args(hint)
    if hint in _WRITTEN or origin is Literal:
        return _WRITTEN.get(hint, hint)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return Literal[tuple(member.value for member in hint)]
    if origin in (Union, UnionType):
        words = [word for kind in inner if get_origin(kind) is Literal for word in get_args(kind)]
        if float in inner and (words or str in inner):
            return _number_or_word(words)
        # Of numbers for all, in order, or by name, files have no list in order.
        by_name = any(get_origin(kind) is Mapping for kind in inner)
        return reduce(or_, (_written(kind) for kind in inner if not (by_name and get_origin(kind) is Sequence)))
    if origin is Mapping:
        return dict[Text, _written(inner[1])]
    if origin is tuple and inner[1:] != (...,):
        return tuple[*map(_written, inner)]
    return list[_written(inner[0])]


def _fields_of(
    member: type, *, needed: bool = True, without: Sequence[str] = ("name",), **written: Any
) -> dict[str, Any]:
    """Return the fields of a member's table from those of its class, with two points or joints in one field.

    If `needed` is False, all fields become optional. `written` are types of fields that files write in another way than
    their annotations say; such a field is None by default if it may be.
    """
    hints, found = get_type_hints(member), {}
    together = [*without]
    if hints.get("a") is PointRef:
        found["points"] = (TwoPoints, Field(description='["body.point", "body.point"]'))
        together += ["a", "b"]
    if joints := joint_pair(member):
        pair = [f'"{each.metadata["description"]}"' for each in fields(member) if each.name in joints]
        found["joints"] = (TwoJoints, Field(description=f"[{', '.join(pair)}]"))
        together += joints
    for each in fields(member):
        if each.name in together:
            continue
        hint, description = hints[each.name], each.metadata.get("description", f"its {each.name}")
        if hint in _IN_TIME:
            found |= _in_time(hint, each.name, description)
        elif hint == tuple[ShapeFunction, ...]:
            found |= _of_shapes(each.name)
        else:
            kind = written.get(each.name) or _written(hint)
            default = each.default if each.default_factory is MISSING else each.default_factory()
            default = (... if needed else None) if default is MISSING else getattr(default, "value", default)
            if each.name in written and NoneType in get_args(kind):
                default = None
            elif default == ():
                default = {} if get_origin(kind) is dict else []
            found[each.name] = (kind, Field(default, description=description))
    return found


def _of_shapes(direction: str) -> dict[str, Any]:
    """Return the fields of a table for the shape functions of a bar in a direction."""
    return {
        f"{direction}_sines": (Count, _optional("the number of shapes sin(n pi z), n = 1, 2, ...", 0)),
        f"{direction}_polynomials": (list[list[Number]], _optional("a list of coefficients, ascending in z", [])),
    }


def _choice(words: Sequence[str], known: Sequence[str]) -> Any:
    """Return the field `type` with some allowed words; its description lists all known words."""
    quoted = [f'"{word}"' for word in known]
    return Literal[tuple(words)], Field(description=f"{', '.join(quoted[:-1])} or {quoted[-1]}")


def _table_of(
    one: Any, kinds: Mapping[str, Any] | None = None, base: type[_Table] = _Table, **others: Any
) -> type[_Table]:
    """Return the table of a class, with the fields of a base table as well, and with a `type` if it is one of kinds."""
    entries = _fields_of(one, **others)
    if kinds and len(kinds) > 1:
        entries = {"type": _choice([kind for kind, each in kinds.items() if each is one], list(kinds))} | entries
    about = one.__doc__.partition("\n\n")[0]
    return create_model(f"{one.__name__}Table", __base__=base, __doc__=about, **entries)


def _member_table(kinds: Mapping[str, Any], base: type[_Table] = _Table) -> Any:
    """Return the table of a member that belongs to one of several classes, with the fields of a base table as well."""
    tables = [_table_of(one, kinds, base) for one in kinds.values()]
    return tables[0] if len(tables) == 1 else Annotated[reduce(or_, tables), Field(discriminator="type")]


def _table_of_any(kinds: Iterable[type], **entries: Any) -> type[_Table]:
    """Return a table with some entries and with the fields of several classes, all of them optional.

    A field that classes declare in several ways has all their types and descriptions.
    """
    found: dict[str, Any] = {}
    for kind in kinds:
        for name, (hint, field) in _fields_of(kind, needed=False, without=("name", *entries)).items():
            known, shown = found.get(name, (hint, field))
            if field.description not in shown.description:
                shown = Field(None, description=f"{shown.description}; or {field.description}")
            found[name] = known if known == hint else known | hint, shown
    return create_model("AnyTable", __base__=_Table, **entries, **found)


class SectionTable(
    _table_of_any(
        [*SHAPES.values(), Section],
        shape=(
            Literal["rectangle", "round", "tube"] | None,
            _optional('"rectangle", "round" or "tube"; by default a rectangle, or by area and second_moment'),
        ),
    )
):
    """A cross-section, given by its shape or by its properties; the fields depend on the shape."""


class MaterialTable(_table_of(Material)):
    """A material."""


class LumpTable(_table_of(LumpedMass, without=("point",))):
    """A lumped mass."""


class DampingTable(_table_of_any(get_args(Damping))):
    """Structural damping of a body: modal damping ratios, a loss factor, or Rayleigh damping."""


class ModalPointTable(_table_of(ModalPoint, position=Pair)):
    """A point of a body given by its matrices."""


_WRITTEN |= {
    Section: Text, Material: Text, tuple[LumpedMass, ...]: dict[str, Text], Damping | None: DampingTable | None,
    ModalPoint: ModalPointTable,
}  # fmt: skip
ReferenceName = Literal["pinned", "cantilever", "free"]
CurvatureName = Literal["separate", "shared"]


class BeamTable(_table_of(FlexibleBeam, BODY_KINDS, reference=ReferenceName | None, curvature=CurvatureName | None)):
    """A flexible beam along its x axis."""


class RigidTable(_table_of(RigidBody, BODY_KINDS)):
    """A rigid body, also if its table has points, no `type`, and no fields of other bodies."""


def _with_type(value: Any) -> Any:
    if not isinstance(value, dict) or "points" not in value or "type" in value:
        return value
    others = {name for table in (BeamTable, AssumedModesTable, ModalTable) for name in table.model_fields}
    return value if value.keys() & (others - RigidTable.model_fields.keys()) else {"type": "rigid"} | value


class AssumedModesTable(_table_of(AssumedModesBeam, BODY_KINDS)):
    """A beam along its x axis that deforms in given shape functions of z = x/length."""


class ModalTable(_table_of(ModalBody, BODY_KINDS, first_moment=Pair)):
    """A flexible body given by its matrices."""


class JointTable(_table_of_any(JOINT_KINDS.values(), type=_choice(list(JOINT_KINDS), list(JOINT_KINDS)))):
    """A joint of any kind between two points."""


# A revolute joint may be written as its two points alone. The tags are chosen such that errors do not show them.
JointEntry = Annotated[
    Annotated[TwoPoints, Tag("list[point]")] | Annotated[JointTable, Tag("JointTable")],
    Discriminator(lambda value: "JointTable" if isinstance(value, dict) else "list[point]"),
]


class MotorTable(_table_of(Motor)):
    """A motor with fields of its own."""


# A motor may be written as the name of its joint alone.
MotorEntry = Annotated[
    Annotated[Text, Tag("joint")] | Annotated[MotorTable, Tag("MotorTable")],
    Discriminator(lambda value: "MotorTable" if isinstance(value, dict) else "joint"),
]


class PieceTable(_Table):
    """One piece of a profile."""

    until: Number | None = _UNTIL
    angle: FunctionOfTime | None = _optional("the angle in rad, an expression of the time t")
    displacement: FunctionOfTime | None = _optional("the displacement in m, an expression of the time t")
    speed: FunctionOfTime | None = _optional("the speed in rad/s, in place of both, a number or an expression of t")


class PrescribedTable(_Table):
    """A prescribed motion: the angle of a joint, or the displacement of a sliding joint, as a profile."""

    joint: Text = Field(description="the name of a joint")
    angle: FunctionOfTime | None = _optional(
        "the angle at t = 0 in rad, by default that of the assembly, or an expression of the time t"
    )
    displacement: FunctionOfTime | None = _optional(
        "the displacement at t = 0 in m, by default that of the assembly, or an expression of the time t"
    )
    speed: FunctionOfTime | None = _optional(
        "the speed in rad/s, from a constant start value: a number, or an expression of the time t"
    )
    ramps: Rows | None = _optional(
        "a list of [t, speed] in s and rad/s, between which the speed changes at constant rates, or the name of a file"
    )
    pieces: Annotated[list[PieceTable], Field(min_length=1)] | None = _optional(
        'a list of { until = s, angle = "..." }, or of { until = s, speed = "..." }, the last without until'
    )
    table: Rows | None = _optional(
        "a list of [t, value] in s and rad or m, or the name of a file with two such columns"
    )


class AssemblyTable(BaseModel):
    """Approximate angles of bodies by name, and positions of points that determine the other angles."""

    model_config: ClassVar[ConfigDict] = ConfigDict(extra="allow", frozen=True, defer_build=True)
    __pydantic_extra__: dict[str, Number] = Field(init=False)  # pyright: ignore[reportIncompatibleVariableOverride]

    extra_description: ClassVar[str] = "the angle of the body in rad"

    points: dict[str, Pair] = _optional('[x, y] in m for each "body.point"', {})

    @property
    def angles(self) -> dict[str, float]:
        """Angles of the bodies for which one is given [rad]."""
        return dict(self.__pydantic_extra__ or {})


class DeflectionTable(_table_of(Deflection)):
    """Deflection of a point of a beam from its undeformed position in the body frame."""


class CoordinatesTable(_Table):
    """All coordinates of a body."""

    x: Number = Field(description="x of the body frame's origin in m")
    y: Number = Field(description="y of the body frame's origin in m")
    phi: Number = Field(description="the angle of the body frame in rad")
    flexible: list[Number] | None = _optional("the body's own flexible coordinates; zeros by default")


class RatesTable(_Table):
    """Rates of all coordinates of a body."""

    x: Number = Field(description="the rate of x of the body frame's origin in m/s")
    y: Number = Field(description="the rate of y of the body frame's origin in m/s")
    phi: Number = Field(description="the rate of the angle of the body frame in rad/s")
    flexible: list[Number] | None = _optional("the rates of the body's own flexible coordinates; zeros by default")


class VelocityTable(_Table):
    """Velocities at the start, from which the others follow by the constraints."""

    angular: dict[str, Number] = _optional("the rate of each body's angle in rad/s", {})
    point: dict[str, Pair] = _optional('[x, y] in m/s for each "body.point"', {})


class StartTable(_Table):
    """Initial state of a model without a path."""

    deflection: dict[str, dict[str, Pair | DeflectionTable]] = _optional(
        "[axial, transverse] in m, or a table of axial, transverse, slope, for points of beams", {}
    )
    velocity: VelocityTable = VelocityTable.model_construct()
    coordinates: dict[str, CoordinatesTable] = _optional("x, y, phi and flexible of bodies", {})
    rates: dict[str, RatesTable] = _optional("rates of x, y, phi and flexible of bodies", {})


class EndEffectorTable(_table_of(EndEffector)):
    """The end-effector, a point that follows a path."""


class PayloadTable(_table_of(Payload)):
    """A payload fixed to the point of the end-effector."""


class ShaperTable(_Table):
    """An input shaper, which modifies a path or torques such that they leave modes of vibration at rest."""

    type: Literal["zv", "zvd", "zvdd", "ei"] = Field(description='the kind: "zv", "zvd", "zvdd" or "ei"')
    frequencies: Number | list[Number] = Field(
        description="the undamped natural frequencies of the modes in Hz, one number or a list"
    )
    damping: Number | list[Number] = _optional("the damping ratio of all modes, or a list with one for each", 0.0)
    tolerance: Number | None = _optional(
        'the residual vibration of "ei" at its frequency as a fraction, by default 0.05'
    )


class _PathTable(_Table):
    shaper: ShaperTable | None = _optional("the input shaper of the path: none by default")


class LineTable(_PathTable):
    """A straight line."""

    type: Literal["line"]
    start: Pair = Field(description="[x, y] in m")
    end: Pair = Field(description="[x, y] in m")
    max_acceleration: Number = Field(description="the largest acceleration in m/s^2")


# Path classes by the name of their type in files.
PATHS: dict[str, Any] = {
    "polygon": Polygon, "line": Line, "circle": Circle, "points": PointPath, "table": TabulatedPath,
    "sequence": SequencePath,
}  # fmt: skip


class TabulatedPathTable(_table_of(TabulatedPath, PATHS, _PathTable, without=("points", "times"))):
    """A smooth curve through many points, such as points read from a file."""

    table: PathRows = Field(
        description="a list of [x, y] in m, or of [x, y, t] in m and s, or the name of a file with such columns"
    )


_WRITTEN[Path] = Text


class SequenceTable(_table_of(SequencePath, PATHS, _PathTable)):
    """Several paths, one after the other, in one motion."""


_NEAR = list[Annotated[list[Number], Field(min_length=2, max_length=3)]]
PathTable = Annotated[
    _table_of(Polygon, PATHS, _PathTable)
    | LineTable
    | _table_of(Circle, PATHS, _PathTable)
    | _table_of(PointPath, PATHS, _PathTable, points=_NEAR)
    | TabulatedPathTable
    | SequenceTable,
    Field(discriminator="type"),
]


class TorqueTable(
    create_model(
        "_Torque", __base__=_Table, **_in_time(InTime, "torque", "the torque in N m, an expression of the time t")
    )
):
    """The torque of a motor as a profile: an expression, pieces or a table."""


# A number or an expression of the time, or a table. The tags are chosen such that errors do not show them.
TorqueEntry = Annotated[
    Annotated[FunctionOfTime, Tag("number[t]")] | Annotated[TorqueTable, Tag("TorqueTable")],
    Discriminator(lambda value: "TorqueTable" if isinstance(value, dict) else "number[t]"),
]


_REFERENCE: Any = Annotated[
    Annotated[Literal["plan", "open-loop"], Tag("word[reference]")]
    | Annotated[dict[str, FunctionOfTime], Tag("ReferenceTable")],
    Discriminator(lambda value: "ReferenceTable" if isinstance(value, dict) else "word[reference]"),
]
_WRITTEN[References | None] = _REFERENCE | None
_CONTROLLER = create_model(
    "ControllerTable", __base__=_Table, **_fields_of(ControllerDescription, without=("name", "law"))
)
if TYPE_CHECKING:
    AnyControllerTable = Any
else:
    AnyControllerTable = _member_table(LAWS, _CONTROLLER)


_WRITTEN |= {Mapping[str, InTime]: dict[str, TorqueEntry], Shaper | None: ShaperTable | None}


class StudyDefaultsTable(_table_of(StudyDefaults)):
    """Default settings of `paraflex run`."""


def _quoted(value: Any) -> Any:
    """Check that names of coordinates are quoted, because TOML reads an unquoted name as nested tables."""
    for name, each in value.items() if isinstance(value, dict) else ():
        if isinstance(each, dict):
            raise _refused(f'"{name}" is a table: a name with points stands in quotes', 'write "body.point.x" = ...')
    return value


NumbersByName = Annotated[dict[str, Number], BeforeValidator(_quoted, json_schema_input_type=dict[str, float | str])]


class StaticsTable(_table_of(StaticsDefaults, loads=NumbersByName, torques=NumbersByName, moved=NumbersByName)):
    """Default settings of `paraflex statics`."""


class _Parts(_Table):
    name: Text = Field(description="a name for the mechanism")
    description: Text = _optional("a sentence or two", "")
    geometry: Literal["linear", "second-order"] = _optional(
        'the shape of beams: "second-order", or "linear" as in the paper', "second-order"
    )
    reference: ReferenceName = _optional(
        'how frames are fixed to beams: "pinned" (along the chord), "cantilever" (the paper\'s) or "free"', "pinned"
    )
    curvature: CurvatureName = _optional(
        'curvature of beams at lumped moments of inertia: "separate", or "shared" as in the paper', "separate"
    )
    parameters: dict[str, Any] = _optional("numbers by name, for expressions of them in quotes", {})
    units: dict[QuantityName, Text] = _optional("the unit in which each quantity is shown", {})
    section: dict[str, SectionTable] = {}
    material: dict[str, MaterialTable] = {}
    lump: dict[str, LumpTable] = {}
    ground: dict[str, Pair] = _optional("[x, y] of each ground point in m", {})
    body: dict[str, Annotated[
        BeamTable | RigidTable | AssumedModesTable | ModalTable, Field(discriminator="type"),
        BeforeValidator(_with_type),
    ]] = Field(description="at least one [body.NAME] table")  # fmt: skip
    joint: dict[str, JointEntry] = _optional(
        '["body.point", "body.point"] for each revolute joint, a table for others', {}
    )
    motor: dict[str, MotorEntry] = _optional("the joint of each motor, or a table", {})
    prescribed: dict[str, PrescribedTable] = {}


_GROUPS: dict[str, Any] = {
    one.table: (dict[str, _member_table({getattr(kind, "kind", ""): kind for kind in one.kinds})], {})
    for one in groups_of(Mechanism).values()
    if one.kinds
}
_WithGroups = create_model("_WithGroups", __base__=_Parts, **_GROUPS)


class ModelTable(_WithGroups):
    """A model file."""

    gravity: Pair = _optional("[x, y] of free fall in m/s^2", [0.0, 0.0])
    end_effector: EndEffectorTable | None = None
    payload: PayloadTable | None = None
    assembly: dict[str, AssemblyTable] = _optional(
        "approximate angles of all bodies in rad for each assembly, or places of points in m", {}
    )
    mode: dict[str, list[Text]] = _optional("the motors of each actuation mode", {})
    path: dict[str, PathTable] = Field(default={})
    controller: dict[str, AnyControllerTable] = Field(default={})
    start: StartTable | None = None
    study: StudyDefaultsTable = StudyDefaultsTable.model_construct()
    statics: StaticsTable = StaticsTable.model_construct()


def model_schema() -> dict[str, Any]:
    """Return the JSON Schema of a model file, for editors."""
    schema = ModelTable.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "paraflex model"}


class PathFile(_Table):
    """A file with one path."""

    path: PathTable
