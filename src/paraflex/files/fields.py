"""Fields of a file: their schema entries, the units that they accept, and the check of units in data."""

import re
import typing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import reduce
from typing import Any, NamedTuple

from pydantic import BaseModel

from paraflex.errors import InputError
from paraflex.expressions.dimensions import UNITS_OF_QUANTITIES, dimension_of, dimensions_of_parameters
from paraflex.expressions.evaluate import ExpressionError, evaluate, expressed_in, names_in, quantity_in, tree_of
from paraflex.mechanism import JOINT_KINDS
from paraflex.units import FIELD_UNITS, PLAIN, WHERE_IT_SLIDES, Dimension, dimension_text, quantities_in, unit_named

# Path to a value in parsed TOML: keys of tables and indices of lists.
Place = tuple[str | int, ...]

_SI = f"(?:{'|'.join(map(re.escape, FIELD_UNITS))})"
# Matches "in m", "in rad/s or m/s", "in s and rad or m", "in s, N and N"; longer units come first among alternatives.
_IN_UNITS = re.compile(rf"\bin ({_SI}(?:(?:,|,? (?:or|and)) {_SI})*)(?=[\s,.)]|$)")
_AND = re.compile(r" and |, (?!or\b)")
# Tables of numbers by user-defined names, and tables of values whose fields belong to another file.
_OF_ANY_UNIT = ("parameters", "set")
# Quantities in messages, by their SI unit.
_EXAMPLES = {"rad": "90 deg", "m": "50 mm", "rad/s": "60 rpm", "m/s": "20 mm/s", "s": "500 ms"}
_WHERE_IT_TURNS = {slides: turns for turns, slides in WHERE_IT_SLIDES.items()}


class FileField(NamedTuple):
    """Schema entry of a field.

    Attributes
    ----------
    owner : type of BaseModel, or None
        Table that contains the field.
    description : str
        Description of the field.
    annotation : Any
        Type of the field; None for a field that the table does not have.
    """

    owner: type[BaseModel] | None
    description: str
    annotation: Any = None


def field_at(schema: type[BaseModel], data: Any, place: Sequence[Any]) -> FileField:
    """Find the field at a place by following the annotations of the schema."""
    model: Any = schema
    owner: type[BaseModel] | None = schema
    description = "a value"
    for part in place:
        data = _below(data, part)
        if is_table(model):
            owner = model
            info = model.model_fields.get(str(part))
            if info is None and model.model_config.get("extra") == "allow":
                return FileField(owner, getattr(model, "extra_description", description), float)
            if info is None:
                return FileField(owner, description)
            description = info.description or f"a [{part}.NAME] table"
            model = info.annotation
        else:
            model = _inner(model)
        model = _resolve(model, data)
    return FileField(owner, description, model)


def units_at(schema: type[BaseModel], data: Mapping[str, Any], place: Place) -> tuple[str, ...] | None:
    """Return the units that the number at a place may have: empty for a plain number, None if any unit is allowed.

    Parameters
    ----------
    schema : type of BaseModel
        Schema of the file.
    data : mapping
        Parsed data, which determine the kind of a table and whether the joint named in it rotates or slides.
    place : tuple
        Keys and indices that lead to the number.
    """
    found = field_at(schema, data, place)
    if place[0] in _OF_ANY_UNIT or "unit of" in found.description:
        return None
    if "table" in place and place[-1] == 0 and (over := value_at(data, (*place[:2], "over"))) is not None:
        unit = unit_over(over)
        return None if unit is None else (unit,)
    units = _units_in(found.description, _row(data, place), place[-1])
    if place[0] == "gear" and place[-1] == "ratio":
        return _ratio_units(data, place)
    slides = _slides(data, place)
    if slides is None:
        return units
    other = WHERE_IT_SLIDES if slides else _WHERE_IT_TURNS
    return tuple(dict.fromkeys(other.get(unit, unit) for unit in units))


def unit_over(over: Any) -> str | None:
    """Return the SI unit of the quantity in the text of `over`; None if it is not one quantity of a known unit."""
    try:
        alone = isinstance(over, str) and quantity_in(tree_of(over)) is not None
    except ExpressionError:
        alone = False
    return UNITS_OF_QUANTITIES.get(over.rpartition(".")[2].rstrip("'")) if alone else None


def described(found: FileField, data: Mapping[str, Any], place: Sequence[Any]) -> str:
    """Return the description of the field at a place; a table over a quantity has it and its unit, not the time."""
    over = value_at(data, (*place[:2], "over")) if "table" in place else None
    if over is None:
        return found.description
    return found.description.replace("[t,", f"[{over},").replace(" in s", f" in {unit_over(over) or 'SI units'}", 1)


def check_units(schema: type[BaseModel], data: Mapping[str, Any]) -> None:
    """Check the units in data that fit a schema against those of the fields.

    Raises
    ------
    InputError
        Unit of another dimension, or sum of quantities of different dimensions.
    """
    table = data.get("parameters", {})
    parameters = dimensions_of_parameters(table if isinstance(table, dict) else {})
    with_units = any(dimension is not None for dimension in parameters.values())
    for place, text in leaves(data):
        if not isinstance(text, str) or not (with_units or quantities_in(text)):
            continue
        found = field_at(schema, data, place)
        if takes_number(found.annotation) and text not in _words_of(found.annotation):
            units = units_at(schema, data, place)
            check_unit(text, parameters, units, ".".join(map(str, place)), described(found, data, place))


def check_unit(
    text: str,
    parameters: Mapping[str, Dimension | None],
    units: tuple[str, ...] | None,
    field: str,
    description: str,
) -> None:
    """Check the unit of an expression against those of its field.

    Parameters
    ----------
    text : str
        Expression.
    parameters : mapping
        Dimensions of the parameters of the file.
    units : tuple of str, or None
        Accepted units; see `units_at`.
    field, description : str
        Name and description of the field, for errors.

    Raises
    ------
    InputError
        Expression of another dimension, or sum of quantities of different dimensions.
    """
    with expressed_in(field, text):
        given = dimension_of(text, parameters)
    if units is None or given in (None, PLAIN) or given in [unit_named(unit).dimension for unit in units]:
        return
    expected = f"one in {' or '.join(units)}" if units else "a number without a unit"
    remedy = f"give {description}"
    if named := sorted(names_in(text) & parameters.keys()):
        remedy += f"; it depends on {', '.join(f'parameters.{name}' for name in named)}"
    # The dimensions differ in the angle only, as for a period computed from a speed, 2 * pi / n.
    if any(given[:3] == unit_named(unit).dimension[:3] for unit in units or ()):
        remedy += "; an angle has a dimension of its own: "
        remedy += 'write "60 rpm"' if "rad/s" in (units or ()) else 'the period of a speed n in rpm is "1 rev / n"'
    raise InputError(
        f"a quantity in {dimension_text(given)} where {expected} is asked for", field=field, value=text, remedy=remedy
    )


def number_in(text: str, unit: str) -> float:
    """Return the number in a text in an SI unit, or without one; the text has no unit, or one of the same dimension.

    Raises
    ------
    InputError
        Text that is not a number, or has another dimension.
    """
    try:
        number = evaluate(text, {})
    except ExpressionError:
        remedy = f'write a number in {unit}, or one with its unit, such as "{_EXAMPLES.get(unit, f"2 {unit}")}"'
        if not unit:
            remedy = "write a number without a unit, such as 0.02"
        raise InputError("not a number", field="value", value=text, remedy=remedy) from None
    check_unit(text, {}, (unit,) if unit else (), "value", f"it in {unit}" if unit else "a ratio")
    return number


def leaves(data: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Yield the place and the value of every entry of data that is not a table or a list."""
    if isinstance(data, (dict, list)):
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from leaves(value, (*place, key))
    else:
        yield place, data


def _words_of(annotation: Any) -> Iterator[Any]:
    """Yield the words that an annotation accepts in place of a number."""
    arguments = typing.get_args(annotation)
    if typing.get_origin(annotation) is typing.Literal:
        yield from arguments
    for each in arguments:
        yield from _words_of(each)


def takes_number(annotation: Any) -> bool:
    """Check whether an annotation accepts a number or an expression for it, or a function of time."""
    return annotation in (float, Any) or any(map(takes_number, typing.get_args(annotation)))


def _units_in(description: str, row: Sequence[Any] | None, key: str | int) -> tuple[str, ...]:
    """Return the units named in a description; for a number in a row, the units of its position in the row."""
    found = [(description[: match.start()], match[1]) for match in _IN_UNITS.finditer(description)]
    if row is not None and isinstance(key, int):
        for before, units in found:
            names = before[before.rfind("[") :].split("]")[0].split(",")
            each = _AND.split(units)
            if len(names) == len(row):
                return _alternatives(each[key] if len(each) == len(row) else each[-1 if key == len(row) - 1 else 0])
    return tuple(dict.fromkeys(unit for _, units in found for unit in _alternatives(units)))


def _alternatives(units: str) -> tuple[str, ...]:
    return tuple(re.findall(_SI, units))


def _row(data: Any, place: Place) -> Sequence[Any] | None:
    """Return the list that contains the number at a place; None if it is not in a list."""
    row = value_at(data, place[:-1])
    return row if isinstance(row, list) else None


def _slides(data: Mapping[str, Any], place: Place) -> bool | None:
    """Check whether the joint to which a number refers slides; None without a joint or if the field name decides."""
    if len(place) < 3 or {"angle", "displacement"} & set(place):
        return None
    table, owner, key = place[:3]
    if table == "statics" and owner in ("loads", "moved"):
        point, _, axis = str(key).rpartition(".")
        return {"x": True, "y": True, "angle": False}.get(axis) if point else _joint_slides(data, key)
    of_motor = table in ("study", "statics") and owner == "torques"
    joint = value_at(data, ("motor", key) if of_motor else (table, owner, "joint"))
    return _joint_slides(data, _below(joint, "joint") if isinstance(joint, dict) else joint)


def _ratio_units(data: Mapping[str, Any], place: Place) -> tuple[str, ...]:
    """Return the units of a gear ratio, the second joint's coordinate per coordinate of the first.

    For a rack and pinion the ratio is the radius of the pinion.
    """
    joints = value_at(data, (*place[:2], "joints"))
    slide = [bool(_joint_slides(data, name)) for name in joints] if isinstance(joints, list) else []
    if slide == [False, True]:
        return ("m/rad", "m")
    return ("rad/m", "1/m") if slide == [True, False] else ()


def _joint_slides(data: Mapping[str, Any], name: Any) -> bool | None:
    """Check whether a joint slides; None if there is no joint of that name."""
    joint = value_at(data, ("joint", name)) if isinstance(name, str) else None
    if joint is None:
        return None
    kind = JOINT_KINDS.get(str(_below(joint, "type")))
    return kind is not None and kind.slides


def is_table(annotation: Any) -> bool:
    """Check whether an annotation is a table with fields of its own."""
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def has_tables(annotation: Any) -> bool:
    """Check whether an annotation contains tables with fields of their own."""
    return is_table(annotation) or any(map(has_tables, typing.get_args(annotation)))


def value_at(data: Any, place: Iterable[Any]) -> Any:
    """Return the value at a place of data; None if there is none."""
    return reduce(_below, place, data)


def _below(data: Any, key: Any) -> Any:
    if isinstance(data, dict):
        return data.get(key)
    return data[key] if isinstance(data, list) and isinstance(key, int) and key < len(data) else None


def _inner(annotation: Any) -> Any:
    """Return the type of the items of a dict or list annotation; other annotations unchanged."""
    arguments = typing.get_args(annotation)
    return arguments[-1] if typing.get_origin(annotation) in (dict, list) and arguments else annotation


def _resolve(annotation: Any, data: Any) -> Any:
    """Strip Annotated, and select the model of a union whose `type` or fields match the data."""
    while typing.get_origin(annotation) is typing.Annotated:
        annotation = typing.get_args(annotation)[0]
    members = [_resolve(member, data) for member in typing.get_args(annotation)]
    models = [member for member in members if is_table(member)]
    if isinstance(data, list):
        members = [each for each in members if typing.get_origin(each) is list and is_table(typing.get_args(each)[0])]
        annotation = members[0] if members else annotation
    if typing.get_origin(annotation) in (dict, list) or not models:
        return annotation
    if isinstance(data, dict):
        for model in models:
            kind = model.model_fields.get("type")
            if kind is not None and data.get("type") in typing.get_args(kind.annotation):
                return model
        return max(models, key=lambda one: (len(set(one.model_fields) & set(data)), -len(one.model_fields)))
    return models[0]
