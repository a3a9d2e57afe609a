"""Methods of SciPy and SUNDIALS: against our own, their tolerance, stops, failures, what they cannot do."""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from paraflex.dynamics import State, build_system, consistent_state, constant_signals, pack_signals
from paraflex.dynamics.signals import InputSignals
from paraflex.errors import InputError, IntegrationError, StiffnessWarning
from paraflex.fem import ReferenceCondition
from paraflex.integrators import METHODS, IntegrationOptions, integrate, make_problem
from paraflex.integrators.external_methods import ExternalMethod
from paraflex.integrators.external_run import largest_rate
from paraflex.integrators.forms import OdeForm
from paraflex.integrators.methods import BDF, RK45, find_method
from paraflex.integrators.stepper import attempts
from paraflex.mechanism import (
    Assembly,
    Curvature,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    Motor,
    PointRef,
    RevoluteJoint,
    RigidBody,
    Section,
)

GUESTS = [name for name, method in METHODS.items() if isinstance(method, ExternalMethod)]
KINDS = (*GUESTS, "ida ggl")
END, JUMP = 0.2, 0.0731
TIMES = np.linspace(0.0, END, 41)
STEEL, SOFT = Material(210e9, 7850.0), Material(3e8, 1100.0)


def joint(name, a, b):
    return RevoluteJoint(name, PointRef.parse(a), PointRef.parse(b))


def arm(material=SOFT, geometry=Geometry.LINEAR):
    """A soft beam driven at its root, a rigid bob at its end, under weight."""
    section, points = Section.rectangle(0.02, 0.02), {"O": 0.0, "P": 0.5}
    rod = FlexibleBeam(
        "rod", 0.5, section, material, points=points, modes=2,
        reference=ReferenceCondition.CANTILEVER, curvature=Curvature.SHARED,
    )  # fmt: skip
    bob = RigidBody("bob", 0.05, 1e-4, (0.05, 0.0), {"P": (0.0, 0.0)})
    return Mechanism(
        name="arm",
        ground={"O": (0.0, 0.0)},
        bodies=(rod, bob),
        joints=(joint("O", "ground.O", "rod.O"), joint("P", "rod.P", "bob.P")),
        motors=(Motor("drive", "O"),),
        gravity=(0.0, -9.81),
        geometry=geometry,
        assemblies=(Assembly("out", {"rod": -1.2, "bob": -0.3}),),
    )


def jumping(before, after, end):
    """A torque that jumps."""
    coefficients = np.zeros((2, 6))
    coefficients[:, 0] = before, after
    return InputSignals(np.array([0.0, JUMP, end]), coefficients)


def run(system, kind, *, tolerance=1e-5, times=TIMES, torques=None, on_progress=None, **options):
    method, _, constraints = kind.partition(" ")
    torque = jumping(0.6, -0.2, times[-1]) if torques is None else torques
    signals, knots = pack_signals(system.mechanism, [torque] * len(system.mechanism.motors), times[-1])
    knots = [*knots, *torque.breaks]
    state = consistent_state(system, system.mechanism.assembly())
    chosen = IntegrationOptions(method=method, tolerance=tolerance, constraints=constraints or None, **options)
    return integrate(system, signals, state, times, knots=np.array(knots), options=chosen, on_progress=on_progress)


@cache
def our_own(geometry=Geometry.LINEAR):
    system = build_system(arm(geometry=geometry))
    return system, run(system, "tr-bdf2", tolerance=1e-7)


@cache
def followed(kind, tolerance):
    """What a guest finds where ours has found the exact motion; several tests look at it."""
    return run(our_own()[0], kind, tolerance=tolerance)


def bob(solution):
    """Where the bob's joint is."""
    return solution.q[:, -3:-1]


def distance(solution, other):
    return np.max(np.linalg.norm(bob(solution) - bob(other), axis=1))


@pytest.mark.parametrize("kind", KINDS)
def test_every_guest_follows_our_own_across_a_jump(kind):
    exact, found = our_own()[1], followed(kind, 1e-5)
    assert found.status == "complete"
    assert found.method == kind.split()[0]
    # The tolerance is 1e-5 m; of these errors rounding moves a tenth.
    assert distance(found, exact) < 1.5e-5
    # Just before the jump what acts is what was: the acceleration there is not that of the other torque.
    assert np.abs(found.v - exact.v).max() < 3e-2 * np.abs(exact.v).max()
    assert np.abs(found.a - exact.a).max() < 6e-2 * np.abs(exact.a).max()
    assert np.abs(found.multipliers - exact.multipliers).max() < 6e-2 * np.abs(exact.multipliers).max()
    assert found.constraint_position_max < 1.5e-5
    assert found.steps > 10
    assert found.evaluations > 0.25 * found.steps
    scale = np.ptp(exact.work)
    assert np.abs(found.work - exact.work).max() < 1e-2 * scale
    assert found.energy_balance_max < 1e-2 * scale
    stored = found.kinetic_energy + found.strain_energy
    assert np.abs(stored - stored[0] - found.work).max() < 1e-2 * scale


@pytest.mark.parametrize("kind", ["radau", "bdf", "ida ggl"])
def test_second_order_geometry(kind):
    system, exact = our_own(Geometry.SECOND_ORDER)
    assert distance(run(system, kind), exact) < 1e-5
    assert distance(our_own()[1], exact) > 1e-4


@pytest.mark.parametrize("kind", KINDS)
def test_error_falls_with_the_tolerance_and_stays_below_it(kind):
    errors = [distance(followed(kind, tolerance), our_own()[1]) for tolerance in (1e-4, 1e-5)]
    assert errors[0] < 1e-4
    assert errors[1] < 1.5e-5
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("kind", ["bdf", "radau", "ida"])
def test_steps_end_at_knots_without_starting_anew(kind):
    """A torque given in pieces that join smoothly costs little more than in one piece."""
    system = build_system(arm())
    line = np.array([[0.3, 2.0, 0.0, 0.0, 0.0, 0.0]])
    pieces = [InputSignals(np.array([0.0, END]), line)]
    breaks = np.linspace(0.0, END, 6)
    pieces.append(InputSignals(breaks, np.stack([[0.3 + 2.0 * t, 2.0, 0, 0, 0, 0] for t in breaks[:-1]])))
    one, five = (run(system, kind, torques=torque) for torque in pieces)
    assert distance(one, five) < 1e-5
    assert five.steps < 1.5 * one.steps + 10


def platform(rods):
    """A heavy platform on parallel rods: with three of them a row follows from the others."""
    feet = np.linspace(0.0, 0.4, rods)
    bars = [RigidBody(f"rod{k}", 0.2, 4e-3, (0.25, 0.0), {"A": (0.0, 0.0), "B": (0.5, 0.0)}) for k in range(rods)]
    plate = RigidBody("plate", 1.0, 0.02, (0.2, 0.0), {f"B{k}": (x, 0.0) for k, x in enumerate(feet)})
    return Mechanism(
        name="platform",
        ground={f"A{k}": (x, 0.0) for k, x in enumerate(feet)},
        bodies=(*bars, plate),
        joints=tuple(
            each
            for k in range(rods)
            for each in (joint(f"A{k}", f"ground.A{k}", f"rod{k}.A"), joint(f"B{k}", f"rod{k}.B", f"plate.B{k}"))
        ),
        gravity=(0.0, -9.81),
        assemblies=(Assembly("up", {f"rod{k}": 1.2 for k in range(rods)} | {"plate": 0.0}),),
    )


@pytest.mark.parametrize("kind", KINDS)
def test_rows_that_follow_from_others_do_no_harm(kind):
    system = build_system(platform(3))
    found, exact = run(system, kind), run(system, "tr-bdf2", tolerance=1e-7)
    # The platform is told by one of its points, the tolerance is a mean over mass.
    assert distance(found, exact) < 3e-5
    assert np.abs(found.multipliers - exact.multipliers).max() < 1e-3 * np.abs(exact.multipliers).max()


@pytest.mark.parametrize("kind", ["rk45", "ida", "bdf"])
def test_interrupt_keeps_the_partial_solution(kind):
    system = build_system(arm())

    def stop(time):
        if time > 0.01:
            raise KeyboardInterrupt

    times = np.linspace(0.0, 20.0, 20001)
    found = run(system, kind, times=times, on_progress=stop)
    assert found.status == "interrupted"
    assert np.any(found.t > 0.009)
    assert found.t[-1] < 15.0
    assert np.all(np.isfinite(found.a))


@pytest.mark.parametrize("kind", ["radau", "bdf", "ida"])
def test_interrupt_within_an_evaluation(kind, monkeypatch):
    system = build_system(arm())
    from paraflex.integrators.forms import DescriptorForm

    home, name = (DescriptorForm, "residual") if kind == "ida" else (OdeForm, "rates")
    inner, calls = getattr(home, name), []

    def evaluate(*arguments):
        calls.append(1)
        if len(calls) > 200:
            raise KeyboardInterrupt
        return inner(*arguments)

    monkeypatch.setattr(home, name, evaluate)
    found = run(system, kind, tolerance=1e-7)
    assert found.status == "interrupted"
    assert 0 < found.t.size < TIMES.size


@pytest.mark.parametrize("kind", ["adams", "bdf", "ida"])
def test_without_sundials_the_remedy_is_named(kind, monkeypatch):
    monkeypatch.setitem(sys.modules, "sksundae", None)
    monkeypatch.setitem(sys.modules, "sksundae.cvode", None)
    with pytest.raises(InputError, match=r"pip install 'paraflex\[sundials\]'") as raised:
        run(build_system(arm()), kind)
    assert raised.value.field == "method"


def test_gains_that_follow_the_step_are_refused():
    with pytest.raises(InputError, match="automatic gains need the step sizes, which bdf does not show"):
        run(build_system(arm()), "bdf", automatic_gains=True)


def test_half_an_order_is_refused():
    with pytest.raises(InputError, match="whole number"):
        BDF(max_order=2.5)


@pytest.mark.parametrize("kind", GUESTS)
def test_a_solution_that_blows_up_is_an_error_with_what_was_found(kind):
    """A torque that grows without bound within the run."""
    system = build_system(arm())
    coefficients = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1e12]])
    torque = InputSignals(np.array([0.0, 1.0]), coefficients)
    with pytest.raises(IntegrationError) as raised:
        run(system, kind, torques=torque, times=np.linspace(0.0, 1.0, 101))
    partial = raised.value.partial
    assert partial.status == "failed"
    assert 0 < partial.t.size < 101
    assert np.all(np.isfinite(partial.q))


# --- Explicit methods on stiff mechanisms ---------------------------------------------------------------------------


def stiff_problem(times):
    system = build_system(arm(STEEL))
    signals, _ = pack_signals(system.mechanism, constant_signals([0.0], times[-1]), times[-1])
    return make_problem(system, signals, consistent_state(system, system.mechanism.assembly()), times)


def test_largest_rate_is_that_of_the_linearised_mechanism():
    """At rest and without weight the largest eigenvalue is the highest natural frequency."""
    from paraflex.dynamics import natural_frequencies

    problem = stiff_problem(np.array([0.0, 1.0]))
    system = build_system(replace(problem.system.mechanism, gravity=(0.0, 0.0)))
    signals, _ = pack_signals(system.mechanism, constant_signals([0.0], 1.0), 1.0)
    state = consistent_state(system, system.mechanism.assembly())
    problem = make_problem(system, signals, State(0.0, state.q, 0.0 * state.v), np.array([1.0]))
    highest = natural_frequencies(system, state).frequencies.max()
    assert largest_rate(OdeForm(problem, IntegrationOptions()), problem) == pytest.approx(highest, rel=1e-6)


def test_the_limit_of_runge_kutta_is_that_of_its_polynomial():
    """Steps of 0.99 of it keep an oscillation bounded, of 1.1 of it do not."""
    coefficients = (1.0, 1.0, 1 / 2, 1 / 6, 1 / 24, 1 / 120, 1 / 600)

    def size(y):
        return abs(sum(c * (1j * y) ** k for k, c in enumerate(coefficients)))

    assert size(0.999 * RK45.stability_limit) < 1.0
    assert size(1.01 * RK45.stability_limit) > 1.0


@pytest.mark.parametrize("method", [name for name in GUESTS if METHODS[name].explicit])
def test_an_explicit_method_warns_once_of_a_stiff_mechanism(method):
    def stop(_):
        raise KeyboardInterrupt

    system, times = build_system(arm(STEEL)), np.linspace(0.0, 20.0, 11)
    with pytest.warns(StiffnessWarning, match="steps for this run") as caught:
        run(system, method, times=times, on_progress=stop, torques=constant_signals([0.0], 20.0)[0])
    assert len(caught) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(system, "bdf", times=times, on_progress=stop, torques=constant_signals([0.0], 20.0)[0])


def test_attempts_are_told_by_their_times():
    # Two attempts of five places, the first longer; what is evaluated at the start counts for nothing.
    first, second = 0.1 * np.array([0.2, 0.3, 0.8, 8 / 9, 1.0]), 0.037 * np.array([0.2, 0.3, 0.8, 8 / 9, 1.0])
    assert attempts([3.0, *(3.0 + first), *(3.0 + second), 3.037], 3.0, 5) == 2
    assert attempts([3.1, 3.1, 3.1], 3.0, 1) == 1


def test_ndf_is_scipys_as_it_is_and_its_order_no_parameter():
    with pytest.raises(InputError, match=r"no parameter of ndf.*it is one of adams, bdf, ida"):
        find_method("ndf", {"max_order": 2})
