"""Our own methods on a stiff flexible mechanism with a loop: orders, treatments of constraints, steps, bad input."""

import pickle
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from paraflex.errors import InputError, IntegrationError
from paraflex.files import load
from paraflex.integrators import METHODS, IntegrationOptions, integrate
from paraflex.integrators.methods import BDF, HHT, Family, GeneralisedAlpha, Newmark, Wilson, find_method
from paraflex.integrators.newmark import NewmarkMethod
from paraflex.mechanism import Geometry
from paraflex.studies import tracking_case
from paraflex.tracking import plan_tracking

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

import orders as study

NATIVE = [name for name, method in METHODS.items() if method.family in (Family.ESDIRK, Family.NEWMARK)]
ESDIRK = [name for name in NATIVE if METHODS[name].family is Family.ESDIRK]
INDEX_3 = [name for name in NATIVE if METHODS[name].family is Family.NEWMARK]
OF_ORDER_2 = [name for name in NATIVE if METHODS[name].order == 2]


# --- Orders --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", OF_ORDER_2)
def test_order_2_in_positions_velocities_and_multipliers(method):
    """Of all modes, up to 290,000 rad/s: hω is 290 at the coarsest step."""
    steps = (50, 100, 200)
    assert study.orders(steps, study.errors(method, steps)) == pytest.approx(2.0, abs=0.06)


@pytest.mark.parametrize(("gamma", "order"), [(0.6, 1.0), (0.5, 2.0)])
def test_newmark_is_of_order_1_where_it_damps(gamma, order):
    steps = (50, 100, 200)
    found = study.orders(steps, study.errors(Newmark(gamma=gamma), steps))
    # Without damping multipliers of index 3 keep the error of the first step.
    assert found[:, :2] == pytest.approx(order, abs=0.12)
    assert Newmark(gamma=gamma, beta=0.3025).numbers.order == order


def test_order_3_in_positions_velocities_and_multipliers():
    steps = (60, 90, 135)
    assert study.orders(steps, study.errors("esdirk3", steps, modes=1)) == pytest.approx(3.0, abs=0.25)


def test_order_4_in_positions_velocities_and_multipliers():
    coarse, fine = (24, 36, 54), (90, 135, 200)
    assert study.orders(coarse, study.errors("esdirk4", coarse, modes=2))[:, 0] == pytest.approx(4.0, abs=0.4)
    found = study.orders(fine[:2], study.errors("esdirk4", fine[:2], modes=1))
    assert found[:, 1:] == pytest.approx(4.0, abs=0.5)


def test_stiff_modes_cost_velocities_and_multipliers_their_order():
    """Documented: stages are of order 2, which shows while modes are stiffer than the step."""
    steps = (100, 225)
    assert np.all(study.orders(steps, study.errors("esdirk4", steps))[:, 1:] < 3.5)


def test_stabilised_index_2_has_multipliers_of_second_order():
    steps = (60, 90, 135)
    found = study.orders(steps, study.errors("tr-bdf2", steps, modes=1, constraints="ggl"))
    assert found[:, 0] == pytest.approx(2.0, abs=0.1)
    assert np.all(found[:, 1:] > 1.2)


# --- Constraints ---------------------------------------------------------------------------------------------------


def violations(method, **options):
    solution = study.run(study.started(), method, 200, **options)
    return solution.constraint_position_max, solution.constraint_velocity_max


@pytest.mark.parametrize("method", ESDIRK)
def test_projection_and_stabilised_index_2_keep_positions_and_velocities(method):
    phi, dphi = violations(method)
    for treatment in ("projection", "ggl"):
        position, velocity = violations(method, constraints=treatment)
        assert position < 1e-13
        assert velocity < 1e-10
    # What there is to keep: index 1 alone drifts.
    bare = violations(method, alpha=0.0, beta=0.0)
    assert bare[1] > 1e-11
    assert phi < 1e-4
    assert dphi < 1e-2


@pytest.mark.parametrize("method", INDEX_3)
def test_index_3_keeps_positions_at_every_step(method):
    position, velocity = violations(method)
    assert position < 1e-13
    # Velocities are left to themselves where steps are fixed, but by Wilson's method.
    assert velocity < 1e-12 if method == "wilson-theta" else velocity > 1e-9


@pytest.mark.parametrize("method", [name for name in INDEX_3 if name in OF_ORDER_2])
def test_index_3_keeps_velocities_too_where_steps_vary(method):
    problem = study.started()
    options = IntegrationOptions(method=method, tolerance=1e-4)
    solution = integrate(problem[0], study.smooth_torque(), problem[1], np.array([study.END]), options=options)
    assert solution.constraint_position_max < 1e-12
    # Projection leaves the square of what it corrects: without it, as with fixed steps, velocities are off by 2e-5.
    assert solution.constraint_velocity_max < 1e-8


def test_automatic_gains_hold_constraints_better_the_smaller_the_step():
    parts = []
    for steps in (100, 400, 1600):
        fixed = study.run(study.started(), "tr-bdf2", steps)
        automatic = study.run(study.started(), "tr-bdf2", steps, automatic_gains=True)
        parts.append(automatic.constraint_position_max / fixed.constraint_position_max)
    assert parts[0] < 0.6
    assert parts[1] < 0.4 * parts[0]
    assert parts[2] < 0.4 * parts[1]


@pytest.mark.parametrize("step", [1e-4, 1e-5, 1e-6])
def test_small_steps_do_not_ruin_index_3(step):
    """Multipliers are found to the digits that positions leave, eps / h^2 of an acceleration; no system is singular."""
    system, state = study.started(1)
    times = np.array([20 * step])
    options = IntegrationOptions(method="generalised-alpha", step=step)
    found = integrate(system, study.smooth_torque(), state, times, options=options)
    exact = integrate(system, study.smooth_torque(), state, times, options=IntegrationOptions(tolerance=1e-9))
    assert found.newton_iterations < 4 * found.steps
    assert found.q == pytest.approx(exact.q, rel=0, abs=0.2 * step**2 + 1e-12)
    assert found.multipliers == pytest.approx(exact.multipliers, abs=1e-14 / step**2 + 300.0 * step**2)


# --- Steps ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", NATIVE)
def test_fixed_steps_are_as_many_as_asked_for(method):
    solution = study.run(study.started(), method, 40)
    assert (solution.steps, solution.rejected, solution.method) == (40, 0, method)
    # Factors serve on where that is cheaper than a new one: less so where a step has many stages.
    many_stages = method in ("esdirk4", "esdirk5")
    assert solution.factorisations < (0.8 if many_stages else 0.6) * solution.steps


def test_steps_of_many_stages_take_new_factors_where_old_ones_cost_more():
    """In large steps of a vibrating mechanism a factor serves one step or two; a small step's serves for many."""
    robot = load("raparm_i")
    task = plan_tracking(robot.mechanism, robot.paths["square"], duration=0.2)

    def run(method, step):
        return task.simulate("++++", options=IntegrationOptions(method=method, step=step)).solution

    large, small = run("esdirk5", 1.2e-3), run("tr-bdf2", 1e-4)
    assert large.factorisations > 0.5 * large.steps
    assert small.factorisations < 0.4 * small.steps


@pytest.mark.parametrize("method", NATIVE)
def test_errors_fall_with_the_tolerance(method):
    problem, times = study.started(), np.linspace(0.0, study.END, 11)

    def path(tolerance, name):
        options = IntegrationOptions(method=name, tolerance=tolerance)
        return integrate(problem[0], study.smooth_torque(), problem[1], times, options=options).q[:, :3]

    exact = path(1e-9, "esdirk5")
    # The finer one takes Newmark's method too long.
    finer = 1e-7 if method == "newmark" else 1e-8
    off = [np.max(np.abs(path(tolerance, method) - exact)) for tolerance in (1e-5, finer)]
    assert off[1] < 0.15 * off[0] + 1e-7
    # Of the crank's angle: a tolerance of 1e-5 m, and it is 0.1 m long.
    assert off[0] < 1e-3


@pytest.mark.parametrize("method", NATIVE)
def test_second_order_geometry_runs_by_every_method(method):
    problem, times = study.started(None, Geometry.SECOND_ORDER), np.array([study.END])
    found = [
        integrate(
            problem[0], study.smooth_torque(), problem[1], times,
            options=IntegrationOptions(method=name, tolerance=tolerance),
        ).q[-1, :3]
        for name, tolerance in ((method, 1e-5), ("esdirk4", 1e-7))
    ]  # fmt: skip
    # A tolerance of 1e-5 m, of a crank 0.1 m long.
    assert found[0] == pytest.approx(found[1], abs=1e-3)


# --- The study of the paper ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def raparm():
    model = load("raparm_i")
    return plan_tracking(model.mechanism, model.path(), duration=0.35, samples=71)


def paths(task, **options):
    """Places of the end-effector (samples, 1, 2), and the solution."""
    case = tracking_case(task, "++++")
    solution = case.solve(IntegrationOptions(**options), None)
    return case.places(solution), solution


@pytest.fixture(scope="module")
def converged_path(raparm):
    return paths(raparm, method="esdirk5", tolerance=1e-7)[0]


@pytest.mark.parametrize("method", NATIVE)
def test_methods_agree_on_the_path_of_the_end_effector(raparm, converged_path, method):
    """Those of our own; the others take minutes and stand in benchmarks/agreement.py."""
    # Of order 1 it would take too long.
    chosen = Newmark(gamma=0.5) if method == "newmark" else method
    found, _ = paths(raparm, method=chosen, tolerance={"esdirk3": 1e-6, "wilson-theta": 3e-7}.get(method, 2e-6))
    assert np.max(np.linalg.norm(found - converged_path, axis=-1)) < 1e-6


def test_newton_needs_few_iterations_and_few_factors(raparm):
    """TR-BDF2 on the study: guesses are extrapolated, factors reused while they serve."""
    _, solution = paths(raparm, method="tr-bdf2", tolerance=1e-4)
    attempts = solution.steps + solution.rejected
    assert solution.newton_iterations < 2.5 * 2 * attempts
    assert solution.factorisations < 0.7 * attempts


# --- Bad input and trouble -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "field", "words"),
    [
        ({"method": "trbdf"}, "method", "tr-bdf2"),
        ({"method": "newmark", "parameters": {"gamma": 0.6}}, "parameters", "method=paraflex.methods.Newmark(...)"),
        ({"method": "radau", "step": 1e-4}, "step", "tolerance"),
        ({"step": -1.0}, "step", "seconds"),
        ({"constraints": "ggl", "method": "newmark"}, "constraints", "position"),
        ({"constraints": "projektion"}, "constraints", "projection"),
        ({"constraints": "projection", "automatic_gains": True}, "automatic_gains", "baumgarte"),
    ],
)
def test_bad_options_are_told(options, field, words):
    with pytest.raises(InputError) as caught:
        IntegrationOptions(**options)
    assert caught.value.field == field
    assert words in caught.value.remedy


@pytest.mark.parametrize(
    ("method", "given", "words"),
    [
        (Newmark, {"gamma": 0.4}, "0.5"),
        (Newmark, {"gamma": 0.7, "beta": 0.3}, "0.36"),
        (Wilson, {"theta": 1.2}, "1.36"),
        (HHT, {"alpha": -0.5}, "-0.333"),
        (GeneralisedAlpha, {"spectral_radius": 1.5}, "1"),
        (GeneralisedAlpha, {"spectral_radius": np.nan}, "1"),
        (GeneralisedAlpha, {"spectral_radius": "high"}, "number"),
    ],
)
def test_a_method_checks_its_parameters_itself_and_as_files_have_them(method, given, words):
    field = list(given)[-1]
    for make, told in ((method, field), (lambda **x: find_method(method.name, x), f"parameters.{field}")):
        with pytest.raises(InputError) as caught:
            make(**given)
        assert caught.value.field == told
        assert words in caught.value.remedy


def test_a_method_and_its_name_are_the_same():
    for name, method in METHODS.items():
        assert IntegrationOptions(method=name) == IntegrationOptions(method=method)
        assert IntegrationOptions(method=method).method is method
        assert find_method(name, {"max_order": 2.0} if "max_order" in method.parameters else None).name == name
    assert find_method("bdf", {"max_order": 3.0}) == BDF(max_order=3) != METHODS["bdf"]
    options = IntegrationOptions(method=GeneralisedAlpha(spectral_radius=0.8), step=1e-3)
    assert replace(options, tolerance=1e-7).method == GeneralisedAlpha(spectral_radius=0.8)
    assert pickle.loads(pickle.dumps(options)) == options
    assert options.to_dict()["method_parameters"] == '{"spectral_radius": 0.8}'
    # Another method has parameters of its own.
    assert replace(options, method="hht-alpha").method == HHT()


def test_parameters_of_another_method_are_told():
    with pytest.raises(InputError, match=r"no parameter of generalised-alpha \(got 'rho'\).*spectral_radius"):
        find_method("generalised-alpha", {"rho": 0.5})


def test_no_name_stands_for_a_method_of_the_newmark_family_that_it_is_not():
    """Numbers belong to the method: none of unknown name has those of generalised alpha."""

    class MyAlpha(NewmarkMethod):
        """Says nothing of its numbers."""

        name, title = "my-alpha", "My alpha"

    with pytest.raises(TypeError, match="numbers"):
        MyAlpha()
    with pytest.raises(InputError, match="unknown method"):
        IntegrationOptions(method="my-alpha")
    assert len({METHODS[name].numbers for name in INDEX_3}) == len(INDEX_3)


def test_a_method_that_is_not_listed_runs():
    """Of whoever has a tableau: the trapezoidal rule by another name."""

    class Mine(type(METHODS["trapezoidal"])):
        name = "mine"

    mine, known = (study.run(study.started(1), method, 20) for method in (Mine(), "trapezoidal"))
    np.testing.assert_array_equal(mine.q, known.q)
    assert mine.method == "mine"


def test_an_unknown_method_lists_the_known():
    with pytest.raises(InputError) as caught:
        IntegrationOptions(method="esdirk6")
    assert all(name in str(caught.value) for name in METHODS)


@pytest.mark.parametrize("method", ["newmark", "esdirk4"])
def test_newtons_failure_at_a_fixed_step_is_typed_and_keeps_what_was_computed(method):
    """A step in which the crank would turn several times."""
    problem = study.started()
    options = IntegrationOptions(method=method, step=0.5)
    torque = study.smooth_torque()._replace(coefficients=2000.0 * study.smooth_torque().coefficients)
    with pytest.raises(IntegrationError) as caught:
        integrate(problem[0], torque, problem[1], np.array([0.0, 1.0]), options=options)
    assert "Newton" in caught.value.cause
    assert caught.value.moment.time < 1.0
    assert caught.value.partial.status == "failed"
    assert caught.value.partial.t.size == 1


@pytest.mark.parametrize("value", [1, np.float32(1.0), np.array(1.0), True])
def test_numbers_of_options_are_converted_once(value):
    """Kernels would be compiled anew for another type of number."""
    options = IntegrationOptions(step=value, alpha=value)
    assert type(options.step) is type(options.alpha) is float
    for wrong in (1j, 10**400):
        with pytest.raises(InputError, match="step: not a number"):
            IntegrationOptions(step=wrong)
