"""Unused and missing entries of a model file: mostly a name that was intended for use elsewhere."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from paraflex.files import Model
from paraflex.files.schema import ModelTable
from paraflex.findings import Finding
from paraflex.units import without_quantities

_NAME = re.compile(r"[^\W\d]\w*")


def file_findings(model: Model) -> Iterator[Finding]:
    """Yield findings about entries of a model's file without effect, and about omissions that are likely mistakes."""
    yield from _unused(model.parameters)
    if model.paths and model.study.torques:
        yield Finding(
            "unused", "study.torques", "the study has a path, whose torques are planned: given ones are not applied",
            "leave them out, or the paths",
        )  # fmt: skip
    springs = model.parameters.get("linear_spring", {})
    for spring in model.mechanism.linear_springs:
        if spring.stiffness > 0.0 and spring.name in springs and "length" not in springs[spring.name]:
            yield Finding(
                "spring-rest", f"linear_spring.{spring.name}.length",
                "no free length is given: the spring pulls with all the distance between its points",
                "give its free length in m, or length = 0.0 if it has none",
            )  # fmt: skip


def _unused(data: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield parameters, sections, materials, lumped masses and ground points of a file that nothing refers to.

    Any text of the file that contains the name counts as a use of it.
    """
    texts = list(_texts(data))
    words = {word for text in texts for word in _NAME.findall(without_quantities(text))}
    names = set(texts)
    used = {
        "parameters": lambda name: name in words,
        "ground": lambda name: f"ground.{name}" in names,
        **dict.fromkeys(("section", "material", "lump"), lambda name: name in names),
    }
    for table, is_used in used.items():
        entries = data.get(table)
        for name in entries if isinstance(entries, Mapping) else ():
            if not is_used(name):
                what = "no expression uses it" if table == "parameters" else "nothing in the file names it"
                remedy = "leave it out, or check which name stands where it should be used"
                if table == "ground" and name in ModelTable.model_fields:
                    remedy = f"put it before the first table of the file, if {name} of the mechanism is meant"
                yield Finding("unused", f"{table}.{name}", what, remedy)


def _texts(value: Any, *, key: str = "") -> Iterator[str]:
    """Yield all texts in tables and lists, and the keys of tables that name points."""
    if isinstance(value, str):
        # Names and descriptions of a model refer to nothing.
        if key not in ("name", "description"):
            yield value
    elif isinstance(value, Mapping):
        for name, one in value.items():
            if "." in str(name):
                yield str(name)
            yield from _texts(one, key=str(name))
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _texts(one)
