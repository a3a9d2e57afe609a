"""Provenance of results: facts of a run, and the command that repeats it."""

import json
import shlex
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from paraflex.errors import InputError
from paraflex.files import library_names
from paraflex.folders import check_listed
from paraflex.results.findings import FINDINGS, finished, verdict_of
from paraflex.writing import read_json

# Options of each command that are repeated, in order; "model" stands for the arguments that name it.
_FRAMES, _PLAN = ("reference", "curvature"), ("duration", "samples", "assembly")
_LINEAR = (
    "results", "model", "modes", "forces", "prescribed", "pose", "at", "along", "path", "assembly", "coordinates",
    "balanced",
)  # fmt: skip
_DRIVEN = ("model", "drive", "path", "start", "end", "speed", *_PLAN, "assemblies")
_COMMANDS: Mapping[str, Sequence[str]] = {
    "run": (
        "model", "path", "modes", "controllers", *_PLAN, "tolerance", "tolerance_per", "control", "method", "step",
        "constraints", "segments", "reduced", *_FRAMES, "after", "max_steps", "method_parameters", "alpha", "beta",
        "automatic_gains", "rigid", "ked", "balanced", "geometry", "stop_at", "metrics",
    ),
    "verify": ("model", "path", "modes", "fidelities", "engines", *_PLAN, "tolerance", "method", "segments", *_FRAMES),
    "statics": ("model", "loads", "torques", "moved", "held", "stiffness", "steps", "buckling", "metrics", "assembly"),
    "kinematics": _DRIVEN,
    "torques": (*_DRIVEN, "mode", "fluctuation"),
    "linearise": _LINEAR,
    "reduce": (*_LINEAR, "states", "methods", "until", "error", "basis"),
}  # fmt: skip
# Flags that are not the name of the option.
_FLAGS = {
    "tolerance": "--tol", "modes": "--mode", "controllers": "--controller", "method_parameters": "--method-parameter",
    "fidelities": "--model", "engines": "--engine", "loads": "--load", "torques": "--torque", "moved": "--move",
    "held": "--hold", "forces": "--force-at", "set": "--set", "methods": "--method", "start": "--from", "end": "--to",
    "metrics": "--metric",
}  # fmt: skip


def asked(data: xr.Dataset) -> dict[str, Any]:
    """Return the request of the command that made the results; empty if it is not known."""
    try:
        return json.loads(data.attrs["parameters"]).get("run", {})
    except (KeyError, ValueError):
        return {}


def model_words(run: Mapping[str, Any]) -> str:
    """Return the fidelity of the model that a request asks for, in words."""
    if run.get("rigid"):
        return "rigid links"
    if run.get("ked"):
        return "kineto-elastodynamics"
    if run.get("segments"):
        return f"{run['segments']} finite segments on the longest link"
    return f"{run.get('geometry', 'linear')} geometry"


def verdict_word(data: xr.Dataset, failed: Collection[str] = ()) -> str:
    """Return the verdict on results: "failed", "partly failed" if some modes are complete, or that of their findings.

    The findings give "sound", "doubtful" or "wrong"; the verdict is empty for files of earlier versions.

    Parameters
    ----------
    data : xarray.Dataset
        Results of a run.
    failed : collection of str
        Modes that could not start.
    """
    whole = finished(data)
    if failed or not whole.all():
        return "partly failed" if whole.any() else "failed"
    return verdict_of(data).level.value if FINDINGS in data.attrs else ""


def common_facts(data: xr.Dataset) -> list[tuple[str, str]]:
    """Return duration, method, step or tolerance, and versions, as names and values."""
    time, attrs = data["time"].values, data.attrs
    facts = [("duration", f"{time[-1]:g} s, {time.size} samples")]
    method = attrs.get("method")
    if method:
        facts.append(("integration", str(method)))
    run = asked(data)
    tolerance, step = run.get("tolerance", attrs.get("tolerance")), run.get("step")
    if step is not None:
        facts.append(("step", f"{step:g} s"))
    elif tolerance is not None:
        facts.append(("tolerance", f"{tolerance:g} m"))
    facts += [
        (name.removesuffix("_version"), str(attrs[name]))
        for name in ("paraflex_version", "numba_version", "numpy_version")
        if name in attrs
    ]
    return facts


def mechanism_argument(source: str) -> str:
    """Return the argument of a command for a mechanism: its name in the library, or its file."""
    name = source.removesuffix(".toml")
    return name if name in library_names() else source


def command_line(run: Mapping[str, Any]) -> str:
    """Return the command that repeats a request: that whose name is an entry of it, else `paraflex run`.

    It is empty if the request is not known.
    """
    if "mechanism" not in run and "results" not in run:
        return ""
    command = next((name for name in _COMMANDS if run.get(name) is True), "run")
    given = {name: run.get(name) for name in _COMMANDS[command] if name not in _without_effect(run)}
    if command == "statics" and run.get("held") == []:
        given["held"] = ["none"]
    words = ["paraflex", command]
    for name, value in given.items():
        if name == "model":
            words += _model_arguments(run)
        elif name == "results":
            words += [value] if value else []
        else:
            words += _option(_FLAGS.get(name, f"--{name.replace('_', '-')}"), value)
    return shlex.join(words)


def _without_effect(run: Mapping[str, Any]) -> set[str]:
    """Return the kept options that have no effect beside others, and those that follow from them."""
    without = {"model", "set"} if "results" in run else set()
    without |= {"geometry"} if any(run.get(name) for name in ("rigid", "ked", "segments")) else set()
    gains = run.get("constraints") == "baumgarte" and not run.get("automatic_gains")
    return without if gains else without | {"alpha", "beta"}


def _model_arguments(run: Mapping[str, Any]) -> list[str]:
    """Return the arguments of a command for a model, with its overridden values."""
    given = {name: value if isinstance(value, str) else json.dumps(value) for name, value in run.get("set", {}).items()}
    return [mechanism_argument(run["mechanism"]), *_option("--set", given),
            *_option("--allow-outside", run.get("allow_outside"))]  # fmt: skip


def _option(flag: str, value: Any) -> list[str]:
    """Return the words of an option: a flag, a value, or one value after the other; none if it is not given."""
    if value is None or value is False:
        return []
    if value is True:
        return [flag]
    values = [f"{name}={one}" for name, one in value.items()] if isinstance(value, Mapping) else value
    values = [values] if isinstance(values, str | int | float) else values
    # A value may begin with a minus.
    return [word for one in map(str, values)
            for word in ([f"{flag}={one}"] if one.startswith("-") else [flag, one])]  # fmt: skip


def summary_beside(file: Path) -> dict[str, Any]:
    """Read the summary that a command wrote beside its data, as the manifest of the folder lists it.

    Raises
    ------
    InputError
        The file is missing, damaged, or not of paraflex.
    """
    numbers = read_json(file)
    check_listed(file, "run the command again")
    if not isinstance(numbers.get("modes"), dict):
        raise InputError("is not a summary that paraflex wrote", field=str(file), remedy="run the command again")
    return numbers
