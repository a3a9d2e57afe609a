"""`paraflex reduce`: linear models of few states beside the full ones."""

from __future__ import annotations

import time

import xarray as xr

from paraflex.cli import COMPLETE
from paraflex.cli.commands.models import ReduceRequest
from paraflex.cli.ending import say_where, tell
from paraflex.cli.linear_models import AskedModels, asked_models
from paraflex.cli.reduce_tables import print_reduction
from paraflex.cli.replacing import hold_results
from paraflex.cli.request import flagged
from paraflex.folders import REDUCED_MODELS
from paraflex.linear.reduced import ReductionMethod
from paraflex.results.reduction_data import reduction_dataset, reduction_summary

_METHODS = (ReductionMethod.CRAIG_BAMPTON.value, ReductionMethod.MODAL.value)


def reduce_command(request: ReduceRequest) -> int:
    """Reduce the models of every mode, print what is left of them, write files where that is asked for; exit code."""
    began = time.perf_counter()
    make = asked_models(request, "reduce")
    if request.out is None:
        _tell(_data(make(), request), request)
        return COMPLETE
    with hold_results(request.out, REDUCED_MODELS, force=request.force) as folder:
        data = _data(make(), request)
        _tell(data, request)
        from paraflex.cli.writing import write_drawn, write_numbers

        write_numbers(data, reduction_summary(data), folder, ("reduced.nc", "reduced.json"))
        write_drawn(data, folder)
    if not request.json:
        say_where(began, "numbers, figures", folder.path)
    return COMPLETE


def _data(found: AskedModels, request: ReduceRequest) -> xr.Dataset:
    asked = {name: getattr(request, name) for name in ("states", "methods", "until", "error")}
    parameters = {**found.parameters, "run": found.parameters["run"] | asked}
    with flagged(request):
        return reduction_dataset(
            found.models, request.states, methods=request.methods or _METHODS, until=request.until, error=request.error,
            parameters=parameters,
        )  # fmt: skip


def _tell(data: xr.Dataset, request: ReduceRequest) -> None:
    tell(reduction_summary(data), lambda out: print_reduction(out, data), as_json=request.json, doubts=())
