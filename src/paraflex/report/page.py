"""HTML page of every report: one file with its style, its scripts, Plotly and the numbers."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from html import escape
from importlib.metadata import version
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

from numpy.typing import ArrayLike

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.errors import InputError
from paraflex.folders import added_to
from paraflex.plots.themes import THEMES
from paraflex.report.film import Animation
from paraflex.report.packing import Series
from paraflex.writing import write_text

# Number of notices from which they are folded.
_FOLDED = 3
_ORIGIN = "How these results were made"
_STYLES = ("page.css",)
_SCRIPTS = ("report.js", "designs.js", "charts.js", "player.js", "start.js")


class Look(NamedTuple):
    """Look of a curve: index of one of the page's eight colours, or None for the colour of text, and dashes.

    Dashes are 0 solid, 1 dashed, 2 dotted, 3 dash-dotted, 4 long dashes.
    """

    colour: int | None = None
    dash: int = 0


PLAIN_LOOK = Look()


@dataclass(frozen=True)
class Curve:
    """Curve of a chart.

    Attributes
    ----------
    name : str
        Name of the curve.
    y : (k,) array
        Ordinates in the chart's unit; NaN where there is no value.
    x : (k,) array, optional
        Abscissae; the page's time by default.
    look : Look
        Colour and dashes.
    run : int, optional
        Run of the curve, which is drawn thicker than others when this run is selected.
    shown : tuple of int, optional
        Selected runs with which the curve is shown; any by default.
    choice : int, optional
        Choice of the chart that shows the curve; every choice by default.
    quiet : bool
        Whether the curve is omitted from the label at the pointer.
    mark : str
        Marks at its points instead of a line, "ring" or "cross"; empty (default) for a line.
    texts : sequence of str
        Text of each mark in the label at the pointer.
    """

    name: str
    y: ArrayLike
    x: ArrayLike | None = None
    look: Look = PLAIN_LOOK
    run: int | None = None
    shown: tuple[int, ...] | None = None
    choice: int | None = None
    quiet: bool = False
    mark: str = ""
    texts: Sequence[str] = ()


class Picker(NamedTuple):
    """Choice of a column for a chart of designs: name, columns, and index of the initial one."""

    name: str
    columns: Sequence[int]
    chosen: int = 0


@dataclass(frozen=True)
class Chart:
    """Chart of a page.

    Attributes
    ----------
    identity : str
        Identifier, unique within the page.
    title, y, x : str
        Title, and labels of the axes with units.
    curves : sequence of Curve
        Curves of the chart.
    choices : sequence of str
        Names of the members that the chart shows one at a time, such as links or motors.
    choosing : str
        Noun for a choice, for screen readers.
    log, log_x, equal : bool
        Whether the vertical axis is logarithmic, whether the horizontal one is, and whether their scales are equal.
    over_time : bool
        Whether x is time: a line then moves with the animation, otherwise a dot on every curve of a run.
    note : str
        Sentence below the chart.
    layout : mapping
        Additional parts of Plotly's `layout`, such as numbers of axes and shapes.
    figure : mapping, optional
        Plotly's own `data` and `layout` in place of curves; colours and fonts of the page are added.
    drawer : str
        Chart of the page's designs in place of curves: "responses", "front", "parallel" or "distribution".
    pickers : sequence of Picker
        Choices of columns that the reader makes for the drawer.
    """

    identity: str
    title: str
    y: str
    curves: Sequence[Curve] = ()
    x: str = "time [s]"
    choices: Sequence[str] = ()
    choosing: str = "shown"
    log: bool = False
    log_x: bool = False
    equal: bool = False
    over_time: bool = True
    note: str = ""
    layout: Mapping[str, Any] = field(default_factory=dict)
    figure: Mapping[str, Any] | None = None
    drawer: str = ""
    pickers: Sequence[Picker] = ()


@dataclass(frozen=True)
class DesignColumn:
    """Column with one number per run.

    Attributes
    ----------
    identity : str
        Name of the column in the table of the study.
    name, unit : str
        Name and unit as shown.
    values : (k,) array
        Values in that unit; NaN where there is none.
    parameter : bool
        Whether the column is a parameter or (default) a metric.
    log : bool
        Whether its axis is logarithmic.
    """

    identity: str
    name: str
    unit: str
    values: ArrayLike
    parameter: bool = False
    log: bool = False


@dataclass(frozen=True)
class Designs:
    """Runs of many designs for the charts of the page.

    Attributes
    ----------
    columns : sequence of DesignColumn
        Columns, parameters first.
    telling : str
        Name of the property that distinguishes series of runs, such as "mode".
    series : sequence of (str, Look)
        Names and looks of the series.
    member : (k,) array of int
        Index of the series of each run.
    number : (k,) array of int
        Number of the design of each run.
    shown : (k,) array of int
        Index of each run among the runs of the page; -1 for most.
    """

    columns: Sequence[DesignColumn]
    telling: str
    series: Sequence[tuple[str, Look]]
    member: ArrayLike
    number: ArrayLike
    shown: ArrayLike


@dataclass(frozen=True)
class Panel:
    """Charts under one heading."""

    title: str
    charts: Sequence[Chart]


@named_in_errors("a page", "what tracking_page or motion_page returns")
@dataclass(frozen=True)
class Page:
    """Content of a report.

    Attributes
    ----------
    title, subtitle : str
        Title and subtitle of the page.
    kind : str
        Kind of results, for the browser's title.
    verdict : str
        Verdict on the results beside the title, "sound", "doubtful" or "wrong"; empty if there is none.
    facts : sequence of (str, str)
        Names and values of the settings behind the results, at the end of the page.
    command : str
        Command that reproduces the results, below the facts; empty if it is not known.
    figures : sequence of (str, str, str)
        Tiles of the main numbers: name, value, and the member or run they refer to.
    summary, tables, more : sequence of (str, str)
        Headings and HTML of the sections before all charts, before those over time, and after them; see `text.table`.
    survey : sequence of Panel
        Charts of all designs, before the tables.
    designs : Designs, optional
        Data of the survey's charts.
    panels : sequence of Panel
        Charts over time or of single runs.
    time : (k,) array
        Abscissae of curves without x; empty if nothing moves.
    runs : sequence of str
        Names of the runs that can be selected.
    groups : sequence of (str, int)
        Names of groups from which the reader chooses before a run, and their numbers of runs; empty for few runs.
    selecting : str
        Noun for a run on this page: "mode", "model", "design".
    selected : int
        Index of the initially selected run.
    film : Animation, optional
        Animation of the runs.
    no_film : str
        Reason why there is no animation.
    notes : sequence of str
        Notices at the top, such as failed runs.
    remarks : sequence of str
        Remarks that support the results, below the notices.
    """

    title: str
    kind: str
    subtitle: str = ""
    verdict: str = ""
    facts: Sequence[tuple[str, str]] = ()
    command: str = ""
    figures: Sequence[tuple[str, str, str]] = ()
    summary: Sequence[tuple[str, str]] = ()
    tables: Sequence[tuple[str, str]] = ()
    more: Sequence[tuple[str, str]] = ()
    survey: Sequence[Panel] = ()
    designs: Designs | None = None
    panels: Sequence[Panel] = ()
    time: ArrayLike = ()
    runs: Sequence[str] = ()
    groups: Sequence[tuple[str, int]] = ()
    selecting: str = "mode"
    selected: int = 0
    film: Animation | None = None
    no_film: str = ""
    notes: Sequence[str] = ()
    remarks: Sequence[str] = ()


@checked_arguments()
def render(page: Page) -> str:
    """Return the page as HTML."""
    return Template(_asset("page.html")).substitute(
        title=escape(page.title),
        kind=escape(page.kind),
        subtitle=escape(page.subtitle),
        verdict=_verdict(page.verdict),
        contents=_contents(page),
        origin=_origin(page),
        figures=_figures(page.figures),
        notes=_notes(page.notes) + _paragraphs(page.remarks, "notice remark"),
        summary=_sections(page.summary),
        tables=_sections(page.tables),
        more=_sections(page.more),
        no_film=escape(page.no_film),
        charts=_of_charts(page),
        no_charts="" if page.panels else "hidden",
        no_survey="" if page.survey else "hidden",
        version=escape(version("paraflex")),
        style="\n".join(map(_asset, _STYLES)),
        data=_script_json(_data(page)),
        scripts="\n".join(map(_asset, _SCRIPTS)),
        plotly=plotly_script(),
    )


@checked_arguments()
def save_page(page: Page, path: str | Path) -> None:
    """Write the page as an HTML file, which appears whole or not at all.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    path = Path(path)
    with added_to(path.parent) as folder:
        write_text(folder / path.name, render(page), remedy="choose another file")


@cache
def plotly_script() -> str:
    """Return Plotly's script from its Python package without importing the package, which would take a second."""
    found = find_spec("plotly")
    for folder in (found.submodule_search_locations or []) if found else []:
        script = Path(folder) / "package_data" / "plotly.min.js"
        if script.is_file():
            # A closing tag in one of its strings would end the page's script.
            return script.read_text(encoding="utf-8").replace("</script", "<\\/script")
    raise InputError(
        "not installed, or without its script", field="plotly", remedy="pip install --force-reinstall plotly"
    )


def _data(page: Page) -> dict[str, Any]:
    """Return the data for the scripts."""
    series = Series()
    time = series.add(page.time, exact=True)

    def panels(some: Sequence[Panel]) -> list[dict[str, Any]]:
        return [{"title": one.title, "charts": [_chart(chart, series, time) for chart in one.charts]} for one in some]

    return {
        "time": time,
        "runs": list(page.runs),
        "groups": [list(group) for group in page.groups],
        "selecting": page.selecting,
        "selected": page.selected,
        "panels": panels(page.panels),
        "survey": panels(page.survey),
        "designs": None if page.designs is None else _designs(page.designs, series),
        "film": None if page.film is None else page.film.to_dict(),
        "palettes": {name: look.links for name, look in THEMES.items()},
        "series": series.to_dict(),
    }


def _fields(thing: Any, *left_out: str) -> dict[str, Any]:
    """Return the fields of a dataclass, except some, as a dict."""
    return {one.name: getattr(thing, one.name) for one in fields(thing) if one.name not in left_out}


def _designs(designs: Designs, series: Series) -> dict[str, Any]:
    numbers = {name: series.add(getattr(designs, name), exact=True) for name in ("member", "number", "shown")}
    return numbers | {
        "telling": designs.telling,
        "columns": [_fields(column, "values") | {"row": series.add(column.values)} for column in designs.columns],
        "series": [{"name": name} | look._asdict() for name, look in designs.series],
    }


def _chart(chart: Chart, series: Series, time: int) -> dict[str, Any]:
    return _fields(chart) | {
        "pickers": [picker._asdict() for picker in chart.pickers],
        "choices": list(chart.choices),
        "figure": None if chart.figure is None else dict(chart.figure),
        "curves": [
            _fields(curve, "look") | curve.look._asdict()
            | {"x": time if curve.x is None else series.add(curve.x), "y": series.add(curve.y)}
            for curve in chart.curves
        ],
    }  # fmt: skip


def _sections(parts: Sequence[tuple[str, str]]) -> str:
    return "".join(
        f'<section class="card" id="{_anchor(heading)}"><h2>{escape(heading)}</h2>{html}</section>'
        for heading, html in parts
    )


def _anchor(heading: str) -> str:
    return "part-" + re.sub(r"\W+", "-", heading.lower()).strip("-")


def _of_charts(page: Page) -> str:
    """Return the heading of the section of animation and charts."""
    return "Animation and charts" if page.film or page.no_film else "Charts"


def _contents(page: Page) -> str:
    """Return links to the sections of the page in their order; empty if there is only one."""
    parts = [
        *((heading, _anchor(heading)) for heading, _ in page.summary),
        *([("All designs", "survey")] if page.survey else []),
        *((heading, _anchor(heading)) for heading, _ in page.tables),
        *([(_of_charts(page), "moving")] if page.panels else []),
        *((heading, _anchor(heading)) for heading, _ in page.more),
        *([(_ORIGIN, _anchor(_ORIGIN))] if page.facts or page.command else []),
    ]
    return "".join(f'<a href="#{anchor}">{escape(heading)}</a>' for heading, anchor in parts) if len(parts) > 1 else ""


def _notes(notes: Sequence[str]) -> str:
    """Return the notices; many of them are folded from the second on, so that the animation stays visible."""
    if len(notes) < _FOLDED:
        return _paragraphs(notes, "notice")
    rest = _paragraphs(notes[1:], "notice")
    return (
        f"{_paragraphs(notes[:1], 'notice')}<details><summary>{len(notes) - 1} more notices</summary>{rest}</details>"
    )


def _paragraphs(texts: Sequence[str], kind: str) -> str:
    return "".join(f'<p class="{kind}">{escape(text)}</p>' for text in texts)


def _verdict(word: str) -> str:
    if not word:
        return ""
    return f'<span class="verdict {escape(word)}"><span class="unseen">verdict: </span>{escape(word)}</span>'


def _figures(figures: Sequence[tuple[str, str, str]]) -> str:
    tiles = "".join(
        f'<div class="tile"><span>{escape(name)}</span><strong>{escape(value)}</strong>'
        f"<small>{escape(of)}</small></div>"
        for name, value, of in figures
    )
    return f'<div class="tiles">{tiles}</div>' if tiles else ""


def _origin(page: Page) -> str:
    """Return the section of the settings and the command behind the results."""
    facts = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in page.facts)
    html = (f'<dl class="facts">{facts}</dl>' if facts else "") + _command(page.command)
    return _sections([(_ORIGIN, html)]) if html else ""


def _command(command: str) -> str:
    """Return the command, with line breaks only between its options."""
    if not command:
        return ""
    parts = command.replace(" --", "\n--").split("\n")
    return f'<p class="command"><code>{" ".join(f"<span>{escape(part)}</span>" for part in parts)}</code></p>'


def _script_json(data: Mapping[str, Any]) -> str:
    """Return JSON with escapes, so that no name in it can end the script."""
    text = json.dumps(data, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    for mark in "<>&\u2028\u2029":
        text = text.replace(mark, f"\\u{ord(mark):04x}")
    return text


def _asset(name: str) -> str:
    return (files("paraflex.report") / "assets" / name).read_text(encoding="utf-8")
