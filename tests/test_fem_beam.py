"""The beam: statics, frequencies, convergence, shape integrals, reference conditions and mesh.

Frequencies are those of a beam of unit length, mass per length and bending stiffness, where omega = (beta L)^2. Roots
marked "textbook" solve the characteristic equations found in any book on vibrations; "published" numbers were printed
by others; "computed" ones come from `exact_midspan_inertia` below or were computed for this project.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

from paraflex.errors import InputError
from paraflex.fem import (
    Lump,
    ReferenceCondition,
    SpanProperties,
    beam_integrals,
    mesh_beam,
    modal_basis,
    natural_frequencies,
    rigid_integrals,
)
from paraflex.fem.element import AXIAL, CURVATURE, SLOPE, TRANSVERSE
from twins import beam_masses, mass_matrix

# Stretching is so stiff that its frequencies stay above the bending ones compared here.
UNIT = SpanProperties(mass_per_length=1.0, axial_stiffness=1e5, bending_stiffness=1.0)

CLAMPED_FREE = [1.8751040687119611, 4.694091132974175, 7.854757438237613]  # textbook
PINNED_PINNED = [np.pi, 2 * np.pi, 3 * np.pi]  # textbook
FREE_FREE = [4.730040744862704, 7.853204624095838, 10.995607838001671]  # textbook
TIP_MASS = [1.24791740960647, 4.03113943671496, 7.13413223994]  # textbook: tip mass equal to the beam's


def unit_beam(elements, lumps=(), condition=ReferenceCondition.CANTILEVER, separate=()):
    """Lumps as (node, mass, inertia)."""
    mesh = mesh_beam(1.0, {}, elements).with_separate_curvature(separate)
    return beam_integrals(mesh, [UNIT], [Lump(*lump) for lump in lumps], condition)


# --- Statics -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("elements", [1, 3])
def test_a_tip_force_bends_and_stretches_a_cantilever_as_in_the_textbook(elements):
    L, EA, EI, P = 0.4, 2e4, 7.0, 3.0
    span = SpanProperties(1.0, EA, EI)
    beam = beam_integrals(mesh_beam(L, {}, elements), [span])
    N = beam.D[[-4 + AXIAL, -4 + TRANSVERSE]]
    slope = beam.D[-4 + SLOPE]
    # The exact solution, a cubic without curvature at the tip, is one of the element's own: only rounding is left,
    # times the condition number of K (1e5 with three elements).
    u = np.linalg.solve(beam.K, N[1] * P)
    np.testing.assert_allclose(N[1] @ u, P * L**3 / (3 * EI), rtol=1e-11)
    np.testing.assert_allclose(slope @ u, P * L**2 / (2 * EI), rtol=1e-11)
    u = np.linalg.solve(beam.K, N[0] * P)
    np.testing.assert_allclose(N[0] @ u, P * L / EA, rtol=1e-11)


def test_spans_of_different_stiffness_are_springs_in_series():
    # An axial force through two spans: L1/EA1 + L2/EA2.
    spans = [SpanProperties(1.0, 100.0, 1.0), SpanProperties(1.0, 250.0, 2.0)]
    beam = beam_integrals(mesh_beam(1.0, {"M": 0.4}, (2, 1)), spans)
    tip = beam.D[-4 + AXIAL]
    np.testing.assert_allclose(tip @ np.linalg.solve(beam.K, tip), 0.4 / 100.0 + 0.6 / 250.0, rtol=1e-12)


# --- Frequencies ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("condition", "lumps", "roots"),
    [
        (ReferenceCondition.CANTILEVER, (), CLAMPED_FREE),
        (ReferenceCondition.CANTILEVER, ((16, 1.0, 0.0),), TIP_MASS),
        (ReferenceCondition.PINNED, (), PINNED_PINNED),
        (ReferenceCondition.FREE, (), FREE_FREE),
    ],
    ids=["clamped-free", "tip mass", "pinned-pinned", "free-free"],
)
def test_bending_frequencies_are_the_textbook_roots(condition, lumps, roots):
    omega = natural_frequencies(unit_beam(16, lumps, condition))[:3]
    # With 16 elements the third root's h^8 error is 1e-9 or less, and so is what the eigenvalue solver's rounding
    # (1e-16 of the highest square, 4e8) leaves of the first root's.
    np.testing.assert_allclose(omega, np.square(roots), rtol=2e-9)


def first_square(beam):
    """omega_1^2 as Rayleigh quotient of its mode: free of the eigenvalue solver's rounding (1e-16 of the highest)."""
    mode = modal_basis(beam).vectors[:, 0]
    return (mode @ beam.K @ mode) / (mode @ beam.Mff @ mode)


@pytest.mark.parametrize("elements", [1, 5, 16])
def test_axial_frequencies_are_those_of_linear_elements_with_consistent_mass(elements):
    # Clamped-free rod with wave speed one, beta = pi/2: omega^2 h^2 = 6 (1 - cos beta h)/(2 + cos beta h) (textbook);
    # the limit is omega = pi/2. A lumped mass matrix would give 4 sin^2(beta h/2) instead.
    span = SpanProperties(mass_per_length=1.0, axial_stiffness=1.0, bending_stiffness=10.0)
    beam = beam_integrals(mesh_beam(1.0, {}, elements), [span])
    h, c = 1.0 / elements, np.cos(np.pi / 2 / elements)
    assert first_square(beam) == pytest.approx(6 * (1 - c) / (2 + c) / h**2, rel=1e-11)


def test_free_free_frequencies_published_by_exudyn():
    # Published: Exudyn's test suite, free-free beam L = 2 m, E = 2.07e11, rho = 7800, b = h = 10 mm [rad/s].
    published = np.array([83.17966459, 229.28844645, 449.50021798])
    b, E, rho, L = 0.01, 2.07e11, 7800.0, 2.0
    span = SpanProperties(rho * b**2, E * b**2, E * b**4 / 12)
    beam = beam_integrals(mesh_beam(L, {}, 16), [span], condition=ReferenceCondition.FREE)
    omega = natural_frequencies(beam)[:3]
    # The published numbers are those of a mesh of cubic elements, above the exact ones by 3e-7, 2.5e-6 and 1e-5.
    assert np.all(omega < published)
    np.testing.assert_allclose(omega, published, rtol=1e-5)
    # A cubic element's relative error is (beta h)^4/1440 (textbook), which all three show with 32 elements (inferred
    # here); what is left is the next term, a hundredth.
    theirs = (np.array(FREE_FREE) / 32) ** 4 / 1440
    np.testing.assert_allclose(omega * (1 + theirs), published, rtol=1.5e-7)


def relative_errors(elements, lumps_of, exact, separate=False):
    """Of omega_1^2, for each number of elements."""

    def beam(n):
        lumps = lumps_of(n)
        return unit_beam(n, lumps, separate=[node for node, _, _ in lumps] if separate else ())

    return np.array([first_square(beam(n)) / exact**2 - 1 for n in elements])


@pytest.mark.parametrize(
    ("root", "tip_mass", "expected"),
    [
        # Computed elsewhere with a free curvature at the tip: 3.1e-6, 2.4e-8, 9.3e-11. The paper's zero tip
        # curvature is the natural condition there and costs nothing but with a single element, 4.2e-6 (computed here).
        (CLAMPED_FREE[0], 0.0, [4.2e-6, 2.4e-8, 9.3e-11]),
        (TIP_MASS[0], 1.0, [2.4e-7, 9.4e-10, 3.6e-12]),  # computed here
    ],
    ids=["common element", "lumped tip mass"],
)
def test_bending_frequencies_converge_with_the_eighth_power_of_the_element(root, tip_mass, expected):
    errors = relative_errors((1, 2, 4), lambda n: ((n, tip_mass, 0.0),), root**2)
    # Two digits, and the Rayleigh quotient's own rounding.
    np.testing.assert_allclose(errors, expected, rtol=0.03, atol=5e-13)
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.all(orders > 7.4)
    assert orders[-1] == pytest.approx(8.0, abs=0.2)


def exact_midspan_inertia(J):
    """omega_1 of a clamped-free unit beam with a moment of inertia J at its middle (computed, from the wave equation).

    Four waves on either side; clamped; at the middle w, w' continuous, w'' jumps by -J omega^2 w', w''' does not; free.
    """

    def waves(k, x, d):
        # d-th derivative of cosh, sinh, cos, sin of k x.
        h = [np.cosh(k * x), np.sinh(k * x)]
        c = [np.cos(k * x + d * np.pi / 2), np.sin(k * x + d * np.pi / 2)]
        return k**d * np.array([h[d % 2], h[1 - d % 2], *c])

    def determinant(k):
        none = np.zeros(4)
        left, right = [[waves(k, 0.5, d) for d in range(4)] for _ in range(2)]
        return np.linalg.det(
            [
                np.concatenate([waves(k, 0.0, 0), none]),
                np.concatenate([waves(k, 0.0, 1), none]),
                np.concatenate([left[0], -right[0]]),
                np.concatenate([left[1], -right[1]]),
                # EI (w''_right - w''_left) = J (d^2/dt^2) w' = -J omega^2 w'.
                np.concatenate([-left[2] + J * k**4 * left[1], right[2]]),
                np.concatenate([left[3], -right[3]]),
                np.concatenate([none, waves(k, 1.0, 2)]),
                np.concatenate([none, waves(k, 1.0, 3)]),
            ]
        )

    return scipy.optimize.brentq(determinant, 1.5, 2.2, xtol=1e-15) ** 2


def test_exact_midspan_inertia_has_the_clamped_free_beam_as_limit():
    assert exact_midspan_inertia(0.0) == pytest.approx(CLAMPED_FREE[0] ** 2, rel=1e-12)


def test_a_lumped_moment_of_inertia_at_midspan_converges_with_the_first_power_only():
    # The paper's shared nodal curvature cannot jump where the true one does: 0.01 rho A L^3 at the middle of a
    # clamped-free beam. Computed here; with a free tip curvature the first is 9.4e-5 (computed elsewhere), and the
    # others are the same.
    errors = relative_errors((2, 4, 8), lambda n: ((n // 2, 0.0, 0.01),), exact_midspan_inertia(0.01))
    # Half a unit of the last digit given.
    np.testing.assert_allclose(errors, [9.7e-5, 4.9e-5, 2.5e-5], rtol=0, atol=5e-7)
    orders = np.log2(errors[:-1] / errors[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.05)


def test_separate_curvatures_restore_the_eighth_power_at_midspan():
    errors = relative_errors((2, 4), lambda n: ((n // 2, 0.0, 0.01),), exact_midspan_inertia(0.01), separate=True)
    assert 0.0 < errors[0] < 1e-7
    # The next mesh is at the rounding of the eigenvalues, 1e-12.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(8.0, abs=0.6)


def exact_tip_inertia(J):
    """omega_1 of a clamped-free unit beam with a moment of inertia J at its tip (computed, from the wave equation)."""

    def determinant(k):
        # Clamped: w = A (cosh - cos) + B (sinh - sin). At the tip its second derivative is J omega^2 times its first,
        # its third vanishes.
        ch, sh, co, si = np.cosh(k), np.sinh(k), np.cos(k), np.sin(k)
        slope, bend, shear = (sh + si, ch - co), (ch + co, sh + si), (sh - si, ch + co)
        return np.linalg.det([[bend[i] - J * k**3 * slope[i] for i in range(2)], shear])

    return scipy.optimize.brentq(determinant, 1.0, 1.95, xtol=1e-15) ** 2


def test_a_tip_moment_of_inertia_needs_a_free_curvature():
    assert exact_tip_inertia(0.0) == pytest.approx(CLAMPED_FREE[0] ** 2, rel=1e-12)
    exact = exact_tip_inertia(0.1)
    shared = relative_errors((1, 2, 4), lambda n: ((n, 0.0, 0.1),), exact)
    np.testing.assert_allclose(np.log2(shared[:-1] / shared[1:]), 1.0, atol=0.1)
    separate = relative_errors((1, 2), lambda n: ((n, 0.0, 0.1),), exact, separate=True)
    assert separate[0] < 1e-5 < shared[0]
    assert np.log2(separate[0] / separate[1]) > 7.0


def test_separate_curvatures_are_one_coordinate_more_each():
    assert unit_beam(4).nf == 16
    assert unit_beam(4, [(0, 0.0, 0.1), (2, 0.0, 0.1)], separate=(0, 2)).nf == 17
    assert unit_beam(4, [(2, 0.0, 0.1), (4, 0.0, 0.1)], separate=(2, 4)).nf == 18


# --- Shape integrals -----------------------------------------------------------------------------------------------

LENGTH, RHO_A = 0.8, 0.6
POINTS = {"A": 0.0, "F": 0.3, "C": LENGTH}
# Mass and moment of inertia at each point: both ends and between, none alike.
LUMPS = {"A": (0.13, 2e-5), "F": (0.2, 7e-4), "C": (0.35, 3e-3)}


def lumped_beam(condition):
    mesh = mesh_beam(LENGTH, POINTS, (1, 2))
    spans = [SpanProperties(RHO_A, 4e3, 2.0)] * 2
    lumps = [Lump(mesh.points[name], *LUMPS[name]) for name in POINTS]
    return mesh, beam_integrals(mesh, spans, lumps, condition)


def test_shape_integrals_are_sums_over_mass_points(condition):
    mesh, beam = lumped_beam(condition)
    masses = beam_masses(mesh.nodes, RHO_A, [(POINTS[name], *LUMPS[name]) for name in POINTS], beam.D)
    ET = np.array([[0.0, 1.0], [-1.0, 0.0]])
    expected = {
        "m": sum(p.mass for p in masses),
        "S1": sum(p.mass * p.x0 for p in masses),
        "S2": sum(p.mass * p.N for p in masses),
        "I0": sum(p.mass * p.x0 @ p.x0 for p in masses),
        "I1": sum(p.mass * p.x0 @ p.N for p in masses),
        "I2": sum(p.mass * p.N.T @ p.N for p in masses),
        "G1": sum(p.mass * p.x0 @ ET @ p.N for p in masses),
        "G2": sum(p.mass * p.N.T @ ET @ p.N for p in masses),
        "J": sum(p.inertia for p in masses),
        "Jf": sum(p.inertia * p.slope for p in masses),
        "Jff": sum(p.inertia * np.outer(p.slope, p.slope) for p in masses),
    }
    # Modes of the free condition reach 1e2 and are summed with cancellation: 1e-12 of the largest entry, seen as a
    # vector integral against its own bound sum |dm N|.
    for name, value in expected.items():
        bound = max(1.0, float(np.max(np.abs(beam.D)))) ** (2 if name in ("I2", "G2", "Jff") else 1)
        np.testing.assert_allclose(getattr(beam, name), value, rtol=0, atol=1e-13 * bound, err_msg=name)


def test_strain_energy_is_the_integral_of_squared_strain_and_curvature(condition):
    # Finite differences of the displacement in x know nothing of the code's derivatives.
    mesh, beam = lumped_beam(condition)
    u = np.random.default_rng(2).normal(size=beam.nf) / np.sqrt(np.diag(beam.K))
    z, w = np.polynomial.legendre.leggauss(8)
    h, energy = 1e-3, 0.0
    for a, b in pairwise(mesh.nodes):
        for x, weight in zip(a + (b - a) * (1 + z) / 2, (b - a) * w / 2, strict=True):
            # Of the five-point formulas, the remainder of the second derivative has the sixth one: none of a quintic.
            values = [mesh.shape_at(x + k * h)[0] @ beam.D @ u for k in (-2, -1, 0, 1, 2)]
            strain = (values[3][0] - values[1][0]) / (2 * h)
            curvature = (-values[0] + 16 * values[1] - 30 * values[2] + 16 * values[3] - values[4])[1] / (12 * h * h)
            energy += 0.5 * weight * (4e3 * strain**2 + 2.0 * curvature**2)
    # Rounding of the differences: 1e-16 / h^2 of the displacement.
    np.testing.assert_allclose(0.5 * u @ beam.K @ u, energy, rtol=1e-9)


def test_total_mass_centre_and_inertia(condition):
    _, beam = lumped_beam(condition)
    lumps = [(POINTS[name], *LUMPS[name]) for name in POINTS]
    np.testing.assert_allclose(beam.m, RHO_A * LENGTH + sum(m for _, m, _ in lumps), rtol=1e-14)
    np.testing.assert_allclose(
        beam.S1, [RHO_A * LENGTH**2 / 2 + sum(m * x for x, m, _ in lumps), 0.0], rtol=1e-14, atol=0
    )
    np.testing.assert_allclose(beam.I0, RHO_A * LENGTH**3 / 3 + sum(m * x * x for x, m, _ in lumps), rtol=1e-14)
    np.testing.assert_allclose(beam.J, sum(J for *_, J in lumps), rtol=1e-14)


def test_the_common_element_is_zero_lumps(condition):
    # Remark 1 of the paper.
    common, zero = unit_beam(2, (), condition), unit_beam(2, ((0, 0.0, 0.0), (1, 0.0, 0.0), (2, 0.0, 0.0)), condition)
    for name in ("m", "S1", "S2", "I0", "I1", "I2", "G1", "G2", "J", "Jf", "Jff", "K", "D"):
        np.testing.assert_array_equal(getattr(zero, name), getattr(common, name), err_msg=name)


def test_rigid_integrals_are_steiners():
    body = rigid_integrals(2.0, (0.3, -0.4), 0.1)
    np.testing.assert_allclose(body.S1, [0.6, -0.8], rtol=1e-15)
    np.testing.assert_allclose(body.I0, 0.1 + 2.0 * 0.25, rtol=1e-15)
    assert (body.m, body.J, body.nf) == (2.0, 0.0, 0)


def test_without_flexibility_keeps_the_inertia_and_drops_the_coordinates(condition):
    _, beam = lumped_beam(condition)
    rigid = beam.without_flexibility()
    assert (rigid.m, rigid.I0, rigid.J, rigid.nf) == (beam.m, beam.I0, beam.J, 0)
    assert rigid.S2.shape == (2, 0)
    np.testing.assert_array_equal(rigid.S1, beam.S1)


def test_modal_basis_diagonalises_mass_and_stiffness(condition):
    _, beam = lumped_beam(condition)
    modes = modal_basis(beam)
    V = modes.vectors
    np.testing.assert_allclose(V.T @ beam.Mff @ V, np.eye(beam.nf), atol=1e-10)
    # Rounding of the matrix is that of its largest eigenvalue.
    np.testing.assert_allclose(V.T @ beam.K @ V, np.diag(modes.omega**2), atol=1e-10 * modes.omega[-1] ** 2)
    assert np.all(np.diff(modes.omega) > 0.0)


# --- Reference conditions ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("elements", [1, (1, 2), 5])
def test_a_beam_of_n_elements_has_4n_flexible_coordinates(condition, elements):
    mesh = mesh_beam(1.0, {"P": 0.4} if elements == (1, 2) else {}, elements)
    beam = beam_integrals(mesh, [UNIT] * 2, [Lump(0, 0.1, 1e-3)], condition)
    assert beam.nf == 4 * mesh.n_elements
    assert np.linalg.matrix_rank(beam.D) == beam.nf


def test_each_condition_fixes_what_it_says():
    held = {}
    for condition in ReferenceCondition:
        _, beam = lumped_beam(condition)
        rows = np.flatnonzero(np.max(np.abs(beam.D), axis=1) == 0.0)
        held[condition] = [int(row) for row in rows]
    last = 12
    # Eq. 9: axial and transverse displacement and slope of the first node, curvature of the last.
    assert held[ReferenceCondition.CANTILEVER] == [AXIAL, TRANSVERSE, SLOPE, last + CURVATURE]
    assert held[ReferenceCondition.PINNED] == [AXIAL, TRANSVERSE, last + TRANSVERSE, last + CURVATURE]
    assert held[ReferenceCondition.FREE] == [last + CURVATURE]


def test_free_coordinates_carry_no_momentum():
    _, beam = lumped_beam(ReferenceCondition.FREE)
    # Orthogonality to the rigid motions comes out of the eigenvalue solver to 1e-16 times its largest mode, here 1e2.
    np.testing.assert_allclose(beam.S2, 0.0, atol=1e-12)
    np.testing.assert_allclose(beam.G1 + beam.Jf, 0.0, atol=1e-12)
    _, cantilever = lumped_beam(ReferenceCondition.CANTILEVER)
    assert np.max(np.abs(cantilever.G1 + cantilever.Jf)) > 1e-2


def test_elastic_frequencies_of_the_unconstrained_beam_do_not_depend_on_the_condition():
    found = []
    for condition in ReferenceCondition:
        _, beam = lumped_beam(condition)
        K = scipy.linalg.block_diag(np.zeros((3, 3)), beam.K)
        squares = scipy.linalg.eigh(K, mass_matrix(beam, np.zeros(3 + beam.nf)), eigvals_only=True)
        # Three rigid-body motions, zero up to rounding of the largest square.
        np.testing.assert_allclose(squares[:3], 0.0, atol=1e-12 * squares[-1])
        found.append(np.sqrt(squares[3:]))
    # The lowest is 1e-3 of the highest: 1e-6 of its square, of which rounding takes 1e-15/1e-6.
    np.testing.assert_allclose(found[1], found[0], rtol=1e-8)
    np.testing.assert_allclose(found[2], found[0], rtol=1e-8)
    # What a free beam's own coordinates give with the frame held is the same: they carry no momentum.
    free = natural_frequencies(lumped_beam(ReferenceCondition.FREE)[1])
    np.testing.assert_allclose(free, found[0], rtol=1e-8)


# --- Mesh ----------------------------------------------------------------------------------------------------------


def test_named_points_are_nodes_and_spans_have_their_elements():
    mesh = mesh_beam(1.0, {"C": 1.0, "B": 0.0, "F": 0.4}, (2, 3))
    np.testing.assert_allclose(mesh.nodes, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0], rtol=1e-15)
    np.testing.assert_array_equal(mesh.spans, [0, 0, 1, 1, 1])
    assert mesh.points == {"C": 5, "B": 0, "F": 2}
    assert (mesh.n_elements, mesh.n_nodal, mesh.length) == (5, 24, 1.0)


def test_ends_are_nodes_without_a_name_and_coinciding_points_share_one():
    mesh = mesh_beam(2.0, {"P": 0.5, "Q": 0.5}, 1)
    np.testing.assert_array_equal(mesh.nodes, [0.0, 0.5, 2.0])
    assert mesh.points == {"P": 1, "Q": 1}


def test_one_number_of_elements_is_for_every_span():
    assert mesh_beam(1.0, {"P": 0.3, "Q": 0.8}, 2).n_elements == 6


@pytest.mark.parametrize(
    ("length", "points", "elements", "field"),
    [
        (-1.0, {}, 1, "length"),
        (0.0, {}, 1, "length"),
        (np.nan, {}, 1, "length"),
        (np.inf, {}, 1, "length"),
        (1.0, {"P": 1.01}, 1, "points.P"),
        (1.0, {"P": -0.01}, 1, "points.P"),
        (1.0, {"P": np.nan}, 1, "points.P"),
        (1.0, {"P": 0.5}, (1,), "elements"),
        (1.0, {"P": 0.5}, (1, 2, 3), "elements"),
        (1.0, {"P": 0.5}, (1, 0), "elements"),
        (1.0, {}, -2, "elements"),
    ],
)
def test_a_mesh_that_cannot_be_made_names_the_field(length, points, elements, field):
    with pytest.raises(InputError) as caught:
        mesh_beam(length, points, elements)
    assert caught.value.field == field
    assert field in str(caught.value)


def test_designs_with_equal_beams_share_the_mesh_and_its_shapes():
    """What a sweep of sections would compute for each design."""
    first, second = (mesh_beam(0.3, {"a": 0.1, "b": 0.3}, (2, 1)) for _ in range(2))
    assert first is second
    one, other = (mesh.with_separate_curvature([2]) for mesh in (first, second))
    places = np.linspace(0.0, 0.3, 7)
    assert one.shapes_at(places)[0] is other.shapes_at(places)[0]
    assert one.transverse_powers() is other.transverse_powers()
    assert one.shapes_at(places)[0] is not first.shapes_at(places)[0]
    with pytest.raises(ValueError, match="read-only"):
        one.shapes_at(places)[1][0] = 1.0
    many = np.linspace(0.0, 0.3, 1201)
    np.testing.assert_allclose(one.shapes_at(many)[0][::200], one.shapes_at(places)[0], rtol=0.0, atol=1e-12)
    assert one.shapes_at(many)[0] is not one.shapes_at(many)[0]
