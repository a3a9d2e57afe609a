"""The curvature a beam has at a lumped moment of inertia, in models of the library: shared against separate."""

from __future__ import annotations

import numpy as np
import pytest

from paraflex import load
from paraflex.dynamics import build_system, closure_of, natural_frequencies, undeformed
from paraflex.fem import ReferenceCondition
from paraflex.mechanism import Curvature, Geometry

ELEMENTS, FINE = 3, 8  # a span of the library's models; of the converged ones


def frequencies(name, elements, curvature, held):
    """The lowest elastic frequencies about the first assembly, undeformed, at rest [rad/s]."""
    mechanism = load(name).mechanism.with_geometry(Geometry.LINEAR)
    mechanism = mechanism.with_beams(elements=elements, curvature=curvature, reference=ReferenceCondition.PINNED)
    system, rigid = build_system(mechanism), build_system(mechanism.rigid())
    state = closure_of(rigid, mechanism.assembly()).state
    assert state is not None
    joints = [motor.joint for motor in mechanism.motors]
    found = natural_frequencies(system, undeformed(system, rigid, state), joints if held else (), torque_at=joints)
    return found.frequencies[found.frequencies > 1.0][: 6 if held else 5]


@pytest.mark.parametrize("held", [True, False], ids=["motors held", "motors free"])
@pytest.mark.parametrize("name", ["five_bar", "3rrr"])
def test_separate_curvature_is_right_with_the_elements_of_the_library(name, held):
    exact = frequencies(name, FINE, Curvature.SEPARATE, held)
    np.testing.assert_allclose(frequencies(name, ELEMENTS, Curvature.SEPARATE, held), exact, rtol=4e-6)
    np.testing.assert_allclose(frequencies(name, 12, Curvature.SEPARATE, held), exact, rtol=2e-8)


@pytest.mark.parametrize(
    ("name", "held", "mode", "off"),
    [("five_bar", False, 5, 0.0265), ("3rrr", True, 2, 0.0108), ("3rrr", True, 4, 0.0083), ("3rrr", False, 1, 0.0032)],
)
def test_shared_curvature_is_off_by_percents(name, held, mode, off):
    exact = frequencies(name, FINE, Curvature.SEPARATE, held)[mode - 1]
    shared = [frequencies(name, n, Curvature.SHARED, held)[mode - 1] / exact - 1.0 for n in (ELEMENTS, 2 * ELEMENTS)]
    assert shared[0] == pytest.approx(off, rel=0.02)
    # It converges with the first power of the element's length.
    assert shared[1] == pytest.approx(0.5 * shared[0], rel=0.1)
