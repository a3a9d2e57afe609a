"""The Exudyn engine: another formulation and another integrator must tell the same story."""

import dataclasses
import os
import signal
import sys
import threading

import exudyn
import numpy as np
import pytest

from paraflex.dynamics import build_system, consistent_state
from paraflex.engines.cables import turn_of
from paraflex.engines.exudyn import ExudynOptions, simulate_exudyn
from paraflex.errors import InputError, IntegrationError
from paraflex.fem import ReferenceCondition
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    Assembly,
    Curvature,
    EndEffector,
    FlexibleBeam,
    Geometry,
    LumpedMass,
    Material,
    Mechanism,
    Motor,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    RigidBody,
    SampledAngle,
    Section,
    TorsionalSpring,
)
from paraflex.paths import Line
from paraflex.results.record import record
from paraflex.tracking import plan_tracking
from records import TIP

TURN = 2 * np.pi


def four_bar(youngs_modulus=280e9):
    """A stiff crank with a lump, a flexible coupler with a lump amid, a rocker with its mass off its points.

    Motors at the ground, between bodies, and with the ground as side b. The rocker's angle is told a turn further on.
    """
    section, material = Section.rectangle(0.02, 0.004), Material(youngs_modulus, 1200.0)
    crank = FlexibleBeam(
        "crank",
        0.12,
        section,
        material,
        {"O": 0.0, "P": 0.12},
        lumps=(LumpedMass("O", 0.01, 1e-5), LumpedMass("P", 0.03, 2e-5)),
        flexible=False,
    )
    coupler = FlexibleBeam(
        "coupler",
        0.4,
        section,
        material,
        {"P": 0.0, "M": 0.15, "Q": 0.35},
        elements=2,
        # The one at Q lets the curvature jump where the spring's moment acts.
        lumps=(LumpedMass("M", 0.05, 3e-5), LumpedMass("Q", 0.0, 1e-5)),
        curvature=Curvature.SEPARATE,
        reference=ReferenceCondition.CANTILEVER,
    )
    rocker = RigidBody("rocker", 0.15, 4e-4, (0.1, 0.03), {"S": (0.02, -0.01), "Q": (0.25, 0.02)})
    return Mechanism(
        name="four-bar",
        ground={"O": (0.05, -0.02), "S": (0.35, 0.0)},
        bodies=(crank, coupler, rocker),
        joints=(
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "O")),
            RevoluteJoint("P", PointRef("crank", "P"), PointRef("coupler", "P")),
            RevoluteJoint("Q", PointRef("rocker", "Q"), PointRef("coupler", "Q")),
            RevoluteJoint("S", PointRef("rocker", "S"), PointRef("ground", "S")),
        ),
        motors=(Motor("base", "O"), Motor("knee", "P"), Motor("foot", "S")),
        end_effector=EndEffector(PointRef("coupler", "M"), ("y",)),
        assemblies=(Assembly("up", {"crank": 1.6, "coupler": 0.4, "rocker": 1.5 + TURN}),),
    ).with_geometry("second-order")


def plan(mechanism, samples=51):
    """The coupler's middle 40 mm down in 79 ms, and a little rest."""
    rigid = build_system(mechanism.rigid())
    x, y, phi = consistent_state(rigid, mechanism.assembly()).q[rigid.body("coupler").all]
    x, y = x + 0.15 * np.cos(phi), y + 0.15 * np.sin(phi)
    return plan_tracking(mechanism, Line((x, y), (x, y - 0.04), 20.0), duration=0.1, samples=samples)


def changed(task, **what):
    """A task of a changed mechanism, driven by the torques of the unchanged one."""
    mechanism = dataclasses.replace(task.mechanism, **what)
    return dataclasses.replace(task, mechanism=mechanism, system=build_system(mechanism))


def distance(a, b):
    """Largest distance of two runs' end-effectors."""
    return np.max(np.linalg.norm(a.end_effector.position - b.end_effector.position, axis=1))


TIGHT = IntegrationOptions(tolerance=1e-6)
FINE = ExudynOptions(step=2.5e-5, refinement=2)


@pytest.fixture(scope="module")
def bar():
    return plan(four_bar())


def at_rest(task, stiffness):
    """A spring between rocker and coupler that is relaxed at the start."""
    angles = [task.start.q[task.system.body(name).angle] for name in ("rocker", "coupler")]
    return TorsionalSpring("spring", "Q", stiffness, rest=angles[1] - angles[0])


@pytest.mark.parametrize("stiffness", [0.0, 5.0])
def test_a_linkage_moves_as_with_second_order_geometry(bar, stiffness):
    """The coupler bends by up to 3 mm: the linear shape is 10 um off, what both neglect some 0.4 um."""
    task = changed(bar, springs=(at_rest(bar, stiffness),)) if stiffness else bar
    ours = record(task.simulate("+++", options=TIGHT))
    linear = record(changed(task, geometry=Geometry.LINEAR).simulate("+++", options=TIGHT))
    theirs = simulate_exudyn(task, "+++", FINE)
    # Our tolerance is 1 um, Exudyn's step costs 0.5 um.
    assert distance(ours, theirs) < 2e-6
    assert distance(ours, linear) > 8e-6
    assert theirs.figures["constraint_position_max"] < 1e-9
    # The work that went in is 0.2 J.
    assert np.ptp(theirs.links["work"]) > 0.1
    assert theirs.figures["energy_balance_max"] < 2e-6
    for name in ("kinetic_energy", "strain_energy", "work"):
        np.testing.assert_allclose(theirs.links[name], ours.links[name], rtol=0, atol=1.5e-5, err_msg=name)
    # Bending vibration at 10 krad/s, of 0.01 mm and 0.1 mrad, is damped by one and not by the other.
    for name, within in (
        ("point_position", 2e-6),
        ("chord_angle", 3e-5),
        ("angle", 1e-4),
        *((tip, 1e-4) for tip in TIP),
    ):
        np.testing.assert_allclose(theirs.links[name], ours.links[name], rtol=0, atol=within, err_msg=name)
    assert np.max(np.abs(ours.links["tip_transverse"][:, 1])) > 2e-3


def test_a_coupler_of_two_sections_moves_as_with_second_order_geometry(bar):
    """A stiff span before the middle point, soft ones of lighter stuff behind it."""
    section, thick = Section.rectangle(0.02, 0.004), Section.rectangle(0.025, 0.005)
    heavy, light = Material(280e9, 1200.0), Material(180e9, 1000.0)
    coupler = dataclasses.replace(
        bar.mechanism.body("coupler"), section=(thick, section, section), material=(heavy, light, light)
    )
    task = bar.remodelled(bar.mechanism.with_bodies([coupler]))
    ours, plain = (record(one.simulate("+++", options=TIGHT)) for one in (task, bar))
    theirs = simulate_exudyn(task, "+++", FINE)
    assert distance(ours, theirs) < 2e-6
    assert distance(ours, plain) > 1e-4
    assert theirs.figures["energy_balance_max"] < 2e-6
    for name in ("kinetic_energy", "strain_energy", "work"):
        np.testing.assert_allclose(theirs.links[name], ours.links[name], rtol=0, atol=1e-5, err_msg=name)


def test_a_rigid_linkage_follows_the_plan():
    """Nothing bends: angles, rates, accelerations and joint forces to second order in the step."""
    task = plan(four_bar().rigid(), samples=26)
    motion, ours = task.motion, record(task.simulate("+++", options=IntegrationOptions(tolerance=1e-8)))
    errors = []
    for step in (2e-4, 1e-4):
        theirs = simulate_exudyn(task, "+++", ExudynOptions(step=step, tolerance=1e-8))
        errors.append(np.max(np.abs(theirs.links["angle"] - motion.q[:, 2::3])))
        scale = (step / 1e-4) ** 2
        np.testing.assert_allclose(theirs.links["angular_velocity"], motion.v[:, 2::3], rtol=0, atol=5e-4 * scale)
        np.testing.assert_allclose(theirs.links["angular_acceleration"], motion.a[:, 2::3], rtol=0, atol=0.1 * scale)
        np.testing.assert_allclose(theirs.links["joint_force"], ours.links["joint_force"], rtol=0, atol=5e-3 * scale)
        for mine, other in zip(ours.end_effector, theirs.end_effector, strict=True):
            np.testing.assert_allclose(other, mine, rtol=0, atol=2e-3 * scale)
        for name in ("chord_angle", "chord_velocity", "point_position", *TIP):
            np.testing.assert_allclose(theirs.links[name], ours.links[name], rtol=0, atol=5e-4 * scale)
    assert errors[0] < 2e-4
    assert errors[1] == pytest.approx(errors[0] / 4, rel=0.1)


def test_rigid_bodies_and_springs_are_the_same_in_both(bar):
    """Finite segments, as a mechanism of their own: one model, two programs."""
    cut = bar.in_segments(3)
    own = dataclasses.replace(cut.mechanism, cut=None)
    task = dataclasses.replace(cut, mechanism=own, system=build_system(own), whole=None)
    theirs = simulate_exudyn(task, "+++", FINE)
    solution = task.simulate("+++", options=IntegrationOptions(tolerance=1e-7)).solution
    angles = [body.angle for body in task.system.bodies]
    np.testing.assert_allclose(theirs.links["angle"], solution.q[:, angles], rtol=0, atol=1e-5)
    np.testing.assert_allclose(theirs.links["strain_energy"], solution.strain_energy, rtol=0, atol=1e-5)
    assert solution.strain_energy.max() > 3e-3


def test_refinement_converges(bar):
    """The cubic elements cost 0.4 um, twice as many a sixth of that."""
    one, two, four = (simulate_exudyn(bar, "+++", ExudynOptions(step=1e-4, refinement=n)) for n in (1, 2, 4))
    assert distance(one, four) > 1e-7
    assert distance(two, four) < distance(one, four) / 4


def test_of_a_task_in_segments_the_uncut_mechanism_is_simulated(bar):
    options = ExudynOptions(step=1e-3)
    whole, cut = (simulate_exudyn(task, "+++", options) for task in (bar, bar.in_segments(3)))
    assert cut.task is bar
    for name in ("point_position", "joint_force"):
        np.testing.assert_array_equal(cut.links[name], whole.links[name])


def test_raparm_moves_as_with_second_order_geometry(raparm, square):
    """Motors on the slopes of beams, lumped inertia at every end."""
    task = plan_tracking(raparm.with_geometry("second-order"), square, duration=0.1, samples=51)
    ours = record(task.simulate("++++", options=TIGHT))
    theirs = simulate_exudyn(task, "++++")
    strayed = np.max(np.linalg.norm(ours.end_effector.position - task.motion.desired.position, axis=1))
    assert strayed > 1e-4
    # Our tolerance is 1 um; the cubic elements and the step cost 0.1 um each.
    assert distance(ours, theirs) < 1e-6
    balance = theirs.figures["energy_balance_max"] / theirs.links["kinetic_energy"].max()
    assert balance < 1e-4


def test_the_trapezoidal_rule_keeps_the_energy(bar):
    """Undamped, with constraints on velocities: the same motion, and gaps of second order in the step."""
    damped, undamped = (simulate_exudyn(bar, "+++", ExudynOptions(spectral_radius=radius)) for radius in (0.9, 1.0))
    assert [damped.method, undamped.method] == ["Exudyn, generalised alpha", "Exudyn, trapezoidal rule"]
    assert distance(damped, undamped) < 2e-6
    assert undamped.figures["energy_balance_max"] < 2e-6
    assert undamped.figures["constraint_position_max"] < 1e-6


def test_the_angle_of_a_vector_that_turns_and_grows():
    """d = e^z in complex numbers, whose derivatives are z' d and (z'' + z'^2) d."""
    t = np.linspace(0.0, 3.0, 100)
    z, dz, ddz = 0.3 * t**2 + 1j * (6.6 * t - t**3 + 2), 0.6 * t + 1j * (6.6 - 3 * t**2), 0.6 - 6j * t
    vectors = (np.exp(z) * factor for factor in (np.ones_like(z), dz, ddz + dz**2))
    turn = turn_of(2.0 + 3 * TURN, *(np.column_stack([x.real, x.imag]) for x in vectors))
    np.testing.assert_allclose(turn.angle, z.imag + 3 * TURN, rtol=0, atol=1e-12)
    np.testing.assert_allclose(turn.rate, dz.imag, rtol=0, atol=1e-10)
    np.testing.assert_allclose(turn.acceleration, ddz.imag, rtol=0, atol=1e-10)


def test_a_prescribed_angle_is_refused_by_name(bar):
    law = SampledAngle(np.sin, np.cos, lambda t: -np.sin(t))
    task = dataclasses.replace(
        bar, mechanism=dataclasses.replace(bar.mechanism, prescribed=(PrescribedAngle("clamp", "P", law),))
    )
    with pytest.raises(InputError, match=r"^prescribed\.clamp: Exudyn cannot express a prescribed angle; leave out"):
        simulate_exudyn(task, "+++")


def test_a_run_that_does_not_converge(raparm, square, capfd, tmp_path, monkeypatch):
    """The step is a tenth of the whole motion, near a singular position of the mode."""
    task = plan_tracking(raparm, square, duration=0.7, samples=11)
    monkeypatch.chdir(tmp_path)
    before = exudyn.config.GetDictionary()
    with pytest.raises(IntegrationError, match=r"^Exudyn: ") as caught:
        simulate_exudyn(task, "+-+-", ExudynOptions(step=1.0))
    assert exudyn.config.GetDictionary() == before
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())
    error = caught.value
    assert error.moment is not None
    assert error.partial.figures["status"] == "failed"
    k = error.partial.end_effector.position.shape[0]
    assert k == error.moment.step + 1 < 11
    assert error.moment.time == pytest.approx(0.07 * error.moment.step)
    assert error.partial.links["angle"].shape == (k, 8)
    assert error.partial.torque.shape == (11, 4)


def test_without_exudyn(bar, monkeypatch):
    monkeypatch.setitem(sys.modules, "exudyn", None)
    says = r"^engine: not installed \(got 'exudyn'\); install it with pip install 'paraflex\[engines\]'$"
    with pytest.raises(InputError, match=says):
        simulate_exudyn(bar, "+++")


def test_a_run_prints_nothing_and_leaves_nothing_behind(bar, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = exudyn.config.GetDictionary()
    first, second = (simulate_exudyn(bar, "+++", ExudynOptions(step=1e-3)) for _ in range(2))
    assert exudyn.config.GetDictionary() == before
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())
    np.testing.assert_array_equal(first.links["point_position"], second.links["point_position"])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"step": 0.0}, "step: must be positive"),
        ({"tolerance": np.nan}, "tolerance: must be positive"),
        ({"refinement": 0}, "refinement: must be at least 1"),
        ({"spectral_radius": 1.1}, "spectral_radius: must be between 0 and 1"),
    ],
)
def test_options_that_make_no_sense(options, says):
    with pytest.raises(InputError, match=says):
        ExudynOptions(**options)


def test_ctrl_c_in_the_middle_is_no_divergence(raparm, square):
    """The signal arrives while the engine steps; it must come out as what it is."""
    task = plan_tracking(raparm, square, duration=0.7, samples=71)
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            simulate_exudyn(task, "++++", ExudynOptions(step=1e-5))
    finally:
        timer.cancel()
