"""Numbers and tables of a page as text and HTML."""

import json
import math
import re
from collections.abc import Iterable, Sequence
from html import escape

from paraflex.figures.tables import Cell, Table
from paraflex.formatting import text_symbol, typeset

_WORD_CLASS, _SORTABLE = ' class="words"', ' class="sortable"'


def table_html(shown: Table) -> str:
    """Return the HTML of a table, which scrolls within the page if it is too wide.

    Numbers are typeset, units stand below the headings, and the first column names the rows. A row of a sortable table
    carries its cells as keys.
    """
    heads = [(text_symbol(name), typeset(below)) for name, below in (column.head for column in shown.columns)]
    rows = [
        (text_symbol(name), ["\n".join(typeset(text_symbol(line)) for line in cell.split("\n")) for cell in cells])
        for name, *cells in shown.texts()
    ]
    # Columns that contain words instead of numbers.
    words = re.compile(r"[^\n]*?[A-Za-z]{2}")
    wordy = [k > 0 and any(words.match(cells[k - 1]) for _, cells in rows) for k in range(len(heads))]
    head = "".join(
        f'<th scope="col"{_WORD_CLASS if words else ""}>{escape(name)}{_small(unit)}</th>'
        for (name, unit), words in zip(heads, wordy, strict=True)
    )
    keys = zip(*(column.cells for column in shown.columns), strict=True)
    body = "".join(
        _row(name, cells, wordy[1:], (shown.runs or {}).get(name), row if shown.sortable else None)
        for (name, cells), row in zip(rows, keys, strict=True)
    )
    caption, sortable = escape(shown.title), _SORTABLE if shown.sortable else ""
    below = f'<p class="note">{escape(shown.note)}</p>' if shown.note else ""
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{caption}"><table{sortable}>'
        f'<caption class="unseen">{caption}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>{below}"
    )


def table_pairs(shown: Table) -> list[tuple[str, str]]:
    """Return names and values of a table with one row, for `pairs`."""
    return [(name, f"{typeset(cell)} {unit}".rstrip())
            for (name, unit), cell in zip(shown.heads(), shown.texts()[0], strict=True)]  # fmt: skip


def sections(tables: Iterable[Table]) -> list[tuple[str, str]]:
    """Return titles and HTML of the tables that have rows, those of one title together."""
    found: dict[str, str] = {}
    for one in tables:
        if one:
            found[one.title] = found.get(one.title, "") + table_html(one)
    return list(found.items())


def by_run(tables: Sequence[tuple[str, str]]) -> str:
    """Return the HTML of tables with titles, one for each run of the page.

    The screen shows the table of the selected run, a printed page all of them.
    """
    return "".join(
        f'<div class="of-run" data-of-run="{run}"><h3>{escape(title)}</h3>{html}</div>'
        for run, (title, html) in enumerate(tables)
    )


def pairs(facts: Sequence[tuple[str, str]], kind: str = "pairs") -> str:
    """Return the HTML of a list of names and values, of a class of the style sheet; empty without any."""
    items = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in facts)
    return f'<dl class="{kind}">{items}</dl>' if items else ""


def _small(text: str) -> str:
    return f"<small>{escape(text)}</small>" if text else ""


def _row(name: str, cells: Sequence[str], wordy: Sequence[bool], run: int | None, keys: Sequence[Cell] | None) -> str:
    """Return the HTML of a row; if it selects a run, its name is a button; keys are for sorting."""
    about, head = "", escape(name)
    if run is not None:
        about, head = f' data-run="{run}"', f'<button type="button" class="pick">{head}</button>'
    if keys is not None:
        plain = [None if isinstance(key, float) and not math.isfinite(key) else key for key in keys]
        about += f' data-keys="{escape(json.dumps(plain))}"'
    return f'<tr{about}><th scope="row">{head}</th>{"".join(map(_cell, cells, wordy))}</tr>'


def _cell(text: str, words: bool) -> str:
    first, _, second = text.partition("\n")
    return f"<td{_WORD_CLASS if words else ''}>{escape(first)}{_small(second)}</td>"
