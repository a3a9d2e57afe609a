"""The report of a study as a reader has it: charts follow their selectors, tables sort, the best designs move."""

import pytest
from playwright.sync_api import Page

from conftest import DESKTOP, PHONE
from paraflex.reports import save_page
from paraflex.studies import load_sweep, sweep
from paraflex.studies.sweeps.report import study_page
from test_report_browser import SharedPages, choose_run, drawn, wait_for_drawing

STUDY = """
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++", "+++-"]
duration = 0.12
samples = 25
metrics = ["tracking_rms", "deflection_max", "peak_torque_max", "total_mass"]

[integration]
method = "esdirk5"
tolerance = 1e-3

[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.004
high = 0.008
number = 3

[vary.end]
fields = ["lump.end.mass"]
values = [0.1, 0.2, 0.3]
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    result = sweep(load_sweep(folder / "study.toml"), folder / "out", workers=1)
    save_page(study_page(result.folder), folder / "report.html")
    return folder / "report.html"


@pytest.fixture(scope="module")
def pages(browser, report):
    return SharedPages(browser, report)


@pytest.fixture
def shared(pages):
    """The report in a window that other tests use too."""
    yield pages
    pages.check()


def traces(page: Page, chart: str) -> list[dict]:
    """What Plotly draws in a chart, once it is drawn."""
    page.locator(f"#chart-{chart}").scroll_into_view_if_needed()
    page.wait_for_function("(id) => charts.all.find((c) => c.description.identity === id).drawn", arg=chart)
    wait_for_drawing(page)
    return page.evaluate(
        """(id) => document.querySelector(`#chart-${id} .js-plotly-plot`).data.map((trace) => ({
            mode: trace.mode || trace.type, name: trace.name,
            x: Array.from(trace.x || []), y: Array.from(trace.y || []),
            customdata: Array.from(trace.customdata || []),
        }))""",
        chart,
    )


def values(page: Page, identity: str) -> list[float]:
    """A column of all designs."""
    return page.evaluate(
        "(name) => Array.from(report.row(report.page.designs.columns.find((c) => c.identity === name).row))", identity
    )


def choose(page: Page, chart: str, which: str, name: str) -> None:
    page.locator(f"#chart-{chart} select[aria-label$=': {which}']").select_option(label=name)
    wait_for_drawing(page)


def test_every_chart_of_all_designs_is_drawn(shared):
    page = shared()
    for chart in ("responses1", "responses2", "front", "distribution", "parallel"):
        assert traces(page, chart)
    assert page.locator("#chart-parallel canvas").count() > 0


def test_selectors_of_metric_and_parameter_change_the_response(shared):
    page = shared()
    marks = [trace for trace in traces(page, "responses1") if trace["mode"] == "markers" and trace["customdata"]]
    assert [trace["name"] for trace in marks] == ["++++", "+++-"]
    first, rows = marks[0], marks[0]["customdata"]
    assert first["x"] == [values(page, "thickness")[row] for row in rows]
    assert first["y"] == [values(page, "tracking_rms")[row] for row in rows]
    choose(page, "responses1", "of", "mass")
    choose(page, "responses1", "to", "end")
    changed = traces(page, "responses1")[0]
    assert changed["x"] == [values(page, "end")[row] for row in rows]
    assert changed["y"] == [values(page, "total_mass")[row] for row in rows]


def test_a_grid_is_joined_by_lines_and_medians(shared):
    page = shared()
    marks, _, lines, middles = traces(page, "responses1")[:4]
    assert (lines["mode"], middles["mode"]) == ("lines", "lines")
    # Three masses, each a line over three thicknesses and a gap.
    assert len(lines["x"]) == 3 * 4
    assert middles["x"] == sorted(set(marks["x"]))
    at = [sorted(y for x, y in zip(marks["x"], marks["y"], strict=True) if x == level)[1] for level in middles["x"]]
    assert middles["y"] == pytest.approx(at)


def test_the_front_is_that_of_no_better_design(shared):
    page = shared()
    for across, up, names in (("tracking_rms", "total_mass", ("RMS tracking error", "mass")),
                              ("total_mass", "peak_torque_max", ("mass", "peak torque"))):  # fmt: skip
        choose(page, "front", "across", names[0])
        choose(page, "front", "up", names[1])
        x, y = values(page, across), values(page, up)
        for k in (0, 1):
            drawn_all, front = traces(page, "front")[2 * k : 2 * k + 2]
            rows = drawn_all["customdata"]
            expected = {
                row for row in rows
                if not any(x[o] <= x[row] and y[o] <= y[row] and (x[o], y[o]) != (x[row], y[row]) for o in rows)
            }  # fmt: skip
            assert set(front["customdata"]) == expected


def test_the_histogram_counts_every_run(shared):
    page = shared()
    for trace in traces(page, "distribution"):
        assert sum(trace["y"][1:-1:2]) == 9


def test_a_design_chosen_moves_and_is_ringed(shared):
    page = shared()
    ring = traces(page, "responses1")[-1]
    page.evaluate("player.seek(0.03)")
    picture, name = drawn(page), page.evaluate("report.runName()")
    choose_run(page, "tr[data-run='2']")
    assert page.evaluate("report.runName()") != name
    assert drawn(page) != picture
    assert traces(page, "responses1")[-1] != ring
    page.locator("#runs label").first.click()
    assert page.evaluate("report.runName()") == name
    still = drawn(page)
    page.get_by_role("button", name="Play").click()
    page.wait_for_function("report.state.time > 0.031")
    assert drawn(page) != still
    # A mark of a run that is shown selects it.
    page.evaluate("designs.choose({ customdata: Array.from(report.row(report.page.designs.shown)).indexOf(1) })")
    assert page.evaluate("report.state.run") == 1


def test_the_table_sorts_by_any_number(shared):
    page = shared()
    keys = "[...document.querySelectorAll('tr[data-run]')].map((row) => JSON.parse(row.dataset.keys)[{}])"
    head = page.locator("table.sortable th", has_text="thickness")
    column = page.evaluate("(head) => head.cellIndex", head.element_handle())
    head.locator("button").click()
    assert page.evaluate(keys.format(column)) == sorted(page.evaluate(keys.format(column)))
    assert head.get_attribute("aria-sort") == "ascending"
    head.locator("button").click()
    assert page.evaluate(keys.format(column)) == sorted(page.evaluate(keys.format(column)), reverse=True)


@pytest.mark.parametrize("viewport", [PHONE, DESKTOP], ids=["phone", "desk"])
def test_nothing_is_wider_than_the_screen(shared, viewport):
    page = shared(viewport)
    for chart in ("front", "parallel", "strain"):
        traces(page, chart)
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]


def test_charts_of_designs_follow_the_theme(opened):
    page = opened(color_scheme="dark")
    colours = """() => {
        const data = (id) => document.querySelector(`#chart-${id} .js-plotly-plot`).data;
        return [data("responses1")[0].marker.color, JSON.stringify(data("parallel")[0].line.colorscale)];
    }"""
    traces(page, "responses1")
    traces(page, "parallel")
    dark = page.evaluate(colours)
    page.emulate_media(color_scheme="light")
    traces(page, "responses1")
    traces(page, "parallel")
    page.wait_for_timeout(100)
    assert all(one != other for one, other in zip(dark, page.evaluate(colours), strict=True))


def test_everything_has_a_name(shared):
    page = shared()
    traces(page, "parallel")
    nameless = page.evaluate(
        """[...document.querySelectorAll("main button, main input, main select")].filter((one) =>
            !(one.getAttribute("aria-label") || one.textContent.trim() || (one.labels && one.labels.length))
        ).map((one) => one.outerHTML)"""
    )
    assert nameless == []
