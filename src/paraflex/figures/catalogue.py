"""Catalogue of figures: each is a function that describes charts, registered by `figure` where it is defined.

A kind of results (`folders.kinds.ResultKind`) names the modules of its figures. `paraflex plot`, the reports, the
gallery of the documentation and the functions of `paraflex.plots` are made from the entries.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, Literal

import xarray as xr

from paraflex.figures.charts import Chart, Panel
from paraflex.figures.selection import as_runs
from paraflex.folders.kinds import RESULT_KINDS

Charts = Callable[..., Iterable[Chart]]
# Data of a figure: all results; the run of a mode; a mode and a pair of models; the number of a run; a table of
# designs; none.
Takes = Literal["results", "mode", "models", "run", "designs", "nothing"]
# Panels of the printed figure: one for each chart; one for each choice and chart; one for each run.
Panels = Literal["charts", "choices", "runs"]


@dataclass(frozen=True)
class Figure:
    """Figure of the catalogue.

    Attributes
    ----------
    name : str
        Name of the function, of the plotting function in `paraflex.plots`, and stem of the files of `paraflex plot`.
    shows : str
        Description in one line.
    charts : callable
        Function that takes the results, and options by keyword, and returns the charts; none for a drawing.
    module : str
        Module of `paraflex.plots` that defines a drawing; empty for a figure with charts.
    heading : str
        Heading of the charts on the page of a report; empty if the page does not show them.
    takes : str
        Data of the figure, see `Takes`.
    written_as : str
        Stem of the file that the command which makes the results writes; empty if that command does not write it.
    variables : tuple of str
        Variables of the dataset that the figure requires.
    points : str
        Option that selects named points, "point" or "points"; empty if there is none.
    panels : str
        Panels of the printed figure, see `Panels`.
    columns : int
        Number of columns of panels in print; 0 (default) for one of charts over time, else for as many as fit.
    height : float
        Height of a panel in print [mm].
    shared : bool
        Whether the panels of a row have the same scale, symmetrical about zero, in print.
    missing : (str, str)
        Problem and remedy of the error if the results have nothing that the figure shows.
    defaults : callable
        Function of the results that returns options of the printed figure for those that are not given.
    """

    name: str
    shows: str
    charts: Charts = lambda _: ()
    module: str = ""
    heading: str = ""
    takes: Takes = "results"
    written_as: str = ""
    variables: tuple[str, ...] = ()
    points: Literal["", "point", "points"] = ""
    panels: Panels = "charts"
    columns: int = 0
    height: float = 48.0
    shared: bool = False
    missing: tuple[str, str] = ("nothing to show in these results", "choose another figure")
    defaults: Callable[[Any], Mapping[str, Any]] = lambda _: {}

    def can_show(self, data: Any) -> bool:
        """Check whether the results have the variables of the figure and, unless it is a drawing, any charts of it."""
        if not all(name in data for name in self.variables):
            return False
        return bool(self.module) or any(True for _ in self.charts(prepared(data)))


def prepared(data: Any, mode: str | None = None) -> Any:
    """Return results as functions of charts take them: runs with a dimension of modes, others unchanged.

    If a mode is given, the results are those of this mode.
    """
    if isinstance(data, xr.Dataset) and "time" in data.dims and "model" not in data.dims:
        return as_runs(data, mode)
    return data if mode is None else data.sel(mode=[mode])


_MODULES: dict[str, dict[str, Figure]] = {}


def figure(shows: str, **more: Any) -> Callable[[Charts], Charts]:
    """Decorate a function that describes charts: it becomes an entry of the catalogue; see `Figure` for the fields."""

    def register(charts: Charts) -> Charts:
        name = charts.__name__
        _MODULES.setdefault(charts.__module__, {})[name] = Figure(name, shows, charts, **more)
        return charts

    return register


@cache
def figures_of_kind(kind: str) -> Mapping[str, Figure]:
    """Return the figures with charts of a kind of results, by name."""
    found: dict[str, Figure] = {}
    for name in RESULT_KINDS[kind].figures:
        import_module(f"paraflex.figures.{name}")
        found |= _MODULES[f"paraflex.figures.{name}"]
    return found


@cache
def all_figures() -> Mapping[str, Figure]:
    """Return all figures with charts, by name."""
    return {name: one for kind in RESULT_KINDS for name, one in figures_of_kind(kind).items()}


def page_panels(kind: str, data: Any) -> list[Panel]:
    """Return the charts of a report, those of one heading together, in the order of the catalogue."""
    headings: dict[str, list[Chart]] = {}
    data = prepared(data)
    for one in figures_of_kind(kind).values():
        if one.heading and all(name in data for name in one.variables):
            headings.setdefault(one.heading, []).extend(chart for chart in one.charts(data) if chart.on_page)
    return [Panel(heading, charts) for heading, charts in headings.items() if charts]
