"""Loads that vary in time: closed forms, energy, inverse dynamics, statics, files, derivatives; what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.actuation import required_effort
from paraflex.checks import check
from paraflex.designs.derivatives.changes import Change
from paraflex.designs.derivatives.plans import nominal_values, run_inputs
from paraflex.designs.run import Task, plan_task
from paraflex.dynamics import acting_loads, balanced_state, build_system, consistent_state, inputs_of
from paraflex.dynamics.signals import pack_signals, profile_signal
from paraflex.elastodynamics import simulate_ked
from paraflex.errors import InputError
from paraflex.files import ExpressionProfile, allowing_outside, library_file, load
from paraflex.integrators import IntegrationOptions
from paraflex.integrators.run import jump_times
from paraflex.integrators.sensitivity import run_derivatives
from paraflex.mechanism import (
    AppliedTorque,
    Assembly,
    ConstantSpeed,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    Motor,
    PiecewiseProfile,
    PointForce,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    Section,
    TabulatedProfile,
    TorsionalSpring,
    WeldJoint,
    raparm_i,
)
from paraflex.mechanism.profiles import Interpolation
from paraflex.motion import simulate_motion
from paraflex.paths import Line
from paraflex.studies import load_sensitivities
from paraflex.tracking import path_stops, plan_tracking
from paraflex.validity.actions import implausible_actions
from shell import paraflex
from test_loads import INERTIA, MASS, REACH, five_bar, pendulum
from test_sensitivities import PLACES
from twins import feed_forward_like

K, FORCE, PACE = 50.0, 3.0, 4.0


def zero_until(time, value, until=None):
    """Nothing until a time, then a constant; nothing again after another."""
    pieces = [ConstantSpeed(0.0, 0.0), ConstantSpeed(value, 0.0)]
    if until is None:
        return PiecewiseProfile(tuple(pieces), (time,))
    return PiecewiseProfile((*pieces, ConstantSpeed(0.0, 0.0)), (time, until))


def slider(force, **changes):
    """A mass of 1.3 kg that slides along x, on a spring or not."""
    values = {
        "ground": {"O": (0.0, 0.0)},
        "bodies": (RigidBody("block", MASS, INERTIA, points={"C": (0.0, 0.0)}),),
        "joints": (PrismaticJoint("rail", PointRef("ground", "O"), PointRef("block", "C")),),
        "loads": (PointForce("push", PointRef("block", "C"), (force, 0.0)),),
        "assemblies": (Assembly("start", {"block": 0.0}),),
    }
    return Mechanism("slider", **(values | changes))


@pytest.mark.parametrize("method", ["esdirk5", "radau", "bdf"])
def test_an_oscillator_under_a_harmonic_force(method):
    force = ExpressionProfile("F * sin(w * t)", {"F": FORCE, "w": PACE})
    mechanism = slider(force, springs=(TorsionalSpring("k", "rail", K),))
    run = simulate_motion(mechanism, 3.0, samples=61, options=IntegrationOptions(method=method, tolerance=1e-7))
    own = np.sqrt(K / MASS)
    expected = FORCE / (MASS * (own**2 - PACE**2)) * (np.sin(PACE * run.times) - PACE / own * np.sin(own * run.times))
    np.testing.assert_allclose(run.solution.q[:, 0], expected, rtol=0, atol=2e-6)
    # All the energy it has is the force's work.
    assert run.solution.energy_balance_max < 1e-5
    assert np.max(run.solution.work) > 0.05


def test_an_impulse_gives_its_momentum_and_steps_end_where_it_jumps():
    mechanism = slider(zero_until(0.1, 500.0, 0.102))
    run = simulate_motion(mechanism, 0.3, samples=4)
    np.testing.assert_allclose(run.solution.v[1:, 0], np.array([0.0, 1.0, 1.0]) / MASS, rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.solution.q[2:, 0], np.array([0.099, 0.199]) / MASS, rtol=0, atol=1e-12)
    assert run.solution.work[-1] == pytest.approx(0.5 / MASS, rel=1e-9)
    # From each jump they grow as from the start.
    assert run.solution.steps < 120


def test_a_beam_under_a_step_load_swings_to_twice_its_deflection():
    EI, length, per_length, tip, late = 5.0, 0.5, 0.27, 0.2, 0.05
    material = Material(70e9, per_length / 1e-4)
    beam = FlexibleBeam("beam", length, Section(1e-4, EI / 70e9), material, {"A": 0.0, "B": length}, 4, modes=1)
    mechanism = Mechanism(
        "clamped", {"O": (0.0, 0.0)}, (beam,), (WeldJoint("wall", PointRef("ground", "O"), PointRef("beam", "A")),),
        loads=(PointForce("step", PointRef("beam", "B"), (0.0, zero_until(late, tip))),), geometry=Geometry.LINEAR,
        assemblies=(Assembly("straight", {"beam": 0.0}),),
    ).with_beams(reference="cantilever")  # fmt: skip
    run = simulate_motion(mechanism, 0.5, samples=501, options=IntegrationOptions(tolerance=1e-8))
    (body,) = run.system.bodies
    shape = run.system.marker(PointRef("beam", "B")).N[1]
    pace = body.modes.omega[0]
    # One mode of unit mass: u'' + w^2 u = N F.
    expected = shape[0] ** 2 * tip / pace**2 * (1.0 - np.cos(pace * np.maximum(run.times - late, 0.0)))
    found = run.solution.q[:, body.flexible] @ shape
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.max(expected))
    # The first mode has 97 hundredths of the textbook's deflection under a force at the tip.
    assert np.max(found) == pytest.approx(2 * 0.9707 * tip * length**3 / (3 * EI), rel=1e-3)


def test_a_torque_that_rises_turns_an_arm_with_the_cube_of_time():
    at_pin = INERTIA + MASS * REACH**2
    twist = AppliedTorque("twist", PointRef("arm", "A"), ExpressionProfile("6 * c * t", {"c": 0.2}))
    run = simulate_motion(pendulum(loads=(twist,)), 1.0, samples=11, options=IntegrationOptions(tolerance=1e-8))
    np.testing.assert_allclose(run.solution.q[:, 2], 0.5 + 0.2 * run.times**3 / at_pin, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("push", "within"),
    [
        ((ExpressionProfile("3 * sin(30 * t)"), -5.0), 3e-7),
        ((zero_until(0.08, 4.0, 0.13), ExpressionProfile("-40 * t")), 1e-7),
        ((TabulatedProfile((0.0, 0.1, 0.2, 0.4), (0.0, 3.0, -2.0, 1.0)), 0.0), 1e-7),
    ],
)
def test_torques_along_a_path_carry_loads_at_every_instant(push, within):
    mechanism = five_bar(loads=(PointForce("tool", PointRef("distal2", "C"), push),))
    task = plan_tracking(mechanism, Line((0.0, 0.30), (0.04, 0.27), 20.0), duration=0.2, samples=41)
    run = task.simulate("++", options=IntegrationOptions(tolerance=1e-8))
    following = run.driven
    assert np.max(np.linalg.norm(following.actual - following.desired, axis=1)) < within
    assert run.solution.energy_balance_max < 1e-6
    # Virtual work: the effort is less by the force, for the tool is the end-effector.
    free = required_effort(replace(task.motion, mechanism=five_bar(), system=build_system(five_bar().rigid())))
    force = mechanism.loads[0].evaluate(task.motion.t)
    np.testing.assert_allclose(task.effort.required, free.required - force, rtol=0, atol=1e-10)


def test_loads_in_time_are_as_constant_ones_where_they_are_constant():
    """Elastodynamics, finite segments and balanced starts, of which each takes forces in its own way."""
    line = Line((0.0, 0.264), (0.01, 0.264), 5.0)
    forces = ((2.0, -3.0), (ExpressionProfile("2 + 0 * t"), ExpressionProfile("-3 + 0 * t")))
    loaded = [replace(raparm_i(), loads=(PointForce("tool", PointRef("link4", "C"), force),)) for force in forces]
    tasks = [plan_tracking(mechanism, line, duration=0.05, samples=6) for mechanism in loaded]  # fmt: skip
    for of in (
        lambda task: simulate_ked(task, "++++").solution.q,
        lambda task: task.in_segments(2).simulate("++++").solution.q,
        lambda task: task.balanced("++++").start.q,
    ):
        one, other = (of(task) for task in tasks)
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-9)


# A ramp from 0.1 to 0.2 s, a constant force, and a fall to nothing within a microsecond.
RAMP = ((0.0, 0.1, 0.2, 0.5, 0.500001, 1.0), (0.0, 0.0, FORCE, FORCE, 0.0, 0.0))
IN_PIECES = PiecewiseProfile(
    (
        ConstantSpeed(0.0, 0.0),
        ConstantSpeed(-FORCE, 10 * FORCE),
        ConstantSpeed(FORCE, 0.0),
        ConstantSpeed(FORCE * 500001, -FORCE * 1e6),
        ConstantSpeed(0.0, 0.0),
    ),
    RAMP[0][1:5],
)


def test_a_linear_table_is_exact_at_its_rows_and_straight_between_them():
    profile, smooth = TabulatedProfile(*RAMP, "linear"), TabulatedProfile(*RAMP)
    times = np.linspace(0.0, 1.0, 301)
    for found, expected in zip(profile.evaluate(times), IN_PIECES.evaluate(times), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(profile.evaluate(np.array(RAMP[0]))[0], RAMP[1])
    assert profile.knots == profile.stops == RAMP[0][1:5]
    assert smooth.knots == ()
    # What it is for: a smooth curve leaves the rows far behind.
    assert np.max(smooth.evaluate(times)[0]) > 2 * FORCE
    signal, ends = profile_signal("load.push", profile, 0.45)
    np.testing.assert_array_equal(signal.breaks, [0.0, 0.1, 0.2, 0.45])
    np.testing.assert_allclose(signal.coefficients[:, :2], [[0, 0], [0, 10 * FORCE], [FORCE, 0]], rtol=1e-12, atol=0)
    assert ends == [0.1, 0.2]


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_a_jump_is_one_in_any_unit_and_rounding_is_none(scale):
    """A load from 0 to 1, to 1 + 1e-12, and back: the second is rounding, whatever the load is measured in."""
    heights = (0.0, 1.0, 1.0 + 1e-12, 0.0)
    profile = PiecewiseProfile(tuple(ConstantSpeed(scale * one, 0.0) for one in heights), (0.1, 0.2, 0.3))
    mechanism = slider(profile)
    signals, knots = pack_signals(mechanism, [], 0.4)
    np.testing.assert_array_equal(jump_times(signals, inputs_of(mechanism), np.array(knots)), [0.1, 0.3])


@pytest.mark.parametrize("method", ["esdirk5", "radau"])
def test_an_oscillator_under_a_ramp_from_a_linear_table_and_the_same_in_pieces(method):
    springs = (TorsionalSpring("k", "rail", K),)
    # Two runs, the steps of which need not be the same: each is within a tenth of what they are compared to.
    options = IntegrationOptions(method=method, tolerance=1e-9)
    table, pieces = (
        simulate_motion(slider(profile, springs=springs), 1.0, samples=41, options=options)
        for profile in (TabulatedProfile(*RAMP, "linear"), IN_PIECES)
    )
    np.testing.assert_allclose(table.solution.q, pieces.solution.q, rtol=0, atol=2e-8)
    own = np.sqrt(K / MASS)

    def ramp(t):
        return np.where(t > 0.0, 10 * FORCE / K * (t - np.sin(own * t) / own), 0.0)

    t = table.times
    fall = np.where(t > 0.5, FORCE / K * (1.0 - np.cos(own * (t - 0.5))), 0.0)
    np.testing.assert_allclose(table.solution.q[:, 0], ramp(t - 0.1) - ramp(t - 0.2) - fall, rtol=0, atol=1e-6)


def test_a_pulse_between_the_rows_of_a_long_linear_table_is_not_stepped_over():
    times, forces = np.linspace(0.0, 0.3, 3001), np.zeros(3001)
    forces[1000:1020] = 500.0
    forces += 1e-3 * np.sin(40.0 * times)
    profile = TabulatedProfile(tuple(times), tuple(forces), "linear")
    # Both ends of both flanks, though there are far more rows than stops.
    assert {times[k] for k in (999, 1000, 1019, 1020)} <= set(profile.stops)
    assert len(profile.stops) == 200
    assert len(profile.knots) == 2999
    run = simulate_motion(slider(profile), 0.3, samples=4)
    momentum = np.trapezoid(forces, times)
    np.testing.assert_allclose(run.solution.v[-1, 0], momentum / MASS, rtol=1e-8)
    assert run.solution.steps < 1000


def test_torques_along_a_path_carry_a_long_linear_table():
    """Its rows are noise, so that no spline passes for them; steps end at few of them."""
    times = np.linspace(0.0, 0.2, 801)
    profile = TabulatedProfile(tuple(times), tuple(np.random.default_rng(3).uniform(-1.0, 1.0, times.size)), "linear")
    mechanism = five_bar(loads=(PointForce("tool", PointRef("distal2", "C"), (profile, 0.0)),))
    task = plan_tracking(mechanism, Line((0.0, 0.30), (0.04, 0.27), 20.0), duration=0.2, samples=41)
    run = task.simulate("++", options=IntegrationOptions(tolerance=1e-8))
    assert np.max(np.linalg.norm(run.driven.actual - run.driven.desired, axis=1)) < 1e-7
    assert task.plan.knots.size > 799
    assert path_stops(task.plan.knots, mechanism).size < 210
    # Between the rows the torques take the load as it is.
    between = 0.5 * (times[1:] + times[:-1])[[7, 400, 790]]
    effort = required_effort(task.plan.follow(between)).required
    free = replace(task.plan.follow(between), mechanism=five_bar(), system=build_system(five_bar().rigid()))
    np.testing.assert_allclose(
        (required_effort(free).required - effort)[:, 0], np.interp(between, times, profile.values)
    )


def test_a_linear_table_is_as_its_pieces_in_elastodynamics_and_segments():
    line = Line((0.0, 0.264), (0.01, 0.264), 5.0)
    pieces = PiecewiseProfile(
        (ConstantSpeed(0.0, 100.0), ConstantSpeed(3.0, -50.0), ConstantSpeed(1.5, 0.0)), (0.02, 0.03)
    )
    table = TabulatedProfile((0.0, 0.02, 0.03, 0.05), (0.0, 2.0, 1.5, 1.5), "linear")
    tasks = [
        plan_tracking(
            replace(raparm_i(), loads=(PointForce("tool", PointRef("link4", "C"), (profile, 0.0)),)),
            line, duration=0.05, samples=6,
        )
        for profile in (pieces, table)
    ]  # fmt: skip
    for of in (
        lambda task: simulate_ked(task, "++++").solution.q,
        # Errors that choose steps would tell rounding apart.
        lambda task: task.in_segments(2).simulate("++++", options=pf.IntegrationOptions(step=2e-4)).solution.q,
    ):
        one, other = (of(task) for task in tasks)
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-9)


def test_statics_take_a_load_at_the_time_of_the_pose():
    mechanism = slider(ExpressionProfile("10 * t"), springs=(TorsionalSpring("k", "rail", K),))
    system = build_system(mechanism)
    for time in (0.0, 1.5):
        state = balanced_state(system, replace(consistent_state(system, mechanism.assembly()), time=time), {})
        assert state.q[0] == pytest.approx(10.0 * time / K, abs=1e-12)


def test_inputs_are_motors_then_loads_then_prescribed_motions():
    mechanism = replace(
        five_bar(),
        loads=(
            PointForce("a", PointRef("distal2", "C"), (1.0, ConstantSpeed(2.0, 1.0))),
            AppliedTorque("b", PointRef("distal1", "C"), 3.0),
            AppliedTorque("c", PointRef("distal1", "C"), zero_until(1.0, 4.0)),
        ),
    )
    assert inputs_of(mechanism) == (range(2), range(2, 4), range(4, 4))
    times = np.array([0.5, 1.0])
    np.testing.assert_array_equal(acting_loads(mechanism, times), [[0, 0, 2.5, 0], [0, 0, 3, 4]])
    np.testing.assert_allclose(acting_loads(mechanism, times, before=True), [[0, 0, 2.5, 0], [0, 0, 3, 0]])


def test_a_load_beyond_what_is_plausible_is_seen_at_its_largest():
    def codes(force):
        return [one.code for one in implausible_actions(slider(force), 0.5, MASS, np.linspace(0.0, 1.0, 3))]

    # The pulse lies between the times that are looked at.
    assert codes(zero_until(0.6, 1e6, 0.61)) == codes(1e6) == ["load-large"]
    assert codes(zero_until(0.6, 1.0, 0.61)) == []


def test_only_motions_have_to_meet():
    jump = zero_until(0.1, 1.0)
    with pytest.raises(InputError, match=r"prescribed\.turn\.pieces: the profile jumps by 1 at t = 0\.1 s"):
        PrescribedAngle("turn", "pin", jump)
    assert PointForce("push", PointRef("arm", "B"), (jump, 0.0)).profiles == (jump,)
    with pytest.raises(
        InputError, match=r"prescribed\.turn\.interpolation: the rate of a motion between straight lines"
    ):
        PrescribedAngle("turn", "pin", TabulatedProfile((0.0, 1.0), (0.0, 0.2), "linear"))
    with pytest.raises(InputError, match=r"profile\.interpolation: unknown interpolation \(got 'cubic'\)"):
        TabulatedProfile((0.0, 1.0), (0.0, 0.2), "cubic")


# --- Files --------------------------------------------------------------------------------------------------------

MODEL = """
name = "arm"
[parameters]
a = 0.3
[ground]
O = [0.0, 0.0]
[body.arm]
type = "rigid"
mass = 2.0
inertia = 0.1
points = { O = [0.0, 0.0], B = [0.4, 0.0] }
[joint]
O = ["ground.O", "arm.O"]
[assembly.start]
arm = 0.0
[study]
duration = 1.0
"""


def written(folder, text):
    (folder / "force.csv").write_text("t [s], x [N], y [N]\n0, 1, 0\n0.5, 3, 0\n1, 2, 0\n")
    (folder / "torque.csv").write_text("0 0\n1 0.2\n")
    (folder / "wide.csv").write_text("0 0 1 2\n1 0 0 0\n")
    file = folder / "arm.toml"
    file.write_text(MODEL + text, encoding="utf-8")
    return file


FORCE_AT = '[load.push]\ntype = "force"\npoint = "arm.B"\n'
TORQUE_AT = '[load.push]\ntype = "torque"\npoint = "arm.B"\n'
SINE = ExpressionProfile("a * sin(t)", {"a": 0.3})


@pytest.mark.parametrize(
    ("text", "components"),
    [
        (FORCE_AT + 'force = ["a * sin(t)", "2 * a"]', (SINE, 0.6)),
        (
            FORCE_AT + 'pieces = [{ until = 0.5, force = [0, 1] }, { force = ["a * sin(t)", 1] }]',
            (PiecewiseProfile((ConstantSpeed(0.0, 0.0), SINE), (0.5,)), 1.0),
        ),
        (FORCE_AT + 'table = "force.csv"', (TabulatedProfile((0.0, 0.5, 1.0), (1.0, 3.0, 2.0)), 0.0)),
        (
            FORCE_AT + 'table = "force.csv"\ninterpolation = "linear"',
            (TabulatedProfile((0.0, 0.5, 1.0), (1.0, 3.0, 2.0), Interpolation.LINEAR), 0.0),
        ),
        (
            FORCE_AT + 'table = [[0, 1, 0], [1, 1, 1]]\ninterpolation = "spline"',
            (1.0, TabulatedProfile((0, 1), (0, 1))),
        ),
        (TORQUE_AT + 'torque = "a * sin(t)"', (SINE,)),
        (TORQUE_AT + 'table = "torque.csv"', (TabulatedProfile((0.0, 1.0), (0.0, 0.2)),)),
        (
            TORQUE_AT + "pieces = [{ until = 0.5, torque = 1 }, { torque = 2 }]",
            (PiecewiseProfile((ConstantSpeed(1.0, 0.0), ConstantSpeed(2.0, 0.0)), (0.5,)),),
        ),
    ],
)
def test_files_give_loads_in_time_and_take_them(tmp_path, text, components):
    model = load(written(tmp_path, text))
    (push,) = model.mechanism.loads
    assert push.components == components
    simulate_motion(model, 1.0, samples=3)
    # Without the text of the file, and with it.
    pf.Model(model.mechanism, study=model.study).save(tmp_path / "again.toml")
    assert load(tmp_path / "again.toml").mechanism == model.mechanism
    changed = replace(model, mechanism=replace(model.mechanism, gravity=(0.0, -9.81)))
    changed.save(tmp_path / "changed.toml")
    assert load(tmp_path / "changed.toml").mechanism == changed.mechanism
    assert ('.csv"' in (tmp_path / "changed.toml").read_text()) == (".csv" in text)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (FORCE_AT, "load.push.force: is missing; give it, or pieces or a table of the force"),
        (FORCE_AT + 'force = ["x", 0]', 'load.push.force.0: unknown parameter "x"'),
        (FORCE_AT + "force = [nan, 0]", "load.push.force.0: not a finite number"),
        (FORCE_AT + 'force = "t"', "load.push.force"),
        (FORCE_AT + 'force = ["1 / (1 - t)", 0]', "load.push.force.0: its value is not a finite number at t = 1 s"),
        (FORCE_AT + 'force = [1, 0]\ntable = "force.csv"', "load.push.table: its force is given in two ways"),
        (FORCE_AT + 'table = "torque.csv"', "load.push.table: line 1 of torque.csv is not three numbers (got '0 0')"),
        (TORQUE_AT + 'table = "force.csv"', "load.push.table: line 2 of force.csv is not two numbers"),
        (FORCE_AT + 'table = "none.csv"', "load.push.table: cannot be read (no such file or directory)"),
        (FORCE_AT + "table = [[0, 1, 1]]", "load.push.table: a table needs two rows (got 1)"),
        (FORCE_AT + "table = [[0, 1, 0], [0.5, 2, 0]]", "load.push.table: it covers t = 0 to 0.5 s, the run"),
        (FORCE_AT + "pieces = [{ force = [1, 0] }, { force = [2, 0] }]", "load.push.pieces.0.until: every piece"),
        (
            FORCE_AT + "pieces = [{ until = 1, force = [1, 0] }, { until = 1, force = [2, 0] }, { force = [0, 0] }]",
            "load.push.pieces: the times of pieces must ascend from 0 (got 1.0)",
        ),
        (
            TORQUE_AT + "pieces = [{ until = 1, torque = 2 }, { until = 0.5, torque = 2 }, { torque = 2 }]",
            "load.push.pieces: the times of pieces must ascend from 0 (got 0.5)",
        ),
        (TORQUE_AT + "pieces = [{ until = 1, force = 1 }, { torque = 0 }]", "load.push.pieces.0"),
        (FORCE_AT + 'force = [1, 0]\ninterpolation = "linear"', "load.push.interpolation: is for tables only (got"),
        (FORCE_AT + 'table = "force.csv"\ninterpolation = "cubic"', "load.push.interpolation"),
    ],
)  # fmt: skip
def test_loads_in_time_that_make_no_sense_are_refused_by_name(tmp_path, text, says):
    file = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        load(file)
    assert f"{file}: {says}" in str(caught.value)
    assert caught.value.remedy


def test_what_a_file_has_no_words_for_is_refused(tmp_path):
    differing = (zero_until(0.1, 1.0), zero_until(0.2, 1.0))
    mechanism = pendulum(loads=(PointForce("push", PointRef("arm", "B"), differing),))
    with pytest.raises(InputError, match=r"load\.push\.force: a model file cannot express a force whose components"):
        mechanism.save(tmp_path / "no.toml")
    with pytest.raises(InputError, match=r"load\.push\.force: not a number, a profile in time or a law"):
        PointForce("push", PointRef("arm", "B"), ("t", 0.0))
    differing = tuple(TabulatedProfile((0.0, 1.0), (0.0, 2.0), kind) for kind in ("spline", "linear"))
    mechanism = pendulum(loads=(PointForce("push", PointRef("arm", "B"), differing),))
    with pytest.raises(InputError, match="tables of the same times and interpolation"):
        mechanism.save(tmp_path / "no.toml")


# --- Derivatives --------------------------------------------------------------------------------------------------

STUDY = """
mechanism = "model.toml"
paths = ["line"]
modes = ["++++"]
duration = 0.06
samples = 13
[integration]
method = "tr-bdf2"
step = 2e-3
tolerance = 1e-7
[vary.a]
fields = ["parameters.a"]
[vary.thickness]
fields = ["section.bar.thickness"]
"""


def study_of(folder, force, flexible=True):
    text = library_file("raparm_i").read_text(encoding="utf-8").replace("\n[", "\n[parameters]\na = 5.0\n[", 1)
    if not flexible:
        text = text.replace('type = "beam"', 'type = "beam"\nflexible = false')
    (folder / "model.toml").write_text(f'{text}\n[load.tool]\ntype = "force"\npoint = "link4.C"\n{force}\n')
    (folder / "study.toml").write_text(STUDY)
    return load_sensitivities(folder / "study.toml")


IN_TIME = 'force = ["a * sin(200 * t)", "-a * t"]'
BY_LAW = 'force = ["-30 * a * link4.C.vx + sin(A1.angle) * t", "-a * max(400 * (link4.C.y - 0.26), -9)"]'


@pytest.mark.parametrize(
    ("force", "flexible", "follows"),
    [(IN_TIME, True, 20.0), (IN_TIME, True, 0.1), (IN_TIME, False, 20.0), (BY_LAW, True, 20.0), (BY_LAW, True, 0.1)],
)
def test_runs_have_derivatives_by_a_number_in_a_load(tmp_path, monkeypatch, force, flexible, follows):
    """Without flexible bodies the equations of motion are solved at samples within steps, where curves are 2 % off.

    So they are with flexible ones in steps that are long beside vibrations, which all are that count as such.
    """
    monkeypatch.setattr("paraflex.integrators.native._FOLLOWS", follows)
    study = study_of(tmp_path, force, flexible)
    setting = study.setting
    task = Task(0, 0, nominal_values(study.setting), "line")
    planned, options = plan_task(setting, task)
    nominal = run_inputs(planned, options, planned.torques("++++"))
    # Rigid links know their thickness by their mass alone.
    for k, step in enumerate([1e-2, 3e-4 if flexible else 3e-2]):
        change = Change(setting, task, planned, k, task.values[k]).of_mode(nominal)
        assert change.error < 1e-10
        found = run_derivatives(nominal.problem, options, [change.direction])
        motions = []
        for place, _ in PLACES:
            values = list(task.values)
            values[k] *= 1.0 + place * step
            beside, _ = plan_task(setting, task._replace(values=tuple(values)))
            beside = replace(beside, system=build_system(beside.mechanism, like=planned.system))
            near = run_inputs(beside, options, feed_forward_like(beside.plan, nominal.torques))
            motions.append(run_derivatives(near.problem, options, []).motion)
        for kind, exact, parts in zip(found.motion._fields, found.derivatives, zip(*motions, strict=True), strict=True):
            expected = sum(weight * part for (_, weight), part in zip(PLACES, parts, strict=True)) / step
            # Rigid links follow the plan whatever they weigh and carry: how their motion changes is rounding.
            if flexible or kind == "multipliers":
                assert np.abs(exact[0] - expected).max() < 3e-6 * np.abs(expected).max(), kind


@pytest.mark.parametrize(
    "force",
    [
        'pieces = [{ until = 0.03, force = ["a", 0] }, { force = [0, 0] }]',
        'table = [[0, "a", 0], [0.03, 1, 0], [1.0, 0, 0]]\ninterpolation = "linear"',
    ],
)
def test_loads_with_pieces_have_no_derivative_along_a_path(tmp_path, force):
    study = study_of(tmp_path, force)
    task = Task(0, 0, nominal_values(study.setting), "line")
    planned, options = plan_task(study.setting, task)
    with pytest.raises(InputError, match="loads whose profile has pieces or a linear table: no derivative"):
        Change(study.setting, task, planned, 0, 5.0).of_mode(run_inputs(planned, options, planned.torques("++++")))


def test_an_arm_in_one_revolute_joint_is_what_the_file_says(tmp_path):
    model = load(written(tmp_path, TORQUE_AT + 'torque = "2 * a"'))
    (joint,) = model.mechanism.joints
    assert isinstance(joint, RevoluteJoint)
    assert model.mechanism.loads == (AppliedTorque("push", PointRef("arm", "B"), 0.6),)


# --- Torques of motors --------------------------------------------------------------------------------------------

DRIVEN = {"motors": (Motor("drive", "pin"),)}
AT_PIN = INERTIA + MASS * REACH**2


def test_torques_of_motors_in_time_do_the_work_that_the_arm_has():
    torque = PiecewiseProfile((ConstantSpeed(0.0, 2.0), ConstantSpeed(-1.0, 0.0)), (0.4,))
    run = simulate_motion(pendulum(**DRIVEN), 1.0, samples=6, torques={"drive": torque})
    t = run.times
    rate = np.where(t < 0.4, t**2, 0.16 - (t - 0.4)) / AT_PIN
    np.testing.assert_allclose(run.solution.v[:, 2], rate, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.solution.work, 0.5 * AT_PIN * rate**2, rtol=0, atol=2e-5)
    np.testing.assert_array_equal(run.applied[:, 0], [0.0, 0.4, -1.0, -1.0, -1.0, -1.0])
    data = pf.motion_dataset(run)
    assert data["applied_torque"].dims == ("time", "motor")
    np.testing.assert_allclose(data["motor_power"].values[:, 0], run.applied[:, 0] * rate, rtol=0, atol=1e-9)
    # The moment in the pin is the motor's.
    np.testing.assert_allclose(data["joint_moment"].values[:, 0], run.applied[:, 0], rtol=0, atol=1e-9)
    with pytest.raises(InputError, match=r"torques\.drive\.table: it covers t = 0 to 0\.5 s, the run goes to t = 1 s"):
        simulate_motion(pendulum(**DRIVEN), 1.0, torques={"drive": TabulatedProfile((0.0, 0.5), (0.0, 1.0))})


@pytest.mark.parametrize(
    ("given", "torque"),
    [
        ("0.7", 0.7),
        ('"2 * a"', 0.6),
        ('"a * sin(t)"', SINE),
        ("{ table = 'torque.csv' }", TabulatedProfile((0.0, 1.0), (0.0, 0.2))),
        ("{ table = 'torque.csv', interpolation = 'linear' }", TabulatedProfile((0.0, 1.0), (0.0, 0.2), "linear")),
        (
            "{ pieces = [{ until = 0.5, torque = 'a * sin(t)' }, { torque = 0 }] }",
            PiecewiseProfile((SINE, ConstantSpeed(0.0, 0.0)), (0.5,)),
        ),
    ],
)
def test_files_give_torques_of_motors_in_time_and_take_them(tmp_path, given, torque):
    file = written(tmp_path, f"torques = {{ drive = {given} }}\n[motor]\ndrive = 'O'\n")
    model = load(file)
    assert model.study.torques == {"drive": torque}
    assert {one.place for one in check(model)} <= {"parameters.a"}
    pf.Model(model.mechanism, study=model.study).save(tmp_path / "again.toml")
    assert load(tmp_path / "again.toml").study == model.study
    replace(model, mechanism=replace(model.mechanism, gravity=(0.0, -9.81))).save(tmp_path / "changed.toml")
    assert load(tmp_path / "changed.toml").study == model.study


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("'b * t'", 'study.torques.drive: unknown parameter "b"'),
        ("'1 / (1 - t)'", "study.torques.drive: its value is not a finite number at t = 1 s"),
        ("[1]", "study.torques.drive: neither a number nor an expression"),
        ("{}", "study.torques.drive.torque: is missing"),
        ("{ table = 'force.csv' }", "study.torques.drive.table: line 2 of force.csv is not two numbers"),
        ("{ speed = 1 }", "study.torques.drive.speed"),
        (
            "{ pieces = [{ torque = 1 }, { torque = 2 }] }",
            "study.torques.drive.pieces.0.until: every piece but the last",
        ),
    ],
)
def test_torques_of_motors_that_make_no_sense_are_refused_by_name(tmp_path, given, says):
    file = written(tmp_path, f"torques = {{ drive = {given} }}\n[motor]\ndrive = 'O'\n")
    with pytest.raises(InputError) as caught:
        load(file)
    assert f"{file}: {says}" in str(caught.value)


def test_a_torque_that_is_large_for_a_moment_is_seen(tmp_path):
    pieces = "{ pieces = [{ until = 0.5, torque = 0 }, { until = 0.501, torque = 1e6 }, { torque = 0 }] }"
    model = load(written(tmp_path, f"torques = {{ drive = {pieces} }}\n[motor]\ndrive = 'O'\n"))
    assert "study.torques.drive" in [one.place for one in check(model) if one.code == "load-large"]


@pytest.mark.parametrize("constant", ["log(0)", "exp(1000)", "1e308*10"])
@pytest.mark.parametrize("form", ["{}", "[{{ until = 0.1, force = {} }}, {{ force = [0, 0] }}]"])
def test_constants_of_loads_that_are_not_finite(tmp_path, constant, form):
    key = "pieces" if "until" in form else "force"
    force = form.format(f'["{constant}", 0]')
    text = library_file("four_bar").read_text(encoding="utf-8")
    (tmp_path / "model.toml").write_text(f'{text}\n[load.tool]\ntype = "force"\npoint = "coupler.B"\n{key} = {force}\n')
    with pytest.raises(InputError, match=r"load\.tool.*: (not a finite number|too large a number)"):
        load(tmp_path / "model.toml")


def test_tables_outside_of_the_model_s_folder_are_read_by_permission_and_not_quoted(tmp_path):
    (tmp_path / "secret").write_text("hush:x:0:0\nhush:y:1:1\n")
    (tmp_path / "model").mkdir()
    file = written(tmp_path / "model", "torques = { drive = { table = '../secret' } }\n[motor]\ndrive = 'O'\n")
    outside = r"study\.torques\.drive\.table: lies outside the folder of the model .*--allow-outside"
    with pytest.raises(InputError, match=outside):
        load(file)
    with allowing_outside(), pytest.raises(InputError, match="not two columns of numbers") as caught:
        load(file)
    assert "hush" not in str(caught.value)
    # A link does not lead out either; an absolute path is as good as any, unless the user gives it.
    (tmp_path / "model" / "own").symlink_to(tmp_path / "secret")
    with pytest.raises(InputError, match=outside):
        load(file, set={"study.torques.drive.table": "own"})
    (tmp_path / "secret").write_text("0, 1\n1, 2\n")
    file.write_text(file.read_text().replace("../secret", str(tmp_path / "secret")))
    with pytest.raises(InputError, match=outside):
        load(file)
    rows = [[0.0, 1.0], [1.0, 2.0]]
    for model in (load(file, set={"study.torques.drive.table": str(tmp_path / "secret")}), allowed(file)):
        assert model.parameters["study"]["torques"]["drive"]["table"] == rows
    assert "outside the folder" in paraflex("modes", file).stderr
    assert "outside the folder" not in paraflex("modes", file, "--allow-outside").stderr


def allowed(file):
    with allowing_outside():
        return load(file)


def test_files_in_the_model_s_folder_are_quoted(tmp_path):
    (tmp_path / "own").write_text("hush:x:0:0\nhush:y:1:1\n")
    with pytest.raises(InputError, match="hush"):
        load(written(tmp_path, "torques = { drive = { table = 'own' } }\n[motor]\ndrive = 'O'\n"))


@pytest.mark.parametrize("duration", [1e-3, 0.01, 0.1])
def test_rounding_of_a_motion_that_has_hardly_begun_is_not_followed(duration):
    """Of spin_up's profile, over 15 s, all terms cancel at its start: 1e-3 s was refused, 0.01 s took 335,538 steps."""
    run = simulate_motion(load("spin_up"), duration=duration, samples=11)
    assert run.solution.status == "complete"
    assert run.solution.steps < 200
    assert np.max(np.abs(run.solution.q[:, 2] - run.solution.q[0, 2])) < 1e-3 * duration
