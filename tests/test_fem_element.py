"""The element: Hermite conditions, completeness, and the shape functions of section 2 of the formulation."""

from __future__ import annotations

import numpy as np
import pytest

from paraflex.fem import SpanProperties, beam_integrals, mesh_beam
from paraflex.fem.element import AXIAL, CURVATURE, SLOPE, TRANSVERSE, axial_shape, transverse_shape
from twins import beam_shape, beam_slope, hermite

LENGTH = 0.37
# Polynomials of degree five with coefficients up to 15: a hundred rounding errors.
ROUNDING = 1e-13


@pytest.mark.parametrize(("node", "x"), [(0, 0.0), (1, LENGTH)])
@pytest.mark.parametrize(("derivative", "coordinate"), [(0, TRANSVERSE), (1, SLOPE), (2, CURVATURE)])
def test_each_transverse_coordinate_is_the_value_slope_or_curvature_of_its_node(node, x, derivative, coordinate):
    expected = np.zeros(8)
    expected[4 * node + coordinate] = 1.0
    row = transverse_shape(np.array([x]), LENGTH, derivative)[0]
    # A second derivative carries 1/l^2 of the values' rounding.
    np.testing.assert_allclose(row, expected, rtol=0, atol=ROUNDING / LENGTH**2)


@pytest.mark.parametrize(("node", "x"), [(0, 0.0), (1, LENGTH)])
def test_each_axial_coordinate_is_the_displacement_of_its_node(node, x):
    expected = np.zeros(8)
    expected[4 * node + AXIAL] = 1.0
    np.testing.assert_array_equal(axial_shape(np.array([x]), LENGTH)[0], expected)


def test_shape_functions_are_the_printed_ones_with_f2_corrected():
    x = np.linspace(0.0, LENGTH, 11)
    columns = [TRANSVERSE, SLOPE, CURVATURE, 4 + TRANSVERSE, 4 + SLOPE, 4 + CURVATURE]
    expected = np.zeros((11, 8))
    expected[:, columns] = np.transpose(hermite(x / LENGTH, LENGTH))
    np.testing.assert_allclose(transverse_shape(x, LENGTH), expected, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("derivative", [0, 1, 2, 3])
def test_any_quintic_is_reproduced_with_its_derivatives(derivative):
    # Rigid translation and rotation are the first two of its six terms.
    w = np.polynomial.Polynomial(np.random.default_rng(1).normal(size=6))
    nodal = np.zeros(8)
    for node, x in ((0, 0.0), (4, LENGTH)):
        nodal[node + TRANSVERSE], nodal[node + SLOPE], nodal[node + CURVATURE] = w(x), w.deriv(1)(x), w.deriv(2)(x)
    x = np.linspace(0.0, LENGTH, 9)
    np.testing.assert_allclose(
        transverse_shape(x, LENGTH, derivative) @ nodal,
        w.deriv(derivative)(x) if derivative else w(x),
        rtol=0,
        atol=10 * ROUNDING / LENGTH**derivative,
    )


def test_axial_displacement_is_linear_and_its_derivative_the_strain():
    nodal = np.zeros(8)
    nodal[AXIAL], nodal[4 + AXIAL] = 0.2, 0.5
    x = np.linspace(0.0, LENGTH, 5)
    np.testing.assert_allclose(axial_shape(x, LENGTH) @ nodal, 0.2 + 0.3 * x / LENGTH, rtol=ROUNDING)
    np.testing.assert_allclose(axial_shape(x, LENGTH, 1) @ nodal, np.full(5, 0.3 / LENGTH), rtol=ROUNDING)


def test_a_rigid_motion_of_an_element_is_stress_free():
    # The last two of three elements are carried along by the bent and stretched first one: only that one stores energy.
    span = SpanProperties(mass_per_length=0.7, axial_stiffness=900.0, bending_stiffness=3.0)
    beam = beam_integrals(mesh_beam(3 * LENGTH, {}, 3), [span])
    alone = beam_integrals(mesh_beam(LENGTH, {}, 1), [span])
    stretch, w, slope = 0.02, 0.1, 0.4
    nodal = np.zeros(16)
    for node in (1, 2, 3):
        nodal[4 * node + AXIAL] = stretch
        nodal[4 * node + TRANSVERSE] = w + slope * (node - 1) * LENGTH
        nodal[4 * node + SLOPE] = slope
    # The cantilever condition keeps exactly these coordinates, so the least-squares solution is exact.
    u = np.linalg.lstsq(beam.D, nodal, rcond=None)[0]
    u_alone = np.linalg.lstsq(alone.D, nodal[:8], rcond=None)[0]
    energy = 0.5 * u_alone @ alone.K @ u_alone
    assert energy > 1.0  # J: bending of 0.4 rad is no small thing to compare
    np.testing.assert_allclose(0.5 * u @ beam.K @ u, energy, rtol=1e-12)
    # Nor does it take forces to hold them: K u of the last two nodes' coordinates is the first element's reaction only.
    forces = beam.D @ beam.K @ u
    np.testing.assert_allclose(forces[8:], 0.0, atol=1e-12 * np.max(np.abs(forces)))


def test_shape_of_a_point_of_the_mesh_is_that_of_its_element():
    mesh = mesh_beam(1.1, {"P": 0.3}, (1, 2))
    for x in (0.0, 0.12, 0.3, 0.55, 0.7, 0.9, 1.1):
        N, slope = mesh.shape_at(x)
        np.testing.assert_allclose(N, beam_shape(mesh.nodes, x), rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(slope, beam_slope(mesh.nodes, x), rtol=0, atol=100 * ROUNDING)
