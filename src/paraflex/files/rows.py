"""Reading of rows of numbers from text files, such as a measured motion or force.

Headings may give units in brackets, "t [ms], x [N]"; columns without units are in SI units.
"""

import copy
import re
import tomllib
from collections.abc import Container, Iterator
from contextlib import suppress
from math import isfinite
from pathlib import Path
from typing import Any

from paraflex.errors import InputError
from paraflex.units import dimension_text, unit_named, unit_of, unknown_unit
from .fields import Place, unit_over, units_at, value_at
from .outside import check_outside, is_outside
from .overlay import overlaid
from .read import text_of
from .schema import ModelTable, PathFile

# Possible numbers of columns of a file, with their names and meanings in errors.
_TWO, _THREE, _PATH = (2,), (3,), (2, 3)
_COUNTS = {_TWO: "two", _THREE: "three", _PATH: "two or three"}
_VALUES = {
    _TWO: "a time in s and a value",
    _THREE: "a time in s and two values",
    _PATH: "x and y in m, and perhaps a time",
}
_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")
_DECIMAL_COMMA = re.compile(r"\d,\d")
_BETWEEN_HEADINGS = re.compile(r"[,;\t]")
# Patterns of a unit at the end of a heading; round brackets may also hold a remark.
_SQUARE_ANYWHERE = re.compile(r"\[([^\[\]]*)\]")
_SQUARE, _ROUND = re.compile(r"\[([^\[\]]*)\]\W*$"), re.compile(r"\(([^()]*)\)\W*$")


def with_rows(data: dict[str, Any], folder: Path, allowed: Container[Any] = ()) -> dict[str, Any]:
    """Replace the file names in a model's prescribed motions, loads, torques and paths by the rows of the files.

    Parameters
    ----------
    data : dict
        Parsed data; not modified.
    folder : Path
        Folder of the model file, to which names are relative.
    allowed : container of values
        Values set by the user; absolute file names among them may lie outside the folder.

    Raises
    ------
    InputError
        File outside the folder without permission, unreadable file, wrong number of columns, anything but numbers below
        one line of headings, or unit that does not fit its column.
    """
    if not any(isinstance(entry.get(place[-1]), str) for place, entry, _ in _entries(data)):
        return data
    data = copy.deepcopy(data)
    for place, entry, columns in _entries(data):
        file = entry.get(place[-1])
        if isinstance(file, str):
            if not (Path(file).is_absolute() and file in allowed):
                check_outside(folder, file, _field(place))
            entry[place[-1]] = _read_rows(data, place, folder, file, columns)
    return data


def with_names(data: dict[str, Any], text: str, folder: Path) -> dict[str, Any]:
    """Replace rows in a model's data by the names of the files from which they come.

    A name is taken from the text of the model file, if that file, relative to the folder, still has these rows.
    """
    named = {place: entry.get(place[-1]) for place, entry, _ in _entries(tomllib.loads(text))}
    data = copy.deepcopy(data)
    for place, entry, columns in _entries(data):
        file = named.get(place)
        with suppress(InputError):
            if isinstance(file, str) and _read_rows(data, place, folder, file, columns) == entry.get(place[-1]):
                entry[place[-1]] = file
    return data


def _entries(data: dict[str, Any]) -> Iterator[tuple[tuple[str, ...], dict[str, Any], tuple[int, ...]]]:
    """Yield place of rows that may be the name of a file, the table that contains them, and numbers of columns."""
    for group, key in (("prescribed", "table"), ("prescribed", "ramps"), ("load", "table")):
        for name, entry in _tables(data.get(group)):
            yield (group, name, key), entry, _THREE if group == "load" and entry.get("type") == "force" else _TWO
    study = data.get("study")
    for name, entry in _tables(study.get("torques") if isinstance(study, dict) else None):
        yield ("study", "torques", name, "table"), entry, _TWO
    paths: Any = data.get("path")
    # In a file with one path, the table itself takes the place of the names.
    if isinstance(paths, dict) and isinstance(paths.get("type"), str):
        yield ("path", "table"), paths, _PATH
        return
    for name, entry in _tables(paths):
        yield ("path", name, "table"), entry, _PATH


def _tables(given: Any) -> list[tuple[str, dict[str, Any]]]:
    return [(name, one) for name, one in given.items() if isinstance(one, dict)] if isinstance(given, dict) else []


def _read_rows(
    data: dict[str, Any], place: Place, folder: Path, name: str, columns: tuple[int, ...]
) -> list[list[float]]:
    """Read the rows of a file in SI units; errors do not quote the content of files outside the model's folder."""
    field = _field(place)
    unread, wrong = "name a file, relative to the model file's folder", f"save {_COUNTS[columns]} columns as CSV"
    lines = text_of(folder / name, field, name, unread=unread, wrong=wrong).splitlines()
    try:
        return _rows_of(data, place, lines, name, columns)
    except InputError as error:
        if error.value is None or not is_outside(folder, name):
            raise
        remedy = "copy it into the folder of the model file, where errors give details"
        problem = f"not {_COUNTS[columns]} columns of numbers below headings"
        raise InputError(problem, field=error.field, value=name, remedy=remedy) from None


def _field(place: Place) -> str:
    return ".".join(map(str, place))


def _rows_of(
    data: dict[str, Any], place: Place, lines: list[str], name: str, columns: tuple[int, ...]
) -> list[list[float]]:
    """Convert the lines of a file to rows in SI units, for the table at a place."""
    field, count = _field(place), _COUNTS[columns]
    over = value_at(data, (*place[:-1], "over"))
    first = "a time in s" if over is None else f"{over} in {unit_over(over) or 'SI units'}"
    wanted = _VALUES[columns].replace("a time in s", first)
    rows: list[list[float]] = []
    headings, comment = None, ""
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            comment = comment if rows or not line.strip() else line
            continue
        row = _numbers(line, (len(rows[0]),) if rows else columns)
        if row is None and not rows and headings is None and not any(map(_is_number, _SEPARATOR.split(line.strip()))):
            headings = line
        elif row is None:
            remedy = f"give {wanted} in every line below the headings"
            if _DECIMAL_COMMA.search(line) and ";" in line:
                remedy = "write decimal points in place of decimal commas"
            raise InputError(
                f"line {number} of {name} is not {count} numbers", field=field, value=line.strip(), remedy=remedy
            )
        elif not all(map(isfinite, row)):
            problem = f"line {number} of {name} has a number that is not finite"
            raise InputError(problem, field=field, value=line.strip(), remedy="leave the line out, or give its numbers")
        else:
            rows.append(row)
    if not rows:
        raise InputError(f"{name} has no row of numbers", field=field, remedy=f"give {wanted} in each line")
    if rows and headings is None and len(_SQUARE_ANYWHERE.findall(comment)) == len(rows[0]):
        headings = comment
    return _in_si(data, place, name, headings, rows) if rows and headings else rows


def _in_si(data: dict[str, Any], place: Place, file: str, headings: str, rows: list[list[float]]) -> list[list[float]]:
    """Convert rows to SI units from the units that the headings give in brackets."""
    schema = PathFile if place == ("path", "table") else ModelTable
    field = _field(place)
    found = [list(column) for column in zip(*rows, strict=True)]
    for k, (heading, text) in enumerate(_units(headings, len(found), file, field)):
        if text is None:
            continue
        unit, where = unit_of(text), f"column {k + 1} of {file}"
        if unit is None:
            _, remedy = unknown_unit(f"1 {text}") or ("", 'write units like "ms", "N m" or "deg"')
            raise InputError(f'{where} has the unknown unit "{text}"', field=field, value=heading, remedy=remedy)
        given = overlaid(data, [(place, [[0.0] * len(found)])])
        units = units_at(schema, given, (*place, 0, k))
        if units is not None and unit.dimension not in [unit_named(one).dimension for one in units]:
            raise InputError(
                f"{where} is in {dimension_text(unit.dimension)} where {' or '.join(units)} is asked for", field=field,
                value=heading, remedy=f"give it in {' or '.join(units)} or a multiple, or take another column",
            )  # fmt: skip
        found[k] = [unit.in_si(repr(x)) if isfinite(x) else x for x in found[k]]
    return [list(row) for row in zip(*found, strict=True)]


def _units(headings: str, count: int, file: str, field: str) -> list[tuple[str, str | None]]:
    """Split headings into those of the columns, each with the unit in its brackets or None."""
    parts = [part.strip() for part in _BETWEEN_HEADINGS.split(headings.strip())]
    given = _SQUARE_ANYWHERE.findall(headings)
    if len(parts) == count:
        return [(part, _unit_in(part)) for part in parts]
    if given and len(given) != count:
        raise InputError(
            f"the headings of {file} do not show to which of {count} columns their units belong", field=field,
            value=headings.strip(), remedy="separate headings by commas",
        )  # fmt: skip
    return [(f"[{unit}]", unit) for unit in given]


def _unit_in(heading: str) -> str | None:
    if square := _SQUARE.search(heading):
        return square[1].strip()
    found = _ROUND.search(heading)
    return found[1].strip() if found and unit_of(found[1]) else None


def _numbers(line: str, columns: tuple[int, ...]) -> list[float] | None:
    parts = _SEPARATOR.split(line.strip())
    return [float(part) for part in parts] if len(parts) in columns and all(map(_is_number, parts)) else None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
