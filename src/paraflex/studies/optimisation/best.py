"""The best design as a mechanism's file."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from paraflex.designs.overlay import overlaid
from paraflex.studies.optimisation.study import DesignStudy
from paraflex.writing import write_text

BEST = "best.toml"
_BARE = re.compile(r"[A-Za-z0-9_-]+\Z")


def write_best(folder: Path, study: DesignStudy, design: tuple[float, ...]) -> Path:
    """Write the mechanism's file with a design's numbers in it; its comments are not kept.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    setting = study.setting
    data = overlaid(dict(setting.data), setting.numbers(design))
    lines = [f"# {setting.source}, with the numbers that the study {json.dumps(study.name)} found:"]
    lines += [f"#   {json.dumps(name)}: {value!r}" for name, value in zip(setting.names, design, strict=True)]
    write_text(folder / BEST, "\n".join([*lines, "", toml_text(data)]))
    return folder / BEST


def toml_text(data: Mapping[str, Any]) -> str:
    """A model's data as TOML: what `tomllib` reads back as the same."""
    return "\n".join(_table(data, ())) + "\n"


def _table(data: Mapping[str, Any], name: tuple[str, ...]) -> Iterator[str]:
    """Lines of a table: its values first, for what follows a header belongs to it."""
    for key, value in data.items():
        if not isinstance(value, dict):
            yield f"{_key(key)} = {_value(value)}"
    for key, value in data.items():
        if isinstance(value, dict):
            inside = (*name, key)
            yield ""
            yield f"[{'.'.join(map(_key, inside))}]"
            yield from _table(value, inside)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # Escapes of JSON are those of TOML, which wants one more.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_value(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return repr(value)


def _key(key: str) -> str:
    return key if _BARE.match(key) else _value(key)
