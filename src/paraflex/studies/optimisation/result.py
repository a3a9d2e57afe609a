"""Base class of the results of optimisations and identifications, and the model file of the best design."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from paraflex.campaign import KeptResult, Result
from paraflex.files.overlay import overlaid
from paraflex.writing import GO_ON, write_json, write_text
from .evaluate import EvaluatedDesign, Session
from .study import DesignStudy

# Distance from a bound, as a fraction of the range, below which a parameter counts as being at it.
_AT_BOUND = 1e-4
# Largest number of different reasons of failure listed.
_MOST_REASONS = 5
# Fields that describe a session, not the result.
_OF_SESSION = ("fresh", "seconds", "folder")
BEST = "best.toml"


@dataclass(frozen=True, kw_only=True)
class SearchResult(KeptResult):
    """State of a search after a session.

    Attributes
    ----------
    name : str
        Name of the study.
    folder : Path
        Folder of the study.
    values, start : mapping of str to float
        Parameter values of the best design and of the start.
    bounds : mapping of str to str
        Parameters of the best design at a bound, with "low" or "high".
    evaluations, fresh, failed : int
        Number of evaluated designs, of those evaluated in this session, and of those that do not run.
    reasons : tuple of str
        First different reasons of failure, five at most.
    stopped : str
        Reason of termination.
    interrupted : bool
        Whether the user stopped the search.
    seconds : float
        Wall time of the session [s].
    history : tuple of (int, float or None, bool)
        Number, objective or residual (None if it failed), and satisfaction of the limits, for every design.
    units : mapping of str to str
        SI units of parameters and metrics.
    """

    values_file = "result.json"
    kind: ClassVar[str]
    name: str
    folder: Path
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
    units: Mapping[str, str] = field(repr=False, default_factory=dict)

    @property
    def complete(self) -> bool:
        """Whether the search has ended."""
        return not self.interrupted

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values, without the times and counts of the session."""
        out = {name: value for name, value in vars(self).items() if name not in _OF_SESSION}
        listed = {"history": [list(each) for each in self.history], "reasons": list(self.reasons)}
        return {"kind": self.kind} | out | listed

    def write(self, study: DesignStudy[Result], folder: Path) -> None:
        """Write `result.json`, and if there is a best design the mechanism's file with its parameter values."""
        write_json(folder / self.values_file, self.to_dict(), remedy=GO_ON)
        if not self.values:
            return
        from paraflex.files.document import document_text

        setting = study.setting
        data = overlaid(dict(setting.data), setting.numbers(tuple(self.values.values())))
        lines = [f"# {setting.source}, with the numbers that the study {json.dumps(study.name)} found:"]
        lines += [f"#   {json.dumps(name)}: {value!r}" for name, value in self.values.items()]
        write_text(folder / BEST, "\n".join([*lines, "", document_text(data, setting.text)]))


def of_session(session: Session, best: EvaluatedDesign | None) -> dict[str, Any]:
    """Return the fields of a `SearchResult` for a session and its best design, without the history."""
    study, history = session.evaluate.study, session.evaluate.history
    names = study.setting.names
    reasons = [each.reason for each in history if not each.complete]
    return {
        "name": study.name,
        "folder": session.folder,
        "values": {} if best is None else dict(zip(names, best.design, strict=True)),
        "start": dict(zip(names, study.start, strict=True)),
        "units": study.setting.units(study.base.members),
        "bounds": {} if best is None else at_bounds(study, best.design),
        "evaluations": len(history),
        "fresh": session.evaluate.fresh,
        "failed": len(reasons),
        "reasons": tuple(dict.fromkeys(reasons))[:_MOST_REASONS],
        "stopped": session.stopped,
        "interrupted": session.interrupted,
        "seconds": session.seconds,
    }


def at_bounds(study: DesignStudy[Result], design: Sequence[float]) -> dict[str, str]:
    """Return the parameters of a design that are at a bound, with "low" or "high"."""
    places = dict(zip(study.setting.names, study.unit(design), strict=True))
    low = {name: "low" for name, place in places.items() if place < _AT_BOUND}
    return low | {name: "high" for name, place in places.items() if place > 1.0 - _AT_BOUND}
