"""Provenance of results: facts of a run, and the command that repeats it."""

from __future__ import annotations

import json
import shlex
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from paraflex.errors import InputError
from paraflex.files import library_names
from paraflex.folders import check_listed
from paraflex.results.findings import FINDINGS, finished, verdict_of
from paraflex.writing import read_json

# Flags and fields of a request that the command line repeats.
_RUN_FLAGS = ("rigid", "ked", "balanced")
_REQUEST_FIELDS = (
    "duration",
    "samples",
    "tolerance",
    "tolerance_per",
    "control",
    "method",
    "step",
    "constraints",
    "segments",
    "reduced",
    "reference",
    "curvature",
    "after",
    "assembly",
    "max_steps",
)
_GIVEN = {name: f"--{name.replace('_', '-')}" for name in _REQUEST_FIELDS} | {"tolerance": "--tol"}


def asked(data: xr.Dataset) -> dict[str, Any]:
    """Return the request of the command that made the results; empty if it is not known."""
    try:
        return json.loads(data.attrs["parameters"]).get("run", {})
    except (KeyError, ValueError):
        return {}


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


def run_command_line(run: dict[str, Any]) -> str:
    """Return the `paraflex run` command of a request; empty if it is not known."""
    if "mechanism" not in run:
        return ""
    words = ["paraflex", "run", *model_words(run)]
    if "path" in run:
        words += ["--path", run["path"], *repeated("--mode", run.get("modes"))]
    words += repeated("--controller", run.get("controllers"))
    for name, flag in _GIVEN.items():
        if run.get(name) is not None:
            words += [flag, str(run[name])]
    parameters = run.get("method_parameters") or {}
    words += repeated("--method-parameter", (f"{name}={value}" for name, value in parameters.items()))
    if run.get("constraints") == "baumgarte" and not run.get("automatic_gains"):
        words += [f"--{name}={run[name]}" for name in ("alpha", "beta") if name in run]
    if run.get("automatic_gains"):
        words.append("--automatic-gains")
    words += [f"--{name}" for name in _RUN_FLAGS if run.get(name)]
    if run.get("geometry") and not any(run.get(name) for name in ("rigid", "ked", "segments")):
        words += ["--geometry", run["geometry"]]
    return shlex.join(words + repeated("--stop-at", run.get("stop_at")))


def verify_command_line(run: dict[str, Any], data: xr.Dataset, engines: Sequence[str]) -> str:
    """Return the `paraflex verify` command of a request; empty if it is not known."""
    if "mechanism" not in run:
        return ""
    words = ["paraflex", "verify", *model_words(run), "--path", run["path"], *repeated("--mode", run.get("modes"))]
    for name in (str(model) for model in data["model"].values):
        words += ["--engine" if name in engines else "--model", name]
    time = data["time"].values
    words += ["--duration", str(time[-1]), "--samples", str(time.size)]
    for name in ("tolerance", "method", "segments", "reference", "curvature"):
        if run.get(name) is not None:
            words += [_GIVEN[name], str(run[name])]
    return shlex.join(words)


def model_words(run: dict[str, Any]) -> list[str]:
    """Return the arguments of a command for a model, with its overridden values."""
    given = run.get("set") or {}
    texts = (f"{name}={value if isinstance(value, str) else json.dumps(value)}" for name, value in given.items())
    outside = ["--allow-outside"] if run.get("allow_outside") else []
    return [mechanism_argument(run["mechanism"]), *repeated("--set", texts), *outside]


def repeated(flag: str, values: Iterable[str] | None) -> list[str]:
    """Return the words of an option that is repeated for each value."""
    return [word for value in values or () for word in (flag, value)]


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
