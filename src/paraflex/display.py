"""Views of objects in notebooks: tables of plain HTML that take their colours from the page, light or dark.

What a mechanism or a run shows takes drawings and metrics, which are made from them. Views therefore stand above what
they show: `view` knows them by class, and `Shown` asks for them when a notebook does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import singledispatch
from html import escape
from importlib import import_module
from typing import Any

# Where views are registered; loaded one after the other until that of a class is there.
_VIEWS = ("paraflex.results.html", "paraflex.plots.mechanism_html", "paraflex.studies.html")
_RULE = "1px solid rgba(128, 128, 128, 0.45)"


@singledispatch
def view(thing: object) -> str:
    """The HTML of an object; `view.register(CLASS)` registers the view of a class."""
    raise TypeError(f"no view of {type(thing).__name__} is registered")


class Shown:
    """Base of objects with a view in notebooks."""

    def _repr_html_(self) -> str:
        """HTML for notebooks."""
        for module in _VIEWS:
            if view.dispatch(type(self)) is view.dispatch(object):
                import_module(module)
        return view(self)


def page(title: str, *parts: str) -> str:
    """A title and the HTML parts below it; empty ones are left out."""
    return f"<div><div><strong>{escape(title)}</strong></div>{''.join(part for part in parts if part)}</div>"


def sentence(text: str) -> str:
    """A line of text."""
    return f"<div>{escape(text)}</div>" if text else ""


def facts(pairs: Iterable[tuple[str, Any]]) -> str:
    """Names and values below one another; None and empty values are left out."""
    rows = [(name, value) for name, value in pairs if not (value is None or value in ("", [], ()))]
    cells = "".join(
        f'<tr><th style="text-align: left; font-weight: normal; opacity: 0.75">{escape(name)}</th>'
        f'<td style="text-align: left">{escape(written(value))}</td></tr>'
        for name, value in rows
    )
    return f"<table>{cells}</table>" if cells else ""


def table(headings: Sequence[str], rows: Iterable[Sequence[Any]], caption: str = "") -> str:
    """A table: numbers on the right, text on the left; empty if there are no rows."""
    body = "".join("<tr>" + "".join(map(_cell, row)) + "</tr>" for row in rows)
    if not body:
        return ""
    style = f'style="text-align: left; border-bottom: {_RULE}"'
    head = "".join(f"<th {style}>{escape(heading)}</th>" for heading in headings)
    title = f'<caption style="text-align: left">{escape(caption)}</caption>' if caption else ""
    return f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def written(value: Any) -> str:
    """A value as text: numbers to four digits, lists with commas, nothing for NaN."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if isinstance(value, (list, tuple)):
        return ", ".join(map(written, value))
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _cell(value: Any) -> str:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return f'<td style="text-align: {"right" if number else "left"}">{escape(written(value))}</td>'
