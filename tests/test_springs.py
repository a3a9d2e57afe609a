"""Torsional springs at joints: frequencies, energy, a static shape, and what they are not part of."""

import dataclasses

import numpy as np
import pytest
import scipy.optimize

from paraflex.dynamics import State, build_system, consistent_state, pack_signals
from paraflex.dynamics.points import point_motion
from paraflex.errors import InputError
from paraflex.integrators import IntegrationOptions, integrate
from paraflex.mechanism import (
    Assembly,
    FlexibleBeam,
    Material,
    Mechanism,
    PointRef,
    RevoluteJoint,
    RigidBody,
    Section,
    TorsionalSpring,
)

MASS, INERTIA, REACH = 1.3, 0.02, 0.4


def pendulum(stiffness, rest=0.0, other=None, ground_first=True):
    """A rigid body hinged to the ground at its point A with a spring there; no gravity."""
    body = RigidBody("arm", MASS, INERTIA, (REACH, 0.0), {"A": (0.0, 0.0), "B": (2 * REACH, 0.0)})
    sides = (PointRef("ground", "O"), PointRef("arm", "A"))
    return Mechanism(
        name="pendulum",
        ground={"O": (0.2, 0.1)},
        bodies=(body,),
        joints=(RevoluteJoint("pin", *(sides if ground_first else sides[::-1])),),
        springs=(TorsionalSpring("spring", "pin", stiffness, rest),),
        assemblies=(Assembly("start", {"arm": 0.5}),),
    )


def run(mechanism, end, *, tolerance=1e-6, state=None, samples=201):
    system = build_system(mechanism)
    state = consistent_state(system, mechanism.assembly()) if state is None else state
    signals, _ = pack_signals(mechanism, [], end)
    return system, integrate(
        system, signals, state, np.linspace(0.0, end, samples), options=IntegrationOptions(tolerance=tolerance)
    )


@pytest.mark.parametrize("ground_first", [True, False])
def test_a_pendulum_swings_about_the_rest_angle(ground_first):
    stiffness, rest = 30.0, 0.2 if ground_first else -0.2
    system, solution = run(pendulum(stiffness, rest, ground_first=ground_first), 0.5)
    omega = np.sqrt(stiffness / (INERTIA + MASS * REACH**2))
    expected = 0.2 + 0.3 * np.cos(omega * solution.t)
    np.testing.assert_allclose(solution.q[:, 2], expected, rtol=0, atol=2e-5)
    start = 0.5 * stiffness * 0.3**2
    assert solution.strain_energy[0] == pytest.approx(start, rel=1e-12)
    np.testing.assert_allclose(solution.strain_energy + solution.kinetic_energy, start, rtol=1e-3)
    assert solution.energy_balance_max < 1e-3 * start
    # The multiplier is the torque.
    np.testing.assert_allclose(
        np.abs(solution.multipliers[:, system.rows.index("spring angle")]),
        stiffness * np.abs(solution.q[:, 2] - 0.2),
        rtol=0,
        atol=1e-3,
    )


def test_a_very_stiff_spring_does_not_dictate_the_step_and_is_a_weld():
    """Two bodies in a row, the joint between them held by a spring of 1e9 N m/rad: they turn as one."""
    link = RigidBody("fore", MASS, INERTIA, (REACH, 0.0), {"A": (0.0, 0.0)})
    base = pendulum(30.0)
    mechanism = Mechanism(
        name="two",
        ground=base.ground,
        bodies=(*base.bodies, link),
        joints=(*base.joints, RevoluteJoint("elbow", PointRef("arm", "B"), PointRef("fore", "A"))),
        springs=(*base.springs, TorsionalSpring("stiff", "elbow", 1e9)),
        assemblies=(Assembly("start", {"arm": 0.5, "fore": 0.5}),),
    )
    _, solution = run(mechanism, 1.0, tolerance=1e-5)
    inertia = 2 * INERTIA + MASS * REACH**2 * (1 + 9)
    np.testing.assert_allclose(solution.q[:, 2], 0.5 * np.cos(np.sqrt(30.0 / inertia) * solution.t), atol=2e-4)
    np.testing.assert_allclose(solution.q[:, 5], solution.q[:, 2], rtol=0, atol=1e-6)
    assert solution.steps < 3000


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
def test_a_spring_acts_on_the_slope_of_a_beam(geometry):
    """A beam on a hinge with a spring swings at the frequency of the textbook's characteristic equation."""
    EI, length, stiffness = 5.0, 0.5, 40.0
    beam = FlexibleBeam("beam", length, Section(1e-4, EI / 70e9), Material(70e9, 2700.0), {"A": 0.0, "B": length}, 2)
    wall = {"O": (0.0, 0.0)}
    mechanism = Mechanism(
        name="cantilever on a spring",
        ground=wall,
        bodies=(beam,),
        joints=(RevoluteJoint("root", PointRef("ground", "O"), PointRef("beam", "A")),),
        springs=(TorsionalSpring("spring", "root", stiffness),),
        assemblies=(Assembly("start", {"beam": 0.0}),),
    ).with_geometry(geometry)
    system = build_system(mechanism)
    omega = first_frequency(mass_per_length=0.27, EI=EI, length=length, stiffness=stiffness)
    # Turned rigidly: mostly the first mode.
    q = np.zeros(system.n)
    q[system.bodies[0].angle] = 1e-3
    _, solution = run(mechanism, 2.0, tolerance=1e-6, state=State(0.0, q, np.zeros(system.n)), samples=8001)
    tip = point_motion(system, PointRef("beam", "B"), solution.q, solution.v, solution.a).position[:, 1]
    spectrum = np.abs(np.fft.rfft(tip * np.hanning(tip.size)))
    peak = int(np.argmax(spectrum))
    # The peak between samples of the spectrum, by the parabola through three logarithms: exact for a Gaussian window.
    left, middle, right = np.log(spectrum[peak - 1 : peak + 2])
    found = 2 * np.pi / solution.t[-1] * (peak + 0.5 * (left - right) / (left - 2 * middle + right))
    assert found == pytest.approx(omega, rel=0.01)
    total = solution.kinetic_energy + solution.strain_energy
    assert solution.energy_balance_max < 0.12 * total[0]


def first_frequency(mass_per_length, EI, length, stiffness):
    """Textbook: hinged with a spring at one end, free at the other."""

    def determinant(k):
        x = k * length
        ch, sh, co, si = np.cosh(x), np.sinh(x), np.cos(x), np.sin(x)
        # With w(0) = 0: w = A sin + B sinh + C (cos - cosh). At the root EI w'' = stiffness w'; at the tip none.
        root = [stiffness * k, stiffness * k, 2 * EI * k**2]
        bend = [-si, sh, -co - ch]
        shear = [-co, ch, si - sh]
        return np.linalg.det([root, bend, shear])

    grid = np.linspace(0.05, 1.87, 200) / length
    values = [determinant(k) for k in grid]
    crossing = next(i for i in range(199) if values[i] * values[i + 1] < 0)
    k = scipy.optimize.brentq(determinant, grid[crossing], grid[crossing + 1])
    return k**2 * np.sqrt(EI / mass_per_length)


def test_springs_are_no_constraints():
    system = build_system(pendulum(30.0))
    assert (system.m, system.n_constraints) == (3, 2)
    assert "spring angle" in system.rows


@pytest.mark.parametrize(
    ("spring", "says"),
    [
        (TorsionalSpring("s", "pinn", 1.0), "spring.s.joint: unknown joint"),
        (TorsionalSpring("s", "pin", -1.0), "spring.s.stiffness: must not be negative"),
        (TorsionalSpring("s", "pin", 1.0, np.nan), "spring.s.rest: "),
    ],
)
def test_a_spring_that_makes_no_sense(spring, says):
    with pytest.raises(InputError, match=r"^spring\.s: gives no torque"):
        TorsionalSpring("s", "pin")
    with pytest.raises(InputError) as caught:
        dataclasses.replace(pendulum(1.0), springs=(spring,))
    assert says in str(caught.value)
