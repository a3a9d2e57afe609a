"""Error control, damping, honesty of the tolerance; singular positions, jumps, ends of runs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from paraflex.dynamics import (
    State,
    build_system,
    consistent_state,
    constant_signals,
    momentum,
    pack_signals,
    piecewise_quintic,
    redundant_rows,
)
from paraflex.dynamics.state import mass_matrix
from paraflex.errors import InputError, IntegrationError
from paraflex.fem import ReferenceCondition
from paraflex.files import load
from paraflex.integrators import IntegrationOptions, integrate
from paraflex.mechanism import (
    Assembly,
    Curvature,
    FlexibleBeam,
    Material,
    Mechanism,
    PointRef,
    RevoluteJoint,
    RigidBody,
    SampledAngle,
    Section,
    TorsionalSpring,
)
from paraflex.mechanism.joints import PrescribedAngle


def beam(**changes) -> FlexibleBeam:
    values = {
        "name": "rod",
        "length": 1.0,
        "section": Section.rectangle(0.03, 0.005),
        "material": Material(70e9, 2700.0),
        "points": {"O": 0.0, "P": 1.0},
        "elements": 2,
        "reference": ReferenceCondition.CANTILEVER,
        "curvature": Curvature.SHARED,
    }
    return FlexibleBeam(**(values | changes))


def pendulum(body) -> Mechanism:
    return Mechanism(
        name="pendulum",
        ground={"O": (0.0, 0.0)},
        bodies=(body,),
        joints=(RevoluteJoint("O", PointRef("ground", "O"), PointRef(body.name, "O")),),
        assemblies=(Assembly("straight", {body.name: 0.3}),),
    )


def first_mode(system, name: str, amplitude: float) -> dict:
    """Nodal deflection of a body's lowest mode."""
    body = system.body(name)
    return {name: amplitude * body.integrals.D[:, 0]}


def run(system, state, end, *, tolerance=1e-5, times=None, **options):
    signals, knots = pack_signals(system.mechanism, [], end)
    times = np.linspace(0.0, end, 21) if times is None else times
    chosen = IntegrationOptions(tolerance=tolerance, **options)
    return integrate(system, signals, state, times, knots=np.array(knots), options=chosen)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-5, 1e-6])
def test_tolerance_bounds_the_error(tolerance):
    """The tip of a spinning, vibrating pendulum is closer to the converged one than the tolerance says."""
    system = build_system(pendulum(beam()))
    velocity = np.zeros(system.n)
    velocity[2] = 5.0
    state = consistent_state(
        system, system.mechanism.assembly(), deflection=first_mode(system, "rod", 1e-3), velocity=velocity
    )
    tip = system.marker(PointRef("rod", "P"))

    def tip_path(tol):
        solution = run(system, state, 0.2, tolerance=tol)
        phi = solution.q[:, 2]
        local = tip.x0 + solution.q[:, 3:] @ tip.N.T
        return np.exp(1j * phi) * (local[:, 0] + 1j * local[:, 1])

    error = np.max(np.abs(tip_path(tolerance) - tip_path(1e-8)))
    # Root mean square over the mass against the tip, where it is largest: a uniform rod's tip has sqrt(3) of it.
    assert error < np.sqrt(3.0) * tolerance
    assert error > 1e-4 * tolerance


def test_stiff_axial_mode_does_not_dictate_the_step():
    """A thousand times stiffer in axial direction: the same bending motion takes as many steps."""

    def steps(axial_factor):
        section = Section.rectangle(0.03, 0.005)
        area = axial_factor * section.area
        body = beam(section=Section(area, section.second_moment), material=Material(70e9, 2700.0 / axial_factor))
        system = build_system(pendulum(body))
        state = consistent_state(
            system, system.mechanism.assembly(), deflection=first_mode(system, "rod", 1e-3), velocity=None
        )
        return run(system, state, 0.1, tolerance=1e-5).steps

    # If it did, steps would be thirty times as many.
    assert steps(1000.0) < 2.0 * steps(1.0)


def test_free_pendulum_keeps_its_energy():
    system = build_system(pendulum(beam()))
    velocity = np.zeros(system.n)
    velocity[2] = 0.3
    state = consistent_state(
        system, system.mechanism.assembly(), deflection=first_mode(system, "rod", 1e-3), velocity=velocity
    )
    coarse, fine = (run(system, state, 0.3, tolerance=tolerance) for tolerance in (1e-5, 1e-6))
    total = coarse.kinetic_energy[0] + coarse.strain_energy[0]
    assert coarse.strain_energy[0] > 1e-3 * total
    # Energy of a vibration of amplitude A is lost in proportion to the error e as 2 e/A.
    assert coarse.energy_balance_max < 2.0 * (1e-5 / 1e-3) * total
    assert fine.energy_balance_max < 0.2 * coarse.energy_balance_max
    assert np.max(np.abs(coarse.work)) == 0.0


def test_free_floating_mechanism_keeps_momentum():
    rod, other = beam(), beam(name="arm", length=0.7, points={"Q": 0.0, "R": 0.7})
    mechanism = Mechanism(
        name="two floating rods",
        ground={},
        bodies=(rod, other),
        joints=(RevoluteJoint("elbow", PointRef("rod", "P"), PointRef("arm", "Q")),),
        assemblies=(Assembly("bent", {"rod": 0.2, "arm": 1.4}),),
    )
    system = build_system(mechanism)
    rng = np.random.default_rng(7)
    velocity = np.zeros(system.n)
    for body in system.bodies:
        velocity[body.offset : body.offset + 3] = rng.normal(size=3)
    state = consistent_state(
        system, mechanism.assembly(), deflection=first_mode(system, "rod", 1e-3), velocity=velocity
    )
    linear, angular = momentum(system, state)
    end = 0.1
    for tolerance in (1e-4, 1e-5):
        solution = run(system, state, end, tolerance=tolerance)
        later = [momentum(system, State(t, q, v)) for t, q, v in zip(solution.t, solution.q, solution.v, strict=True)]
        # Velocity errors that nothing turns round may add up to the tolerance over a tenth of the run.
        allowed = system.total_mass * tolerance / (0.1 * end)
        assert max(np.max(np.abs(p - linear)) for p, _ in later) < allowed
        # About the origin, less than two metres away.
        assert max(abs(h - angular) for _, h in later) < 2.0 * allowed
    assert np.linalg.norm(linear) > 0.1


def test_a_single_free_body_flies_straight():
    system = build_system(Mechanism("free", ground={}, bodies=(RigidBody("body", mass=2.0, inertia=0.1),), joints=()))
    state = State(0.0, np.array([1.0, 2.0, 0.3]), np.array([0.5, -0.25, 2.0]))
    solution = run(system, state, 2.0)
    np.testing.assert_allclose(solution.q[-1], state.q + 2.0 * state.v, rtol=0, atol=1e-12)


def test_baumgarte_pulls_a_violated_constraint_back():
    system = build_system(pendulum(beam(flexible=False)))
    state = consistent_state(system, system.mechanism.assembly())
    state.q[0] += 1e-4
    end = 1.0
    drifting = run(system, state, end, alpha=0.0, beta=0.0, tolerance=1e-7)
    pulled = run(system, state, end, alpha=20.0, beta=20.0, tolerance=1e-7)
    assert drifting.q[-1, 0] == pytest.approx(1e-4, rel=1e-3)
    # Critically damped: (1 + 20 t) exp(-20 t) of it is left.
    t = pulled.t
    assert pulled.q[:, 0] == pytest.approx(1e-4 * (1.0 + 20.0 * t) * np.exp(-20.0 * t), abs=1e-7)


def test_prescribed_angle_is_followed_and_its_work_balances():
    body = RigidBody("disc", mass=2.0, inertia=0.1, points={"O": (0.0, 0.0)})
    law = SampledAngle(lambda t: np.sin(3.0 * t), lambda t: 3.0 * np.cos(3.0 * t), lambda t: -9.0 * np.sin(3.0 * t))
    mechanism = Mechanism(
        name="driven disc",
        ground={"O": (0.0, 0.0)},
        bodies=(body,),
        joints=(RevoluteJoint("O", PointRef("ground", "O"), PointRef("disc", "O")),),
        prescribed=(PrescribedAngle("drive", "O", law),),
        assemblies=(Assembly("start", {"disc": 0.0}),),
    )
    system = build_system(mechanism)
    velocity = np.array([0.0, 0.0, 3.0])
    state = consistent_state(system, mechanism.assembly())
    # The start follows the law's rate, whatever velocity was given.
    assert state.v == pytest.approx(velocity, abs=1e-12)
    solution = run(system, state, 2.0, tolerance=1e-6)
    assert solution.q[:, 2] == pytest.approx(np.sin(3.0 * solution.t), abs=1e-6)
    assert solution.kinetic_energy - solution.kinetic_energy[0] == pytest.approx(solution.work, abs=1e-5)
    assert np.ptp(solution.work) > 0.4


def test_redundant_joint_changes_nothing():
    """The same joint twice: rank-deficient constraints give the accelerations of the pseudo-inverse (Eq. 59)."""
    single = pendulum(beam(flexible=False))
    joints = (*single.joints, RevoluteJoint("again", PointRef("ground", "O"), PointRef("rod", "O")))
    double = Mechanism("twice", single.ground, single.bodies, joints, assemblies=single.assemblies)
    solutions = []
    for mechanism in (single, double):
        system = build_system(mechanism)
        velocity = np.zeros(system.n)
        velocity[2] = 4.0
        state = consistent_state(system, mechanism.assembly(), velocity=velocity)
        solutions.append(run(system, state, 0.5, tolerance=1e-6))
    assert solutions[1].q == pytest.approx(solutions[0].q, abs=1e-9)


def parallelogram(angle_law) -> Mechanism:
    """Two unit cranks and a coupler over a unit base: its constraints lose rank where all links lie in line."""
    points = {"a": (0.0, 0.0), "b": (1.0, 0.0)}
    left, coupler, right = (RigidBody(name, 1.0, 0.1, (0.5, 0.0), points) for name in ("left", "coupler", "right"))
    return Mechanism(
        name="parallelogram",
        ground={"O": (0.0, 0.0), "E": (1.0, 0.0)},
        bodies=(left, coupler, right),
        joints=(
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("left", "a")),
            RevoluteJoint("M", PointRef("left", "b"), PointRef("coupler", "a")),
            RevoluteJoint("N", PointRef("coupler", "b"), PointRef("right", "b")),
            RevoluteJoint("E", PointRef("right", "a"), PointRef("ground", "E")),
        ),
        prescribed=(PrescribedAngle("drive", "O", angle_law),),
        assemblies=(Assembly("up", {"left": 1.0, "coupler": 0.0, "right": 1.0}),),
    )


def test_a_singular_position_is_passed_and_told():
    """The crank is driven through the straight position, where a step ends: the links stay parallel."""
    law = SampledAngle(lambda t: 1.0 - t, lambda t: -1.0 + 0.0 * t, lambda t: 0.0 * t, knots=(1.0,))
    system = build_system(parallelogram(law))
    state = consistent_state(system, system.mechanism.assembly())
    assert redundant_rows(system, state.q) == []
    solution = run(system, state, 1.5, tolerance=1e-6, alpha=50.0, beta=50.0)
    angles = [system.body(name).angle for name in ("left", "coupler", "right")]
    expected = np.outer(1.0 - solution.t, [1.0, 0.0, 1.0])
    assert solution.q[:, angles] == pytest.approx(expected, abs=1e-5)
    assert solution.singular_positions == pytest.approx([1.0], abs=3e-3)
    gone = np.isnan(solution.multipliers).any(axis=1)
    assert np.all(np.abs(solution.t[gone] - 1.0) < 1e-2)


def test_a_drive_beyond_reach_stops_the_run_with_what_there_is():
    """A slider is driven away until crank and rod are in line, and on: named with time, kept until then."""
    law = SampledAngle(lambda t: 0.25 + 0.2 * t, lambda t: 0.2 + 0.0 * t, lambda t: 0.0 * t)
    mechanism = replace(
        load("slider_crank").mechanism,
        motors=(),
        modes=(),
        end_effector=None,
        prescribed=(PrescribedAngle("push", "rail", law),),
    )
    system = build_system(mechanism)
    state = consistent_state(system, mechanism.assembly())
    with pytest.raises(IntegrationError, match="lose rank") as caught:
        run(system, state, 1.0, tolerance=1e-2)
    # Crank and rod are 0.32 m long.
    assert caught.value.moment.time == pytest.approx(0.35, abs=2e-3)
    partial = caught.value.partial
    assert partial.t[-1] > 0.29
    assert partial.q[:, system.body("slider").offset] == pytest.approx(0.25 + 0.2 * partial.t, abs=1e-2)


def spinning(start: float, speed: float = 1e7, span: float = 1e-5, **options):
    """A disc on a spring, turned by 0.1 rad, whose run starts at a time; so many rad/s are its own."""
    disc = RigidBody("disc", mass=2.0, inertia=0.5, points={"O": (0.0, 0.0)})
    spring = TorsionalSpring("spring", "O", stiffness=0.5 * speed**2)
    mechanism = replace(pendulum(disc), springs=(spring,), assemblies=(Assembly("turned", {"disc": 0.1}),))
    system = build_system(mechanism)
    signals, _ = pack_signals(mechanism, [], span)
    initial = replace(consistent_state(system, mechanism.assembly()), time=start)
    chosen = IntegrationOptions(method="tr-bdf2", **options)
    return integrate(system, signals, initial, start + np.linspace(0.0, span, 5), options=chosen)


@pytest.mark.parametrize("start", [1000.0, -1000.0])
def test_when_a_run_starts_does_not_bound_its_steps(start):
    """The smallest step is a part of the run, not of the clock; the clock has its digits, a thousandth of a step."""
    usual, late = (spinning(time, tolerance=1e-6) for time in (0.0, start))
    assert late.rejected > 0
    assert late.steps == pytest.approx(usual.steps, rel=0.02)
    np.testing.assert_allclose(late.q, usual.q, rtol=0.0, atol=0.02)


@pytest.mark.parametrize("start", [0.0, -1.0, -3.0])
def test_a_run_that_cannot_go_on_ends_whenever_it_starts(monkeypatch, start):
    """One that ends at zero or before would shorten its steps for ever."""
    # No spring that may be given is so stiff.
    monkeypatch.setattr("paraflex.limits.LARGEST", math.inf)
    with pytest.raises(IntegrationError, match=r"Newton.s iteration does not converge, however small the step"):
        spinning(start, speed=1e14, span=1.0, max_steps=2000)


def test_too_many_steps_keep_the_partial_solution():
    system = build_system(pendulum(beam()))
    state = consistent_state(
        system, system.mechanism.assembly(), deflection=first_mode(system, "rod", 1e-3), velocity=None
    )
    with pytest.raises(IntegrationError, match="the run has not ended after 50 steps, at t = ") as caught:
        run(system, state, 1.0, max_steps=50, times=np.linspace(0.0, 1.0, 100001))
    partial = caught.value.partial
    assert partial.status == "failed"
    assert caught.value.moment.step == partial.steps
    assert partial.steps + partial.rejected == 50
    assert 0 < partial.t.size < 100001
    assert np.all(np.isfinite(partial.q))


def test_interrupt_keeps_the_partial_solution():
    system = build_system(pendulum(beam()))
    state = consistent_state(
        system, system.mechanism.assembly(), deflection=first_mode(system, "rod", 1e-3), velocity=None
    )
    signals, _ = pack_signals(system.mechanism, [], 1.0)

    def stop(time):
        if time > 0.01:
            raise KeyboardInterrupt

    solution = integrate(system, signals, state, np.linspace(0.0, 1.0, 1001), on_progress=stop)
    assert solution.status == "interrupted"
    assert 0.01 <= solution.t[-1] < 0.9
    assert np.all(np.isfinite(solution.a))


def test_dense_output_agrees_with_steps_that_end_there():
    system = build_system(pendulum(beam()))
    state = consistent_state(
        system, system.mechanism.assembly(), deflection=first_mode(system, "rod", 1e-3), velocity=None
    )
    signals, _ = pack_signals(system.mechanism, [], 0.1)
    times = np.sort(np.random.default_rng(3).uniform(0.0, 0.1, 40))
    options = IntegrationOptions(tolerance=1e-6)
    between = integrate(system, signals, state, times, options=options)
    landed = integrate(system, signals, state, times, knots=times, options=options)
    M = mass_matrix(system, state.q)

    def size(x):
        """Root mean square over the mass: the angle of the frame and the modes that go against it move little."""
        return np.sqrt(np.max(np.einsum("ti,ij,tj->t", x, M, x)) / system.total_mass)

    assert size(between.q - landed.q) < 1e-6
    # A velocity error of a vibration is omega times that of its position; bending modes here reach some 2000 rad/s.
    assert size(between.v - landed.v) < 2000.0 * 1e-6


def test_signals_are_smooth_and_exact():
    t = np.linspace(0.0, 2.0, 41)
    signal = piecewise_quintic(t, np.sin(t), np.cos(t), -np.sin(t))
    x = np.linspace(0.0, 1.999, 333)
    piece = np.searchsorted(signal.breaks, x, side="right") - 1
    values = sum(signal.coefficients[piece, k] * (x - signal.breaks[piece]) ** k for k in range(6))
    # The quintic Hermite error bound h^6/(720 * 64) with h = 0.05.
    assert np.max(np.abs(values - np.sin(x))) < 0.05**6 / 46080.0


@pytest.mark.parametrize(
    ("field", "value"), [("tolerance", 0.0), ("tolerance", float("nan")), ("alpha", -1.0), ("max_step", 0.0)]
)
def test_bad_options_are_refused(field, value):
    with pytest.raises(InputError) as caught:
        IntegrationOptions(**{field: value})
    assert caught.value.field == field


def test_times_must_ascend():
    system = build_system(pendulum(beam(flexible=False)))
    state = consistent_state(system, system.mechanism.assembly())
    signals, _ = pack_signals(system.mechanism, constant_signals([], 1.0), 1.0)
    with pytest.raises(InputError, match="times"):
        integrate(system, signals, state, np.array([0.0, 0.5, 0.5]))
