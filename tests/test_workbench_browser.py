"""The workbench as a person has it, in a real Chromium: mechanisms are drawn by clicks, edited, dragged and undone."""

from __future__ import annotations

import base64
import re
import time
import tomllib
from collections.abc import Callable
from contextlib import ExitStack
from itertools import combinations
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from conftest import is_ours
from paraflex.files import library_text
from paraflex.files.model import model_of_text
from paraflex.workbench.document import EMPTY
from paraflex.workbench.readiness import checked
from workbenches import hosted

expect.set_options(timeout=30_000)

DESKTOP, TABLET = {"width": 1400, "height": 1000}, {"width": 1024, "height": 768}
# Long enough for a processor that several tests share [ms].
PATIENCE = 30_000
SQUARE = ((-0.04, 0.25), (0.04, 0.25), (0.04, 0.21), (-0.04, 0.21))

# A white image of 40 by 20 pixels.
PHOTOGRAPH = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAACgAAAAUCAAAAADaLSBnAAAAFUlEQVR4nGP4TyRgGFU4qnBUIQgAAIy4HQ4pMOANAAAAAElFTkSuQmCC"
)


class Person:
    """Somebody who draws with a mouse and keys on the page of a workbench."""

    def __init__(self, page: Page) -> None:
        self.page = page
        page.set_default_timeout(PATIENCE)

    @property
    def state(self) -> dict:
        """State of the document as the page has it."""
        return self.page.evaluate("workbench.state")

    @property
    def message(self) -> str:
        """Line in which the page answers."""
        return self.page.locator(".message").inner_text()

    def pixels(self, x: float, y: float) -> tuple[float, float]:
        """Place on the screen of a place in metres."""
        found = self.page.evaluate(
            """([x, y]) => {
                const box = workbench.sheet.canvas.getBoundingClientRect(), [px, py] = workbench.sheet.px(x, y);
                return [box.left + px, box.top + py];
            }""",
            [x, y],
        )
        return found[0], found[1]

    def point(self, ref: str) -> tuple[float, float]:
        """Place of a point [m]."""
        return next((x, y) for name, x, y in self.state["picture"]["points"] if name == ref)

    def until(self, condition: str) -> None:
        """Wait for a condition; the policy of the page forbids that Playwright evaluates it there again and again."""
        end = time.monotonic() + PATIENCE / 1000
        while not self.page.evaluate(condition):
            assert time.monotonic() < end, condition
            self.page.wait_for_timeout(20)

    def changes(self, do: Callable[[], object]) -> None:
        """Do something, and wait until the text has changed."""
        before = self.state["revision"]
        do()
        self.until(f"workbench.state.revision > {before}")

    def click(self, x: float, y: float) -> None:
        self.page.mouse.move(*self.pixels(x, y))
        self.page.mouse.click(*self.pixels(x, y))

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.page.mouse.move(*self.pixels(*start))
        self.page.mouse.down()
        self.page.mouse.move(*self.pixels(*end), steps=4)
        self.page.mouse.up()

    def tool(self, key: str) -> None:
        self.page.keyboard.press(key)

    def clicks(self, *places: tuple[float, float]) -> None:
        """Click at places, each of which changes the text."""
        for place in places:
            self.changes(lambda place=place: self.click(*place))

    def links(self, *ends: tuple[tuple[float, float], tuple[float, float]]) -> None:
        """Draw links with one press each."""
        for start, end in ends:
            self.changes(lambda start=start, end=end: self.drag(start, end))

    def undo_all(self) -> None:
        while self.state["undo"]:
            self.changes(lambda: self.page.keyboard.press("Control+z"))


@pytest.fixture
def at_work(browser, tmp_path, monkeypatch):
    """Open a workbench; its console must be silent in the end."""
    complaints, ends = [], ExitStack()
    monkeypatch.chdir(tmp_path)

    def open_page(source: str | None = None, viewport: dict[str, int] = DESKTOP, **settings) -> Person:
        _, address = ends.enter_context(hosted(source, folder=tmp_path))
        context = browser.new_context(viewport=viewport, **settings)
        ends.callback(context.close)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(message.text) if is_ours(message.text) else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "request",
            lambda request: (
                None if request.url.startswith((address, "data:", "blob:")) else complaints.append(request.url)
            ),
        )
        page.goto(address)
        person = Person(page)
        person.until("window.workbench?.state.revision >= 0 && workbench.sheet.frames > 0")
        return person

    with ends:
        yield open_page
    assert complaints == []


def four_bar(person: Person) -> None:
    """Draw a crank-rocker with its coupler point by clicks on the sheet."""
    person.tool("g")
    person.clicks((-0.1, 0.0), (0.1, 0.0))
    person.tool("l")
    person.links(((-0.1, 0.0), (-0.1, 0.05)), ((-0.1, 0.05), (0.07, 0.15)), ((0.07, 0.15), (0.1, 0.0)))
    person.tool("d")
    person.clicks((-0.1, 0.0))


def five_bar(person: Person) -> None:
    """Draw a five-bar of flexible links with motors, end-effector and path."""
    person.tool("g")
    person.clicks((-0.1, 0.0), (0.1, 0.0))
    person.tool("b")
    person.links(
        ((-0.1, 0.0), (-0.2, 0.2)), ((-0.2, 0.2), (0.0, 0.25)), ((0.1, 0.0), (0.2, 0.2)), ((0.2, 0.2), (0.0, 0.25))
    )
    person.tool("m")
    person.clicks((-0.1, 0.0), (0.1, 0.0))
    person.tool("e")
    person.clicks((0.0, 0.25))
    person.tool("p")
    for corner in SQUARE:
        person.click(*corner)
    person.changes(lambda: person.page.keyboard.press("Enter"))


def test_a_four_bar_is_drawn_and_its_coupler_curve_computed(at_work):
    person = at_work()
    expect(person.page.get_by_role("heading", name="Draw a mechanism")).to_be_visible()
    four_bar(person)
    data = tomllib.loads(person.state["text"])
    assert list(data["body"]) == ["link1", "link2", "link3"]
    assert [data["prescribed"]["drive"]["joint"], data["joint"]["A"]] == ["A", ["ground.A", "link1.A"]]
    # A click on the coupler makes a point there, which is the end-effector.
    person.tool("e")
    middle = (-0.015, 0.1)
    person.changes(lambda: person.click(*middle))
    person.until("workbench.state.picture.effector !== null")
    effector = person.state["picture"]["effector"]
    assert effector.startswith("link2.")
    assert person.point(effector) == pytest.approx(middle, abs=2e-3)
    curve = person.page.evaluate("workbench.link.ask('turn')")["curves"]
    assert curve


def test_a_five_bar_is_ready_to_run(at_work):
    person = at_work()
    five_bar(person)
    ready = person.page.locator(".ready")
    expect(ready).to_have_attribute("data-ok", "true")
    assert tomllib.loads(person.state["text"])["mode"] == {"++": ["motor1", "motor2"]}
    assert person.state["problem"] is None
    person.undo_all()
    assert person.state["text"] == EMPTY


def test_links_are_drawn_in_any_order(at_work):
    person = at_work()
    person.tool("l")
    person.links(((-0.1, 0.05), (0.07, 0.15)), ((0.07, 0.15), (0.1, 0.0)))
    person.links(((-0.2, 0.1), (-0.2, 0.2)))
    assert "not connected" in person.state["problem"]["text"]
    assert len(person.state["picture"]["bodies"]) == 3
    # The ground under the end of a link holds it there.
    person.tool("g")
    person.changes(lambda: person.click(0.1, 0.0))
    person.until("workbench.state.picture.joints.length === 2")
    joints = tomllib.loads(person.state["text"])["joint"].values()
    assert [
        sum(ref.startswith(f"{body}.") for pair in joints for ref in pair) for body in ("ground", "link1", "link2")
    ] == [1, 1, 2]


def test_a_quick_return_is_drawn_and_turned(at_work):
    person = at_work()
    person.tool("g")
    person.clicks((0.0, 0.0), (0.0, 0.1))
    person.tool("l")
    person.links(((0.0, 0.0), (0.1, 0.25)), ((0.0, 0.1), (0.06, 0.15)))
    # The end of the crank lies on the rocker: a slider there is a slot along it.
    person.tool("s")
    person.clicks((0.06, 0.15))
    person.tool("d")
    person.clicks((0.0, 0.1))
    assert tomllib.loads(person.state["text"])["joint"]["D"]["type"] == "slot"
    assert len(person.page.evaluate("workbench.link.ask('turn')")["time"]) > 10


def test_a_leaf_spring_guide_is_drawn_until_its_mass_is_asked_for(at_work):
    person = at_work()
    person.tool("g")
    person.clicks((-0.05, 0.0), (0.05, 0.0))
    person.tool("b")
    person.links(((-0.05, 0.0), (-0.05, 0.15)), ((0.05, 0.0), (0.05, 0.15)))
    person.tool("l")
    person.links(((-0.05, 0.15), (0.05, 0.15)))
    person.tool("w")
    for place in ((-0.05, 0.0), (0.05, 0.0), (-0.05, 0.15), (0.05, 0.15)):
        count = person.state["text"].count("weld")
        person.click(*place)
        person.until(f"workbench.state.text.split('weld').length === {count + 2}")
    person.tool("f")
    person.changes(lambda: person.drag((-0.05, 0.15), (0.0, 0.15)))
    # The readiness line leads to the field that is missing.
    ready = person.page.locator(".ready")
    expect(ready).to_contain_text(re.compile("link3.*mass"))
    ready.click()
    mass = person.page.get_by_label("mass", exact=True)
    expect(mass).to_be_focused()
    mass.fill("200 g")
    person.changes(lambda: mass.press("Enter"))
    # Neither mass nor inertia can be given alone: the inertia is that of a rod.
    link = tomllib.loads(person.state["text"])["body"]["link3"]
    assert link["mass"] == "200 g"
    assert link["inertia"] == pytest.approx(0.2 * 0.1**2 / 12, rel=1e-4)
    assert link["centre_of_mass"] == pytest.approx([0.05, 0.0])


def test_an_open_chain_is_ready_to_run(at_work):
    person = at_work()
    person.tool("g")
    person.clicks((0.0, 0.0))
    person.tool("b")
    person.links(((0.0, 0.0), (0.1, 0.1)), ((0.1, 0.1), (0.2, 0.05)))
    person.tool("m")
    person.clicks((0.0, 0.0), (0.1, 0.1))
    person.tool("e")
    person.clicks((0.2, 0.05))
    person.tool("p")
    person.changes(lambda: person.drag((0.2, 0.05), (0.15, 0.05)))
    expect(person.page.locator(".ready")).to_have_attribute("data-ok", "true")


def test_a_photograph_is_scaled_by_two_clicks(at_work, tmp_path):
    person = at_work()
    person.page.locator("input[type=file]").set_input_files(
        {"name": "photo.png", "mimeType": "image/png", "buffer": PHOTOGRAPH}
    )
    expect(person.page.locator(".photo")).to_be_visible()
    person.click(-0.05, 0.1)
    person.click(0.05, 0.1)
    distance = person.page.get_by_label("Distance")
    distance.fill("80 apples")
    distance.press("Enter")
    expect(person.page.locator("dialog .wrong")).to_contain_text("not a length")
    before = person.page.evaluate("workbench.photograph.size")
    distance.fill("80 mm")
    distance.press("Enter")
    expect(person.page.locator("dialog")).to_have_count(0)
    assert person.page.evaluate("workbench.photograph.size") == pytest.approx(0.8 * before, rel=0.1)


def test_two_fingers_zoom_and_move_the_sheet(at_work):
    person = at_work("five_bar", has_touch=True)
    before = person.page.evaluate("workbench.sheet.scale")
    session = person.page.context.new_cdp_session(person.page)
    x, y = person.pixels(0.0, 0.1)
    for kind, apart in (("touchStart", 40), ("touchMove", 60), ("touchMove", 80)):
        points = [{"x": x - apart, "y": y, "id": 0}, {"x": x + apart, "y": y, "id": 1}]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    assert person.page.evaluate("workbench.sheet.scale") == pytest.approx(2.0 * before, rel=0.01)
    assert person.state["text"] == library_text("five_bar")


def test_a_link_of_three_points_ends_with_enter(at_work):
    person = at_work()
    person.tool("t")
    for place in ((-0.1, 0.0), (0.1, 0.0), (0.0, 0.1)):
        person.click(*place)
    person.changes(lambda: person.page.keyboard.press("Enter"))
    assert len(tomllib.loads(person.state["text"])["body"]["link1"]["points"]) == 3


def test_a_person_without_a_mouse_draws_with_arrows(at_work):
    person = at_work()
    person.page.locator("canvas.sheet").focus()
    for key in ("l", "ArrowRight", "Enter", "ArrowUp", "ArrowUp", "ArrowUp"):
        person.page.keyboard.press(key)
    person.changes(lambda: person.page.keyboard.press("Enter"))
    assert list(tomllib.loads(person.state["text"])["body"]) == ["link1"]


def test_a_length_is_edited_beside_what_is_wrong_with_it(at_work):
    person = at_work("five_bar")
    person.click(*middle_of(person, "proximal1"))
    length = person.page.get_by_label("length", exact=True)
    expect(length).to_have_value("l1")
    expect(person.page.locator(".field", has_text="length").first).to_contain_text("= 250 mm")
    length.fill("l1 + l9")
    length.press("Enter")
    expect(person.page.locator(".field .wrong:visible")).to_contain_text("unknown parameter")
    expect(length).to_have_value("l1 + l9")
    assert person.state["text"] == library_text("five_bar")
    length.fill("260 mm")
    person.changes(lambda: length.press("Enter"))
    expect(person.page.locator(".field .wrong:visible")).to_have_count(0)
    expected = (
        library_text("five_bar")
        .replace('length = "l1"', 'length = "260 mm"', 1)
        .replace('B1 = "l1" }', 'B1 = "260 mm" }', 1)
    )
    assert person.state["text"] == expected


def middle_of(person: Person, body: str) -> tuple[float, float]:
    points = next(points for name, points, *_ in person.state["picture"]["bodies"] if name == body)
    (x0, y0), (x1, y1) = points[0], points[-1]
    # Beside the middle, where a name or a joint may be.
    return x0 + 0.4 * (x1 - x0), y0 + 0.4 * (y1 - y0)


def test_a_field_follows_many_steps_and_their_undoing(at_work):
    person = at_work("five_bar")
    field = person.page.get_by_label("l1", exact=True).first
    field.focus()
    for text in ("0.2", "0.21", "0.22", "0.23"):
        person.page.keyboard.press("Control+a")
        person.page.keyboard.type(text)
        person.page.keyboard.press("Enter")
    person.until("workbench.state.text.includes('l1 = 0.23')")
    for _ in range(4):
        person.page.keyboard.press("Control+z")
    person.until("!workbench.state.undo")
    assert person.state["text"] == library_text("five_bar")
    expect(field).to_have_value("0.250")


def test_a_slider_of_a_parameter_is_one_step(at_work):
    person = at_work("five_bar")
    slider = person.page.get_by_label("l1 slider")
    box = slider.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    person.page.mouse.move(x, y)
    person.page.mouse.down()
    person.page.mouse.move(x + 25, y, steps=8)
    person.page.mouse.up()
    person.until("workbench.state.text.includes('l1 = 0.250') === false")
    person.page.wait_for_timeout(300)
    assert person.state["picture"] is not None
    person.changes(lambda: person.page.evaluate("workbench.step('undo')"))
    assert person.state["text"] == library_text("five_bar")
    assert not person.state["undo"]


def test_the_text_and_the_sheet_follow_one_another(at_work):
    person = at_work("four_bar")
    person.page.get_by_role("tab", name="File").click()
    area = person.page.get_by_label("Text of the model file")
    text = library_text("four_bar")
    assert area.input_value() == text
    before = person.point("crank.A")
    person.changes(lambda: area.fill(text.replace("crank = 0.100", "crank = 0.120")))
    assert person.state["text"] == text.replace("crank = 0.100", "crank = 0.120")
    assert person.point("crank.A") != before
    # A text that cannot be read is marked at its line; the mechanism stays.
    person.changes(lambda: area.fill(text.replace("crank = 0.100", "crank = 0.1x0")))
    expect(person.page.locator(".lines .bad")).to_have_text("9")
    assert person.state["picture"] is not None
    person.changes(lambda: area.fill(text))
    expect(person.page.locator(".lines .bad")).to_have_count(0)
    # An action on the sheet is written into the text; what is selected there is marked here.
    person.page.keyboard.press("Escape")
    person.click(*person.point("crank.A"))
    marked = person.page.locator(".lines .own")
    expect(marked).to_have_count(1)
    assert text.splitlines()[int(marked.inner_text()) - 1] == 'A = ["crank.A", "coupler.A"]'
    person.tool("m")
    person.changes(lambda: person.click(*person.point("ground.Q")))
    assert area.input_value() == person.state["text"]
    assert tomllib.loads(area.input_value())["motor"]


def test_deleting_names_what_goes_as_well(at_work):
    person = at_work("five_bar")
    person.click(*person.point("ground.A1"))
    person.page.keyboard.press("Delete")
    expect(person.page.locator(".message")).to_contain_text("motor left")
    person.page.keyboard.press("Escape")
    assert person.state["text"] == library_text("five_bar")
    person.page.keyboard.press("Delete")
    expect(person.page.locator(".message")).to_contain_text("motor left")
    person.changes(lambda: person.page.keyboard.press("Enter"))
    data = tomllib.loads(person.state["text"])
    assert ["A1" in data["joint"], "left" in data["motor"]] == [False, False]
    person.undo_all()
    assert person.state["text"] == library_text("five_bar")


def test_a_force_on_a_bare_link_is_one_step_and_a_path_is_selected_by_a_click(at_work):
    person = at_work("five_bar")
    person.tool("f")
    (x, y), (u, v) = person.point("proximal1.A1"), person.point("proximal1.B1")
    person.clicks((x + 0.4 * (u - x), y + 0.4 * (v - y)))
    data = tomllib.loads(person.state["text"])
    (load,) = data["load"].values()
    assert load["point"].split(".")[0] == "proximal1"
    assert load["point"].split(".")[1] in data["body"]["proximal1"]["points"]
    person.changes(lambda: person.page.keyboard.press("Control+z"))
    assert person.state["text"] == library_text("five_bar")
    person.tool("v")
    person.until("workbench.state.seen?.path?.length > 0")
    person.click(*max(person.state["seen"]["path"], key=lambda place: place[1])[:2])
    person.until("workbench.selected.some(({ kind, name }) => kind === 'path' && name === 'square')")


def test_what_info_finds_stands_in_the_line_of_readiness(at_work):
    person = at_work("five_bar")
    text = library_text("five_bar").replace("duration = 0.6", "duration = 0.1")
    person.page.evaluate("text => workbench.request('text', { text })", text)
    person.until("workbench.state.findings !== undefined")
    expected = checked(model_of_text(text, "five_bar", Path()))
    assert person.state["findings"] == expected["findings"] != []
    assert person.page.locator(".ready").get_attribute("title").endswith(expected["findings"][-1])


def test_the_panel_is_widened_by_mouse_and_keys(at_work):
    person = at_work("five_bar")
    divider, side = person.page.get_by_role("separator", name="Width of the panel"), person.page.locator(".side")
    before, box = side.bounding_box(), divider.bounding_box()
    person.page.mouse.move(box["x"] + 3, box["y"] + 300)
    person.page.mouse.down()
    person.page.mouse.move(box["x"] - 117, box["y"] + 300, steps=3)
    person.page.mouse.up()
    assert side.bounding_box()["width"] == pytest.approx(before["width"] + 120, abs=5)
    divider.focus()
    person.page.keyboard.press("ArrowRight")
    assert side.bounding_box()["width"] == pytest.approx(before["width"] + 100, abs=5)


def test_a_link_is_renamed_and_copied_by_keys(at_work):
    person = at_work("four_bar")
    person.click(*middle_of(person, "crank"))
    person.page.keyboard.press("F2")
    expect(person.page.get_by_label("Name", exact=True)).to_be_focused()
    person.page.keyboard.type("handle")
    person.changes(lambda: person.page.keyboard.press("Enter"))
    assert tomllib.loads(person.state["text"])["joint"]["O"] == ["ground.O", "handle.O"]
    expect(person.page.get_by_label("Name", exact=True)).to_have_value("handle")
    assert person.message == ""
    person.page.locator("canvas.sheet").focus()
    person.changes(lambda: person.page.keyboard.press("Control+d"))
    assert len(tomllib.loads(person.state["text"])["body"]) == 4
    person.until("workbench.selected.length > 1")
    assert not {one["name"] for one in person.page.evaluate("workbench.selected")} & {"handle", "ground.O"}
    before = person.state["picture"]["points"]
    person.changes(lambda: person.page.keyboard.press("ArrowRight"))
    moved = [ref for (ref, *at), (_, *now) in zip(before, person.state["picture"]["points"], strict=True) if at != now]
    assert sorted(ref.startswith("ground.") for ref in moved) == [False, False, True]
    person.undo_all()
    assert person.state["text"] == library_text("four_bar")


def test_lengths_change_where_a_point_is_dragged(at_work):
    person = at_work("four_bar")
    x, y = person.point("crank.A")
    person.tool("a")
    person.changes(lambda: person.drag((x, y), (x, y + 0.02)))
    assert person.point("crank.A")[1] > y + 0.01
    assert tomllib.loads(person.state["text"])["parameters"]["crank"] != 0.1


def test_a_drag_moves_the_mechanism_until_it_is_put_back(at_work):
    person = at_work("five_bar")
    start = person.point("distal1.C")
    person.drag(start, (start[0] + 0.04, start[1] - 0.03))
    keep = person.page.get_by_role("button", name="Keep this pose")
    expect(keep).to_be_visible()
    moved = person.point("distal1.C")
    assert moved == pytest.approx((start[0] + 0.04, start[1] - 0.03), abs=1e-3)
    person.page.get_by_role("button", name="Back").click()
    expect(keep).to_be_hidden()
    person.until(f"Math.abs(workbench.state.picture.points.find(([r]) => r === 'distal1.C')[1] - {start[0]}) < 1e-6")
    assert person.state["text"] == library_text("five_bar")
    person.drag(start, (start[0] + 0.04, start[1] - 0.03))
    person.changes(keep.click)
    assert person.state["text"] != library_text("five_bar")
    assert person.point("distal1.C") == pytest.approx(moved, abs=1e-3)


def test_a_mechanism_is_chosen_by_its_picture(at_work):
    person = at_work()
    person.changes(person.page.locator(".start .card", has_text="RAParM-I").first.click)
    assert person.state["text"] == library_text("raparm_i")
    expect(person.page.locator(".start")).to_be_hidden()


@pytest.mark.parametrize("size", [DESKTOP, TABLET], ids=["desktop", "tablet"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_button_covers_another(at_work, size, scheme):
    person = at_work("raparm_i", size, color_scheme=scheme)
    boxes = person.page.evaluate(
        """() => [...document.querySelectorAll("button, input, select")].filter((one) => one.checkVisibility())
        .map((one) => {
            let { left, top, right, bottom } = one.getBoundingClientRect();
            for (let above = one.parentElement; above; above = above.parentElement) {
                if (getComputedStyle(above).overflowY === "visible") continue;
                const box = above.getBoundingClientRect();
                [left, top] = [Math.max(left, box.left), Math.max(top, box.top)];
                [right, bottom] = [Math.min(right, box.right), Math.min(bottom, box.bottom)];
            }
            return [one.title || one.textContent, left, top, Math.max(right, left), Math.max(bottom, top)];
        })"""
    )
    assert len(boxes) > 30
    for (one, l0, t0, r0, b0), (other, l1, t1, r1, b1) in combinations(boxes, 2):
        assert min(r0, r1) - max(l0, l1) < 1 or min(b0, b1) - max(t0, t1) < 1, (one, other)
    for name, left, top, right, bottom in boxes:
        assert min(left, top, size["width"] - right, size["height"] - bottom) >= 0, name
    assert person.page.evaluate(
        "document.documentElement.scrollWidth <= innerWidth && document.documentElement.scrollHeight <= innerHeight"
    )
