"""Reference conditions against exact solutions: columns, leaf springs and a cantilever bent far.

In every geometry a deflection is measured in the body frame. How much of the shortening by bending a model has, and
how far its slopes may go, depends on where that frame sits. Truth here is Euler's column and the elastica.
"""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from paraflex.dynamics import build_system, natural_frequencies, start_state, static_equilibrium
from paraflex.dynamics.points import point_motion
from paraflex.fem import ReferenceCondition
from paraflex.mechanism import (
    AppliedTorque,
    Assembly,
    Curvature,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    PointForce,
    PointRef,
    RevoluteJoint,
    RigidBody,
    Section,
    SlotJoint,
    Start,
    WeldJoint,
)

CANTILEVER, PINNED, FREE = ReferenceCondition
LINEAR, SECOND_ORDER = Geometry
# Of a beam of unit length and bending stiffness, pinned at both ends, or clamped and guided.
BUCKLING = np.pi**2


def beam(name, reference):
    """Unit length and bending stiffness; so stiff along its axis that it only bends."""
    return FlexibleBeam(
        name,
        1.0,
        Section(area=1e6, second_moment=1.0),
        Material(youngs_modulus=1.0, density=1e-6),
        points={"A": 0.0, "B": 1.0},
        elements=4,
        reference=reference,
        curvature=Curvature.SEPARATE,
    )


def at_rest(mechanism):
    """The system and its static equilibrium."""
    system = build_system(mechanism)
    return system, static_equilibrium(system, start_state(system, Start(), mechanism.assembly()))


def place(system, state, point):
    """Of a point at rest [m]."""
    return point_motion(system, PointRef.parse(point), state.q[None], state.v[None], state.v[None]).position[0]


def largest_slope(system, state, name):
    """At the nodes of a beam, in its body frame [rad]."""
    body = system.body(name)
    slopes = [row @ state.q[body.flexible] for row in body.integrals.D[2::4]]
    return float(np.max(np.abs(slopes)))


# --- A column ------------------------------------------------------------------------------------------------------


def squared_frequency(reference, geometry, compression):
    """Of the first mode of a column on a pin and a roller."""
    column = Mechanism(
        name="column",
        ground={"A": (0.0, 0.0)},
        bodies=(beam("column", reference),),
        joints=(
            RevoluteJoint("A", PointRef("ground", "A"), PointRef("column", "A")),
            SlotJoint("B", PointRef("ground", "A"), PointRef("column", "B"), 0.0),
        ),
        loads=(PointForce("load", PointRef("column", "B"), (-compression, 0.0)),),
        assemblies=(Assembly("level", {"column": 0.0}),),
        geometry=geometry,
    )
    return natural_frequencies(*at_rest(column), count=1).squares[0]


@pytest.mark.parametrize("reference", list(ReferenceCondition), ids=lambda c: c.value)
@pytest.mark.parametrize("part", [0.5, 0.9, -0.5, -4.0])
def test_second_order_columns_have_eulers_frequency(reference, part):
    """(f/f0)^2 = 1 - P/P_cr, in compression and tension: 0.707 at half the buckling load."""
    loaded = squared_frequency(reference, SECOND_ORDER, part * BUCKLING)
    assert loaded / squared_frequency(reference, SECOND_ORDER, 0.0) == pytest.approx(1.0 - part, abs=5e-4)


def test_axial_force_changes_nothing_in_linear_geometry_unless_the_frame_is_a_cantilevers():
    """Pinned and free frames leave the force out; the cantilever's has its sign wrong: 1.264 where 0.707 is right."""
    for reference in (PINNED, FREE):
        ratio = squared_frequency(reference, LINEAR, 0.5 * BUCKLING) / squared_frequency(reference, LINEAR, 0.0)
        assert ratio == pytest.approx(1.0, abs=1e-9)
    alone = squared_frequency(CANTILEVER, LINEAR, 0.0)
    assert np.sqrt(squared_frequency(CANTILEVER, LINEAR, 0.5 * BUCKLING) / alone) == pytest.approx(1.264, abs=1e-3)
    assert squared_frequency(CANTILEVER, LINEAR, -0.5 * BUCKLING) < -alone


# --- A cantilever under a force at its tip ---------------------------------------------------------------------------


def elastica(deflection):
    """Force and place of the tip of a clamped elastica whose tip stands so far aside; the force keeps its direction."""

    def slopes(_, y, p):
        return np.array([y[1], -p[0] * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    def ends(a, b, p):
        return np.array([a[0], b[1], a[2], a[3], b[3] - deflection])

    x = np.linspace(0.0, 1.0, 41)
    shape = deflection * np.array([1.5 * (2 * x - x**2), 3 * (1 - x), x / deflection, 0.5 * (3 * x**2 - x**3)])
    found = solve_bvp(slopes, ends, x, shape, p=[3.0 * deflection], tol=1e-9)
    assert found.success
    return found.p[0], found.y[2:, -1]


def bent(reference, geometry, force):
    """A clamped beam under a force across its tip, at rest."""
    clamped = Mechanism(
        name="cantilever",
        ground={"A": (0.0, 0.0)},
        bodies=(beam("beam", reference),),
        joints=(WeldJoint("A", PointRef("ground", "A"), PointRef("beam", "A"), 0.0),),
        loads=(PointForce("load", PointRef("beam", "B"), (0.0, force)),),
        assemblies=(Assembly("level", {"beam": 0.0}),),
        geometry=geometry,
    )
    return at_rest(clamped)


@pytest.mark.parametrize(
    ("deflection", "cantilever", "pinned"), [(0.10, 0.0104, -0.0004), (0.30, 0.103, -0.0032), (0.49, 0.344, -0.0078)]
)
def test_how_far_a_cantilever_may_bend(deflection, cantilever, pinned):
    """Errors of its deflection; in its own frame a second-order beam is a linear one, as nothing pulls along it."""
    force, (_, exact) = elastica(deflection)
    error = {}
    for geometry in Geometry:
        for reference in (CANTILEVER, PINNED):
            error[geometry, reference] = place(*bent(reference, geometry, force), "beam.B")[1] / exact - 1.0
    assert error[LINEAR, CANTILEVER] == pytest.approx(cantilever, rel=0.02)
    assert error[SECOND_ORDER, CANTILEVER] == pytest.approx(cantilever, rel=0.02)
    assert error[SECOND_ORDER, PINNED] == pytest.approx(pinned, rel=0.1)


def test_a_percent_is_lost_at_a_slope_of_015_in_the_cantilevers_frame():
    force, (_, exact) = elastica(0.10)
    system, state = bent(CANTILEVER, SECOND_ORDER, force)
    assert largest_slope(system, state, "beam") == pytest.approx(0.15, rel=0.02)
    assert place(system, state, "beam.B")[1] / exact - 1.0 == pytest.approx(0.01, rel=0.1)


def test_less_than_a_percent_is_lost_at_a_slope_of_03_in_the_pinned_frame():
    """Moments at both ends make an arc: its rise is (1 - cos s)/(2 s), that of the second order s/4."""
    slope = 0.3
    arc = Mechanism(
        name="arc",
        ground={"A": (0.0, 0.0)},
        bodies=(dataclasses.replace(beam("beam", PINNED), points={"A": 0.0, "M": 0.5, "B": 1.0}),),
        joints=(
            RevoluteJoint("A", PointRef("ground", "A"), PointRef("beam", "A")),
            SlotJoint("B", PointRef("ground", "A"), PointRef("beam", "B"), 0.0),
        ),
        loads=tuple(
            AppliedTorque(f"at {end}", PointRef("beam", end), sign * 2.0 * slope) for end, sign in (("A", 1), ("B", -1))
        ),
        assemblies=(Assembly("level", {"beam": 0.0}),),
        geometry=SECOND_ORDER,
    )
    system, state = at_rest(arc)
    assert largest_slope(system, state, "beam") == pytest.approx(slope, rel=1e-3)
    rise = (1.0 - np.cos(slope)) / (2.0 * slope)
    assert place(system, state, "beam.M")[1] / rise - 1.0 == pytest.approx(slope**2 / 12.0, rel=0.02)


# --- A stage on two leaf springs -------------------------------------------------------------------------------------


def guided(share, aside):
    """Force that pushes the guided end of an elastica so far aside, under a share of its buckling load."""

    def slopes(_, y, p):
        return np.array([y[1], -share * BUCKLING * np.sin(y[0]) - p[0] * np.cos(y[0]), np.sin(y[0]), np.cos(y[0])])

    def ends(a, b, p):
        return np.array([a[0], b[0], a[2], a[3], b[2] - aside])

    x = np.linspace(0.0, 1.0, 41)
    wave = 0.5 * np.pi * aside
    shape = np.array(
        [wave * np.sin(np.pi * x), wave * np.pi * np.cos(np.pi * x), 0.5 * aside * (1 - np.cos(np.pi * x)), x]
    )
    found = solve_bvp(slopes, ends, x, shape, p=[12.0 * (1.0 - share) * aside], tol=1e-9)
    assert found.success
    return found.p[0]


def pushed(reference, share, force):
    """How far a platform on two upright leaves goes aside; pushed half-way up, where it does not tilt."""
    feet = {"left": (-1.0, 0.0), "right": (1.0, 0.0)}
    platform = RigidBody("platform", 1.0, 1.0, (0.0, 0.0), {**feet, "centre": (0.0, 0.0), "half_way": (0.0, -0.5)})
    joints = []
    for name in feet:
        joints += [
            WeldJoint(f"foot {name}", PointRef("ground", name), PointRef(name, "A"), np.pi / 2),
            WeldJoint(f"top {name}", PointRef(name, "B"), PointRef("platform", name), -np.pi / 2),
        ]
    stage = Mechanism(
        name="stage",
        ground=feet,
        bodies=(*(beam(name, reference) for name in feet), platform),
        joints=tuple(joints),
        loads=(
            PointForce("weight", PointRef("platform", "centre"), (0.0, -2.0 * share * BUCKLING)),
            PointForce("push", PointRef("platform", "half_way"), (2.0 * force, 0.0)),
        ),
        assemblies=(Assembly("upright", {"left": np.pi / 2, "right": np.pi / 2, "platform": 0.0}),),
        geometry=SECOND_ORDER,
    )
    return place(*at_rest(stage), "platform.centre")[0]


def test_leaf_springs_near_buckling_need_the_pinned_frame():
    """At 0.93 of the buckling load, pushed aside by 0.13 of their length: 9 % off in the cantilever's frame."""
    share, aside = 0.93, 0.13
    force = guided(share, aside)
    assert pushed(CANTILEVER, share, force) / aside - 1.0 == pytest.approx(0.09, abs=0.01)
    assert pushed(PINNED, share, force) / aside - 1.0 == pytest.approx(0.0, abs=3e-3)
