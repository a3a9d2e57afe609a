"""Numbers of a pose for the page (in work)."""

from typing import Any


class Seeing:
    """Numbers of a pose."""

    def __init__(self, model: Any, mover: Any) -> None:
        self.model, self.mover = model, mover

    def quick(self, q: Any, mode: str) -> dict[str, Any]:
        """Return the numbers that are computed fast."""
        return {}

    full = quick


def readiness(text: str, model: Any = None, problem: Any = None) -> dict[str, Any]:
    """Return what stands in the way of a run."""
    return {
        "ok": problem is None and model is not None,
        "sentence": str(problem or "Draw a link"),
        "place": [],
        "action": "",
    }
