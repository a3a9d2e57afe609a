"""Studies of many designs whose equilibria are found: sweeps, searches and indices of statics."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import paraflex as pf
from flexures import LENGTH, WIDTH, E
from paraflex.designs.measure import measure
from paraflex.designs.sweep import load_sweep
from paraflex.errors import InputError
from paraflex.files import library_text
from paraflex.results.metrics import METRICS, STATICS, MetricMembers, metric_unit
from shell import paraflex

BASE = 'mechanism = "leaf_spring_guide"\n'
GIVEN = """
[statics]
loads = { "stage.T.y" = "-20 N" }
moved = { "stage.T.x" = "8 mm" }
held = ["stage.T.angle"]
stiffness = ["stage.T.x", "stage.T.y"]
steps = 3
"""
# One equilibrium, where stiffness is that of the closed form.
STRAIGHT = '[statics]\nmoved = {}\nstiffness = ["stage.T.x"]\n'
VARIED = """
[vary.thickness]
fields = ["section.leaf.thickness"]
values = ["0.4 mm", "0.6 mm"]

[vary.weight]
fields = ["statics.loads.stage.T.y"]
values = [0.0, "-20 N"]
"""
RANGES = """
[vary.thickness]
fields = ["section.leaf.thickness"]
low = "0.3 mm"
high = "1 mm"

[vary.length]
fields = ["parameters.length"]
low = "80 mm"
high = "120 mm"
"""


def written(folder: Path, *parts: str) -> Path:
    file = folder / "study.toml"
    file.write_text("".join(parts), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("statics")
    ran = paraflex("sweep", written(folder, BASE, GIVEN, VARIED), "--output", folder / "out", "--engine", "threads")
    assert ran.returncode == 0, ran.stderr
    return folder / "out"


def test_rows_are_what_statics_of_each_design_say(swept):
    table = pd.read_parquet(swept / "results.parquet")
    assert list(table["status"]) == ["complete"] * 4
    for _, row in table.iterrows():
        guide = pf.load("leaf_spring_guide", set={"section.leaf.thickness": row["thickness"]})
        found = pf.statics(
            guide, loads={"stage.T.y": row["weight"]}, moved={"stage.T.x": 0.008}, held=["stage.T.angle"], steps=3,
            stiffness=["stage.T.x", "stage.T.y"], warning=False,
        )  # fmt: skip
        data = pf.statics_dataset(found)
        expected = {
            "travel.stage.T.y": found.travel("stage.T.y")[-1],
            "travel_max.stage.T.y": abs(found.travel("stage.T.y")).max(),
            "effort.stage.T.x": found.effort("stage.T.x")[-1],
            "effort_max.stage.T.angle": abs(found.effort("stage.T.angle")).max(),
            "stiffness.stage.T.y": found.stiffness("stage.T.y")[-1],
            "stiffness_min.stage.T.x": found.stiffness("stage.T.x").min(),
            "compliance.stage.T.x": 1.0 / found.stiffness("stage.T.x")[-1],
            "compliance_max.stage.T.y": 1.0 / found.stiffness("stage.T.y").min(),
            "frequency": found.frequencies[-1, 0] / (2.0 * math.pi),
            "frequency_free": found.free_frequencies[-1, 0] / (2.0 * math.pi),
            "frequency_min": found.frequencies[:, 0].min() / (2.0 * math.pi),
            "buckling_factor": found.buckling[0, 0],
            "stress_max": float(data["stress_max"].max()),
            "safety_factor_min": float(data["safety_factor"].min()),
            "joint_force_max": float(np.linalg.norm(data["joint_force"], axis=-1).max()),
            "unstable_steps": 0,
        }
        for column, value in expected.items():
            # Datasets keep section forces, from which stresses are, in single precision.
            assert row[column] == pytest.approx(value, rel=1e-6 if column[:6] in ("stress", "safety") else 1e-9,
                                                nan_ok=column == "buckling_factor"), column  # fmt: skip
        assert math.isnan(row["limit_load"])
    # Both numbers count.
    assert table["effort.stage.T.x"].nunique() == 4
    # Travel alone presses no leaf.
    assert table["buckling_factor"].isna().tolist() == (table["weight"] == 0.0).tolist()
    assert table["buckling_factor"].nunique() == 2


def test_columns_have_the_unit_of_their_coordinate(swept):
    schema = pq.read_schema(swept / "results.parquet")
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in schema}
    assert [units[f"{name}.stage.T.x"] for name in ("travel", "effort", "stiffness", "compliance")] == [
        "m", "N", "N/m", "m/N"
    ]  # fmt: skip
    assert [units[f"{name}.stage.T.angle"] for name in ("travel", "effort")] == ["rad", "N m"]
    assert "stiffness.stage.T.angle" not in units


def test_its_report_tells_what_varies_and_shows_no_motion(swept):
    page = (swept / "report.html").read_text(encoding="utf-8")
    assert "What was varied" in page
    assert "largest stress" in page
    assert "is not shown in motion" not in page
    pf.plots.response_curves(swept, metrics=["stiffness.stage.T.y"])
    pf.plots.response_curves(swept)


def test_metrics_of_which_more_is_better_choose_no_design_and_are_drawn(tmp_path):
    varied = VARIED.replace("statics.loads.stage.T.y", "statics.moved.stage.T.x").replace("-20 N", "5 mm")
    file = written(tmp_path, 'metrics = ["stiffness"]\n', BASE, varied, GIVEN)
    found = pf.sweep(file, tmp_path / "out")
    assert found.complete
    assert "Best designs" not in paraflex("report", tmp_path / "out").stderr
    assert "Best designs" not in (tmp_path / "out" / "report.html").read_text(encoding="utf-8").partition("<script")[0]
    assert pf.plots.response_curves(tmp_path / "out").axes


def test_the_thinnest_leaves_of_a_given_stiffness_are_those_of_the_closed_form(tmp_path):
    """Stress at a given travel falls with length, and thickness follows from k = 24 EI / L^3 = 2 E b (t / L)^3."""
    limit = '[[objective.at_most]]\nmetric = "compliance_max.stage.T.x"\nvalue = "1 mm/N"\n'
    objective = f"[objective]\nminimise = {{ stress_max = 1.0 }}\n{limit}"
    file = written(tmp_path, 'metrics = ["stress_max"]\n', BASE, "[statics]\nsteps = 2\n", RANGES, objective)
    found = pf.optimise(file, tmp_path / "out")
    assert found.holds_limits
    assert found.values["length"] == pytest.approx(0.12, rel=1e-6)
    thickness = 0.12 * (1000.0 / (2.0 * E * WIDTH)) ** (1.0 / 3.0)
    # As leaves stretch, the stage turns a little: the guide is 1e-4 softer than two beams whose ends do not.
    assert found.values["thickness"] == pytest.approx(thickness, rel=1e-4)
    best = pf.statics(pf.load(tmp_path / "out" / "best.toml"))
    assert best.stiffness("stage.T.x")[0] == pytest.approx(1000.0, rel=1e-4)


SIDEWAYS = """
[vary.aside]
fields = ["statics.moved.stage.T.x"]
low = "-4 mm"
high = "6 mm"
start = "3 mm"
"""


@pytest.mark.parametrize(("metric", "best"), [("max(abs(stage.T.y))", 0.0), ("travel.stage.T.y", 0.006)])
def test_an_expression_is_least_where_the_stage_sinks_least_and_travel_where_it_sinks_most(tmp_path, metric, best):
    """It sinks by 3/5 x^2 / L: as a signed travel this has no least value within the bounds."""
    objective = f'[objective]\nrelative = false\nminimise = {{ "{metric}" = 1.0 }}\n'
    given = '[statics]\nmoved = { "stage.T.x" = "3 mm" }\nsteps = 1\n'
    found = pf.optimise(written(tmp_path, BASE, given, SIDEWAYS, objective), tmp_path / "out")
    assert found.values["aside"] == pytest.approx(best, abs=1e-4)
    assert abs(found.metrics[metric]) == pytest.approx(0.6 * best**2 / LENGTH, rel=0.02, abs=1e-7)


def test_expressions_take_coordinates_in_all_steps_and_have_their_units():
    found = pf.statics(pf.load("leaf_spring_guide"), moved={"stage.T.x": -0.01}, steps=2)
    y, x, force = found.travel("stage.T.y"), found.travel("stage.T.x"), found.effort("stage.T.x")
    wanted = {
        "max(abs(stage.T.y))": np.max(np.abs(y)), "min(stage.T.x)": np.min(x), "last(travel.stage.T.x)": x[-1],
        "mean( effort.stage.T.x )": np.mean(force), "max(abs(effort.stage.T.x))": np.max(np.abs(force)),
        "min(stiffness.stage.T.y)": np.min(found.stiffness("stage.T.y")),
    }  # fmt: skip
    got = measure(found, list(wanted))
    assert got == pytest.approx(wanted, rel=1e-12)
    members = MetricMembers(found.system.described, found.equations.conditions)
    assert [metric_unit(name, members) for name in list(wanted)[::3]] == ["m", "N"]


def test_names_of_coordinates_need_no_quotes(tmp_path):
    """A minus sign in the name of a coordinate is none between two."""
    text = re.sub(r"\bstage\b", "my-stage", library_text("leaf_spring_guide"))
    (tmp_path / "guide.toml").write_text(text, encoding="utf-8")
    found = pf.statics(pf.load(tmp_path / "guide.toml"), moved={"my-stage.T.x": -0.01}, steps=2)
    y, x = found.travel("my-stage.T.y"), found.travel("my-stage.T.x")
    wanted = {
        "max(abs(my-stage.T.y))": np.max(np.abs(y)), "max(abs('my-stage.T.y'))": np.max(np.abs(y)),
        "mean(effort.my-stage.T.x)": np.mean(found.effort("my-stage.T.x")),
        "max(my-stage.T.y - my-stage.T.x) - 1 mm": np.max(y - x) - 1e-3,
    }  # fmt: skip
    assert measure(found, list(wanted)) == pytest.approx(wanted, rel=1e-12)


def test_points_and_joints_are_changes_since_the_start_whether_they_are_named_coordinates_or_not():
    crank = pf.load("slider_crank")
    places = {"rail.travel": "rail", "A.angle": "A", "crank.A.y": "crank.A.y", "rod.B.x": "rod.B.x"}
    given = {"moved": {"O": 0.1}, "steps": 2, "warning": False}
    named = pf.statics(crank, **given, stiffness=list(places.values()))
    for found in (named, pf.statics(crank, **given, stiffness=[])):
        for quantity, coordinate in places.items():
            (value,) = pf.metrics(found, [f"last({quantity})"]).values()
            assert value == pytest.approx(named.travel(coordinate)[-1], rel=1e-9), quantity
            assert abs(value) > 1e-4
    with pytest.raises(InputError, match=r"unknown coordinate \(got 'A.rate'\)"):
        pf.metrics(named, ["max(A.rate)"])


def test_equilibria_have_loads_of_joints_and_stresses_of_beams():
    found = pf.statics(pf.load("leaf_spring_guide"), moved={"stage.T.x": 0.01}, steps=2)
    got = measure(found, ["joint_force_max", "max(L.force)", "stress_max", "max(left.stress)", "max(right.stress)"])
    forces = [measure(found, [f"max({joint.name}.force)"]) for joint in found.system.described.joints]
    assert got["joint_force_max"] == pytest.approx(max(max(one.values()) for one in forces), rel=1e-12)
    assert got["stress_max"] == pytest.approx(max(got["max(left.stress)"], got["max(right.stress)"]), rel=1e-12)


def test_a_stiffness_is_sought_in_n_per_mm(tmp_path):
    """Of two leaves, 2 E b (t / L)^3."""
    target = '[[objective.targets]]\nmetric = "last(stiffness.stage.T.x)"\ntarget = "1 N/mm"\n'
    ranges, search = RANGES.partition("[vary.length]")[0], "[search]\ntolerance = 1e-8\n"
    found = pf.optimise(written(tmp_path, BASE, STRAIGHT, ranges, target, search), tmp_path / "out")
    assert found.values["thickness"] == pytest.approx(LENGTH * np.cbrt(1e3 / (2.0 * E * WIDTH)), rel=1e-3)
    assert found.units["last(stiffness.stage.T.x)"] == "N/m"


@pytest.mark.parametrize(
    ("metric", "message"),
    [
        ("max(abs(stage.T.q))", "unknown coordinate (got 'stage.T.q')"),
        ("max(abs(A.forc))", "unknown coordinate (got 'A.forc'); did you mean \"A.force\"?"),
        ("nope", "unknown metric (got 'nope'); choose from deflection_max,"),
        ("max(stiffness.stage.T.angle)", "unknown direction (got 'stage.T.angle')"),
        ("largest(stage.T.y)", "unknown function \"largest\" (got 'largest(stage.T.y)')"),
        ("max(abs(stage.T.y)", "no such expression of a metric (got 'max(abs(stage.T.y)')"),
        ("max(stage.T.y) + 1", "a sum of a quantity in m and a number without a unit (got 'max(stage.T.y) + 1')"),
        ("max(stage.T.y) + max(effort.stage.T.x)", "a sum of quantities in m and in N"),
        ("max(stage.T.y[0:1])", "equilibria have no time"),
    ],
)
def test_expressions_that_make_no_sense_are_refused(tmp_path, metric, message):
    ran = paraflex(
        "sweep", written(tmp_path, f'metrics = ["{metric}"]\n', BASE, VARIED, GIVEN), "--output", tmp_path / "o"
    )
    assert ran.returncode == 2
    assert message in ran.stderr


def test_a_thickness_is_identified_from_a_stiffness(tmp_path):
    wanted = 2.0 * E * WIDTH * (0.0006 / LENGTH) ** 3
    target = f'[[target]]\nmetric = "stiffness_min.stage.T.x"\nvalue = "{wanted / 1e3} N/mm"\n'
    ranges = RANGES.partition("[vary.length]")[0]
    found = pf.identify(written(tmp_path, BASE, STRAIGHT, ranges, target), tmp_path / "out")
    assert found.values["thickness"] == pytest.approx(0.0006, rel=1e-4)


def test_indices_tell_which_number_a_stiffness_depends_on(tmp_path):
    # (t / L)^3: with the same relative ranges both explain as much.
    ranges = RANGES.replace("0.3 mm", "0.45 mm").replace('"1 mm"', '"0.55 mm"').replace("80 mm", "90 mm")
    ranges = ranges.replace("120 mm", "110 mm")
    file = written(tmp_path, 'metrics = ["stiffness"]\n', BASE, STRAIGHT, ranges)
    found = pf.indices(file, tmp_path / "out", metrics=["stiffness.stage.T.x"], samples=32, workers=1)
    first, total = found.indices["first"].values[0], found.indices["total"].values[0]
    assert first == pytest.approx([0.5, 0.5], abs=0.15)
    assert total == pytest.approx([0.5, 0.5], abs=0.1)


def test_past_buckling_no_compliance_is_small(tmp_path):
    """Its stiffness is negative, and of the thinnest guide positive again: an optimum there would be of no use."""
    load = '[statics]\nloads = { "stage.T.y" = "-20 N" }\nmoved = {}\nsteps = 2\nstiffness = ["stage.T.x"]\n'
    thin = '[vary.thickness]\nfields = ["section.leaf.thickness"]\nvalues = ["0.15 mm", "0.3 mm", "0.46 mm"]\n'
    metrics = 'metrics = ["stiffness", "compliance", "compliance_max"]\n'
    ran = paraflex("sweep", written(tmp_path, metrics, BASE, load, thin), "--output", tmp_path / "out")
    assert ran.returncode == 0, ran.stderr
    table = pd.read_parquet(tmp_path / "out" / "results.parquet")
    stiffness = table["stiffness.stage.T.x"]
    assert np.sign(stiffness).tolist() == [1.0, -1.0, 1.0]
    for metric in ("compliance", "compliance_max"):
        assert np.isinf(table[f"{metric}.stage.T.x"]).tolist() == [True, True, False]
    assert table["compliance.stage.T.x"][2] == pytest.approx(1.0 / stiffness[2], rel=1e-12)


def test_designs_that_carry_less_than_what_is_given_fail_with_the_reason(tmp_path):
    (tmp_path / "arm.toml").write_text(library_text("pendulum"), encoding="utf-8")
    file = written(
        tmp_path, 'mechanism = "arm.toml"\nmetrics = ["travel"]\n',
        "[statics]\nloads = { pivot = 1.0 }\nheld = []\nsteps = 2\n",
        '[vary.torque]\nfields = ["statics.loads.pivot"]\nvalues = ["0.5 N m", "3 N m"]\n',
    )  # fmt: skip
    found = pf.sweep(file, tmp_path / "out")
    assert found.data["status"].values.tolist() == ["complete", "failed"]
    assert "no equilibrium beyond load factor" in found.data["reason"].values[1]


def test_a_study_may_have_all_of_the_statics_and_a_mechanism_a_path(tmp_path):
    file = written(
        tmp_path, 'mechanism = "five_bar"\nmetrics = ["stiffness", "effort"]\n',
        '[statics]\nloads = { "distal1.C.y" = "-5 N" }\nsteps = 1\n',
        '[vary.load]\nfields = ["statics.loads.distal1.C.y"]\nvalues = [-10.0]\n',
    )  # fmt: skip
    table = pf.sweep(file, tmp_path / "out").data.to_dataframe()
    assert set(table["path"]) == set(table["mode"]) == {""}
    found = pf.statics(pf.load("five_bar"), loads={"distal1.C.y": -10.0}, steps=1)
    assert table["effort.A1"].iloc[0] == pytest.approx(found.effort("A1")[-1], rel=1e-9)


def test_whole_equilibria_are_kept(tmp_path):
    study = load_sweep(written(tmp_path, "trajectories = true\nmetrics = ['travel']\n", BASE, GIVEN, VARIED))
    study.run(tmp_path / "out", limit=1)
    (first,) = (tmp_path / "out" / "trajectories").iterdir()
    assert pf.load_results(first).attrs["kind"] == "statics"


@pytest.mark.parametrize(
    ("more", "given", "field", "words"),
    [
        ('modes = ["++"]\n', GIVEN, "modes", "equilibria have none"),
        ("duration = 1.0\n", GIVEN, "duration", "equilibria have none"),
        ('metrics = ["tracking_rms"]\n', GIVEN, "metrics", "of runs along a path, not of statics"),
        ('metrics = ["travel"]\n', "", "metrics", "of statics, not of runs without a path"),
        ('metrics = ["travel.stage.T.x"]\n', GIVEN, "metrics", 'write "travel"'),
        ("", GIVEN.replace("stage.T.x", "stage.T.q"), "statics.moved.stage.T.q", "is neither a joint"),
        ("", GIVEN.replace("8 mm", "8 N"), "statics.moved.stage.T.x", "a quantity in N where one in m"),
        ("", GIVEN.replace("steps", "step"), "statics.step", "unknown field"),
        ("", "[statics]\nmoved = 3\n", "statics.moved", "should be a "),
        ("", GIVEN + "[vary.tol]\nfields = ['integration.tolerance']\nvalues = [1e-4]\n", "integration", "have none"),
    ],
)
def test_what_such_studies_do_not_have_is_refused(tmp_path, more, given, field, words):
    file = written(tmp_path, more, BASE, given, VARIED if "vary" not in given else "")
    if not given:
        file.write_text(more + BASE + VARIED.partition("[vary.weight]")[0])
    with pytest.raises(pf.InputError, match=words) as caught:
        load_sweep(file)
    assert caught.value.field == field
    assert str(file) == caught.value.source


def test_limits_of_metrics_are_in_the_unit_of_their_coordinate(tmp_path):
    limit = '[[objective.at_most]]\nmetric = "compliance.stage.T.x"\nvalue = "1 rad/N/m"\n'
    objective = f"[objective]\nminimise = {{ stress_max = 1.0 }}\n{limit}"
    with pytest.raises(pf.InputError, match=r"compliance\.stage\.T\.x in m/N"):
        pf.optimise(written(tmp_path, BASE, "[statics]\n", RANGES, objective), tmp_path / "out")


def test_derivatives_of_statics_are_refused_by_name(tmp_path):
    with pytest.raises(pf.InputError, match="not of statics"):
        pf.sensitivities(written(tmp_path, BASE, "[statics]\n", "[vary.thickness]\nfields = ['leaf.thickness']\n"))


def test_every_metric_of_statics_is_in_the_table(swept):
    columns = set(pd.read_parquet(swept / "results.parquet").columns)
    own = [metric for metric in METRICS.values() if STATICS in metric.runs]
    assert len(own) > 15
    assert {metric.name for metric in own} <= {column.partition(".")[0] for column in columns}
