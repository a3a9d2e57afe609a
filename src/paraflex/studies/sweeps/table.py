"""The table of a sweep: rows appended in parts while it runs, merged in order of runs at its end."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from paraflex.errors import OutputError
from paraflex.studies.sweeps.metrics import METRICS, VALIDITY

if TYPE_CHECKING:
    import pyarrow as pa

RESULTS, PARTS = "results.parquet", "parts"
FIXED_COLUMNS = ("run", "id", "design", "path", "mode", "status", "reason", "time_reached")
# Rows that are held at once when parts are merged, and rows of a group in the file.
_GROUP = 16_384
_AGAIN = "free some space and run the same command again: it goes on from there"


def table_schema(
    names: Sequence[str], whole: Sequence[bool], metrics: Sequence[str], motors: Sequence[str]
) -> pa.Schema:
    """Columns of a sweep's table: runs, parameters, how they ended, metrics; with units in the fields' metadata."""
    import pyarrow as pa

    columns = [
        pa.field("run", pa.int64()),
        pa.field("id", pa.string()),
        pa.field("design", pa.int64()),
        pa.field("path", pa.string()),
        pa.field("mode", pa.string()),
    ]
    columns += [
        pa.field(name, pa.int64() if integer else pa.float64()) for name, integer in zip(names, whole, strict=True)
    ]
    columns += [
        pa.field("status", pa.string()),
        pa.field("reason", pa.string()),
        pa.field("time_reached", pa.float64(), metadata={"unit": "s"}),
    ]
    for name in metrics:
        metric = METRICS[name]
        told = {"unit": metric.unit, "meaning": metric.meaning}
        kind = pa.int64() if metric.whole else pa.float64()
        called = [f"{name}.{motor}" for motor in motors] if metric.per_motor else [name]
        columns += [pa.field(each, kind, metadata=told) for each in called]
    return pa.schema(columns)


class PartsWriter:
    """Appends rows to a folder of parts; what is there stays whatever happens.

    Parameters
    ----------
    folder : Path
        Of the sweep.
    schema : pyarrow.Schema
    """

    def __init__(self, folder: Path, schema: pa.Schema) -> None:
        self.folder, self.schema = folder / PARTS, schema
        self.next = 1 + max((int(part.stem.removeprefix("part-")) for part in parts(folder)), default=0)

    def append(self, rows: list[dict[str, Any]]) -> None:
        """Write rows as one more part, there whole or not at all.

        Raises
        ------
        OutputError
            The disk is full, or cannot be written for another reason.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        rows = sorted(rows, key=lambda row: row["run"])
        columns = [
            pa.array([row.get(name) for row in rows], kind) for name, kind in zip(*_typed(self.schema), strict=True)
        ]
        with whole_file(self.folder / f"part-{self.next:06d}.parquet") as unfinished:
            pq.write_table(pa.Table.from_arrays(columns, schema=self.schema), unfinished)
        self.next += 1


class whole_file:
    """A file under another name until it is complete and on the disk; errors of the disk become an OutputError."""

    def __init__(self, path: Path) -> None:
        self.path, self.unfinished = path, path.with_name(path.name + ".part")

    def __enter__(self) -> Path:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise _unwritable(self.path, error) from error
        return self.unfinished

    def __exit__(self, kind: type | None, error: BaseException | None, _: object) -> None:
        try:
            if error is None:
                _to_disk(self.unfinished)
                self.unfinished.replace(self.path)
                return
        except OSError as trouble:
            error = trouble
        with suppress(OSError):
            self.unfinished.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise _unwritable(self.path, error) from error


def write_json(file: Path, figures: Mapping[str, Any]) -> None:
    """Write numbers as JSON; the file appears whole or not at all."""
    with whole_file(file) as unfinished:
        unfinished.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


def parts(folder: Path) -> list[Path]:
    """Parts of a sweep, in the order they were written."""
    return sorted((folder / PARTS).glob("part-*.parquet"))


def runs_in(file: Path) -> NDArray[np.int64]:
    """Numbers of the runs in a part or table.

    Raises
    ------
    OutputError
        It is damaged.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return pq.read_table(file, columns=["run"])["run"].to_numpy()
    except (OSError, pa.ArrowException, KeyError) as error:
        raise OutputError(
            f"cannot be read ({str(error).splitlines()[0]})", field=str(file),
            remedy="delete this file and run the same command again: its runs are made again",
        ) from error  # fmt: skip


def merge(folder: Path, schema: pa.Schema, counts: NDArray[np.int64]) -> Path:
    """All parts as one table in order of runs; parts go once it is there.

    The file does not depend on how rows were spread over parts. Memory holds one group of rows and a part at a time.

    Parameters
    ----------
    folder : Path
    schema : pyarrow.Schema
    counts : (parts, 2) array
        Smallest and largest run of each part of `parts(folder)`.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    files, last = parts(folder), int(counts[:, 1].max(initial=-1))
    # A dictionary of every text would grow with the file and depend on its groups; counts of nothing are dropped.
    with whole_file(folder / RESULTS) as unfinished, pq.ParquetWriter(unfinished, schema) as writer:
        for first in range(0, last + 1, _GROUP):
            wanted = (counts[:, 0] < first + _GROUP) & (counts[:, 1] >= first)
            chosen = [("run", ">=", first), ("run", "<", first + _GROUP)]
            read = [pq.read_table(files[k], schema=schema, filters=chosen) for k in np.flatnonzero(wanted)]
            rows = pa.concat_tables([schema.empty_table(), *read]).sort_by("run").combine_chunks()
            if rows.num_rows:
                writer.write_table(rows, row_group_size=_GROUP)
    for file in files:
        file.unlink()
    (folder / PARTS).rmdir()
    return folder / RESULTS


def status_counts(files: Iterable[Path]) -> dict[str, int]:
    """How many runs ended how."""
    import pyarrow.parquet as pq

    counts: dict[str, int] = {}
    for file in files:
        with pq.ParquetFile(file) as table:
            for batch in table.iter_batches(columns=["status"]):
                for each in batch.column(0).value_counts().to_pylist():
                    counts[each["values"]] = counts.get(each["values"], 0) + each["counts"]
    return counts


def beyond_counts(files: Iterable[Path]) -> int:
    """How many runs are beyond what their model can describe: those whose validity is above 1."""
    import pyarrow.parquet as pq

    count = 0
    for file in files:
        with pq.ParquetFile(file) as table:
            if VALIDITY in table.schema_arrow.names:
                for batch in table.iter_batches(columns=[VALIDITY]):
                    count += int(np.sum(batch.column(0).to_numpy(zero_copy_only=False).astype(float) > 1.0))
    return count


def read_rows(files: Iterable[Path]) -> Iterator[dict[str, Any]]:
    """Rows of parts or a table, one after the other."""
    import pyarrow.parquet as pq

    for file in files:
        with pq.ParquetFile(file) as table:
            for batch in table.iter_batches():
                yield from batch.to_pylist()


def _typed(schema: pa.Schema) -> tuple[list[str], list[Any]]:
    return list(schema.names), list(schema.types)


def _to_disk(file: Path) -> None:
    with file.open("rb+") as opened:
        os.fsync(opened.fileno())


def _unwritable(path: Path, error: OSError) -> OutputError:
    reason = (error.strerror or str(error)).lower()
    return OutputError(f"cannot be written ({reason})", field=str(path), remedy=f"what is written stays; {_AGAIN}")
