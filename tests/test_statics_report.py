"""The report of static equilibria: its numbers, charts, steps in motion; in a browser."""

from __future__ import annotations

import shlex

import numpy as np
import pytest

import paraflex as pf
from flexures import guide, truss
from paraflex.errors import LimitPointError
from paraflex.figures.charts import is_logarithmic, joined
from paraflex.reports import render, save_page, statics_page
from paraflex.results import load_results
from shell import paraflex


@pytest.fixture(scope="module")
def pushed():
    return pf.statics_dataset(pf.statics(pf.load("leaf_spring_guide"), steps=5))


@pytest.fixture(scope="module")
def snapped():
    found = pf.statics(truss(), loads={"apex.T.y": -15.0}, held=["apex.T.angle"], steps=5, warning=False)
    return pf.statics_dataset(found)


def charts(page) -> dict:
    return {chart.identity: chart for panel in page.panels for chart in panel.charts}


def test_tiles_tables_and_charts_have_the_numbers_of_the_dataset(pushed):
    page = statics_page(pushed)
    assert ("force of stage.T.x", "10.6 N", "moved: 10 mm") in page.figures
    assert ("stiffness of stage.T.y", "5.272 kN/mm", "42 kN/mm at the start") in page.figures
    force = charts(page)["force-0"].curves[0]
    assert np.asarray(force.x) == pytest.approx(pushed["travel"].sel(named="stage.T.x").values)
    assert np.asarray(force.y) == pytest.approx(pushed["effort"].sel(named="stage.T.x").values)
    assert charts(page)["force-0"].shown_units().x.name == "mm"
    # 1 and 42000 N/mm in one chart.
    stiffness = charts(page)["stiffness-m"]
    assert is_logarithmic(stiffness.axis(None), joined(curve.y for curve in stiffness.curves))
    assert not charts(page)["force-0"].axis(None).log
    sinks = charts(page)["travels"].curves[0]
    assert np.asarray(sinks.y)[-1] == pytest.approx(pushed["travel"].sel(named="stage.T.y").values[-1])
    titles = [title for title, _ in page.more]
    assert titles == ["At the last step", "Steps", "Stresses of beams", "Reactions"]
    assert "buckling" not in charts(page)
    assert page.verdict == "sound"


def test_the_animation_goes_from_step_to_step_and_names_them(pushed, snapped):
    film = statics_page(pushed).film
    assert film is not None
    assert film.shape.shape[1] == film.time.size == 6
    assert film.moments[0] == "stable at load factor 0"
    assert film.moments[-1] == "stable at load factor 1"
    assert film.shape[0] == pytest.approx(pushed["shape"].values, abs=1e-7)
    other = statics_page(snapped).film
    assert other is not None
    assert "limit point at load factor 0.663" in other.moments


def test_unstable_parts_are_dotted_and_limit_points_ringed(snapped):
    curves = charts(statics_page(snapped))["force-0"].curves
    stable, unstable, limits = curves
    assert [curve.look.dash for curve in curves[:2]] == [0, 2]
    assert limits.mark == "ring"
    assert len(np.asarray(limits.y)) == 2
    kinds = np.where(snapped["limit_point"], "limit", np.where(snapped["stable"], "stable", "unstable"))
    assert np.isfinite(stable.y).tolist() == [kind != "unstable" for kind in kinds]
    assert np.isfinite(unstable.y).tolist() == [kind != "stable" for kind in kinds]


def test_an_unstable_equilibrium_is_told_with_its_motion_and_buckling_shape():
    loads = {"stage.T.y": -100.0}
    data = pf.statics_dataset(pf.statics(guide(1, elements=2), loads=loads, steps=2, buckling=2, warning=False))
    page = statics_page(data)
    assert page.verdict == "doubtful"
    assert "1 of 3 equilibria are unstable" in page.notes[0]
    assert "turns most" in page.notes[0]
    factor = f"{float(data['buckling_factor'][0, 0]):.4g}"
    assert any(tile[:2] == ("buckling", factor) for tile in page.figures)
    shape = charts(page)["buckling"]
    assert shape.equal
    assert len(shape.choices) == 2
    before, swung = (next(c for c in shape.curves if c.name == name and c.choice == 0) for name in ("before", "stage"))
    # Sideways, by the same of all its points.
    apart = np.ptp(np.asarray(swung.x)) - np.ptp(np.asarray(before.x))
    assert apart > 0.0


def test_a_mechanism_at_rest_has_its_shape(tmp_path):
    data = pf.statics_dataset(pf.statics(pf.load("raparm_i"), warning=False))
    page = statics_page(data)
    assert list(charts(page)) == ["shape"]
    assert page.film is not None
    assert "10⁻" not in "".join(html for _, html in page.more)
    assert "<h1>RAParM-I</h1>" in render(page)


def test_the_command_writes_it_and_its_command_finds_the_same_again(tmp_path):
    given = ["--load", "stage.T.y=-20 N", "--move", "stage.T.x=5 mm", "--hold", "stage.T.angle", "--steps", "2"]
    done = paraflex(
        "statics", "leaf_spring_guide", *given, "--set", "leaf.thickness=0.4 mm", "--out", "a", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert "numbers, figures and report.html in a" in done.stderr
    page = statics_page(load_results(tmp_path / "a" / "statics.nc"))
    _, *words = shlex.split(page.command)
    assert words[:2] == ["statics", "leaf_spring_guide"]
    again = paraflex(*words, "--out", "b", "--no-report", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert not (tmp_path / "b" / "report.html").exists()
    first, second = (load_results(tmp_path / name / "statics.nc") for name in "ab")
    assert first["effort"].values == pytest.approx(second["effort"].values, abs=1e-12)
    later = paraflex("report", "b", cwd=tmp_path)
    assert later.returncode == 0, later.stderr
    assert (tmp_path / "b" / "report.html").exists()


def test_steps_until_a_failure_are_reported():
    with pytest.raises(LimitPointError) as caught:
        pf.statics(pf.load("pendulum"), loads={"pivot": 3.0}, held=[], steps=4)
    page = statics_page(pf.statics_dataset(caught.value.partial))
    assert page.verdict == "failed"
    assert page.notes[0].startswith("failed: no equilibrium beyond load factor")


@pytest.mark.parametrize(("width", "height"), [(1400, 1000), (390, 844)])
def test_it_opens_and_moves_in_a_browser(browser, pushed, tmp_path, width, height):
    save_page(statics_page(pushed), tmp_path / "report.html")
    page, errors = browser.new_page(viewport={"width": width, "height": height}), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto((tmp_path / "report.html").as_uri())
    page.wait_for_function("document.documentElement.dataset.ready === 'true'")
    assert page.locator("#time").inner_text() == "stable at load factor 0"
    page.keyboard.press("ArrowRight")
    assert page.locator("#time").inner_text() == "stable at load factor 0.2"
    page.keyboard.press("End")
    assert page.locator("#time").inner_text() == "stable at load factor 1"
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    box = page.locator("#canvas").bounding_box()
    assert box is not None
    assert box["height"] > 200
    assert not errors
    page.close()
