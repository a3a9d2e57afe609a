"""Section forces and stresses of beams against statics in closed form, forces of joints, and Exudyn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.dynamics import (
    JointMotion,
    balanced_state,
    build_system,
    consistent_state,
    static_equilibrium,
)
from paraflex.dynamics.sections import sections_of
from paraflex.fem import Polynomial, Sine
from paraflex.mechanism import (
    Assembly,
    AssumedModesBeam,
    FlexibleBeam,
    Geometry,
    LumpedMass,
    Material,
    Mechanism,
    Motor,
    PointForce,
    PointRef,
    RevoluteJoint,
    Section,
    SlotJoint,
    WeldJoint,
)
from paraflex.motion import simulate_motion
from paraflex.results import motion_dataset

L, WIDTH, THICK = 0.8, 0.02, 0.005
BAR, STEEL = Section.rectangle(WIDTH, THICK), Material(2.1e11, 7800.0, 3e8)
MU = STEEL.density * BAR.area
# Loads so small that what bends does not change them.
SMALL = 1e-3

# Place in an element where the curvature of cubic shape functions is best.
GAUSS = 0.5 - 0.5 / np.sqrt(3.0)

ref = PointRef.parse
CLAMP = WeldJoint("clamp", ref("ground.O"), ref("beam.A"))
PIN = RevoluteJoint("pin", ref("ground.O"), ref("beam.A"))


def beam(**changes):
    points = {"A": 0.0, "M": 0.5 * L, "B": L}
    return FlexibleBeam(**{"name": "beam", "length": L, "section": BAR, "material": STEEL, "points": points} | changes)


def held(body, *joints, geometry="linear", angle=0.0, **keywords):
    return Mechanism(
        name="held",
        ground={"O": (0.0, 0.0), "E": (L, 0.0)},
        bodies=(body,),
        joints=joints,
        assemblies=(Assembly("start", {"beam": angle}),),
        geometry=Geometry(geometry),
        **keywords,
    )


def at_rest(mechanism):
    """Stations, moments and forces in static equilibrium."""
    system = build_system(mechanism)
    return in_state(system, static_equilibrium(system, consistent_state(system, None)).q)


def in_state(system, q, v=None):
    still, sections = np.zeros((1, system.n)), sections_of(system)
    loads = sections.loads(system, q[None], still if v is None else v[None], still)
    return sections, loads.moment[0], loads.force[0]


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
@pytest.mark.parametrize("reference", ["pinned", "cantilever"])
def test_a_cantilever_under_a_load_at_its_tip_and_under_its_weight(geometry, reference):
    mechanism = held(beam(reference=reference), CLAMP, geometry=geometry)
    push = PointForce("push", ref("beam.B"), (0.0, -SMALL))
    sections, moment, force = at_rest(replace(mechanism, loads=(push,)))
    np.testing.assert_allclose(moment, -SMALL * (L - sections.x), rtol=0, atol=1e-9 * SMALL * L)
    # Across the chord, which turns by 5e-6 rad.
    np.testing.assert_allclose(force, 0.0, atol=1e-5 * SMALL)
    sections, moment, _ = at_rest(replace(mechanism, gravity=(0.0, -SMALL)))
    np.testing.assert_allclose(moment, -MU * SMALL * (L - sections.x) ** 2 / 2, rtol=0, atol=1e-9 * MU * SMALL)


def test_stress_is_moment_over_modulus_and_force_over_area():
    loads = (PointForce("push", ref("beam.B"), (30.0 * SMALL, -SMALL)),)
    mechanism = held(beam(reference="cantilever"), CLAMP, loads=loads)
    sections, _, _ = at_rest(mechanism)
    by_hand = 30.0 * SMALL / (WIDTH * THICK) + SMALL * (L - sections.x) * (THICK / 2) / (WIDTH * THICK**3 / 12)
    system = build_system(mechanism)
    q = static_equilibrium(system, consistent_state(system, None)).q[None]
    stress = sections.stress(sections.loads(system, q, 0 * q, 0 * q))[0]
    np.testing.assert_allclose(stress, by_hand, rtol=1e-6)


@pytest.mark.parametrize("elements", [1, 3])
def test_a_column_carries_its_weight_and_that_on_it(elements):
    body = beam(elements=elements, lumps=(LumpedMass("M", 2.0),))
    sections, _, force = at_rest(held(body, CLAMP, gravity=(-9.81, 0.0)))
    above = np.arange(sections.x.size) < sections.x.size // 2
    by_hand = -9.81 * (MU * (L - sections.x) + 2.0 * above)
    np.testing.assert_allclose(force, by_hand, rtol=0, atol=1e-9 * 9.81 * MU)
    # On both sides of the node with the mass, where the force jumps.
    assert np.sum(sections.x == 0.5 * L) == 2


def test_a_beam_on_two_supports_under_a_load_and_its_weight():
    rail = SlotJoint("rail", ref("ground.E"), ref("beam.B"))
    push = PointForce("push", ref("beam.M"), (0.0, -SMALL))
    mechanism = held(beam(), PIN, rail, loads=(push,), gravity=(0.0, -SMALL))
    sections, moment, _ = at_rest(mechanism)
    x = np.minimum(sections.x, L - sections.x)
    by_hand = 0.5 * SMALL * x + MU * SMALL * sections.x * (L - sections.x) / 2
    np.testing.assert_allclose(moment, by_hand, rtol=0, atol=1e-7 * SMALL * L)


@pytest.mark.parametrize("elements", [1, 2])
def test_a_beam_that_turns_pulls_at_its_axis(elements):
    """N = rho A w^2 (L^2 - x^2) / 2 in one element as in several: the stretch alone would give its mean."""
    system = build_system(held(beam(elements=elements, points={"A": 0.0, "B": L}), PIN, motors=(Motor("turn", "pin"),)))
    rate = 5.0
    start = balanced_state(system, consistent_state(system, None), {"pin": JointMotion(rate)})
    v = np.zeros(system.n)
    v[system.body("beam").angle] = rate
    sections, _, force = in_state(system, start.q, v)
    by_hand = MU * rate**2 * (L**2 - sections.x**2) / 2
    np.testing.assert_allclose(force, by_hand, rtol=0, atol=1e-6 * by_hand[0])


def test_a_step_of_the_section_leaves_the_moment_and_changes_the_stress():
    thick = Section.rectangle(WIDTH, 2 * THICK)
    push = PointForce("push", ref("beam.B"), (0.0, -SMALL))
    mechanism = held(beam(section=(thick, BAR), reference="cantilever"), CLAMP, loads=(push,))
    sections, moment, _ = at_rest(mechanism)
    np.testing.assert_allclose(moment, -SMALL * (L - sections.x), rtol=0, atol=1e-8 * SMALL * L)
    left, right = np.flatnonzero(sections.x == 0.5 * L)
    assert sections.modulus[left] == pytest.approx(4 * sections.modulus[right])


def test_bars_of_assumed_modes_and_beams_of_few_modes():
    rail = SlotJoint("rail", ref("ground.E"), ref("beam.B"))
    given = {"points": {"A": 0.0, "B": L}, "name": "beam", "length": L, "section": BAR, "material": STEEL}
    # One half wave under a load of that shape is exact; here under its weight its Fourier coefficient.
    bar = AssumedModesBeam(transverse=(Sine(1),), **given)
    sections, moment, force = at_rest(held(bar, PIN, rail, gravity=(0.0, -SMALL)))
    by_hand = 4.0 * MU * SMALL * L**2 / np.pi**3 * np.sin(np.pi * sections.x / L)
    np.testing.assert_allclose(moment, by_hand, rtol=0, atol=1e-9 * by_hand.max())
    assert np.isnan(force).all()
    pulled = (PointForce("pull", ref("beam.B"), (SMALL, 0.0)),)
    stretching = AssumedModesBeam(transverse=(Sine(1),), axial=(Polynomial((0.0, 1.0)),), **given)
    np.testing.assert_allclose(at_rest(held(stretching, PIN, rail, loads=pulled))[2], SMALL, rtol=1e-9)
    # Of a beam's lowest modes, which only bend, no axial force is known; that of all is the load's.
    whole = at_rest(held(beam(), PIN, rail, loads=pulled))[2]
    np.testing.assert_allclose(whole, SMALL, rtol=1e-9)
    assert np.isnan(at_rest(held(beam(modes=2), PIN, rail, loads=pulled))[2]).all()
    assert sections_of(build_system(held(beam(flexible=False), PIN))) is None


@pytest.fixture(scope="module")
def swinging():
    """A pendulum that falls from the horizontal, in four elements."""
    mechanism = held(beam(elements=2), PIN, gravity=(0.0, -9.81), geometry="second-order")
    options = pf.IntegrationOptions(tolerance=1e-7)
    return simulate_motion(mechanism, 0.15, samples=151, options=options)


def test_a_pendulum_bends_as_a_falling_chimney_does_and_hangs_on_its_pin(swinging):
    data = motion_dataset(swinging)
    x = data["section_place"].values
    # In the mean over its vibration: M = 1/4 mu g cos(phi) x (L - x)^2 / L.
    load = np.cos(data["angle"].sel(body="beam")).mean().item() * MU * 9.81
    by_hand = 0.25 * load * x * (L - x) ** 2 / L
    np.testing.assert_allclose(data["section_moment"].mean("time"), by_hand, rtol=0, atol=0.05 * np.abs(by_hand).max())
    # What the pin does along the beam is the axial force at its first end.
    angle = data["angle"].sel(body="beam").values
    fx, fy = data["joint_force"].sel(joint="pin").transpose("axis", "time").values
    force = data["section_force"].values
    np.testing.assert_allclose(force[:, 0], -(np.cos(angle) * fx + np.sin(angle) * fy), rtol=0, atol=1e-3)
    np.testing.assert_allclose(force[:, -1], 0.0, atol=2e-3 * np.abs(force).max())


def test_the_moment_in_motion_is_that_of_exudyn(swinging):
    exudyn = pytest.importorskip("exudyn")
    from exudyn import itemInterface as items

    container = exudyn.SystemContainer()
    mbs, n, places = container.AddSystem(), 32, (0.25 * L, 0.5 * L)
    ground = mbs.AddObject(items.ObjectGround())
    nodes = [
        mbs.AddNode(items.NodePoint2DSlope1(referenceCoordinates=[k * L / n, 0.0, 1.0, 0.0])) for k in range(n + 1)
    ]
    E, EI = STEEL.youngs_modulus, STEEL.youngs_modulus * BAR.second_moment
    cables = [
        mbs.AddObject(
            items.ObjectANCFCable2D(
                length=L / n, massPerLength=MU, bendingStiffness=EI,
                axialStiffness=E * BAR.area, nodeNumbers=[nodes[k], nodes[k + 1]],
            )
        )
        for k in range(n)
    ]  # fmt: skip
    for cable in cables:
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=cable))
        mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=[0.0, -9.81, 0.0]))
    pin = mbs.AddMarker(items.MarkerNodePosition(nodeNumber=nodes[0]))
    fixed = mbs.AddMarker(items.MarkerBodyPosition(bodyNumber=ground, localPosition=[0.0, 0.0, 0.0]))
    mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=[fixed, pin]))
    sensors = [
        mbs.AddSensor(
            items.SensorBody(
                bodyNumber=cables[int(x / L * n + 1e-9)], localPosition=[GAUSS * L / n, 0.0, 0.0], storeInternal=True,
                outputVariableType=exudyn.OutputVariableType.TorqueLocal,
            )
        )
        for x in places
    ]  # fmt: skip
    mbs.Assemble()
    settings = exudyn.SimulationSettings()
    timing = settings.timeIntegration
    timing.endTime, timing.numberOfSteps = 0.15, 12000
    timing.generalizedAlpha.spectralRadius = 0.95
    # Exudyn asks for more than the rounding of axial forces allows.
    timing.newton.relativeTolerance, timing.newton.absoluteTolerance = 1e-6, 1e-7
    settings.solution.sensors.writePeriod = 1e-3
    settings.solution.file.write = False
    mbs.SolveDynamic(settings)
    data = motion_dataset(swinging)
    ours = data["section_moment"].values
    for x, sensor in zip(places, sensors, strict=True):
        theirs = mbs.GetSensorStoredData(sensor)[:, -1]
        # Within an element the curvature of a quintic is a cubic.
        own = slice(*{0.25 * L: (5, 10), 0.5 * L: (10, 15)}[x])
        stations = data["section_place"].values[own] - x
        here = np.array([np.polyval(np.polyfit(stations, at, 3), GAUSS * L / n) for at in ours[:, own]])
        most = np.abs(theirs).max()
        assert np.sqrt(np.mean((here - theirs) ** 2)) < 0.01 * most
        # The sudden release excites high modes, whose phases part.
        np.testing.assert_allclose(here, theirs, rtol=0, atol=0.02 * most)
