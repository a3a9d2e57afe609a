"""Results on disk: netCDF with a versioned schema, written whole or not at all, and read again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError, suggestion
from paraflex.folders import check_listed
from paraflex.interrupts import uninterrupted
from paraflex.results.following import metric_variables
from paraflex.seals import NETCDF, PARQUET, check_regular, check_seal, damaged, unreadable
from paraflex.writing import sealed_file

# Version of what datasets hold; those from 1 on stay readable. 2: shapes, and what else drawings are made from. 3:
# errors during the motion and after it, vibration about the drift, deflections from the chord; joint forces are whole
# (before, of joints that slide their normal part), joint moments, multipliers of all runs.
SCHEMA = 3
_FOLLOWING = 3
# What commands call the file in their folder, and where a sweep keeps its runs.
FILES = ("results.nc", "verify.nc", "linear.nc", "statics.nc", "reduced.nc", "laws.nc")
_TRAJECTORIES = "trajectories"
_MOST_NAMED = 3
# Smaller arrays are written as they are: what describes the compression takes more than it gains [bytes].
_LARGE = 16384
# Written at once where the reason is looked for why a file cannot be [bytes].
_PIECE = 1 << 20
# First bytes of what netCDF files are: HDF5, or the classic formats.
_NETCDF = (NETCDF, b"CDF\x01", b"CDF\x02", b"CDF\x05")
_AGAIN = "copy it again, or delete it and run the same command again"


def origin(parameters: Mapping[str, Any] | None) -> dict[str, Any]:
    """Attributes of a dataset that tell what was asked for and what wrote it."""
    asked = json.dumps(parameters or {}, sort_keys=True)
    return {"parameters": asked, "paraflex_version": version("paraflex"), "schema": SCHEMA}


@checked_arguments()
def save_results(data: xr.Dataset, path: str | Path) -> None:
    """Write a dataset as netCDF, compressed; the file appears whole or not at all.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    write_results(data, Path(path), parents=False)


def write_results(data: xr.Dataset, path: Path, **options: Any) -> None:
    """Write a dataset as netCDF; see `whole_file` for the options and errors. Ctrl-C waits for the end.

    Its library takes locks in Python: one that an exception leaves taken lets all who read or write after it wait.
    """
    with sealed_file(path, **options) as unfinished, uninterrupted():
        _write_netcdf(data, unfinished)


def _write_netcdf(data: xr.Dataset, file: Path) -> None:
    # Large arrays are compressed: bytes of like weight together, at the least effort.
    encoding = {
        str(name): {"zlib": True, "complevel": 1, "shuffle": True}
        for name, values in data.data_vars.items()
        if values.nbytes >= _LARGE and values.dtype.kind in "fiu"
    }
    try:
        data.to_netcdf(file, engine="netcdf4", encoding=encoding)
    except (OSError, RuntimeError) as error:
        # The library does not say why, or says something else: writing as much without it does.
        with file.open("wb") as plain:
            for _ in range(1 + data.nbytes // _PIECE):
                plain.write(bytes(_PIECE))
        raise OSError(f"by the netCDF library: {error}") from error


@checked_arguments()
def open_results(path: str | Path) -> xr.Dataset:
    """The dataset that a command or `save_results` wrote, read into memory.

    Parameters
    ----------
    path : str or Path
        The folder of a run or verification, or a file. Files of earlier versions of the schema stay readable; what
        they do not tell (shapes in schema 1) is missing, tracking errors and vibration are those of today's formulas.

    Raises
    ------
    InputError
        Nothing there, a folder without results or of a sweep, a file that is damaged, of something else, or of a
        later version.
    """
    file = results_file(path)
    return _checked(_read(file), file)


@checked_arguments()
def load_results(path: str | Path) -> xr.Dataset:
    """Read a dataset that `save_results` wrote: the same as `open_results`."""
    return open_results(path)


@checked_arguments()
def results_file(path: str | Path) -> Path:
    """The netCDF file that a folder of results or a file name means.

    Raises
    ------
    InputError
        See `open_results`.
    """
    path = Path(path)
    if not path.exists():
        near = [each.name for each in path.parent.iterdir()] if path.parent.is_dir() else []
        remedy = suggestion(path.name, near) if near and len(near) < 20 else "name the folder of a run"
        raise InputError("there is no such file or folder", field=str(path), remedy=remedy)
    if not path.is_dir():
        return path
    for name in FILES:
        if (path / name).is_file():
            return path / name
    if (path / "results.parquet").exists() or (path / "study.json").exists():
        runs = sorted(path.glob(f"{_TRAJECTORIES}/*.nc"))
        more = ", ..." if len(runs) > _MOST_NAMED else ""
        raise InputError(
            "the folder of a study of many runs, whose figures are in results.parquet",
            field=str(path),
            remedy=f"name one of its runs: {', '.join(str(run.relative_to(path)) for run in runs[:_MOST_NAMED])}{more}"
            if runs
            else "it kept no runs: set trajectories = true in the study, or run the design you want with paraflex run",
        )
    raise InputError(
        f"no results in this folder (no {' or '.join(FILES)})", field=str(path), remedy="name one that paraflex wrote"
    )


def _read(file: Path) -> xr.Dataset:
    try:
        check_regular(file)
        with file.open("rb") as stream:
            start = stream.read(4)
    except OSError as error:
        raise unreadable(error, file) from error
    if start == PARQUET:
        raise InputError(
            "a table of many runs, not the results of one", field=str(file), remedy="read it with pandas or pyarrow"
        )
    if start not in _NETCDF:
        raise InputError(
            "not a netCDF file" if start else "an empty file", field=str(file),
            remedy="name a results.nc that paraflex wrote",
        )  # fmt: skip
    check_seal(file, _AGAIN)
    check_listed(file, _AGAIN)
    try:
        with uninterrupted():
            return xr.load_dataset(file, engine="netcdf4")
    # Of a damaged file without a seal the libraries raise whatever its bytes lead them to.
    except Exception as error:
        raise damaged(file, "cut short, or not a readable netCDF file", _AGAIN) from error


def _checked(data: xr.Dataset, file: Path) -> xr.Dataset:
    schema = data.attrs.get("schema")
    if not isinstance(schema, int | np.integer) or "paraflex_version" not in data.attrs:
        raise InputError(
            "a netCDF file, but not of paraflex", field=str(file), remedy="name a results.nc that paraflex wrote"
        )
    if not 1 <= schema <= SCHEMA:
        raise InputError(
            f"written by a later version, paraflex {data.attrs['paraflex_version']} (schema {schema}; this one reads "
            f"up to {SCHEMA})",
            field=str(file),
            remedy="update paraflex",
        )
    if schema < _FOLLOWING and "end_effector" in data:
        return data.assign(metric_variables(data))
    return data
