"""Reading and validation of TOML files, with errors that name file, field, value and remedy."""

import re
import tomllib
import typing
from collections.abc import Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from paraflex.errors import InputError, suggestion
from paraflex.expressions.evaluate import evaluate_parameters
from paraflex.limits import FILE_BYTES, KEY_PARTS, NAME_LETTERS
from .fields import check_units, described, field_at

# Patterns of numbers with a decimal comma, of unquoted values that TOML does not allow, and of strings and comments,
# whose brackets are ignored.
_DECIMAL_COMMA = re.compile(r"=\s*[-+]?\d+,\d")
_BARE = re.compile(
    r"[=\[,]\s*(?!true\b|false\b|[-+]?inf\b|[-+]?nan\b)(?=[^\"'#\[\]{},=]*[A-Za-z_])[-+(\w][^\"'#\[\]{},=]*(?=[\],#]|$)"
)
_NO_BRACKETS = re.compile(r"\"[^\"]*\"|'[^']*'|#.*")
# A key with more parts than any valid key; the parser takes minutes for thousands of parts.
_DEEP_KEY = re.compile(rf"""(?<![\w"'.-])(?:[\w"'-]+[ \t]*\.[ \t]*){{{KEY_PARTS}}}""")
# Field that selects the kind of a table, in every file.
_TAG = "type"
# Words of other programs for kinds of joints and for fields.
_WORDS = {
    "slider": "prismatic", "hinge": "revolute", "pin": "revolute", "fixed": "weld", "link": "distance",
    "axis": "direction", "rpm": "speed", "omega": "speed",
}  # fmt: skip
_NO_TABLE = ("dict_type", "model_type", "model_attributes_type")

T = typing.TypeVar("T", bound=BaseModel)


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file; see `read_text` and `parse_toml` for the errors."""
    return parse_toml(read_text(path))


def read_text(path: Path) -> str:
    """Read the text of a TOML file.

    Raises
    ------
    InputError
        Unreadable file; see `text_of`.
    """
    unread = "name a TOML file, not a folder" if path.is_dir() else "check its name"
    return text_of(path, "file", None, unread=unread, wrong="name a TOML file")


def text_of(path: Path, field: str, name: str | None, *, unread: str, wrong: str) -> str:
    """Read the text of a file of limited size, in UTF-8 with or without a byte order mark.

    Parameters
    ----------
    path : Path
        File to read.
    field, name : str
        Field that names the file and the name given there, for errors.
    unread, wrong : str
        Remedies for a file that cannot be read, and for one that is too large or not text.

    Raises
    ------
    InputError
        File that cannot be read, is not a regular file, is too large, or is not UTF-8.
    """
    try:
        content = _content(path)
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise InputError(f"cannot be read ({reason})", field=field, value=name, remedy=unread) from None
    if len(content) > FILE_BYTES:
        remedy = f"{wrong}, of at most {FILE_BYTES // 10**6} MB"
        raise InputError("too large a file", field=field, value=name, remedy=remedy)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("not a text file in UTF-8", field=field, value=name, remedy=wrong) from None


def _content(path: Path) -> bytes:
    """Read the content of a file, at most one byte more than allowed."""
    # Opening a pipe would block until something is written to it, and devices have no end.
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError("not a regular file")
    with path.open("rb") as stream:
        return stream.read(FILE_BYTES + 1)


def exists(path: Path) -> bool:
    """Check whether a file exists; False for a name that no file can have."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text.

    Raises
    ------
    InputError
        Text that is not valid TOML, or has names that are too long.
    """
    if _DEEP_KEY.search(text):
        remedy = f"at most {KEY_PARTS} between dots"
        raise InputError("not valid TOML: a name of too many parts", field="file", remedy=remedy)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _not_toml(str(error), text) from error
    except (ValueError, RecursionError):
        problem = "not valid TOML: a number of too many digits, or too many nested brackets"
        raise InputError(problem, field="file", remedy="name a model file") from None
    _check_names(data)
    return data


def _check_names(data: dict[str, Any]) -> None:
    """Check that no name is too long, at any depth."""
    left: list[tuple[str, Any]] = [("", data)]
    while left:
        table, value = left.pop()
        inner = value.items() if isinstance(value, dict) else [("", each) for each in value]
        for name, each in inner:
            if len(name) > NAME_LETTERS:
                remedy = f"at most {NAME_LETTERS}"
                raise InputError(f"a name of {len(name)} letters", field=table or "file", value=name, remedy=remedy)
            if isinstance(each, dict | list):
                left.append((f"{table}.{name}".strip("."), each))


def _not_toml(reason: str, text: str) -> InputError:
    """Build the error of invalid TOML: the parser's reason or the duplicate table, with a likely remedy."""
    twice = re.match(r"Cannot declare \((.*?),?\) twice \((.*)\)", reason)
    if twice is None:
        problem, remedy = f"not valid TOML: {reason[0].lower()}{reason[1:]}", "correct this line"
        at = re.search(r"at line (\d+)", reason)
        number = int(at[1]) if at else text.count("\n") + 1
        line = text.split("\n")[number - 1][:500]
        if _DECIMAL_COMMA.search(line):
            remedy = "write decimals with a point, 0.5"
        elif _BARE.search(line):
            remedy = 'put names and expressions in quotes, "2 * l1"'
        elif reason.startswith("Unclosed") and (opened := _opened(text, number)):
            problem += f", opened in line {opened}"
            remedy = "close it there"
        if re.search("overwrite|mutate|uplicate", reason):
            remedy += "; a name may appear only once"
        return InputError(problem, field="file", remedy=remedy)
    table = ".".join(part.strip(" '") for part in twice[1].split(","))
    return InputError(f"the table [{table}] appears twice ({twice[2]})", field=table, remedy="leave one of them out")


def _opened(text: str, last: int) -> int:
    """Return the line of the last bracket still open at the line where the parser stopped; zero if there is none."""
    opened: list[int] = []
    for number, line in enumerate(text.split("\n")[:last], 1):
        for bracket in re.findall(r"[\[{\]}]", _NO_BRACKETS.sub("", line)):
            if bracket in "[{":
                opened.append(number)
            elif opened:
                opened.pop()
    return opened[-1] if opened else 0


@contextmanager
def naming(source: str) -> Iterator[None]:
    """Add the name of a source to errors raised inside the context that name no file."""
    try:
        yield
    except InputError as error:
        raise (error if error.source else error.in_file(source)) from None


def validate(schema: type[T], data: dict[str, Any], source: str) -> T:
    """Validate parsed data against a schema; numbers may be expressions of the data's [parameters], and have units.

    Parameters
    ----------
    schema : type of BaseModel
        Schema of the file.
    data : dict
        Parsed data.
    source : str
        Name of the file, for errors.

    Raises
    ------
    InputError
        Invalid field, or unit that does not fit the field; the first problem is reported.
    """
    table = data.get("parameters", {})
    with naming(source):
        try:
            parameters = evaluate_parameters(table if isinstance(table, dict) else {})
        except InputError as error:
            raise error.advising(_above(schema, error.field.rpartition(".")[2]) or error.remedy) from None
        try:
            checked = schema.model_validate(data, context={"parameters": parameters})
        except ValidationError as error:
            raise _first_problem(schema, data, error, source) from None
        check_units(schema, data)
    return checked


def _first_problem(schema: type[BaseModel], data: dict[str, Any], error: ValidationError, source: str) -> InputError:
    if (problem := _other_kind(schema, data, source)) is not None:
        return problem
    problem = min(error.errors(), key=lambda d: (_rank(schema, data, d), len(d["loc"])))
    location = _fields(schema, data, problem)
    field = ".".join(str(part) for part in location)
    place = field_at(schema, data, location)
    model, description = place.owner, described(place, data, location)
    kind, value = problem["type"], problem.get("input")
    if kind == "missing":
        return InputError("is missing", field=field, remedy=f"give {description}")
    if kind == "extra_forbidden":
        known = sorted(model.model_fields) if model is not None else []
        name = str(location[-1])
        remedy = _above(schema, name) or suggestion(_WORDS[name] if _WORDS.get(name) in known else name, known)
        return InputError("unknown field", field=field, value=value, remedy=remedy)
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return _tag_problem(_tags(schema, problem["loc"]), field, value)
    if kind == "expression":
        context = problem.get("ctx", {})
        remedy = f"give {description}; {context.get('remedy')}"
        return InputError(context.get("problem", ""), field=field, value=value, remedy=remedy)
    if kind in _NO_TABLE:
        return InputError("should be a table", field=field, value=value, remedy=f"give {description}")
    if kind == "literal_error":
        allowed = problem.get("ctx", {}).get("expected", "")
        known = re.findall("'([^']*)'", allowed)
        near = [_WORDS[value]] if _WORDS.get(str(value)) in known else get_close_matches(str(value), known, n=1)
        remedy = f'did you mean "{near[0]}"?' if near else f"give {description}"
        return InputError(f"should be {allowed}", field=field, value=value, remedy=remedy)
    message = problem["msg"].removeprefix("Input ").replace(" after validation", "")
    text = message[0].lower() + message[1:]
    return InputError(text, field=field, value=value, remedy=f"give {description}")


def _above(schema: type[BaseModel], name: str) -> str:
    """Return the remedy for a top-level field of the file that stands in a table; empty for other names."""
    annotation = getattr(schema.model_fields.get(name), "annotation", dict)
    tables = [annotation, *typing.get_args(annotation)]
    is_table = any(typing.get_origin(one) is dict or one is dict or hasattr(one, "model_fields") for one in tables)
    return "" if is_table else "write it at the top of the file, above the first [table]"


def _other_kind(schema: type[BaseModel], data: dict[str, Any], source: str) -> InputError | None:
    """Return the error for a model file given in place of a study file, or vice versa; None in other cases."""
    fields = schema.model_fields
    if "mechanism" in fields and "body" in data and "mechanism" not in data:
        name = f'mechanism = "{source}"'
        remedy = f"write a study file with {name} and what it is to vary, and name that"
        return InputError("this is a model file, not a study file", field="file", remedy=remedy)
    if "body" in fields and "body" not in data and isinstance(data.get("mechanism"), str):
        remedy = f"name its mechanism, {data['mechanism']}, or give it to the command of its study"
        return InputError("this is a study file, not a model file", field="file", remedy=remedy)
    return None


def _tag_problem(tags: list[str], table: str, value: Any) -> InputError:
    """Build the error of a missing, unknown or misspelt `type` of a table."""
    choice = " or ".join([", ".join(f'"{tag}"' for tag in tags[:-1]), f'"{tags[-1]}"'])
    given = value if isinstance(value, dict) else {}
    if _TAG in given:
        near = get_close_matches(str(given[_TAG]), tags, n=1)
        remedy = f'did you mean "{near[0]}"? it may be {choice}' if near else f"it may be {choice}"
        return InputError("unknown type", field=f"{table}.{_TAG}", value=given[_TAG], remedy=remedy)
    near = get_close_matches(_TAG, given, n=1)
    if near:
        remedy = f'did you mean "{_TAG}"?'
        return InputError("unknown field", field=f"{table}.{near[0]}", value=given[near[0]], remedy=remedy)
    return InputError("is missing", field=f"{table}.{_TAG}", remedy=f"it may be {choice}")


def _tags(schema: type[BaseModel], location: tuple) -> list[str]:
    """Return the allowed values of `type` of a body, path or load."""
    annotation: Any = schema.model_fields[str(location[0])].annotation
    while typing.get_origin(annotation) in (dict, typing.Annotated):
        annotation = typing.get_args(annotation)[0 if typing.get_origin(annotation) is typing.Annotated else -1]
    kinds = [variant.model_fields[_TAG].annotation for variant in typing.get_args(annotation)]
    return [tag for kind in kinds for tag in typing.get_args(kind)]


def _fields(schema: type[BaseModel], data: Any, problem: Any) -> list:
    """Return an error's location without the variants of unions, which are not names in the file."""
    location, found = problem["loc"], []
    tag = _tag_position(schema, location[0]) if location else None
    for position, part in enumerate(location):
        named = isinstance(data, dict) and part in data
        if position != tag and (named or not _is_variant(part)):
            found.append(part)
            within = named or (isinstance(data, list) and isinstance(part, int) and part < len(data))
            data = data[part] if within else None
    return found


def _tag_position(schema: type[BaseModel], table: Any) -> int | None:
    """Return the position of the `type` of a body, path or load in an error's location; None for other tables."""
    info = schema.model_fields.get(str(table))
    if info is None:
        return None
    if info.discriminator:
        return 1
    inner = (typing.get_args(info.annotation) or (None,))[-1]
    tagged = any(getattr(part, "discriminator", None) for part in typing.get_args(inner))
    return 2 if tagged and typing.get_origin(inner) is typing.Annotated else None


def _rank(schema: type[BaseModel], data: dict[str, Any], problem: Any) -> int:
    """Return the rank of a problem, the lowest being the most informative.

    A misspelt name is ranked first, because it explains the missing field as well.
    """
    location = _fields(schema, data, problem)
    model = field_at(schema, data, location).owner
    known = set(model.model_fields) if model is not None else set()
    name = str(location[-1]) if location else ""
    if problem["type"] == "extra_forbidden":
        if name in known:  # reported by another variant of the union than the intended one
            return 2
        return 0 if get_close_matches(name, list(known), n=1) else 1
    # A wrong type, such as a list for a table, is reported by all variants of a union except the intended one.
    if problem["type"] in (*_NO_TABLE, "list_type") and len(location) < len(problem["loc"]):
        return 2
    # So is a table where a number may stand too; its problem is within it.
    if problem["type"] == "float_type" and isinstance(problem["input"], dict):
        return 2
    return 2 if problem["type"] == "missing" and name not in known else 1


def _is_variant(part: Any) -> bool:
    """Check whether a part of an error's location names a variant of a union, not a field of the file."""
    return isinstance(part, str) and (
        part.endswith("Table") or "[" in part or part.removeprefix("constrained-") in ("int", "float", "str")
    )
