"""Figures for print in the user's style: rcParams, styles by name and file, families of fonts, text in SVG, pgf."""

from __future__ import annotations

import io
import re
import stat
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.style
import pytest
import xarray as xr
from matplotlib import font_manager
from matplotlib.colors import same_color

import paraflex as pf
from paraflex import plots
from paraflex.plots.catalogue import CATALOGUE
from paraflex.plots.style import BLUE, changed_settings, write_figure
from shell import paraflex
from test_draw import RIDER, words

# What the pgf backend asks of LaTeX: a start, and the width, height and depth of texts.
LATEX = f"""#!{sys.executable}
import sys
for line in sys.stdin:
    if "pgf_backend_query_start" in line:
        print("*pgf_backend_query_start\\n*", end="", flush=True)
    elif "typeout" in line:
        print("10.0pt,5.0pt,1.0pt\\n\\n*", end="", flush=True)
    elif "@@end" in line:
        break
"""


@pytest.fixture(autouse=True)
def no_settings() -> Iterator[None]:
    """Settings of a user who has none, whatever other tests of the process left."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        yield


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("run") / "results"
    few = ["--mode", "++", "--duration", "0.1", "--samples", "21", "--tol", "1e-3", "--rigid"]
    done = paraflex("run", "five_bar", *few, "--no-figures", "--no-report", "--out", out)
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def data(run: Path) -> xr.Dataset:
    return pf.load_results(run)


def drawn(run: Path, out: Path, *options: object) -> str:
    """The text of a figure written as SVG."""
    done = paraflex("plot", run, "tracking_errors", "--format", "svg", "--output", out, *options)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return (out / "tracking_errors.svg").read_text(encoding="utf-8")


def refused(run: Path, out: Path, *options: object) -> str:
    done = paraflex("plot", run, "tracking_errors", "--output", out, *options)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert not out.exists()
    return line


def sizes(figure: Any) -> list[Any]:
    axes = figure.axes[0]
    return [axes.title.get_fontsize(), axes.yaxis.label.get_fontsize(), axes.get_yticklabels()[0].get_fontsize()]


def test_settings_of_the_user_are_above_the_common_style_and_left_as_they_are(data: xr.Dataset) -> None:
    assert changed_settings() == {}
    assert sizes(plots.tracking_errors(data)) == [8.0, 8.0, 7.0]
    mine: Any = {"lines.linewidth": 7.0, "font.size": 16.0, "axes.labelsize": 5.0, "axes.grid": True}
    with matplotlib.rc_context(mine):
        before = dict(matplotlib.rcParams)
        axes = plots.tracking_errors(data).axes[0]
        assert dict(matplotlib.rcParams) == before
        assert changed_settings() == mine
        # Sizes that are not set follow the common one.
        assert sizes(axes.figure) == [16.0, 5.0, 14.0]
    assert {line.get_linewidth() for line in axes.lines} <= {0.5, 7.0}
    assert axes.xaxis.get_gridlines()[0].get_visible()


@pytest.mark.parametrize("layout", ["figure.constrained_layout.use", "figure.autolayout"])
def test_a_layout_of_matplotlib_neither_moves_nor_warns(data: xr.Dataset, layout: Any) -> None:
    for figure in (plots.tracking_errors, plots.mechanism_drawing):
        usual = figure(data).axes[0].get_position().extents
        with matplotlib.rc_context({layout: True}), warnings.catch_warnings():
            warnings.simplefilter("error")
            drawing = figure(data)
            write_figure(drawing, io.StringIO(), "svg")
        assert drawing.axes[0].get_position().extents == pytest.approx(usual)


@pytest.mark.parametrize("setting", ["axes.titlesize", "axes.labelsize", "xtick.labelsize", "ytick.labelsize"])
def test_large_text_has_room(data: xr.Dataset, setting: str) -> None:
    large: Any = {setting: 20.0}
    with matplotlib.rc_context(large):
        figure = plots.tracking_errors(data)
        figure.canvas.draw()
        (axes,) = figure.axes
        title, of_y, of_x = (text.get_window_extent() for text in (axes.title, axes.yaxis.label, axes.xaxis.label))
        assert title.y1 <= figure.bbox.y1
        assert of_y.x0 >= -1.0
        assert of_x.y0 >= 0.0
        # Numbers end before the names of their axes.
        low, high = axes.get_ylim()
        numbers = [text.get_window_extent() for text in axes.get_yticklabels() if low <= text.get_position()[1] <= high]
        assert min(box.x0 for box in numbers) >= of_y.x1 - 1.0
        assert min(text.get_window_extent().y0 for text in axes.get_xticklabels()) >= of_x.y1 - 1.0


def test_colours_are_those_of_a_cycle_that_is_set(data: xr.Dataset) -> None:
    assert BLUE in {line.get_color() for line in plots.tracking_errors(data).axes[0].lines}
    with matplotlib.style.context("dark_background"):
        axes = plots.end_effector_path(data, "++").axes[0]
        assert same_color(axes.get_facecolor(), "black")
        assert not any(same_color(line.get_color(), "black") for line in axes.lines)
        cycle = matplotlib.rcParams["axes.prop_cycle"].by_key()["color"]
        assert {cycle[0], cycle[1]} <= {line.get_color() for line in plots.tracking_errors(data).axes[0].lines}


def test_a_style_is_named_or_a_file_and_the_last_one_wins(run: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.mplstyle"
    own.write_text("# mine\n\nlines.linewidth: 3.25  # thick\nfigure.facecolor: 123456\n", encoding="utf-8")
    text = drawn(run, tmp_path / "a", "--style", own, "--style", "single")
    assert "stroke-width: 3.25" in text
    assert "#123456" in text
    assert float(re.findall(r'width="([0-9.]+)pt"', text)[0]) == pytest.approx(84.0 / 25.4 * 72.0, abs=1e-3)
    text = drawn(run, tmp_path / "b", "--style", "dark_background", "--style", own)
    assert "#123456" in text
    # Nothing of it is left.
    assert changed_settings() == {}
    assert "#123456" not in drawn(run, tmp_path / "c")


def test_fonts_are_those_of_the_family(run: Path, tmp_path: Path) -> None:
    text = drawn(run, tmp_path / "a", "--font", "stixgeneral", "--svg-text")
    # Symbols too: only glyphs that the family lacks are of another one.
    families = set(re.findall(r"font-family: ([^;\"]*)", text))
    assert families == {"'STIXGeneral', 'DejaVu Sans'", "'STIXGeneral'"}
    assert "DejaVuSans" not in drawn(run, tmp_path / "b", "--font", "STIXGeneral")


def test_text_in_svg_is_text_where_asked_for(run: Path, tmp_path: Path) -> None:
    assert "<text" not in drawn(run, tmp_path / "a")
    assert re.search(r"<text[^>]*>error \[µm\]", drawn(run, tmp_path / "b", "--svg-text"))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--font", "DejaVu"), "(got 'DejaVu'); did you mean \"DejaVu Sans\"?"),
        (("--font", "STIXGenral"), 'did you mean "STIXGeneral"?'),
        (("--font", ""), "--font: no such family"),
        (("--style", "ggplott"), "(got 'ggplott'); did you mean \"ggplot\"?"),
        (("--style", "singel"), "(got 'singel'); did you mean \"single\"?"),
        (("--style", "no.mplstyle"), "--style: neither a width nor a style of Matplotlib (got 'no.mplstyle')"),
        (("--style", "."), "--style: neither a width nor a style of Matplotlib (got '.')"),
        (("--style", "single", "--style", "double"), "--style: more than one width (got 'single double')"),
        (("--font", "serif", "--font", "cursive"), "--font: given 2 times"),
    ],
)
def test_wrong_styles_and_fonts_are_refused_in_a_line(run: Path, tmp_path: Path, options, says: str) -> None:
    assert says in refused(run, tmp_path / "out", *options)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"font.sise: 3\n", "there is no setting font.sise"),
        (b"font.size: large thing\n", "Key font.size: Could not convert 'large thing' to float"),
        (b"\x89PNG\xff", "codec can't decode"),
        (b"no colon\n", "there is no setting no colon"),
        (b"axes.prop_cycle: import os\n", "Key axes.prop_cycle"),
    ],
)
def test_files_that_are_no_styles_are_refused_in_a_line(run: Path, tmp_path: Path, content: bytes, why: str) -> None:
    file = tmp_path / "bad.mplstyle"
    file.write_bytes(content)
    line = refused(run, tmp_path / "out", "--style", file)
    assert why in line
    assert "--style: not a style of Matplotlib" in line


def test_pgf_and_usetex_need_latex(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    told = refused(run, tmp_path / "out", "--format", "pdf,pgf")
    assert "--format: needs LaTeX, and there is no xelatex (got 'pgf'); install it, or choose pdf, svg or png" in told
    style = tmp_path / "tex.mplstyle"
    style.write_text("text.usetex: True\npgf.texsystem: lualatex\n")
    assert "text.usetex: needs LaTeX, and there is no latex" in refused(run, tmp_path / "out", "--style", style)
    assert "no lualatex" in refused(run, tmp_path / "out", "--style", style, "--format", "pgf")


@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in is a script")
def test_pgf_is_written_with_latex(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "bin" / "xelatex"
    program.parent.mkdir()
    program.write_text(LATEX, encoding="utf-8")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", str(program.parent))
    done = paraflex("plot", run, "tracking_errors", "--format", "pgf", "--output", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "out" / "tracking_errors.pgf").read_text(encoding="utf-8")
    assert r"\begin{pgfpicture}" in text
    assert "error [µm]" in text


def test_descriptions_of_figures_are_free_of_the_papers_numbers(run: Path) -> None:
    listed = paraflex("plot", run, "--list").stdout
    assert "torque of every motor over time, one panel per mode\n" in listed
    shown = [figure.shows for figures in CATALOGUE.values() for figure in figures]
    assert not re.search(r"\b(Figs?|Tables?)\.? [0-9]", "\n".join([listed, *shown]))
    assert {figure.paper for figure in CATALOGUE["tracking"]} >= set(range(11, 19))


def test_points_apart_from_joints_are_named_in_drawings() -> None:
    assert {"beam.tip", "pivot, damper bearing"} <= set(words(pf.draw("pendulum")))
    andrews = words(pf.draw("andrews"))
    assert "K3.D" in andrews
    # Points of joints have the names of their joints.
    assert not {"K1.O", "K3.B"} & set(andrews)
    assert words(pf.draw("raparm_i")).count("end-effector link4.C") == 1
    assert "link4.C" not in words(pf.draw("raparm_i"))


def test_too_many_points_are_left_out_with_a_remark(tmp_path: Path) -> None:
    many = ", ".join(f"p{k} = [0.0, {0.002 * k + 0.01:.3f}]" for k in range(50))
    file = tmp_path / "rider.toml"
    file.write_text(RIDER.replace("T = [0.0, 0.15]", f"T = [0.0, 0.15], {many}"), encoding="utf-8")
    said = words(pf.draw(file))
    assert any(one.endswith("; names of points left out") for one in said)
    assert "tool.T" not in said


def test_a_drawing_of_a_run_names_joints_and_the_followed_point(data: xr.Dataset) -> None:
    said = words(plots.mechanism_drawing(data, "++"))
    assert {"A₁", "B₁", data.attrs["end_effector_point"]} <= set(said)
    assert "proximal1.B1" in words(plots.mechanism_drawing(data, "++", point="proximal1.B1"))


def test_every_family_of_fonts_is_found_by_its_name() -> None:
    from paraflex.plots.style import _family

    for name in {one.name for one in font_manager.fontManager.ttflist}:
        assert _family(name.upper()).casefold() == name.casefold()
