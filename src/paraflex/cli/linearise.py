"""`paraflex linearise`: linear models of a mechanism in its actuation modes, their poles and zeros."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import xarray as xr

from paraflex.cli import COMPLETE
from paraflex.cli.commands.models import LineariseRequest
from paraflex.cli.ending import say_where, tell
from paraflex.cli.linear_models import AskedModels, asked_models, moments_along
from paraflex.cli.linearise_tables import print_linear
from paraflex.cli.replacing import hold_results
from paraflex.cli.request import flagged
from paraflex.folders import LINEAR_MODELS, ResultsFolder
from paraflex.results.linear_data import linear_dataset
from paraflex.results.linear_summary import linear_summary


def linearise_command(request: LineariseRequest) -> int:
    """Linearise in every mode, print poles and zeros, and write files where that is asked for; the exit code."""
    began = time.perf_counter()
    make = asked_models(request, "linearise")
    if request.out is None:
        _tell(_data(make(), request), request)
        return COMPLETE
    with hold_results(request.out, LINEAR_MODELS, force=request.force) as folder:
        data = _data(make(), request)
        _tell(data, request)
        _write(data, folder, request)
    if not request.json:
        say_where(began, "numbers, figures", folder.path, report=request.report)
    return COMPLETE


def _data(found: AskedModels, request: LineariseRequest) -> xr.Dataset:
    with flagged(request):
        along = [] if request.along is None else moments_along(found, request.along)
        return linear_dataset(found.models, along=along, parameters=found.parameters)


def _tell(data: xr.Dataset, request: LineariseRequest) -> None:
    tell(linear_summary(data), lambda out: print_linear(out, data), as_json=request.json, doubts=())


def _write(data: xr.Dataset, folder: ResultsFolder, request: LineariseRequest) -> None:
    """Numbers first, then what is drawn of them."""
    from paraflex.cli.writing import write_drawn, write_numbers

    write_numbers(data, linear_summary(data), folder, ("linear.nc", "linear.json"))
    write_drawn(data, folder, _page(data) if request.report else None)


def _page(data: xr.Dataset) -> Callable[[], Any]:
    from paraflex.report.linear import linear_page

    return lambda: linear_page(data)
