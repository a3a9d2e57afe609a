"""Fields that a description says, as against those that are as they are by default."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import Any


def fields_said(given: Any, *left_out: str) -> dict[str, Any]:
    """The fields of a dataclass that are not as they are by default."""
    out = {}
    for field in fields(given):
        value = getattr(given, field.name)
        default = field.default if field.default_factory is MISSING else field.default_factory()
        if field.name not in left_out and (default is MISSING or value != default):
            out[field.name] = value
    return out
