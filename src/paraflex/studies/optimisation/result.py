"""What every search for a design tells of itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from paraflex.display import Shown

# Of a session, and no results.
_OF_SESSION = ("fresh", "seconds", "folder", "table")


@dataclass(frozen=True, kw_only=True)
class SearchResult(Shown):
    """Where a search stands after a session.

    Attributes
    ----------
    folder, table : Path
        Where all is, and all runs as pandas reads them.
    values, start : mapping of str to float
        The best design's numbers, and those of the start.
    bounds : mapping of str to str
        "low" or "high" for parameters at a bound.
    evaluations, fresh, failed : int
        Designs, of these in this session, and those that do not run.
    reasons : tuple of str
        Why some of them do not.
    stopped : str
        Why it ended.
    interrupted : bool
        Whether the user stopped it.
    seconds : float
        The session took.
    history : tuple of (int, float or None, bool)
        Of every design its number, how good it is (None where it failed), and whether limits hold.
    """

    folder: Path
    table: Path
    values: Mapping[str, float]
    start: Mapping[str, float]
    bounds: Mapping[str, str]
    evaluations: int
    fresh: int
    failed: int
    reasons: tuple[str, ...]
    stopped: str
    interrupted: bool
    seconds: float
    history: tuple[tuple[int, float | None, bool], ...] = field(repr=False, default=())

    def figures(self) -> dict[str, Any]:
        """In plain values; without times and counts of a session, which are no results."""
        out = {name: value for name, value in vars(self).items() if name not in _OF_SESSION}
        return out | {"history": [list(each) for each in self.history], "reasons": list(self.reasons)}
