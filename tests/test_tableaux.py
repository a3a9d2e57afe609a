"""Butcher tableaux: order conditions of both formulas, stage order, L-stability."""

import numpy as np
import pytest

from paraflex.integrators import METHODS
from paraflex.integrators.tableaux import ESDIRK


def conditions(A, b, order):
    """What is left of the conditions of Runge-Kutta methods up to an order (Hairer, Norsett and Wanner, II.2)."""
    c = A.sum(axis=1)
    trees = {
        1: [b.sum() - 1],
        2: [b @ c - 1 / 2],
        3: [b @ c**2 - 1 / 3, b @ A @ c - 1 / 6],
        4: [b @ c**3 - 1 / 4, (b * c) @ A @ c - 1 / 8, b @ A @ c**2 - 1 / 12, b @ A @ A @ c - 1 / 24],
        5: [
            b @ c**4 - 1 / 5,
            (b * c**2) @ A @ c - 1 / 10,
            b @ (A @ c) ** 2 - 1 / 20,
            (b * c) @ A @ c**2 - 1 / 15,
            b @ A @ c**3 - 1 / 20,
            (b * c) @ A @ A @ c - 1 / 30,
            b @ A @ (c * (A @ c)) - 1 / 40,
            b @ A @ A @ c**2 - 1 / 60,
            b @ A @ A @ A @ c - 1 / 120,
        ],
    }
    return np.abs(np.concatenate([trees[k] for k in range(1, order + 1)]))


@pytest.fixture(params=[name for name, method in METHODS.items() if isinstance(method, ESDIRK)])
def name(request):
    return request.param


def stability(tableau, z: complex) -> complex:
    A = tableau.A
    return 1.0 + z * A[-1] @ np.linalg.solve(np.eye(len(A)) - z * A, np.ones(len(A)))


def test_the_order_is_the_one_told(name):
    tableau, order = METHODS[name].tableau, METHODS[name].order
    assert np.max(conditions(tableau.A, tableau.A[-1], order)) < 1e-15
    if order < 5:
        assert np.max(conditions(tableau.A, tableau.A[-1], order + 1)) > 1e-4


def test_the_companion_is_of_the_order_that_steps_are_chosen_by(name):
    tableau = METHODS[name].tableau
    if not tableau.error.size:
        pytest.skip("its error is estimated from the last step")
    companion = tableau.A[-1] - tableau.error
    # The estimate falls with the lower of both orders, in a unit of time.
    of_companion = 3 if name == "tr-bdf2" else METHODS[name].order - 1
    assert tableau.order == min(METHODS[name].order, of_companion)
    assert np.max(conditions(tableau.A, companion, of_companion)) < 1e-15
    assert np.max(conditions(tableau.A, companion, of_companion + 1)) > 1e-4


def test_stages_are_of_second_order_with_one_diagonal(name):
    A, c = METHODS[name].tableau.A, METHODS[name].tableau.c
    assert not A[0].any()
    np.testing.assert_allclose(A @ c, c**2 / 2, rtol=0, atol=3e-16)
    assert np.ptp(np.diag(A)[1:]) == 0.0
    # Stiffly accurate: the last stage is the step's end.
    assert c[-1] == pytest.approx(1.0, abs=1e-15)


def test_multipliers_are_interpolated_through_different_times(name):
    tableau = METHODS[name].tableau
    times = tableau.c[tableau.nodes]
    assert (times[0], times[-1]) == pytest.approx((0.0, 1.0))
    assert np.min(np.diff(times)) > 0.1


def test_they_are_l_stable(name):
    tableau = METHODS[name].tableau
    for frequency in np.geomspace(1e-2, 1e4, 60):
        assert abs(stability(tableau, 1j * frequency)) <= 1.0 + 1e-12
    if name == "trapezoidal":
        assert abs(stability(tableau, 5.0j)) == pytest.approx(1.0, abs=1e-14)
        return
    # |R| falls like 1/z at least: nothing is left of what is stiff.
    assert abs(stability(tableau, -1e8)) < 1e-6
    assert abs(stability(tableau, 1e8j)) < 1e-6
