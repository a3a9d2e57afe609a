"""Reduced linear models: published and independent numbers, what must not change, and where reduction is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy

import paraflex as pf
from paraflex.linear import linearise, reduce, states_needed
from paraflex.linear.bases import craig_bampton, rubin
from paraflex.mechanism import AccelerationSensor, FlexibleBeam, JointForceSensor, ModalDamping, StrainGauge
from paraflex.paths import Line
from test_linear import HELD, hub_beam, joints_of

# A hundredth to the right of the imaginary axis: as if all vibrations were damped by one per cent.
DAMPED = 1j + 0.01


@pytest.fixture(scope="module")
def raparm_at_q():
    """RAParM-I in all modes, the end-effector at (0, 0.264)."""
    mechanism = pf.library.raparm_i()
    start = pf.plan(mechanism, Line((0.0, 0.264), (0.0, 0.26), max_acceleration=1.0), samples=2).start
    return {mode.name: linearise(mechanism, mode=mode, start=start) for mode in mechanism.modes}


def test_craig_bampton_as_published():
    """The example of JuliaFEM's ModelReduction: four masses, the last one kept, one vibration."""
    stiffness = 2.0 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1)
    stiffness[3, 3] = 1.0
    mass, rows = np.diag([2.0, 2.0, 2.0, 1.0]), np.eye(4)[3:]
    shapes = craig_bampton(mass, stiffness, rows, 1, 1.0).shapes
    shapes = shapes * np.sign([shapes[3, 0], -shapes[0, 1]])
    assert shapes.T @ mass @ shapes == pytest.approx(np.array([[2.75, -1.20711], [-1.20711, 1.0]]), abs=5e-6)
    assert shapes.T @ stiffness @ shapes == pytest.approx(np.diag([0.25, 0.292893]), abs=5e-7)


@pytest.mark.parametrize("mode", HELD)
def test_sixteen_states_of_raparm(raparm_at_q, mode):
    """Frequencies with motors free and held, in every mode, and the zeros to the encoders, which are those held."""
    full = raparm_at_q[mode]
    few = reduce(full)
    assert few.A.shape == (16, 16)
    assert [one.name for one in few.states[:4]] == ["A1", "D1", "A2", "D2"]
    assert few.held_frequencies()[:2] == pytest.approx(full.held_frequencies()[:2], rel=1e-5)
    assert few.frequencies[2:4] == pytest.approx(full.frequencies[2:4], rel=1e-4)
    assert few.frequencies[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    lowest = np.sort(np.abs(few.zeros(outputs=joints_of(full))))[:4:2]
    assert lowest == pytest.approx(full.held_frequencies()[:2], rel=1e-5)


BAND = 2.0 * np.pi * np.linspace(0.5, 40.0, 60) * DAMPED


def test_responses_without_feed_through(raparm_at_q):
    """As an independent finite-element model has them, motors to C and to encoders until 40 Hz: 4.5e-4, 5.4e-4."""
    full = raparm_at_q["++++"]
    encoders = joints_of(full)
    models = [reduce(full, states, feed_through=False) for states in (12, 16, 24)]
    errors = [[few.error(BAND, names).max() for names in (["x", "y"], encoders)] for few in models]
    assert errors[0] == pytest.approx([0.13, 0.18], rel=0.05)
    assert errors[1] == pytest.approx([4.5e-4, 5.4e-4], rel=0.15)
    assert np.max(errors[2]) < 2.1e-5
    assert not np.any(models[0].D)


@pytest.mark.parametrize("place", [(0.0, 0.264), (0.05, 0.314)])
def test_responses_of_sixteen_states_in_all_modes(place):
    """Within a thousandth until 40 Hz: C and the encoders by Craig-Bampton, every single output by Rubin's shapes."""
    mechanism = pf.library.raparm_i()
    start = pf.plan(mechanism, Line(place, (place[0], place[1] - 0.004), max_acceleration=1.0), samples=2).start
    for mode in mechanism.modes:
        full = linearise(mechanism, mode=mode, start=start)
        encoders = ["A1", "D1", "A2", "D2"]
        few = {method: reduce(full, method=method) for method in ("craig-bampton", "rubin")}
        own = few["craig-bampton"]
        assert own.error(BAND, ["x", "y"]).max() < 6e-4
        assert own.error(BAND, encoders).max() < 6.5e-4
        assert max(own.error(BAND, [name]).max() for name in ("x", "y")) < 7e-4
        assert max(few["rubin"].error(BAND, [one.name]).max() for one in full.outputs) < 6.5e-4
        # Motors' encoders see no feed-through: control loops about them stay without algebraic ones.
        assert not np.any(own.D[:4])
        assert np.any(own.D[4:])
        assert few["rubin"].frequencies[2:4] == pytest.approx(full.frequencies[2:4], rel=1e-9)
        for motors in (None, [motor.name for motor in mechanism.motors]):
            exact = full.held_frequencies(motors)[:4]
            assert few["rubin"].held_frequencies(motors)[:4] == pytest.approx(exact, rel=5e-5)


# Of the same independent model: compliance at C with the motors held [um/N], xx, xy and yy.
COMPLIANCE = {
    "++++": (75.255, 0.0, 110.034), "++-+": (116.513, -14.622, 115.216), "+-+-": (109.504, 0.0, 1862.67),
    "-+-+": (240.668, 0.0, 116.938),
}  # fmt: skip


@pytest.mark.parametrize("method", ["craig-bampton", "rubin"])
@pytest.mark.parametrize("mode", COMPLIANCE)
def test_static_compliance_with_motors_held_by_their_inputs(mode, method):
    """Of forces at C, where the basis has no interface: torques that bring the encoders back, at 0.02 Hz."""
    mechanism = pf.library.raparm_i()
    start = pf.plan(mechanism, Line((0.0, 0.264), (0.0, 0.26), max_acceleration=1.0), samples=2).start
    full = linearise(mechanism, mode=mode, start=start, forces=[str(mechanism.end_effector.point)])
    response = reduce(full, method=method).frequency_response(np.array([0.04 * np.pi + 0j]))[0].real
    outputs, motors = [one.name for one in full.outputs], full.motor_joints()
    angles, place = ([outputs.index(name) for name in names] for names in (motors, ("x", "y")))
    turned, pushed = np.split(response, [len(motors)], axis=1)
    compliance = pushed[place] - turned[place] @ np.linalg.solve(turned[angles], pushed[angles])
    assert 1e6 * compliance[[0, 0, 1], [0, 1, 1]] == pytest.approx(COMPLIANCE[mode], rel=5e-5, abs=2e-3)


def test_zeros_to_the_end_effector(raparm_at_q):
    """51.352 and 51.381 Hz in +-+-, of which shapes without feed-through have 51.343 and 51.353."""
    found = np.abs(reduce(raparm_at_q["+-+-"]).zeros(outputs=["x", "y"]))[:4:2] / (2.0 * np.pi)
    assert found == pytest.approx([51.352, 51.381], abs=2e-3)


@pytest.mark.parametrize("tied", [0.0, 1e-3])
def test_rubins_shapes_are_completed_where_modes_bring_none(tied):
    """A mass alone, free or on a soft spring, whose mode bends nothing, and a mass with a chain of three behind it.

    In turned coordinates, so that what is nothing is rounding.
    """
    turn = scipy.linalg.qr(np.random.default_rng(1).standard_normal((5, 5)))[0]
    stiffness = np.diag([tied, 0.0, 0.0, 0.0, 0.0])
    for k in range(1, 4):
        stiffness[k : k + 2, k : k + 2] += [[1.0, -1.0], [-1.0, 1.0]]
    mass, stiffness = turn.T @ np.diag([2.0, 1.0, 0.5, 0.7, 0.9]) @ turn, turn.T @ stiffness @ turn

    def spanned(shapes, one):
        return np.linalg.norm(shapes @ np.linalg.lstsq(shapes, one, rcond=None)[0] - one) < 1e-9

    # A motor at each: of the two lowest modes one brings a shape; the other shape is the chain's lowest vibration.
    rows = np.eye(5)[:2] @ turn
    shapes = rubin(mass, stiffness, rows, 2, 1.0).shapes
    assert rows @ shapes == pytest.approx(np.eye(2, 4), abs=1e-12)
    assert spanned(shapes, craig_bampton(mass, stiffness, rows, 1, 1.0).shapes[:, 2])
    # A motor at the chain: the lowest motion with it held is that of the mass alone.
    assert spanned(rubin(mass, stiffness, rows[1:], 1, 1.0).shapes, turn.T @ np.eye(5)[0]) or tied


def test_truncated_modes_mislead_those_who_hold_motors(raparm_at_q):
    """What the literature plans: modes with motors free. Four of them make 47.7 Hz of 4.10 Hz with motors held."""
    full, counts = raparm_at_q["+-+-"], (8, 16, 40)
    held = [reduce(full, states, method="modal").held_frequencies()[0] / (2.0 * np.pi) for states in counts]
    assert held[0] == pytest.approx(47.7, rel=1e-3)
    assert 5.1 < held[1] < 5.2
    assert 4.2 < held[2] < held[1]
    assert reduce(full, 12).held_frequencies()[0] / (2.0 * np.pi) == pytest.approx(4.1046, rel=1e-4)


@pytest.mark.parametrize("method", ["craig-bampton", "rubin", "modal"])
def test_outputs_with_feed_through(method):
    """Accelerations, strains and joint forces: what is left out bends statically."""
    bar = pf.load("five_bar").mechanism
    sensors = (
        AccelerationSensor("acceleration", bar.end_effector.point, "x"),
        StrainGauge("gauge", "proximal1", 0.02, distance=1e-3), JointForceSensor("force", bar.joints[0].name, "y"),
    )  # fmt: skip
    full = linearise(replace(bar, sensors=sensors), mode="++")
    s = np.array([1.0, 20.0, 60.0]) * DAMPED
    assert len(full.outputs) == 7
    few = reduce(full, len(full.states), method=method)
    assert few.frequency_response(s) == pytest.approx(full.frequency_response(s), rel=1e-6, abs=1e-12)
    few = reduce(full, 32, method=method)
    for one in full.outputs:
        assert few.error(s, [one.name]).max() < 1e-3, one.name


# --- Balanced truncation ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def damped_hub():
    """A beam on a hub with a tip mass, one per cent of damping: torque to the tip's place."""
    return linearise(hub_beam(0.1, 0.5, 0.0, ModalDamping((0.01,)))).select(outputs=["y"])


def test_hankel_singular_values(damped_hub):
    """From eight modes in closed form; the model has more, which tell in the small ones."""
    found = reduce(damped_hub, 4, method="balanced").hankel
    assert found[:4] == pytest.approx([1.19974029, 1.17598529, 0.0436528880, 0.0427891469], rel=2e-7)
    assert found[4:6] == pytest.approx([1.22232486e-3, 1.19816120e-3], rel=1e-5)


@pytest.mark.parametrize(("kept", "actual"), [(2, 0.0864138), (4, 2.41933e-3), (6, 2.07126e-4)])
def test_the_bound_of_balanced_truncation_is_above_the_error(damped_hub, kept, actual):
    """Rigid motions are kept beside them."""
    few = reduce(damped_hub, 2 + kept, method="balanced")
    near = [omega * (1.0 + np.linspace(-0.03, 0.03, 401)) for omega in damped_hub.frequencies[1:8]]
    omega = np.sort(np.concatenate([np.geomspace(0.5, 2e3, 500), *near]))
    error = np.max(np.abs(few.frequency_response(omega) - damped_hub.frequency_response(omega)))
    assert len(few.A) == 2 + kept
    assert error == pytest.approx(actual, rel=1e-4)
    assert error <= few.bound < 3.0 * error
    assert np.abs(few.poles()[:2]).max() < 1e-6


def randomly_damped(mechanism, seed):
    """The mechanism with modal damping between a thousandth and a tenth of each flexible body."""
    random = np.random.default_rng(seed)
    ratios = {body.name: 10.0 ** random.uniform(-3.0, -1.0) for body in mechanism.bodies}
    return mechanism.with_bodies(
        replace(body, damping=ModalDamping((ratios[body.name],))) if isinstance(body, FlexibleBeam) else body
        for body in mechanism.bodies
    )


@pytest.mark.parametrize(
    ("name", "mode", "outputs", "moving"),
    [
        ("raparm_i", "+-+-", ("x", "y"), None), ("raparm_i", "++++", ("A1", "D2"), None),
        ("five_bar", "++", ("x", "y"), None), ("five_bar", "++", ("A1", "A2"), 0.05), ("3prr", None, ("x", "y"), None),
        ("3rrr", None, ("x", "y"), None), ("geared_five_bar", None, ("y",), None),
    ],
)  # fmt: skip
def test_the_bound_is_nowhere_below_the_error(name, mode, outputs, moving):
    """From below all frequencies to above them, and about the peaks: down to what rounding leaves of the bound."""
    model = pf.load(name)
    mechanism = randomly_damped(model.mechanism, seed=len(name))
    source = mechanism if moving is None else pf.plan(mechanism, model.path(), samples=101)
    full = linearise(source, mode=mode, at=moving).select(outputs=list(outputs))
    poles = full.poles()
    poles = poles[poles.imag > 1.0]
    near = poles.imag[:, None] + np.outer(poles.real, np.linspace(-3.0, 3.0, 7))
    omega = np.concatenate([np.geomspace(0.1, 1e6, 200), np.abs(near).ravel()])
    exact = full.frequency_response(omega)
    for states in (8, 13, 24, 60, 80):
        few = reduce(full, states, method="balanced")
        error = np.max(np.linalg.norm(few.frequency_response(omega) - exact, 2, axis=(1, 2)))
        assert error <= few.bound
        # Nor can any model of as many states err less than the first value left out.
        left_out = few.hankel[states - (len(full.states) - few.hankel.size)]
        assert error > 0.9 * left_out or left_out < 1e-7 * few.hankel[0]


# --- How many states --------------------------------------------------------------------------------------------------


def test_states_needed_are_the_fewest_that_reach_the_error(raparm_at_q):
    models = [raparm_at_q[mode].select(outputs=["D1", "y"]) for mode in ("-+-+", "++++")]
    table = states_needed(models, 2.0 * np.pi * 40.0, error=0.02)["states"]
    s = 2.0 * np.pi * np.geomspace(0.4, 40.0, 200) * DAMPED
    for model in models:
        for method in ("craig-bampton", "modal"):
            for output in ("D1", "y"):
                count = int(table.sel(mode=model.mode, reduction=method, output=output).item())
                errors = [
                    reduce(model, states, method=method).error(s, [output]).max() for states in (count - 2, count)
                ]
                assert errors[0] > 0.02 >= errors[1]
    few = states_needed(models[:1], 2.0 * np.pi * 40.0, most=10)["states"]
    assert np.all(np.isnan(few.sel(reduction="craig-bampton")))


@pytest.mark.parametrize(
    ("given", "says"), [({"until": 0.0}, "until: is not positive"), ({"error": -1.0}, "error: is not positive")]
)
def test_bad_input_of_the_table(raparm_at_q, given, says):
    with pytest.raises(pf.InputError, match=says):
        states_needed([raparm_at_q["++++"]], **{"until": 1.0} | given)


# --- Bad input --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("states", "method", "says"),
    [
        (6, "craig-bampton", "states: are fewer than the 8 of the coordinates of 4 motors"),
        (15, "craig-bampton", "states: is odd"),
        (0, "modal", "states: no such number of states"),
        (9999, "modal", "states: no such number of states"),
        (16, "balance", "method: unknown reduction method"),
        (16, "balanced", "states: 164 of 164 states are not damped"),
    ],
)
def test_bad_input(raparm_at_q, states, method, says):
    with pytest.raises(pf.InputError, match=says):
        reduce(raparm_at_q["++++"], states, method=method)


def test_rigid_mechanisms_are_not_reduced():
    with pytest.raises(pf.InputError, match="has rigid links only"):
        reduce(linearise(pf.library.raparm_i().rigid(), mode="++++"))


def test_the_same_in_other_forms(damped_hub):
    few = reduce(damped_hub, 6)
    data = few.to_xarray()
    assert data.attrs["method"] == "craig-bampton"
    assert data["A"].sel(state="O_rate", state_of="held_mode1") == few.A[3, 1]
    assert few.to_scipy().A.shape == few.A.shape
    with pytest.raises(pf.InputError, match="no coordinates whose rates are states"):
        reduce(damped_hub, 6, method="balanced").held_frequencies()
