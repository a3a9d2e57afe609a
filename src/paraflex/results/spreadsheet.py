"""Escaping of text in tables for spreadsheets: no cell acts as a formula or as a control sequence of a terminal."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from paraflex.errors import printable

if TYPE_CHECKING:
    import pyarrow as pa

# Beginning of a formula; a text of signs alone is the name of an actuation mode.
_FORMULA = re.compile(r"[=@\t\r]|[+-](?![+-]*$)")


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
