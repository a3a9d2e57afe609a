"""Linear models of many bodies: sparse equations against dense ones, closed forms, memory."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import scipy

import paraflex as pf
from paraflex.dynamics import build_system, consistent_state, linearise as vibrations, natural_frequencies
from paraflex.dynamics.sparse import Factor
from paraflex.errors import SingularPositionError
from paraflex.linear import linearise
from paraflex.linear.descriptor import Descriptor, poles_near, response_at
from paraflex.linear.independent import independent_dense, independent_sparse
from paraflex.mechanism import (
    EndEffector,
    Motor,
    PointRef,
    TorsionalDamper,
    chain_of_segments,
    four_bars_in_a_row,
)  # fmt: skip
from test_linear import Moving, hub_beam
from test_tangent import NAMES


def chain(n, motors=1, *, stiffness=1e-6):
    """A chain that hangs, motors at the first joints, its end as the end-effector."""
    plain = chain_of_segments(n, angle=-np.pi / 2, bending_stiffness=stiffness)
    return replace(
        plain, motors=tuple(Motor(f"tau{k}", f"J{k}") for k in range(1, motors + 1)),
        end_effector=EndEffector(PointRef(f"segment{n}", "Q"), ("x", "y")),
    )  # fmt: skip


def row_of_loops(n):
    return replace(four_bars_in_a_row(n), motors=(Motor("tau", "A0"),))


def directly(model, s):
    """C (s - A)^-1 B + D."""
    return model.C @ np.linalg.solve(s * np.eye(len(model.A)) - model.A, model.B) + model.D


def sparsely(model, s):
    return response_at(model.minimal, model.rows, model.selected, s)


# --- Choice of coordinates --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_elimination_finds_as_many_rows_as_factorisations_with_columns_that_determine_them(seed):
    """Of random sparse rows, dependent ones among them, in groups."""
    random = np.random.default_rng(seed)
    rows = random.standard_normal((12, 40)) * (random.random((12, 40)) < 0.2)
    rows[5], rows[9] = rows[0] - 2.0 * rows[2], rows[1] + rows[7]
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    groups = [scipy.sparse.csr_matrix(part) for part in (rows[:7], rows[7:8], rows[8:])]
    weights = np.where(np.arange(40) < 20, 1e-5, 1.0)
    for choose in (independent_dense, independent_sparse):
        found = choose(groups, weights)
        assert [part.size for part in found.groups] == [6, 1, 3]
        kept = np.concatenate([found.groups[0], 7 + found.groups[1], 8 + found.groups[2]])
        assert found.columns.size == 10
        assert np.sum(found.columns < 20) == np.linalg.matrix_rank(rows[:, :20])
        assert np.linalg.cond(rows[np.ix_(kept, found.columns)]) < 1e4


# --- Responses --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_sparse_equations_in_motion(name):
    """Of mechanisms with one of everything: what is added to the states' derivatives, at a real s."""
    model = Moving(name).model()
    states, s = len(model.states), 7.0
    added = np.random.default_rng(3).standard_normal(states)
    found = Descriptor(model.minimal, s).states(added)
    known = np.linalg.solve(s * np.eye(states) - model.A, added)
    assert np.linalg.norm(found - known) <= 1e-8 * np.linalg.norm(known)


@pytest.mark.parametrize("name", [name for name in NAMES if "raparm" in name])
def test_sparse_response_in_motion(name):
    """All changes of the motion under its motors."""
    model = Moving(name).model()
    changes, states, s = model.minimal.changes, len(model.states), 3.0 + 20.0j
    x = np.linalg.solve(s * np.eye(states) - model.A, model.B)
    found = Descriptor(model.minimal, s).response(np.arange(len(model.inputs)))
    for part, known in (
        (found.q, changes.q @ x), (found.v, changes.v @ x),
        (found.a, changes.a[:, :states] @ x + changes.a[:, states:]),
        (found.multipliers, changes.multipliers[:, :states] @ x + changes.multipliers[:, states:]),
    ):  # fmt: skip
        assert np.linalg.norm(part - known) <= 1e-8 * np.linalg.norm(known)


def test_sparse_response_at_rest():
    raparm = pf.library.raparm_i()
    for model in (
        linearise(raparm, mode="+-+-", forces=[str(raparm.end_effector.point)]),
        linearise(row_of_loops(20)),
        linearise(hub_beam(0.1, 0.5, 0.0)),
    ):
        for s in (30j, 5.0 + 200j):
            known = directly(model, s)
            assert np.linalg.norm(sparsely(model, s) - known) <= 1e-9 * np.linalg.norm(known)


def test_chain_of_three_hundred():
    """The response without anything of the size of its square, to 1e-9 that of A, B, C and D."""
    mechanism = chain(300)
    tracemalloc.start()
    model = linearise(mechanism)
    found = model.frequency_response([10.0])[0]
    slow = model.poles(4)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    n = model.minimal.system.n
    assert n == 900
    assert peak < 8 * n**2
    known = directly(model, 10j)
    assert np.linalg.norm(found - known) <= 1e-9 * np.linalg.norm(known)
    # A heavy string: zeros of J0(2 omega sqrt(L / g)), but for the finite number of links.
    string = scipy.special.jn_zeros(0, 2) / 2.0 * np.sqrt(9.81)
    assert np.abs(slow)[::2] == pytest.approx(string, rel=5e-3)


# --- Poles ------------------------------------------------------------------------------------------------------------


def test_poles_near_a_place():
    """With damping at a joint, and in motion, against those of A."""
    damped = replace(chain(12), dampers=(TorsionalDamper("d", "J3", 0.01),))
    for model, place in ((linearise(damped), 3.0), (Moving(NAMES[0]).model(), 3.0)):
        known = np.linalg.eigvals(model.A)
        known = known[np.argsort(np.abs(known - place))][:4]
        found = poles_near(model.minimal, place, 4)
        assert np.sort_complex(found[np.argsort(np.abs(found - place))]) == pytest.approx(
            np.sort_complex(known), rel=1e-6, abs=1e-6
        )


def test_slow_poles_of_a_chain_without_weight():
    """A beam on a pin: it turns freely, and its squares are 1e-13 of those of a link on its springs."""
    model = linearise(replace(chain(300), gravity=(0.0, 0.0)))
    poles = model.poles(6)
    assert np.all(poles[:2] == 0.0)
    assert np.abs(poles[2::2]) == pytest.approx([15.4182e-3, 49.9649e-3], rel=1e-4)


def test_few_poles_are_the_first_of_all():
    model = linearise(pf.library.raparm_i())
    assert model.poles(6) == pytest.approx(model.poles()[:6])


def test_lowest_frequencies_of_a_chain_whose_links_are_stiff():
    """Their squares are 1e-10 of those of a link: Lanczos' method needs a shift near them."""
    found = []
    for n in (100, 250):
        system = build_system(chain_of_segments(n, angle=-np.pi / 2))
        found.append(natural_frequencies(system, consistent_state(system, None), count=3).frequencies)
    assert found[1] == pytest.approx(found[0], rel=1e-3)


def test_a_stiffness_that_the_typical_square_cancels(monkeypatch):
    """Upright four-bars in a row fall: one freedom, in a sparse matrix."""
    system = build_system(four_bars_in_a_row(20))
    state = consistent_state(system, None)
    known = natural_frequencies(system, state).squares
    monkeypatch.setattr(vibrations, "DENSE_COORDINATES", 0)
    assert natural_frequencies(system, state).squares == pytest.approx(known)


def test_the_sign_of_a_factor_is_that_of_the_determinant():
    rng = np.random.default_rng(5)
    for _ in range(20):
        matrix = rng.normal(size=(7, 7)) * (rng.random((7, 7)) < 0.5) + np.diag(rng.normal(size=7))
        factor = Factor(scipy.sparse.csr_matrix(matrix), np.full(7, 0.5))
        assert factor.sign == np.sign(np.linalg.det(matrix))


# --- Singular matrices ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["column", "rows"])
@pytest.mark.parametrize("seed", range(5))
def test_a_matrix_without_pivots_never_reaches_superlu(kind, seed, monkeypatch):
    """It has BLAS refuse arguments then, and writes beyond its memory: a column of zeros, two rows of one entry."""
    random = np.random.default_rng(seed)
    matrix = scipy.sparse.random(40, 40, 0.1, random_state=random).toarray() + np.eye(40)
    if kind == "column":
        matrix[:, random.integers(40)] = 0.0
    else:
        matrix[:2], matrix[0, 7], matrix[1, 7] = 0.0, 1.0, 2.0
    monkeypatch.setattr(scipy.sparse.linalg, "splu", lambda _: pytest.fail("SuperLU got a matrix without pivots"))
    for number in (1.0, 1.0j):
        with pytest.raises(np.linalg.LinAlgError, match="structurally singular"):
            Factor(scipy.sparse.csr_matrix(number * matrix), np.ones(40))


def test_a_matrix_singular_by_its_numbers_is_refused():
    matrix = scipy.sparse.csr_matrix(np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 1.0, 1.0]]))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        Factor(matrix, np.ones(3))


@pytest.mark.parametrize("elements", [3, 12])
def test_responses_at_poles_are_refused(elements):
    """Dense and sparse: constant torques of free motors never end to make the mechanism turn."""
    with pytest.raises(pf.InputError, match="frequencies: is a pole of the model"):
        linearise(pf.library.raparm_i().with_beams(elements=elements)).frequency_response([1.0, 0.0])


def test_a_response_at_a_pole_of_a_reduced_model_is_refused():
    few = pf.reduce(linearise(hub_beam(0.1, 0.5, 0.0)), 2)
    with pytest.raises(pf.InputError, match="frequencies: is a pole of the model"):
        few.frequency_response([0.0])


def test_accelerations_that_contradict_constraints_are_refused():
    """Rows that depend on one another, as at a pose where a mechanism loses a constraint."""
    minimal = linearise(pf.load("five_bar")).minimal
    twice, held = replace(minimal), minimal.held_rows
    object.__setattr__(twice, "held_rows", held.with_rows(held.taken(np.array([0]))))
    with pytest.raises(SingularPositionError, match="depend on one another"):
        _ = twice.changes
