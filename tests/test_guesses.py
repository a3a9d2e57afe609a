"""Guesses of stages: weights learned from the last steps save iterations, and change no result."""

import numpy as np
import pytest

import paraflex as pf


@pytest.fixture(scope="module")
def task():
    arm = pf.library.raparm_i().with_geometry("second-order").with_beams(reference="pinned", curvature="separate")
    return pf.plan(arm, pf.load("raparm_i").paths["square"], duration=0.7)


def test_learned_guesses_save_iterations(task):
    """By polynomials through three stages it takes 2.4 iterations a stage; here 2.0."""
    options = pf.IntegrationOptions(method="esdirk5", step=1.5e-3, tolerance=1e-3)
    solution = task.simulate("++++", options=options).solution
    assert solution.newton_iterations < 2.2 * 6 * solution.steps


def test_guesses_do_not_change_a_run_beyond_the_tolerance_of_the_iteration(task):
    """A run whose iteration is a hundred times more accurate is the same but for that tolerance."""
    one, other = (
        task.simulate(
            "++++", options=pf.IntegrationOptions(method="esdirk5", step=1.5e-3, tolerance=tolerance)
        ).solution
        for tolerance in (1e-3, 1e-5)
    )
    distance = np.abs(one.q - other.q)[:, [body.angle for body in task.system.bodies]]
    assert float(distance.max()) < 3e-5
