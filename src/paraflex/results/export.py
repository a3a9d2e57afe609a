"""Export of results to other programs: tables as CSV or Parquet, a struct for MATLAB, netCDF."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import NDArray
from paraflex.errors import InputError, suggestion
from paraflex.folders import RESULT_KINDS, added_to
from paraflex.formatting import output_unit
from paraflex.writing import whole_file
from .beam_stresses import SECTION
from .controllers import SAMPLE, controller_names, controller_variables, dimension
from .kinds import kind_of
from .storage import save_results
from .tables import read_parquet, spreadsheet_table, write_parquet

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

EXPORT_FORMATS = ("csv", "parquet", "mat", "netcdf")
ENDINGS = {"csv": ".csv", "parquet": ".parquet", "mat": ".mat", "netcdf": ".nc"}
FIGURES_TABLE, SHAPES, SECTIONS = "figures", "shapes", "sections"
LAWS = "laws"
# Dimensions of the rows of tables, outermost first; the independent variable is the innermost.
_ROW_DIMENSIONS = ("model", "law", "mode")
# Longest name of a variable or field in MATLAB.
_LONGEST_NAME = 63


@checked_arguments()
def result_tables(data: xr.Dataset, *, shapes: bool = False) -> dict[str, pd.DataFrame]:
    """Return results as tidy tables, one row per observation, with NaN at times that a run did not reach.

    Parameters
    ----------
    data : xarray.Dataset
        Results of a run with or without a path, of a verification, of equilibria, of reduced models or of a comparison
        of control laws.
    shapes : bool
        Whether to include deformed shapes and section forces along beams, which have many rows.

    Returns
    -------
    dict of str to pandas.DataFrame
        `time_series`: one row per model (of a verification), mode and time. A variable with more dimensions has one
        column per label, such as `torque_tau1` or `joint_force_B1_x`. For equilibria the table is called `steps`, for
        reduced models `frequencies`. `figures`: one row per model and mode. `shapes`: one row per model, mode, time and
        drawn point. `sections`: one row per model, mode, time and place along a beam. `controller_NAME`: one row per
        mode and sample of a controller. For control laws there is only `laws`, with one row per law and mode. The
        `attrs` of the tables hold `units` and `meanings` of the columns.

    Raises
    ------
    InputError
        The results are linear models, which are not tables.
    """
    kind = RESULT_KINDS[kind_of(data)]
    kind.refuse("table", "to")
    if kind.along is None:
        return {kind.name: _table(data, list(data.data_vars), _ROW_DIMENSIONS)}
    drawn = [name for name in data.data_vars if "station" in data[name].dims]
    forces = [name for name in data.data_vars if SECTION in data[name].dims]
    dim, first = kind.along
    rows = (*_ROW_DIMENSIONS, dim)
    along = [name for name in data.data_vars if dim in data[name].dims and name not in (*drawn, *forces)]
    controlled = {name: controller_variables(name) for name in controller_names(data)}
    others = {*drawn, *forces, *along, *(name for names in controlled.values() for name in names)}
    single = [name for name in data.data_vars if name not in others]
    tables = {first: _table(data, along, rows)} if along or not single else {}
    if single:
        tables[FIGURES_TABLE] = _table(data, single, _ROW_DIMENSIONS)
    for name, own in controlled.items():
        tables[f"controller_{name}"] = _table(data, own, (*_ROW_DIMENSIONS, dimension(SAMPLE, name)))
    if shapes and drawn:
        stations = data.assign_coords(station=np.arange(data.sizes["station"]))
        tables[SHAPES] = _table(stations, ["station_body", *drawn], (*rows, "station"))
    if shapes and forces:
        stations = data.assign_coords({SECTION: np.arange(data.sizes[SECTION])})
        tables[SECTIONS] = _table(stations, ["section_body", "section_place", *forces], (*rows, SECTION))
    return tables


def _table(data: xr.Dataset, names: Sequence[Any], rows: Sequence[str]) -> pd.DataFrame:
    import pandas as pd

    rows = [dim for dim in rows if dim in data.dims]
    every = xr.DataArray(np.zeros([data.sizes[dim] for dim in rows]), {dim: data[dim] for dim in rows}, rows)
    columns: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    meanings: dict[str, str] = {}
    for name in (*rows, *names):
        # A variable is repeated over row dimensions that it does not have.
        array = data[name].broadcast_like(every)
        others = [dim for dim in array.dims if dim not in rows]
        values = array.transpose(*rows, *others).values
        labels = [data[dim].values if dim in data.coords else range(data.sizes[dim]) for dim in others]
        for index in product(*(range(len(one)) for one in labels)):
            column = "_".join([str(name), *(str(one[i]) for one, i in zip(labels, index, strict=True))])
            columns[column] = values[(..., *index)].ravel()
            units[column], meanings[column] = _unit_and_meaning(data[name], index)
    table = pd.DataFrame(columns)
    table.attrs = {"units": units, "meanings": meanings}
    return table


def _unit_and_meaning(array: xr.DataArray, index: tuple[int, ...] = ()) -> tuple[str, str]:
    """Return unit and meaning of a variable, or of one of its labels if `units_each` gives each its own unit."""
    each = str(array.attrs.get("units_each", "")).split(", ")
    unit = each[index[0]] if each != [""] and len(index) == 1 else str(array.attrs.get("units", ""))
    return ("" if unit == "1" else unit), str(array.attrs.get("long_name", ""))


@checked_arguments()
def export(data: xr.Dataset, output: str | Path, to: str, *, shapes: bool = False, force: bool = False) -> list[Path]:
    """Write results for other programs; every file is written completely or not at all.

    Parameters
    ----------
    data : xarray.Dataset
        Results.
    output : str or Path
        Folder for one file per table, or for results.mat or results.nc; created if missing. A name that ends in .csv or
        .parquet is a file for the time series alone, a name that ends in .mat or .nc is the file itself.
    to : str
        Format: "csv", with units in the column names; "parquet", with units in the metadata of the columns; "mat", see
        `matlab_struct`; or "netcdf".
    shapes : bool
        Whether to add the tables of deformed shapes and section forces; .mat and netCDF files always hold them.
    force : bool
        Whether existing files may be overwritten.

    Returns
    -------
    list of Path
        Files written.

    Raises
    ------
    InputError
        The format is unknown, the file's ending does not match it, or a file exists already.
    OutputError
        A file cannot be written.
    """
    if to not in EXPORT_FORMATS:
        raise InputError("no such format", field="to", value=to, remedy=suggestion(to, EXPORT_FORMATS))
    output, ending = Path(output), ENDINGS[to]
    single = output.suffix.lower() == ending
    if not single and output.suffix.lower() in ENDINGS.values():
        raise InputError(
            f"does not have the ending of {to}", field="output", value=str(output), remedy=f"end it in {ending}"
        )
    whole = to in ("mat", "netcdf")
    tables: dict[str, Any] = {"results": None} if whole else result_tables(data, shapes=shapes and not single)
    names = [next(iter(tables))] if single else tables
    files = {name: output if single else output / f"{name}{ending}" for name in names}
    _refuse(list(files.values()), force)
    for name, file in files.items():
        with _added(file) as unfinished:
            if to == "mat":
                _write_mat({"results": matlab_struct(data)}, unfinished)
            elif to == "netcdf":
                save_results(data, unfinished)
            else:
                _write_table(tables[name], unfinished, to, {key: _plain(value) for key, value in data.attrs.items()})
    return list(files.values())


@contextmanager
def _added(file: Path) -> Iterator[Path]:
    """Provide a temporary name for a file, which becomes part of the results in its folder."""
    with added_to(file.parent) as folder, whole_file(folder / file.name) as unfinished:
        yield unfinished


def _write_table(table: pd.DataFrame, file: Path, to: str, about: Mapping[str, str]) -> None:
    """Write a table as CSV with units in the column names, or as Parquet with units in the metadata of the columns."""
    import pyarrow as pa

    units, meanings = table.attrs["units"], table.attrs["meanings"]
    # Attributes are copied with every column that is looked at.
    table = table.copy(deep=False)
    table.attrs = {}
    found = pa.Table.from_pandas(table, preserve_index=False)
    if to == "csv":
        _write_csv(found, units, file)
        return
    about_columns = {name: {"unit": units[name], "long_name": meanings[name]} for name in units}
    fields = [field.with_metadata(about_columns[field.name]) for field in found.schema]
    write_parquet(found.cast(pa.schema(fields, metadata=dict(about))), file, "zstd")


def _write_csv(table: pa.Table, units: Mapping[str, str], file: Path) -> None:
    """Write a table as CSV, in output units where there are any."""
    import pyarrow as pa
    from pyarrow import compute, csv

    units = dict(units)
    for k, name in enumerate(table.column_names):
        if (shown := output_unit(units[name])).factor != 1.0:
            values = compute.call_function("multiply", [table[name], pa.scalar(shown.factor)])
            table, units[name] = table.set_column(k, name, values), shown.name
    names = [f"{name} [{units[name]}]" if units[name] else name for name in table.column_names]
    try:
        csv.write_csv(spreadsheet_table(table.rename_columns(names)), file)
    except ValueError as error:
        raise InputError("CSV cannot hold all values of the table", field="to", remedy='export it as "mat"') from error


def matlab_struct(data: xr.Dataset) -> dict[str, Any]:
    """Return results as a struct for MATLAB.

    Each variable or coordinate is a field. Time, or the step of equilibria or the frequency, is the first dimension, so
    that `plot(results.time, results.torque(:, :, 1))` plots the torques of the first mode; mode and model are the last.
    Labels are cell arrays of text. `units`, `dims` and `meaning` have the same fields: text, cell arrays of dimension
    names, text. `attributes` holds the provenance.
    """
    struct: dict[str, Any] = {"units": {}, "dims": {}, "meaning": {}}
    samples = [dimension(SAMPLE, name) for name in controller_names(data)]
    along = (*(kind.along[0] for kind in RESULT_KINDS.values() if kind.along), *samples)
    for name in (*data.coords, *data.data_vars):
        array, field = data[name], matlab_name(str(name))
        first = [dim for dim in array.dims if dim in along]
        last = [dim for dim in ("mode", "model") if dim in array.dims]
        array = array.transpose(*first, *(dim for dim in array.dims if dim not in (*first, *last)), *last)
        struct[field] = _matlab_value(array.values)
        struct["units"][field], struct["meaning"][field] = _unit_and_meaning(array)
        struct["dims"][field] = _cells([str(dim) for dim in array.dims])
    struct["attributes"] = {matlab_name(str(key)): value for key, value in data.attrs.items()}
    return struct


def matlab_name(name: str) -> str:
    """Convert a name to a valid MATLAB name: letters, digits and underscores, a letter first, at most 63 characters."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    if not re.match(r"[A-Za-z]", plain):
        plain = f"x{plain}"
    return plain[:_LONGEST_NAME]


def _matlab_value(values: NDArray[Any]) -> Any:
    if values.dtype.kind in "fiub":
        return values if values.ndim else values.item()
    return str(values.item()) if not values.ndim else _cells([str(value) for value in values.ravel()])


def _cells(texts: Sequence[str]) -> NDArray[Any]:
    """Return texts as a column of cells."""
    cells = np.empty((len(texts), 1), dtype=object)
    cells[:, 0] = texts
    return cells


def _write_mat(variables: dict[str, Any], file: Path) -> None:
    from scipy.io import savemat

    with file.open("wb") as stream:
        savemat(stream, variables, long_field_names=True, do_compression=True, oned_as="column")


def export_table(source: Path, output: Path, to: str, *, force: bool = False) -> list[Path]:
    """Write the Parquet table of a study of many runs as CSV, or for MATLAB as a struct with one field per column.

    Parameters
    ----------
    source : Path
        Parquet table of the study.
    output : Path
        File with the ending of the format, or folder for results.csv or results.mat.
    to : str
        Format, "csv" or "mat".
    force : bool
        Whether an existing file may be overwritten.

    Returns
    -------
    list of Path
        File written.

    Raises
    ------
    InputError
        The format is another one, the file exists already, or the table cannot be read.
    OutputError
        The file cannot be written.
    """
    if to not in ("csv", "mat"):
        raise InputError(
            f"the table of a study of many runs cannot be written as {to}", field="to",
            remedy=f"it is Parquet already: {source}; csv and mat can be made of it",
        )  # fmt: skip
    file = output if output.suffix.lower() == ENDINGS[to] else output / f"results{ENDINGS[to]}"
    _refuse([file], force)
    found = read_parquet(source)
    with _added(file) as unfinished:
        if to == "csv":
            units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in found.schema}
            _write_csv(found, units, unfinished)
        else:
            columns = {matlab_name(name): _matlab_value(_values(found[name])) for name in found.column_names}
            _write_mat({"results": columns}, unfinished)
    return [file]


def _values(column: pa.ChunkedArray) -> NDArray[Any]:
    """Return the values of an Arrow column; missing numbers are NaN, missing text is empty."""
    import pyarrow as pa
    from pyarrow import compute

    return (compute.fill_null(column, "") if pa.types.is_string(column.type) else column).to_numpy()


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(np.asarray(value).tolist())


def _refuse(files: Sequence[Path], force: bool) -> None:
    for file in files:
        if file.exists() and not force:
            raise InputError("exists already", field=str(file), remedy="name another, or write over it with --force")
