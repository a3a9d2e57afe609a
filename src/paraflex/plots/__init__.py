"""Figures of results: each function takes a dataset, or numbers read from a file, and returns a Matplotlib figure.

The functions share these parameters:

data, figures, table
    Results of a kind for which `paraflex plot --list` lists the figure: a dataset (from `paraflex.results` or
    `studies.Verification.dataset`), the plain numbers of a study's result, or its table of designs; alternatively the
    folder or file that holds them.
mode, models, run
    Selection of runs: an actuation mode, two models of a verification, or the number of a run. The default of an
    optional mode is the mode with most active motors.
metrics
    Metrics of a study of many designs; by default the first metrics that vary.

An `InputError` is raised if the results are of another kind or hold nothing to show, or if there is no such mode,
model, run or metric.

The names below are imported on first use: most commands need one or two of them.
"""

from typing import Any

import lazy_loader

_attached, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    try:
        return _attached(name)
    except AttributeError:
        # A figure of the catalogue that the stub does not list.
        from paraflex.plots import charts

        if name not in charts.all_figures():
            raise
        return charts.plotting_function(name)
