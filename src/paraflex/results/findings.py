"""Storage of findings in datasets, and their lines in summaries and reports."""

from __future__ import annotations

import json
from collections.abc import Iterable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.findings import DONE_STATUSES, Finding, Level, Verdict

# Prefix of `Finding.place` in findings on single runs.
MODE = "mode "
_LEVEL_WORDS = {Level.WRONG: "wrong", Level.DOUBTFUL: "warning"}
# Attribute of a dataset that holds its findings, as JSON.
FINDINGS = "findings"


def finished(data: xr.Dataset) -> NDArray[np.bool_]:
    """Return which runs of a dataset reached their end or an event; metrics of the others cover a part of the run."""
    return np.isin(np.atleast_1d(data["status"].values), DONE_STATUSES)


def keep_findings(data: xr.Dataset, findings: Iterable[Finding]) -> None:
    """Write findings into a dataset's attributes, without duplicates, the most severe first."""
    data.attrs[FINDINGS] = json.dumps([one.to_dict() for one in Verdict(findings)])


def verdict_of(data: xr.Dataset) -> Verdict:
    """Return the findings of a dataset; files of earlier versions have none."""
    return Verdict(map(Finding.from_dict, json.loads(data.attrs.get(FINDINGS, "[]"))))


def finding_lines(verdict: Iterable[Finding]) -> list[str]:
    """Return a line for each finding; after the first, all modes with the same code share one line."""
    lines, further = [], {}
    for one in verdict:
        whose = one.place.partition(MODE)[2] if one.place.startswith(MODE) else ""
        if whose and one.code in further:
            further[one.code].append(whose)
            continue
        if whose:
            further[one.code] = []
        lines.append(f"{_LEVEL_WORDS[one.level]}: {one}")
    return lines + [
        f"warning: the same in mode {', '.join(names)} [{code}]" for code, names in further.items() if names
    ]
