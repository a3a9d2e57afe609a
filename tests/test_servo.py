"""Modes whose motors follow the planned motion: against rigid inverse dynamics, KED and the plan itself."""

import re
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.control.environment import Environment
from paraflex.dynamics import joint_coordinate
from paraflex.elastodynamics import simulate_ked
from paraflex.engines.mujoco import simulate_mujoco
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


def _following(*names):
    mechanism = pf.load("five_bar").mechanism
    return replace(
        mechanism,
        motors=tuple(replace(one, follows="plan" if one.name in names else None) for one in mechanism.motors),
    )


def test_motors_follow_by_themselves(task):
    """All motors by their own field are a servo mode; of two, the other gives its planned torque."""
    both, one = (task.remodelled(_following(*names)) for names in (("left", "right"), ("left",)))
    run, servo = (pf.simulate(*which, warning=False) for which in ((both, "++"), (task, "++ servo")))
    assert np.array_equal(run.solution.q, servo.solution.q)
    assert np.array_equal(run.applied, servo.applied)
    mixed = pf.simulate(one, "++", warning=False)
    planned = task.torques("++").evaluate(task.motion.t)
    assert np.array_equal(mixed.applied[:, 1], planned[:, 1])
    found = joint_coordinate(mixed.system, "A1", mixed.solution.q).value
    assert np.max(np.abs(found - joint_coordinate(task.motion.system, "A1", task.motion.q).value)) < 1e-5
    energy = np.max(mixed.solution.kinetic_energy + mixed.solution.strain_energy)
    assert mixed.solution.energy_balance_max < 1e-3 * energy


def test_a_rigid_mechanism_with_one_following_motor_stays_on_the_path(task):
    run = pf.simulate(task.remodelled(_following("left").rigid()), "++", warning=False)
    assert float(pf.tracking_dataset([run])["tracking_max"].item()) < 1e-5


def test_a_motor_that_follows_is_a_table_of_the_file(tmp_path):
    pf.load("five_bar").mechanism.save(tmp_path / "plain.toml")
    assert '[motor]\nleft = "A1"' in (tmp_path / "plain.toml").read_text(encoding="utf-8")
    changed = _following("left")
    changed.save(tmp_path / "one.toml")
    assert pf.load(tmp_path / "one.toml").mechanism.motors == changed.motors
    for wrong, message in (
        ('"path"', "motor.left.follows: should be 'plan' (got 'path')"),
        ("1", "motor.left.follows"),
    ):
        path = tmp_path / "wrong.toml"
        path.write_text((tmp_path / "one.toml").read_text(encoding="utf-8").replace('"plan"', wrong), encoding="utf-8")
        with pytest.raises(InputError, match=re.escape(message)):
            pf.load(path)


def test_a_motor_written_as_its_joint_alone_takes_the_field():
    model = pf.load("five_bar", set={"motor.left.follows": "plan"})
    assert model.mechanism.motors == _following("left").motors
    for field in ("body.proximal1.section.thickness", "name.x"):
        with pytest.raises(InputError, match=f"{re.escape(field)}: no such field in the model's file"):
            pf.load("five_bar", set={field: "1 mm"})


@pytest.mark.parametrize("wrong", ["path", 3, True])
def test_a_motor_follows_nothing_but_the_plan(wrong):
    with pytest.raises(InputError, match=r"motor.left.follows: unknown motion to follow .*plan"):
        pf.Motor("left", "A1", wrong)


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (
            lambda one: pf.simulate(one, "++", after="hold", warning=False),
            "study.after: motors that give torques cannot",
        ),
        (lambda one: simulate_mujoco(one, "++"), "motor.left.follows: MuJoCo needs given torques"),
        (lambda one: pf.simulate_motion(one.mechanism, 0.1, start="outward"), "a motion without a path needs given"),
        (lambda one: Environment(one), "a sampled controller needs given torques"),
    ],
)
def test_motors_that_follow_are_refused_by_name(task, act, message):
    with pytest.raises(InputError, match=re.escape(message)):
        act(task.remodelled(_following("left")))


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
    assert "the motors free, those that follow the plan held on it" in done.stdout
    assert "--mode '++ servo'" in (tmp_path / "report.html").read_text(encoding="utf-8").replace("&#x27;", "'")
