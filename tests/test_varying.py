"""Linear models along motions: against runs with a perturbation, closed forms, and integration of the same matrices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import paraflex as pf
from paraflex.dynamics import State
from paraflex.dynamics.points import marker_place
from paraflex.errors import InputError, SingularPositionError
from paraflex.linear.discrete import InputHold, transitions
from paraflex.mechanism import Motor, PointRef

OPTIONS = pf.IntegrationOptions(method="esdirk5", tolerance=1e-11)
TORQUES = {"left": 0.6, "right": -0.2}
DURATION, SAMPLES = 0.02, 161


def five_bar(geometry="second-order"):
    return pf.load("five_bar").mechanism.with_beams(elements=1).with_geometry(geometry)


def run(mechanism, torques=TORQUES, start=None, samples=SAMPLES):
    return pf.simulate_motion(mechanism, DURATION, samples=samples, torques=torques, start=start, options=OPTIONS)


def pushed(nominal, change):
    """Its start with rates changed by those (f,) of the minimal coordinates, to which constraints are linear."""
    Z, solution = pf.linearise(nominal).minimal.directions, nominal.solution
    return State(0.0, solution.q[0], solution.v[0] + Z @ change)


@pytest.fixture(scope="module", params=["linear", "second-order"])
def nominal(request):
    """A closed mechanism of flexible links that motors set in motion."""
    return run(five_bar(request.param))


@pytest.fixture(scope="module")
def varying(nominal):
    return pf.linearise_along(nominal)


@pytest.mark.parametrize("changed", ["torques", "start"])
def test_error_of_a_predicted_perturbation_falls_fourfold_when_it_is_halved(nominal, varying, changed):
    """Of states, in the norm of energy, and of outputs; the error is that of second order in the perturbation."""
    errors, f = [], len(varying.states) // 2
    for size in (1.0, 0.5, 0.25):
        if changed == "torques":
            more = {"left": 0.1 * size, "right": -0.05 * size}
            other = run(nominal.system.mechanism, {name: TORQUES[name] + more[name] for name in TORQUES})
            predicted = varying.predict(None, more)
        else:
            rates = np.zeros(f)
            rates[:3] = np.array([1.0, -0.4, 0.01]) * size
            other = run(nominal.system.mechanism, TORQUES, pushed(nominal, rates))
            predicted = varying.predict(np.concatenate([np.zeros(f), rates]))
        found = varying.along(other)
        states = (predicted.states - (found.states - varying.nominal.states)) @ varying.modal[0].T
        outputs = predicted.outputs - (found.outputs - varying.nominal.outputs)
        errors.append([np.linalg.norm(states, axis=1).max(), *np.abs(outputs).max(axis=0)])
    errors = np.array(errors)
    assert errors[:-1] / errors[1:] == pytest.approx(4.0, rel=0.05)


def test_matrices_are_those_of_the_models_at_the_samples(nominal, varying):
    at = varying.times[60]
    model = pf.linearise(nominal, at=at)
    assert model.states == varying.states
    assert varying.A[60] == pytest.approx(model.A, rel=1e-12, abs=1e-12 * np.abs(model.A).max())
    few = pf.linearise_along(nominal, times=varying.times[::40])
    assert few.times == pytest.approx(varying.times[::40])
    assert few.C[1] == pytest.approx(varying.C[40])


def test_nominal_values_are_those_of_the_run(nominal, varying):
    states, inputs, outputs = varying.nominal
    place = marker_place(nominal.system, nominal.system.marker(PointRef.parse("distal1.C")), nominal.solution.q)[0]
    assert inputs == pytest.approx(np.tile(list(TORQUES.values()), (SAMPLES, 1)))
    assert outputs[:, 2:] == pytest.approx(place, abs=1e-12)
    assert states[:, :2] == pytest.approx(outputs[:, :2])


def test_a_plan_has_a_model_along_it():
    task = pf.plan(five_bar(), pf.load("five_bar").path("line"), samples=21, assembly="outward", duration=0.1)
    varying = pf.linearise_along(task, mode="++", forces=["distal1.C"])
    assert varying.about == "a planned motion"
    assert [one.name for one in varying.inputs] == ["left", "right", "distal1.C.x", "distal1.C.y"]
    assert varying.nominal.outputs[:, 2:] == pytest.approx(task.motion.desired.position, abs=1e-9)
    assert varying.nominal.inputs[:, :2] == pytest.approx(task.torques("++").evaluate(task.motion.t), abs=1e-9)
    assert not np.any(varying.nominal.inputs[:, 2:])


# --- Coordinates ------------------------------------------------------------------------------------------------------


def test_coordinates_of_the_end_effector_predict_the_same_outputs(nominal, varying):
    task = pf.linearise_along(nominal, coordinates="task")
    assert [one.name for one in task.states[:2]] == ["x", "y"]
    assert task.nominal.states[:, :2] == pytest.approx(task.nominal.outputs[:, 2:], abs=1e-12)
    f, q, v = len(task.states) // 2, nominal.solution.q, nominal.solution.v
    near = [task.coordinates.values(task.chosen, q + h * v, v)[:, :f] for h in (1e-4, -1e-4)]
    rates = (near[0] - near[1]) / 2e-4
    assert task.nominal.states[:, f:] == pytest.approx(rates, rel=1e-5, abs=1e-6)
    du = {"left": 0.1, "right": 0.02}
    expected = varying.predict(None, du).outputs
    assert task.predict(None, du).outputs == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())


def pushed_slider_crank():
    """A motor pushes the slider, which is at rest at the dead centres, whatever turns the crank."""
    crank = pf.load("slider_crank").mechanism
    return replace(crank, motors=(Motor("push", "rail"),), modes=(), end_effector=None, dampers=())


def test_coordinates_that_become_singular_are_chosen_anew():
    """Through a dead centre; the travel of the slider is no state then, and the model holds as well as elsewhere."""
    mechanism = pushed_slider_crank()

    def turning(force):
        start = pf.Start(angular={"crank": 40.0})
        return pf.simulate_motion(
            mechanism, 0.08, samples=161, torques={"push": 2.0 + force}, start=start, options=OPTIONS
        )  # fmt: skip

    nominal = turning(0.0)
    assert pf.linearise(nominal).states[0].name == "rail"
    varying = pf.linearise_along(nominal)
    assert np.ptp(np.sign(np.diff(varying.nominal.outputs[:, 0]))) == 2.0
    assert "rail" not in [one.name for one in varying.states]
    errors = []
    for size in (1.0, 0.5):
        found = varying.along(turning(size)).outputs - varying.nominal.outputs
        errors.append(np.abs(found - varying.predict(None, {"push": size}).outputs).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_coordinates_of_a_motion_that_stays_singular_are_refused():
    """The end-effector's x alone, where it turns back: its rate says nothing there about the crank's."""
    model = replace(pf.load("slider_crank").mechanism, dampers=())
    run = pf.simulate_motion(model, 0.08, samples=161, start=pf.Start(angular={"crank": 40.0}), options=OPTIONS)
    with pytest.raises(SingularPositionError, match=r"coordinates of the linear model .* x"):
        pf.linearise_along(run, coordinates="task")


# --- Samples ----------------------------------------------------------------------------------------------------------


def swinging(t):
    """A fast and a slow oscillator, coupled, both with stiffness in time."""
    slow, fast = 3.0 + 2.0 * np.sin(5.0 * t), 4e4 * (1.0 + 0.2 * np.cos(3.0 * t))
    A = np.zeros((4, 4))
    A[:2, 2:] = np.eye(2)
    A[2:] = [[-9.0 * slow, 30.0, -0.3, 0.0], [20.0, -fast, 0.0, -0.5]]
    return A, np.array([[0.0], [0.0], [1.0 + t], [5.0 * np.cos(2.0 * t)]])


def sampled(samples, hold, periods):
    times = np.linspace(0.0, 1.0, samples)
    A, B = (np.array(each) for each in zip(*(swinging(t) for t in times), strict=True))
    size = np.array([1.0, 200.0, 1.0, 1.0])
    found = transitions(times, A * size[:, None] / size, B * size[:, None], np.linspace(0.0, 1.0, periods + 1), hold)
    return found, size


@pytest.fixture(scope="module")
def exact():
    """Changes (4, 6) over the first half of the unit of time, with x, with u constant and with u = t / 0.5."""
    ends = []
    for k in range(6):

        def slope(t, x, k=k):
            A, B = swinging(t)
            return A @ x + B[:, 0] * (0.0, 1.0, 2.0 * t)[max(k - 3, 0)]

        start = np.eye(4, 6)[:, k]
        ends.append(solve_ivp(slope, (0.0, 0.5), start, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1])
    return np.array(ends).T


@pytest.mark.parametrize("hold", InputHold)
def test_transitions_are_those_of_integration_and_their_error_is_estimated(exact, hold):
    """Of fourth order, and as exact as the estimate says."""
    apart, size = [], np.array([1.0, 200.0, 1.0, 1.0])
    for samples in (161, 321):
        found, _ = sampled(samples, hold, 2)
        Phi, Gamma, following = found.Phi[0], found.Gamma[0], found.Gamma_next[0]
        expected = exact * size[:, None]
        assert np.any(following) == (hold is InputHold.FIRST)
        inputs = Gamma + following if hold is InputHold.FIRST else Gamma
        errors = [Phi - expected[:, :4] / size, inputs[:, 0] - expected[:, 4]]
        if hold is InputHold.FIRST:
            errors.append(following[:, 0] - expected[:, 5])
        apart.append([np.linalg.norm(error) for error in errors])
        assert 0.2 * found.error[0] < np.linalg.norm(errors[0], 2) < 1.5 * found.error[0]
    assert np.array(apart[0]) / apart[1] == pytest.approx(16.0, rel=0.3)


def test_periods_of_other_lengths_compose(varying):
    """Transitions over two samples are products of those over one, and constant inputs are straight lines too."""
    one, two = varying.discretised(hold="zero"), varying.discretised(2.0 * varying.times[1])
    assert two.times == pytest.approx(varying.times[::2])
    energy = varying.modal
    expected = energy[0] @ one.Phi[21] @ one.Phi[20] @ energy[1]
    assert energy[0] @ two.Phi[10] @ energy[1] == pytest.approx(expected, abs=1e-9)
    du = {"left": 0.1}
    assert two.predict(None, du).outputs == pytest.approx(varying.predict(None, du).outputs[::2], rel=1e-6, abs=1e-12)
    assert varying.discretised(3.3 * varying.times[1]).times[-1] <= varying.times[-1]


def test_labelled_arrays(varying):
    data = varying.to_xarray()
    assert data["A"].dims == ("time", "state", "state_of")
    assert data["nominal_input"].sel(input="left").values == pytest.approx(TORQUES["left"])
    assert data["output_unit"].sel(output="x").item() == "m"
    sampled = varying.discretised(hold="first").to_xarray()
    assert sampled["Gamma_next"].sel(input="left").dims == ("period", "state")
    assert sampled.attrs["hold"] == "first"


def test_what_does_not_fit_is_named(nominal, varying):
    with pytest.raises(InputError, match="period"):
        varying.discretised(1.0)
    with pytest.raises(InputError, match="hold"):
        varying.discretised(hold="second")
    with pytest.raises(InputError, match=r"du\.left"):
        varying.predict(None, {"left": np.zeros(3)})
    with pytest.raises(InputError, match="x0"):
        varying.predict({"nothing": 1.0})
    with pytest.raises(InputError, match="at least 4"):
        pf.linearise_along(nominal, times=[0.0, 0.01])
    with pytest.raises(InputError, match="other bodies"):
        varying.along(run(pf.load("five_bar").mechanism.rigid(), samples=5))
