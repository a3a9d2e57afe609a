"""Rows of two numbers from a text file, such as a motion measured or computed elsewhere."""

from __future__ import annotations

import re
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import Any

from paraflex.errors import InputError
from paraflex.files.read import text_of

_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")


def with_rows(data: dict[str, Any], folder: Path) -> dict[str, Any]:
    """A model's data with the rows of the files its prescribed tables name in place of the names.

    Parameters
    ----------
    data : dict
        As parsed.
    folder : Path
        Where the model file is; names are relative to it.

    Raises
    ------
    InputError
        A file that cannot be read or has anything but two columns of numbers below one line of headings.
    """
    prescribed = data.get("prescribed")
    if not isinstance(prescribed, dict):
        return data
    read = {
        name: entry | {"table": _read_rows(folder / entry["table"], entry["table"], f"prescribed.{name}.table")}
        if isinstance(entry, dict) and isinstance(entry.get("table"), str)
        else entry
        for name, entry in prescribed.items()
    }
    return data | {"prescribed": read}


def with_names(data: dict[str, Any], text: str, folder: Path) -> dict[str, Any]:
    """A model's data with the names of files in place of their rows, where a text has names that hold for a folder."""
    named = tomllib.loads(text).get("prescribed", {})
    prescribed = dict(data.get("prescribed", {}))
    for name, entry in prescribed.items():
        file = named.get(name, {}).get("table")
        with suppress(InputError):
            if isinstance(file, str) and _read_rows(folder / file, file, name) == entry.get("table"):
                prescribed[name] = entry | {"table": file}
    return data | {"prescribed": prescribed} if prescribed else data


def _read_rows(path: Path, name: str, field: str) -> list[list[float]]:
    unread, wrong = "name a file, seen from the model file's folder", "save two columns as CSV"
    lines = text_of(path, field, name, unread=unread, wrong=wrong).splitlines()
    rows: list[list[float]] = []
    headed = False
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        row = _numbers(line)
        if row is None and not rows and not headed and not any(map(_is_number, _SEPARATOR.split(line.strip()))):
            headed = True
        elif row is None:
            raise InputError(
                f"line {number} of {name} is not two numbers", field=field, value=line.strip(),
                remedy="give a time in s and a value in every line below the headings",
            )  # fmt: skip
        else:
            rows.append(row)
    return rows


def _numbers(line: str) -> list[float] | None:
    parts = _SEPARATOR.split(line.strip())
    return [float(part) for part in parts] if len(parts) == 2 and all(map(_is_number, parts)) else None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
