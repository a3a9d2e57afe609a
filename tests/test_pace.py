"""Runs that do not get on are given up early, and say why; healthy ones never are."""

from dataclasses import replace

import numpy as np
import pytest

from paraflex.dynamics import build_system
from paraflex.errors import IntegrationError
from paraflex.files import load
from paraflex.integrators import IntegrationOptions
from paraflex.integrators.pace import Pace, too_slow
from paraflex.integrators.run import Instant
from paraflex.mechanism import ModalDamping
from paraflex.motion import simulate_motion
from paraflex.paths import Line
from paraflex.tracking import plan_tracking


def test_links_thrown_about_at_a_base_pivot_are_given_up_within_seconds():
    # The end-effector passes 20 mm above a base pivot, the torques of rigid links throw the beams about: three million
    # steps until the end of a motion that means nothing.
    mechanism = load("raparm_i").mechanism
    task = plan_tracking(mechanism, Line((-0.18, 0.02), (-0.02, 0.02), 40.0), duration=0.2, samples=101)
    with pytest.raises(IntegrationError, match=r"steps are down to .* this pace the run would need") as caught:
        task.simulate("++++", method="tr-bdf2", options=IntegrationOptions(method="tr-bdf2", tolerance=1e-4))
    text, solution = str(caught.value), caught.value.partial.solution
    assert "rad/s and accelerates by" in text
    assert "; given up at t = 0.1" in text
    assert text.endswith("or allow more steps (max_steps)")
    # What was computed is kept, and it was computed with steps of a size that a healthy run takes in all.
    assert solution.status == "failed"
    assert 0.08 < solution.t[-1] < 0.2
    assert solution.steps < 200_000


def test_a_jump_that_set_undamped_beams_vibrating_is_named_where_a_run_is_given_up():
    mechanism = load("five_bar").mechanism
    system = build_system(mechanism)
    n = system.n
    now = Instant(0.3, np.zeros(n), np.zeros(n), np.ones(n), np.zeros(system.m), 0.0)
    pace = Pace(0.0, 1.0, None, 50_000)
    pace.look(200, 0.3)

    def said(jumps, bodies=mechanism.bodies):
        given = replace(system, mechanism=replace(mechanism, bodies=bodies))
        return too_slow(given, now, np.zeros(n), pace, np.array(jumps))

    cause, remedy = said([0.1, 0.25, 0.5])
    assert "; loads or torques jumped at t = 0.25 s, and the vibrations since in proximal1, distal1," in cause
    assert "have no damping; given up" in cause
    assert "damping = { ratios = [0.01] }" in remedy
    # Nothing has jumped yet, or damping has ended what a jump excited.
    damped = tuple(replace(body, damping=ModalDamping((0.01,))) for body in mechanism.bodies)
    for cause, remedy in (said([0.5]), said([0.1], damped)):
        assert "jumped" not in cause
        assert "turns links more slowly" in remedy


def paced(pace, *pieces):
    """Look at a run every 200 attempts, through pieces of (attempts, time they take); when it is given up."""
    attempts, now = 0, 0.0
    for count, span in pieces:
        for _ in range(count // 200):
            attempts, now = attempts + 200, now + span * 200 / count
            if pace.look(attempts, now):
                return attempts
    return None


def test_steady_runs_are_only_given_up_far_beyond_what_they_may_take():
    assert paced(Pace(0.0, 1.0, None, 50_000), (2_000_000, 0.2)) is None
    assert paced(Pace(0.0, 1.0, None, 50_000), (2_000_000, 0.03)) == 50_000
    assert paced(Pace(0.0, 1.0, 100_000, 50_000), (100_000, 0.25)) is None
    assert paced(Pace(0.0, 1.0, 100_000, 50_000), (100_000, 0.15)) == 50_000


def test_a_run_that_collapses_is_given_up_and_one_that_recovers_is_not():
    assert paced(Pace(0.0, 1.0, None, 50_000), (2_000, 0.5), (200_000, 1e-3)) <= 60_000
    assert paced(Pace(0.0, 1.0, None, 50_000), (2_000, 0.5), (40_000, 1e-3), (4_000, 0.4)) is None
    # Twenty times slower is what motions with impacts and dwells do.
    assert paced(Pace(0.0, 1.0, None, 50_000), (100_000, 0.5), (2_000_000, 0.49)) is None
    # With a number of steps given nothing else counts.
    assert paced(Pace(0.0, 1.0, 10_000_000, 50_000), (2_000, 0.5), (200_000, 1e-2)) is None


@pytest.mark.parametrize("name", ["andrews", "spin_up", "pendulum"])
def test_healthy_motions_end(name):
    model = load(name)
    solution = simulate_motion(model.mechanism, model.study.duration, samples=11).solution
    assert solution.status == "complete"
    # Not even a tenth of what a run's pace is taken of.
    assert solution.steps < 5_000
