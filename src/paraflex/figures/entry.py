"""Entry of the catalogue of figures: a function that describes charts, registered by `figure` where it is defined.

A kind of results (`folders.kinds.ResultKind`) names the modules of its figures. `paraflex plot`, the reports, the
gallery of the documentation and the functions of `paraflex.plots` are made from the entries.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import xarray as xr

from .charts import Chart
from .selection import as_runs, selected

Charts = Callable[..., Iterable[Chart]]
# Data of a figure: all results; the run of a mode; a mode and a pair of models; the number of a run; a table of
# designs; none.
Takes = Literal["results", "mode", "models", "run", "designs", "nothing"]
# Panels of the printed figure: one for each chart; one for each choice and chart; one for each run.
Panels = Literal["charts", "choices", "runs"]

# Problem of results without charts of a figure.
NOTHING = "nothing to show in these results"


@dataclass(frozen=True)
class Figure:
    """Figure of the catalogue.

    Attributes
    ----------
    name : str
        Name of the function, of the plotting function in `paraflex.plots`, and stem of the files of `paraflex plot`.
    shows : str
        Description in one line.
    paper : int
        Number of the figure of the paper that shows the same of RAParM-I; 0 (default) if there is none.
    charts : callable
        Function that takes the results, and options by keyword, and returns the charts; None for a drawing, which is a
        function of `paraflex.plots`.
    heading : str
        Heading of the charts on the page of a report; empty if the page does not show them.
    takes : str
        Data of the figure, see `Takes`.
    written_as : str
        Stem of the file that the command which makes the results writes; empty if that command does not write it.
    written_with : tuple of str
        Attributes, and variables with values, without which the command does not write the figure.
    variables : tuple of str
        Variables of the dataset that the figure requires.
    points : str
        Option that selects named points, "point" or "points"; empty if there is none.
    panels : str
        Panels of the printed figure, see `Panels`.
    members : int
        Largest number of choices in print, the first ones; 0 (default) for all.
    curves : int
        Largest number of curves in a printed panel, those with the largest peaks.
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
    charts: Charts | None = None
    paper: int = 0
    heading: str = ""
    takes: Takes = "results"
    written_as: str = ""
    written_with: tuple[str, ...] = ()
    variables: tuple[str, ...] = ()
    points: Literal["", "point", "points"] = ""
    panels: Panels = "charts"
    members: int = 0
    curves: int = 7
    columns: int = 0
    height: float = 48.0
    shared: bool = False
    missing: tuple[str, str] = (NOTHING, "choose another figure")
    defaults: Callable[[Any], Mapping[str, Any]] = lambda _: {}

    def can_show(self, data: Any) -> bool:
        """Check whether the results have the variables of the figure and, unless it is a drawing, any charts of it."""
        if self.charts is None or self.takes == "nothing":
            return self.has_variables(data)
        return self.has_variables(data) and any(chart.has_values for chart in self.charts(prepared(data)))

    def has_variables(self, data: Any) -> bool:
        """Check whether the results have the variables of the figure."""
        return all(name in data for name in self.variables)

    def is_over_time(self, data: Any) -> bool:
        """Check whether the figure has curves over the time of runs, which may be over another quantity of them."""
        if self.charts is None or not isinstance(data, xr.Dataset) or "time" not in data.dims:
            return False
        return any(chart.over_time for chart in self.charts(prepared(data)))

    def is_written(self, data: Any) -> bool:
        """Check whether the command that makes the results writes the figure."""
        attributes = getattr(data, "attrs", ())
        return bool(self.written_as) and all(
            name in attributes or (name in data and bool(data[name].notnull().any())) for name in self.written_with
        )

    def describe(self, data: Any, **options: Any) -> list[Chart]:
        """Return the charts of results from `prepared`; charts without any value are left out."""
        assert self.charts is not None
        return [chart for chart in self.charts(data, **options) if chart.has_values]


def prepared(data: Any, mode: str | None = None, models: Sequence[str] | None = None) -> Any:
    """Return results (of a mode, of models) as functions of charts take them: runs with a dimension of modes."""
    if models is not None:
        data = selected(data, "model", *models)
    if isinstance(data, xr.Dataset) and "time" in data.dims:
        return as_runs(data, mode)
    return data if mode is None else selected(data, "mode", mode)


# Figures by the module that defines them, once it has been imported, and by name.
ENTRIES: dict[str, dict[str, Figure]] = {}


def figure(shows: str, **more: Any) -> Callable[[Charts], Charts]:
    """Decorate a function that describes charts: it becomes an entry of the catalogue; see `Figure` for the fields."""

    def register(charts: Charts) -> Charts:
        name = charts.__name__
        ENTRIES.setdefault(charts.__module__, {})[name] = Figure(name, shows, charts, **more)
        return charts

    return register
