"""Text for tables that spreadsheets open: nothing in it is taken for a formula, nor moves a terminal's cursor."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from paraflex.errors import printable

if TYPE_CHECKING:
    import pyarrow as pa

# How a formula begins; signs alone are the name of an actuation mode.
_FORMULA = re.compile(r"[=@\t\r]|[+-](?![+-]*$)")


def spreadsheet_text(text: str) -> str:
    """A text as a cell shows it: before what would be a formula stands an apostrophe."""
    return ("'" if _FORMULA.match(text) else "") + printable(text).replace("\n", " ")


def spreadsheet_table(table: pa.Table) -> pa.Table:
    """A table whose texts and names of columns are so; the same where they are already."""
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
