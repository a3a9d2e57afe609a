"""What datasets keep of the findings of runs, and what summaries and the command line say of them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import xarray as xr

from paraflex.findings import Finding

# The variable that holds them: JSON, a list of findings.
FINDINGS = "findings"


def findings_text(findings: Iterable[Finding]) -> str:
    """Findings as a dataset holds them."""
    return json.dumps([one.to_dict() for one in findings])


def findings_summary(run: xr.Dataset) -> list[dict[str, str]]:
    """Findings of one run of a dataset: code, level, place, text and remedy; none in files of earlier versions."""
    return json.loads(run[FINDINGS].item()) if FINDINGS in run else []


def findings_lines(runs: Mapping[str, Sequence[Mapping[str, Any]] | None]) -> list[str]:
    """A line for each finding of runs by name, from their summaries; the name is left out where it is empty."""
    lines = []
    for name, findings in runs.items():
        whose = f'mode "{name}": ' if name else ""
        lines += [
            f"{one['level']}: {whose}{one['place']}: {one['text']}; {one['remedy']} [{one['code']}]"
            for one in findings or ()
        ]
    return lines
