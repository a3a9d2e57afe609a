"""`paraflex reduce`: linear models with few states, compared with the full ones."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from rich.console import Console

from paraflex.cli import COMPLETE
from paraflex.cli.commands.models import ReduceRequest
from paraflex.cli.commands.requests import flagged
from paraflex.cli.dataset_command import DatasetCommand
from paraflex.cli.linear_models import AskedModels, asked_models, pose_asked
from paraflex.cli.tables import number, plain_table, print_titled
from paraflex.errors import InputError, renamed
from paraflex.linear import PosesAlong, poses_along
from paraflex.linear.reduced import ReductionMethod
from paraflex.results.linear_data import HOLDINGS
from paraflex.results.reduction_along import along_heads, along_rows
from paraflex.results.reduction_data import FULL, percent_off, reduction_dataset, reduction_summary

_METHODS = (ReductionMethod.CRAIG_BAMPTON.value, ReductionMethod.MODAL.value)
Array = NDArray[np.float64]

# Largest numbers of outputs and of frequencies in a row; reduced.json has all.
_OUTPUTS, _FREQUENCIES = 8, 4


def reduce_command(request: ReduceRequest) -> int:
    """Reduce the models of every mode, print the results and, with --out, write files; return the exit code."""
    make = asked_models(request, "reduce")
    _COMMAND.run(request.files, lambda: _data(make(), request))
    return COMPLETE


def _data(found: AskedModels, request: ReduceRequest) -> xr.Dataset:
    asked = {name: getattr(request, name) for name in ("states", "methods", "until", "error")}
    asked |= {} if request.basis is None else {"basis": request.basis}
    parameters = {**found.parameters, "run": found.parameters["run"] | asked}
    with flagged(request):
        return reduction_dataset(
            found.models, request.states, methods=request.methods or _METHODS, until=request.until, error=request.error,
            along=_along(found, request), parameters=parameters,
        )  # fmt: skip


def _along(found: AskedModels, request: ReduceRequest) -> list[PosesAlong]:
    """Return the poses along the path for each mode, with the pose whose basis is used; empty without --along."""
    if request.along is None:
        if request.basis is not None:
            raise InputError("is the pose whose basis is taken along a path", field="--basis", value=request.basis,
                             remedy="give the number of poses: --along 21")  # fmt: skip
        return []
    pose = None if request.basis is None else pose_asked(found.model, request.basis, request.assembly, "--basis")
    with renamed("--along", only="count"):
        return [poses_along(motion, request.along, mode=mode, pose=pose, **found.ports)
                for motion, mode in zip(found.motions, found.modes, strict=True)]  # fmt: skip


def print_reduction(out: Console, data: xr.Dataset) -> None:
    """Print reduced models: states needed, errors, frequencies, error bounds, and errors along the path."""
    attrs = data.attrs
    until, accuracy = float(attrs["until"]), float(attrs["accuracy"])
    kept, full = int(attrs["kept_states"]), int(attrs["full_states"])
    out.print(f"{attrs['mechanism']}, about {attrs['about']}: {kept} of {full} states", soft_wrap=True)
    outputs = [str(name) for name in data["output"].values][:_OUTPUTS]
    pairs = [(str(mode), str(name)) for mode in data["mode"].values for name in data["reduction"].values]
    needed = ([mode, name, *(_states(data["states"].sel(mode=mode, reduction=name, output=one).item())
                             for one in outputs)] for mode, name in pairs)  # fmt: skip
    print_titled(out, f"States needed for {100.0 * accuracy:.3g} % up to {until:g} Hz",
                 plain_table("mode", "method", numbers=outputs, rows=needed))  # fmt: skip
    errors = ([mode, name, *(f"{data['largest_error'].sel(mode=mode, reduction=name, output=one).item():.1e}"
                             for one in outputs)] for mode, name in pairs)  # fmt: skip
    print_titled(out, f"Largest error with {kept} states up to {until:g} Hz",
                 plain_table("mode", "method", numbers=outputs, rows=errors))  # fmt: skip
    heads = [str(k + 1) for k in range(_FREQUENCIES)]
    table = plain_table("mode", "motors", "states", numbers=heads, rows=_frequency_rows(data))
    print_titled(out, "Frequencies [Hz], with the errors of reduced models below", table)
    for mode, name in pairs:
        bound = float(data["bound"].sel(mode=mode, reduction=name))
        if not math.isnan(bound):
            out.print(f"mode {mode}, {name}: the gain of the error is at most {bound:.3g}", soft_wrap=True)
    if rows := list(along_rows(data)):
        title, stretch = along_heads(data)
        cells = ([*one[:3], *(number(error, ".1e") for error in one[3:6]), one.within] for one in rows)
        heads = ["largest", *HOLDINGS, stretch]
        print_titled(out, title, plain_table("mode", "static shapes", "vibrations", numbers=heads, rows=cells))


def _states(value: float) -> str:
    return "more than 80" if math.isnan(value) else f"{value:.0f}"


def _frequency_rows(data: xr.Dataset) -> Iterator[list[str]]:
    """Yield rows of frequencies with motors free, which all modes share, and with the motors of each mode held."""
    modes = [str(mode) for mode in data["mode"].values]
    held = [("all" if holding == HOLDINGS[0] else mode, mode, holding)
            for holding in HOLDINGS for mode in (modes[:1] if holding == HOLDINGS[0] else modes)]  # fmt: skip
    for shown, mode, holding in held:
        found = data["natural_frequency"].sel(mode=mode, holding=holding)
        for name in map(str, data["variant"].values):
            cells = _cells(found.sel(variant=name).values, found.sel(variant=FULL).values, full=name == FULL)
            if any(cells):
                yield [shown, holding, "all" if name == FULL else name, *cells]


def _cells(values: Array, exact: Array, *, full: bool) -> list[str]:
    cells = []
    for value, right in zip(values[:_FREQUENCIES], exact, strict=False):
        off = "" if full or math.isnan(right) else f"\n{percent_off(value, right)}"
        cells.append("" if math.isnan(value) else f"{value:.4g}{off}")
    return cells


_COMMAND = DatasetCommand("reduction", reduction_summary, print_reduction, doubts=())
