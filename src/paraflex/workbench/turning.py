"""A full turn for the page (in work)."""

from typing import Any


def turning(*_: Any, **__: Any) -> dict[str, Any]:
    """Return the turn."""
    return {}
