"""Files of tables: Parquet files, and cells for spreadsheets.

Parquet files have a seal, and page checksums for other programs; both are checked when a table is read. No cell for a
spreadsheet acts as a formula or as a control sequence of a terminal.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paraflex.errors import printable
from paraflex.folders import check_listed
from paraflex.interrupts import uninterrupted
from paraflex.seals import check_seal, damaged
from paraflex.writing import sealed_file

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

# Beginning of a formula; a text of signs alone is the name of an actuation mode.
_FORMULA = re.compile(r"[=@\t\r]|[+-](?![+-]*$)")
_AGAIN = "delete it and run the same command again"


def write_parquet(table: pa.Table, path: Path, compression: str = "snappy", **options: Any) -> None:
    """Write a table to a Parquet file; see `whole_file` for the options and errors."""
    with open_parquet(path, table.schema, compression, **options) as writer, uninterrupted():
        writer.write_table(table)


@contextmanager
def open_parquet(
    path: Path, schema: pa.Schema, compression: str = "snappy", **options: Any
) -> Iterator[pq.ParquetWriter]:
    """Open a Parquet file to write tables into; see `whole_file` for the options and errors."""
    import pyarrow.parquet as pq

    with sealed_file(path, **options) as unfinished:
        with uninterrupted():
            writer = pq.ParquetWriter(unfinished, schema, compression=compression, write_page_checksum=True)
        try:
            yield writer
        finally:
            with uninterrupted():
                writer.close()


def read_parquet(file: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """Read a table, or some of its columns, from a Parquet file.

    Raises
    ------
    InputError
        The file is damaged, or cannot be read.
    """
    import pyarrow.parquet as pq

    check_seal(file, _AGAIN)
    check_listed(file, _AGAIN)
    try:
        names = None if columns is None else list(columns)
        table = pq.read_table(file, columns=names, page_checksum_verification=True)
        table.validate(full=True)
        for field in table.schema:
            _ = [field.name, *(text.decode() for about in (field.metadata or {}).items() for text in about)]
    # The library may raise any exception for a damaged file without a seal.
    except Exception as error:
        raise damaged(file, "cut short, or not a readable table", _AGAIN) from error
    return table


def spreadsheet_text(text: str) -> str:
    """Return a text as a cell value, with an apostrophe before a text that would be a formula."""
    return ("'" if _FORMULA.match(text) else "") + printable(text).replace("\n", " ")


def spreadsheet_table(table: pa.Table) -> pa.Table:
    """Return a table whose texts and column names are converted by `spreadsheet_text` where necessary."""
    import pyarrow as pa

    for k, field in enumerate(table.schema):
        if not (pa.types.is_string(field.type) or pa.types.is_large_string(field.type)):
            continue
        texts = [text for text in table[k].unique().to_pylist() if text is not None]
        cells = {text: cell for text in texts if (cell := spreadsheet_text(text)) != text}
        if cells:
            values = [cells.get(text, text) for text in table[k].to_pylist()]
            table = table.set_column(k, field, pa.array(values, field.type))
    return table.rename_columns([spreadsheet_text(name) for name in table.column_names])
