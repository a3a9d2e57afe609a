"""Rows of numbers from a text file, such as a motion or a force measured or computed elsewhere."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from paraflex.errors import InputError
from paraflex.files.read import text_of

# Columns that a file may have: what they are called, and what stands in them.
_TWO, _THREE, _PATH = (2,), (3,), (2, 3)
_COUNTS = {_TWO: "two", _THREE: "three", _PATH: "two or three"}
_VALUES = {
    _TWO: "a time in s and a value",
    _THREE: "a time in s and two values",
    _PATH: "x and y in m, and perhaps a time",
}
_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")


def with_rows(data: dict[str, Any], folder: Path) -> dict[str, Any]:
    """A model's data with the rows of the files its prescribed motions and loads name in place of the names.

    Parameters
    ----------
    data : dict
        As parsed.
    folder : Path
        Where the model file is; names are relative to it.

    Raises
    ------
    InputError
        A file that cannot be read or has anything but so many columns of numbers below one line of headings.
    """
    if not any(isinstance(entry.get("table"), str) for _, entry, _ in _entries(data)):
        return data
    data = copy.deepcopy(data)
    for place, entry, columns in _entries(data):
        file = entry.get("table")
        if isinstance(file, str):
            entry["table"] = _read_rows(folder / file, file, f"{place}.table", columns)
    return data


def with_names(data: dict[str, Any], text: str, folder: Path) -> dict[str, Any]:
    """A model's data with the names of files in place of their rows, where a text has names that hold for a folder."""
    named = {place: entry.get("table") for place, entry, _ in _entries(tomllib.loads(text))}
    data = copy.deepcopy(data)
    for place, entry, columns in _entries(data):
        file = named.get(place)
        with suppress(InputError):
            if isinstance(file, str) and _read_rows(folder / file, file, place, columns) == entry.get("table"):
                entry["table"] = file
    return data


def _entries(data: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], tuple[int, ...]]]:
    """The tables of a model's data that may name a file as their `table`: where each is, itself, and columns."""
    for group in ("prescribed", "load"):
        for name, entry in _tables(data.get(group)):
            yield f"{group}.{name}", entry, _THREE if group == "load" and entry.get("type") == "force" else _TWO
    for name, entry in _tables(_of_study(data)):
        yield f"study.torques.{name}", entry, _TWO
    paths: Any = data.get("path")
    # A file of one path has it in place of its name.
    if isinstance(paths, dict) and isinstance(paths.get("type"), str):
        yield "path", paths, _PATH
        return
    for name, entry in _tables(paths):
        yield f"path.{name}", entry, _PATH


def _of_study(data: dict[str, Any]) -> Any:
    return study.get("torques") if isinstance(study := data.get("study"), dict) else None


def _tables(given: Any) -> list[tuple[str, dict[str, Any]]]:
    return [(name, one) for name, one in given.items() if isinstance(one, dict)] if isinstance(given, dict) else []


def _read_rows(path: Path, name: str, field: str, columns: tuple[int, ...]) -> list[list[float]]:
    count = _COUNTS[columns]
    unread, wrong = "name a file, seen from the model file's folder", f"save {count} columns as CSV"
    lines = text_of(path, field, name, unread=unread, wrong=wrong).splitlines()
    rows: list[list[float]] = []
    headed = False
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        row = _numbers(line, (len(rows[0]),) if rows else columns)
        if row is None and not rows and not headed and not any(map(_is_number, _SEPARATOR.split(line.strip()))):
            headed = True
        elif row is None:
            raise InputError(
                f"line {number} of {name} is not {count} numbers", field=field, value=line.strip(),
                remedy=f"give {_VALUES[columns]} in every line below the headings",
            )  # fmt: skip
        else:
            rows.append(row)
    return rows


def _numbers(line: str, columns: tuple[int, ...]) -> list[float] | None:
    parts = _SEPARATOR.split(line.strip())
    return [float(part) for part in parts] if len(parts) in columns and all(map(_is_number, parts)) else None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
