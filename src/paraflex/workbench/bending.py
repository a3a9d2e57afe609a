"""Statics and linear models for the page (in work)."""

from typing import Any


def drag_force(*_: Any) -> dict[str, Any]:
    """Return the statics of a force."""
    return {}


def linear(*_: Any) -> dict[str, Any]:
    """Return the linear model."""
    return {}
