"""Guesses of stages: weights learned from the last steps save iterations, and change no result."""

import numpy as np
import pytest

import paraflex as pf


@pytest.fixture(scope="module")
def task():
    arm = pf.library.raparm_i().with_geometry("second-order").with_beams(reference="pinned", curvature="separate")
    return pf.plan(arm, pf.load("raparm_i").paths["square"], duration=0.7)


# Without learned weights, by polynomials through three stages, these are 2.5 and 1.8; here 2.04 and 1.43.
@pytest.mark.parametrize(
    ("method", "step", "stages", "most"), [("esdirk5", 1.5e-3, 6, 2.25), ("tr-bdf2", 2.5e-4, 2, 1.6)]
)
def test_learned_guesses_save_iterations(task, method, step, stages, most):
    options = pf.IntegrationOptions(method=method, step=step, tolerance=1e-3)
    solution = task.simulate("++++", options=options).solution
    assert solution.newton_iterations < most * stages * solution.steps


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
