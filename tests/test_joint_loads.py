"""Forces and moments in joints: which body they act on, positive which way, and nothing left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate

import twins
from conftest import RUBBER
from paraflex.dynamics import State, build_system, consistent_state, static_equilibrium
from paraflex.fem import ReferenceCondition
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    Assembly,
    FlexibleBeam,
    Geometry,
    JointFriction,
    LinearSpring,
    Mechanism,
    Motor,
    PointForce,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SampledAngle,
    Section,
    TorsionalDamper,
    TorsionalSpring,
    WeldJoint,
)
from paraflex.motion import simulate_motion
from paraflex.results import motion_dataset, tracking_dataset
from paraflex.tracking import simulate
from test_axes import sliders_put_together

G, MASS, REACH = 9.81, 2.0, 0.3


def ref(text):
    return PointRef.parse(text)


def single(joint, angle=0.0, **keywords):
    """One rigid body on one joint to the ground at O, its mass 0.3 m along its x axis."""
    arm = RigidBody("arm", MASS, 0.01, (REACH, 0.0), {"P": (0.0, 0.0), "tip": (REACH, 0.0)})
    return Mechanism(
        name="single",
        ground={"O": (0.1, 0.2)},
        bodies=(arm,),
        joints=(joint,),
        assemblies=(Assembly("start", {"arm": angle}),),
        gravity=(0.0, -G),
        **keywords,
    )


def at_start(mechanism, torques=None):
    """Force and moment in the joint at the start of a run."""
    data = motion_dataset(simulate_motion(mechanism, 1e-3, samples=2, torques=torques)).isel(time=0, joint=0)
    return data["joint_force"].values, data["joint_moment"].item()


def test_a_weight_hangs_on_its_pin():
    # Straight down, at rest: the pin pulls it up.
    force, moment = at_start(single(RevoluteJoint("pin", ref("ground.O"), ref("arm.P")), angle=-np.pi / 2))
    np.testing.assert_allclose(force, (0.0, MASS * G), atol=1e-9)
    assert moment == 0.0
    # With the ground as the joint's second body: the weight pulls it down.
    force, _ = at_start(single(RevoluteJoint("pin", ref("arm.P"), ref("ground.O")), angle=-np.pi / 2))
    np.testing.assert_allclose(force, (0.0, -MASS * G), atol=1e-9)


def test_a_weld_holds_an_arm_up_anticlockwise():
    force, moment = at_start(single(WeldJoint("clamp", ref("ground.O"), ref("arm.P"))))
    np.testing.assert_allclose(force, (0.0, MASS * G), atol=1e-9)
    assert moment == pytest.approx(MASS * G * REACH)
    _, moment = at_start(single(WeldJoint("clamp", ref("arm.P"), ref("ground.O"))))
    # On the ground, about O.
    assert moment == pytest.approx(-MASS * G * REACH)


def test_a_motor_or_a_spring_that_holds_an_arm_is_a_moment_of_its_joint():
    pin = RevoluteJoint("pin", ref("ground.O"), ref("arm.P"))
    hold = MASS * G * REACH
    force, moment = at_start(single(pin, motors=(Motor("hold", "pin"),)), {"hold": hold})
    np.testing.assert_allclose(force, (0.0, MASS * G), atol=1e-9)
    assert moment == pytest.approx(hold)
    # A spring wound back by 0.1 rad against its rest pulls anticlockwise.
    _, moment = at_start(single(pin, springs=(TorsionalSpring("coil", "pin", hold / 0.1, 0.1),)))
    assert moment == pytest.approx(hold)
    still = SampledAngle(lambda t: 0.0 * t, lambda t: 0.0 * t, lambda t: 0.0 * t)
    _, moment = at_start(single(pin, prescribed=(PrescribedAngle("law", "pin", still),)))
    assert moment == pytest.approx(hold)


def test_a_spring_along_a_rail_pushes_its_slider():
    # Its rest is 0.04 m further along x: it pushes that way, as hard as a weight of 200 N/m times that.
    rail = PrismaticJoint("rail", ref("ground.O"), ref("arm.P"))
    force, moment = at_start(single(rail, springs=(TorsionalSpring("coil", "rail", 200.0, 0.04),)))
    np.testing.assert_allclose(force, (8.0, MASS * G), atol=1e-9)
    # The weight is beyond the slider's point.
    assert moment == pytest.approx(MASS * G * REACH)


def test_a_motor_on_a_rail_against_a_load():
    rail = PrismaticJoint("rail", ref("ground.O"), ref("arm.P"), direction=np.pi / 2, angle=0.0)
    mechanism = single(rail, motors=(Motor("lift", "rail"),), loads=(PointForce("wind", ref("arm.tip"), (3.0, 0.0)),))
    force, _ = at_start(mechanism, {"lift": MASS * G})
    np.testing.assert_allclose(force, (-3.0, MASS * G), atol=1e-9)


def test_damper_and_friction_along_a_rail_brake_its_slider():
    rail = PrismaticJoint("rail", ref("ground.O"), ref("arm.P"))
    mechanism = single(
        rail, dampers=(TorsionalDamper("oil", "rail", 7.0),), frictions=(JointFriction("dry", "rail", 4.0, 0.1),)
    )
    system = build_system(mechanism)
    q, v = np.array([0.1, 0.2, 0.0]), np.array([0.5, 0.0, 0.0])
    run = simulate_motion(mechanism, 1e-3, samples=2, start=State(0.0, q, v))
    force = motion_dataset(run)["joint_force"].isel(time=0, joint=0)
    assert system.n == 3
    np.testing.assert_allclose(force, (-7.0 * 0.5 - 4.0 * np.tanh(5.0), MASS * G), atol=1e-9)


@pytest.mark.parametrize("geometry", list(Geometry))
def test_joint_loads_are_all_that_moves_rigid_bodies(geometry):
    """Newton's and Euler's laws for every rigid body in a mechanism with one of everything that slides."""
    mechanism, start = sliders_put_together(geometry)
    system = build_system(mechanism)
    run = simulate_motion(
        # At both ends accelerations are not interpolated; at the last, Newton's iteration has left a residual.
        mechanism, 0.02, samples=2, torques={"screw": 0.5, "turn": 0.05, "push": 0.3, "pull": 0.2}, start=start,
        options=IntegrationOptions(tolerance=1e-7),
    )  # fmt: skip
    data, solution = motion_dataset(run), run.solution
    checked = 0
    for body in (one for one in mechanism.bodies if isinstance(one, RigidBody)):
        here = system.body(body.name)
        centre, acceleration = [], []
        for x, v, a in zip(solution.q, solution.v, solution.a, strict=True):
            arm = twins.rotation(x[here.angle]) @ body.centre_of_mass
            quarter = np.array([-arm[1], arm[0]])
            centre.append(x[here.position] + arm)
            acceleration.append(a[here.position] + a[here.angle] * quarter - v[here.angle] ** 2 * arm)
        force, moment = np.zeros((len(solution.t), 2)), np.zeros(len(solution.t))
        for joint in mechanism.joints:
            sign = (joint.b.body == body.name) - (joint.a.body == body.name)
            if not sign:
                continue
            one = data.sel(joint=joint.name)
            if joint.b.on_ground:
                at = np.tile(mechanism.ground[joint.b.point], (len(solution.t), 1))
            else:
                at = data["point_position"].sel(point=str(joint.b)).values
            lever, f = at - centre, sign * one["joint_force"].values
            force += f
            moment += sign * one["joint_moment"].values + lever[:, 0] * f[:, 1] - lever[:, 1] * f[:, 0]
            checked += 1
        weight = body.mass * np.array(mechanism.gravity)
        expected = np.column_stack([body.mass * np.array(acceleration), body.inertia * solution.a[:, here.angle]])
        found, scale = np.column_stack([force + weight, moment]), np.max(np.abs(force))
        np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=1e-9 * scale)
        np.testing.assert_allclose(found[-1], expected[-1], rtol=0, atol=1e-5 * scale)
    assert checked == 6


def test_a_flexible_cantilever_has_the_moment_of_its_load_at_its_weld():
    section = Section.rectangle(width=0.02, thickness=0.01)
    beam = FlexibleBeam(
        "beam", 0.5, section, RUBBER, points={"A": 0.0, "B": 0.5}, reference=ReferenceCondition.PINNED, modes=None
    )
    still = Mechanism(
        name="cantilever",
        ground={"A": (0.0, 0.0)},
        bodies=(beam,),
        joints=(WeldJoint("clamp", ref("ground.A"), ref("beam.A")),),
        loads=(PointForce("pull", ref("beam.B"), (0.0, -1e-3)),),
        assemblies=(Assembly("straight", {"beam": 0.0}),),
    )
    system = build_system(still)
    start = static_equilibrium(system, consistent_state(system, still.assembly()))
    data = motion_dataset(simulate_motion(still, 1e-3, samples=2, start=start)).isel(time=0, joint=0)
    np.testing.assert_allclose(data["joint_force"], (0.0, 1e-3), atol=1e-9)
    assert data["joint_moment"].item() == pytest.approx(1e-3 * 0.5, rel=1e-3)


def test_runs_along_a_path_tell_moments_and_multipliers(tracking):
    data = tracking_dataset([simulate(tracking, "++++", options=IntegrationOptions(tolerance=1e-4))])
    for motor in tracking.mechanism.motors:
        moment = data["joint_moment"].sel(joint=motor.joint)
        np.testing.assert_array_equal(moment, data["torque"].sel(motor=motor.name))
    rows = [f"{joint.name} {axis}" for joint in tracking.mechanism.joints for axis in "xy"]
    np.testing.assert_array_equal(
        data["multiplier"].sel(row=rows).values.reshape(data["joint_force"].shape), -data["joint_force"].values
    )


def test_springs_store_and_dampers_take():
    """A slider between a spring along its rail and one to a point: their energy is strain energy, not work."""
    stiffness, rest, oil, cord, length = 300.0, 0.02, 6.0, 150.0, 0.1
    mechanism = replace(
        single(PrismaticJoint("rail", ref("ground.O"), ref("arm.P"), direction=np.pi / 2)),
        ground={"O": (0.1, 0.2), "Q": (0.1, 0.5)},
        springs=(TorsionalSpring("coil", "rail", stiffness, rest),),
        dampers=(TorsionalDamper("oil", "rail", oil),),
        linear_springs=(LinearSpring("cord", ref("ground.Q"), ref("arm.P"), cord, length),),
    )
    run = simulate_motion(mechanism, 0.4, samples=4001, options=IntegrationOptions(tolerance=1e-8))
    height, rate, solution = run.solution.q[:, 1] - 0.2, run.solution.v[:, 1], run.solution
    stored = 0.5 * stiffness * (height - rest) ** 2 + 0.5 * cord * (0.3 - height - length) ** 2
    np.testing.assert_allclose(solution.strain_energy, stored, rtol=1e-6)
    taken = scipy.integrate.cumulative_trapezoid(oil * rate**2, run.times, initial=0.0)
    expected = -MASS * G * height - taken
    np.testing.assert_allclose(solution.work, expected, rtol=0, atol=1e-5 * np.max(np.abs(expected)))
    total = solution.kinetic_energy + solution.strain_energy - solution.work
    np.testing.assert_allclose(total, total[0], rtol=0, atol=1e-5 * np.max(stored))
    assert np.ptp(stored) > 0.1 * np.max(stored)
    assert taken[-1] > 0.01 * np.max(stored)


def test_conventions_are_in_the_attributes():
    data = motion_dataset(simulate_motion(single(RevoluteJoint("pin", ref("ground.O"), ref("arm.P"))), 1e-3, samples=2))
    for name in ("joint_force", "joint_moment", "multiplier"):
        assert "second body" in data[name].attrs["comment"]
