"""Section forces and stresses of beams against statics in closed form, forces of joints, and Exudyn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.dynamics import JointMotion, balanced_state, build_system, consistent_state, static_equilibrium
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
    TabulatedProfile,
    WeldJoint,
)
from paraflex.motion import simulate_motion
from paraflex.results import motion_dataset
from paraflex.results.numbers import single

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
    loads = sections.loads(system, q[None], still if v is None else v[None], still, np.zeros((1, system.m)))
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
    stress = sections.loads(system, q, 0 * q, 0 * q, np.zeros((1, system.m))).stress[0]
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


SOON = 0.15
_KNOTS = np.linspace(0.0, SOON, 13)
# A torque that begins, turns round and ends smoothly: 6 N m one way, 1.6 N m the other.
SMOOTH = TabulatedProfile(tuple(_KNOTS), tuple(10.0 * np.sin(np.pi * _KNOTS / SOON) ** 2 * (1.0 - 1.3 * _KNOTS / SOON)))
PLACES = (0.25 * L, 0.5 * L, 0.75 * L)
CABLES = 32


def moments_of_exudyn():
    """Bending moments (3, 151) of a bar turned by the torque at its pin, in 32 ANCF cables."""
    exudyn = pytest.importorskip("exudyn")
    from exudyn import itemInterface as items

    exudyn.config.printToConsole = False
    container = exudyn.SystemContainer()
    mbs, length = container.AddSystem(), L / CABLES
    ground = mbs.AddObject(items.ObjectGround())
    nodes = [
        mbs.AddNode(items.NodePoint2DSlope1(referenceCoordinates=[k * length, 0.0, 1.0, 0.0]))
        for k in range(CABLES + 1)
    ]
    E = STEEL.youngs_modulus
    cables = [
        mbs.AddObject(
            items.ObjectANCFCable2D(
                length=length, massPerLength=MU, bendingStiffness=E * BAR.second_moment,
                axialStiffness=E * BAR.area, nodeNumbers=nodes[k : k + 2],
            )
        )
        for k in range(CABLES)
    ]  # fmt: skip
    pin = mbs.AddMarker(items.MarkerNodePosition(nodeNumber=nodes[0]))
    fixed = mbs.AddMarker(items.MarkerBodyPosition(bodyNumber=ground, localPosition=[0.0, 0.0, 0.0]))
    mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=[fixed, pin]))
    root = mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=cables[0], localPosition=[0.0, 0.0, 0.0]))

    def torque(_, t, __):
        return [0.0, 0.0, float(SMOOTH.evaluate(np.array([min(t, SOON)]))[0][0])]

    mbs.AddLoad(items.LoadTorqueVector(markerNumber=root, loadVector=[0.0, 0.0, 0.0], loadVectorUserFunction=torque))
    sensors = [
        mbs.AddSensor(
            items.SensorBody(
                bodyNumber=cables[round(x / length)], localPosition=[GAUSS * length, 0.0, 0.0], storeInternal=True,
                outputVariableType=exudyn.OutputVariableType.TorqueLocal,
            )
        )
        for x in PLACES
    ]  # fmt: skip
    mbs.Assemble()
    settings = exudyn.SimulationSettings()
    timing = settings.timeIntegration
    timing.endTime, timing.numberOfSteps, timing.adaptiveStep = SOON, 6000, False
    timing.generalizedAlpha.spectralRadius = 0.95
    # Forces are zero at the start; axial forces of cables this stiff are rounded to about 1e-6 N.
    timing.newton.relativeTolerance, timing.newton.absoluteTolerance = 1e-6, 1e-4
    settings.solution.sensors.writePeriod = 1e-3
    settings.solution.file.write = False
    mbs.SolveDynamic(settings)
    return np.array([mbs.GetSensorStoredData(sensor)[:, -1] for sensor in sensors])


def test_moments_in_motion_are_those_of_exudyn():
    """At a quarter, half and three quarters of a bar that vibrates while a torque swings it by 10 degrees."""
    theirs = moments_of_exudyn()
    turned = held(beam(elements=4, points={"A": 0.0, "B": L}), PIN, geometry="second-order",
                  motors=(Motor("turn", "pin"),))  # fmt: skip
    run = simulate_motion(
        turned, SOON, samples=151, torques={"turn": SMOOTH}, options=pf.IntegrationOptions(tolerance=1e-7)
    )
    data = motion_dataset(run)
    places, moments = data["section_place"].values.reshape(4, -1), data["section_moment"].values.reshape(151, 4, -1)
    for x, reference in zip(PLACES, theirs, strict=True):
        at = x + GAUSS * L / CABLES
        element = int(4.0 * at / L)
        # Within an element the curvature of a quintic is a cubic.
        ours = [np.polyval(np.polyfit(places[element], now, 3), at) for now in moments[:, element]]
        # Measured 1.3e-4, 2.4e-4 and 6.9e-4 of the largest at each place.
        np.testing.assert_allclose(ours, reference, rtol=0, atol=1e-3 * np.abs(reference).max())


def test_the_moment_at_a_motor_is_its_torque_with_one_element():
    """Where nothing else is at the pin, at all times of a vibration; the shape functions alone are 0.6 % off."""
    turned = held(beam(points={"A": 0.0, "B": L}), PIN, geometry="second-order", motors=(Motor("turn", "pin"),))
    options = pf.IntegrationOptions(tolerance=1e-7)
    data = motion_dataset(simulate_motion(turned, SOON, samples=151, torques={"turn": SMOOTH}, options=options))
    torque = SMOOTH.evaluate(data["time"].values)[0]
    root = data["section_moment"].values[:, 0]
    # Measured 1.1e-4 of the largest.
    np.testing.assert_allclose(root, -torque, rtol=0, atol=2e-4 * np.abs(torque).max())


def test_numbers_beyond_single_precision_stay_double():
    assert single(np.array([1.0, np.nan])).dtype == np.float32
    large = np.array([1e39, np.nan])
    assert single(large) is large
