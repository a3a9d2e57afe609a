"""Runs without a path: in Python, as a dataset, on the command line."""

import json
import re

import numpy as np
import pytest
import scipy.special

import paraflex as pf
from paraflex import plots
from paraflex.errors import InputError, IntegrationError
from paraflex.files import library_file, load
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    Assembly,
    ConstantSpeed,
    Mechanism,
    Motor,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    RigidBody,
    TorsionalDamper,
)
from paraflex.motion import simulate_motion
from paraflex.reports import motion_page
from paraflex.results import load_results, motion_dataset, motion_summary, open_results, save_results
from shell import paraflex
from test_loads import INERTIA, MASS, REACH, G, pendulum

J = INERTIA + MASS * REACH**2


def test_a_pendulum_let_go_swings_for_the_period_of_the_elliptic_integral():
    mechanism = pendulum(gravity=(0.0, -G), assemblies=(Assembly("start", {"arm": -np.pi / 2 + 2.0}),))
    period = 4.0 * scipy.special.ellipk(np.sin(1.0) ** 2) / np.sqrt(MASS * G * REACH / J)
    run = simulate_motion(mechanism, period, samples=5, options=IntegrationOptions(tolerance=1e-6))
    np.testing.assert_allclose(run.solution.q[:, 2] + np.pi / 2, [2, 0, -2, 0, 2], rtol=0, atol=3e-5)


def test_constant_torques_turn_what_their_motors_drive():
    mechanism = pendulum(motors=(Motor("drive", "pin"), Motor("idle", "pin")))
    run = simulate_motion(mechanism, 0.5, samples=3, torques={"drive": 0.7})
    np.testing.assert_allclose(run.solution.q[:, 2] - 0.5, 0.5 * 0.7 / J * run.times**2, rtol=0, atol=1e-6)
    assert run.torques == {"drive": 0.7, "idle": 0.0}
    assert run.solution.work[-1] == pytest.approx(0.7 * (run.solution.q[-1, 2] - 0.5), rel=1e-5)


def test_a_dataset_names_coordinates_points_forces_and_torques():
    mechanism = pendulum(gravity=(0.0, -G), dampers=(TorsionalDamper("oil", "pin", 0.1),))
    run = simulate_motion(mechanism, 0.4, samples=401, options=IntegrationOptions(tolerance=1e-6))
    data = motion_dataset(run)
    assert list(data["coordinate"].values) == ["arm.x", "arm.y", "arm.phi"]
    np.testing.assert_array_equal(data["coordinate_value"].sel(coordinate="arm.phi"), data["angle"].sel(body="arm"))
    rates = {"point_position": "point_velocity", "point_velocity": "point_acceleration", "angle": "angular_velocity"}
    for value, rate in rates.items():
        numeric = np.gradient(data[value].values, data["time"].values, axis=0)[2:-2]
        # Differences leave the third derivative times the square of the spacing.
        within = 2e-3 if rate == "point_acceleration" else 1e-3
        np.testing.assert_allclose(numeric, data[rate].values[2:-2], rtol=0, atol=within)
    # The pin carries the weight and what turns the centre of mass: m (a - g).
    phi, w, dw = (data[name].sel(body="arm").values for name in ("angle", "angular_velocity", "angular_acceleration"))
    arm = REACH * np.column_stack([np.cos(phi), np.sin(phi)])
    across = np.column_stack([-arm[:, 1], arm[:, 0]])
    carried = MASS * (dw[:, None] * across - w[:, None] ** 2 * arm + [0.0, G])
    np.testing.assert_allclose(data["joint_force"].sel(joint="pin"), carried, rtol=0, atol=0.02)
    np.testing.assert_allclose(data["multiplier"].sel(row="oil angle"), 0.1 * w, rtol=0, atol=1e-3)
    assert all(data[name].attrs["units"] for name in data.data_vars if name not in ("status", "message"))
    summary = motion_summary(data)
    assert summary["final"]["angle"]["arm"] == phi[-1]
    json.dumps(summary, allow_nan=False)


def test_a_driven_crank_turns_a_linkage(tmp_path):
    """A four-bar with its crank at constant speed: rocker angles from the closed form of the loop."""

    def bar(name, length, a, b):
        return RigidBody(name, 0.2, 1e-3, (length / 2, 0.0), {a: (0.0, 0.0), b: (length, 0.0)})

    mechanism = Mechanism(
        "four-bar",
        {"O": (0.0, 0.0), "Q": (0.4, 0.0)},
        (bar("crank", 0.1, "O", "A"), bar("coupler", 0.35, "A", "B"), bar("rocker", 0.25, "Q", "B")),
        (
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "O")),
            RevoluteJoint("A", PointRef("crank", "A"), PointRef("coupler", "A")),
            RevoluteJoint("B", PointRef("coupler", "B"), PointRef("rocker", "B")),
            RevoluteJoint("Q", PointRef("ground", "Q"), PointRef("rocker", "Q")),
        ),
        prescribed=(PrescribedAngle("drive", "O", ConstantSpeed(1.0, 20.0)),),
        assemblies=(Assembly("open", {"crank": 1.0, "coupler": 0.4, "rocker": 1.6}),),
    )
    run = simulate_motion(mechanism, 0.5, samples=26, options=IntegrationOptions(tolerance=1e-6))
    A = 0.1 * np.column_stack([np.cos(1.0 + 20.0 * run.times), np.sin(1.0 + 20.0 * run.times)])
    line = A - [0.4, 0.0]
    d = np.linalg.norm(line, axis=1)
    rocker = np.arctan2(line[:, 1], line[:, 0]) - np.arccos((0.25**2 + d**2 - 0.35**2) / (2 * 0.25 * d))
    found = run.solution.q[:, run.system.body("rocker").angle]
    np.testing.assert_allclose((found - rocker + np.pi) % (2 * np.pi) - np.pi, 0.0, rtol=0, atol=1e-5)
    data = motion_dataset(run)
    save_results(data, tmp_path / "results.nc")
    assert load_results(tmp_path / "results.nc")["angle"].equals(data["angle"])
    assert len(plots.motion_overview(data).axes) == 3


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
def test_a_mechanism_that_starts_moving_is_not_struck(geometry):
    """The crank turns from the first instant: links move with it, unbent, and nothing rings at high frequency."""
    mechanism = load("four_bar").mechanism.with_geometry(geometry)
    run = simulate_motion(mechanism, 0.1, samples=11)
    rigid = simulate_motion(mechanism.rigid(), 0.1, samples=11, options=IntegrationOptions(tolerance=1e-6))
    for name in ("coupler", "rocker"):
        body = run.system.body(name)
        assert np.abs(run.solution.v[0, body.flexible]).max() < 1e-6
        expected = rigid.solution.v[0, rigid.system.body(name).angle]
        assert run.solution.v[0, body.angle] == pytest.approx(expected, rel=1e-6)
    assert run.solution.steps < 2000


def test_a_run_that_stops_keeps_what_there_is():
    with pytest.raises(IntegrationError) as caught:
        simulate_motion(pendulum(gravity=(0.0, -G)), 5.0, options=IntegrationOptions(tolerance=1e-8, max_steps=300))
    data = motion_dataset(caught.value.partial)
    assert data["status"].item() == "failed"
    assert 0 < int(data["angle"].notnull().sum()) < data.sizes["time"]
    final = motion_summary(data)["final"]
    solution = caught.value.partial.solution
    assert final["time"] == solution.t[-1] <= caught.value.moment.time
    assert final["angle"]["arm"] == data["angle"].sel(body="arm", time=final["time"]).item()


def test_a_run_that_fails_names_one_time_at_which_it_did(tmp_path):
    done = paraflex("run", "pendulum", "--duration", "1", "--max-steps", "30", "--out", str(tmp_path))
    assert done.returncode == 1
    failed = re.findall(r"at t = (\S+) s", done.stderr)
    assert len(failed) == 1
    assert re.search(
        r"^flexible pendulum: failed, 30 steps; the last sample is t = (\S+) s$", done.stdout, re.MULTILINE
    )
    last = json.loads((tmp_path / "summary.json").read_text())["final"]["time"]
    assert last <= float(failed[0]) < 1.0
    assert f"failed at t = {failed[0]} s" not in done.stdout
    tile = motion_page(open_results(tmp_path)).figures[0]
    assert tile[:2] == ("status", "failed")
    assert tile[2].startswith(f"last sample t = {last:.4g} s, ")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"duration": 0.0}, "duration: must be positive"),
        ({"samples": 1}, "samples: too few samples"),
        ({"torques": {"drvie": 1.0}}, r"torques: unknown motor \(got 'drvie'\); did you mean \"drive\""),
        ({"torques": {"drive": np.inf}}, "torques.drive: not a finite number"),
        ({"start": "folded"}, "assembly: unknown assembly"),
    ],
)
def test_what_makes_no_sense_is_named(changes, says):
    arguments = {"duration": 1.0} | changes
    with pytest.raises(InputError, match=says):
        simulate_motion(pendulum(motors=(Motor("drive", "pin"),)), **arguments)


# --- The command line ---------------------------------------------------------------------------------------------


def test_the_library_pendulum_runs_from_the_command_line(tmp_path):
    done = paraflex("run", "-m", "pendulum", "--duration", "0.5", "--samples", "51", "--out", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    assert "flexible pendulum: complete at t = 0.5 s" in done.stdout
    assert "beam.tip: (" in done.stdout
    assert sorted(entry.name for entry in (tmp_path / "out").iterdir()) == [
        ".lock",
        "figures",
        "manifest.json",
        "report.html",
        "results.nc",
        "summary.json",
    ]
    data = load_results(tmp_path / "out" / "results.nc")
    assert data.sizes["time"] == 51
    assert data.sizes["coordinate"] == 16
    # Let go from the horizontal it falls.
    tip = data["point_position"].sel(point="beam.tip", axis="y")
    assert float(tip[-1]) < -0.5
    # Energy: weight has done what the bob has gained, but for the bearing.
    gained = data["kinetic_energy"] + data["strain_energy"] - data["work"]
    assert float(np.abs(gained).max()) < 1e-3 * float(data["kinetic_energy"].max())


def test_finite_segments_of_it_swing_alike(tmp_path):
    ends = []
    for extra in ((), ("--segments", "12")):
        done = paraflex("run", "-m", "pendulum", "--tol", "1e-5", "--duration", "0.5", "--json", *extra,
                        "--out", str(tmp_path))  # fmt: skip
        points = json.loads(done.stdout)["final"]["point_position"]
        ends.append(points["beam.tip"])
    # A beam without stretch, hinged twelve times, swung through 90 degrees.
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-3)


def test_balanced_it_hangs_still(tmp_path):
    source = library_file("pendulum").read_text(encoding="utf-8").replace("beam = 0.0 }", "beam = -1.2 }")
    file = tmp_path / "low.toml"
    file.write_text(source)
    done = paraflex("run", "-m", str(file), "--balanced", "--duration", "0.5", "--json", "--out", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["final"]["angle"]["beam"] == pytest.approx(-np.pi / 2, abs=1e-9)


def test_a_path_may_start_from_equilibrium(tmp_path):
    source = library_file("five_bar").read_text(encoding="utf-8").replace("\n[", "\ngravity = [0.0, -9.81]\n[", 1)
    file = tmp_path / "heavy.toml"
    file.write_text(source)
    steps = {}
    for extra in ([], ["--balanced"]):
        done = paraflex("run", "-m", str(file), *extra, "--duration", "0.1", "--samples", "11", "--json",
                        "--no-figures", "--out", str(tmp_path / "out"))  # fmt: skip
        assert done.returncode == 0, done.stderr
        summary = json.loads(done.stdout)
        steps[bool(extra)] = summary["modes"]["++"]["steps"]
        assert summary["parameters"]["run"]["balanced"] is bool(extra)
    assert steps[True] < steps[False]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ["--mode", "++"],
            "--mode: a model without a path has no actuation modes, its torques are given (got '++')",
        ),
        (["--ked"], "--ked: the model has no path to prescribe"),
        (["--path", "square"], "pendulum.toml: path: unknown path (got 'square'); there is none to choose from"),
        (["--duration", "-1"], "--duration: must be positive (got -1.0)"),
        (["--assembly", "up"], "--assembly: unknown assembly (got 'up')"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, arguments, says):
    done = paraflex("run", "-m", "pendulum", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


SHORT = """
name = "arm"
gravity = [0.0, -9.81]
[ground]
O = [0.0, 0.0]
[body.arm]
type = "rigid"
mass = 1.0
inertia = 0.1
points = { O = [-0.5, 0.0] }
[joint]
pin = ["ground.O", "arm.O"]
[motor]
drive = "pin"
[assembly]
start = { arm = 0.0 }
[study]
torques = { drive = 4.905 }
"""


def test_torques_of_a_file_hold_an_arm_level(tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text(SHORT)
    assert load(file).study.torques == {"drive": 4.905}
    assert abs(simulate_motion(load(file), 1.0, samples=3).solution.q[-1, 2]) < 1e-9
    assert simulate_motion(load(file), 1.0, samples=3, torques={}).solution.q[-1, 2] < -1.0
    done = paraflex("run", "-m", str(file), "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert "--duration: the model has no path, and its run has no duration" in done.stderr
    done = paraflex("run", "-m", str(file), "--duration", "1", "--json", "--out", str(tmp_path / "out"))
    assert abs(json.loads(done.stdout)["final"]["angle"]["arm"]) < 1e-9
    file.write_text(SHORT.replace("drive = 4.905", "drvie = 4.905"))
    done = paraflex("run", "-m", str(file), "--duration", "1", "--out", str(tmp_path / "out"))
    assert "study.torques: unknown motor (got 'drvie'); did you mean \"drive\"?" in done.stderr


def test_loops_that_do_not_close_are_said_so_with_the_gap(tmp_path):
    text = SHORT.replace('pin = ["ground.O", "arm.O"]', 'pin = ["ground.O", "arm.O"]\nfar = ["ground.P", "arm.O"]')
    file = tmp_path / "broken.toml"
    file.write_text(text.replace("O = [0.0, 0.0]\n[body", "O = [0.0, 0.0]\nP = [0.2, 0.0]\n[body"))
    done = paraflex("run", "-m", str(file), "--duration", "1", "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert f"{file}: assembly: the loops do not close: a gap of 0.2 m remains in far" in done.stderr
    assert not (tmp_path / "out").exists()


def test_datasets_name_the_options_of_their_run():
    """They named those of the model, or the default, unless they were told once more."""
    options = pf.IntegrationOptions(method="esdirk4", tolerance=1e-6, alpha=7.0)
    motion = pf.motion_dataset(pf.simulate_motion(pf.load("pendulum"), 0.1, samples=5, warning=False, options=options))
    task = pf.plan(pf.load("five_bar"), duration=0.01, samples=5)
    tracking = pf.tracking_dataset([task.simulate("++", warning=False, options=options)])
    for data in (motion, tracking):
        found = [data.attrs[name] for name in ("integration_method", "tolerance", "baumgarte_alpha")]
        assert found == ["esdirk4", 1e-6, 7.0]
