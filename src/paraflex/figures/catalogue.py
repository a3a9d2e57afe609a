"""Catalogue of figures with charts, by kind of results.

A kind of results (`folders.kinds.ResultKind`) names the modules of its figures, or single figures as "module.figure".
"""

from collections.abc import Container, Mapping
from functools import cache
from importlib import import_module
from typing import Any

from paraflex.folders.kinds import RESULT_KINDS
from .charts import Chart, Panel
from .entry import ENTRIES, Figure, prepared


@cache
def figures_of_kind(kind: str) -> Mapping[str, Figure]:
    """Return the figures with charts of a kind of results, by name."""
    found: dict[str, Figure] = {}
    for each in RESULT_KINDS[kind].figures:
        module, _, name = each.partition(".")
        import_module(f"paraflex.figures.{module}")
        entries = ENTRIES[f"paraflex.figures.{module}"]
        found |= {name: entries[name]} if name else entries
    return found


@cache
def all_figures() -> Mapping[str, Figure]:
    """Return all figures with charts, by name."""
    return {name: one for kind in RESULT_KINDS for name, one in figures_of_kind(kind).items()}


def page_panels(kind: str, data: Any, names: Container[str] | None = None) -> list[Panel]:
    """Return the charts of a report, those of one heading together, in the order of the catalogue.

    A chart that two figures have is shown once. If names are given, the charts are those of these figures.
    """
    headings: dict[str, list[Chart]] = {}
    data, seen = prepared(data), set[str]()
    for one in figures_of_kind(kind).values():
        if one.heading and (names is None or one.name in names) and one.has_variables(data):
            charts = [chart for chart in one.describe(data) if chart.on_page and chart.identity not in seen]
            seen.update(chart.identity for chart in charts)
            headings.setdefault(one.heading, []).extend(charts)
    return [Panel(heading, charts) for heading, charts in headings.items() if charts]
