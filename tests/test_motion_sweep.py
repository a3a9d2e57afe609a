"""Studies of many designs of a mechanism without a path: prescribed motions and loads drive it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import paraflex as pf
from paraflex.designs.sweep import load_sweep
from shell import paraflex

METRICS = ["drive_torque_max", "drive_power_max", "joint_force_max", "joint_speed_max", "stress_max",
           "safety_factor_min", "section_moment_max", "strain_energy_max", "drive_torque_error",
           "joint_force_error", "stress_max_error"]  # fmt: skip
# A slider-crank that a constant speed drives, without the library's published start.
LIBRARY = Path(pf.__file__).parent / "mechanism" / "library" / "slider_crank_flexible.toml"
MODEL = re.sub(r"(?ms)^# The published start.*?(?=^\[study\])", "", LIBRARY.read_text(encoding="utf-8"))
STUDY = """
mechanism = "crank.toml"
duration = 0.004
samples = 41
set = { "steel.strength" = 235e6 }
"""
VARIED = """
[vary.speed]
fields = ["parameters.speed"]
values = [120.0, 150.0]

[vary.thickness]
fields = ["section.rod.thickness"]
values = ["6 mm", "8 mm"]
"""
RANGE = """
[vary.thickness]
fields = ["section.rod.thickness"]
low = "6 mm"
high = "9 mm"
"""


def written(folder: Path, *parts: str) -> Path:
    (folder / "crank.toml").write_text(MODEL, encoding="utf-8")
    file = folder / "study.toml"
    file.write_text("".join(parts), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("driven")
    ran = paraflex("sweep", written(folder, f"metrics = {METRICS}\n", STUDY, VARIED), "--output", folder / "out")
    assert ran.returncode == 0, ran.stderr
    return folder / "out"


def test_rows_are_what_runs_of_each_design_say(swept):
    table = pd.read_parquet(swept / "results.parquet")
    assert list(table["status"]) == ["complete"] * 4
    assert set(table["path"]) == set(table["mode"]) == {""}
    for _, row in table.iterrows():
        model = pf.load(swept.parent / "crank.toml", set={
            "parameters.speed": row["speed"], "section.rod.thickness": row["thickness"], "steel.strength": 235e6,
        })  # fmt: skip
        data = pf.motion_dataset(pf.simulate_motion(model, 0.004, samples=41))
        speeds = abs(data["joint_speed"]).max("time")
        expected = {
            "drive_torque_max.drive": abs(data["drive_torque"]).max(),
            "drive_power_max.drive": abs(data["drive_power"]).max(),
            "joint_force_max": np.linalg.norm(data["joint_force"], axis=-1).max(),
            "stress_max": data["stress_max"].max(),
            "safety_factor_min": data["safety_factor"].min(),
            "strain_energy_max": data["strain_energy"].max(),
            "drive_torque_error.drive": data["drive_torque_error"].max(),
            "joint_force_error": data["joint_force_error"].max(),
            "stress_max_error": data["stress_max_error"].max(),
            **{f"joint_speed_max.{joint}": speeds.sel(joint=joint) for joint in data["joint"].values},
        }
        for column, value in expected.items():
            assert row[column] == pytest.approx(float(value), rel=1e-6), column
        off = row["joint_force_error"] > 0.01 * row["joint_force_max"]
        assert ("errors of integration" in row["reason"]) == off, row["reason"]
    assert table["drive_torque_max.drive"].nunique() == 4


def test_the_report_shows_drives_joints_and_stresses_of_the_best(swept):
    page = (swept / "report.html").read_text(encoding="utf-8")
    for text in (
        "largest torque of drive",
        "Torques of prescribed motions",
        "Stresses of beams",
        "Sliding speeds of joints",
    ):
        assert text in page, text
    assert "Tracking error" not in page
    assert "mode " not in pf.plots.response_curves(swept).axes[0].get_legend_handles_labels()[1]
    pf.plots.pareto_front(swept)
    pf.plots.parallel_coordinates(swept)


def test_it_goes_on_where_it_stopped_and_keeps_whole_runs(tmp_path):
    study = load_sweep(written(tmp_path, 'metrics = ["stress_max"]\ntrajectories = true\n', STUDY, VARIED))
    assert study.run(tmp_path / "out", limit=2).done == 2
    done = study.run(tmp_path / "out")
    assert (done.fresh, done.complete) == (2, True)
    (first, *others) = sorted((tmp_path / "out" / "trajectories").iterdir())
    assert len(others) == 3
    assert pf.load_results(first).attrs["kind"] == "motion"


def test_without_names_all_metrics_of_such_runs_are_kept(tmp_path):
    columns = load_sweep(written(tmp_path, STUDY, VARIED)).setting.metrics
    assert {"stress_max", "drive_torque_max", "joint_force_max", "kinetic_energy_max", "steps"} <= set(columns)
    # Without path and motors nothing of these.
    assert not {"tracking_rms", "residual_vibration", "actuation_condition_max", "peak_torque_max"} & set(columns)


def test_a_balanced_start_is_that_of_the_run(tmp_path):
    found = pf.sweep(written(tmp_path, 'balanced = true\nmetrics = ["stress_max"]\n', STUDY, VARIED), tmp_path / "out")
    model = pf.load(tmp_path / "crank.toml")
    data = [
        pf.motion_dataset(pf.simulate_motion(model, 0.004, samples=41, balanced=balanced))["stress_max"].max().item()
        for balanced in (True, False)
    ]
    assert data[0] != pytest.approx(data[1], rel=0.01)
    table = found.data.to_dataframe()
    nominal = table[np.isclose(table["speed"], 150.0) & np.isclose(table["thickness"], 0.008)]
    assert len(nominal) == 1
    assert float(nominal["stress_max"].iloc[0]) == pytest.approx(data[0], rel=1e-6)


def test_a_row_says_that_its_samples_are_too_few(tmp_path):
    study = STUDY.replace("duration = 0.004", "duration = 0.05").replace("samples = 41", "samples = 6")
    found = pf.sweep(written(tmp_path, 'metrics = ["stress_max"]\n', study, VARIED), tmp_path / "out")
    assert found.coarse == 4
    assert found.to_dict()["too_few_samples"] == 4
    assert all("6 samples are too few" in each for each in found.data["reason"].values)
    assert not pf.sweep(written(tmp_path, 'metrics = ["work"]\n', study, VARIED), tmp_path / "energies").coarse


def test_an_optimisation_takes_differences(tmp_path):
    limit = '[[objective.at_most]]\nmetric = "stress_max"\nvalue = "400 MPa"\n'
    objective = f"[objective]\nminimise = {{ total_mass = 1.0 }}\n{limit}"
    search = '[search]\nmethod = "nelder-mead"\nevaluations = 12\n'
    found = pf.optimise(written(tmp_path, STUDY, RANGE, objective, search), tmp_path / "out")
    assert found.evaluations <= 12
    assert found.values["thickness"] < 0.008


@pytest.mark.parametrize(
    ("more", "field", "words"),
    [
        ('modes = ["++"]\n', "modes", "no actuation modes"),
        ('metrics = ["tracking_rms"]\n', "metrics", "runs along a path"),
        ('metrics = ["drive_torque"]\n', "metrics", "drive_torque_max"),
        ('paths = ["square"]\n', "paths", "square"),
    ],
)
def test_what_such_runs_do_not_have_is_refused(tmp_path, more, field, words):
    with pytest.raises(pf.InputError, match=words) as caught:
        load_sweep(written(tmp_path, more, STUDY, VARIED))
    assert field in caught.value.field


def test_a_run_of_unknown_length_and_a_balanced_one_along_a_path_are_refused(tmp_path):
    study = written(tmp_path, STUDY.replace("duration = 0.004\n", ""), VARIED)
    (tmp_path / "crank.toml").write_text(MODEL.replace("duration = 0.1 # s\n", ""), encoding="utf-8")
    with pytest.raises(pf.InputError, match="no duration is given"):
        load_sweep(study)
    along = 'mechanism = "five_bar"\nbalanced = true\n'
    with pytest.raises(pf.InputError, match="start on the planned motion"):
        load_sweep(written(tmp_path, along))


def test_derivatives_of_such_runs_are_refused_by_name(tmp_path):
    with pytest.raises(pf.InputError, match="derivatives need runs along a path"):
        pf.sensitivities(written(tmp_path, STUDY, "[vary.thickness]\nfields = ['section.rod.thickness']\n"))
