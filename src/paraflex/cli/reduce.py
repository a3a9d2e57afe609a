"""`paraflex reduce`: linear models with few states, compared with the full ones."""

from __future__ import annotations

import xarray as xr

from paraflex.cli import COMPLETE
from paraflex.cli.commands.models import ReduceRequest
from paraflex.cli.commands.requests import flagged
from paraflex.cli.dataset_command import DatasetCommand
from paraflex.cli.linear_models import RequestedModels, requested_models, requested_pose
from paraflex.cli.reduce_tables import print_reduction
from paraflex.errors import InputError, renamed
from paraflex.linear import PosesAlong, poses_along
from paraflex.linear.reduced import ReductionMethod
from paraflex.results.reduction_data import reduction_dataset
from paraflex.results.reduction_summary import reduction_summary

_METHODS = (ReductionMethod.CRAIG_BAMPTON.value, ReductionMethod.MODAL.value)


def reduce_command(request: ReduceRequest) -> int:
    """Reduce the models of every mode, print the results and, with --out, write files; return the exit code."""
    make = requested_models(request, "reduce")
    _COMMAND.run(request.files, lambda: _data(make(), request))
    return COMPLETE


def _data(found: RequestedModels, request: ReduceRequest) -> xr.Dataset:
    requested = {name: getattr(request, name) for name in ("states", "methods", "until", "error")}
    requested |= {} if request.basis is None else {"basis": request.basis}
    parameters = {**found.parameters, "run": found.parameters["run"] | requested}
    with flagged(request):
        return reduction_dataset(
            found.models, request.states, methods=request.methods or _METHODS, until=request.until, error=request.error,
            along=_along(found, request), parameters=parameters,
        )  # fmt: skip


def _along(found: RequestedModels, request: ReduceRequest) -> list[PosesAlong]:
    """Return the poses along the path for each mode, with the pose whose basis is used; empty without --along."""
    if request.along is None:
        if request.basis is not None:
            raise InputError("is the pose whose basis is taken along a path", field="--basis", value=request.basis,
                             remedy="give the number of poses: --along 21")  # fmt: skip
        return []
    pose = None if request.basis is None else requested_pose(found.model, request.basis, request.assembly, "--basis")
    with renamed("--along", only="count"):
        return [poses_along(motion, request.along, mode=mode, pose=pose, **found.ports)
                for motion, mode in zip(found.motions, found.modes, strict=True)]  # fmt: skip


_COMMAND = DatasetCommand("reduction", reduction_summary, print_reduction, findings=())
