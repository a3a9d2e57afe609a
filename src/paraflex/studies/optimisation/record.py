"""Every run of a search as a row of a table, read again when the search goes on."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from paraflex.errors import OutputError
from paraflex.studies.optimisation.study import DesignStudy
from paraflex.studies.sweeps.run import Row
from paraflex.studies.sweeps.table import PARTS, RESULTS, PartsWriter, parts, read_rows, table_schema, whole_file

if TYPE_CHECKING:
    import pyarrow as pa

# Rows wait so long before they are written [s]: what a crash can cost.
_SECONDS = 2.0
RESULT = "result.json"
# Column that says why a run has no exact derivatives.
NO_SLOPES = "slope.reason"


def slope_column(column: str, parameter: str) -> str:
    """Column of a metric's exact derivative by a parameter."""
    return f"slope.{column}.{parameter}"


def record_schema(study: DesignStudy, *, slopes: bool) -> pa.Schema:
    """Columns of the table: a sweep's, and derivatives of the metrics that count where they are exact."""
    import pyarrow as pa

    setting = study.setting
    schema = table_schema(setting.names, setting.whole, setting.metrics, study.base.motors)
    if slopes:
        for column in study.columns:
            for name in setting.names:
                schema = schema.append(pa.field(slope_column(column, name), pa.float64()))
        schema = schema.append(pa.field(NO_SLOPES, pa.string()))
    return schema


class Record:
    """The rows of a folder, by run id: those of earlier sessions, and those of this one as they come.

    Parameters
    ----------
    folder : Path
    schema : pyarrow.Schema

    Raises
    ------
    OutputError
        A file of earlier rows is damaged.
    """

    def __init__(self, folder: Path, schema: pa.Schema) -> None:
        self.folder, self.schema = folder, schema
        self.rows = {row["id"]: row for row in _found(folder)}
        self.writer = PartsWriter(folder, schema)
        self.waiting: list[Row] = []
        self.written = time.monotonic()

    def find(self, ids: list[str]) -> tuple[Row, ...] | None:
        """Rows of runs; None where one is lacking."""
        return tuple(self.rows[each] for each in ids) if all(each in self.rows for each in ids) else None

    def add(self, rows: tuple[Row, ...]) -> None:
        """Keep rows; they are written when the first has waited for two seconds."""
        self.rows |= {row["id"]: row for row in rows}
        self.waiting += rows
        if time.monotonic() - self.written > _SECONDS:
            self.write()

    def write(self) -> None:
        """Write what waits."""
        if self.waiting:
            rows, self.waiting = self.waiting, []
            self.writer.append(rows)
        self.written = time.monotonic()

    def finish(self) -> Path:
        """All rows in one table, in the order the designs were asked for; the parts go."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        self.write()
        rows = sorted(self.rows.values(), key=lambda row: row["run"])
        columns = [pa.array([row.get(field.name) for row in rows], field.type) for field in self.schema]
        with whole_file(self.folder / RESULTS) as unfinished:
            pq.write_table(pa.Table.from_arrays(columns, schema=self.schema), unfinished)
        for part in parts(self.folder):
            part.unlink()
        if (self.folder / PARTS).exists():
            (self.folder / PARTS).rmdir()
        return self.folder / RESULTS

    @property
    def table(self) -> Path:
        """What pandas reads: the table, or the parts of a search that was stopped."""
        return self.folder / PARTS if parts(self.folder) else self.folder / RESULTS


def _found(folder: Path) -> list[Row]:
    import pyarrow as pa

    rows: list[Row] = []
    table = folder / RESULTS
    for file in [*([table] if table.exists() else []), *parts(folder)]:
        try:
            rows += read_rows([file])
        except (OSError, pa.ArrowException) as error:
            raise OutputError(
                f"cannot be read ({str(error).splitlines()[0]})", field=str(file),
                remedy="delete this file and run the same command again: its runs are made again",
            ) from error  # fmt: skip
    return rows
