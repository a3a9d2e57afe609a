"""Storage of results on disk: netCDF files with a versioned schema, written completely or not at all."""

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.errors import suggestion
from paraflex.folders import DATA_FILES, check_listed
from paraflex.interrupts import uninterrupted
from paraflex.seals import NETCDF, PARQUET, check_regular, check_seal, damaged, unreadable, wrong_file
from paraflex.writing import sealed_file
from .following import metric_variables

# Version of the contents of datasets; all versions are readable. 2: shapes and other variables of drawings. 3: errors
# during the motion and after it, vibration about the drift, deflections from the chord, total joint forces (before,
# only the normal part for sliding joints), joint moments, multipliers of all runs.
SCHEMA = 3
_FOLLOWING = 3
# Names of the file that commands write into their folder, and folder of the runs of a sweep.
FILES = tuple(name for name in DATA_FILES if name.endswith(".nc"))
_TRAJECTORIES = "trajectories"
_MOST_NAMED = 3
# Smaller arrays are not compressed: the description of the compression takes more space than it saves [bytes].
_LARGE = 16384
# Size of the pieces of a test write, which determines why a file cannot be written [bytes].
_PIECE = 1 << 20
# First bytes of netCDF files: HDF5, or the classic formats.
_NETCDF = (NETCDF, b"CDF\x01", b"CDF\x02", b"CDF\x05")
_OURS = "name a results.nc that paraflex wrote"
_AGAIN = "copy it again, or delete it and run the same command again"


def origin(parameters: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the provenance attributes of a dataset: requested parameters, version of paraflex, schema."""
    text = json.dumps(parameters or {}, sort_keys=True)
    return {"parameters": text, "paraflex_version": version("paraflex"), "schema": SCHEMA}


@checked_arguments()
def save_results(data: xr.Dataset, path: str | Path) -> None:
    """Write a dataset as a compressed netCDF file, completely or not at all.

    Parameters
    ----------
    data : xarray.Dataset
        Results.
    path : str or Path
        File to write; its folder is created if needed.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    write_results(data, Path(path))


def write_results(data: xr.Dataset, path: Path, **options: Any) -> None:
    """Write a dataset as netCDF; see `whole_file` for the options and errors. Ctrl-C is deferred to the end.

    The netCDF library acquires locks in Python code. A lock left acquired by an exception would block all later reads
    and writes.
    """
    with sealed_file(path, **options) as unfinished, uninterrupted():
        _write_netcdf(data, unfinished)


def _write_netcdf(data: xr.Dataset, file: Path) -> None:
    # Large arrays are compressed at the lowest level, with bytes of equal significance grouped.
    encoding = {
        str(name): {"zlib": True, "complevel": 1, "shuffle": True}
        for name, values in data.data_vars.items()
        if values.nbytes >= _LARGE and values.dtype.kind in "fiu"
    }
    try:
        data.to_netcdf(file, engine="netcdf4", encoding=encoding)
    except (OSError, RuntimeError) as error:
        # The library does not report the reason reliably; writing as many bytes without it raises the actual error.
        with file.open("wb") as plain:
            for _ in range(1 + data.nbytes // _PIECE):
                plain.write(bytes(_PIECE))
        raise OSError(f"by the netCDF library: {error}") from error


@checked_arguments()
def open_results(path: str | Path) -> xr.Dataset:
    """Read a dataset that a command or `save_results` wrote into memory.

    Parameters
    ----------
    path : str or Path
        Folder of a run or verification, or a file. Files of earlier versions of the schema are readable; variables that
        they do not have (shapes in schema 1) are missing, and tracking errors and vibration are computed anew with the
        current formulas.

    Raises
    ------
    InputError
        The path does not exist, is a folder without results or of a sweep, or is a file that is damaged, of another
        program, or of a later version.
    """
    file = results_file(path)
    return _checked(_read(file), file)


@checked_arguments()
def load_results(path: str | Path) -> xr.Dataset:
    """Read a dataset that `save_results` wrote; equivalent to `open_results`."""
    return open_results(path)


@checked_arguments()
def results_file(path: str | Path) -> Path:
    """Return the netCDF file in a folder of results, or the file itself.

    Raises
    ------
    InputError
        The path does not exist, or is a folder without results or of a study of many runs.
    """
    path = Path(path)
    if not path.exists():
        near = [each.name for each in path.parent.iterdir()] if path.parent.is_dir() else []
        remedy = suggestion(path.name, near) if near and len(near) < 20 else "name the folder of a run"
        raise wrong_file(path, "there is no such file or folder", remedy)
    if not path.is_dir():
        return path
    for name in FILES:
        if (path / name).is_file():
            return path / name
    if (path / "results.parquet").exists() or (path / "study.json").exists():
        runs = [str(run.relative_to(path)) for run in sorted(path.glob(f"{_TRAJECTORIES}/*.nc"))]
        remedy = "it kept no runs: set trajectories = true in the study, or run the design you want with paraflex run"
        if runs:
            more = ", ..." if len(runs) > _MOST_NAMED else ""
            remedy = f"name one of its runs: {', '.join(runs[:_MOST_NAMED])}{more}"
        raise wrong_file(path, "the folder of a study of many runs, whose results are in results.parquet", remedy)
    raise wrong_file(path, f"no results in this folder (no {' or '.join(FILES)})", "name one that paraflex wrote")


def _read(file: Path) -> xr.Dataset:
    try:
        check_regular(file)
        with file.open("rb") as stream:
            start = stream.read(4)
    except OSError as error:
        raise unreadable(error, file) from error
    if start == PARQUET:
        raise wrong_file(file, "a table of many runs, not the results of one", "read it with pandas or pyarrow")
    if start not in _NETCDF:
        raise wrong_file(file, "not a netCDF file" if start else "an empty file", _OURS)
    check_seal(file, _AGAIN)
    check_listed(file, _AGAIN)
    try:
        with uninterrupted():
            return xr.load_dataset(file, engine="netcdf4")
    # The libraries may raise any exception for a damaged file without a seal.
    except Exception as error:
        raise damaged(file, "cut short, or not a readable netCDF file", _AGAIN) from error


def _checked(data: xr.Dataset, file: Path) -> xr.Dataset:
    schema = data.attrs.get("schema")
    if not isinstance(schema, int | np.integer) or "paraflex_version" not in data.attrs:
        raise wrong_file(file, "a netCDF file, but not of paraflex", _OURS)
    if not 1 <= schema <= SCHEMA:
        written = f"paraflex {data.attrs['paraflex_version']} (schema {schema}; this one reads up to {SCHEMA})"
        raise wrong_file(file, f"written by a later version, {written}", "update paraflex")
    if schema < _FOLLOWING and "end_effector" in data:
        return data.assign(metric_variables(data))
    return data
