"""Tables of runs in Parquet files, made of a journal; read again from any file that has rows."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from paraflex.campaign.journal import JOURNAL, Journal, read_journal
from paraflex.writing import GO_ON, whole_file

if TYPE_CHECKING:
    import pyarrow as pa

RESULTS = "results.parquet"
UNFINISHED = "unfinished.parquet"
# What a folder of an earlier release has in place of a journal while its study is unfinished.
EARLIER = "parts/part-*.parquet"
# Rows of a group in the file, and those that are held as rows at once.
_GROUP, _HELD = 16_384, 1024
# Under which name a journal keeps the columns of its table.
SCHEMA = "schema"


def write_table(folder: Path, journal: Journal, *, finished: bool) -> Path:
    """Write a journal's rows as one table, `results.parquet` or, while more are to come, `unfinished.parquet`.

    The file depends on nothing but the rows; memory holds a group of them.

    Raises
    ------
    OutputError
        The disk is full, or cannot be written for another reason.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    file, other = (folder / name for name in ((RESULTS, UNFINISHED) if finished else (UNFINISHED, RESULTS)))
    schema, held = _schema(journal), min(_HELD, _GROUP)
    pieces = _pieces(journal, held)
    with whole_file(file, remedy=GO_ON) as unfinished, pq.ParquetWriter(unfinished, schema) as writer:
        while group := list(islice(pieces, _GROUP // held)):
            writer.write_table(pa.concat_tables(group).combine_chunks(), row_group_size=_GROUP)
    other.unlink(missing_ok=True)
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


def _schema(journal: Journal) -> pa.Schema:
    import pyarrow as pa

    noted = journal.noted(SCHEMA)
    return pa.schema([]) if noted is None else pa.ipc.read_schema(pa.py_buffer(noted))


def _pieces(journal: Journal, size: int) -> Iterator[pa.Table]:
    import pyarrow as pa

    schema, rows = _schema(journal), journal.rows()
    while some := list(islice(rows, size)):
        yield pa.Table.from_pylist(some, schema)
