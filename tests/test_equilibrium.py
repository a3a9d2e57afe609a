"""Static equilibrium: closed forms, nothing moves from there, and what cannot stand still."""

import dataclasses

import numpy as np
import pytest
import scipy.optimize

from paraflex.dynamics import build_system, consistent_state, static_equilibrium
from paraflex.dynamics.state import point_position
from paraflex.errors import AssemblyError
from paraflex.fem import ReferenceCondition
from paraflex.fem.element import TRANSVERSE
from paraflex.files import load
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    AppliedTorque,
    Assembly,
    ConstantSpeed,
    FlexibleBeam,
    Geometry,
    LinearSpring,
    Material,
    Mechanism,
    PointForce,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    Section,
    TorsionalSpring,
    WeldJoint,
    chain_of_segments,
    raparm_i,
)
from paraflex.motion import simulate_motion
from paraflex.paths import Line
from paraflex.tracking import plan_tracking
from test_loads import MASS, REACH, G, pendulum


def equilibrium(mechanism, held=()):
    system = build_system(mechanism)
    return system, static_equilibrium(system, consistent_state(system, mechanism.assembly()), held)


def test_an_arm_on_springs_stands_where_moments_balance():
    mechanism = pendulum(
        gravity=(0.0, -G),
        springs=(TorsionalSpring("spring", "pin", 8.0, 0.7),),
        linear_springs=(LinearSpring("stay", PointRef("ground", "O"), PointRef("arm", "B"), 30.0, 0.5),),
        loads=(AppliedTorque("twist", PointRef("arm", "A"), 0.6),),
    )
    system, state = equilibrium(mechanism)
    # The stay runs from the pin: it turns nothing.
    expected = scipy.optimize.brentq(lambda x: -8.0 * (x - 0.7) + 0.6 - MASS * G * REACH * np.cos(x), -0.5, 1.0)
    assert state.q[system.body("arm").angle] == pytest.approx(expected, abs=1e-9)
    assert not state.v.any()


@pytest.mark.parametrize("geometry", list(Geometry))
def test_a_clamped_beam_sags_and_stays(geometry):
    EI, length, per_length = 5.0, 0.5, 0.27
    beam = FlexibleBeam(
        "beam", length, Section(1e-4, EI / 70e9), Material(70e9, per_length / 1e-4), {"A": 0.0, "B": length}, 2,
        reference=ReferenceCondition.CANTILEVER,
    )  # fmt: skip
    mechanism = Mechanism(
        "clamped",
        {"O": (0.0, 0.0)},
        (beam,),
        (RevoluteJoint("root", PointRef("ground", "O"), PointRef("beam", "A")),),
        prescribed=(PrescribedAngle("clamp", "root", ConstantSpeed(0.0, 0.0)),),
        assemblies=(Assembly("level", {"beam": 0.0}),),
        gravity=(0.0, -G),
        geometry=geometry,
    )
    system, state = equilibrium(mechanism)
    body = system.bodies[0]
    tip = body.integrals.D[body.mesh.column(-1, TRANSVERSE)] @ state.q[body.flexible]
    assert tip == pytest.approx(-per_length * G * length**4 / (8 * EI), rel=1e-4)
    run = simulate_motion(mechanism, 0.2, samples=5, start=state, options=IntegrationOptions(tolerance=1e-6))
    np.testing.assert_allclose(run.solution.q, np.tile(state.q, (5, 1)), rtol=0, atol=1e-8)


@pytest.mark.parametrize("geometry", list(Geometry))
def test_held_motors_carry_a_flexible_manipulator(geometry):
    """Redundant motors hold: what they hold with and the sag of the tool balance a virtual displacement of each."""
    mechanism = dataclasses.replace(
        raparm_i(), gravity=(0.0, -G), loads=(PointForce("tool", PointRef("link4", "C"), (0.0, -20.0)),)
    ).with_geometry(geometry)
    task = plan_tracking(mechanism, Line((0.0, 0.264), (0.02, 0.264), 10.0), duration=0.1, samples=11)
    balanced = task.balanced("++++")
    undeformed = task.simulate("++++").solution
    solution = balanced.simulate("++++").solution
    # It sags by less than a centimetre, and its motors stay where they were.
    tip = task.system.body("link4").position
    assert 1e-4 < np.linalg.norm(balanced.start.q[tip] - task.start.q[tip]) < 1e-2
    for motor in mechanism.motors:
        row = np.zeros(task.system.n)
        body = task.system.body(mechanism.joint(motor.joint).b.body)
        row[body.angle] = 1.0
        row[body.flexible] = task.system.marker(mechanism.joint(motor.joint).b).slope
        assert row @ (balanced.start.q - task.start.q) == pytest.approx(0.0, abs=1e-9)
    # What rings less takes fewer steps.
    assert solution.steps < undeformed.steps
    # Weight has bent the links: their energy is there from the start.
    assert solution.strain_energy[0] > 0.01
    assert undeformed.strain_energy[0] == 0.0


def test_the_library_pendulum_hangs_down():
    mechanism = load("pendulum").mechanism
    down = dataclasses.replace(mechanism, assemblies=(Assembly("low", {"beam": -1.2}),))
    system, state = equilibrium(down)
    assert state.q[2] == pytest.approx(-np.pi / 2, abs=1e-9)
    # Straight, and stretched by the bob and half its own weight.
    beam = system.bodies[0]
    stretch = beam.integrals.D[beam.mesh.column(-1, 0)] @ state.q[beam.flexible]
    EA, own = 210e9 * 0.020 * 0.0015, 7850.0 * 0.020 * 0.0015 * 0.6
    assert stretch == pytest.approx((0.2 + own / 2) * G * 0.6 / EA, rel=1e-6)


def test_what_nothing_holds_has_no_equilibrium():
    with pytest.raises(AssemblyError, match=r"no static equilibrium is found near the start at .*; start nearer to it"):
        equilibrium(pendulum(loads=(AppliedTorque("twist", PointRef("arm", "A"), 0.6),)))
    equilibrium(pendulum(loads=(AppliedTorque("twist", PointRef("arm", "A"), 0.6),)), held=["pin"])


@pytest.mark.parametrize("n", [20, 300])
def test_a_long_chain_hangs_as_an_elastic_line(n):
    """Segments with springs, hung nearly straight: few with dense matrices, many with sparse ones.

    A stiff chain welded at its first joint sags as a cantilever under its own weight, q l^4 / 8 E I, less a fraction
    2 / n: half a segment at the clamp does not bend.
    """
    mechanism = chain_of_segments(n, bending_stiffness=200.0)
    clamp = WeldJoint("J1", *(getattr(mechanism.joint("J1"), side) for side in "ab"))
    mechanism = dataclasses.replace(mechanism, joints=(clamp, *mechanism.joints[1:]))
    system = build_system(mechanism)
    rest = static_equilibrium(system, consistent_state(system, mechanism.assembly()))
    tip = point_position(system, rest.q, PointRef(f"segment{n}", "Q"))
    exact = 9.81 / (8.0 * 200.0) * (1.0 - 2.0 / n)
    assert -tip[1] == pytest.approx(exact, rel=3.0 / n**2 + 1e-4)
    assert not rest.v.any()
