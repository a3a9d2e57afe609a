"""Descriptions of charts and tables: units, scales, text of numbers; print and page draw the same curves."""

import base64
import json
import re
import zlib

import numpy as np
import pytest

import paraflex as pf
from paraflex import plots
from paraflex.figures.catalogue import figures_of_kind, page_panels
from paraflex.figures.charts import Axis, Chart, Curve, Panel, Span, is_logarithmic, look
from paraflex.figures.entry import prepared
from paraflex.figures.tables import Column, Table
from paraflex.formatting import common_unit, display_unit, number, quantity, typeset
from paraflex.plots.labels import mathematics
from paraflex.reports.page import Page, render
from paraflex.reports.text import table_html
from paraflex.units import DisplayUnit


@pytest.mark.parametrize(
    ("value", "options", "text"),
    [
        (0.377, {}, "0.377"),
        (0.377, {"digits": 5, "padded": True}, "0.37700"),
        (1.2e-5, {}, "1.2e-05"),
        (1.2e-5, {"digits": 3, "padded": True}, "1.20e-05"),
        (43708.2, {}, "43708"),
        (999.96, {}, "1000"),
        (999999.7, {}, "1e+06"),
        (-12345.6, {"factor": 1e-3}, "-12.35"),
        (0.0, {}, "0"),
        (1e-16, {"beside": 1.0}, "0"),
        (1e-14, {"beside": 1.0}, "1e-14"),
        (1e-14, {"beside": np.nan}, "1e-14"),
        (None, {}, "-"),
        (np.nan, {"missing": ""}, ""),
        (np.inf, {"infinite": "rigid"}, "rigid"),
        (np.float32(0.25), {}, "0.25"),
    ],
)
def test_one_rule_from_number_to_text(value, options, text):
    assert number(value, **options) == text
    if text not in ("", "-", "rigid"):
        found = float(text)
        # The text is the value to its digits, or zero.
        assert found == 0.0 or found == pytest.approx(options.get("factor", 1.0) * value, rel=0.6 * 10.0**-3)


def test_typeset_numbers_are_those_of_pages():
    assert typeset("1.20e-05") == "1.20 × 10⁻⁵"
    assert typeset("-3.5e+12 N") == "−3.5 × 10¹² N"
    assert typeset("-") == "–"
    # Names and modes are no numbers.
    for text in ("-+-+", "robot-2", "A1", "link.tip", "v1.2e5x", "tau-1e5"):
        assert typeset(text) == text
    assert typeset("t = -0.5 s") == "t = −0.5 s"


def test_units_are_chosen_by_size():
    assert display_unit("m", [2e-4, -1e-5]).name == "mm"
    assert display_unit("m", [9e-5]).name == "µm"
    assert display_unit("Pa", [3e8]).name == "MPa"
    assert display_unit("N", [1e9]).name == "kN"
    assert display_unit("kg", [1e9]) == DisplayUnit("kg", 1.0)
    assert common_unit("N/m", [1080.0, 5.3e6]).name == "N/mm"
    assert common_unit("m", [None, np.nan, 2e-6, 5e-5]).name == "µm"
    assert quantity(3.77e-4, "m") == "0.377 mm"
    # A unit that a user chooses is a field of the axis and of the column.
    chart = Chart("a", "A", Axis("way", "m", shown=DisplayUnit("in", 1 / 0.0254)), [Curve("", [0.0254], [0.0])])
    assert chart.shown_units().of(None).factor * 0.0254 == pytest.approx(1.0)
    assert Column("way", [0.0254], "m", shown=DisplayUnit("in", 1 / 0.0254)).texts() == ["1"]


def test_axes_are_logarithmic_only_where_decades_matter():
    axis = Axis("stiffness", "N/m", log=True)
    assert is_logarithmic(axis, [1.0, 11.0, np.nan, -3.0])
    assert not is_logarithmic(axis, [1.0, 9.0])
    assert not is_logarithmic(axis, [])
    assert not is_logarithmic(Axis("stiffness", "N/m"), [1.0, 1e9])


def test_symbols_are_mathematics_in_print():
    assert mathematics("travel of A₁ [mm]") == "travel of $A_{1}$ [mm]"
    assert mathematics("angular velocity φ\u0307 [rad/s]") == r"angular velocity $\dot \varphi$ [rad/s]"
    assert mathematics("x") == "$x$"
    assert mathematics("a $5 link") == r"a \$5 link"


def test_tables_have_one_unit_a_column_and_drop_what_nobody_knows():
    table = Table("Steps", [
        Column("beam", ["A1", "left"]), Column("way", [0.001, -0.0205], "m"), Column("lost", [None, np.nan], "N"),
        Column("stress", [1.0e6, None], "Pa", below=[2.5e5, 1.0e6]), Column("step", [1, 12000]),
    ]).filled()  # fmt: skip
    assert table.heads() == [("beam", ""), ("way", "mm"), ("stress", "MPa"), ("step", "")]
    assert table.texts() == [["A1", "1", "1\n0.25", "1"], ["left", "-20.5", "-\n1", "12000"]]
    html = table_html(table)
    assert "A₁" in html
    assert "−20.5" in html
    assert "[mm]" in html
    assert [row[0] for row in table.thinned([1]).texts()] == ["left"]
    assert table.thinned([1]).title == "Steps (1 of 2)"
    assert not Table("Empty", [Column("beam", [])])


@pytest.fixture(scope="module")
def statics():
    pushed = pf.statics(pf.load("leaf_spring_guide"), moved={"stage.T.x": 0.01}, steps=4, stiffness=["stage.T.angle"])
    return pf.statics_dataset(pushed)


def page_data(panels, time=(0.0, 1.0)):
    """Charts of a page as its scripts see them, with their rows of numbers."""
    html = render(Page(title="t", kind="statics", panels=panels, time=list(time)))
    data = json.loads(re.search(r'<script[^>]*type="application/json"[^>]*>(.*?)</script>', html, re.S)[1])
    packed = data["series"]
    raw = np.frombuffer(zlib.decompress(base64.b64decode(packed["data"])), np.uint8)
    joined = np.ascontiguousarray(raw.reshape(4, -1).T).view("<f4").ravel()
    rows = np.split(joined, np.cumsum(packed["lengths"])[:-1])
    return {chart["identity"]: chart for panel in data["panels"] for chart in panel["charts"]}, rows


def test_print_and_page_draw_the_same_curves(statics):
    charts, rows = page_data(page_panels("statics", statics))
    for name, entry in figures_of_kind("statics").items():
        described = entry.describe(statics)
        figure = getattr(plots, name)(statics)
        for panel, chart in zip(figure.axes, described, strict=True):
            shown = charts[chart.identity]
            assert panel.get_xlabel().replace("$", "") == shown["x"]
            curves = [curve for curve in shown["curves"] if curve["choice"] in (None, 0)]
            drawn = [line for line in panel.lines if len(line.get_xdata()) == len(rows[curves[0]["x"]])]
            for curve in curves:
                x, y = rows[curve["x"]], rows[curve["y"]]
                assert any(
                    np.allclose(line.get_xdata(), x, rtol=1e-4) and np.allclose(line.get_ydata(), y, rtol=1e-4,
                                                                              equal_nan=True) for line in drawn
                ), (name, curve["name"])  # fmt: skip


def linear_models():
    return pf.linear_dataset([pf.linearise(pf.load("five_bar"))])


def reduced_models():
    return pf.reduction_dataset([pf.linearise(pf.load("five_bar"))], 16)


def run_without_path():
    return pf.motion_dataset(pf.simulate_motion(pf.load("pendulum").mechanism, 0.2, samples=41))


def tracking_runs():
    return pf.tracking_dataset([pf.simulate(pf.plan("five_bar", samples=41), "++")])


def is_drawn(x, y, line):
    """Whether a printed line has the values of a curve of the page, of which a constant one may have one value only."""
    return line.shape[1] == len(x) and np.allclose(line, [x, np.broadcast_to(y, len(x))], rtol=1e-4, equal_nan=True)


@pytest.mark.parametrize(("kind", "made"), [
    ("linear", linear_models), ("reduction", reduced_models), ("motion", run_without_path), ("tracking", tracking_runs),
])  # fmt: skip
def test_print_and_page_draw_the_same_curves_of_models_and_runs(kind, made):
    data = made()
    charts, rows = page_data(page_panels(kind, data), data["time"].values if "time" in data else (0.0, 1.0))
    compared = 0
    for name, entry in figures_of_kind(kind).items():
        if not entry.can_show(data):
            continue
        figure = getattr(plots, name)(data)
        drawn = [line.get_xydata().T for panel in figure.axes for line in panel.lines]
        runs = prepared(data)
        for chart in entry.describe(runs, **entry.defaults(runs)):
            # Pages show the places of values on a symmetrical logarithmic axis, and leave out some charts of print.
            if chart.identity not in charts or chart.x.linear_below or chart.axis(None).linear_below:
                continue
            names = [curve.name for curve in chart.curves]
            curves = [curve for curve in charts[chart.identity]["curves"] if curve["name"] in names]
            first = [curve for curve in curves if curve["choice"] in (None, 0)][: entry.curves]
            found = [any(is_drawn(rows[curve["x"]], rows[curve["y"]], line) for line in drawn) for curve in first]
            # Print has the first members only of a figure with a panel for each.
            assert any(found) if entry.members else all(found), (name, chart.identity, found)
            compared += len(found)
    assert compared > 2


def test_what_a_page_and_print_draw_beside_curves():
    chart = Chart(
        "bars", "Bars", Axis("", names=["one", "two"]), [Curve("a", [0.0, 1.0], [3.0, 5.0], look(0), mark="bar")],
        Axis("share"), spans=[Span(1.0, 2.0, "range")], levels=[0.5],
    )  # fmt: skip
    charts, _ = page_data([Panel("All", [chart])])
    assert charts["bars"]["layout"]["yaxis"]["ticktext"] == ["one", "two"]
    assert len(charts["bars"]["layout"]["shapes"]) == 2
    assert charts["bars"]["curves"][0]["mark"] == "bar"


def test_whole_numbers_with_a_unit_are_converted_as_others_are():
    column = Column("stiffness", [25000, 1000], "N/m", below=[5, None])
    assert column.texts() == ["25\n0.005", "1"]
    assert column.shown_unit.name == "N/mm"
    assert Column("way", [1, 0.002], "m").texts() == ["1000", "2"]
    assert Column("steps", [25000, np.int64(3)]).texts() == ["25000", "3"]


def test_names_beside_charts_are_texts_and_short():
    names = ["<b>bold</b>", "n" * 300]
    chart = Chart(
        "bars", "Bars", Axis("", names=names), [Curve("a", [0.0, 1.0], [3.0, 5.0], mark="bar")], Axis("share")
    )
    charts, _ = page_data([Panel("All", [chart])])
    first, second = charts["bars"]["layout"]["yaxis"]["ticktext"]
    assert first == "&lt;b&gt;bold&lt;/b&gt;"
    assert len(second) < 50


def test_charts_without_a_value_are_none():
    assert not Chart("a", "A", Axis("y"), [Curve("", [np.nan, np.nan])]).has_values
    assert not Chart("a", "A", Axis("y"), [Curve("", [0.0], [np.nan])]).has_values
    assert not Chart("a", "A", Axis("y")).has_values
    assert Chart("a", "A", Axis("y"), [Curve("", [np.nan, 1.0])]).has_values
    assert typeset("inf") == "∞"
