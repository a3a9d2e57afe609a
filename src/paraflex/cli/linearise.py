"""`paraflex linearise`: linear models of a mechanism in its actuation modes, their poles and zeros."""

from __future__ import annotations

import xarray as xr

from paraflex.cli import COMPLETE
from paraflex.cli.commands.models import LineariseRequest
from paraflex.cli.commands.requests import flagged
from paraflex.cli.dataset_command import DatasetCommand
from paraflex.cli.linear_models import RequestedModels, moments_along, requested_models
from paraflex.cli.linearise_tables import print_linear
from paraflex.results.linear_data import linear_dataset
from paraflex.results.linear_summary import linear_summary


def linearise_command(request: LineariseRequest) -> int:
    """Linearise in every mode, print poles and zeros and, with --out, write files; return the exit code."""
    make = requested_models(request, "linearise")
    _COMMAND.run(request.files, lambda: _data(make(), request))
    return COMPLETE


def _data(found: RequestedModels, request: LineariseRequest) -> xr.Dataset:
    with flagged(request):
        along = [] if request.along is None else moments_along(found, request.along)
        return linear_dataset(found.models, along=along, parameters=found.parameters)


_COMMAND = DatasetCommand("linear", linear_summary, print_linear, findings=())
