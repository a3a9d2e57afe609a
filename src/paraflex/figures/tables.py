"""Table: columns of numbers and words, as the terminal, the page of a report, notebooks and files show them.

Numbers are in SI units; `Table.texts` converts and formats them by the one rule of `formatting`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeGuard

import numpy as np

from paraflex.formatting import NO_VALUE, common_unit, display_unit, error_text, number
from paraflex.units import DisplayUnit

Cell = float | int | str | None


@dataclass(frozen=True)
class Column:
    r"""Column of a table.

    Attributes
    ----------
    name : str
        Heading.
    cells : sequence of float, int, str or None
        Values in SI units, whole numbers, or words; None where there is none. A word of two lines is "first\nsecond".
    unit : str
        SI unit of the values, or a text below the heading for columns of words; empty if there is none.
    below : sequence of float or None, optional
        Second value of each cell, which stands below the first; None where there is none.
    errors : sequence of float or None, optional
        Error of each value, in the same unit, which is written behind ±; None where it is not.
    below_unit : str
        Unit in which second values are given, which is written after each; by default that of the first ones.
    beside : float
        Magnitude of the quantities whose differences the values are; values within their rounding are 0.
    digits : int
        Number of significant digits.
    infinite : str
        Text of an infinite value.
    least : float
        Magnitude below which values are not known; they are written as "<1e-08".
    shown : DisplayUnit or None
        Unit for display; by default one in which all values have few digits.
    """

    name: str
    cells: Sequence[Cell]
    unit: str = ""
    below: Sequence[float | None] = ()
    errors: Sequence[float | None] = ()
    below_unit: str = ""
    beside: float = 0.0
    digits: int = 4
    infinite: str = "inf"
    least: float = 0.0
    shown: DisplayUnit | None = None

    @property
    def is_numeric(self) -> bool:
        """Whether no cell is a word."""
        return not any(isinstance(cell, str) for cell in self.cells)

    @property
    def values(self) -> list[float]:
        """Numbers with a unit."""
        cells = (*self.cells, *(() if self.below_unit else self.below))
        return [float(cell) for cell in cells if isinstance(cell, float) or (self.unit and _is_whole(cell))]

    @property
    def shown_unit(self) -> DisplayUnit:
        """Unit in which the values are shown."""
        return self.shown or common_unit(self.unit, self.values, beside=self.beside)

    @property
    def printed_unit(self) -> str:
        """Name of the unit in which numbers are shown, or the text below the heading of words; empty if none."""
        unit = self.shown_unit.name if self.is_numeric else self.unit
        return "" if unit == "1" else unit

    @property
    def head(self) -> tuple[str, str]:
        """Heading, and what stands below it: the unit of numbers as "[mm]", the text of words, or nothing."""
        unit = self.printed_unit
        return self.name, f"[{unit}]" if unit and self.is_numeric else unit

    def texts(self) -> list[str]:
        """Return the cells as text."""
        factor = self.shown_unit.factor

        def text(cell: Cell) -> str:
            if isinstance(cell, str) or (_is_whole(cell) and not self.unit):
                return str(cell)
            if cell is not None and abs(cell) < self.least:
                return f"<{number(self.least, 1, factor=factor)}"
            return number(cell, self.digits, factor=factor, beside=self.beside, infinite=self.infinite)

        def second(value: float | None) -> str:
            if value is None:
                return ""
            return "\n" + (f"{number(value, 3)} {self.below_unit}" if self.below_unit else text(value))

        texts = list(map(text, self.cells))
        for k, error in enumerate(self.errors):
            texts[k] += error_text(error, factor)
        return [first + second(value) for first, value in zip(texts, self.below or [None] * len(texts), strict=True)]


@dataclass(frozen=True)
class Table:
    """Table: a heading, columns of equally many cells, and a sentence below.

    Attributes
    ----------
    title : str
        Heading.
    columns : sequence of Column
        Columns, that of the names of the rows first.
    note : str
        Sentence below the table.
    runs : mapping of str to int
        Runs of a page that rows select, by the name of the row.
    sortable : bool
        Whether readers of a page may sort the rows by a column.
    """

    title: str
    columns: Sequence[Column]
    note: str = ""
    runs: Mapping[str, int] | None = None
    sortable: bool = False

    def __bool__(self) -> bool:
        return bool(self.columns and self.columns[0].cells)

    def heads(self) -> list[tuple[str, str]]:
        """Return heading and unit of every column; the unit is empty if there is none."""
        return [(column.name, column.printed_unit) for column in self.columns]

    def texts(self) -> list[list[str]]:
        """Return the rows as text."""
        return [list(row) for row in zip(*(column.texts() for column in self.columns), strict=True)]

    def filled(self) -> "Table":
        """Return the table without columns of numbers that have no value in any row."""
        kept = [c for c in self.columns if not c.is_numeric or any(_is_known(cell) for cell in c.cells)]
        return replace(self, columns=kept)

    def in_one_unit(self) -> "Table":
        """Return the table with a common unit for all columns of numbers that have the same SI unit."""
        values: dict[str, list[float]] = {}
        for one in self.columns:
            values.setdefault(one.unit, []).extend(one.values)
        return replace(self, columns=[
            replace(one, shown=one.shown or common_unit(one.unit, values[one.unit], beside=one.beside))
            if one.is_numeric else one for one in self.columns
        ])  # fmt: skip

    def thinned(self, rows: Sequence[int]) -> "Table":
        """Return the table with some of its rows; the title has their number and that of all rows."""
        count = len(self.columns[0].cells)
        if len(rows) == count:
            return self

        def some(values: Sequence[Any]) -> list[Any]:
            return [values[k] for k in rows] if values else []

        columns = [replace(one, cells=some(one.cells), below=some(one.below), errors=some(one.errors))
                   for one in self.columns]  # fmt: skip
        return replace(self, title=f"{self.title} ({len(rows)} of {count})", columns=columns)


def columns_of(rows: Iterable[Mapping[str, Any]], *heads: tuple[str, str, str], **more: Any) -> list[Column]:
    """Return columns of entries of the rows; `heads` are heading, name of the entry, and unit of each column."""
    rows = list(rows)
    return [Column(head, [row[name] for row in rows], unit, **more) for head, name, unit in heads]


def table_of(
    title: str, heads: Sequence[tuple[str, str]], rows: Iterable[Sequence[Cell]], note: str = "",
    alike: Sequence[str] = (),
) -> Table:  # fmt: skip
    """Return the table of rows of cells, without columns of numbers that have no value.

    Heads are heading and unit of each column; columns with the headings `alike` are in one unit, that of their largest
    value.
    """
    cells = list(zip(*rows, strict=True)) or [()] * len(heads)
    columns = [Column(name, each, unit) for (name, unit), each in zip(heads, cells, strict=True)]
    if some := [column for column in columns if column.name in alike]:
        shown = display_unit(some[0].unit, [value for column in some for value in column.values])
        columns = [replace(column, shown=shown) if column.name in alike else column for column in columns]
    return Table(title, columns, note).filled()


def in_row_units(columns: Sequence[Column], units: Sequence[str]) -> list[Column]:
    """Return columns whose rows have different SI units in units for display, followed by the column of these units."""
    rows = zip(*(column.cells for column in columns), strict=True)
    numbers = [[cell if isinstance(cell, float | int) else None for cell in row] for row in rows]
    shown = [common_unit(unit, row) for unit, row in zip(units, numbers, strict=True)]
    cells = [[None if cell is None else unit.factor * cell for cell in row]
             for unit, row in zip(shown, numbers, strict=True)]  # fmt: skip
    converted = [replace(column, cells=[row[k] for row in cells]) for k, column in enumerate(columns)]
    return [*converted, Column("unit", [NO_VALUE if unit.name in ("", "1") else unit.name for unit in shown])]


def _is_whole(cell: object) -> TypeGuard[int]:
    """Check whether a cell is a whole number, which is written as it is if it has no unit."""
    return isinstance(cell, int | np.integer) and not isinstance(cell, bool)


def _is_known(cell: Cell) -> bool:
    return cell is not None and not (isinstance(cell, float) and np.isnan(cell))
