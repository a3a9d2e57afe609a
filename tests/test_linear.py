"""Linear models: against differences of accelerations, closed forms of a beam on a hub, tables computed elsewhere."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
import twins
from paraflex.control import DesignedLQG
from paraflex.control.laws.discrete import DiscreteModel
from paraflex.dynamics import State, build_system, inputs_of
from paraflex.dynamics.projection import second_rates
from paraflex.dynamics.signals import constant_signals, moment_signals, pack_signals
from paraflex.dynamics.tangents import MotionPoint
from paraflex.errors import InputError
from paraflex.kernel.ode import accelerations
from paraflex.kernel.packed import INDEX_1
from paraflex.linear import linearise, states_needed
from paraflex.linear.coordinates import coordinates_of
from paraflex.linear.linearise import ModelVariables, Ports, linear_model
from paraflex.linear.zeros import zeros
from paraflex.mechanism import (
    ActuationMode,
    Assembly,
    EndEffector,
    FlexibleBeam,
    LossFactor,
    LumpedMass,
    Material,
    Mechanism,
    Motor,
    PointRef,
    RevoluteJoint,
    RigidBody,
    Section,
    StrainGauge,
)
from paraflex.paths import Line
from test_tangent import NAMES, STENCIL, TIME, mechanism

# --- Against differences ----------------------------------------------------------------------------------------------


class Moving:
    """A mechanism in a random motion under random torques, with the accelerations that it then has."""

    def __init__(self, name):
        self.system = build_system(mechanism(name))
        self.q, self.v, _ = twins.random_state(self.system, 5)
        self.torques = np.random.default_rng(2).standard_normal(len(self.system.mechanism.motors))

    def accelerations(self, q, v, torques):
        system = self.system
        signals, _ = pack_signals(system.mechanism, constant_signals(torques, 1.0), 1.0)
        a, lam, acting = np.zeros(system.n), np.zeros(system.m), np.zeros(inputs_of(system.mechanism).acting)
        accelerations(system.packed, signals, TIME, INDEX_1, q, v, a, lam, acting, system.workspace(), 1e-7)
        return a, lam, acting

    @property
    def point(self):
        a, lam, acting = self.accelerations(self.q, self.v, self.torques)
        return MotionPoint(TIME, self.q, self.v, a, lam, acting)

    def model(self, driven=()):
        motors = tuple(motor.name for motor in self.system.mechanism.motors)
        ports = Ports(ActuationMode("all", motors), (), driven, ())
        return linear_model(ModelVariables(coordinates_of(self.system, driven), ports, "a motion"), self.point)


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_change_as_the_model_says(name):
    """With states, by Z and Z', and with inputs: mechanisms with one of everything, in motion, both geometries."""
    moving = Moving(name)
    model = moving.model()
    changes, states = model.minimal.changes, len(model.states)
    # Links that are stiff drown small differences; joints that slide make large ones curved.
    random, step = np.random.default_rng(1), 3e-4 if "sliders" in name else 3e-3
    for _ in range(4):
        x, u = random.standard_normal(states), random.standard_normal(len(model.inputs))
        x /= np.linalg.norm(changes.q @ x) + np.linalg.norm(changes.v @ x)
        found = sum(
            weight * moving.accelerations(
                moving.q + place * step * (changes.q @ x), moving.v + place * step * (changes.v @ x),
                moving.torques + place * step * u,
            )[0]
            for place, weight in STENCIL
        ) / step  # fmt: skip
        expected = changes.a @ np.concatenate([x, u])
        assert np.linalg.norm(found - expected) <= 1e-6 * np.linalg.norm(expected)


def test_states_are_named_joints_then_elastic_coordinates():
    model = linearise(pf.library.raparm_i())
    assert [one.name for one in model.states[:5]] == ["A1", "D1", "A2", "D2", "link1.elastic2"]
    assert model.states[len(model.states) // 2].name == "A1_rate"
    assert [one.unit for one in model.states[:5]] == ["rad", "rad", "rad", "rad", "m kg^0.5"]
    assert [one.name for one in model.inputs] == ["tau1", "tau2", "tau5", "tau6"]
    assert [one.name for one in model.outputs] == ["A1", "D1", "A2", "D2", "x", "y"]


# --- A beam on a hub --------------------------------------------------------------------------------------------------

# E I = rho A = L = 1; hub inertia, tip mass and tip inertia; roots of 4 x 4 determinants.
TIP = (11.18664272403066, 60.45169586356192)
HUBS = [
    (
        (0.1, 0.0, 0.0), (6.963923552724, 22.980238966699), (3.5160152685, 22.034491564667), TIP,
        (15.41820571698, 49.9648620318, 104.247696458861),
    ),
    (
        (0.1, 0.5, 0.0), (5.69177290724, 18.100719840919), (2.016298981807, 16.901417720974), TIP,
        (11.334014158603, 41.180441863399, 90.621912595493),
    ),
    (
        (0.1, 0.5, 0.01), (5.534329608875, 14.49388804682, 32.788534331433), (1.987525575088, 13.403441938005),
        (13.695932322466, 76.583575555098), (9.728193410433, 26.6991630571, 56.895118953066),
    ),
]  # fmt: skip


def hub_beam(hub, tip, turn, damping=None):
    lumps = (LumpedMass("O", 0.0, hub), *((LumpedMass("T", tip, turn),) if tip else ()))
    beam = FlexibleBeam(
        "beam", 1.0, Section(1.0, 1e-6), Material(1e6, 1.0), points={"O": 0.0, "T": 1.0}, elements=8, lumps=lumps,
        damping=damping,
    )  # fmt: skip
    return Mechanism(
        "hub", ground={"O": (0.0, 0.0)}, bodies=(beam,),
        joints=(RevoluteJoint("O", PointRef("ground", "O"), PointRef("beam", "O")),),
        motors=(Motor("tau", "O"),), end_effector=EndEffector(PointRef("beam", "T"), ("y",)),
        sensors=(StrainGauge("root", "beam", 0.0, distance=1.0),), assemblies=(Assembly("straight", {"beam": 0.0}),),
    )  # fmt: skip


def upper(values):
    """Magnitudes of pairs, one of each, ascending."""
    return np.sort(np.abs(values))[::2]


@pytest.mark.parametrize(("lumps", "poles", "clamped", "tip", "root"), HUBS)
def test_beam_on_a_hub(lumps, poles, clamped, tip, root):
    model = linearise(hub_beam(*lumps))
    assert model.poles()[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert upper(model.poles()[2:])[: len(poles)] == pytest.approx(poles, rel=1e-6)
    assert upper(model.zeros(outputs=["O"]))[: len(clamped)] == pytest.approx(clamped, rel=1e-6)
    real = model.zeros(outputs=["y"])
    real = np.sort(real[np.abs(real.imag) < 1e-9 * np.abs(real)].real)
    assert real[real > 0.0][: len(tip)] == pytest.approx(tip, rel=1e-6)
    assert real[real < 0.0][::-1][: len(tip)] == pytest.approx([-zero for zero in tip], rel=1e-6)
    strain = upper(model.zeros(outputs=["root"]))
    assert strain[strain > 1.0][: len(root)] == pytest.approx(root, rel=1e-6)


def test_frequency_response_of_a_beam_on_a_hub():
    """At s = 10 j and 2 + 10 j: angle, tip, and root moment, with what the inertia of the deflection adds to it."""
    model = linearise(hub_beam(0.1, 0.5, 0.0))
    angle, tip, root = model.frequency_response(np.array([10j, 2.0 + 10j]))[:, :, 0].T
    assert angle == pytest.approx([-0.113267273005460, -0.0864436724189053 - 0.0569957607188636j], rel=1e-8)
    assert tip == pytest.approx([0.014496160519393, 0.010160252443409 + 0.006534043404271j], rel=1e-8)
    # At a positive distance from the neutral axis a positive moment compresses.
    assert -root[0] == pytest.approx(0.132672730054604, rel=1e-8)


def test_responses_have_the_rigid_residue():
    """theta / tau tends to 1 / ((Jh + 1/3 + mu) s^2) where s is small."""
    model = linearise(hub_beam(0.1, 0.5, 0.0))
    s = 1e-4j
    assert (s**2 * model.frequency_response([s])[0, 0, 0]).real == pytest.approx(
        1.0 / (0.1 + 1.0 / 3.0 + 0.5), rel=1e-7
    )


# --- Two cranks and a coupler: a redundant motor ----------------------------------------------------------------------


def parallelogram():
    """Two beams on hubs, upright, with a pinned rigid coupler of unit mass, motors at both hubs."""

    def crank(name):
        return FlexibleBeam(
            name, 1.0, Section(1.0, 1e-6), Material(1e6, 1.0), points={"O": 0.0, "T": 1.0}, elements=8,
            lumps=(LumpedMass("O", 0.0, 0.1),),
        )  # fmt: skip

    coupler = RigidBody("coupler", 1.0, 0.1, (0.5, 0.0), {"A": (0.0, 0.0), "B": (1.0, 0.0)})
    ref = PointRef.parse
    return Mechanism(
        "parallelogram", ground={"A": (0.0, 0.0), "B": (1.0, 0.0)}, bodies=(crank("left"), crank("right"), coupler),
        joints=(
            RevoluteJoint("A", ref("ground.A"), ref("left.O")), RevoluteJoint("B", ref("ground.B"), ref("right.O")),
            RevoluteJoint("C", ref("left.T"), ref("coupler.A")), RevoluteJoint("D", ref("right.T"), ref("coupler.B")),
        ),
        motors=(Motor("tau1", "A"), Motor("tau2", "B")),
        assemblies=(Assembly("upright", {"left": np.pi / 2, "right": np.pi / 2, "coupler": 0.0}),),
    )  # fmt: skip


def test_parallelogram_with_two_motors():
    model = linearise(parallelogram())
    symmetric, antisymmetric = (5.69177290724, 18.100719840919), (4.97881240247, 16.772228635034)
    assert upper(model.poles()[2:])[:4] == pytest.approx(sorted((*symmetric, *antisymmetric)), rel=1e-6)
    response = model.select(outputs=["A", "B"]).frequency_response([10.0])[0]
    assert response[0, 0] == pytest.approx(-0.10597436394911, rel=1e-7)
    assert response[1, 0] == pytest.approx(-0.00729290905635, rel=1e-6)
    own = model.zeros(["tau1"], ["A"])
    assert upper(own)[:4] == pytest.approx([1.3331996176, 5.3671379748, 15.8561001823, 17.7422012117], rel=1e-6)
    # Neither looks like a tip: the zeros from one motor to the other's encoder are real, and double.
    other = model.zeros(["tau1"], ["B"])
    # Both belong to one shape, so that rounding takes them apart by its square root, along the real axis or across it,
    # with more or less of it on other processors. Their sum and product are exact, and only those of a double zero fit.
    pairs = other[other.real > 0.0][:4].reshape(2, 2)
    assert np.abs(pairs.imag).max() < 0.1
    pairs_at = np.array([11.186642724, 60.451695864])
    assert np.sum(pairs, axis=1) == pytest.approx(2.0 * pairs_at, rel=1e-6)
    assert np.prod(pairs, axis=1) == pytest.approx(pairs_at**2, rel=1e-6)
    assert upper(model.zeros(outputs=["A", "B"]))[:2] == pytest.approx([2.016298981807, 15.41820571698], rel=1e-6)


# --- RAParM-I ---------------------------------------------------------------------------------------------------------

# First frequencies with motors held [Hz] and compliances xx, xy, yy at C [um/N], of cubic frame elements.
HELD = {
    "++++": ((13.4047, 18.6957, 71.069, 76.380), (75.255, 0.0, 110.034)),
    "++-+": ((10.6958, 18.4921, 71.067, 76.361), (116.513, -14.622, 115.216)),
    "+-+-": ((4.1046, 11.1212, 51.399, 61.212), (109.504, 0.0, 1862.67)),
    "-+-+": ((7.4536, 18.1233, 71.064, 76.341), (240.668, 0.0, 116.938)),
}


@pytest.fixture(scope="module")
def raparm_at_q():
    """RAParM-I and its pose with the end-effector at (0, 0.264)."""
    mechanism = pf.library.raparm_i()
    return mechanism, pf.plan(mechanism, Line((0.0, 0.264), (0.0, 0.26), max_acceleration=1.0), samples=2).start


def joints_of(model):
    motors = {motor.name: motor.joint for motor in model.minimal.system.mechanism.motors}
    return [motors[one.name] for one in model.inputs if one.name in motors]


@pytest.mark.parametrize("mode", HELD)
def test_raparm_with_motors_held(raparm_at_q, mode):
    mechanism, start = raparm_at_q
    model = linearise(mechanism, mode=mode, start=start, forces=[str(mechanism.end_effector.point)])
    frequencies, compliance = HELD[mode]
    assert model.held_frequencies()[:4] / (2.0 * np.pi) == pytest.approx(frequencies, rel=1e-4)
    found = 1e6 * model.held_compliance(str(mechanism.end_effector.point))
    assert found[np.triu_indices(2)] == pytest.approx(compliance, rel=1e-4, abs=1e-3)
    assert model.frequencies[:4] / (2.0 * np.pi) == pytest.approx([0.0, 0.0, 51.396, 61.130], rel=1e-4)


def test_zeros_of_motors_to_their_encoders_are_the_held_frequencies(raparm_at_q):
    """In all nine modes; there are as many zeros as frequencies."""
    mechanism, start = raparm_at_q
    assert len(mechanism.modes) == 9
    for mode in mechanism.modes:
        model = linearise(mechanism, mode=mode, start=start)
        assert upper(model.zeros(outputs=joints_of(model))) == pytest.approx(model.held_frequencies(), rel=1e-8)


@pytest.mark.parametrize(
    ("mode", "positive"), [("+-+-", (1408.19, 1408.19)), ("-+-+", (800.5,)), ("+--+", (539.2, 1408.19))]
)
def test_zeros_of_motors_to_the_end_effector(raparm_at_q, mode, positive):
    """Real ones: non-minimum phase; one bar alone, with its rotary lump, has 1408.19 rad/s."""
    mechanism, start = raparm_at_q
    fine = mechanism.with_beams(elements=4)
    start = pf.plan(fine, Line((0.0, 0.264), (0.0, 0.26), max_acceleration=1.0), samples=2).start
    found = linearise(fine, mode=mode, start=start).zeros(outputs=["x", "y"])
    real = np.sort(found.real[np.abs(found.imag) < 1e-6 * np.abs(found)])
    assert real[real > 0.0][: len(positive)] == pytest.approx(positive, rel=1e-3)
    assert real[real < 0.0][::-1][: len(positive)] == pytest.approx([-zero for zero in positive], rel=1e-3)


def test_more_motors_than_coordinates_have_few_zeros(raparm_at_q):
    """Motors to C, of both ways to find zeros: none of ++++; of +++- those of the bar that one motor alone moves."""
    mechanism, start = raparm_at_q
    for mode, known in (("++++", []), ("+++-", [-1409.123, 1409.123, -6097.341j, 6097.341j])):
        model = linearise(mechanism, mode=mode, start=start).select(outputs=["x", "y"])
        for found in (model.zeros(), zeros(model.scaled, 100.0)):
            low = found[np.abs(found) < 8000.0]
            assert np.sort_complex(low) == pytest.approx(np.sort_complex(np.array(known, dtype=complex)), rel=1e-6)


def geared(start_of=None):
    """Models of the geared five-bar: each of its two motors drives both cranks."""
    model = pf.load("geared_five_bar")
    return model if start_of is None else linearise(model.plan(), at=start_of)


def test_motors_at_geared_joints_have_the_zeros_of_one():
    """A response of rank one has the zeros of each entry, here the frequencies with the cranks held."""
    full = linearise(geared())
    # Zeros of a state space are found up to a tenth of the fastest pole.
    for model, count in ((full, 5), (pf.reduce(full, 12), 2)):
        for outputs in (["A1", "A2"], ["A1"]):
            found = upper(model.zeros(outputs=outputs))
            assert found[:count] == pytest.approx(full.held_frequencies()[:count], rel=1e-6)


@pytest.mark.parametrize("at", [0.05, 0.2, 0.4])
def test_zeros_of_motors_at_geared_joints_in_motion(at):
    model = geared(at)
    whole, one = (model.zeros(inputs, ["A1", "A2"]) for inputs in (None, ["left"]))
    low = one[np.abs(one) < 2000.0]
    assert low.size >= 4
    assert whole[: low.size] == pytest.approx(low, rel=1e-6)


def test_responses_that_are_zero_have_no_zeros():
    """Two wheels on fixed pins; one motor turns the other wheel only if they are geared."""
    wheels = [RigidBody(name, 0.5, 0.02, (0.0, 0.0), {"O": (0.0, 0.0)}) for name in ("one", "two")]
    joints = [RevoluteJoint(name, PointRef.parse(f"ground.{name}"), PointRef.parse(f"{body}.O"))
              for name, body in (("A", "one"), ("B", "two"))]  # fmt: skip
    apart = Mechanism(
        name="wheels", ground={"A": (0.0, 0.0), "B": (0.3, 0.0)}, bodies=tuple(wheels), joints=tuple(joints),
        motors=(Motor("a", "A"), Motor("b", "B")), assemblies=(Assembly("start", {"one": 0.3, "two": 0.1}),),
    )  # fmt: skip
    model = linearise(apart)
    assert model.zeros(["a"], ["B"]).size == 0
    # The other wheel turns freely, unseen.
    assert np.abs(model.zeros(["a"], ["A"])) == pytest.approx([0.0, 0.0], abs=1e-6)


# --- Damping ----------------------------------------------------------------------------------------------------------


def test_poles_with_damping_of_the_material():
    """D = c K: each mode has s^2 + c w^2 s + w^2 = 0, the rigid one stays."""
    damping = LossFactor(0.02, 1.0)
    damped, plain = (linearise(hub_beam(0.1, 0.5, 0.0, one)) for one in (damping, None))
    omega = plain.frequencies[1:4]
    expected = -0.5 * damping.stiffness * omega**2 + 1j * omega * np.sqrt(1.0 - (0.5 * damping.stiffness * omega) ** 2)
    poles = damped.poles()
    assert poles[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert poles[poles.imag > 0.0][:3] == pytest.approx(expected, rel=1e-9)


# --- About motions ----------------------------------------------------------------------------------------------------


def test_along_a_plan_and_a_run():
    """With velocities, accelerations and torques kept: other than at rest in the same pose, and each about its time."""
    mechanism = pf.library.raparm_i()
    task = pf.plan(mechanism, Line((0.0, 0.264), (0.0, 0.2), max_acceleration=40.0), samples=21)
    planned = linearise(task, mode="++++", at=0.5 * task.motion.t[-1])
    assert planned.time == pytest.approx(task.motion.t[10])
    assert not planned.at_rest
    still = linearise(mechanism, start=State(0.0, planned.minimal.point.q, None))
    assert not np.allclose(still.A, planned.A, rtol=1e-6, atol=1e-6 * np.abs(still.A).max(axis=1, keepdims=True))
    run = pf.simulate(task, "++++")
    about = linearise(run, at=float(task.motion.t[10]))
    assert (about.mode, about.about) == ("++++", "a run")
    with pytest.raises(InputError, match="not a time of the motion"):
        linearise(run, at=99.0)


def test_multipliers_of_a_plan_are_those_of_the_rigid_motion():
    """The rigid equations hold at the point that a planned motion is linearised about."""
    task = pf.plan(pf.library.raparm_i().rigid(), Line((0.0, 0.264), (0.0, 0.2), max_acceleration=40.0), samples=5)
    point = linearise(task, mode="++++", at=0.5 * task.motion.t[-1]).minimal.point
    solved = pf.simulate(task, "++++").solution
    assert point.a == pytest.approx(solved.a[2], rel=1e-3, abs=1e-3 * np.abs(solved.a[2]).max())
    assert point.multipliers == pytest.approx(solved.multipliers[2], abs=1e-3 * np.abs(solved.multipliers[2]).max())


def test_segments_of_a_plan_lie_and_move_along_their_links():
    """Joints between segments are closed, Phi' and Phi'' are zero, at the plan's velocities and accelerations."""
    path = Line((0.0, 0.264), (0.0, 0.2), max_acceleration=40.0)
    task = pf.plan(pf.library.raparm_i(), path, samples=5).in_segments(2)
    point = linearise(task, mode="++++", at=0.5 * task.motion.t[-1]).minimal.point
    assert np.abs(point.a).max() > 10.0
    signals = moment_signals(task.mechanism, point.time)
    phi, rates = task.system.constraints(signals, point.time, point.q, point.v)
    assert phi == pytest.approx(0.0, abs=1e-9)
    assert rates == pytest.approx(0.0, abs=1e-9)
    assert second_rates(task.system, signals, point.time, point.q, point.v, point.a) == pytest.approx(0.0, abs=1e-7)


# --- In other programs ------------------------------------------------------------------------------------------------


def test_python_control_has_the_same_poles_and_names(raparm_at_q):
    pytest.importorskip("control")
    mechanism, start = raparm_at_q
    model = linearise(mechanism, mode="+-+-", start=start, forces=[str(mechanism.end_effector.point)])
    system = model.to_control()
    assert list(system.input_labels) == [
        "tau1",
        "tau5",
        *(f"{str(mechanism.end_effector.point).replace('.', '_')}_{axis}" for axis in "xy"),
    ]
    assert list(system.output_labels) == ["A1", "D1", "A2", "D2", "x", "y"]
    s = 2j * np.pi * 7.0
    assert system(s) == pytest.approx(model.frequency_response([s])[0], rel=1e-6, abs=1e-12)


def test_python_control_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(InputError, match="not installed"):
        linearise(hub_beam(0.1, 0.0, 0.0)).to_control()


def test_labelled_arrays():
    data = linearise(hub_beam(0.1, 0.5, 0.0)).to_xarray()
    assert data["A"].dims == ("state", "state_of")
    assert data["B"].sel(state="O_rate", input="tau").item() > 0.0
    assert data["output_unit"].sel(output="y").item() == "m"


# --- Bad input --------------------------------------------------------------------------------------------------------


def test_what_cannot_be_linearised_is_named(raparm_at_q):
    mechanism, _ = raparm_at_q
    with pytest.raises(InputError, match="not one of the inputs"):
        linearise(mechanism).zeros(inputs=["tau9"])
    with pytest.raises(InputError, match="unknown point"):
        linearise(mechanism, forces=["link1.Z"])
    bare = replace(hub_beam(0.1, 0.0, 0.0), motors=())
    with pytest.raises(InputError, match="neither motors nor prescribed"):
        linearise(bare)


def test_a_pose_has_no_time_and_a_motion_no_pose():
    model = pf.load("five_bar")
    task = model.plan()
    with pytest.raises(InputError, match="at: has no meaning for a pose at rest"):
        linearise(model, at=0.05)
    for given in ({"assembly": model.mechanism.assemblies[0].name}, {"balanced": True}):
        with pytest.raises(InputError, match=f"{next(iter(given))}: has no meaning for a motion"):
            linearise(task, **given)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_times_and_frequencies_are_finite(wrong):
    model = pf.load("five_bar")
    task, linear = model.plan(), linearise(model)
    few, shaper = pf.reduce(linear, 8), pf.shaper("zv", 3.0)
    loop = pf.closed_loop(([[0.0]], [[1.0]], [[1.0]], [[0.0]]), DiscreteModel(*np.zeros((4, 1, 1)), 1e-3, (), ()))
    for field, call in (
        ("at", lambda: linearise(task, at=wrong)),
        ("at", lambda: pf.reduce(task, at=wrong)),
        ("at", lambda: pf.linearise_along(task, times=[0.0, 0.1, 0.2, 0.3, wrong])),
        ("at", lambda: DesignedLQG({"A1": 0.1}, 1.0, at=wrong)),
        ("frequencies", lambda: linear.frequency_response([1.0, wrong])),
        ("frequencies", lambda: few.frequency_response([1.0, wrong])),
        ("frequencies", lambda: few.error([1.0, wrong])),
        ("until", lambda: states_needed([linear], wrong)),
        ("omega", lambda: loop.sensitivity(wrong)),
        ("omega", lambda: loop.loop([1.0, wrong])),
        ("delay", lambda: loop.later(wrong)),
        ("until", lambda: pf.Simulation(task).run([], until=wrong)),
        ("frequency", lambda: shaper.residual([1.0, wrong])),
        ("start", lambda: shaper.shaped(np.sin, start=wrong)),
    ):
        with pytest.raises(InputError) as caught:
            call()
        assert caught.value.field == field


def test_state_as_a_start():
    model = linearise(
        hub_beam(0.1, 0.0, 0.0), start=State(0.0, np.zeros(build_system(hub_beam(0.1, 0.0, 0.0)).n), None)
    )
    assert model.at_rest


# --- Coordinates of the end-effector ----------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["++++", "+-+-"])
def test_coordinates_of_the_end_effector_change_nothing_but_the_states(raparm_at_q, mode):
    """Poles, zeros, responses and frequencies with motors held are the same; A and B are similar by x = W x."""
    mechanism, start = raparm_at_q
    motors = linearise(mechanism, mode=mode, start=start)
    task = linearise(mechanism, mode=mode, start=start, coordinates="task")
    assert [one.name for one in task.states[:3]] == ["x", "y", "link1.elastic1"]
    assert [one.unit for one in task.states[:2]] == ["m", "m"]
    assert task.poles() == pytest.approx(motors.poles(), rel=1e-8, abs=1e-6)
    for outputs in (["x", "y"], joints_of(motors)):
        low = motors.zeros(outputs=outputs)[:8]
        assert task.zeros(outputs=outputs)[:8] == pytest.approx(low, rel=1e-8)
    assert task.held_frequencies() == pytest.approx(motors.held_frequencies(), rel=1e-8)
    found, expected = (model.frequency_response([5.0, 50.0, 500.0]) for model in (task, motors))
    assert found == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(expected).max())
    # Minimal coordinates of the one from those of the other, by the motion of all coordinates that both describe.
    place, f = np.linalg.lstsq(task.minimal.directions, motors.minimal.directions, rcond=None)[0], len(task.states) // 2
    assert place[:2] == pytest.approx(motors.C[-2:, :f], rel=1e-8, abs=1e-8)
    W = np.kron(np.eye(2), place)
    size = np.abs(task.A @ W).max(axis=1, keepdims=True)
    assert task.A @ W / size == pytest.approx(W @ motors.A / size, abs=1e-8)
    assert pytest.approx(W @ motors.B, rel=1e-7, abs=1e-7) == task.B


def test_the_angle_of_the_end_effector_is_a_coordinate():
    """Of a beam on a hub its tip's slope, which turns with the hub: the same poles."""
    beam = hub_beam(0.1, 0.5, 0.01)
    turned = replace(beam, end_effector=EndEffector(PointRef("beam", "T"), ("angle",)))
    model = linearise(turned, coordinates="task")
    assert (model.states[0].name, model.states[0].unit) == ("angle", "rad")
    assert model.poles()[:6] == pytest.approx(linearise(beam).poles()[:6], rel=1e-8, abs=1e-8)


def test_coordinates_of_the_end_effector_that_do_not_describe_the_motion():
    with pytest.raises(InputError, match="needs an end-effector"):
        linearise(parallelogram(), coordinates="task")
    # Along a straight beam the tip moves as the beam stretches, not as it turns.
    beam = replace(hub_beam(0.1, 0.0, 0.0), end_effector=EndEffector(PointRef("beam", "T"), ("x",)))
    with pytest.raises(InputError, match="beam can move while x and all deflections stay"):
        linearise(beam, coordinates="task")
    # A rigid link has one freedom: two coordinates are one too many.
    both = replace(beam.rigid(), end_effector=EndEffector(PointRef("beam", "T"), ("x", "y")))
    with pytest.raises(InputError, match="x cannot change by itself"):
        linearise(both, coordinates="task")
    with pytest.raises(InputError, match="coordinates"):
        linearise(beam, coordinates="joints")
