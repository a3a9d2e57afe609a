"""Units of the numbers of a mechanism's file, from the descriptions in its schema."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any, get_args, get_origin

from pydantic import BaseModel

from paraflex.designs.overlay import Place
from paraflex.designs.schema import IntegrationTable, SweepTable
from paraflex.files.schema import ModelTable

_UNITS = (
    "kg m^2", "kg/m^3", "kg m", "kg", "N m s/rad", "N m/rad", "N s/m", "N m", "N/m", "m/s^2", "m^4", "m^2", "m/s",
    "rad/s", "rad", "Pa", "1/s", "m", "s", "N",
)  # fmt: skip
# Of "the length in m", "the torque in N m, or force in N": the first; the longest that fits stands first in the list.
_UNIT = re.compile(rf"\bin ({'|'.join(map(re.escape, _UNITS))})(?=[\s,.)]|$)")


@cache
def unit_of(place: Place) -> str:
    """The unit of a number of a mechanism's file, or of a study's [integration]; empty if it has none."""
    descriptions = list(_descriptions((ModelTable, IntegrationTable, SweepTable), place))
    found = [match.group(1) for match in map(_UNIT.search, descriptions) if match]
    return found[0] if found and len(set(found)) == 1 else ""


def _descriptions(kinds: tuple[Any, ...], place: Place) -> Iterator[str]:
    """Descriptions of the field at a place, by each of the tables that may be there."""
    key, *rest = place
    for kind in kinds:
        field = kind.model_fields.get(str(key)) if isinstance(kind, type) and issubclass(kind, BaseModel) else None
        if field is None:
            continue
        models, depth = _inside(field.annotation)
        inner = tuple(rest[depth:])
        if field.description and not (models and inner):
            yield field.description
        elif models and inner:
            yield from _descriptions(models, inner)


def _inside(annotation: Any) -> tuple[tuple[Any, ...], int]:
    """The tables within an annotation, and the number of keys of dicts and lists that lead to them."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return (annotation,), 0
    arguments = get_args(annotation)
    container = get_origin(annotation) in (dict, list)
    inner = [_inside(each) for each in (arguments[-1:] if container else arguments)]
    models = tuple(model for each, _ in inner for model in each)
    depth = max((deep for each, deep in inner if each), default=0)
    return models, depth + (1 if container else 0)
