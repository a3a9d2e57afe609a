"""What the workbench shows of a pose, a turn and a run, in a real Chromium, against the same numbers by `pf`."""

from __future__ import annotations

import re

import numpy as np
import pytest
from playwright.sync_api import expect

import paraflex as pf
import test_workbench_browser as browsing
from paraflex.figures.kinematics import kinematics_of
from paraflex.files import library_text
from paraflex.results.following import headline
from paraflex.workbench import session
from paraflex.workbench.computing import computed, model_of
from paraflex.workbench.runs import Runner
from test_workbench_browser import Person

at_work = browsing.at_work
# A four-bar without masses, whose coupler point draws a curve that crosses itself once.
CROSSING = """name = "crossing"
[ground]
O = [0.0, 0.0]
Q = [2.0, 0.0]
[body.crank]
type = "rigid"
points = { O = [0.0, 0.0], A = [1.0, 0.0] }
[body.coupler]
type = "rigid"
points = { A = [0.0, 0.0], B = [2.5, 0.0], P = [1.25, -2.0] }
[body.rocker]
type = "rigid"
points = { Q = [0.0, 0.0], B = [2.5, 0.0] }
[joint]
O = ["ground.O", "crank.O"]
A = ["crank.A", "coupler.A"]
B = ["coupler.B", "rocker.B"]
Q = ["ground.Q", "rocker.Q"]
[motor]
turn = "O"
[end_effector]
point = "coupler.P"
coordinates = ["x"]
[assembly.open]
crank = 1.0
coupler = 0.6
rocker = 1.8
"""
# Charts of the page whose axes lack a unit or two numbers; those of ratios have none.
WITHOUT_AXES = r"""() => workbench.motion.charts.filter((chart) => {
    const unit = (text) => /\[.+\]|ratio|number|error/.test(text);
    const hasUnits = unit(chart.label) && unit(chart.over?.label ?? chart.description.x);
    return !hasUnits || chart.yTicks.length < 2 || chart.xTicks.length < 2;
}).map((chart) => chart.description.title)"""


@pytest.fixture(scope="module")
def runner():
    with Runner(spare=False) as made:
        yield made


@pytest.fixture
def warm(runner, monkeypatch):
    """Let all sessions use one process for runs, which is warm after the first."""
    monkeypatch.setattr(runner, "close", runner.cancel)
    monkeypatch.setattr(session, "Runner", lambda: runner)


def run(person: Person) -> None:
    person.page.locator(".actions").get_by_role("button", name="Run").click()
    finished(person)


def finished(person: Person) -> None:
    person.until("workbench.motion.recordings.run?.text === workbench.state.text && workbench.motion.computing.hidden")


def number(person: Person, key: str) -> str:
    return person.page.locator(f"[data-number={key}]").inner_text()


def painted(person: Person, place: tuple[float, float], colour: str) -> bool:
    """Whether a colour of the style sheet is on the sheet at a place [m], or a pixel beside it."""
    return person.page.evaluate(
        """([x, y, colour]) => {
            const { sheet } = workbench, ratio = devicePixelRatio, [px, py] = sheet.px(x, y);
            sheet.paint();
            const copy = new OffscreenCanvas(5, 5).getContext("2d", { willReadFrequently: true });
            copy.drawImage(sheet.canvas, 2 - Math.round(ratio * px), 2 - Math.round(ratio * py));
            const { data } = copy.getImageData(0, 0, 5, 5);
            const own = parseInt(sheet.colour(colour).slice(1), 16), parts = [own >> 16, (own >> 8) & 255, own & 255];
            const pixels = Array.from({ length: data.length / 4 }, (_, k) => data.slice(4 * k, 4 * k + 3));
            return pixels.some((pixel) => parts.every((one, j) => Math.abs(one - pixel[j]) < 12));
        }""",
        [*place, colour],
    )


def test_numbers_of_the_pose_follow_a_drag(at_work):
    person = at_work("five_bar")
    mechanism = pf.load("five_bar").mechanism
    linear = pf.linearise(mechanism)
    held = linear.held_frequencies([motor.name for motor in mechanism.motors])[:3] / (2 * np.pi)
    assert person.state["seen"]["held"] == pytest.approx(held, rel=1e-6)
    assert number(person, "freedoms") == "2"
    assert number(person, "held") == ", ".join(f"{one:.3g}" for one in held) + " Hz"
    before = {key: number(person, key) for key in ("condition", "held")}
    x, y = person.pixels(*person.point("distal1.C"))
    person.page.mouse.move(x, y)
    person.page.mouse.down()
    person.page.mouse.move(x + 70, y + 50, steps=12)
    person.until(f"document.querySelector('[data-number=condition]').textContent !== '{before['condition']}'")
    expect(person.page.locator("[data-number=held]")).to_have_class("old")
    person.page.mouse.up()
    expect(person.page.locator("[data-number=held]")).not_to_have_class("old")
    assert number(person, "held") != before["held"]
    seen = person.state["seen"]
    assert number(person, "condition") == f"{seen['condition']:.3g}"
    # The ellipse of that pose is on the sheet.
    assert seen["compliance"]["sizes"][0] >= seen["compliance"]["sizes"][1] > 0
    centre, (scale,) = person.point("distal1.C"), [person.page.evaluate("64 / workbench.sheet.scale")]
    angle = seen["compliance"]["angle"]
    assert painted(person, (centre[0] - scale * np.cos(angle), centre[1] - scale * np.sin(angle)), "good")


def test_a_turn_shows_the_coupler_curve_with_its_values(at_work, tmp_path):
    (tmp_path / "crossing.toml").write_text(CROSSING, encoding="utf-8")
    person = at_work("crossing.toml")
    person.page.get_by_role("button", name="Turn the crank").click()
    person.until("workbench.motion.kind === 'turn' && !!workbench.sheet.picture")
    motion = pf.kinematics(model_of(CROSSING))
    data = pf.motion_dataset(motion)
    curve = data["point_position"].sel(point="coupler.P").transpose("time", "axis").values
    (trail,) = person.page.evaluate("workbench.motion.recording.trails")
    assert trail["path"] == pytest.approx(curve, abs=1e-9)
    (crossing,) = motion.features.trails["coupler.P"].crunodes
    assert [one["position"] for one in trail["crunodes"]] == [pytest.approx(crossing.position, abs=1e-9)]
    person.page.evaluate("workbench.motion.pause(); workbench.motion.seek(Infinity)")
    for k in (40, 160, 300):
        assert painted(person, tuple(curve[k]), "trail")
    # Charts in units, whose values at the time are those of the motion.
    assert person.page.locator(".drawer .chart").count() == 3
    assert person.page.evaluate(WITHOUT_AXES) == []
    k = 150
    person.page.evaluate(f"workbench.motion.seek({float(data['time'][k])})")
    shown = person.page.locator(".drawer .chart").nth(1).locator(".legend output").all_inner_texts()
    speed = data["point_velocity"].sel(point="coupler.P").isel(time=k).values
    expected = [*speed, np.linalg.norm(speed)]
    assert [float(one.replace("−", "-")) for one in shown] == pytest.approx(expected, rel=2e-3, abs=1e-4)
    effector = person.page.evaluate("workbench.sheet.picture.points[0]")
    assert effector[1:] == pytest.approx(curve[k], abs=1e-3)
    person.page.get_by_role("tab", name="Features").click()
    least = min(one["smallest"]["value"] for one in kinematics_of(data)["transmission_angles"])
    expect(person.page.locator(".tiles")).to_contain_text(f"{least:.3g}")
    expect(person.page.locator(".drawer")).to_contain_text("crunode")


def test_a_run_is_played_with_its_numbers(at_work, warm):
    person = at_work("five_bar")
    run(person)
    found = computed(model_of(library_text("five_bar"))).begun().result.data
    (shown,) = person.page.evaluate("workbench.motion.recording.numbers")
    assert shown["error_rms"] == pytest.approx(float(headline(found)[0].values.ravel()[0]), rel=1e-6)
    assert shown["stress_max"] == pytest.approx(float(np.nanmax(found["stress_max"].values)), rel=1e-6)
    stress = re.search(r"largest stress ([\d.]+) MPa", person.page.locator(".results").inner_text())
    assert stress
    assert float(stress[1]) == pytest.approx(shown["stress_max"] / 1e6, rel=5e-3)
    # It moves by itself, and stands when it is paused.
    time = person.page.evaluate("workbench.motion.time")
    person.until(f"workbench.motion.playing && workbench.motion.time !== {time}")
    person.page.keyboard.press("Space")
    assert not person.page.evaluate("workbench.motion.playing")
    # Deflections are magnified about the links as they were rigid.
    magnified = person.page.evaluate(
        """[0, 1, 30].map((m) => Array.from(workbench.motion.film.stations(0, 0.25, m)))"""
    )
    rigid, once, often = np.array(magnified)
    assert np.max(np.abs(once - rigid)) > 1e-5
    assert often - rigid == pytest.approx(30 * (once - rigid), abs=1e-5)
    person.page.get_by_role("button", name="Charts").click()
    for panel in person.page.locator(".drawer-tabs button").all():
        panel.click()
        assert person.page.evaluate(WITHOUT_AXES) == []
    # A press on the sheet returns to the drawing.
    person.click(0.0, 0.1)
    assert person.page.evaluate("workbench.sheet.picture") is None


def test_a_change_runs_again_beside_the_run_before(at_work, warm):
    person = at_work("five_bar")
    run(person)
    person.page.get_by_role("button", name="Charts").click()
    first = person.page.evaluate("workbench.motion.recording.numbers[0].stress_max")
    person.changes(
        lambda: person.page.evaluate("workbench.act({kind: 'set', place: ['parameters', 'l1'], text: '0.26'})")
    )
    finished(person)
    assert person.page.evaluate("workbench.motion.before.numbers[0].stress_max") == first
    assert person.page.evaluate("workbench.motion.recording.numbers[0].stress_max") != first
    assert person.page.evaluate("workbench.motion.charts[0].drawnBefore().length") == 1
    expect(person.page.locator(".drawer .legend").first).to_contain_text("before")


def test_a_long_run_is_described_and_can_be_stopped(at_work):
    person = at_work("five_bar")
    text = person.state["text"].replace("samples = 601", "samples = 601\nstep = 1e-6")
    person.page.get_by_label("auto").uncheck()
    person.page.evaluate("text => workbench.request('text', { text })", text)
    person.page.get_by_role("button", name=re.compile("Run$")).click()
    stop = person.page.get_by_role("button", name="Stop")
    expect(stop).to_be_visible()
    person.until("workbench.motion.doing.textContent === 'a first look'")
    stop.click()
    expect(stop).to_be_hidden()
    assert person.page.evaluate("workbench.motion.recordings.run?.accuracy?.coarse !== false")


def test_what_is_taken_away(at_work):
    person = at_work("five_bar")
    menu = person.page.get_by_role("button", name="Export")
    menu.click()
    person.page.get_by_role("menuitem", name="Python program").click()
    text = person.page.locator("dialog textarea").input_value()
    compile(text, "program", "exec")
    assert "pf.Mechanism(" in text
    person.page.keyboard.press("Escape")
    menu.click()
    for name, ending, head in [
        ("SVG", ".svg", b"<?xml"),
        ("PDF", ".pdf", b"%PDF"),
        ("PNG", ".png", b"\x89PNG"),
        ("Film", ".gif", b"GIF8"),
    ]:
        with person.page.expect_download() as made:
            person.page.get_by_role("menuitem", name=name).click()
        assert made.value.suggested_filename.endswith(ending)
        assert made.value.path().read_bytes().startswith(head)
        menu.click()
    with person.page.expect_popup() as report:
        person.page.get_by_role("menuitem", name="Report").click()
    report.value.wait_for_url("**/report.html")
    assert "five-bar" in report.value.title()


def test_a_pull_deflects_as_the_compliance_has_it(at_work):
    person = at_work("five_bar")
    person.page.get_by_role("button", name="Pull").click()
    person.page.get_by_label("Force of a pull").select_option(label="100 mN")
    x, y = person.pixels(*person.point("distal1.C"))
    person.page.mouse.move(x, y)
    person.page.mouse.down()
    person.page.mouse.move(x + 80, y - 60, steps=4)
    person.page.mouse.up()
    person.until("!!workbench.pull.found && !workbench.pull.newest.flight")
    force, found = person.page.evaluate("[workbench.pull.force, workbench.pull.found]")
    assert force == pytest.approx([0.08, 0.06], abs=2e-3)
    large, small = person.state["seen"]["compliance"]["sizes"]
    angle = person.state["seen"]["compliance"]["angle"]
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    expected = large * (along @ force) * along + small * (across @ force) * across
    assert found["deflection"] == pytest.approx(expected, rel=5e-3, abs=1e-3 * np.linalg.norm(expected))
    expect(person.page.locator(".pulling")).to_contain_text("stiffness along the force")
    # Links are drawn bent, magnified by a round number.
    factor = person.page.evaluate("workbench.pull.shown")
    tip = person.page.evaluate("workbench.sheet.picture.points.find(([ref]) => ref === 'distal1.C')")
    assert np.array(tip[1:]) - person.point("distal1.C") == pytest.approx(factor * expected, rel=1e-2, abs=1e-5)
    person.page.keyboard.press("Escape")
    assert person.page.evaluate("workbench.sheet.picture") is None


def test_linear_models_show_poles_and_responses(at_work):
    person = at_work("five_bar")
    person.page.get_by_role("button", name="Linear").click()
    dialog = person.page.get_by_role("dialog", name="Linear model")
    expect(dialog.locator("canvas[role=img]")).to_have_count(3)
    held = ", ".join(f"{one:.3g}" for one in person.state["seen"]["held"][:1])
    expect(dialog).to_contain_text(f"motors held: {held}")
