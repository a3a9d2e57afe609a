"""The report as a reader has it, in a real Chromium without a window: it opens, moves, follows its keys, fits."""

from collections import Counter
from itertools import combinations
from pathlib import Path

import pytest
from playwright.sync_api import Error, Page

from colours import APART, colour_distance
from conftest import DESKTOP, PHONE, LastingBrowser, is_ours, page_asks
from paraflex.figures.charts import Axis
from paraflex.plots.themes import THEMES
from paraflex.reports import Chart, Curve, Page as ReportPage, Panel, save_page, tracking_page, verification_page
from reports import FAILED, MODES, tracked, verified

# Of opening, on a machine that is busy with other tests as well: the best of so many is told [ms].
OPENING, TRIES = 3000.0, 5
WIDE = {"width": 2000, "height": 1100}
# What a page is when it is opened, and how it gets there again.
REMEMBER = """() => {
    window.controls = () => [...document.querySelectorAll("main select, main input[type=checkbox]")];
    window.atFirst = { ...report.state, controls: controls().map((one) => one.checked ?? one.value) };
}"""
PUT_BACK = """() => {
    controls().forEach((one, k) => {
        const now = one.checked ?? one.value, before = atFirst.controls[k];
        if (now === before) return;
        one[typeof before === "boolean" ? "checked" : "value"] = before;
        one.dispatchEvent(new Event("change"));
    });
    for (const what of ["playing", "run", "time", "magnify"]) report.set(what, atFirst[what]);
    if (document.documentElement.dataset.theme !== "auto") report.setTheme("auto");
    for (const button of document.querySelectorAll(".legend button[aria-pressed=false]")) button.click();
    document.activeElement.blur();
    scrollTo(0, 0);
}"""


class SharedPages:
    """A report in windows of several sizes, each opened once (that takes 2 s) and put back for every test."""

    def __init__(self, browser: LastingBrowser, report: Path) -> None:
        self._browser, self._report = browser, report
        self._pages: dict[tuple[int, ...], Page] = {}
        self._complaints: list[str] = []

    def __call__(self, viewport: dict[str, int] = DESKTOP) -> Page:
        """The page in a window, as it was opened."""
        size = tuple(viewport.values())
        if size in self._pages and not self._pages[size].is_closed():
            self._pages[size].emulate_media(media="null")
            self._pages[size].evaluate(PUT_BACK)
        else:
            self._pages[size] = self._opened(viewport)
        wait_for_drawing(self._pages[size])
        return self._pages[size]

    def _opened(self, viewport: dict[str, int]) -> Page:
        say = self._complaints.append
        page = self._browser.new_context(viewport=viewport).new_page()
        page.on("console", lambda message: say(message.text) if is_ours(message.text) else None)
        page.on("pageerror", lambda error: say(str(error)))
        page.on("request", lambda request: say(request.url) if page_asks(request.url) else None)
        page.goto(self._report.as_uri())
        page.wait_for_function("document.documentElement.dataset.charts === 'true'")
        page.evaluate(REMEMBER)
        return page

    def check(self) -> None:
        """What the consoles said since the last test, and what was asked of a network, must be nothing."""
        said, self._complaints[:] = self._complaints[:], []
        assert said == []


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    file = tmp_path_factory.mktemp("report") / "report.html"
    save_page(tracking_page(tracked(), FAILED), file)
    return file


@pytest.fixture(scope="module")
def pages(browser, report):
    return SharedPages(browser, report)


@pytest.fixture
def shared(pages):
    """The report in a window that other tests use too."""
    yield pages
    pages.check()


def drawn(page: Page) -> str:
    """What is on the canvas, after it is painted."""
    wait_for_drawing(page)
    return page.evaluate("document.getElementById('canvas').toDataURL()")


def wait_for_drawing(page: Page) -> None:
    """Two frames of the screen: what has changed is drawn."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done())))")


def choose_run(page: Page, row: str) -> None:
    """Choose a run by its button in a table, once charts in view are drawn: legends of those above it move it."""
    button = page.locator(row).locator(".pick")
    button.scroll_into_view_if_needed()
    wait_for_drawing(page)
    page.wait_for_function("charts.all.every((chart) => !chart.inView || !chart.stale)")
    wait_for_drawing(page)
    button.click()


def curves(page: Page, chart: str) -> list[list[float]]:
    """What Plotly draws in a chart, once it is in view and drawn."""
    page.locator(f"#chart-{chart}").scroll_into_view_if_needed()
    page.wait_for_function("(id) => document.querySelector(`#chart-${id} .js-plotly-plot .trace`)", arg=chart)
    wait_for_drawing(page)
    return page.evaluate(
        "(id) => document.querySelector(`#chart-${id} .js-plotly-plot`).data.map((trace) => Array.from(trace.y))", chart
    )


def time_of(page: Page) -> float:
    return page.evaluate("report.state.time")


def coloured(page: Page) -> list[int]:
    """How many pixels of the canvas have very nearly each colour of the page's palette, after it is painted."""
    wait_for_drawing(page)
    return page.evaluate(
        """() => {
            const canvas = document.getElementById("canvas");
            const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            return report.palette().map((colour) => {
                const [r, g, b] = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
                let count = 0;
                for (let k = 0; k < data.length; k += 4) {
                    if (data[k + 3] > 200 && Math.hypot(data[k] - r, data[k + 1] - g, data[k + 2] - b) < 8) count++;
                }
                return count;
            });
        }"""
    )


def test_it_opens_at_once(browser, report):
    taken = []
    for _ in range(TRIES):
        page = browser.new_page(viewport=DESKTOP)
        page.goto(report.as_uri(), wait_until="commit")
        page.wait_for_function("document.documentElement.dataset.ready === 'true'")
        taken.append(page.evaluate("performance.getEntriesByName('ready')[0].startTime"))
        page.close()
        if taken[-1] < OPENING:
            break
    assert min(taken) < OPENING


def test_the_mechanism_is_above_the_fold_and_the_solver_below_it(shared):
    page = shared()
    drawing, solver = page.locator("#canvas").bounding_box(), page.locator("#part-integration").bounding_box()
    assert drawing is not None
    assert solver is not None
    assert drawing["y"] + drawing["height"] <= DESKTOP["height"]
    assert solver["y"] > DESKTOP["height"]


def test_no_chart_can_be_sent_anywhere(shared):
    requests = []
    page = shared()
    page.on("request", lambda request: requests.append(request.url))
    curves(page, "torques")
    titles = page.evaluate(
        "[...document.querySelectorAll('.modebar-btn')].map((one) => one.dataset.title || one.title || one.ariaLabel)"
    )
    assert any("Download" in title for title in titles)
    assert not [
        title for title in titles if any(word in title.lower() for word in ("share", "cloud", "edit", "plotly"))
    ]
    context = page.evaluate("document.querySelector('#chart-torques .js-plotly-plot')._context")
    assert not context["showSendToCloud"]
    assert context["plotlyServerURL"] == ""
    assert not [url for url in requests if url.startswith(("http", "ws"))]


def test_a_print_keeps_proportions_and_cuts_nothing(opened):
    page = opened(viewport={"width": 720, "height": 1000})
    curves(page, "path")
    page.emulate_media(media="print")
    wait_for_drawing(page)
    canvas = page.evaluate(
        "(({clientWidth, clientHeight, width, height}) => clientWidth * height / (clientHeight * width))"
        "(document.getElementById('canvas'))"
    )
    assert canvas == pytest.approx(1.0, abs=0.02)
    # A metre of the path is as long across as up.
    drawn = page.evaluate(
        "(({xaxis, yaxis}) => [xaxis._length / (xaxis.range[1] - xaxis.range[0]),"
        " yaxis._length / (yaxis.range[1] - yaxis.range[0])])"
        "(document.querySelector('#chart-path .js-plotly-plot')._fullLayout)"
    )
    assert drawn[0] == pytest.approx(drawn[1], rel=0.01)
    box = page.locator("#chart-path .main-svg").first.bounding_box()
    assert box is not None
    assert box["x"] + box["width"] <= 720
    assert page.evaluate("getComputedStyle(document.getElementById('chart-path')).breakInside") == "avoid"
    assert not page.locator("#dock").is_visible()


def test_charts_wider_than_paper_are_printed_smaller_as_a_whole(shared):
    page = shared(WIDE)
    curves(page, "path")
    size = "((box) => [box.width, box.height])(document.querySelector('#chart-path .main-svg').getBoundingClientRect())"
    wide = page.evaluate(size)
    assert wide[0] > 700
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    printed = page.evaluate(size)
    assert printed[0] == pytest.approx(640, abs=2)
    assert printed[1] / printed[0] == pytest.approx(wide[1] / wide[0], rel=0.01)
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate(size) == pytest.approx(wide)


def test_charts_over_time_are_flat_on_paper_and_as_before_after_it(shared):
    page = shared(WIDE)
    curves(page, "errors")
    size = (
        "((box) => [box.width, box.height])(document.querySelector('#chart-errors .main-svg').getBoundingClientRect())"
    )
    title = "document.querySelector('#chart-errors .js-plotly-plot')._fullLayout.yaxis.title.font.size"
    before = [*page.evaluate(size), page.evaluate(title)]
    assert before[0] > 700
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate(size) == pytest.approx([640, 200], abs=1)
    assert page.evaluate(title) < before[2]
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    wait_for_drawing(page)
    page.wait_for_function(f"{size}[0] > 700")
    assert [*page.evaluate(size), page.evaluate(title)] == pytest.approx(before, abs=1)


def test_a_table_on_a_phone_says_that_it_scrolls(shared):
    page = shared(PHONE)
    table = page.locator("#part-modes .scroll")
    assert page.locator("#part-modes .swipe").is_visible()
    assert "goes-on" in table.get_attribute("class")
    table.evaluate("(one) => one.scrollTo(one.scrollWidth, 0)")
    page.wait_for_function("!document.querySelector('#part-modes .scroll').classList.contains('goes-on')")
    assert not shared().locator("#part-modes .swipe").is_visible()


def test_motors_and_joints_are_of_the_selected_mode_and_on_paper_of_all(shared):
    page = shared()
    tables = page.locator("#part-motors-and-prescribed-motions .of-run")
    shown = "(parts) => parts.map((part) => part.checkVisibility())"
    page.locator("#runs label").nth(1).click()
    assert tables.evaluate_all(shown) == [False, True, False]
    assert tables.nth(1).locator("h3").inner_text() == f"mode {MODES[1]}"
    page.emulate_media(media="print")
    assert tables.evaluate_all(shown) == [True, True, True]


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_no_link_has_the_colour_of_the_trail_or_the_path(shared, theme):
    page = shared()
    page.evaluate("(name) => report.setTheme(name)", theme)
    links = page.evaluate("report.palette()")
    for name in ("trail", "text"):
        own = page.evaluate("(name) => report.colour(name)", name)
        assert min(colour_distance(own, link) for link in links) > APART
    assert links == list(THEMES[theme].links)
    assert page.evaluate("report.colour('trail')") == THEMES[theme].trail


def test_names_keep_clear_of_one_another(shared):
    page = shared()
    page.evaluate("""() => {
        const pen = CanvasRenderingContext2D.prototype, write = pen.fillText;
        window.boxes = [];
        window.forget = () => { pen.fillText = write; };
        pen.fillText = function (text, x, y) {
            if (this.textAlign === "center") boxes.push([text, x, y, this.measureText(text).width]);
            return write.call(this, text, x, y);
        };
    }""")
    page.locator("#names").check()
    for time in (0.01, 0.05, 0.09):
        page.evaluate("(time) => { boxes.length = 0; player.seek(time); }", time)
        wait_for_drawing(page)
        boxes = {text: (x, y, wide) for text, x, y, wide in page.evaluate("boxes")}
        assert {"link1", "link8", "A1", "D1", "C"} <= boxes.keys()
        overlapping = [
            (one, other)
            for (one, (x, y, wide)), (other, (u, v, far)) in combinations(boxes.items(), 2)
            if abs(x - u) < 0.5 * (wide + far) and abs(y - v) < 10.0
        ]
        assert not overlapping
    page.evaluate("forget()")


def test_charts_below_the_screen_wait_until_they_are_seen(opened):
    page = opened()
    described = page.evaluate("charts.all.length")
    before = page.evaluate("charts.all.filter((chart) => chart.drawn).length")
    assert 0 < before < described
    curves(page, "strain")
    assert before < page.evaluate("charts.all.filter((chart) => chart.drawn).length") < described


def test_play_moves_the_mechanism_and_pause_stops_it(shared):
    page = shared()
    still = drawn(page)
    page.get_by_role("button", name="Play").click()
    page.wait_for_function("report.state.time > 0.002")
    moving = drawn(page)
    assert moving != still
    page.get_by_role("button", name="Pause").click()
    stopped = drawn(page)
    page.wait_for_timeout(100)
    assert drawn(page) == stopped


def test_the_links_are_drawn_where_the_dataset_has_them(shared):
    page = shared()
    page.locator("#names").uncheck()
    page.evaluate("player.seek(0.04)")
    wait_for_drawing(page)
    counts = coloured(page)
    assert min(counts) > 100
    # The longest link has most of the pixels: 0.25 m and 0.1 m.
    assert counts[0] > 1.5 * counts[1]


def test_the_slider_and_the_keys_move_in_time(shared):
    page = shared()
    still = drawn(page)
    page.locator("#scrub").fill("500")
    assert time_of(page) == pytest.approx(0.05, abs=1e-6)
    assert page.locator("#time").inner_text() == "0.050 s"
    assert drawn(page) != still
    page.locator("#canvas").focus()
    page.keyboard.press("ArrowRight")
    assert time_of(page) == pytest.approx(0.052, abs=1e-6)
    page.keyboard.press("Shift+ArrowLeft")
    assert time_of(page) == pytest.approx(0.032, abs=1e-6)
    page.keyboard.press("Space")
    page.wait_for_function("report.state.playing && report.state.time > 0.033")
    page.keyboard.press("Space")
    assert not page.evaluate("report.state.playing")
    page.keyboard.press("End")
    assert time_of(page) == pytest.approx(0.1)
    page.keyboard.press("0")
    assert time_of(page) == 0.0
    assert drawn(page) == still


def test_the_magnifier_bends_links_more_and_leaves_joints_alone(shared):
    page = shared()
    page.evaluate("player.seek(0.02)")
    # It begins with a round number at which bending is seen.
    assert page.evaluate("report.state.magnify === report.page.film.magnify && report.state.magnify > 1")
    page.evaluate("report.set('magnify', 1)")
    true = drawn(page)
    page.locator("#magnify").fill("100")
    assert page.locator("#magnified").inner_text() == "200"
    assert drawn(page) != true
    page.locator("#magnify").fill("0")
    assert drawn(page) == true
    page.locator("#canvas").focus()
    for expected in (2, 5, 10):
        page.keyboard.press("+")
        assert page.evaluate("report.state.magnify") == expected
    page.keyboard.press("-")
    assert page.evaluate("report.state.magnify") == 5


def test_the_selector_of_modes_changes_curves_and_mechanism(shared):
    page = shared()
    assert page.evaluate("report.runName()") == "++++"
    page.evaluate("player.seek(0.05)")
    before, picture = curves(page, "torques"), drawn(page)
    page.locator("#runs label", has_text="+-+-").click()
    after = curves(page, "torques")
    assert len(before) == len(after) == 4
    data = tracked()["torque"].values
    for k, (one, other) in enumerate(zip(before, after, strict=True)):
        assert one == pytest.approx(data[0, :, k].tolist(), rel=1e-5, abs=1e-30)
        assert other == pytest.approx(data[1, :, k].tolist(), rel=1e-5, abs=1e-30)
    assert drawn(page) != picture
    # Another motor beside itself in all modes: the selected one is the thickest.
    page.locator("#chart-torques select").select_option(label="τ₁")
    wait_for_drawing(page)
    assert len(curves(page, "torques")) == len(MODES)
    widths = page.evaluate("document.querySelector('#chart-torques .js-plotly-plot').data.map((t) => t.line.width)")
    assert widths.index(max(widths)) == 1
    page.locator("#canvas").focus()
    page.keyboard.press("m")
    assert page.evaluate("report.runName()") == MODES[2]
    assert page.locator("tr.selected th").inner_text().strip() == MODES[2]
    choose_run(page, "tr[data-run='0']")
    assert page.evaluate("report.runName()") == MODES[0]


def test_a_run_that_stopped_stays_where_it_ended(shared):
    page = shared()
    page.evaluate("report.set('run', 2); player.seek(0.06)")
    ended = drawn(page)
    page.evaluate("player.seek(0.05)")
    assert drawn(page) != ended
    gaps = [sum(value != value for value in curve) for curve in curves(page, "deflections")]
    assert set(gaps) == {25}


def test_a_line_in_every_chart_goes_with_time(shared):
    page = shared()
    curves(page, "torques")
    places = []
    for time in (0.02, 0.06):
        page.evaluate(f"player.seek({time})")
        wait_for_drawing(page)
        box = page.locator("#chart-torques .cursor").bounding_box()
        assert box is not None
        places.append(box["x"])
    plot = page.evaluate("charts.all.find((c) => c.description.identity === 'torques').plot._fullLayout.xaxis._length")
    assert places[1] - places[0] == pytest.approx(0.4 * plot, rel=0.02)
    # In the plane a dot goes along the path.
    page.locator("#chart-path").scroll_into_view_if_needed()
    wait_for_drawing(page)
    assert page.locator("#chart-path .dot").first.is_visible()


def test_the_legend_hides_a_curve(shared):
    page = shared()
    curves(page, "torques")
    button = page.locator("#chart-torques .legend button").first
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    assert page.evaluate("document.querySelector('#chart-torques .js-plotly-plot').data[0].visible") == "legendonly"


@pytest.mark.parametrize("viewport", [PHONE, {"width": 820, "height": 1100}, DESKTOP], ids=["phone", "tablet", "desk"])
def test_nothing_is_wider_than_the_screen(shared, viewport):
    page = shared(viewport)
    curves(page, "phases")
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]


def test_dark_and_light_follow_the_system_and_the_button(opened):
    page = opened(color_scheme="dark")
    ground = "getComputedStyle(document.body).backgroundColor"
    ink = "document.querySelector('#chart-errors .js-plotly-plot').layout.font.color"
    dark = page.evaluate(ground), page.evaluate(ink), drawn(page)
    page.emulate_media(color_scheme="light")
    wait_for_drawing(page)
    light = page.evaluate(ground), page.evaluate(ink), drawn(page)
    assert all(one != other for one, other in zip(dark, light, strict=True))
    button = page.locator("#theme")
    for expected in ("light", "dark"):
        button.click()
        assert button.get_attribute("aria-label") == f"Theme: {expected}"
    wait_for_drawing(page)
    assert (page.evaluate(ground), page.evaluate(ink)) == dark[:2]


SLOW = """
    const whole = Response.prototype.arrayBuffer;
    Response.prototype.arrayBuffer = async function () {
        await new Promise((done) => setTimeout(done, 150));
        return whole.call(this);
    };
"""


def test_a_page_repainted_while_its_film_is_unpacked_says_nothing(browser, report):
    complaints = []
    page = browser.new_page()
    page.add_init_script(SLOW)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(report.as_uri())
    repainted = page.evaluate(
        """async () => {
            let k = 0;
            const { dataset } = document.documentElement;
            for (; dataset.ready !== "true" || k % 2; k++) {
                report.setTheme(k % 2 ? "dark" : "light");
                await new Promise((done) => setTimeout(done, 20));
            }
            return k;
        }"""
    )
    assert repainted > 2  # 8 to 18 here, by the time it takes
    assert len(set(coloured(page))) > 1
    page.close()
    assert complaints == []


def test_everything_is_reached_by_keyboard_and_has_a_name(shared):
    page = shared()
    nameless = page.evaluate(
        """[...document.querySelectorAll("main button, main input, main select, canvas")].filter((one) =>
            !(one.getAttribute("aria-label") || one.textContent.trim() || (one.labels && one.labels.length))
        ).map((one) => one.outerHTML)"""
    )
    assert nameless == []
    seen = Counter()
    page.locator("#theme").focus()
    for _ in range(14):
        page.keyboard.press("Tab")
        name, outline = page.evaluate(
            """() => {
                const one = document.activeElement, shown = one.type === "radio" ? one.parentElement : one;
                return [one.id || one.name || one.className, getComputedStyle(shown).outlineStyle];
            }"""
        )
        seen[name] += 1
        assert outline == "solid"
    assert {"play", "scrub", "run", "canvas", "magnify", "speed", "ghost", "trail", "names"} <= set(seen)


def test_models_of_a_verification_are_overlaid_and_their_buttons_fade_beside_a_phone(opened, tmp_path):
    save_page(verification_page(*verified()), tmp_path / "report.html")
    page = opened(tmp_path / "report.html", viewport={"width": 280, "height": 700})
    page.evaluate("player.seek(0.03)")
    picture = drawn(page)
    assert len(curves(page, "angle_differences")) == 3
    page.locator("#runs label", has_text="rigid").click()
    assert drawn(page) != picture
    page.locator("#runs label").first.click()
    buttons = page.locator("#runs")
    page.wait_for_function("document.getElementById('runs').classList.contains('goes-on')")
    assert "goes-back" not in buttons.get_attribute("class")
    assert "gradient" in buttons.evaluate("(one) => getComputedStyle(one).maskImage")
    page.locator("#runs label").last.click()
    page.wait_for_function("document.getElementById('runs').classList.contains('goes-back')")
    assert "goes-on" not in buttons.get_attribute("class")


def test_more_than_six_charts_of_a_panel_are_folded_and_drawn_once_they_are_opened_or_printed(opened, tmp_path):
    time = [0.0, 0.5, 1.0]
    lines = [Chart(f"c{k}", f"Chart {k}", Axis("y"), [Curve("a", [0.0, k, 1.0])]) for k in range(8)]
    save_page(ReportPage("a", "run", panels=[Panel("Six", lines[:6]), Panel("Two more", lines)], time=time, runs=[""]),
              tmp_path / "a.html")  # fmt: skip
    page = opened(tmp_path / "a.html")
    more = page.locator("#panels details.more > summary")
    assert more.count() == 1
    assert more.inner_text() == "2 more charts: Chart 6, Chart 7"
    assert not page.locator("#chart-c7").is_visible()
    more.click()
    assert curves(page, "c7") == [[0.0, 7.0, 1.0]]
    more.click()
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator("#chart-c6").is_visible()
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert not page.locator("#chart-c6").is_visible()


def test_parts_fold_by_key_and_open_by_their_links_and_for_paper(opened, report):
    """All parts are open at first. Keys of the player do not act while the heading of a part has the focus."""
    page = opened(report)
    assert page.evaluate("[...document.querySelectorAll('details.part')].every((one) => one.open)")
    modes = page.locator("#part-modes")
    modes.locator("summary").focus()
    page.keyboard.press("Space")
    assert not modes.locator("table").is_visible()
    assert not page.evaluate("report.state.playing")
    page.locator(".contents a", has_text="Modes").click()
    assert modes.locator("table").is_visible()
    # A second time the address is the same.
    modes.locator("summary").click()
    page.locator(".contents a", has_text="Modes").click()
    assert modes.locator("table").is_visible()
    modes.locator("summary").click()
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert modes.locator("table").is_visible()
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert not modes.locator("table").is_visible()


def test_charts_and_animation_fit_when_they_are_unfolded(opened, report):
    """The window has become narrower, and another mode is shown, since they were folded."""
    page = opened(report)
    curves(page, "errors")
    folded = page.locator("#panels > .part").first
    for part in (folded, page.locator("#film")):
        part.locator("> summary").click()
    page.set_viewport_size({"width": 700, "height": 900})
    page.evaluate("report.set('run', 1)")
    wait_for_drawing(page)
    for part in (page.locator("#film"), folded):
        part.locator("> summary").click()
    curves(page, "errors")
    page.wait_for_function("""() => {
        const plot = document.querySelector("#chart-errors .js-plotly-plot");
        return Math.abs(plot._fullLayout.width - plot.clientWidth) < 1;
    }""")
    page.locator("#canvas").scroll_into_view_if_needed()
    wait_for_drawing(page)
    ratio = page.evaluate("(({ width, clientWidth }) => width / clientWidth)(document.getElementById('canvas'))")
    assert ratio == pytest.approx(page.evaluate("devicePixelRatio"), abs=0.01)
    assert sum(coloured(page)) > 0


def test_a_link_to_a_part_leads_to_it_from_elsewhere(opened, report):
    page = opened(report)
    page.evaluate("document.getElementById('part-integration').open = false; location.hash = '#part-integration'")
    page.wait_for_function("document.getElementById('part-integration').open")


def test_a_browser_that_died_is_started_again(browser, shared):
    """So one crash of Chromium does not fail all tests that come after it."""
    before = shared()
    with pytest.raises(Error, match="has been closed"):
        browser.alive().new_browser_cdp_session().send("Browser.crash")
    assert before.is_closed()
    assert shared().locator("#canvas").is_visible()


def test_charts_over_time_are_over_what_the_reader_chooses(shared):
    """The curve of the selected mode is over its own coordinate, marked at the time of the animation."""
    page, data = shared(), tracked()
    page.locator("#chart-energies").scroll_into_view_if_needed()
    names = page.locator("#over option").all_inner_texts()
    assert names[0] == "time"
    page.select_option("#over", label="angle of A₁")
    page.evaluate("report.set('time', 0.04)")
    wait_for_drawing(page)
    plot = "document.querySelector('#chart-energies .js-plotly-plot')"
    run = page.evaluate("report.state.run")
    angle = data["joint_coordinate"].sel(joint="A1").values[run]
    assert page.evaluate(f"{plot}._fullLayout.xaxis.title.text") == "angle of A₁ [rad]"
    assert page.evaluate(f"Array.from({plot}.data[0].x)") == pytest.approx(angle, rel=1e-4)
    place = f"{plot}._fullLayout.xaxis.d2p({angle[20]}) + {plot}._fullLayout.xaxis._offset"
    dot = "document.querySelector('#chart-energies .dot').style.transform.match(/[0-9.]+/)[0]"
    assert page.evaluate(f"Number({dot}) - ({place})") == pytest.approx(0.0, abs=0.5)
    assert page.evaluate("document.querySelector('#chart-energies .cursor').style.visibility") == "hidden"
    assert page.evaluate(f"{plot}._fullLayout.shapes.length") == 0
    page.select_option("#over", label="time")
    wait_for_drawing(page)
    assert page.evaluate(f"Array.from({plot}.data[0].x)") == pytest.approx(data["time"].values, abs=1e-6)
    assert page.evaluate("document.querySelector('#chart-energies .dot').style.visibility") == "hidden"
