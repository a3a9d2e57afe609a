"""Storage of findings and validity in datasets, and their lines in summaries and reports."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from paraflex.arrays import Mask
from paraflex.findings import DONE_STATUSES, Finding, Level, Verdict

if TYPE_CHECKING:
    # Files can be read without the modules that compute validity.
    from paraflex.validity import Validity

# Prefix of `Finding.place` in findings on single runs.
MODE = "mode "
_LEVEL_WORDS = {Level.WRONG: "wrong", Level.DOUBTFUL: "warning"}
# Attribute of a dataset that holds its findings, as JSON.
FINDINGS = "findings"
_INDICATORS = {
    "validity_shortening": "shortening by bending, times the condition number, over the tracking error",
    "validity_axial_force": "largest axial force of a body of linear geometry over its buckling load",
    "validity_slope": "largest slope of a body of linear geometry, in its frame",
    "validity_fourth_order": "terms of fourth order over the deflection, of a beam of second-order geometry",
}
VALIDITY_UNITS = {
    "validity": ("size of the neglected terms over its limit: the model holds up to 1", "1"),
    "validity_verdict": ("whether the model holds", "1"),
    **{name: (meaning, "rad" if name.endswith("slope") else "1") for name, meaning in _INDICATORS.items()},
}


def finished(data: xr.Dataset) -> Mask:
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


def validity_variables(runs: Sequence[Validity | None]) -> dict[str, np.ndarray]:
    """Return the validity variables of a dataset, one number or text per run: NaN or "" if validity is not defined."""
    out = {
        "validity": np.array([math.nan if one is None else one.ratio for one in runs]),
        "validity_verdict": np.array(["" if one is None else one.verdict for one in runs]),
    }
    for name in _INDICATORS:
        indicator = name.removeprefix("validity_").replace("_", " ")
        values = [{} if one is None else {each.name: each.value for each in one.indicators} for one in runs]
        out[name] = np.array([value.get(indicator, math.nan) for value in values])
    return out


def validity_summary(run: xr.Dataset) -> dict[str, Any] | None:
    """Return the validity of one run of a dataset: largest ratio of an indicator to its limit, verdict, all indicators.

    Return None if validity is not defined, as for rigid bodies and in files of earlier versions.
    """
    if "validity" not in run or not math.isfinite(run["validity"].item()):
        return None
    ratio = float(run["validity"].item())
    values = {name.removeprefix("validity_"): run[name].item() for name in _INDICATORS}
    return {
        "ratio": ratio,
        "holds": ratio <= 1.0,
        "verdict": str(run["validity_verdict"].item()),
        **{name: float(value) for name, value in values.items() if math.isfinite(value)},
    }


def validity_line(verdicts: Mapping[str, Mapping[str, Any] | None]) -> str:
    """Return a sentence that the models of all runs are valid, with the verdict of the run nearest to its limit.

    The sentence is empty if one model is not valid, or if all bodies are rigid. The name of a single run may be empty.
    """
    known = {name: one for name, one in verdicts.items() if one is not None}
    if not known or not all(one["holds"] for one in known.values()):
        return ""
    worst = max(known, key=lambda name: known[name]["ratio"])
    whose = f"mode {worst}: " if worst else ""
    return f"validity: {whose}{known[worst]['verdict']}{'; further from its limit in the others' * (len(known) > 1)}"
