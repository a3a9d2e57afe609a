"""Tables of runs in Parquet files, made of a journal; read again from any file that has rows."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from paraflex.campaign.journal import JOURNAL, Journal, read_journal
from paraflex.results.spreadsheet import spreadsheet_table
from paraflex.writing import GO_ON, whole_file

if TYPE_CHECKING:
    import pyarrow as pa

RESULTS = "results.parquet"
UNFINISHED = "unfinished.parquet"
# The same rows for programs that read no Parquet, once all are there.
CSV = "results.csv"
# What a folder of an earlier release has in place of a journal while its study is unfinished.
EARLIER = "parts/part-*.parquet"
# Rows of a group in the file, and those that are held as rows at once.
_GROUP, _HELD = 16_384, 1024
# Under which name a journal keeps the columns of its table.
SCHEMA = "schema"
# Columns that say which run a row is of, and what the metadata of columns are called in datasets.
_KEYS = ("run", "id", "design", "path", "mode")
_ATTRIBUTES = {"unit": "units", "meaning": "comment"}


def write_table(folder: Path, journal: Journal, *, finished: bool) -> Path:
    """Write a journal's rows as one table, `results.parquet` or, while more are to come, `unfinished.parquet`.

    A finished one is written as `results.csv` too. Files depend on nothing but the rows; memory holds a group of them.

    Raises
    ------
    OutputError
        The disk is full, or cannot be written for another reason.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = folder / (RESULTS if finished else UNFINISHED)
    schema, held = _schema(journal), min(_HELD, _GROUP)
    pieces = _pieces(journal, held)
    with whole_file(file, remedy=GO_ON) as unfinished, pq.ParquetWriter(unfinished, schema) as writer:
        while group := list(islice(pieces, _GROUP // held)):
            writer.write_table(pa.concat_tables(group).combine_chunks(), row_group_size=_GROUP)
    if finished:
        _write_csv(file, folder / CSV)
    return file


def tables_of(folder: Path) -> list[Path]:
    """Files that hold the rows of a folder's runs: the table, else the journal; and parts of an earlier release."""
    found = [folder / name for name in (RESULTS, JOURNAL, UNFINISHED) if (folder / name).is_file()]
    return found[:1] + sorted(folder.glob(EARLIER))


def read_table(file: Path) -> pa.Table:
    """The rows of a file that `tables_of` names.

    Raises
    ------
    OutputError
        A journal that is damaged; of other files pyarrow's errors.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    if file.name != JOURNAL:
        return pq.read_table(file)
    with read_journal(file) as journal:
        return pa.concat_tables([_schema(journal).empty_table(), *_pieces(journal, _HELD)])


def read_data(file: Path) -> xr.Dataset:
    """The rows of a file that `tables_of` names, a variable a column over the dimension `run`; see `read_table`."""
    table = read_table(file)
    columns = {
        field.name: ("run", column.to_numpy(), _attributes(field))
        for field, column in zip(table.schema, table.columns, strict=True)
    }
    return xr.Dataset(columns).set_coords([name for name in columns if name in _KEYS])


def _attributes(field: pa.Field) -> dict[str, str]:
    about = {key.decode(): text.decode() for key, text in (field.metadata or {}).items()}
    return {_ATTRIBUTES[key]: text for key, text in about.items() if key in _ATTRIBUTES}


def _write_csv(table: Path, file: Path) -> None:
    import pyarrow.csv
    import pyarrow.parquet as pq

    read = pq.ParquetFile(table)
    schema = spreadsheet_table(read.schema_arrow.empty_table()).schema
    with (
        whole_file(file, remedy=GO_ON) as unfinished,
        pyarrow.csv.CSVWriter(unfinished, schema) as writer,
    ):
        for number in range(read.num_row_groups):
            writer.write_table(spreadsheet_table(read.read_row_group(number)))


def _schema(journal: Journal) -> pa.Schema:
    import pyarrow as pa

    noted = journal.noted(SCHEMA)
    return pa.schema([]) if noted is None else pa.ipc.read_schema(pa.py_buffer(noted))


def _pieces(journal: Journal, size: int) -> Iterator[pa.Table]:
    import pyarrow as pa

    schema, rows = _schema(journal), journal.rows()
    while some := list(islice(rows, size)):
        yield pa.Table.from_pylist(some, schema)
