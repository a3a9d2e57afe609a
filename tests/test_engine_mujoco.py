"""MuJoCo on the same mechanisms, torques and start: another formulation, other code, the same motion."""

import dataclasses
import os
import signal
import sys
import threading

import numpy as np
import pytest

from conftest import make_five_bar
from paraflex.engines import check_engine
from paraflex.engines.exudyn import simulate_exudyn
from paraflex.engines.mujoco import MuJoCoOptions, simulate_mujoco
from paraflex.engines.tree import spanning_tree
from paraflex.errors import InputError, IntegrationError
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    AppliedTorque,
    FlexibleBeam,
    LumpedMass,
    Material,
    Motor,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    SampledAngle,
    Section,
    TorsionalDamper,
    TorsionalSpring,
    finite_segments,
    raparm_i,
)
from paraflex.paths import Line
from paraflex.results import tracking_dataset
from paraflex.results.record import record
from paraflex.tracking import plan_tracking
from records import values

PAPER = {f"link{i}": 4 if i in (2, 6) else 8 for i in range(1, 9)}


def soft_five_bar():
    """Flexible and rigid links, centres of mass off the line, joints named from either side, a motor at an elbow."""
    mechanism = make_five_bar()
    beam = FlexibleBeam(
        "distal1", 0.25, Section.rectangle(0.02, 0.004), Material(3e9, 1200.0), {"B1": 0.0, "C": 0.25, "mid": 0.1},
        lumps=(LumpedMass("mid", 0.05, 1e-5),),
    )  # fmt: skip
    rigid = dataclasses.replace(mechanism.body("proximal2"), centre_of_mass=(0.1, 0.03))
    joints = {joint.name: joint for joint in mechanism.joints}
    for name in ("A2", "B1"):
        joints[name] = RevoluteJoint(name, joints[name].b, joints[name].a)
    return dataclasses.replace(
        mechanism.with_bodies([beam, rigid]),
        joints=tuple(joints.values()),
        motors=(*mechanism.motors, Motor("elbow", "B1"), Motor("other", "B2")),
    )


@pytest.fixture(scope="module")
def task():
    path = Line((0.0, 0.30), (0.04, 0.27), 20.0)
    return plan_tracking(soft_five_bar(), path, duration=0.12, samples=25).in_segments(5)


@pytest.fixture(scope="module")
def ours(task):
    return record(task.simulate("++++", options=IntegrationOptions(tolerance=1e-9)))


@pytest.fixture(scope="module")
def theirs(task):
    return simulate_mujoco(task, "++++", MuJoCoOptions(step=2e-5))


@pytest.mark.parametrize(
    ("what", "within"),
    # Of the largest change. At 1e-8 m ours differ from these by ten times as much as at 1e-9 m: the limit is ours.
    [
        ("point_position", 1e-7),
        ("angle", 1e-6),
        ("chord_angle", 1e-6),
        ("angular_velocity", 1e-4),
        ("chord_velocity", 1e-4),
        ("angular_acceleration", 1e-3),
        ("tip", 1e-5),
        ("kinetic_energy", 1e-6),
        ("strain_energy", 1e-5),
        ("work", 1e-6),
    ],
)
def test_everything_moves_as_ours_does(ours, theirs, what, within):
    a, b = (values(run, what) for run in (ours, theirs))
    np.testing.assert_allclose(a, b, rtol=0, atol=within * np.ptp(a))


def test_the_end_effector_moves_as_ours_does(ours, theirs):
    for name, within in (("position", 1e-7), ("velocity", 1e-5), ("acceleration", 1e-3)):
        a, b = getattr(ours.end_effector, name), getattr(theirs.end_effector, name)
        np.testing.assert_allclose(a, b, rtol=0, atol=within * np.ptp(a))


def test_the_run_tells_how_well_it_went(theirs):
    assert theirs.figures["energy_balance_max"] < 1e-6 * theirs.links["kinetic_energy"].max()
    assert theirs.figures["constraint_position_max"] < 1e-7
    assert theirs.figures["status"] == "complete"


def test_records_of_both_make_datasets_of_one_shape(ours, theirs):
    a, b = tracking_dataset([ours]), tracking_dataset([theirs])
    assert dict(a.sizes) == dict(b.sizes)
    # How far forces may be off is known of our own error control alone.
    assert set(a.data_vars) - {"joint_force_error", "joint_moment_error"} == set(b.data_vars)
    assert b.attrs["method"].startswith("MuJoCo")
    assert np.isnan(b["joint_force"]).all()
    assert float(b["tracking_rms"][0]) == pytest.approx(float(a["tracking_rms"][0]), rel=1e-3)


def test_raparm_in_56_segments_agrees_to_a_thousandth_of_the_deflection(square):
    task = plan_tracking(raparm_i(), square, duration=0.05, samples=11).in_segments(PAPER)
    ours = record(task.simulate("++++", options=IntegrationOptions(tolerance=1e-6))).end_effector.position
    theirs = simulate_mujoco(task, "++++").end_effector.position
    deflection = np.linalg.norm(ours - task.motion.desired.position, axis=1).max()
    assert np.linalg.norm(ours - theirs, axis=1).max() < 1e-3 * deflection


def test_the_tree_leaves_loops_to_joints_without_springs():
    mechanism = finite_segments(raparm_i(), PAPER).mechanism
    tree = spanning_tree(mechanism)
    assert len(tree.links) == 56
    assert len(tree.closing) == 3
    sprung = {spring.joint for spring in mechanism.springs}
    assert sprung <= {link.joint.name for link in tree.links}
    assert {motor.joint for motor in mechanism.motors} <= {link.joint.name for link in tree.links}


def test_too_large_a_step_is_an_error_and_what_was_computed_is_kept(task, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(IntegrationError, match=r"MuJoCo diverges with steps of 0\.005 s at t = ") as caught:
        simulate_mujoco(task, "++++", MuJoCoOptions(step=5e-3))
    partial = caught.value.partial
    assert partial.figures["status"] == "failed"
    assert np.isfinite(partial.links["angle"]).all()
    assert np.isnan(tracking_dataset([partial])["tracking_rms"][0])
    assert list(tmp_path.iterdir()) == []  # MuJoCo's own log file among them


def test_a_prescribed_angle_is_refused_by_name(task):
    still = SampledAngle(np.zeros_like, np.zeros_like, np.zeros_like)
    held = dataclasses.replace(task.mechanism, prescribed=(PrescribedAngle("clamp", "B2", still),))
    with pytest.raises(InputError, match=r"prescribed\.clamp: MuJoCo cannot express a prescribed angle"):
        simulate_mujoco(dataclasses.replace(task, mechanism=held), "++++")


@pytest.mark.parametrize("simulate", [simulate_mujoco, simulate_exudyn], ids=["mujoco", "exudyn"])
def test_weight_bends_a_mechanism_alike(simulate):
    path = Line((0.0, 0.30), (0.04, 0.27), 20.0)
    mechanism = dataclasses.replace(soft_five_bar(), gravity=(2.0, -9.81)).with_geometry("second-order")
    task = plan_tracking(mechanism, path, duration=0.12, samples=25)
    model = task.in_segments(5) if simulate is simulate_mujoco else task.remodelled(mechanism.refined(2))
    theirs = simulate(model, "++--")
    ours = record(model.simulate("++--", options=IntegrationOptions(tolerance=2e-6)))
    deflection = np.abs(values(ours, "tip")).max()
    light = plan_tracking(soft_five_bar(), path, duration=0.12, samples=25)
    assert np.abs(deflection / np.abs(values(record(light.simulate("++--")), "tip")).max() - 1.0) > 0.1
    np.testing.assert_allclose(theirs.end_effector.position, ours.end_effector.position, rtol=0, atol=3e-3 * deflection)
    # Weights do work on the way, and the torques carry them.
    work, theirs_work = ours.links["work"], theirs.links["work"]
    assert np.abs(theirs_work - work).max() < 2e-3 * np.ptp(work)
    assert theirs.figures["energy_balance_max"] < 2e-3 * np.ptp(work)


@pytest.mark.parametrize("engine", ["mujoco", "exudyn"])
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"dampers": (TorsionalDamper("oil", "B1", 0.1),)}, r"damper\.oil: \w+ cannot express a damper"),
        ({"loads": (AppliedTorque("drag", PointRef("distal1", "C"), 1.0),)}, r"load\.drag: \w+ cannot express a load"),
    ],
)
def test_what_an_adapter_has_not_is_refused_by_name(engine, changes, says):
    with pytest.raises(InputError, match=says):
        check_engine(engine, dataclasses.replace(soft_five_bar(), **changes))


def test_springs_all_round_a_loop_are_too_many_for_a_tree():
    springs = tuple(TorsionalSpring(name, name, 1.0) for name in ("A1", "A2", "B1", "B2", "C"))
    with pytest.raises(InputError, match=r"spring\.C: MuJoCo cannot express a spring where a loop closes"):
        check_engine("mujoco", dataclasses.replace(soft_five_bar(), springs=springs))
    check_engine("exudyn", dataclasses.replace(soft_five_bar(), springs=springs))


def test_an_engine_that_is_not_installed_names_the_extra(task, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InputError, match=r"engine: not installed \(got 'mujoco'\); .*paraflex\[engines\]"):
        simulate_mujoco(task, "++++")


def test_a_step_that_is_none_is_refused(task):
    with pytest.raises(InputError, match="step: must be positive"):
        simulate_mujoco(task, "++++", MuJoCoOptions(step=0.0))


def test_bodies_off_the_ground_are_named():
    mechanism = raparm_i()
    adrift = dataclasses.replace(mechanism.body("link1"), name="stray")
    loose = object.__new__(type(mechanism))
    loose.__dict__.update(mechanism.__dict__ | {"bodies": (*mechanism.bodies, adrift)})
    with pytest.raises(InputError, match=r"body\.stray: nothing joins it to the ground"):
        spanning_tree(loose)


def test_a_joint_may_name_the_ground_second():
    tree = spanning_tree(soft_five_bar())
    link = next(link for link in tree.links if link.name == "proximal2")
    assert (link.sign, link.own, link.parent) == (-1.0, PointRef("proximal2", "A2"), "ground")


def test_ctrl_c_in_the_middle_is_no_divergence(raparm, square):
    task = plan_tracking(raparm, square, duration=0.7, samples=71)
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            simulate_mujoco(task, "++++", MuJoCoOptions(step=1e-5))
    finally:
        timer.cancel()


def test_by_default_segments_are_of_one_length(square):
    """Eight on every link of RAParM-I would make those of its short ones too stiff for the default step."""
    task = plan_tracking(raparm_i(), square, duration=0.01, samples=3)
    assert simulate_mujoco(task, "++++").figures["status"] == "complete"
