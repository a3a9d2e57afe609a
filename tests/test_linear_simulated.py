"""Linear models against runs of the nonlinear equations: decrements of vibrations that die away, and sine tests."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.interpolate import PPoly, make_interp_spline

import paraflex as pf
from paraflex.dynamics import State
from paraflex.dynamics.projection import assemble, constraint_change, project
from paraflex.dynamics.signals import moment_signals
from paraflex.mechanism import LossFactor, TabulatedProfile, TorsionalDamper, TorsionalSpring

# Turn of the motors in a vibration [rad]: terms of second order are a part of this size.
AMPLITUDE = 5e-7
OPTIONS = pf.IntegrationOptions(method="esdirk5", tolerance=1e-13)
JOINTS = ["A1", "A2"]


@pytest.fixture(scope="module", params=["linear", "second-order"])
def model(request):
    """Of a five-bar at equilibrium under weight, on springs and dampers, its links with structural damping."""
    bar = pf.load("five_bar").mechanism.with_beams(elements=1).with_geometry(request.param)
    mechanism = replace(
        bar,
        bodies=tuple(replace(body, damping=LossFactor(0.02, 100.0)) for body in bar.bodies),
        springs=(TorsionalSpring("s1", "A1", 80.0, 2.0), TorsionalSpring("s2", "A2", 60.0, 1.1)),
        dampers=(TorsionalDamper("d1", "A1", 0.05), TorsionalDamper("d2", "C", 0.01)),
        gravity=(0.0, -9.81),
    )
    return pf.linearise(mechanism, mode="++", balanced=True).select(outputs=JOINTS)


def moved(model, change):
    """The state nearest to the model's point moved by a change of its states."""
    system, point, f = model.minimal.system, model.minimal.point, len(model.states) // 2
    signals, Z = moment_signals(system.mechanism, 0.0), model.minimal.directions
    q, _ = assemble(system, signals, 0.0, point.q + Z @ change[:f], partial(constraint_change, system))
    v = project(constraint_change(system, q), Z @ change[f:], lambda v: system.constraints(signals, 0.0, q, v)[1])
    return State(0.0, q, v)


def simulated(model, change, times, left=0.0):
    """Turns of the motors (k, 2) in a run from a changed state, with a change (k,) of the left motor's torque."""
    system, point = model.minimal.system, model.minimal.point
    mechanism, torques = system.mechanism, dict(zip(("left", "right"), point.torques.tolist(), strict=True))
    torques["left"] = TabulatedProfile(tuple(times), tuple(torques["left"] + left + 0.0 * times))
    start = moved(model, change)
    run = pf.simulate_motion(
        mechanism, times[-1], samples=times.size, start=start, torques=torques, options=OPTIONS
    )  # fmt: skip
    values = [pf.dynamics.joint_coordinate(system, joint, run.solution.q).value for joint in JOINTS]
    still = [pf.dynamics.joint_coordinate(system, joint, point.q[None]).value for joint in JOINTS]
    return np.stack(values, axis=1) - np.stack(still, axis=1)


def decrement(times, values):
    """Natural logarithm of the ratio of a vibration's swings a period apart; a swing is from one turn to the next."""
    spline = make_interp_spline(times, values, k=5)
    turns = np.sort(PPoly.from_spline(spline.derivative()).roots(extrapolate=False))
    swings = np.abs(np.diff(spline(turns)))
    periods = (swings.size - 1) // 2
    assert periods >= 4
    return np.log(swings[0] / swings[2 * periods]) / periods


@pytest.mark.parametrize("mode", range(4))
def test_logarithmic_decrement_of_a_simulated_vibration(model, mode):
    """Started in the shape of one mode: two of springs and dampers, two of links with structural damping."""
    found, shapes = np.linalg.eig(model.A)
    k = [k for k in np.argsort(np.abs(found)) if found[k].imag > 0.0][mode]
    pole, shape = found[k], shapes[:, k]
    poles = model.poles()
    assert poles[poles.imag > 0.0][mode] == pytest.approx(pole, rel=1e-6)
    seen = int(np.argmax(np.abs(model.C @ shape)))
    change = np.real(AMPLITUDE * shape / (model.C @ shape)[seen])
    times = np.linspace(0.0, 6.0 * 2.0 * np.pi / pole.imag, 401)
    turns = simulated(model, change, times)[:, seen]
    assert decrement(times, turns) == pytest.approx(-2.0 * np.pi * pole.real / pole.imag, rel=1e-4)


@pytest.mark.parametrize("frequency", [3.0, 20.0, 50.0, 300.0, 1000.0, 1150.0])
def test_frequency_response_is_that_of_a_simulated_sine_sweep(model, frequency):
    """Started on the periodic solution, so that there is nothing to die away; amplitude and phase by least squares."""
    f = len(model.states) // 2
    states = np.linalg.solve(1j * frequency * np.eye(2 * f) - model.A, model.B[:, 0])
    expected = model.frequency_response([frequency])[0, :, 0]
    torque = AMPLITUDE / np.abs(expected).max()
    times = np.linspace(0.0, 3.0 * 2.0 * np.pi / frequency, 241)
    turns = simulated(model, np.imag(torque * states), times, torque * np.sin(frequency * times))
    basis = np.column_stack([np.sin(frequency * times), np.cos(frequency * times), np.ones_like(times)])
    fitted = np.linalg.lstsq(basis, turns, rcond=None)[0]
    found = (fitted[0] + 1j * fitted[1]) / torque
    assert found == pytest.approx(expected, rel=1e-5)
