"""Repetition of the runs of a results folder from its provenance, as results do not store all data of a run."""

import json
import shlex
from collections.abc import Iterator, Sequence
from functools import partial

import xarray as xr
from typer.main import Typer, get_command

from paraflex.compilation import compile_kernels_for
from paraflex.designs.own_motion import own_run
from paraflex.errors import InputError
from paraflex.files import Model
from paraflex.mechanism import parse_mode
from paraflex.motion import MotionRun
from paraflex.reports.provenance import asked, command_line
from paraflex.results.kinds import kind_of
from paraflex.results.storage import open_results
from paraflex.tracking import TrackingRun, simulate
from .along import own_method, requested_tasks
from .commands.requests import filled, with_options
from .commands.runs import RunRequest
from .integration import integration_options
from .motion import own_motion, start_of
from .request import acting_controllers, find_path, requested_model
from .run import requested_mechanism
from .tables import PlainConsole

_OTHER = "name the folder of paraflex run"


def repeated_runs(results: str, modes: Sequence[str] = ()) -> tuple[Model, Iterator[TrackingRun | MotionRun]]:
    """Return the model of stored results, and an iterator that repeats their runs in all modes or in `modes`.

    Raises
    ------
    InputError
        The results are not of a run, are of kineto-elastodynamics, or lack their provenance; their model's file has
        changed; or they lack one of the modes.
    """
    data = open_results(results)
    if kind_of(data) not in ("tracking", "motion"):
        raise InputError(f"these are results of kind {kind_of(data)}", field=results, remedy=_OTHER)
    request = _request(data, results)
    model = _model(data, request, results)
    names = [str(name) for name in data["mode"].values] if "mode" in data.dims else []
    for name in modes:
        if name not in names:
            raise InputError(
                "no such mode in these results", field="--mode", value=name,
                remedy=f"choose from {', '.join(names)}" if names else "leave it out: the run has none",
            )  # fmt: skip
    return model, _runs(model, request, asked(data).get("path"), modes or names)


def _model(data: xr.Dataset, request: RunRequest, results: str) -> Model:
    """Return the model of a run from its file; raise InputError if the file has changed since."""
    model = requested_model(request.model)
    then, now = json.loads(data.attrs["parameters"]).get("model"), json.loads(json.dumps(dict(model.parameters)))
    if then != now:
        raise InputError(
            f"these results are of another version of {request.model.name}", field=results,
            remedy="run it again, then linearise",
        )  # fmt: skip
    return model


def _request(data: xr.Dataset, results: str) -> RunRequest:
    run = asked(data)
    if not run or run.get("ked"):
        why = (
            "of kineto-elastodynamics, which has no equations of motion"
            if run
            else "stored without the command that made them"
        )
        raise InputError(f"these results are {why}", field=results, remedy=_OTHER)
    app = Typer(add_completion=False)
    app.command("run")(with_options(RunRequest, lambda _: None))
    command = get_command(app)
    return filled(RunRequest, command.make_context("run", shlex.split(command_line(run))[2:]).params)


def _runs(
    model: Model, request: RunRequest, path: str | None, modes: Sequence[str]
) -> Iterator[TrackingRun | MotionRun]:
    mechanism, options = requested_mechanism(model, request), integration_options(request, model.study)
    compile_kernels_for(mechanism, PlainConsole(stderr=True).print)
    controllers = acting_controllers(model, request)
    if path is None:
        study = own_motion(model, request.plan)
        start = start_of(model, mechanism, study.assembly, balanced=request.balanced) or study.assembly
        yield own_run(mechanism, study, controllers, warning=True, start=start, options=options)
        return
    chosen = [parse_mode(mechanism, mode) for mode in modes]
    task = requested_tasks(request, model, mechanism, find_path(model, path), chosen, options)[0]
    run = own_method(request, options, controllers) or partial(simulate, options=options, warning=False)
    for mode in modes:
        yield run(task, mode)
