"""A study's folder opened again: its parameters and mechanism, and single runs repeated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from paraflex.campaign import STUDY, read_study
from paraflex.designs.measure import measure
from paraflex.designs.run import Task, dataset_of, ready, run_mode
from paraflex.designs.samples import Varied
from paraflex.designs.setting import Setting, digest, versions
from paraflex.errors import InputError

_AGAIN = "run the study again, in a new folder"


@dataclass(frozen=True)
class StudyFolder:
    """Content of a folder's `study.json`.

    Attributes
    ----------
    folder : Path
    name : str
    runs : int or None
        Of the whole study; None of a search, which has no number of its own.
    sampling : str
        "grid", "sobol", ...; "search" of an optimisation.
    setting : Setting
    ranges : mapping of str to (float, float, str)
        Lowest and highest value of parameters and how they are spread, where the folder tells.
    versions : mapping of str to str
        That its runs were made by.
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
        """Whether runs made now would equal those of the folder to the last bit."""
        return all(versions()[name] == had for name, had in self.versions.items() if name in versions())


def study_account(
    name: str, setting: Setting, parameters: Sequence[Varied], content: Mapping[str, Any], **more: Any
) -> dict[str, Any]:
    """Content of the `study.json` of a folder.

    Parameters
    ----------
    name : str
    setting : Setting
    parameters : sequence of Varied
    content : mapping
        What the results depend on, in plain values.
    **more
        More of `StudyFolder`.
    """
    account = {"content": digest(content), "versions": dict(setting.versions), "format": 1, "name": name}
    return account | more | {"ranges": {each.name: _range(each) for each in parameters}, "study": content}


def open_study(folder: str | Path) -> StudyFolder:
    """The study whose results a folder holds.

    Raises
    ------
    InputError
        `study.json` cannot be read, or is not that of a study.
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


def run_again(
    setting: Setting,
    values: Sequence[float],
    path: str,
    mode: str,
    watch: Callable[[float], None] | None = None,
) -> tuple[xr.Dataset, dict[str, float | int]]:
    """A run of a design with all its samples, and its metrics.

    Parameters
    ----------
    setting : Setting
    values : sequence of float
        Of the parameters.
    path, mode : str
    watch : callable, optional
        Called with the time reached in the run [s]; a KeyboardInterrupt from it abandons the run.

    Raises
    ------
    InputError, NumericalError
        It cannot be run.
    Abandoned
        See `watch`.
    """
    planned, options = ready(setting, Task(0, 0, tuple(values), path))
    run = run_mode(planned, mode, options, watch)
    return dataset_of(run, options), measure(run, setting.metrics)


def _range(parameter: Varied) -> list[Any]:
    """Its lowest and highest value, and "log", "linear" or "values"."""
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
