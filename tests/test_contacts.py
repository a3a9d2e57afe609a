"""Section moments under a force that slides along a beam, against statics in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.dynamics import build_system, consistent_state, static_equilibrium
from paraflex.dynamics.sections import sections_of
from paraflex.dynamics.sensors import sensor_readings, sensor_rows
from paraflex.files import library_text
from paraflex.mechanism import (
    Assembly,
    FlexibleBeam,
    LumpedMass,
    Material,
    Mechanism,
    PointForce,
    PointRef,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    Section,
    SlidingJoint,
    SlotJoint,
    StrainGauge,
    WeldJoint,
)
from short_studies import check_derivatives, stress_study

L = 0.8
BAR, STEEL = Section.rectangle(0.02, 0.005), Material(2.1e11, 7800.0, 3e8)
# A load so small that what bends does not change it.
SMALL = 1e-3

LUMPS = LumpedMass("M", 0.3, 2e-3), LumpedMass("B", 0.1, 1e-3)

ref = PointRef.parse
CLAMP = WeldJoint("clamp", ref("ground.O"), ref("beam.A"))
PIN = RevoluteJoint("pin", ref("ground.O"), ref("beam.A"))
RAIL = SlotJoint("rail", ref("ground.E"), ref("beam.B"))


def pressed(places, *supports, **changes):
    """A beam on which blocks press at the given places, each held there by a vertical guide."""
    points = {"A": 0.0, "M": 0.5 * L, "B": L}
    beam = FlexibleBeam(**{"name": "beam", "length": L, "section": BAR, "material": STEEL, "points": points} | changes)
    names = [f"block{k}" for k in range(len(places))]
    return Mechanism(
        name="pressed",
        ground={"O": (0.0, 0.0), "E": (L, 0.0)} | {name: (x, 0.0) for name, x in zip(names, places, strict=True)},
        bodies=(beam, *(RigidBody(name, 0.1, 1e-4, points={"P": (0.0, 0.0)}) for name in names)),
        joints=(
            *supports,
            *(PrismaticJoint(f"guide {name}", ref(f"ground.{name}"), ref(f"{name}.P"), np.pi / 2, 0.0)
              for name in names),
            *(SlidingJoint(f"on {name}", ref("beam.M"), ref(f"{name}.P")) for name in names),
        ),
        loads=tuple(PointForce(f"push {name}", ref(f"{name}.P"), (0.0, -SMALL)) for name in names),
        assemblies=(Assembly("start", {"beam": 0.0, **dict.fromkeys(names, 0.0)}),),
    )  # fmt: skip


def loads_at_rest(mechanism):
    """Sections and their loads in static equilibrium, the multipliers those of the weight on each block."""
    system = build_system(mechanism)
    q = static_equilibrium(system, consistent_state(system, None)).q
    multipliers = np.zeros((1, system.m))
    for k, row in enumerate(system.rows):
        # Minus the multiplier acts on the block, and holds it.
        multipliers[0, k] = -SMALL * row.startswith("on ")
    sections = sections_of(system)
    return sections, sections.loads(system, q[None], 0.0 * q[None], 0.0 * q[None], multipliers)


def cantilever(x, places):
    return -SMALL * sum(np.maximum(place - x, 0.0) for place in places)


def two_supports(x, places):
    return SMALL * sum(np.where(x < at, x * (L - at), at * (L - x)) / L for at in places)


@pytest.mark.parametrize("places", [(0.1 * L,), (0.37 * L,), (0.5 * L,), (0.83 * L,), (0.2 * L, 0.24 * L)])
@pytest.mark.parametrize(
    ("supports", "by_hand", "changes"),
    [
        ((CLAMP,), cantilever, {"reference": "pinned"}),
        ((CLAMP,), cantilever, {"reference": "cantilever", "elements": 2}),
        ((CLAMP,), cantilever, {"reference": "free", "elements": 3, "curvature": "shared"}),
        # Supports whose forces the modes do not feel.
        ((CLAMP,), cantilever, {"reference": "cantilever", "modes": 3}),
        ((PIN, RAIL), two_supports, {"reference": "pinned", "elements": (1, 3)}),
        ((PIN, RAIL), two_supports, {"reference": "pinned", "modes": 2}),
        ((PIN, RAIL), two_supports, {"reference": "free", "lumps": LUMPS}),
    ],
)  # fmt: skip
def test_moments_are_those_of_statics_wherever_the_force_stands(places, supports, by_hand, changes):
    sections, loads = loads_at_rest(pressed(places, *supports, **{"elements": 1} | changes))
    expected = by_hand(loads.x[0], places)
    np.testing.assert_allclose(loads.x[0, len(sections.bodies) :], places, rtol=1e-9)
    np.testing.assert_allclose(loads.moment[0], expected, rtol=0, atol=2e-8 * np.abs(expected).max())
    stress = np.abs(expected) / (0.02 * 0.005**2 / 6)
    np.testing.assert_allclose(loads.stress[0], stress, rtol=0, atol=1e-6 * stress.max())
    # The largest is there under the force or at the clamp, and no station is between.
    most = {cantilever: SMALL * sum(places), two_supports: np.abs(by_hand(np.array(places), places)).max()}[by_hand]
    assert np.abs(loads.moment).max() == pytest.approx(most, rel=1e-7)


@pytest.mark.parametrize(("supports", "by_hand"), [((CLAMP,), cantilever), ((PIN, RAIL), two_supports)])
def test_a_run_has_the_moment_under_the_force_with_the_sign_and_size_of_its_multiplier(supports, by_hand):
    x = 0.37 * L
    mechanism = pressed((x,), *supports)
    system = build_system(mechanism)
    start = static_equilibrium(system, consistent_state(system, None))
    data = pf.motion_dataset(pf.simulate_motion(mechanism, 1e-4, samples=3, start=start))
    places, bar = data["section_place"].values, SMALL * L
    # Multipliers of the start are known to about 1e-6 of the force.
    np.testing.assert_allclose(data["section_moment"][0], by_hand(places, (x,)), rtol=0, atol=1e-5 * bar)
    np.testing.assert_allclose(data["contact_moment"][:, 0], by_hand(np.array(x), (x,)), rtol=0, atol=1e-5 * bar)
    assert data["contact_body"].values.tolist() == ["beam"]
    place = data["stress_place"].sel(body="beam").item()
    assert place == pytest.approx(0.0 if by_hand is cantilever else x, rel=1e-6)
    moment = max(abs(by_hand(np.array([0.0, x]), (x,))))
    assert data["stress_max"].sel(body="beam").item() == pytest.approx(moment / (0.02 * 0.005**2 / 6), rel=1e-4)


GAUGED = [
    ((CLAMP,), {"elements": (1, 2)}),
    ((CLAMP,), {"reference": "cantilever", "modes": 5}),
    ((PIN, RAIL), {"reference": "free", "lumps": LUMPS, "elements": 2}),
]


@pytest.mark.parametrize(("supports", "changes"), GAUGED)
def test_a_gauge_sees_the_kink_as_the_section_there_does(supports, changes):
    """In any motion, at all stations: at a node as on the side of the last end."""
    mechanism = pressed((0.37 * L, 0.62 * L), *supports, **changes)
    system, rng = build_system(mechanism), np.random.default_rng(3)
    q = consistent_state(system, None).q + 1e-5 * rng.normal(size=(4, system.n))
    v, a = rng.normal(size=(2, 4, system.n))
    multipliers = rng.normal(size=(4, system.m))
    sections = sections_of(system)
    loads = sections.loads(system, q, v, a, multipliers)
    stations = {round(float(x), 9): k for k, x in enumerate(sections.x)}
    gauges = [StrainGauge(f"gauge{k}", "beam", float(sections.x[k]), 0.002) for k in stations.values()]
    read = sensor_readings(system, q, v, a, multipliers, np.zeros((4, 0)), gauges)
    E, area, second = STEEL.youngs_modulus, 0.02 * 0.005, 0.02 * 0.005**3 / 12
    at = list(stations.values())
    strain = np.nan_to_num(loads.force[:, at]) / (E * area) - 0.002 * loads.moment[:, at] / (E * second)
    np.testing.assert_allclose(read, strain, rtol=0, atol=1e-10 * np.abs(strain).max())


@pytest.mark.parametrize(("supports", "changes"), GAUGED)
def test_the_linear_model_of_a_gauge_has_its_differences(supports, changes):
    """By places, rates, accelerations and forces in contacts, at a loaded pose."""
    mechanism = pressed((0.37 * L, 0.62 * L), *supports, **changes)
    gauge = StrainGauge("gauge", "beam", 0.45 * L, 0.002)
    system, rng = build_system(mechanism), np.random.default_rng(4)
    q = consistent_state(system, None).q + 1e-5 * rng.normal(size=system.n)
    state = [q, *rng.normal(size=(2, system.n)), rng.normal(size=system.m), np.zeros(0)]
    rows = sensor_rows(system, *state, sensors=[gauge])
    # Readings are quadratic in rates, and linear in accelerations and forces: long steps leave the least rounding.
    for kind, row, step in zip(range(4), rows, (1e-8, 1e-1, 1.0, 1.0), strict=False):
        for k in range(state[kind].size):
            ends = []
            for sign in (1.0, -1.0):
                moved = [part.copy() for part in state]
                moved[kind][k] += sign * step
                ends.append(sensor_readings(system, *(part[None] for part in moved), sensors=[gauge]).item())
            found = (ends[0] - ends[1]) / (2.0 * step)
            assert row.toarray()[0, k] == pytest.approx(found, rel=1e-5, abs=1e-7 * np.abs(row.toarray()).max())
    # Forces in both contacts bend it; the multipliers of nothing else do.
    assert rows.multipliers.nnz == 2


def test_a_beam_that_something_slides_along_has_elements_of_at_most_a_third_of_it():
    def meshed(points, **changes):
        return pressed((0.3 * L,), CLAMP, points=points, **changes).body("beam")

    assert meshed({"A": 0.0, "M": 0.5 * L, "B": L}).elements == (2, 2)
    assert meshed({"A": 0.0, "M": 0.1 * L}).elements == (1, 3)
    # 1/3 of the beam may be rounded.
    assert meshed({"A": 0.0, "M": L / 3.0}).elements == (1, 2)
    assert meshed({"A": 0.0, "M": L}, elements=1).elements == 1
    alone = pressed((), CLAMP, points={"A": 0.0, "B": L})
    assert alone.body("beam").elements is None
    assert alone.body("beam").mesh.n_elements == 1
    assert alone.refined(3).body("beam").elements == 3


def test_elements_that_are_too_long_for_what_slides_along_are_a_finding():
    def few(elements, **changes):
        mechanism = pressed((0.3 * L,), CLAMP, points={"A": 0.0, "M": L}, elements=elements, **changes)
        return [one.place for one in pf.check(mechanism).findings if one.code == "elements-few"]

    assert few(None) == few(3) == few(2, flexible=False) == []
    assert few(2) == ["body.beam.elements"]


@pytest.mark.parametrize(("kind", "told"), [("slot", True), ("prismatic", True), ("sliding", False)])
def test_an_axis_along_a_beam_that_bends_is_a_finding(kind, told):
    made = {
        "slot": lambda *ends: SlotJoint("on block0", *ends),
        "prismatic": lambda *ends: PrismaticJoint("on block0", *ends),
        "sliding": lambda *ends: SlidingJoint("on block0", *ends),
    }[kind]
    mechanism = pressed((0.3 * L,), CLAMP)

    def codes(point, **changes):
        joint = made(ref(f"beam.{point}"), ref("block0.P"))
        joints = tuple(joint if one.name == joint.name else one for one in mechanism.joints)
        bodies = tuple(replace(one, **changes) if one.name == "beam" else one for one in mechanism.bodies)
        return {one.code for one in pf.check(replace(mechanism, joints=joints, bodies=bodies)).findings}

    assert ("axis-along-beam" in codes("A")) == ("axis-along-beam" in codes("M")) == told
    # A rigid beam does not bend.
    assert "axis-along-beam" not in codes("A", flexible=False)


def test_a_slider_beyond_the_end_of_a_beam_is_a_telescope():
    telescope = PrismaticJoint("on block0", ref("beam.B"), ref("block0.P"))
    mechanism = pressed((1.2 * L,), CLAMP)
    joints = tuple(telescope if one.name == telescope.name else one for one in mechanism.joints)
    assert "axis-along-beam" not in {one.code for one in pf.check(replace(mechanism, joints=joints)).findings}


def test_a_balanced_start_bends_the_beam_as_statics_do_and_an_undeformed_one_does_not(tmp_path):
    x = 0.37 * L
    mechanism = pressed((x,), CLAMP)
    moments = {
        balanced: pf.motion_dataset(pf.simulate_motion(mechanism, 1e-4, samples=2, balanced=balanced))["contact_moment"]
        for balanced in (True, False)
    }
    root = pf.motion_dataset(pf.simulate_motion(mechanism, 1e-4, samples=2, balanced=True))["section_moment"][0, 0]
    assert root.item() == pytest.approx(-SMALL * x, rel=1e-5)
    assert abs(moments[True][0, 0].item()) < 1e-5 * SMALL * L < abs(moments[False][0, 0].item())
    mechanism.save(tmp_path / "beam.toml")
    (tmp_path / "beam.toml").write_text((tmp_path / "beam.toml").read_text() + "\n[study]\nduration = 2e-4\n")
    assert pf.simulate_motion(pf.load(tmp_path / "beam.toml"), samples=2).times[-1] == 2e-4
    with pytest.raises(pf.InputError, match=r"duration: is missing"):
        pf.simulate_motion(mechanism)
    start = consistent_state(build_system(mechanism), None)
    with pytest.raises(pf.InputError, match=r"balanced: a given state cannot be balanced"):
        pf.simulate_motion(mechanism, 1e-4, start=start, balanced=True)


# --- Derivatives ------------------------------------------------------------------------------------------------------

LEVER = """
[section.thin]
width = 0.030
thickness = 0.004

[body.lever]
type = "beam"
length = 0.6
section = "thin"
material = "aluminium"
points = { G = 0.0, T = 0.6 }
elements = 3
lumps = { T = "tool" }

[joint.block]
type = "sliding"
points = ["lever.G", "distal1.C"]
"""


def test_the_stress_under_what_slides_has_exact_derivatives(tmp_path):
    """A five-bar whose end-effector drags a lever with a mass along; the largest stress is in the lever."""
    text = library_text("five_bar").replace('A2 = ["base", 0.0]', 'A2 = ["base", 0.0]\nG = [0.1, 0.75]', 1)
    text = text.replace('"distal2.C"]', '"distal2.C"]\nG = ["ground.G", "lever.G"]', 1)
    text = text.replace("distal2 = 2.89", "distal2 = 2.89\nlever = -1.8", 1)
    (tmp_path / "slotted.toml").write_text(text + LEVER, encoding="utf-8")
    check_derivatives(tmp_path, stress_study("slotted.toml", "section.thin.thickness"), 0.004, rel=1e-6)
