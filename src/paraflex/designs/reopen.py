"""Reopening of a study's folder: its parameters and mechanism, and repetition of single runs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from paraflex.campaign import STUDY, read_study
from paraflex.errors import InputError
from .measure import measure
from .run import Task, dataset_of, ready, run_mode
from .samples import SweptParameter
from .setting import Setting, digest, versions

_AGAIN = "run the study again, in a new folder"


@dataclass(frozen=True)
class StudyFolder:
    """Contents of a folder's `study.json`.

    Attributes
    ----------
    folder : Path
        Folder of the study.
    name : str
        Name of the study.
    runs : int or None
        Number of runs of the whole study; None for a search, whose number of runs is not fixed.
    sampling : str
        Kind of sampling, such as "grid" or "sobol"; "search" for an optimisation.
    setting : Setting
        Common settings of all runs.
    ranges : mapping of str to (float, float, str)
        Lowest and highest value of each parameter, and "log", "linear" or "values"; empty if the folder has none.
    versions : mapping of str to str
        Versions of the packages with which the runs were made.
    """

    folder: Path
    name: str
    runs: int | None
    sampling: str
    setting: Setting
    ranges: Mapping[str, tuple[float, float, str]]
    versions: Mapping[str, str]

    @property
    def same_versions(self) -> bool:
        """Whether runs made now would be bitwise equal to those of the folder."""
        return all(versions()[name] == had for name, had in self.versions.items() if name in versions())


def study_account(
    name: str, setting: Setting, parameters: Sequence[SweptParameter], content: Mapping[str, Any], **more: Any
) -> dict[str, Any]:
    """Return the contents of the `study.json` of a folder.

    Parameters
    ----------
    name : str
        Name of the study.
    setting : Setting
        Common settings of all runs.
    parameters : sequence of SweptParameter
        Parameters of the study.
    content : mapping
        All inputs that determine the results, as plain values.
    **more
        Further fields of `StudyFolder`.
    """
    account = {"content": digest(content), "versions": dict(setting.versions), "format": 1, "name": name}
    return account | more | {"ranges": {each.name: _range(each) for each in parameters}, "study": content}


def open_study(folder: str | Path) -> StudyFolder:
    """Return the study whose results a folder holds.

    Raises
    ------
    InputError
        `study.json` cannot be read, or does not describe a study.
    """
    folder = Path(folder)
    account = read_study(folder / STUDY)
    try:
        return StudyFolder(
            folder=folder,
            name=str(account["name"]),
            runs=account.get("runs"),
            sampling=account.get("sampling", "search"),
            setting=_setting(account["study"], account.get("versions", {})),
            ranges={name: (low, high, spread) for name, (low, high, spread) in account.get("ranges", {}).items()},
            versions=account.get("versions", {}),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError("not a study.json of paraflex", field=str(folder / STUDY), remedy=_AGAIN) from error


def rerun(
    setting: Setting,
    values: Sequence[float],
    path: str,
    mode: str,
    watch: Callable[[float], None] | None = None,
) -> tuple[xr.Dataset, dict[str, float | int]]:
    """Run a design again, and return the dataset with all samples and the metrics.

    Parameters
    ----------
    setting : Setting
        Common settings of the study.
    values : sequence of float
        Values of the parameters.
    path, mode : str
        Names of the path and of the actuation mode; empty for a run without a path.
    watch : callable, optional
        Function called with the time reached in the run [s]; a KeyboardInterrupt from it abandons the run.

    Raises
    ------
    InputError, NumericalError
        The design cannot be run.
    Abandoned
        The run was abandoned by `watch`.
    """
    planned, options = ready(setting, Task(0, 0, tuple(values), path))
    run = run_mode(planned, mode, watch)
    return dataset_of(run, options), measure(run, setting.metrics)


def _range(parameter: SweptParameter) -> list[Any]:
    """Return the lowest and highest value of a parameter, and "log", "linear" or "values"."""
    if parameter.values is not None:
        return [min(parameter.values), max(parameter.values), "values"]
    return [parameter.low, parameter.high, "log" if parameter.log else "linear"]


def _setting(content: Mapping[str, Any], had: Mapping[str, str]) -> Setting:
    data, parameters = content["mechanism"], content["parameters"]
    return Setting(
        data=data,
        source=str(data["name"]),
        names=tuple(each["name"] for each in parameters),
        places=tuple(tuple(map(tuple, each["places"])) for each in parameters),
        whole=tuple(each["whole"] for each in parameters),
        **{name: tuple(content[name]) for name in ("paths", "modes", "metrics")},
        **{name: content[name] for name in ("duration", "samples", "assembly", "integration")},
        trajectories=False,
        versions=had,
        balanced=content.get("balanced", False),
        statics=content.get("statics", False),
    )
