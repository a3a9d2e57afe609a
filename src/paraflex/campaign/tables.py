"""Tables of runs: writing as Parquet and CSV files from a journal, and reading from any file with rows."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from paraflex.errors import InputError, ResultWarning, warn_user
from paraflex.interrupts import uninterrupted
from paraflex.results.tables import open_parquet, read_parquet, spreadsheet_table
from paraflex.seals import damaged
from paraflex.writing import GO_ON, whole_file
from .journal import JOURNAL, Journal, Row, read_journal

if TYPE_CHECKING:
    import pyarrow as pa

RESULTS = "results.parquet"
UNFINISHED = "unfinished.parquet"
# File with the same rows for programs that cannot read Parquet, written when all runs are done.
CSV = "results.csv"
# Files in place of a journal in the folder of an unfinished study of an earlier release.
EARLIER = "parts/part-*.parquet"
# Number of rows of a group in the file, and number of rows converted at once.
_GROUP, _HELD = 16_384, 1024
# Name of the note in which a journal stores the columns of its table.
SCHEMA_KEY = "schema"
# Columns that identify the run of a row, and names of the metadata of columns in datasets.
_KEYS = ("run", "id", "design", "path", "mode")
_ATTRIBUTES = {"unit": "units", "meaning": "comment"}


def table_name(*, finished: bool) -> str:
    """Return the file name of the table of all runs, or of that of the runs done so far."""
    return RESULTS if finished else UNFINISHED


def write_table(folder: Path, journal: Journal, *, finished: bool) -> Path:
    """Write the rows of a journal as one table: `results.parquet`, or `unfinished.parquet` while runs are missing.

    A finished table is written as `results.csv` as well. The files depend on the rows only. Memory holds one group of
    rows at a time.

    Raises
    ------
    OutputError
        Disk that is full, or cannot be written for another reason, or damaged journal.
    """
    import pyarrow as pa

    file = folder / table_name(finished=finished)
    schema, held = _schema(journal), min(_HELD, _GROUP)
    pieces = (piece for _, piece in _batches(journal, held))
    with open_parquet(file, schema, remedy=GO_ON) as writer:
        while group := list(islice(pieces, _GROUP // held)):
            with uninterrupted():
                writer.write_table(pa.concat_tables(group).combine_chunks(), row_group_size=_GROUP)
    if finished:
        _write_csv(file, folder / CSV)
    return file


def tables_of(folder: Path) -> list[Path]:
    """Return the files with the rows of a folder: the table, else the journal, else those of an earlier release."""
    found = [folder / name for name in (RESULTS, JOURNAL, UNFINISHED) if (folder / name).is_file()]
    # Parts beside a finished table or a journal were left by a killed process, and their rows are in the table.
    return found[:1] if found and found[0].name != UNFINISHED else [*found, *sorted(folder.glob(EARLIER))]


def read_tables(files: Sequence[Path]) -> pa.Table:
    """Read the rows of all files returned by `tables_of`, each run once.

    Raises
    ------
    InputError
        File that is damaged, or has rows of another study.
    """
    import pyarrow as pa

    tables = [read_table(file) for file in files]
    if len(tables) == 1:
        return tables[0]
    known: dict[int, str] = {}
    kept = [_new_rows(file, table, known) for file, table in zip(files, tables, strict=True)]
    try:
        return pa.concat_tables(kept)
    except pa.ArrowException as error:
        raise _of_two_studies(files[-1], "they have other columns") from error


def _new_rows(file: Path, table: pa.Table, known: dict[int, str]) -> pa.Table:
    """Return the rows of runs that are not in `known`, and add these runs to it."""
    import pyarrow as pa

    if not {"run", "id"} <= set(table.column_names):
        raise damaged(file, "not a table of runs", "delete it and run the same command again")
    new = []
    for place, (run, identity) in enumerate(zip(table["run"].to_pylist(), table["id"].to_pylist(), strict=True)):
        if run not in known:
            known[run] = identity
            new.append(place)
        elif known[run] != identity:
            raise _of_two_studies(file, f"run {run} has two identities")
    return table.take(pa.array(new, pa.int64()))


def _of_two_studies(file: Path, why: str) -> InputError:
    remedy = "move this file out of the folder, if it was copied there"
    return InputError(f"rows of another study than in the files beside it ({why})", field=str(file), remedy=remedy)


def read_table(file: Path) -> pa.Table:
    """Read the rows of a file returned by `tables_of`; if it is damaged, those of the journal beside it.

    Raises
    ------
    InputError
        Damaged file without a journal beside it.
    """
    if file.name == JOURNAL:
        return _journal_table(file)
    journal = file.with_name(JOURNAL)
    try:
        return read_parquet(file)
    except InputError as error:
        if file.name not in (RESULTS, UNFINISHED) or not (file.is_file() and journal.is_file()):
            raise
        found = _journal_table(journal)
        why = f"{error.problem}; its rows are read from {JOURNAL} beside it"
        warn_user(ResultWarning(f"{file}: {why}; run the same command again, and the table is made again"))
        return found


def _journal_table(file: Path) -> pa.Table:
    import pyarrow as pa

    with read_journal(file) as journal:
        return pa.concat_tables([_schema(journal).empty_table(), *(piece for _, piece in _batches(journal, _HELD))])


def read_data(file: Path) -> xr.Dataset:
    """Read a file returned by `tables_of` as a dataset over the dimension `run`, one variable per column.

    See `read_table` for the errors.
    """
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
            with uninterrupted():
                writer.write_table(spreadsheet_table(read.read_row_group(number)))


def _schema(journal: Journal) -> pa.Schema:
    import pyarrow as pa

    noted = journal.noted(SCHEMA_KEY)
    try:
        return pa.schema([]) if noted is None else pa.ipc.read_schema(pa.py_buffer(noted))
    except (pa.ArrowException, OSError) as error:
        raise sqlite3.DatabaseError("its columns are not recorded") from error


def checked_rows(journal: Journal) -> Iterator[Row]:
    """Yield all rows of a journal; raise `sqlite3.DatabaseError` if one has not the types of its columns."""
    return (row for rows, _ in _batches(journal, _HELD) for row in rows)


def _batches(journal: Journal, size: int) -> Iterator[tuple[list[Row], pa.Table]]:
    """Yield the rows of a journal, some at a time, with the table of these."""
    import pyarrow as pa

    schema, rows = _schema(journal), journal.rows()
    while some := list(islice(rows, size)):
        try:
            piece = pa.Table.from_pylist(some, schema)
        except (pa.ArrowException, TypeError, ValueError, OverflowError) as error:
            raise sqlite3.DatabaseError("a row does not fit its columns") from error
        yield some, piece
