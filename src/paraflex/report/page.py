"""The HTML page of every report: one file with its style, its scripts, Plotly and the numbers."""

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

from paraflex.arguments import checked_arguments, given_as
from paraflex.errors import InputError
from paraflex.folders import added_to
from paraflex.plots.themes import THEMES
from paraflex.report.film import Animation
from paraflex.report.packing import Series
from paraflex.writing import write_text

# So many notices are folded.
_FOLDED = 3
_ORIGIN = "How these results were made"
_STYLES = ("page.css",)
_SCRIPTS = ("report.js", "designs.js", "charts.js", "player.js", "start.js")


class Look(NamedTuple):
    """Look of a curve: one of the page's eight colours, or without one that of text, as for desired curves.

    Dashes: 0 solid, 1 dashed, 2 dotted, 3 dash-dotted, 4 long dashes.
    """

    colour: int | None = None
    dash: int = 0


PLAIN_LOOK = Look()


@dataclass(frozen=True)
class Curve:
    """A curve of a chart.

    Attributes
    ----------
    name : str
    y : (k,) array
        In the chart's unit; NaN where there is no value.
    x : (k,) array, optional
        The page's time by default.
    look : Look
    run : int, optional
        The run it is of: drawn thicker beside others when this run is selected.
    shown : tuple of int, optional
        Runs with whose selection it is shown; always by default.
    choice : int, optional
        Which of the chart's choices shows it; every one by default.
    quiet : bool
        Left out of the label at the pointer.
    mark : str
        "ring" or "cross": marks at its points instead of a line.
    texts : sequence of str
        What the label at the pointer says of each mark.
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
    """A choice of columns for a chart of designs, and the initial ones."""

    name: str
    columns: Sequence[int]
    chosen: int = 0


@dataclass(frozen=True)
class Chart:
    """A diagram.

    Attributes
    ----------
    identity : str
        A word of its own within the page.
    title, y, x : str
        What it shows; labels of its axes with units.
    curves : sequence of Curve
    choices : sequence of str
        Names of what it shows one at a time: links, motors.
    choosing : str
        What is chosen, for those who hear the page.
    log, log_x, equal : bool
        A logarithmic vertical axis, a logarithmic horizontal one; the same scale both ways.
    over_time : bool
        Whether x is time: a line then moves with the animation, else a dot on every curve of a run.
    note : str
        A sentence under it.
    layout : mapping
        Parts of Plotly's `layout` that are added: numbers of axes, shapes.
    figure : mapping, optional
        Plotly's own `data` and `layout` instead of curves; colours and fonts of the page are added.
    drawer : str
        What of the page's designs it shows instead of curves: "responses", "front", "parallel" or "distribution".
    pickers : sequence of Picker
        What the reader chooses for the drawer.
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
    """A column with a number of every design.

    Attributes
    ----------
    identity : str
        Its name in the table.
    name, unit : str
        As it is shown.
    values : (k,) array
        In that unit; NaN where there is none.
    parameter : bool
        Whether it was varied, or came of it.
    log : bool
        Shown on a logarithmic axis.
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
        Parameters first.
    telling : str
        What distinguishes runs: "mode".
    series : sequence of (str, Look)
        Its names and looks.
    member : (k,) array of int
        Which of them each run is of.
    number : (k,) array of int
        Of its design.
    shown : (k,) array of int
        Which of the page's runs it is; -1 for most.
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


@given_as("a page", "what tracking_page or motion_page returns")
@dataclass(frozen=True)
class Page:
    """Content of a report.

    Attributes
    ----------
    title, subtitle : str
    kind : str
        What it is a report of, for the browser's title.
    verdict : str
        On the results in a word, beside the title: "sound", "doubtful", "wrong"; empty where there is none.
    facts : sequence of (str, str)
        Names and values of what the results were made with, at the end.
    command : str
        The command that gives these results again, below them; empty where it is not known.
    figures : sequence of (str, str, str)
        The few numbers that matter: name, value, and what it is of.
    summary, tables, more : sequence of (str, str)
        Headings and HTML of what stands before all charts, before those over time, and after them; see `text.table`.
    survey : sequence of Panel
        Charts before the tables: what all designs do.
    designs : Designs, optional
        What they draw.
    panels : sequence of Panel
    time : (k,) array
        What curves without x are drawn over; empty where nothing moves.
    runs : sequence of str
        Names of what can be selected.
    groups : sequence of (str, int)
        Names of groups that one chooses from before a run, and how many of the runs each has; none for few runs.
    selecting : str
        What a run is called in this page: "mode", "model", "design".
    selected : int
        The run selected at first.
    film : Animation, optional
        The animation.
    no_film : str
        Why there is none.
    notes : sequence of str
        What the reader has to know first: runs that failed.
    remarks : sequence of str
        What speaks for the results, below the notes.
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
    """The page as HTML."""
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
    """Write the page; the file appears whole or not at all.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    path = Path(path)
    with added_to(path.parent) as folder:
        write_text(folder / path.name, render(page), remedy="choose another file")


@cache
def plotly_script() -> str:
    """Plotly's script from its Python package, without importing it, which would take a second."""
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
    """Data for the scripts."""
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
    """Fields of a dataclass, without some."""
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
    """Name of the part with what moves and what is drawn over time."""
    return "Animation and charts" if page.film or page.no_film else "Charts"


def _contents(page: Page) -> str:
    """Links to the parts of the page, in their order."""
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
    """Notices; the mechanism stays in sight below many of them, as they are folded from the second on."""
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
    """What the results were made with."""
    facts = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in page.facts)
    html = (f'<dl class="facts">{facts}</dl>' if facts else "") + _command(page.command)
    return _sections([(_ORIGIN, html)]) if html else ""


def _command(command: str) -> str:
    """The command, with line breaks between its options only."""
    if not command:
        return ""
    parts = command.replace(" --", "\n--").split("\n")
    return f'<p class="command"><code>{" ".join(f"<span>{escape(part)}</span>" for part in parts)}</code></p>'


def _script_json(data: Mapping[str, Any]) -> str:
    """JSON with escapes, so that no name in it ends the script."""
    text = json.dumps(data, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    for mark in "<>&\u2028\u2029":
        text = text.replace(mark, f"\\u{ord(mark):04x}")
    return text


def _asset(name: str) -> str:
    return (files("paraflex.report") / "assets" / name).read_text(encoding="utf-8")
