"""HTML page of every report: one file with its style, its scripts, Plotly and the numbers."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from html import escape
from importlib.metadata import version
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.arrays import ArrayLike
from paraflex.display import Shown
from paraflex.errors import InputError
from paraflex.figures.abscissae import Abscissa
from paraflex.figures.charts import (
    Array,
    Axis,
    Chart,
    Curve,
    Panel,
    ShownUnits,
    is_logarithmic,
    joined,
    symmetrical_numbers,
)
from paraflex.folders import added_to
from paraflex.formatting import logarithmic_number, shortened, typeset
from paraflex.late import view
from paraflex.plots.themes import THEMES
from paraflex.units import DisplayUnit
from paraflex.writing import write_text
from .designs import PARALLEL, Designs
from .film import Animation
from .packing import Series, deflated
from .text import pairs

# Number of notices from which they are folded.
_FOLDED = 3
_ORIGIN = "How these results were made"
_STYLES = ("page.css",)
_SCRIPTS = ("unpacking.js", "report.js", "designs.js", "charts.js", "player.js", "start.js")


@named_in_errors("a page", "what tracking_page or motion_page returns")
@dataclass(frozen=True)
class Page(Shown):
    """Content of a report.

    Attributes
    ----------
    title, subtitle : str
        Title and subtitle of the page.
    kind : str
        Kind of results, for the browser's title.
    verdict : str
        Verdict on the results beside the title, "sound", "doubtful" or "wrong"; empty if there is none.
    judged : str
        Results that the verdict is about, before it; empty if it is about all of them.
    words : str
        Sentences about the verdict below the title; by default general ones.
    facts : sequence of (str, str)
        Names and values of the settings behind the results, at the end of the page.
    command : str
        Command that reproduces the results, below the facts; empty if it is not known.
    figures : sequence of (str, str, str)
        Tiles of the main numbers: name, value, and the member or run they refer to.
    summary, tables, more : sequence of (str, str)
        Headings and HTML of the sections before all charts, before those over time, and after them, as of
        `text.sections`.
    survey : sequence of Panel
        Charts of all designs, before the tables.
    designs : Designs, optional
        Data of the survey's charts.
    panels : sequence of Panel
        Charts over time or of single runs.
    time : (k,) array
        Abscissae of curves without x; empty if nothing moves.
    abscissae : sequence of Abscissa
        Quantities over which the reader may see the charts over time.
    over : str
        Name of the abscissa shown first; the time (default) where there is none of this name.
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
        Reason why there is no animation, shown if there is none.
    notes : sequence of str
        Notices at the top, such as failed runs.
    remarks : sequence of str
        Remarks that support the results, below the notices.
    """

    title: str
    kind: str
    subtitle: str = ""
    verdict: str = ""
    judged: str = ""
    words: str = ""
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
    abscissae: Sequence[Abscissa] = ()
    over: str = ""
    runs: Sequence[str] = ()
    groups: Sequence[tuple[str, int]] = ()
    selecting: str = "mode"
    selected: int = 0
    film: Animation | None = None
    no_film: str = ""
    notes: Sequence[str] = ()
    remarks: Sequence[str] = ()

    def save(self, path: str | Path) -> None:
        """Write the page as an HTML file; see `save_page`."""
        save_page(self, path)


@view.register(Page)
def page_html(page: Page) -> str:
    """Return the page in a frame of its own, apart from the notebook's scripts and styles."""
    style = "width: 100%; height: 45em; border: 0"
    return f'<iframe srcdoc="{escape(render(page))}" sandbox="allow-scripts allow-downloads" style="{style}"></iframe>'


@checked_arguments()
def render(page: Page) -> str:
    """Return the page as HTML."""
    return Template(_asset("page.html")).substitute(
        title=escape(page.title),
        kind=escape(page.kind),
        subtitle=escape(page.subtitle),
        lead=escape(_lead(page)),
        verdict=_verdict(page.verdict, page.judged),
        contents=_contents(page),
        origin=_origin(page),
        figures=_figures(page.figures),
        notes=_notes(page.notes) + paragraphs(page.remarks, "notice remark"),
        summary=_sections(page.summary),
        tables=_sections(page.tables),
        more=_sections(page.more),
        no_film="" if page.film else escape(page.no_film),
        charts=_of_charts(page),
        no_charts="" if page.panels else "hidden",
        no_survey="" if page.survey else "hidden",
        version=escape(version("paraflex")),
        style="\n".join(map(_asset, _STYLES)),
        data=_script_json(page_data(page)),
        scripts="\n".join(map(_asset, _SCRIPTS)),
        plotly=plotly_script(whole=_needs_whole(page)),
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
def plotly_script(*, whole: bool) -> str:
    """Return Plotly's script, compressed: its basic part, or the whole, which its Python package has.

    The package itself, whose import takes a second, is not imported.
    """
    if not whole:
        return deflated(_asset("plotly-basic.min.js").encode())
    found = find_spec("plotly")
    for folder in (found.submodule_search_locations or []) if found else []:
        script = Path(folder) / "package_data" / "plotly.min.js"
        if script.is_file():
            return deflated(script.read_bytes())
    raise InputError(
        "not installed, or without its script", field="plotly", remedy="pip install --force-reinstall plotly"
    )


def _needs_whole(page: Page) -> bool:
    """Return whether a page has charts beyond lines, marks and bars: parallel coordinates."""
    return any(getattr(chart, "drawer", "") == PARALLEL for panel in page.survey for chart in panel.charts)


def page_data(page: Page) -> dict[str, Any]:
    """Return the data for the scripts."""
    series = Series()
    time = series.add(page.time, exact=True)

    def panels(some: Sequence[Panel]) -> list[dict[str, Any]]:
        return [{"title": one.title, "charts": [_chart(chart, series, time) for chart in one.charts]} for one in some]

    return {
        "time": time,
        "abscissae": [{"name": axis.name, "label": axis.label(unit), "rows": [series.add(unit.factor * x) for x in row]}
                      for _, axis, row, _ in page.abscissae for unit in [axis.unit_for(row)]],
        "over": next((k for k, one in enumerate(page.abscissae, start=1) if one.name == page.over), 0),
        "runs": list(page.runs),
        "groups": [list(group) for group in page.groups],
        "selecting": page.selecting,
        "selected": page.selected,
        "panels": panels(page.panels),
        "survey": panels(page.survey),
        "designs": None if page.designs is None else page.designs.to_dict(series),
        "film": None if page.film is None else page.film.to_dict(),
        "palettes": {name: look.links for name, look in THEMES.items()},
        "series": series.to_dict(),
    }  # fmt: skip


def _fields(thing: Any, *left_out: str) -> dict[str, Any]:
    """Return the fields of a dataclass, except some, as a dict."""
    return {one.name: getattr(thing, one.name) for one in fields(thing) if one.name not in left_out}


def _chart(chart: Chart, series: Series, time: int) -> dict[str, Any]:
    """Return a described chart for the scripts, in the units in which it is shown."""
    units = chart.shown_units()
    labels = [axis.label(unit) for axis, unit in zip(chart.axes, units.y, strict=False)]

    def curve(one: Curve) -> dict[str, Any]:
        x = time if one.x is None else series.add(_placed(chart.x, units.x, one.x))
        y = series.add(_placed(chart.axis(one.choice), units.of(one.choice), one.y))
        own = {"x": x, "y": y} | ({"texts": list(map(typeset, one.texts))} if one.mark else {})
        # What a plain line does not have is left out of the file.
        left_out = () if one.mark else ("mark", "size", "faint", "thickness", "line", "texts")
        left_out = left_out if one.quiet else (*left_out, "quiet")
        return _fields(one, "look", "desired", "stopped", *left_out) | one.look._asdict() | own

    ys, xs = (joined(each) for each in (
        (one.y for one in chart.curves), (one.x for one in chart.curves if one.x is not None)
    ))  # fmt: skip
    return {
        "identity": chart.identity, "title": chart.title, "y": labels, "x": chart.x.label(units.x),
        "curves": [curve(one) for one in chart.curves], "choices": list(chart.choices), "choosing": chart.choosing,
        "log": is_logarithmic(chart.axis(None), ys), "log_x": is_logarithmic(chart.x, xs),
        "equal": chart.equal, "over_time": chart.over_time, "note": chart.note, "layout": _layout(chart, units),
        "drawer": getattr(chart, "drawer", ""),
        "pickers": [picker._asdict() for picker in getattr(chart, "pickers", ())],
    }  # fmt: skip


def _layout(chart: Chart, units: ShownUnits) -> dict[str, Any]:
    """Return additional parts of Plotly's layout: shaded ranges, levels, and numbers of symmetrical axes and names."""
    shade = {"type": "rect", "xref": "x", "yref": "paper", "y0": 0.0, "y1": 1.0, "fillcolor": "rgba(128,128,128,0.14)",
             "line": {"width": 0}, "layer": "below"}  # fmt: skip
    level = {
        "type": "line",
        "xref": "paper",
        "x0": 0.0,
        "x1": 1.0,
        "line": {"width": 1, "dash": "dash", "color": "grey"},
    }
    end = chart.x.high or joined(one.x for one in chart.curves if one.x is not None).max(initial=0.0)
    ends = ([x if np.isfinite(x) else end for x in span[:2]] for span in chart.spans)
    shapes = [shade | dict(zip(("x0", "x1"), _placed(chart.x, units.x, each).tolist(), strict=True)) for each in ends]
    shapes += [level | {"y0": units.of(None).factor * y, "y1": units.of(None).factor * y} for y in chart.levels]
    out: dict[str, Any] = {"shapes": shapes} if shapes else {}
    both = {"xaxis": (chart.x, units.x), "yaxis": (chart.axis(None), units.of(None))}
    out |= {key: _symmetrical(axis, unit) for key, (axis, unit) in both.items() if axis.linear_below}
    if names := chart.axis(None).names:
        # Plotly reads tags in texts.
        texts = [escape(shortened(name), quote=False) for name in names]
        out["yaxis"] = {"tickvals": list(range(len(names))), "ticktext": texts, "range": [len(names) - 0.4, -0.6]}
    return out


def _placed(axis: Axis, unit: DisplayUnit, values: ArrayLike) -> Array:
    """Return values in the unit of an axis, or the places of values on a symmetrical logarithmic axis."""
    values = np.asarray(values, dtype=float)
    if not axis.linear_below:
        return unit.factor * values
    return np.sign(values) * np.log10(1.0 + np.abs(values) / axis.linear_below)


def _symmetrical(axis: Axis, unit: DisplayUnit) -> dict[str, Any]:
    """Return Plotly's layout of a symmetrical logarithmic axis."""
    ticks, limits = symmetrical_numbers(axis), [axis.low or 0.0, axis.high or 0.0]
    return {
        "tickvals": _placed(axis, unit, ticks).tolist(), "range": _placed(axis, unit, limits).tolist(),
        "ticktext": list(map(logarithmic_number, unit.factor * ticks)), "zeroline": axis.zero, "tickangle": 0,
    }  # fmt: skip


def _sections(parts: Sequence[tuple[str, str]]) -> str:
    return "".join(
        f'<details class="card part" id="{_anchor(heading)}" open><summary><h2>{escape(heading)}</h2></summary>{html}'
        "</details>"
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


def _lead(page: Page) -> str:
    """Return what came out and whether to trust it: the first number, and the verdict in words."""
    first = next((each for each in page.figures if each[0] != "status"), None)
    words = []
    if first is not None:
        label, value, where = first[0], first[1], first[2].partition(";")[0]
        words.append(f"{label[:1].upper()}{label[1:]}: {value}{f', {where}' if where else ''}.")
    if page.words:
        words.append(page.words)
    elif page.verdict == "sound":
        words.append("No check gives reason for doubt.")
    elif page.verdict:
        below = f": see the notice{'s' * (len(page.notes) > 1)} below" if page.notes else ""
        words.append(f"These results are {page.verdict}{below}.")
    return " ".join(words)


def _notes(notes: Sequence[str]) -> str:
    """Return the notices; many of them are folded from the second on, so that the animation stays visible."""
    if len(notes) < _FOLDED:
        return paragraphs(notes, "notice")
    rest = paragraphs(notes[1:], "notice")
    return f"{paragraphs(notes[:1], 'notice')}<details><summary>{len(notes) - 1} more notices</summary>{rest}</details>"


def paragraphs(texts: Sequence[str], kind: str) -> str:
    """Return texts as paragraphs of a class of the style sheet."""
    return "".join(f'<p class="{kind}">{escape(text)}</p>' for text in texts)


def _verdict(word: str, judged: str) -> str:
    if not word:
        return ""
    of = f"{escape(judged)}: " if judged else ""
    return f'<span class="verdict {escape(word)}"><span class="unseen">verdict: </span>{of}{escape(word)}</span>'


def _figures(figures: Sequence[tuple[str, str, str]]) -> str:
    tiles = "".join(
        f'<div class="tile"><span>{escape(name)}</span><strong>{escape(typeset(value))}</strong>'
        f"<small>{escape(typeset(of))}</small></div>"
        for name, value, of in figures
    )
    return f'<div class="tiles">{tiles}</div>' if tiles else ""


def _origin(page: Page) -> str:
    """Return the section of the settings and the command behind the results."""
    html = pairs(page.facts, "facts") + _command(page.command)
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
    return (files("paraflex.reports") / "assets" / name).read_text(encoding="utf-8")
