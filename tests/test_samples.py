"""Are the samples of a run close enough for its largest loads? The finding on those that are not."""

from __future__ import annotations

import copy
import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

import paraflex as pf
from paraflex.dynamics import build_system
from paraflex.integrators.between import LARGER, with_between
from shell import paraflex

PAGE = Path(__file__).parents[1] / "docs" / "quick-return.md"
CODE = "samples-coarse"
# The module, which the package's function of the same name hides.
integrate = importlib.import_module("paraflex.integrators.integration")


@pytest.fixture(scope="module")
def shaper(tmp_path_factory):
    """The model file of the documentation's shaper."""
    (model,) = re.findall(r'```toml title="shaper.toml"\n(.*?)```', PAGE.read_text(encoding="utf-8"), re.DOTALL)
    file = tmp_path_factory.mktemp("shaper") / "shaper.toml"
    file.write_text(model, encoding="utf-8")
    return file


def coarse(run):
    return [one for one in run.findings if one.code == CODE]


def largest(run):
    data = pf.motion_dataset(run)
    return np.nanmax(data["stress_max"]) / 1e6, np.max(np.linalg.norm(data["joint_force"], axis=-1))


def test_a_stress_that_samples_miss_is_found_with_the_number_that_has_it(shaper):
    model = pf.load(shaper)
    with pytest.warns(pf.ResultWarning, match="51 samples are too few"):
        run = pf.simulate_motion(model, samples=51, balanced=True)
    (found,) = coarse(run)
    stress, force = largest(run)
    whole = pf.simulate_motion(model, samples=4001, balanced=True)
    true_stress, true_force = largest(whole)
    assert stress < 0.75 * true_stress
    # The text has the numbers of the samples, and the true ones to the same percent as its remedy.
    numbers = [float(each) for each in re.findall(r"([0-9.]+) (?:MPa|N)\b", found.text)]
    np.testing.assert_allclose(numbers, [stress, true_stress, force, true_force], rtol=0.01)
    enough = int(re.fullmatch(r"give samples = (\d+)", found.remedy).group(1))
    remedied = pf.simulate_motion(model, samples=enough, balanced=True)
    np.testing.assert_allclose(largest(remedied), [true_stress, true_force], rtol=LARGER)
    assert not coarse(remedied)
    assert not coarse(whole)


def test_terminal_report_and_summary_say_so(shaper, tmp_path):
    ran = paraflex("run", "--no-figures", shaper, "--balanced", "--samples", 51, "--out", tmp_path / "few")
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.count(f"[{CODE}]") == 1
    assert CODE in (tmp_path / "few" / "report.html").read_text(encoding="utf-8")
    summary = json.loads((tmp_path / "few" / "summary.json").read_text(encoding="utf-8"))
    # Its beam is damped: steps resolve how it vibrates.
    assert {one["code"] for one in summary["verdict"]["findings"]} == {CODE}


@pytest.mark.parametrize("name", ["slider_crank_flexible", "spin_up", "pendulum", "four_bar"])
def test_no_alarm_of_a_motion_with_its_own_samples(name):
    model = pf.load(name)
    assert not coarse(pf.simulate_motion(model, samples=model.study.samples))


def test_no_alarm_of_the_shaper_with_its_own_samples(shaper):
    assert not coarse(pf.simulate_motion(pf.load(shaper), samples=1001))


@pytest.mark.parametrize(("name", "mode"), [("five_bar", "++"), ("raparm_i", "++++"), ("slider_crank", "+")])
def test_no_alarm_along_the_paths_of_the_library(name, mode):
    model = pf.load(name)
    assert not coarse(model.plan().simulate(mode))


def test_a_run_along_a_path_says_of_which_mode():
    task = pf.load("five_bar").plan(samples=6)
    (found,) = coarse(task.simulate("++"))
    assert (found.place, found.text[:9]) == ("mode ++", "6 samples")


def test_what_is_kept_is_the_same_to_the_last_bit(monkeypatch):
    def solution():
        return pf.simulate_motion(pf.load("slider_crank_flexible"), samples=7).solution

    looked = solution()
    monkeypatch.setattr(integrate, "with_between", lambda *_: None)
    plain = solution()
    assert looked.steps == plain.steps
    for name in ("t", "q", "v", "a", "multipliers", "kinetic_energy", "strain_energy", "work"):
        np.testing.assert_array_equal(getattr(looked, name), getattr(plain, name))
    assert [one.code for one in looked.findings] == [CODE]
    assert not plain.findings


def test_times_between_are_left_out_where_they_would_take_too_much_memory():
    times = np.linspace(0.0, 1.0, 701)
    near = with_between(times, build_system(pf.load("five_bar").mechanism).n)
    assert near is not None
    np.testing.assert_array_equal(near.times[near.stored], times)
    assert near.times.size == 1401
    assert np.all(np.diff(near.times) > 0.0)
    assert with_between(times, 10_000) is None
    assert with_between(times[:1], 3) is None


def test_a_short_pulse_is_seen_between_samples(tmp_path):
    """Of a millisecond in 100 s, between two of the samples that are looked at: steps follow it."""
    model = tmp_path / "pulse.toml"
    model.write_text(
        """
name = "arm"
ground = { O = [0.0, 0.0] }
[body.arm]
type = "rigid"
mass = 2.0
inertia = 0.3
points = { O = [0.0, 0.0], T = [0.8, 0.0] }
[joint]
O = ["ground.O", "arm.O"]
[assembly.home]
arm = 0.0
[prescribed.drive]
joint = "O"
speed = 1.0
[load.pulse]
type = "torque"
point = "arm.T"
torque = "exp(-((t - 43.21) / 0.001)^2)"
""".replace("^2", "**2")
    )
    run = pf.simulate_motion(pf.load(model), 100.0, samples=101, warning=False)
    (found,) = coarse(run)
    assert float(re.search(r"and (\S+) N m at t = 43.21 s", found.text).group(1)) == pytest.approx(1.0, rel=0.01)
    number = int(re.search(r"samples = (\d+)", found.remedy).group(1))
    assert 1e5 < number < 1e6


def test_loads_between_samples_are_computed_when_somebody_asks(monkeypatch, tmp_path):
    from paraflex.integrators import integration

    asked = []
    compute = integration.samples_too_few
    monkeypatch.setattr(integration, "samples_too_few", lambda *given: asked.append(1) or compute(*given))
    solution = pf.load("five_bar").plan().simulate("++", warning=False).solution
    assert not asked
    found = copy.deepcopy(solution).findings
    assert len(asked) == 1
    assert isinstance(found, tuple)
    assert solution.findings == found
    assert solution.findings == solution.findings
    assert repr(solution.findings) == repr(found)
    assert len(asked) == 1
    (tmp_path / "sweep.toml").write_text(
        'mechanism = "five_bar"\npaths = ["line"]\nmetrics = ["tracking_rms"]\n[vary.thickness]\n'
        'fields = ["section.bar.thickness"]\nvalues = [0.004, 0.006]\n'
    )
    pf.sweep(tmp_path / "sweep.toml", tmp_path / "out", workers=1)
    assert len(asked) == 1
