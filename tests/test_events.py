"""Events that end a run: where closed forms say, for every kind of joint, in both geometries, with dependent rows."""

import io
import re
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import scipy.special

from paraflex.dynamics import InputSignals, SingularityMeasure, build_system, consistent_state, pack_signals
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.files import load
from paraflex.integrators import DeflectionLimit, IntegrationOptions, JointLimit, SingularDistance, integrate
from paraflex.integrators.crossing import advance
from paraflex.integrators.event_functions import deflection_rows, event_functions
from paraflex.integrators.run import Instant
from paraflex.kernel.run_state import PAUSED
from paraflex.mechanism import (
    Assembly,
    ConstantSpeed,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    Motor,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    Section,
    WeldJoint,
)
from paraflex.motion import simulate_motion
from paraflex.results import load_results, motion_dataset, motion_summary, save_results, summary, tracking_dataset
from paraflex.results.outlines import deflections
from paraflex.tracking import plan_tracking, simulate
from test_integrator import parallelogram
from test_loads import INERTIA, MASS, REACH, G, pendulum

PACE = np.sqrt(MASS * G * REACH / (INERTIA + MASS * REACH**2))


def stopped(mechanism, duration, *events, tolerance=1e-6, samples=21, **options):
    chosen = IntegrationOptions(tolerance=tolerance, events=events, **options)
    return simulate_motion(mechanism, duration, samples=samples, options=chosen).solution


def let_go():
    """From rest two radians off the vertical; clockwise is down."""
    return pendulum(gravity=(0.0, -G), assemblies=(Assembly("start", {"arm": -np.pi / 2 + 2.0}),))


def time_until(angle):
    """When a pendulum let go at two radians is at an angle on its way down: elliptic integrals."""
    k = np.sin(1.0)
    return (scipy.special.ellipk(k**2) - scipy.special.ellipkinc(np.arcsin(np.sin(angle / 2) / k), k**2)) / PACE


def test_a_pendulum_stops_at_its_limit_when_the_elliptic_integral_says():
    limit = JointLimit("pin", low=-np.pi / 2 + 1.0)
    errors = []
    for tolerance in (1e-3, 1e-6):
        solution = stopped(let_go(), 2.0, limit, tolerance=tolerance)
        errors.append(abs(solution.t[-1] - time_until(1.0)))
        assert solution.q[-1, 2] == pytest.approx(-np.pi / 2 + 1.0, abs=1e-12)
    assert errors[0] < 2e-6
    assert errors[1] < 0.02 * errors[0]


def test_a_run_ends_at_the_event_with_its_state():
    solution = stopped(let_go(), 2.0, JointLimit("pin", -np.pi / 2 + 1.0, 3.0))
    assert solution.status == "stopped"
    assert solution.event == "joint pin"
    assert (
        solution.message == f"joint pin reached its lower limit {-np.pi / 2 + 1.0:g} rad at t = {time_until(1.0):.6g} s"
    )
    # Samples every 0.1 s until then, and the event.
    np.testing.assert_allclose(solution.t, [0.0, 0.1, 0.2, 0.3, time_until(1.0)], rtol=0, atol=1e-7)
    assert solution.event_time == solution.t[-1]
    energy = MASS * G * REACH * (np.cos(1.0) - np.cos(2.0))
    assert solution.kinetic_energy[-1] == pytest.approx(energy, rel=1e-6)
    assert solution.work[-1] == pytest.approx(energy, rel=1e-6)
    assert solution.a[-1, 2] == pytest.approx(-(PACE**2) * np.sin(1.0), rel=1e-9)
    # The pin carries the weight and the acceleration of the centre of mass along the arm and across it.
    rate = np.sqrt(2 * energy / (INERTIA + MASS * REACH**2))
    along = MASS * (REACH * rate**2 + G * np.cos(1.0))
    across = MASS * (G * np.sin(1.0) - REACH * PACE**2 * np.sin(1.0))
    assert np.linalg.norm(solution.multipliers[-1]) == pytest.approx(np.hypot(along, across), rel=1e-5)


def test_samples_before_an_event_are_those_of_a_run_without():
    free = stopped(let_go(), 2.0)
    ended = stopped(let_go(), 2.0, JointLimit("pin", low=-np.pi / 2 + 1.0))
    assert free.status == "complete"
    assert free.event == ""
    np.testing.assert_array_equal(ended.q[:-1], free.q[: len(ended.q) - 1])
    np.testing.assert_array_equal(ended.multipliers[:-1], free.multipliers[: len(ended.q) - 1])


def test_the_first_of_several_events_ends_the_run():
    events = (JointLimit("pin", low=-np.pi / 2 + 0.5), JointLimit("pin", low=-np.pi / 2 + 1.5))
    assert stopped(let_go(), 2.0, *events).q[-1, 2] == pytest.approx(-np.pi / 2 + 1.5, abs=1e-12)


@dataclass
class Thrown:
    """A run in steps of one second along the angle (t - 5 - shift)^2, an arm that turns round within a step."""

    shift: float
    t: float = 0.0

    def now(self):
        x = self.t - 5.0 - self.shift
        q, v, a = np.zeros((3, 3))
        q[2], v[2], a[2] = x**2, 2.0 * x, 2.0
        return Instant(self.t, q, v, a, np.zeros(2), 0.0)

    def march(self, attempts):
        self.t += attempts
        return PAUSED


@pytest.mark.parametrize("shift", np.linspace(0.0, 0.9, 10))
def test_a_limit_is_found_that_is_crossed_and_left_within_a_step(shift):
    system = build_system(pendulum())
    functions = event_functions(system, np.array([0.0, 0.0, 1.0]), [JointLimit("pin", low=0.02)])
    _, crossing = advance(Thrown(shift), functions, 10)
    assert crossing is not None
    assert crossing.t == pytest.approx(5.0 + shift - np.sqrt(0.02), abs=1e-12)
    _, crossing = advance(Thrown(shift), event_functions(system, np.ones(3), [JointLimit("pin", low=-1e-9)]), 10)
    assert crossing is None


def test_work_at_an_event_is_that_of_the_motor():
    mechanism = pendulum(motors=(Motor("drive", "pin"),))
    options = IntegrationOptions(tolerance=1e-6, events=(JointLimit("pin", high=0.7),))
    solution = simulate_motion(mechanism, 1.0, samples=11, torques={"drive": 2.0}, options=options).solution
    assert solution.work[-1] == pytest.approx(2.0 * 0.2, rel=1e-6)


def slider(**changes):
    """A block on a rail through the origin, 30 degrees below the x axis."""
    block = RigidBody("block", 2.0, 0.01, (0.0, 0.0), {"P": (0.0, 0.0)})
    values = {
        "name": "slider",
        "ground": {"O": (0.0, 0.0)},
        "bodies": (block,),
        "joints": (PrismaticJoint("rail", PointRef("ground", "O"), PointRef("block", "P"), -np.pi / 6, 0.0),),
        "gravity": (0.0, -G),
        "assemblies": (Assembly("top", {"block": 0.0}, {PointRef("block", "P"): (0.0, 0.0)}),),
    }
    return Mechanism(**(values | changes))


def test_a_block_slides_down_to_its_stop():
    solution = stopped(slider(), 1.0, JointLimit("rail", -0.1, 0.4))
    assert solution.message.startswith("joint rail reached its upper limit 0.4 m")
    assert solution.t[-1] == pytest.approx(np.sqrt(2 * 0.4 / (0.5 * G)), abs=1e-6)


def test_prescribed_motion_goes_through_a_limit():
    mechanism = pendulum(prescribed=(PrescribedAngle("drive", "pin", ConstantSpeed(0.5, 3.0)),))
    solution = stopped(mechanism, 1.0, JointLimit("pin", high=1.4))
    assert solution.t[-1] == pytest.approx(0.3, abs=1e-6)
    assert solution.message == "joint pin reached its upper limit 1.4 rad at t = 0.3 s"


def test_dependent_rows_leave_an_event_where_it_is():
    """A second pin at the same place adds rows that follow from the first's, and multipliers share the force."""
    twice = replace(
        let_go(),
        joints=(
            *let_go().joints,
            RevoluteJoint("again", PointRef("ground", "O"), PointRef("arm", "A")),
        ),
    )
    once, both = (stopped(m, 1.0, JointLimit("pin", low=-0.5), SingularDistance(1e-3)) for m in (let_go(), twice))
    assert both.event == "joint pin"
    assert both.t[-1] == pytest.approx(once.t[-1], abs=1e-9)
    np.testing.assert_allclose(both.multipliers[-1], np.tile(0.5 * once.multipliers[-1], 2), rtol=1e-6)


def bending(geometry, elements=2):
    """A horizontal steel strip held at one end and let go."""
    strip = FlexibleBeam(
        "strip", 0.6, Section.rectangle(0.02, 0.002), Material(210e9, 7850.0), points={"A": 0.0, "B": 0.6},
        elements=elements,
    )  # fmt: skip
    return Mechanism(
        name="strip",
        ground={"O": (0.0, 0.0)},
        bodies=(strip,),
        joints=(WeldJoint("clamp", PointRef("ground", "O"), PointRef("strip", "A")),),
        gravity=(0.0, -G),
        assemblies=(Assembly("flat", {"strip": 0.0}),),
        geometry=geometry,
    )


@pytest.mark.parametrize("geometry", list(Geometry))
def test_a_strip_let_go_stops_at_its_deflection(geometry):
    """From its chord, at z = 3/8: q L^4 / 24 EI |z^4 - 4 z^3 + 6 z^2 - 3 z|; it swings to twice that."""
    z, stiffness = 0.375, 210e9 * 0.02 * 0.002**3 / 12
    static = 7850.0 * 0.02 * 0.002 * G * 0.6**4 / (24 * stiffness) * abs(z**4 - 4 * z**3 + 6 * z**2 - 3 * z)
    mechanism = bending(geometry)
    solution = stopped(mechanism, 0.5, DeflectionLimit("strip", static))
    assert solution.event == "deflection of strip"
    bent = np.max(np.abs(deflections(build_system(mechanism), solution.q)), axis=1)
    assert bent[-1] == pytest.approx(static, abs=1e-9)
    assert np.all(bent[:-1] < static)
    # A quarter of the period of the first mode: (1.8751 / L)^2 sqrt(EI / m').
    pace = 1.8751041**2 / 0.6**2 * np.sqrt(210e9 * 0.002**2 / 12 / 7850.0)
    assert solution.t[-1] == pytest.approx(0.5 * np.pi / pace, rel=0.05)


def test_deflections_are_taken_within_elements():
    """The largest of a pinned beam's first mode is at its middle, where an element of the whole length has no node."""
    rod = FlexibleBeam(
        "rod", 1.0, Section.rectangle(0.02, 0.002), Material(210e9, 7850.0), points={"A": 0.0, "B": 1.0}, elements=1,
        reference=ReferenceCondition.PINNED,
    )  # fmt: skip
    mechanism = Mechanism(
        "rod", {"O": (0.0, 0.0)}, (rod,), (RevoluteJoint("O", PointRef("ground", "O"), PointRef("rod", "A")),)
    )
    _, rows, _ = deflection_rows(build_system(mechanism).body("rod"))
    shape = np.abs(rows[:, 1, 0])
    assert shape.argmax() == 2
    assert shape[[0, -1]] == pytest.approx(0.0, abs=1e-12)
    assert shape[1] / shape[2] == pytest.approx(np.sin(np.pi / 4), rel=0.01)


def closing(angle=1.0):
    """The parallelogram of unit links, driven flat at 1 rad/s."""
    return parallelogram(ConstantSpeed(angle, -1.0))


def test_a_parallelogram_stops_before_it_is_flat():
    solution = stopped(closing(), 1.5, SingularDistance(0.05), alpha=50.0, beta=50.0)
    assert solution.event == "singular position"
    assert solution.t[-1] < 1.0
    system = build_system(closing())
    q = solution.q[[0, -1]]
    measure = SingularityMeasure(system, q[0])
    assert measure(q)[1] == pytest.approx(0.05, abs=1e-9)
    # Near the flat position it is proportional to the angle from there.
    nearer = stopped(closing(), 1.5, SingularDistance(0.025), alpha=50.0, beta=50.0)
    assert (1.0 - nearer.t[-1]) / (1.0 - solution.t[-1]) == pytest.approx(0.5, rel=0.03)


def test_the_measure_is_a_singular_value_in_the_metric_of_the_mass():
    system = build_system(closing())
    q = consistent_state(system, system.mechanism.assembly()).q
    # Unit links of mass 1 and inertia 0.1 about their middles.
    M = np.zeros((9, 9))
    for k in range(3):
        c, s = 0.5 * np.cos(q[3 * k + 2]), 0.5 * np.sin(q[3 * k + 2])
        M[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = [[1, 0, -s], [0, 1, c], [-s, c, 0.1 + 0.25]]
    J = system.jacobian(q)
    schur = J @ np.linalg.solve(M, J.T)
    size = np.sqrt(np.diag(schur))
    expected = np.sqrt(np.linalg.eigvalsh(schur / np.outer(size, size))[0])
    assert SingularityMeasure(system, q)(q[None])[0] == pytest.approx(expected, rel=1e-9)
    flat = np.zeros_like(q)
    flat[3] = flat[6] = 1.0
    assert SingularityMeasure(system, q)(flat[None])[0] == pytest.approx(0.0, abs=1e-12)


def driven_slider_crank():
    """Equal arms: crank and rod fold flat where the slider is at the crank's pivot; its motor pushes the slider."""
    return Mechanism(
        "slider-crank",
        {"O": (0.0, 0.0)},
        (
            RigidBody("crank", 1.0, 0.01, (0.15, 0.0), {"O": (0.0, 0.0), "A": (0.3, 0.0)}),
            RigidBody("rod", 1.0, 0.02, (0.25, 0.0), {"A": (0.0, 0.0), "B": (0.5, 0.0)}),
            RigidBody("slider", 0.5, 0.001, (0.0, 0.0), {"B": (0.0, 0.0)}),
        ),
        (
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "O")),
            RevoluteJoint("A", PointRef("crank", "A"), PointRef("rod", "A")),
            RevoluteJoint("B", PointRef("rod", "B"), PointRef("slider", "B")),
            PrismaticJoint("rail", PointRef("ground", "O"), PointRef("slider", "B")),
        ),
        motors=(Motor("push", "rail"), Motor("turn", "O")),
        assemblies=(Assembly("up", {"crank": 1.0, "rod": -0.53, "slider": 0.0}),),
    )


def test_motors_are_singular_where_they_hold_nothing():
    """A slider held at its dead centre lets the crank turn; a crank held there holds the slider."""
    system = build_system(driven_slider_crank())
    poses = []
    for crank in (1.0, 0.1, 0.0):
        rod = -np.arcsin(0.3 * np.sin(crank) / 0.5)
        x = 0.3 * np.cos(crank) + 0.5 * np.cos(rod)
        poses.append([0, 0, crank, 0.3 * np.cos(crank), 0.3 * np.sin(crank), rod, x, 0, 0])
    poses = np.array(poses)
    push, turn, both = (
        SingularityMeasure(system, poses[0], names)(poses) for names in (("push",), ("turn",), ("push", "turn"))
    )
    assert push[2] == pytest.approx(0.0, abs=1e-12)
    assert 0.0 < push[1] < 0.3 * push[0]
    assert np.all(turn > 0.1)
    assert np.all(both > 0.1)


def test_a_mechanism_stops_before_the_singularity_of_a_motor():
    event = SingularDistance(0.02, ("push",))
    chosen = IntegrationOptions(tolerance=1e-6, events=(event,))
    solution = simulate_motion(driven_slider_crank(), 1.0, samples=11, torques={"turn": -1.0}, options=chosen).solution
    assert solution.event == "singular position of push"
    assert 0.0 < solution.q[-1, 2] < 0.3


def test_too_few_motors_are_refused_at_the_start():
    with pytest.raises(InputError, match="start outside the limits of singular position of tau1"):
        stopped(load("raparm_i").mechanism, 0.1, SingularDistance(0.01, ("tau1",)))


@pytest.mark.parametrize(
    ("event", "says"),
    [
        (JointLimit("pim", 0.0, 1.0), 'unknown joint .*did you mean "pin"'),
        (DeflectionLimit("arn", 0.1), 'unknown body .*did you mean "arm"'),
        (DeflectionLimit("arm", 0.1), "a rigid body does not bend"),
        (SingularDistance(0.1, ("tau",)), "unknown motor"),
        (
            JointLimit("pin", 1.0, 2.0),
            r"start outside the limits of joint pin \(got 0.5\); start above 1 rad and below",
        ),
        ("pin", "not an event"),
    ],
)
def test_events_a_mechanism_cannot_have_are_refused(event, says):
    with pytest.raises(InputError, match=says):
        stopped(pendulum(), 0.1, event)


@pytest.mark.parametrize(
    "make",
    [
        lambda: JointLimit("pin", 1.0, 1.0),
        lambda: JointLimit("pin"),
        lambda: JointLimit("pin", float("nan"), 1.0),
        lambda: DeflectionLimit("arm", 0.0),
        lambda: DeflectionLimit("arm", np.inf),
        lambda: SingularDistance(0.0),
        lambda: SingularDistance(1.0),
    ],
)
def test_limits_that_make_no_sense_are_refused(make):
    with pytest.raises(InputError):
        make()


def test_a_weld_has_no_limit():
    with pytest.raises(InputError, match="a weld does not move"):
        stopped(bending(Geometry.LINEAR), 0.1, JointLimit("clamp", -1.0, 1.0))


@pytest.mark.parametrize("angle", [0.5439, 0.6], ids=["in the step after the jump", "later"])
def test_events_leave_jumps_of_what_is_given_alone(angle):
    """Constant torque, then none, where steps end: speed and work are those of the first stretch."""
    mechanism = pendulum(motors=(Motor("drive", "pin"),))
    system = build_system(mechanism)
    state = consistent_state(system, mechanism.assembly())
    torque = InputSignals(np.array([0.0, 0.1, 1.0]), np.array([[2.0, 0, 0, 0, 0, 0], np.zeros(6)]))
    signals, knots = pack_signals(mechanism, [torque], 1.0)
    options = IntegrationOptions(tolerance=1e-7, events=(JointLimit("pin", high=angle),))
    solution = integrate(
        system, signals, state, np.linspace(0.0, 1.0, 11), knots=np.append(knots, 0.1), options=options
    )
    speed = 2.0 / (INERTIA + MASS * REACH**2) * 0.1
    assert solution.t[-1] == pytest.approx(0.1 + (angle - 0.5 - 0.5 * speed * 0.1) / speed, abs=1e-6)
    assert solution.v[-1, 2] == pytest.approx(speed, rel=1e-8)
    assert solution.a[-1, 2] == pytest.approx(0.0, abs=1e-9)
    assert solution.work[-1] == pytest.approx(0.1 * speed, rel=1e-6)
    assert solution.energy_balance_max < 1e-9


def test_a_dataset_of_a_stopped_motion_ends_at_the_event(tmp_path):
    options = IntegrationOptions(events=(JointLimit("pin", low=-0.5),))
    run = simulate_motion(let_go(), 2.0, samples=21, options=options)
    data = motion_dataset(run, options=options)
    assert data["time"].values[-1] == run.solution.event_time
    assert data["angle"].values[-1, 0] == pytest.approx(-0.5)
    assert data.attrs["stop_at"] == "joint pin"
    assert data.attrs["integration_method"] == "esdirk5"
    assert data.attrs["constraints_treatment"] == "baumgarte"
    figures = motion_summary(data)
    assert (figures["status"], figures["event"]) == ("stopped", "joint pin")
    assert figures["event_time"] == figures["final"]["time"] == run.solution.event_time
    save_results(data, tmp_path / "results.nc")
    assert load_results(tmp_path / "results.nc")["event"].item() == "joint pin"


def test_a_study_tells_which_modes_were_stopped():
    model = load("raparm_i")
    task = plan_tracking(model.mechanism.rigid(), model.path("square"), duration=0.1, samples=21)
    start, later = task.motion.q[[0, 10], task.system.body("link1").angle]
    limit = JointLimit("A1", **{"high" if later > start else "low": later})
    options = IntegrationOptions(events=(limit,))
    free, ended = simulate(task, "++++"), simulate(task, "+-+-", options=options)
    data = tracking_dataset([free, ended])
    assert list(data["status"].values) == ["complete", "stopped"]
    reached = int((task.motion.t < ended.solution.event_time).sum())
    assert int(data["angle"].sel(mode="+-+-").notnull().all("body").sum()) == reached
    np.testing.assert_array_equal(data["angle"].sel(mode="+-+-").values[:reached, 0], ended.solution.q[:reached, 2])
    figures = summary(data)["modes"]
    assert figures["+-+-"]["event"] == "joint A1"
    assert figures["+-+-"]["event_time"] == ended.solution.event_time
    assert "event" not in figures["++++"]


def test_the_page_on_events_prints_what_it_says():
    page = (Path(__file__).parents[1] / "docs" / "events.md").read_text(encoding="utf-8")
    code, says = re.search(r"```python\n(.*?)```\n\nprints `([^`]*)`", page, re.DOTALL).groups()
    out = io.StringIO()
    with redirect_stdout(out):
        exec(compile(code, "events.md", "exec"), {})
    (found, time), (expected, when) = (text.removesuffix(" s").split("t = ") for text in (out.getvalue().strip(), says))
    assert found == expected
    assert float(time) == pytest.approx(float(when), rel=1e-4)
