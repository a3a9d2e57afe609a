"""Modes whose motors follow the planned motion: against rigid inverse dynamics, KED and the plan itself."""

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.dynamics import joint_coordinate
from paraflex.elastodynamics import simulate_ked
from paraflex.errors import InputError
from paraflex.mechanism import RayleighDamping
from paraflex.mechanism.actuation_modes import following, parse_mode
from shell import paraflex


@pytest.fixture(scope="module")
def task():
    return pf.plan(pf.load("five_bar"), warning=False)


def test_rigid_links_need_the_planned_torques(task):
    rigid = task.remodelled(task.mechanism.rigid())
    run = pf.simulate(rigid, "++ servo", warning=False)
    planned = task.torques("++").evaluate(task.motion.t)
    # The torque jumps at the corners of the path, where samples lie on either side.
    smooth = np.min(np.abs(task.motion.t[:, None] - task.torques("++").knots), axis=1) > 1e-6
    off = np.abs(run.applied - planned)[smooth]
    assert np.max(off) < 1e-4 * np.max(np.abs(planned))
    assert float(pf.tracking_dataset([run])["tracking_max"].item()) < 1e-6


def test_motors_hold_their_joints_on_the_plan(task):
    run, rigid = pf.simulate(task, "++ servo", warning=False), task.motion
    for motor in task.mechanism.motors:
        found = joint_coordinate(run.system, motor.joint, run.solution.q).value
        planned = joint_coordinate(rigid.system, motor.joint, rigid.q).value
        # Half the tolerance of the integration over the length of a link.
        assert np.max(np.abs(found - planned)) < 1e-5
    assert run.solution.status == "complete"
    energy = np.max(run.solution.kinetic_energy + run.solution.strain_energy)
    assert run.solution.energy_balance_max < 1e-3 * energy


def test_stiff_links_deflect_as_in_kineto_elastodynamics():
    stiff = pf.load("five_bar", set={"section.bar.thickness": "20 mm"})
    task = pf.plan(stiff.mechanism.with_geometry("linear"), next(iter(stiff.paths.values())), warning=False)
    run, ked = pf.simulate(task, "++ servo", warning=False), simulate_ked(task, "++", step=2e-5)
    one, other = (pf.tracking_dataset([each])["end_effector"].squeeze().values for each in (run, ked))
    missed = np.max(np.linalg.norm(other - task.motion.desired.position, axis=1))
    assert np.max(np.linalg.norm(one - other, axis=1)) < 0.06 * missed
    assert missed > 5e-4


def test_finite_segments_converge_to_the_beams_with_the_second_power():
    """Links clamped at their motors bend in the half segment beside these, too; damped, so that phases agree."""
    model = pf.load("five_bar", set={"section.bar.thickness": "20 mm"})
    damped = [replace(one, damping=RayleighDamping(0.0, 2e-3)) for one in model.mechanism.bodies]
    task = pf.plan(model.mechanism.with_bodies(damped), model.paths["line"], duration=0.4, samples=201, warning=False)
    beams = pf.simulate(task, "++ servo", warning=False).end_effector.position
    missed = np.max(np.linalg.norm(beams - task.motion.desired.position, axis=1))
    off = [
        np.max(np.linalg.norm(
            pf.simulate(task.in_segments(n), "++ servo", warning=False).end_effector.position - beams, axis=1
        )) / missed
        for n in (4, 8)
    ]  # fmt: skip
    assert off[1] < 0.08
    assert off[0] / off[1] > 2.8


def test_the_motors_of_a_mode_may_be_fewer_than_there_are():
    model = pf.load("raparm_i")
    task = pf.plan(model.mechanism, model.paths["square"], duration=0.05, samples=51, warning=False)
    run = pf.simulate(task, "+-+- servo", warning=False)
    assert not run.applied[:, [1, 3]].any()
    assert run.applied[:, [0, 2]].any()


def test_modes_are_named_by_a_word():
    mechanism = pf.load("five_bar").mechanism
    mode = parse_mode(mechanism, "left,right servo")
    assert (mode.name, mode.motors, mode.follows) == ("++ servo", ("left", "right"), True)
    assert following(mode) is mode
    assert parse_mode(mechanism, "++") == replace(mode, name="++", follows=False)
    for wrong in ("servo", "++ follow", "+ servo", "++servo", "++ servo servo"):
        with pytest.raises(InputError, match="not an actuation mode"):
            parse_mode(mechanism, wrong)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["linearise", "five_bar", "--mode", "++ servo"], "a linear model needs given torques"),
        (["run", "pendulum", "--servo"], "--servo: the model has no path to prescribe"),
        (["run", "five_bar", "--ked", "--servo"], "--servo: has no effect with --ked"),
        (["run", "five_bar", "--servo", "--reduced", "auto"], "the choice of few coordinates needs given torques"),
        (["verify", "five_bar", "--mode", "++ servo", "--engine", "mujoco"], "MuJoCo needs given torques"),
    ],
)
def test_what_needs_torques_refuses(words, message, tmp_path):
    done = paraflex(*words, "--out", tmp_path / "out", "--no-figures", "--no-report")
    assert message in done.stderr, done.stdout


def test_runs_show_both_side_by_side(tmp_path):
    done = paraflex("run", "five_bar", "--servo", "--duration", "0.5", "--out", tmp_path, "--no-figures")
    assert done.returncode == 0, done.stderr
    assert list(pf.load_results(tmp_path)["mode"].values) == ["++", "++ servo"]
    assert "the motors free, of servo modes held on the plan" in done.stdout
    assert "--mode '++ servo'" in (tmp_path / "report.html").read_text(encoding="utf-8").replace("&#x27;", "'")
