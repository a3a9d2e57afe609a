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

from importlib import import_module
from typing import Any

import lazy_loader

# Drawings by their modules; figures with charts are made by `charts`.
_drawing, _, _drawings = lazy_loader.attach(__name__, submod_attrs={
    "equilibria": ["buckling_shapes", "deformed_shapes"], "maps": ["response_map"],
    "mechanism": ["desired_path", "mechanism_drawing"], "mode_shapes": ["mode_shapes"],
    "parallel": ["parallel_coordinates"], "save": ["save_figures"],
})  # fmt: skip


def __getattr__(name: str) -> Any:
    if name == "__all__":
        return __dir__()
    try:
        return _drawing(name)
    except AttributeError:
        figure = getattr(import_module("paraflex.plots.charts"), name, None)
        if figure is None:
            raise
        return figure


def __dir__() -> list[str]:
    from paraflex.figures.catalogue import all_figures

    return sorted({*_drawings, *all_figures()})
