"""The table of metrics on the page of sweeps, from the table in the code."""

from __future__ import annotations

from typing import Any

from paraflex.results.metrics import METRICS, Metric

MARK = "<!-- metrics -->"
# Of a motor, a prescribed motion, a joint, and coordinates of equilibria.
EXAMPLES = {"motor": "tau1", "drive": "drive", "joint": "O", "coordinate": "stage.T.x", "direction": "stage.T.x"}


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put the table where the page marks it."""
    return markdown.replace(MARK, table()) if page.file.src_uri == "sweeps.md" else markdown


def table() -> str:
    """Names of all metrics, what they mean, their units, and whether they have derivatives."""
    return "\n".join(["| Metric | | Unit | Derivatives |", "|---|---|---|---|", *map(_row, METRICS.values())])


def _row(metric: Metric) -> str:
    meaning = metric.meaning + (f": columns `{metric.name}.{EXAMPLES[metric.each]}`, ..." if metric.each else "")
    unit = "" if metric.unit == "1" else metric.unit
    return f"| `{metric.name}` | {meaning} | {unit} | {'yes' if metric.smooth else 'none'} |"
