"""`paraflex reduce`: what it prints and writes against Python's reduced models, and bad input."""

from __future__ import annotations

import json
import math

import pytest

import paraflex as pf
from paraflex.results import load_results, reduction_summary
from shell import paraflex


def test_it_tells_what_python_finds(tmp_path):
    done = paraflex(
        "reduce", "raparm_i", "--mode", "+-+-", "--mode", "++++", "--until", "30", "--out", "r", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    data = load_results(tmp_path / "r" / "reduced.nc")
    numbers = json.loads((tmp_path / "r" / "reduced.json").read_text())
    assert {key: numbers[key] for key in numbers if key != "digest"} == reduction_summary(data)
    model = pf.linearise(pf.load("raparm_i"), mode="+-+-")
    few = pf.reduce(model, 16)
    own = numbers["modes"]["+-+-"]["craig-bampton"]
    assert own["frequencies_held"][:2] == pytest.approx(few.held_frequencies()[:2] / (2.0 * math.pi), rel=1e-9)
    needed = pf.states_needed([model], until=2.0 * math.pi * 30.0, methods=["craig-bampton"])["states"]
    assert own["states_needed"]["x"] == needed.sel(mode="+-+-", reduction="craig-bampton", output="x").item()
    # The paper's plan, free modes, has the held frequency a quarter too high; ours to a millionth.
    exact = numbers["modes"]["+-+-"]["full"]["frequencies_held"][0]
    assert own["frequencies_held"][0] == pytest.approx(exact, rel=1e-4)
    assert numbers["modes"]["+-+-"]["modal"]["frequencies_held"][0] > 1.2 * exact
    by_states = data["held_frequency"].sel(mode="+-+-")
    assert by_states.sel(reduction="modal", kept=16).item() == pytest.approx(
        numbers["modes"]["+-+-"]["modal"]["frequencies_held"][0], rel=1e-9
    )
    assert math.isnan(by_states.sel(reduction="craig-bampton", kept=6).item())
    assert "States needed for 1 % up to 30 Hz" in done.stdout
    assert {file.stem for file in (tmp_path / "r" / "figures").glob("*.png")} == {
        "reduced_responses", "reduction_errors", "held_frequency_by_states"
    }  # fmt: skip


def test_errors_are_those_of_the_responses():
    model = pf.linearise(pf.load("five_bar"), mode="++")
    data = pf.reduction_dataset([model], 12, methods=["craig-bampton"], until=20.0)
    s = 2.0 * math.pi * data["frequency"].values * (1j + data.attrs["damping_ratio"])
    few = pf.reduce(model, 12)
    for k, output in enumerate(data["output"].values):
        error = few.error(s, outputs=[str(output)])
        assert data["error"].values[0, 0, k] == pytest.approx(error, rel=1e-9)
    inside = data["error"].sel(frequency=slice(None, 20.0))
    assert data["largest_error"].values == pytest.approx(inside.max("frequency").values)


def test_balanced_models_come_with_their_bound(tmp_path):
    text = (pf.library.text("five_bar")).replace(
        'material = "aluminium"', 'material = "aluminium"\ndamping = { ratios = [0.01] }'
    )
    (tmp_path / "damped.toml").write_text(text, encoding="utf-8")
    done = paraflex("reduce", "damped.toml", "--method", "balanced", "--states", "12", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "mode ++, balanced: the gain of the error is at most" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["five_bar", "--states", "2"], "--states: are fewer than the 4 of the coordinates of 2 motors"),
        (["five_bar", "--states", "15"], "--states: is odd"),
        (["five_bar", "--states", "1000"], "--states: no such number of states (got 1000)"),
        (["raparm_i", "--method", "magic"], "unknown reduction method"),
        (["raparm_i", "--until", "-1"], "--until: is not positive"),
        (["slider_crank"], "has rigid links only"),
        (["raparm_i", "--pose", "9,9"], "--pose: the end-effector cannot reach it"),
        (["raparm_i", "--method", "balanced"], "damp"),
    ],
)
def test_bad_input_is_one_line(arguments, message):
    done = paraflex("reduce", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
