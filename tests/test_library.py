"""Library mechanisms with paths: what they are, and the rigid ones driven by their own torques in every mode."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from paraflex.actuation import allocate
from paraflex.dynamics.state import point_position
from paraflex.files import load
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import PointRef, parse_mode
from paraflex.results import tracking_dataset
from paraflex.tracking import plan_tracking, simulate

NAMES = ("raparm_ii", "3rrr", "4rrr")
MODES = [(name, mode.name) for name in NAMES for mode in load(name).mechanism.modes]


def planned(name, *, rigid=True, **given):
    model = load(name)
    mechanism = model.mechanism.rigid() if rigid else model.mechanism
    return plan_tracking(mechanism, model.path(), **({"duration": model.study.duration, "samples": 71} | given))


@pytest.fixture(scope="module")
def tasks():
    return {name: planned(name) for name in NAMES}


def place(task, ref, k=0):
    return point_position(task.motion.system, task.motion.q[k], PointRef.parse(ref))


@pytest.mark.parametrize("assembly", ["outward", "inward", "left", "right"])
def test_raparm_ii_has_its_parallelograms_behind_the_elbows(assembly):
    task = planned("raparm_ii", assembly=assembly)
    for side, (arm, crank, beside, distal) in (("1", (1, 2, 3, 4)), ("2", (5, 6, 7, 8))):
        for k in (0, 30):
            a, b, c = (place(task, f"link{i}.{p}", k) for i, p in ((arm, f"A{side}"), (arm, f"B{side}"), (distal, "C")))
            e, f = (place(task, f"link{i}.{p}{side}", k) for i, p in ((crank, "E"), (beside, "F")))
            # F on the line C B, 0.1 m beyond B; A B F E a parallelogram, not folded over.
            np.testing.assert_allclose(f, b + 0.1 / 0.25 * (b - c), atol=1e-10)
            np.testing.assert_allclose(e - a, f - b, atol=1e-10)


def test_raparm_ii_turns_its_motors_as_raparm_i_does(tasks):
    """Its cranks stay parallel to the distal links, so the motors' speeds are the same; what they move is not."""
    one, two = planned("raparm_i"), tasks["raparm_ii"]
    np.testing.assert_allclose(two.effort.matrix, one.effort.matrix, atol=1e-9)
    assert np.abs(two.effort.required - one.effort.required).max() > 1.0


def test_the_platforms_keep_their_orientation_along_the_path(tasks):
    for name in ("3rrr", "4rrr"):
        task = tasks[name]
        np.testing.assert_allclose(task.motion.q[:, task.motion.system.body("platform").angle], 0.0, atol=1e-12)
        assert task.effort.required.shape[1] == 3


def test_the_platform_may_be_turned_along_the_path():
    task = planned("3rrr", orientation=0.1)
    np.testing.assert_allclose(task.motion.q[:, task.motion.system.body("platform").angle], 0.1, atol=1e-12)


def test_elbows_alone_cannot_turn_a_platform_in_line_with_its_base(tasks):
    """At angle zero the three lines A C meet in one point; turned by 0.1 rad they do not."""
    values = {}
    for turned in (0.0, 0.1):
        task = planned("3rrr", orientation=turned, samples=5)
        elbows = [motor.name.startswith("B") for motor in task.mechanism.motors]
        values[turned] = np.linalg.svd(task.effort.matrix[:, :, elbows], compute_uv=False)[:, -1]
    assert values[0.0].max() < 1e-12
    assert values[0.1].min() > 1e-3


@pytest.mark.parametrize(("name", "mode"), MODES)
def test_the_rigid_mechanism_driven_by_its_torques_follows_the_path(tasks, name, mode):
    tolerance = 1e-6
    run = simulate(tasks[name], mode, options=IntegrationOptions(tolerance=tolerance))
    data = tracking_dataset([run])
    distance = np.linalg.norm(data["end_effector"][0] - data["end_effector_desired"][0], axis=1)
    # The tolerance is a mean over the masses: the end strays by up to 4.4 of it, by more where a mode is ill-posed.
    assert distance.max() < tolerance * max(5.0, float(run.condition.max()))
    assert run.solution.energy_balance_max < 1e-5
    bodies = [body.angle for body in tasks[name].system.bodies]
    np.testing.assert_allclose(run.solution.q[:, bodies], tasks[name].motion.q[:, 2::3], rtol=0, atol=1e-3)


@pytest.mark.parametrize(("name", "mode"), MODES)
def test_motors_do_the_work_that_moves_the_masses(name, mode):
    """Motor torque times motor speed, told by the bodies' angles, adds up to the kinetic energy: no formula shared."""
    task = planned(name, samples=1401)
    torques = allocate(task.effort, parse_mode(task.mechanism, mode))
    motion, power, energy = task.motion, 0.0, 0.0
    for motor, torque in zip(task.mechanism.motors, torques.T, strict=True):
        joint = task.mechanism.joint(motor.joint)
        rates = [0.0 if p.on_ground else motion.v[:, motion.system.body(p.body).angle] for p in (joint.a, joint.b)]
        power = power + torque * (rates[1] - rates[0])
    for body in motion.system.bodies:
        s = body.integrals
        vx, vy, w = motion.v[:, body.all].T
        c, sn = np.cos(motion.q[:, body.angle]), np.sin(motion.q[:, body.angle])
        across = -(s.S1[0] * sn + s.S1[1] * c) * vx + (s.S1[0] * c - s.S1[1] * sn) * vy
        energy = energy + 0.5 * s.m * (vx**2 + vy**2) + w * across + 0.5 * (s.I0 + s.J) * w**2
    work = cumulative_trapezoid(power, motion.t, initial=0.0)
    # Samples every 0.5 ms: the trapezoidal rule costs up to three ten-thousandths.
    assert energy.max() > 0.1
    np.testing.assert_allclose(work, energy, rtol=0, atol=5e-4 * energy.max())


@pytest.mark.parametrize("name", NAMES)
def test_redundant_sets_have_the_smaller_torques(tasks, name):
    """The least norm over more motors is at most that over fewer of them, at every instant."""
    effort = tasks[name].effort
    modes = tasks[name].mechanism.modes
    norms = {mode: np.linalg.norm(allocate(effort, mode), axis=1) for mode in modes}
    pairs = [(more, fewer) for more in modes for fewer in modes if set(more.motors) > set(fewer.motors)]
    assert len(pairs) >= 4
    for more, fewer in pairs:
        assert np.all(norms[more] <= norms[fewer] * (1.0 + 1e-12))
        assert norms[more].max() < 0.99 * norms[fewer].max()
