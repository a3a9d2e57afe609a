"""Points that slide off their beams: when a closed form says, by every way of running, and what is said of it."""

import dataclasses
import json
import warnings
from itertools import pairwise

import numpy as np
import pandas
import pytest
import scipy.optimize

from paraflex.elastodynamics import simulate_ked
from paraflex.errors import InputError, ModelWarning, ResultWarning, SliderOffBeamError, UnreachablePathError
from paraflex.files import library_names, load
from paraflex.integrators import METHODS, IntegrationOptions, JointLimit
from paraflex.mechanism import (
    Assembly,
    AtEnd,
    ConstantSpeed,
    EndEffector,
    FlexibleBeam,
    LinearSpring,
    Material,
    Mechanism,
    Motor,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    RigidBody,
    Section,
    SlidingJoint,
    finite_segments,
)
from paraflex.motion import simulate_motion
from paraflex.paths import Line
from paraflex.results import motion_dataset, motion_summary, summary, tracking_dataset
from paraflex.tracking import plan_tracking, simulate
from shell import paraflex

BASE, CRANK, LENGTH = 0.2, 0.1, 0.25
START, SPEED = 2.5, -5.0
# The pin on the crank is sqrt(BASE^2 + CRANK^2 + 2 BASE CRANK cos phi) from the lever's bearing.
COSINE = (LENGTH**2 - BASE**2 - CRANK**2) / (2 * BASE * CRANK)
LEAVES = (np.arccos(COSINE) - START) / SPEED
FURTHEST = BASE + CRANK


def ref(text):
    return PointRef.parse(text)


def lever(at_end="error", start=START, length=LENGTH, **keywords):
    beam = FlexibleBeam(
        "lever", length, Section.rectangle(0.02, 0.004), Material(210e9, 7850.0), {"Q": 0.0, "T": length}, 2
    )  # fmt: skip
    crank = RigidBody("crank", 0.2, 1e-3, points={"O": (0.0, 0.0), "P": (CRANK, 0.0)})
    values = {
        "prescribed": (PrescribedAngle("drive", "O", ConstantSpeed(start, SPEED)),),
        "assemblies": (Assembly("start", {"crank": start, "lever": 0.4}),),
    } | keywords
    return Mechanism(
        "lever",
        {"O": (BASE, 0.0), "Q": (0.0, 0.0)},
        (crank, beam),
        (
            RevoluteJoint("O", ref("ground.O"), ref("crank.O")),
            RevoluteJoint("Q", ref("ground.Q"), ref("lever.Q")),
            SlidingJoint("pin", ref("lever.Q"), ref("crank.P"), at_end),
        ),
        **values,
    )


def driven(at_end="error"):
    """The same with a motor in place of the prescribed speed; its task is where the pin is along x."""
    return lever(
        at_end, prescribed=(), motors=(Motor("tau", "O"),), end_effector=EndEffector(ref("crank.P"), ("x",))
    )  # fmt: skip


def path(end=0.25):
    return Line((BASE + CRANK * np.cos(START), 0.0), (end, 0.0), 10.0)


def path_leaves():
    """When the pin on the path is where the beam ends."""
    line = path()
    x = BASE + CRANK * COSINE
    return scipy.optimize.brentq(lambda t: line.evaluate(np.array([t])).position[0, 0] - x, 0.0, line.duration)


@pytest.mark.parametrize("method", sorted(METHODS))
@pytest.mark.parametrize("at_end", ["error", "stop"])
def test_a_run_ends_where_the_beam_does(method, at_end):
    options = IntegrationOptions(method=method, tolerance=1e-6)
    run_it = lambda: simulate_motion(lever(at_end).rigid(), 1.0, samples=21, options=options)  # noqa: E731
    if at_end == "error":
        with pytest.raises(SliderOffBeamError, match=r"joint pin came to the end of its beam lever, 0\.25 m") as caught:
            run_it()
        run = caught.value.partial
        assert caught.value.moment.time == pytest.approx(LEAVES, abs=2e-6)
        assert run.solution.status == "failed"
    else:
        run = run_it()
        assert run.solution.status == "stopped"
    assert run.solution.event == "joint pin at the end of lever"
    # Samples every 0.05 s until then, and the state there.
    np.testing.assert_allclose(run.solution.t, [*np.arange(0.0, LEAVES, 0.05), LEAVES], rtol=0, atol=2e-6)
    motion_dataset(run)


def test_the_error_names_the_joint_its_place_and_time():
    with pytest.raises(SliderOffBeamError) as caught:
        simulate_motion(lever(), 1.0, samples=21)
    steps = caught.value.partial.solution.steps
    assert str(caught.value) == (
        "joint pin came to the end of its beam lever, 0.25 m from its first end "
        f'(at_end = "error"), at t = {LEAVES:.6g} s (step {steps}); '
        'lengthen the beam, or let the run go on with at_end = "warn"'
    )


def test_a_run_that_goes_on_says_how_far_and_when():
    text = (
        f"joint.pin: its point leaves lever, 0.25 m long, at t = {LEAVES:.6g} s, as far as {FURTHEST:g} m "
        "from its first end: deflections there are extrapolated"
    )
    with pytest.warns(ResultWarning) as caught:
        run = simulate_motion(lever("warn").rigid(), 1.0, samples=21)
    assert len(caught) == 1
    assert str(caught[0].message).startswith(text)
    assert run.solution.status == "complete"
    finding = motion_summary(motion_dataset(run))["verdict"]["findings"]
    assert [one["code"] for one in finding] == ["slider-off-beam"]
    assert finding[0]["place"] == "joint.pin"
    ignored = simulate_motion(lever("ignore").rigid(), 1.0, samples=21)
    assert ignored.solution.findings == ()
    np.testing.assert_array_equal(ignored.solution.q, run.solution.q)


def test_a_run_that_goes_on_still_stops_at_its_events():
    """The limit is met after the beam's end, in the same step and in a later one."""
    for beyond in (1e-7, 0.2):
        limit = JointLimit("O", low=np.arccos(COSINE) - beyond)
        options = IntegrationOptions(events=(limit,))
        run = simulate_motion(lever("warn").rigid(), 1.0, samples=21, options=options)
        assert run.solution.event == "joint O"
        assert run.solution.t[-1] == pytest.approx(LEAVES + beyond / -SPEED, abs=1e-8)
        assert len(run.solution.findings) == 1


def test_a_start_off_the_beam_is_refused_with_the_place():
    mechanism = lever(start=0.3)
    place = np.sqrt(BASE**2 + CRANK**2 + 2 * BASE * CRANK * np.cos(0.3))
    with pytest.raises(InputError) as caught:
        simulate_motion(mechanism, 0.1)
    assert str(caught.value) == (
        f"joint.pin: its point is off the beam at the start, t = 0 s: {place:.6g} m from the first end of lever, which "
        'is 0.25 m long; start within the beam, lengthen it, or let the run go on with at_end = "warn"'
    )
    with pytest.warns(ResultWarning, match=r"its point leaves lever, 0\.25 m long, at t = 0 s, as far as"):
        simulate_motion(lever("warn", start=0.3).rigid(), 0.1)


def test_a_point_may_start_at_the_very_end():
    """At the end to rounding, and drawn inwards: no event."""
    mechanism = lever(start=float(np.arccos(COSINE)))
    inwards = dataclasses.replace(
        mechanism, prescribed=(PrescribedAngle("drive", "O", ConstantSpeed(float(np.arccos(COSINE)), 5.0)),)
    )
    assert simulate_motion(inwards, 0.05, samples=3).solution.status == "complete"


def test_a_bead_leaves_the_first_end_too():
    """A bead drawn along a still beam by a spring: s = s0 cos(sqrt(k / m) t), past zero only if the end were not."""
    beam = FlexibleBeam("wire", 0.5, Section.rectangle(0.02, 0.02), Material(210e9, 7850.0), {"A": 0.0, "B": 0.5}, 1)
    bead = RigidBody("bead", 0.1, 1e-5, points={"C": (0.0, 0.0)})
    mechanism = Mechanism(
        "bead",
        {"A": (0.0, 0.0)},
        (beam, bead),
        (
            RevoluteJoint("A", ref("ground.A"), ref("wire.A")),
            SlidingJoint("slide", ref("wire.B"), ref("bead.C"), "stop"),
        ),
        prescribed=(PrescribedAngle("clamp", "A", ConstantSpeed(0.0, 0.0)),),
        linear_springs=(LinearSpring("pull", ref("ground.A"), ref("bead.C"), 40.0, 0.0),),
        assemblies=(Assembly("start", {"wire": 0.0, "bead": 0.0}, {ref("bead.C"): (0.3, 0.0)}),),
    )
    solution = simulate_motion(mechanism.rigid(), 1.0, options=IntegrationOptions(tolerance=1e-8)).solution
    # It sets out at 0.3 m and reaches the first end after a quarter of a period.
    assert solution.event == "joint slide at the end of wire"
    assert solution.t[-1] == pytest.approx(0.5 * np.pi * np.sqrt(0.1 / 40.0), abs=1e-7)


def test_a_path_that_leaves_the_beam_is_refused_before_any_run():
    with pytest.raises(UnreachablePathError, match=r"the path takes joint pin as far as 0\.264\d* m") as e:
        plan_tracking(driven(), path(), samples=51)
    assert e.value.moment.time == pytest.approx(path_leaves(), abs=1e-5)
    with pytest.warns(ModelWarning, match=r"its point leaves lever, 0\.25 m long, at t ="):
        plan_tracking(driven("warn"), path(), samples=51)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plan_tracking(driven("ignore"), path(), samples=51)
        plan_tracking(driven(), path(0.225), samples=51)


@pytest.mark.parametrize("rigid", [True, False])
def test_a_run_along_a_path_stops_at_the_end_of_the_beam(rigid):
    task = plan_tracking(driven("stop"), path(), samples=51)
    task = task.remodelled(task.mechanism.rigid()) if rigid else task
    run = simulate(task, "tau", options=IntegrationOptions(tolerance=1e-7))
    assert run.solution.status == "stopped"
    # Driven by torques alone a flexible lever follows the path to its errors.
    assert run.solution.t[-1] == pytest.approx(path_leaves(), abs=1e-5 if rigid else 1e-3)
    data = summary(tracking_dataset([run]))
    (figures,) = data["modes"].values()
    assert figures["event"] == "joint pin at the end of lever"
    assert "slider-off-beam" not in [one["code"] for one in data["verdict"]["findings"]]


def test_elastodynamics_stops_or_goes_on_where_the_joint_says():
    stopped, gone_on = (
        simulate_ked(plan_tracking(driven(at_end), path(), samples=51, warning=False), "tau", step=1e-3)
        for at_end in ("stop", "warn")
    )
    solution = stopped.solution
    assert solution.status == "stopped"
    assert solution.event == "joint pin at the end of lever"
    assert solution.t[-1] == pytest.approx(path_leaves(), abs=1e-5)
    assert solution.message.startswith("joint pin came to the end of its beam lever, 0.25 m from its first end")
    k = solution.t.size - 1
    np.testing.assert_array_equal(solution.q[:k], gone_on.solution.q[:k])
    # What the mechanism does at the end stands between its neighbours.
    low, high = np.sort(gone_on.solution.q[k - 1 : k + 1], axis=0)
    assert np.all((solution.q[k] >= low - 1e-6) & (solution.q[k] <= high + 1e-6))
    assert stopped.findings == ()
    (figures,) = summary(tracking_dataset([stopped]))["modes"].values()
    assert figures["event_time"] == solution.t[-1]
    assert [one.code for one in gone_on.findings] == ["slider-off-beam"]
    with pytest.raises(InputError, match="its point is off the beam at the start"):
        simulate_ked(
            plan_tracking(driven("stop"), Line((0.25, 0.0), (BASE + CRANK * np.cos(START), 0.0), 10.0), samples=51),
            "tau",
        )


def test_a_beam_that_carries_a_sliding_point_is_not_cut():
    with pytest.raises(InputError, match=r"joint\.pin: a beam that a joint slides along cannot be cut into segments"):
        finite_segments(lever(), 4)
    finite_segments(dataclasses.replace(lever(), bodies=lever().rigid(["lever"]).bodies), {})


def test_what_a_joint_does_at_the_end_is_one_of_four():
    assert lever("stop").joint("pin").at_end is AtEnd.STOP
    with pytest.raises(InputError, match=r"joint\.pin\.at_end: unknown at end"):
        lever("bounce")


MODEL = """
name = "lever"
[ground]
O = [0.2, 0.0]
Q = [0.0, 0.0]
[section.strip]
width = 0.02
thickness = 0.004
[material.steel]
youngs_modulus = 210e9
density = 7850.0
[body.crank]
type = "rigid"
mass = 0.2
inertia = 1e-3
points = { O = [0.0, 0.0], P = [0.1, 0.0] }
[body.lever]
type = "beam"
length = 0.25
section = "strip"
material = "steel"
points = { Q = 0.0, T = 0.25 }
[joint]
O = ["ground.O", "crank.O"]
Q = ["ground.Q", "lever.Q"]
[joint.pin]
type = "sliding"
points = ["lever.Q", "crank.P"]
AT_END
[prescribed.drive]
joint = "O"
angle = 2.5
speed = -5.0
[assembly.start]
crank = 2.5
lever = 0.5
[study]
duration = 1.0
samples = 101
"""


def test_the_command_line_says_so(tmp_path):
    said, codes = {}, {}
    for at_end in ("error", "stop", "warn", "ignore"):
        line = "" if at_end == "error" else f'at_end = "{at_end}"'
        file = tmp_path / f"{at_end}.toml"
        file.write_text(MODEL.replace("AT_END", line))
        done = paraflex("run", "-m", str(file), "--rigid", "--no-report", "--out", str(tmp_path / at_end))
        said[at_end], codes[at_end] = done.stdout + done.stderr, done.returncode
    assert codes == {"error": 1, "stop": 0, "warn": 0, "ignore": 0}
    came = 'joint pin came to the end of its beam lever, 0.25 m from its first end (at_end = "{}"), at t = 0.249405 s'
    assert "error: " + came.format("error") in said["error"]
    assert "lever: failed, " in said["error"]
    assert came.format("stop") in said["stop"]
    assert "warning: joint.pin: its point leaves lever, 0.25 m long, at t = 0.249405 s" in said["warn"]
    assert "[slider-off-beam]" in said["warn"]
    assert "joint pin came" not in said["ignore"]
    assert "warning: joint.pin" not in said["ignore"]
    figures = json.loads((tmp_path / "error" / "summary.json").read_text())
    assert figures["event"] == "joint pin at the end of lever"


@pytest.mark.parametrize(("at_end", "status"), [("stop", "failed"), ("error", "failed"), ("warn", "complete")])
def test_a_sweep_has_no_metrics_of_a_run_that_ended_there(tmp_path, at_end, status):
    """The design whose beam is too short fails, with the time; the longer one is complete whatever `at_end` is."""
    start, fields = MODEL.index("[prescribed.drive]"), MODEL.index("[assembly.start]")
    text = MODEL[:start] + MODEL[fields:].replace("duration = 1.0\n", "")
    text = text.replace("AT_END", f'at_end = "{at_end}"').replace("length = 0.25", 'length = "L"')
    text = text.replace("T = 0.25", 'T = "L"').replace("[ground]", "[parameters]\nL = 0.25\n[ground]", 1)
    x = BASE + CRANK * np.cos(START)
    text += f"""
[motor]
tau = "O"
[mode]
"+" = ["tau"]
[end_effector]
point = "crank.P"
coordinates = ["x"]
[path.line]
type = "line"
start = [{x:.17g}, 0.0]
end = [0.25, 0.0]
max_acceleration = 10.0
"""
    (tmp_path / "lever.toml").write_text(text)
    (tmp_path / "study.toml").write_text(
        'name = "lengths"\nmechanism = "lever.toml"\nsamples = 21\n[sampling]\nkind = "grid"\n'
        '[vary.L]\nfields = ["parameters.L"]\nvalues = [0.25, 0.35]\n'
    )
    out = tmp_path / "out"
    done = paraflex("sweep", str(tmp_path / "study.toml"), "--workers", "1", "--no-report", "--out", str(out))
    table = pandas.read_parquet(out / "results.parquet").set_index("L")
    assert list(table["status"]) == [status, "complete"], done.stderr
    if status == "failed":
        assert "pin" in table["reason"][0.25]
        assert table["time_reached"][0.25] == pytest.approx(path_leaves(), abs=1e-4)


@pytest.mark.parametrize("name", library_names())
def test_no_mechanism_of_the_library_slides_on_a_beam(name):
    """They run as they did before ends of beams were watched."""
    assert not any(isinstance(joint, SlidingJoint) for joint in load(name).mechanism.joints)


def test_samples_before_the_end_are_those_of_a_run_without():
    ended = simulate_motion(lever("stop"), 1.0, samples=21).solution
    free = simulate_motion(lever("ignore"), 1.0, samples=21).solution
    np.testing.assert_array_equal(ended.q[:-1], free.q[: len(ended.q) - 1])
    assert all(a < b for a, b in pairwise(ended.t))
