"""HTML views of objects in notebooks: plain tables that take their colours from the page, light or dark.

The view of a mechanism or a run needs drawings and metrics, which import the classes of mechanisms and runs. Views are
therefore registered by class with `late.view` in higher layers.
"""

import math
from collections.abc import Container, Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from .arrays import Brief
from .formatting import number, typeset
from .late import played, view

# Largest number of rows shown of a table that could be long.
_MOST_LISTED = 60
_RULE = "1px solid rgba(128, 128, 128, 0.45)"


class Shown(Brief):
    """Base class of objects with a view in notebooks."""

    def _repr_html_(self) -> str:
        """Return the HTML for notebooks."""
        return view(self)


class Played(Shown):
    """Base class of runs and of results with runs."""

    def animate(self, file: str | Path | None = None, modes: Sequence[str] = (), options: Any = None) -> Any:
        """Return a film, which notebooks show; see `paraflex.animate`."""
        return played(self, file, modes, options)


def page(title: str, *parts: str) -> str:
    """Return a title with HTML parts below it; empty parts are left out."""
    return f"<div><div><strong>{escape(title)}</strong></div>{''.join(part for part in parts if part)}</div>"


def sentence(text: str) -> str:
    """Return a line of text as HTML, empty for an empty text."""
    return f"<div>{escape(text)}</div>" if text else ""


def facts(pairs: Iterable[tuple[str, Any]]) -> str:
    """Return a two-column table of names and values; None and empty values are left out."""
    rows = [(name, value) for name, value in pairs if not (value is None or value in ("", [], ()))]
    cells = "".join(
        f'<tr><th style="text-align: left; font-weight: normal; opacity: 0.75">{escape(name)}</th>'
        f'<td style="text-align: left">{escape(written(value))}</td></tr>'
        for name, value in rows
    )
    return f"<table>{cells}</table>" if cells else ""


def table(headings: Sequence[str], rows: Iterable[Sequence[Any]], caption: str = "", right: Container[int] = ()) -> str:
    """Return a table with numbers and the columns `right` aligned right, text left; an empty text without rows."""
    body = "".join("<tr>" + "".join(_cell(value, k in right) for k, value in enumerate(row)) + "</tr>" for row in rows)
    if not body:
        return ""
    style = f'style="text-align: left; border-bottom: {_RULE}"'
    head = "".join(f"<th {style}>{escape(heading)}</th>" for heading in headings)
    title = f'<caption style="text-align: left">{escape(caption)}</caption>' if caption else ""
    return f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def described(shown: Any) -> str:
    """Return a described table, see `figures.tables.Table`; an empty text if it has no rows."""
    numeric = [column.is_numeric for column in shown.columns]
    heads = [" ".join(filter(None, one.head)) if is_number else one.name
             for one, is_number in zip(shown.columns, numeric, strict=True)]  # fmt: skip
    rows, right = shown.texts(), [k for k, one in enumerate(numeric) if one]
    cells = [list(map(typeset, row)) for row in rows[:_MOST_LISTED]]
    more = sentence(f"and {len(rows) - _MOST_LISTED} more rows") if len(rows) > _MOST_LISTED else ""
    return table(heads, cells, shown.title, right) + sentence(shown.note) + more


def written(value: Any) -> str:
    """Format a value as text: floats to four digits, lists with commas, an empty text for None, NaN and infinities."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if isinstance(value, (list, tuple)):
        return ", ".join(map(written, value))
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return number(value) if isinstance(value, float) else str(value)


def _cell(value: Any, right: bool) -> str:
    number = right or (isinstance(value, (int, float)) and not isinstance(value, bool))
    return f'<td style="text-align: {"right" if number else "left"}">{escape(written(value))}</td>'
