"""Tables in Parquet files, with a seal and page checksums for other programs; both are checked when a table is read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paraflex.folders import check_listed
from paraflex.interrupts import uninterrupted
from paraflex.seals import check_seal, damaged
from paraflex.writing import sealed_file

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

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
