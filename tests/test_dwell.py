"""Motors after the path: free as ever, or held by brakes from its end on."""

import dataclasses
import json

import numpy as np
import pytest
import scipy

from paraflex.dynamics import State, brake, build_system, joint_coordinate, momentum
from paraflex.dynamics.sparse import sparse_mass
from paraflex.errors import InputError, IntegrationError
from paraflex.fem import ReferenceCondition
from paraflex.files import load
from paraflex.integrators import METHODS, IntegrationOptions, JointLimit
from paraflex.integrators.method import NativeMethod
from paraflex.mechanism import (
    Assembly,
    EndEffector,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    Motor,
    PointRef,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    Section,
    raparm_i,
)
from paraflex.paths import Line, PointPath, Polygon
from paraflex.results import summary, tracking_dataset
from paraflex.studies import run_study, verify
from paraflex.tracking import Ending, plan_tracking
from shell import paraflex

PAPER = raparm_i().with_geometry(Geometry.LINEAR)
SIDE = Line((-0.01, 0.264), (0.01, 0.264), 20.0)
LENGTH, THICKNESS, ALUMINIUM = 0.4, 0.004, Material(70e9, 2700.0)


def arm(reference=ReferenceCondition.PINNED, geometry=Geometry.SECOND_ORDER):
    """One flexible link turned by a motor at its root."""
    link = FlexibleBeam(
        "link", LENGTH, Section.rectangle(0.02, THICKNESS), ALUMINIUM, {"root": 0.0, "tip": LENGTH}, elements=3,
        reference=reference,
    )  # fmt: skip
    return Mechanism(
        "arm",
        {"O": (0.0, 0.0)},
        (link,),
        (RevoluteJoint("shoulder", PointRef("ground", "O"), PointRef("link", "root")),),
        (Motor("torque", "shoulder"),),
        end_effector=EndEffector(PointRef("link", "tip"), ("x",)),
        assemblies=(Assembly("up", {"link": 0.4}),),
        geometry=geometry,
    )


# The end of the arm to an angle of one radian, fast, so that it goes on swinging.
SWING = PointPath(((LENGTH * np.cos(0.4), 0.0), (LENGTH * np.cos(1.0), 0.0)), 0.06)


def swinging(mechanism, after, **options):
    task = plan_tracking(mechanism, SWING, duration=0.4, samples=1201, after=after)
    return task, task.simulate("+", options=IntegrationOptions(tolerance=1e-6, **options))


def rate_of_largest(values, times):
    """Circular frequency of the largest line of a spectrum, fitted [rad/s]."""
    values = values - np.polynomial.polynomial.polyval(times, np.polynomial.polynomial.polyfit(times, values, 1))
    spectrum = np.abs(np.fft.rfft(values * np.hanning(values.size)))
    first = 2.0 * np.pi * np.argmax(spectrum[1:] + 0.0) + 2.0 * np.pi
    guess = first / (times[-1] - times[0])

    def wave(t, a, b, w, c):
        return a * np.cos(w * t) + b * np.sin(w * t) + c

    return scipy.optimize.curve_fit(wave, times - times[0], values, p0=[1e-4, 1e-4, guess, 0.0])[0][2]


@pytest.mark.parametrize("reference", [ReferenceCondition.CANTILEVER, ReferenceCondition.PINNED])
@pytest.mark.parametrize("geometry", list(Geometry))
def test_a_held_arm_swings_as_a_clamped_beam(reference, geometry):
    """(1.8751 / L)^2 sqrt(EI / m'), of the beam clamped at its root; a free one has 3.9266^2: four times as fast."""
    task, run = swinging(arm(reference, geometry), "hold")
    solution = run.solution
    after = solution.t > task.path.duration
    angle = joint_coordinate(task.system, "shoulder", solution.q).value
    assert np.ptp(angle[after]) < 1e-11
    tip = tracking_dataset([run])["end_effector"].values[0, after, 1]
    omega = 1.8751041**2 / LENGTH**2 * np.sqrt(ALUMINIUM.youngs_modulus * THICKNESS**2 / 12 / ALUMINIUM.density)
    assert rate_of_largest(tip, solution.t[after]) == pytest.approx(omega, rel=3e-3)


def test_the_brake_holds_with_the_rate_of_angular_momentum():
    """About the root, which stands still: from coordinates, velocities and accelerations alone."""
    task, run = swinging(arm(), "hold", method="esdirk5")
    solution, h = run.solution, 1e-6
    assert run.applied.shape == (solution.t.size, 1)
    after = np.nonzero(solution.t > task.path.duration)[0][::50]
    for k in after:
        q, v, a = solution.q[k], solution.v[k], solution.a[k]
        turning = [momentum(task.system, State(0.0, q + x * v + 0.5 * x**2 * a, v + x * a))[1] for x in (-h, h)]
        assert run.applied[k, 0] == pytest.approx((turning[1] - turning[0]) / (2.0 * h), abs=1e-3)
    # Between steps accelerations and multipliers are interpolated, each by itself.
    assert np.abs(run.applied[after]).max() > 0.5


@pytest.mark.parametrize("mechanism", [PAPER, PAPER.rigid()], ids=["flexible", "rigid"])
def test_an_engagement_takes_what_is_left_of_the_nearest_motion(mechanism):
    """By the null space of the constraints instead of multipliers."""
    task = plan_tracking(mechanism, SIDE, samples=11)
    run = task.simulate("++++", options=IntegrationOptions(tolerance=1e-5))
    state = State(run.solution.t[5], run.solution.q[5], run.solution.v[5])
    joints = ["A1", "A2"]
    braked = brake(task.system, state, joints)
    M = sparse_mass(task.system, state.q).toarray()
    rows = [joint_coordinate(task.system, name, state.q[None]).rows for name in joints]
    Z = scipy.linalg.null_space(np.vstack([task.system.jacobian(state.q), *rows]))
    expected = Z @ np.linalg.solve(Z.T @ M @ Z, Z.T @ M @ state.v)
    # Joints that Baumgarte leaves a little open in velocity are closed by the same blow.
    np.testing.assert_allclose(braked.state.v, expected, atol=1e-8 * np.abs(state.v).max())
    before, left = 0.5 * state.v @ M @ state.v, 0.5 * expected @ M @ expected
    assert braked.energy == pytest.approx(before - left, rel=1e-6)
    # Rigid links stop; flexible ones are stopped at their roots alone and go on.
    assert braked.energy == pytest.approx(before, rel=1e-9) if mechanism is not PAPER else braked.energy < 0.01 * before
    assert braked.energy > 1e-6 * before
    assert brake(task.system, braked.state, joints).energy < 1e-15 * before
    np.testing.assert_array_equal(braked.state.q, state.q)


@pytest.mark.parametrize("geometry", list(Geometry))
@pytest.mark.parametrize("mode", ["++++", "+-++"])
def test_held_motors_stand_still_and_energy_is_accounted_for(geometry, mode):
    task = plan_tracking(PAPER.with_geometry(geometry), SIDE, duration=2.0 * SIDE.duration, samples=201)
    options = IntegrationOptions(method="esdirk5", tolerance=2e-7)
    free, held = (task.simulate(mode, options=options, after=after) for after in ("free", "hold"))
    solution = held.solution
    assert solution.status == "complete"
    np.testing.assert_array_equal(solution.t, free.solution.t)
    assert solution.q.shape == free.solution.q.shape
    assert solution.multipliers.shape == free.solution.multipliers.shape
    after = solution.t > task.path.duration
    along = [tracking_dataset([run])["end_effector"].values[0, ~after] for run in (free, held)]
    assert np.abs(along[0] - along[1]).max() < 2e-5
    for k, motor in enumerate(task.mechanism.motors):
        angle = joint_coordinate(task.system, motor.joint, solution.q).value[after]
        if motor.name in held.mode.motors:
            assert np.ptp(angle) < 1e-10
            assert np.abs(held.applied[after, k]).max() > 1e-2
        else:
            assert np.ptp(angle) > 1e-6
            assert np.all(held.applied[:, k] == 0.0)
    assert np.abs(free.applied[after]).max() < 1e-12
    balance = solution.kinetic_energy + solution.strain_energy - solution.work
    assert solution.brake_energy > 1e-5
    # Motors stand still and work no more; the brakes' share is in the work.
    assert np.ptp(solution.work[after]) < 1e-12
    first = int(np.argmax(after))
    assert abs(balance[first] - balance[first - 1]) < 0.1 * solution.brake_energy
    # The method damps some of the fast vibration that the blow leaves: with a fifth of the tolerance a quarter of it.
    assert np.ptp(balance) < 0.25 * solution.brake_energy
    # At the ends of steps it varies by no more than twice its largest magnitude, and between them hardly by more.
    assert np.ptp(balance) / solution.energy_balance_max < 3.0


@pytest.mark.parametrize("method", [*(name for name, one in METHODS.items() if isinstance(one, NativeMethod)), "radau"])
def test_every_method_holds(method):
    task = plan_tracking(PAPER, SIDE, duration=1.5 * SIDE.duration, samples=31, after=Ending.HOLD)
    reference = task.simulate("++++", options=IntegrationOptions(method="esdirk5", tolerance=1e-7))
    # What errors of these two add up to is several tolerances.
    tolerance = 1e-6 if method in ("esdirk3", "wilson-theta") else 1e-5
    run = task.simulate("++++", options=IntegrationOptions(method=method, tolerance=tolerance))
    a, b = (tracking_dataset([each])["end_effector"].values for each in (run, reference))
    assert np.abs(a - b).max() < 2e-4
    angle = joint_coordinate(task.system, "A1", run.solution.q).value[run.solution.t > task.path.duration]
    assert np.ptp(angle) < 1e-6


def test_the_rigid_mechanism_stands_still_when_its_motors_are_held():
    """Four locks on two degrees of freedom: two of them follow from the others."""
    path = Polygon(((0.05, 0.314), (-0.05, 0.314), (-0.05, 0.214), (0.05, 0.214)), 40.0)
    task = plan_tracking(PAPER.rigid(), path, duration=0.6, samples=61, after="hold")
    run = task.simulate("++++", options=IntegrationOptions(tolerance=1e-6))
    after = run.solution.t > path.duration
    assert np.ptp(run.solution.q[after], axis=0).max() < 1e-7
    assert run.solution.brake_energy < 1e-9
    data = tracking_dataset([run])
    assert float(data["tracking_rms_after"][0]) < 1e-5


def test_finite_segments_are_held_too():
    """By the joints of the first segments; told as links."""
    task = plan_tracking(PAPER, SIDE, duration=1.5 * SIDE.duration, samples=61, after="hold").in_segments(4)
    run = task.simulate("++++", options=IntegrationOptions(method="esdirk5", tolerance=1e-8))
    data, solution = tracking_dataset([run]), run.solution
    after = solution.t > SIDE.duration
    for motor in task.mechanism.motors:
        assert np.ptp(joint_coordinate(task.system, motor.joint, solution.q).value[after]) < 1e-10
    np.testing.assert_array_equal(data["torque"].values[0], run.applied)
    assert list(data["body"].values) == [body.name for body in PAPER.bodies]
    balance = solution.kinetic_energy + solution.strain_energy - solution.work
    assert np.ptp(balance) < 0.05 * solution.brake_energy


def test_a_slider_is_held_where_it_is():
    """A mass on a rail, driven to 0.1 m; weight along the rail, so that it falls unless it is held."""
    slider = RigidBody("slider", 2.0, 0.1, points={"S": (0.0, 0.0)})
    rail = Mechanism(
        "rail", {"O": (0.0, 0.0)}, (slider,),
        (PrismaticJoint("rail", PointRef("ground", "O"), PointRef("slider", "S")),), (Motor("drive", "rail"),),
        end_effector=EndEffector(PointRef("slider", "S"), ("x",)), assemblies=(Assembly("at", {"slider": 0.0}),),
        gravity=(3.0, 0.0),
    )  # fmt: skip
    path = PointPath(((0.0, 0.0), (0.1, 0.0)), 0.2)
    task = plan_tracking(rail, path, duration=0.5, samples=51, after="hold")
    run = task.simulate("+", options=IntegrationOptions(tolerance=1e-7))
    after = run.solution.t > 0.2
    np.testing.assert_allclose(run.solution.q[after, 0], 0.1, atol=1e-6)
    np.testing.assert_allclose(run.applied[after, 0], -2.0 * 3.0, rtol=1e-9)


def test_samples_need_not_fall_on_the_end_of_the_path():
    path = PointPath(((0.0, 0.264), (0.01, 0.264)), 0.1)
    options = IntegrationOptions(method="esdirk5", tolerance=1e-6)
    on, off = (
        plan_tracking(PAPER, path, duration=0.2, samples=samples, after="hold").simulate("++++", options=options)
        for samples in (41, 8)
    )
    assert np.any(on.solution.t == 0.1)
    assert not np.any(np.isclose(off.solution.t, 0.1))
    assert off.solution.t.size == 8
    assert on.solution.brake_energy == pytest.approx(off.solution.brake_energy, rel=1e-3)
    np.testing.assert_allclose(on.solution.q[-1], off.solution.q[-1], atol=1e-5)


def test_a_run_that_ends_with_its_path_engages_nothing():
    task = plan_tracking(PAPER, SIDE, samples=11, after="hold")
    assert not task.holds
    run = task.simulate("++++")
    assert run.holding is None
    assert run.solution.brake_energy == 0.0


def test_runs_stop_and_fail_in_the_dwell_with_what_was_computed():
    task = plan_tracking(PAPER, SIDE, duration=2.0 * SIDE.duration, samples=101, after="hold")
    whole = task.simulate("+-++", options=IntegrationOptions(tolerance=1e-4))
    after = whole.solution.t > SIDE.duration
    # The joint that goes furthest beyond all that it does in the motion.
    beyond = {}
    for joint in PAPER.joints:
        angle = joint_coordinate(task.system, joint.name, whole.solution.q).value
        low, high = angle[~after].min(), angle[~after].max()
        beyond[JointLimit(joint.name, high=0.5 * (high + angle[after].max()))] = angle[after].max() - high
        beyond[JointLimit(joint.name, low=0.5 * (low + angle[after].min()))] = low - angle[after].min()
    bound = max(beyond, key=beyond.__getitem__)
    run = task.simulate("+-++", options=IntegrationOptions(tolerance=1e-4, events=(bound,)))
    assert run.solution.status == "stopped"
    # Which vibration goes furthest, and when, is up to rounding.
    in_dwell = SIDE.duration < run.solution.event_time < 2.0 * SIDE.duration
    assert in_dwell
    data = tracking_dataset([run])
    assert np.isfinite(data["tracking_rms_motion"][0])
    assert np.isnan(data["tracking_rms"][0])
    with pytest.raises(IntegrationError) as caught:
        task.simulate("+-++", options=IntegrationOptions(tolerance=1e-4, max_steps=whole.solution.steps - 3))
    partial = caught.value.partial
    # Of the whole run, not of its part with brakes.
    assert caught.value.cause == f"the run has not ended after {whole.solution.steps - 3} steps,"
    assert caught.value.moment.step == partial.solution.steps > 100
    reached = whole.solution.t[whole.solution.t <= caught.value.moment.time]
    np.testing.assert_array_equal(partial.solution.t, reached)
    assert np.any(reached > SIDE.duration)
    assert reached.size < whole.solution.t.size
    assert partial.applied.shape == (partial.solution.t.size, 4)


def test_names_are_checked():
    task = plan_tracking(PAPER, SIDE, samples=3)
    for make in (
        lambda: plan_tracking(PAPER, SIDE, samples=3, after="brake"),
        lambda: task.simulate("++++", after="brake"),
        lambda: dataclasses.replace(task, after="brake"),
    ):
        with pytest.raises(InputError, match=r"after: unknown ending \(got 'brake'\)"):
            make()
    assert dataclasses.replace(task, after="hold").after is Ending.HOLD


@pytest.mark.parametrize("engine", ["exudyn", "mujoco"])
def test_engines_refuse_brakes_by_name(engine):
    pytest.importorskip(engine)
    task = plan_tracking(PAPER, SIDE, duration=0.2, samples=11, after="hold")
    with pytest.raises(InputError, match=r"study.after: (Exudyn|MuJoCo) cannot express brakes after the path"):
        verify(task, ["++++"], models=[engine])


def test_the_model_file_and_the_command_line_say_so(tmp_path):
    done = paraflex("new", "mine", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    model = tmp_path / "mine.toml"
    text = model.read_text(encoding="utf-8")
    model.write_text(text.replace("[study]", '[study]\nafter = "hold"'), encoding="utf-8")
    assert load(str(model)).study.after == "hold"
    model.write_text(text.replace("[study]", '[study]\nafter = "brake"'), encoding="utf-8")
    with pytest.raises(InputError, match=r"study.after"):
        load(str(model))
    asked = ("run", "-m", "raparm_i", "--path", "line", "--mode", "++++", "--duration", "0.2", "--tol", "1e-3")
    done = paraflex(*asked, "--no-figures", "--after", "hold", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "the motors" in done.stdout
    assert "held by brakes" in " ".join(done.stdout.split())
    told = json.loads((tmp_path / "results" / "summary.json").read_text())
    assert (told["after"], told["parameters"]["run"]["after"]) == ("hold", "hold")
    assert told["modes"]["++++"]["brake_energy"] > 0.0
    page = (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
    assert "--after hold" in page
    assert "motors held by brakes" in page
    done = paraflex(*asked, "--after", "brake", cwd=tmp_path)
    assert done.returncode == 2
    assert "--after: unknown ending (got 'brake')" in done.stderr
    done = paraflex("run", "--no-figures", "-m", "raparm_i", "--ked", "--after", "hold", cwd=tmp_path)
    assert "--after: has no effect with --ked" in done.stderr
    done = paraflex("run", "--no-figures", "-m", "pendulum", "--after", "hold", cwd=tmp_path)
    assert "--after: the model has no path after which motors could be held" in done.stderr


def test_a_study_keeps_what_its_task_says():
    task = plan_tracking(PAPER, SIDE, duration=0.2, samples=21, after="hold")
    data = run_study(task, ["++++"], options=IntegrationOptions(tolerance=1e-3)).data
    assert data.attrs["after"] == "hold"
    assert summary(data)["modes"]["++++"]["brake_energy"] == float(data["brake_energy"][0]) > 0.0
    assert build_system(task.remodelled(PAPER.rigid()).mechanism).n == 24
    assert task.remodelled(PAPER.rigid()).holds
