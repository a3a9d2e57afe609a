"""What objects show in notebooks: well-formed HTML, the right numbers, text escaped, colours of the page."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import paraflex as pf
from made_up import STUDY, made_up, write_study
from paraflex.designs.sweep import SweepResult
from paraflex.display import facts, table, written
from paraflex.errors import IntegrationError
from paraflex.integrators import IntegrationOptions
from paraflex.motion import simulate_motion
from paraflex.plots.mechanism_html import freedoms, mechanism_html
from paraflex.plots.svg import sketch
from paraflex.results import tracking_dataset
from paraflex.results.drawing import assembled_data
from paraflex.studies import load_optimisation, load_sweep, optimise, run_study, sweep, verify
from paraflex.studies.comparison import Measurement, MethodComparison, Reference
from paraflex.studies.html import indices_html, search_html
from paraflex.studies.optimisation.identify import IdentificationResult, TargetResult
from paraflex.studies.optimisation.indices import IndicesResult
from paraflex.studies.optimisation.objective import Target
from paraflex.studies.sensitivity import Sensitivities

_EMPTY = {"circle", "path", "rect", "br", "polygon", "polyline"}
EVIL = '<script>alert("x")</script> & co'


class _Reader(HTMLParser):
    """Rows of tables as text, and whether every element is closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.names: set[str] = set()
        self.text = ""

    def handle_starttag(self, tag, attrs) -> None:
        self.names.add(tag)
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag, attrs) -> None:
        self.names.add(tag)

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag

    def handle_data(self, text) -> None:
        self.text += text
        if {"td", "th"} & set(self.open):
            self.rows[-1][-1] += text


def read(thing: object) -> _Reader:
    html = thing if isinstance(thing, str) else thing._repr_html_()  # pyright: ignore[reportAttributeAccessIssue]
    reader = _Reader()
    reader.feed(html)
    reader.close()
    assert reader.open == []
    # The page's own colours, light or dark.
    assert "background" not in html
    assert "color: #" not in html
    assert "script" not in reader.names
    return reader


def row(reader: _Reader, name: str) -> list[str]:
    (found,) = [cells for cells in reader.rows if cells[0] == name]
    return found


@pytest.fixture(scope="module")
def task():
    model = pf.load("five_bar")
    return pf.plan(model.mechanism, model.path("line"), duration=0.05, samples=26)


@pytest.fixture(scope="module")
def run(task):
    return task.simulate("++")


@pytest.mark.parametrize("name", pf.library.names())
def test_every_mechanism_of_the_library_shows_itself(name: str) -> None:
    mechanism = pf.load(name).mechanism
    shown = read(mechanism)
    for body in mechanism.bodies:
        assert row(shown, body.name)
    for joint in mechanism.joints:
        assert f"{joint.a} – {joint.b}" in [cells[-1] for cells in shown.rows]
    assert "svg" in shown.names


def test_counts_of_a_mechanism() -> None:
    shown = read(pf.load("raparm_i"))
    assert row(shown, "bodies") == ["bodies", "8, 8 of them flexible"]
    assert row(shown, "closed loops")[1] == "3"
    assert row(shown, "degrees of freedom (Grübler)")[1] == "2"
    assert "tau1 at A1 [N m]" in row(shown, "motors")[1]
    assert row(shown, "link2") == ["link2", "flexible beam", "0.1", "D1, E1"]
    assert row(shown, "study: path")[1] == "square"
    assert "held rigid" in read(pf.load("five_bar").mechanism.with_bodies(
        [replace(pf.load("five_bar").mechanism.bodies[0], flexible=False)])).text  # fmt: skip


@pytest.mark.parametrize(
    ("name", "expected"),
    [("slider_crank", 1), ("3rrr", 3), ("3prr", 3), ("pendulum", 1), ("four_bar", 0), ("andrews", 1)],
)
def test_freedoms_as_gruebler_counts_them(name: str, expected: int) -> None:
    assert freedoms(pf.load(name).mechanism) == expected


def test_names_are_escaped() -> None:
    mechanism = replace(pf.load("five_bar").mechanism, name=EVIL, description="1 < 2")
    html = mechanism_html(mechanism)
    assert EVIL not in html
    assert "&lt;script&gt;" in html
    shown = read(html)
    assert EVIL in shown.text
    assert "1 < 2" in shown.text
    assert "<b>" not in table(["<b>"], [["<b>", 1.0]], "<b>") + facts([("<b>", "<b>")])


def places_of(mechanism) -> dict[str, dict[str, tuple[float, float]]]:
    """Where the sketch has the named points of bodies [m]."""
    data, places = assembled_data(mechanism), {body.name: {} for body in mechanism.bodies}
    assert data is not None
    for name, station in zip(data["point"].values, data["point_station"].values, strict=True):
        body, _, point = str(name).partition(".")
        places[body][point] = tuple(data["shape"].values[0, station].tolist())
    return places


def test_the_sketch_puts_links_end_to_end() -> None:
    mechanism = pf.load("raparm_i").mechanism
    places = places_of(mechanism)
    angles = mechanism.assemblies[0].angles
    for body in mechanism.bodies:
        first, last = places[body.name][next(iter(body.points))], places[body.name][list(body.points)[-1]]
        length = max(body.points.values()) - min(body.points.values())  # pyright: ignore[reportArgumentType, reportAttributeAccessIssue]
        assert np.hypot(last[0] - first[0], last[1] - first[1]) == pytest.approx(length)
        assert np.arctan2(last[1] - first[1], last[0] - first[0]) == pytest.approx(angles[body.name])
    assert places["link1"]["A1"] == mechanism.ground["A1"]
    assert places["link1"]["B1"] == pytest.approx(places["link4"]["B1"])
    drawn = sketch(mechanism)
    assert drawn.count('stroke-linecap="round"') == 8
    # Eleven pins and the end-effector.
    assert drawn.count("<circle") == 12
    assert sketch(replace(mechanism, assemblies=())) == ""
    assert 'fill-opacity="0.25"' in sketch(pf.load("3rrr").mechanism)
    assert 'fill-opacity="0.25"' not in drawn
    assert sketch(pf.load("3prr").mechanism).count('class="block"') == 3


def test_a_slider_hangs_on_its_rod_not_on_its_axis() -> None:
    places = places_of(pf.load("slider_crank").mechanism)
    slider, rod = list(places.values())[-1], list(places.values())[1]
    assert any(place == pytest.approx(end) for place in slider.values() for end in rod.values())


def test_a_tracking_run_tells_what_its_dataset_does(run) -> None:
    shown = read(run)
    data = tracking_dataset([run]).isel(mode=0)
    assert "complete" in shown.text
    error = float(data["tracking_rms_motion"])
    assert row(shown, "tracking error during the motion, RMS")[1] == f"{1e6 * error:.4g} µm"
    assert row(shown, "largest deflection")[1] == f"{1e3 * float(data['deflection'].max()):.4g} mm"
    for motor in data["motor"].values:
        peak, rms = (float(data[key].sel(motor=motor)) for key in ("peak_torque", "rms_torque"))
        assert row(shown, str(motor)) == [str(motor), "active", f"{peak:.4g}", f"{rms:.4g}", "N m"]
    assert row(shown, "steps")[1].startswith(f"{run.solution.steps},")


def test_a_run_that_failed_says_why(task) -> None:
    with pytest.raises(IntegrationError) as caught:
        task.simulate("++", options=IntegrationOptions(max_steps=3))
    shown = read(caught.value.partial)
    assert "failed" in shown.text
    solution = caught.value.partial.solution
    assert solution.message in shown.text
    # The message says when it failed; the last sample is earlier.
    assert f"failed, its last sample at t = {solution.t[-1]:.4g} s" in shown.text


def test_a_motion_run() -> None:
    run = simulate_motion(pf.load("pendulum").mechanism, 0.05, samples=6)
    shown = read(run)
    assert "complete at t = 0.05 s" in shown.text
    assert row(shown, "kinetic energy, largest")[1] == f"{run.solution.kinetic_energy.max():.4g} J"
    x, y = (float(cell) for cell in row(shown, "beam.tip")[1:])
    assert np.hypot(x, y) == pytest.approx(0.6, rel=2e-3)


def test_a_study_with_a_mode_that_cannot(task) -> None:
    result = run_study(task, ["++", "+-"])
    shown = read(result)
    assert result.data is not None
    assert row(shown, "++")[2] == f"{1e6 * float(result.data['tracking_rms'][0]):.4g}"
    assert "error [µm]" in shown.text
    assert row(shown, "+-")[1] == "failed"
    assert "cannot drive the mechanism" in shown.text
    assert "no mode ran" in read(run_study(task, ["+-"])).text


def test_models_compared(task) -> None:
    found = verify(task, ["++"], models=["rigid", "linear"])
    shown = read(found)
    heads, *rows = shown.rows
    assert [cells[0] for cells in rows] == ["rigid", "linear geometry"]
    # There is a status where a model did not run to its end.
    assert "status" not in heads


def test_a_sweep_and_a_search(tmp_path: Path) -> None:
    run = made_up(
        tracking_rms=lambda mode, x, y: 1e-3 * x, peak_torque_max=lambda mode, x, y: y, total_mass=lambda *_: 3.0
    )
    sampled = STUDY.replace("[vary.x]", '[sampling]\nkind = "sobol"\nnumber = 4\n\n[vary.x]')
    done = sweep(load_sweep(write_study(tmp_path, sampled)), tmp_path / "out", run=run)
    assert row(read(done), "runs")[1] == "4 of 4"
    assert row(read(SweepResult("grid", tmp_path, 9, {"complete": 3}, interrupted=True)), "runs")[1] == "3 of 9"
    text = STUDY + "\n[objective]\nminimise = { tracking_rms = 1.0 }\n[search]\nevaluations = 20\n"
    best = optimise(load_optimisation(write_study(tmp_path, text, "best.toml")), tmp_path / "best", run=run)
    shown = read(best)
    assert row(shown, "x") == ["x", "2", "5", "mm", "lowest allowed"]
    assert row(shown, "RMS tracking error") == ["RMS tracking error", "2", "5", "µm", "−60"]


def test_an_identification_and_indices(tmp_path: Path) -> None:
    target = Target(run=0, path="square", mode="++", column="tracking_rms", value=2.0, weight=1.0)  # pyright: ignore[reportCallIssue]
    found = IdentificationResult(
        name="rod", folder=tmp_path, values={"x": 1.5}, start={"x": 1.0}, residual=0.05, start_residual=0.5,
        targets=(TargetResult(target, 2.1, 1.0, 0.05),), confidence=None, bounds={}, evaluations=7, fresh=0, failed=0,
        reasons=(), derivatives="exact", stopped="converged", interrupted=False, seconds=1.0,
    )  # fmt: skip
    shown = read(search_html(found))
    assert row(shown, "x")[:3] == ["x", "1.5", "1"]
    assert row(shown, "RMS tracking error")[:4] == ["RMS tracking error", "2", "2.1", "1"]
    shares = {"first": 0.25, "first_confidence": 0.01, "total": 0.5, "total_confidence": 0.02}
    data = {name: (("index", "parameter"), [[share]]) for name, share in shares.items()}
    data |= {"samples": ("index", [64]), "dropped": ("index", [0])}
    of = {"metric": ("index", ["tracking_rms"]), "path": ("index", ["square"]), "mode": ("index", ["++"])}
    indices = xr.Dataset(data, of | {"parameter": ["x"]})
    result = IndicesResult(SweepResult("saltelli", tmp_path, 1, {"complete": 1}), indices)
    assert row(read(indices_html(result)), "RMS tracking error")[3:] == ["x", "0.25", "0.01", "0.5", "0.02"]


def test_sensitivities_and_methods() -> None:
    one = np.array([[[2.0]]])
    found = Sensitivities("s", "arm", (("square", "++"),), ("x<y",), np.array([3.0]), (("a",),), ("work",), ("J",),
                          np.array([[12.0]]), one, one, np.zeros(1))  # fmt: skip
    assert row(read(found), "work") == ["work", "12", "J", "0.5"]
    assert "x<y" in read(found).text
    run = Measurement("esdirk5", tolerance=1e-4, wall_time=0.5, error=1e-5, steps=40)
    compared = MethodComparison("mode ++", "arm", 1.0, 11, 6, 4, Reference("a", 1e-9, "b", 1e-9, 1e-10, 1.0), (run,))
    rows = read(compared).rows
    assert ["method", "tolerance [mm]", "error [µm]", "wall time [s]"] in rows
    assert [cells for cells in rows if cells[0] == "esdirk5"][:2] == [
        ["esdirk5", "0.1", "10", "0.5"], ["esdirk5", "0.1", "40"],
    ]  # fmt: skip


def test_values_as_text() -> None:
    values = (1.23456, 3, "a", None, float("nan"), [1, "b"], True, np.inf)
    assert [written(value) for value in values] == ["1.235", "3", "a", "", "", "1, b", "yes", ""]
    assert re.search("right.*left", table(["a", "b"], [[1.0, "x"]])) is not None
    assert table(["a"], []) == facts([]) == ""
