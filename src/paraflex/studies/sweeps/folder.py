"""The folder of a sweep: whose results it holds, how far they are, who writes there."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.errors import InputError, OutputError
from paraflex.studies.sweeps.samples import Varied
from paraflex.studies.sweeps.study import SweepStudy, digest
from paraflex.studies.sweeps.table import PARTS, RESULTS, parts, runs_in, whole_file

STUDY, LOCK = "study.json", ".lock"
TRAJECTORIES = "trajectories"


def claim(folder: Path, study: SweepStudy) -> None:
    """Make a folder that of a sweep, or see that it is; see `claim_for`."""
    told = {"name": study.name, "runs": study.runs, "sampling": study.kind, "ranges": ranges_of(study.parameters)}
    claim_for(folder, study.content(), study.setting.versions, told)


def claim_for(folder: Path, content: dict[str, Any], versions: Mapping[str, str], told: dict[str, Any]) -> None:
    """Make a folder that of a study, or see that it is.

    Parameters
    ----------
    folder : Path
    content : dict
        What the study's results depend on, in plain values.
    versions : mapping of str to str
        Of packages.
    told : dict
        What `study.json` says besides.

    Raises
    ------
    InputError
        It holds results of another study, of other versions, or something else.
    OutputError
        It cannot be written.
    """
    said = {"content": digest(content), "versions": dict(versions)}
    file = folder / STUDY
    if file.exists():
        _check_same(folder, read_told(file), said)
        return
    try:
        others = [each.name for each in folder.iterdir() if each.name != LOCK] if folder.exists() else []
    except OSError as error:
        raise _no_folder(folder, error) from error
    if others:
        raise InputError(
            f"the folder holds other files ({', '.join(sorted(others)[:3])})", field="--output", value=str(folder),
            remedy="name a new folder",
        )  # fmt: skip
    with whole_file(file) as unfinished:
        unfinished.write_text(
            json.dumps(said | {"format": 1} | told | {"study": content}, indent=2, default=str) + "\n", encoding="utf-8"
        )


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Keep others from writing to a folder; the system lets go of it when this process ends, however it does.

    Raises
    ------
    InputError
        Another process writes to it.
    OutputError
        It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / LOCK).open("w")
    except OSError as error:
        raise _no_folder(folder, error) from error
    with lock:
        _lock(lock.fileno(), folder)
        yield


def done_runs(folder: Path, total: int) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Which runs have a row, and the smallest and largest run of each part (parts, 2).

    Raises
    ------
    OutputError
        A part or the table is damaged.
    """
    done, ranges = np.zeros(total, dtype=bool), []
    table = folder / RESULTS
    if table.exists():
        done[runs_in(table)] = True
        for left in parts(folder):
            left.unlink()
        return done, np.zeros((0, 2), dtype=np.int64)
    for part in parts(folder):
        runs = runs_in(part)
        done[runs] = True
        ranges.append((int(runs.min()), int(runs.max())))
    return done, np.array(ranges, dtype=np.int64).reshape(-1, 2)


def forget_unfinished(folder: Path) -> None:
    """Remove files that a process left half written when it was killed."""
    for place in (folder, folder / PARTS, folder / TRAJECTORIES):
        for file in place.glob("*.part"):
            file.unlink(missing_ok=True)


def _check_same(folder: Path, found: dict, said: dict) -> None:
    if found.get("content") != said["content"]:
        raise InputError(
            "the folder holds results of another study, or of this one before it was changed", field="--output",
            value=str(folder), remedy="name a new folder",
        )  # fmt: skip
    for name, wanted in said["versions"].items():
        had = found.get("versions", {}).get(name)
        if had != wanted:
            raise InputError(
                f"the folder's results were begun with {name} {had}, this is {wanted}: they would not be comparable",
                field="--output", value=str(folder), remedy=f"name a new folder, or install {name} {had}",
            )  # fmt: skip


def ranges_of(parameters: Sequence[Varied]) -> dict[str, list]:
    """Lowest and highest value of each parameter, and "log", "linear" or "values"."""
    out = {}
    for parameter in parameters:
        if parameter.values is not None:
            out[parameter.name] = [min(parameter.values), max(parameter.values), "values"]
        else:
            out[parameter.name] = [parameter.low, parameter.high, "log" if parameter.log else "linear"]
    return out


def read_told(file: Path) -> dict:
    """What a `study.json` says.

    Raises
    ------
    InputError
        It cannot be read, or is none of ours.
    """
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        found = None
    if not isinstance(found, dict) or "content" not in found:
        raise InputError("not the study of a sweep", field=str(file), remedy="name a new folder")
    return found


def _lock(descriptor: int, folder: Path) -> None:
    if os.name != "posix":
        return
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(
            "another process writes to it", field="--output", value=str(folder), remedy="wait for it, or stop it"
        ) from None
    except OSError:
        # A file system without locks.
        return


def _no_folder(folder: Path, error: OSError) -> OutputError:
    reason = (error.strerror or str(error)).lower()
    return OutputError(
        f"cannot be written ({reason})", field="--output", value=str(folder), remedy="choose another folder"
    )
