"""Structural damping: ratios of the modes of a beam as its joints hold it, in whatever frame it is described."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from paraflex import load
from paraflex.arguments import with_fields
from paraflex.dynamics import State, build_system, natural_frequencies
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    Assembly,
    Curvature,
    FlexibleBeam,
    Geometry,
    LossFactor,
    Material,
    Mechanism,
    ModalDamping,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RayleighDamping,
    RevoluteJoint,
    RigidBody,
    SampledAngle,
    Section,
    SlotJoint,
    WeldJoint,
    finite_segments,
)
from paraflex.motion import simulate_motion

STEEL = Material(2.1e11, 7850.0)
STILL = SampledAngle(lambda t: 0.0 * t, lambda t: 0.0 * t, lambda t: 0.0 * t)


def ref(text):
    return PointRef.parse(text)


def beam(reference, damping, **keywords):
    section = Section.rectangle(width=0.02, thickness=0.004)
    places = {"A": 0.0, "B": 0.5}
    options = {"elements": 2, "curvature": Curvature.SEPARATE, "points": places} | keywords
    return FlexibleBeam("beam", 0.5, section, STEEL, reference=reference, damping=damping, **options)


def held(body, ends, geometry=Geometry.LINEAR, others=(), **keywords):
    """A beam between ground points: "pin", "weld", "drive" (a prescribed angle) or "free" at each end."""
    joints = []
    for point, kind in zip("AB", ends, strict=True):
        if kind != "free":
            joints.append(
                (WeldJoint if kind == "weld" else RevoluteJoint)(point, ref(f"ground.{point}"), ref(f"beam.{point}"))
            )
    prescribed = tuple(
        PrescribedAngle(f"drive{point}", point, STILL)
        for point, kind in zip("AB", ends, strict=True)
        if kind == "drive"
    )
    bodies = (body, *(other for other, _ in others))
    return Mechanism(
        name="held",
        ground={"A": (0.0, 0.0), "B": (0.5, 0.0)},
        bodies=bodies,
        joints=(*joints, *(joint for _, joint in others)),
        prescribed=prescribed,
        assemblies=(Assembly("straight", {one.name: 0.0 for one in bodies}),),
        geometry=geometry,
        **keywords,
    )


def vibrations(mechanism, ratio_in_frame=None):
    """Frequencies [rad/s] and damping ratios of the vibrations about the undeformed pose at rest, lowest first.

    With a ratio in the frame, that of every mode of the frame in place of the body's own damping matrix.
    """
    system = build_system(mechanism)
    mass, damping, stiffness = (np.zeros((system.n, system.n)) for _ in range(3))
    for body in system.bodies:
        s, here = body.integrals, slice(body.offset, body.offset + 3)
        lever = np.array([-s.S1[1], s.S1[0]])
        mass[here, here] = np.block([[s.m * np.eye(2), lever[:, None]], [lever, np.array([[s.I0 + s.J]])]])
        mass[body.flexible, body.flexible] = np.eye(body.nf)
        mass[here, body.flexible] = np.vstack([s.S2, s.G1 + s.Jf])
        mass[body.flexible, here] = mass[here, body.flexible].T
        of_frame = None if ratio_in_frame is None else np.diag(2.0 * ratio_in_frame * body.modes.omega)
        damping[body.flexible, body.flexible] = body.damping if of_frame is None else of_frame
        stiffness[body.flexible, body.flexible] = np.diag(body.modes.omega**2)
    q = np.zeros(system.n)
    for body, described in zip(system.bodies, mechanism.bodies, strict=True):
        q[body.offset] = 0.0 if described.name == "beam" else 0.5
    free = scipy.linalg.null_space(system.jacobian(q), rcond=1e-10)
    M, D, K = (free.T @ matrix @ free for matrix in (mass, damping, stiffness))
    n = len(M)
    roots = np.linalg.eigvals(
        np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
    )
    roots = roots[np.imag(roots) > 1e-3]
    roots = roots[np.argsort(np.abs(roots))]
    return np.abs(roots), -np.real(roots) / np.abs(roots)


@pytest.mark.parametrize(
    "ends",
    [
        ("pin", "pin"),
        ("weld", "free"),
        ("drive", "free"),
        ("weld", "weld"),
        ("weld", "pin"),
        ("pin", "weld"),
        ("free", "drive"),
        ("pin", "free"),
    ],
)
def test_a_ratio_is_that_of_the_beam_as_it_is_held_in_every_frame(ends, condition):
    _, ratios = vibrations(held(beam(condition, ModalDamping((0.02, 0.05))), ends))
    # Eight coordinates; the stiffest of them stretch the beam.
    assert ratios[0] == pytest.approx(0.02, rel=1e-6)
    np.testing.assert_allclose(ratios[1:4], 0.05, rtol=1e-6)


@pytest.mark.parametrize(
    ("reference", "ratio"),
    [(ReferenceCondition.PINNED, 0.02), (ReferenceCondition.CANTILEVER, 0.0295), (ReferenceCondition.FREE, 0.0086)],
)
def test_ratios_of_the_frame_s_modes_would_be_others(reference, ratio):
    _, ratios = vibrations(held(beam(reference, None), ("pin", "pin")), 0.02)
    # Half a unit of the last digit that docs/theory.md gives.
    assert ratios[0] == pytest.approx(ratio, abs=5e-5)


@pytest.mark.parametrize("modes", [2, 3, 5])
def test_so_it_is_with_few_modes(modes, condition):
    _, ratios = vibrations(held(beam(condition, ModalDamping((0.02,)), modes=modes), ("pin", "pin")))
    assert ratios[0] == pytest.approx(0.02, rel=1e-6)


def test_rigid_motion_is_undamped(condition):
    # A beam on one pin swings; the swing is no vibration.
    mechanism = held(beam(condition, ModalDamping((0.02,))), ("pin", "free"))
    frequencies, _ = vibrations(mechanism)
    exact = scipy.optimize.brentq(lambda x: np.tan(x) - np.tanh(x), 3.5, 4.2)
    assert frequencies[0] == pytest.approx(exact**2 * unit_frequency(), rel=1e-5)
    run = simulate_motion(
        mechanism, 1.0, samples=3, start=spinning(mechanism, 2.0), options=IntegrationOptions(tolerance=1e-9)
    )
    # But for the stretch by which it starts to spin.
    assert run.solution.kinetic_energy[-1] == pytest.approx(run.solution.kinetic_energy[0], rel=1e-6)


def spinning(mechanism, speed):
    system = build_system(mechanism)
    v = np.zeros(system.n)
    v[system.body("beam").angle] = speed
    return State(0.0, np.zeros(system.n), v)


def unit_frequency():
    """sqrt(EI / rho A) / L^2 of the beam [rad/s]."""
    section = Section.rectangle(width=0.02, thickness=0.004)
    return np.sqrt(STEEL.youngs_modulus * section.second_moment / (STEEL.density * section.area)) / 0.25


def test_what_hangs_on_a_beam_does_not_hold_it(condition):
    bob = RigidBody("bob", 1e-6, 1e-12, points={"C": (0.0, 0.0)})
    hung = held(
        beam(condition, ModalDamping((0.02,))),
        ("weld", "free"),
        others=[(bob, WeldJoint("tip", ref("beam.B"), ref("bob.C")))],
    )
    frequencies, ratios = vibrations(hung)
    assert frequencies[0] == pytest.approx(1.8751041**2 * unit_frequency(), rel=1e-4)
    assert ratios[0] == pytest.approx(0.02, rel=1e-4)


def test_a_rail_holds_the_slope_and_lets_the_beam_slide(condition):
    mechanism = held(beam(condition, ModalDamping((0.02, 0.05))), ("free", "free"))
    rail = PrismaticJoint("A", ref("ground.A"), ref("beam.A"), direction=np.pi / 2)
    frequencies, ratios = vibrations(replace(mechanism, joints=(rail,)))
    # Guided at one end, free at the other: the symmetric modes of a free beam of twice the length.
    assert frequencies[0] == pytest.approx((4.7300407 / 2.0) ** 2 * unit_frequency(), rel=1e-5)
    assert ratios[0] == pytest.approx(0.02, rel=1e-6)
    np.testing.assert_allclose(ratios[1:4], 0.05, rtol=1e-6)


def test_mass_proportional_damping_is_of_the_beam_as_it_is_held(condition):
    frequencies, ratios = vibrations(held(beam(condition, RayleighDamping(3.0, 1e-5)), ("pin", "pin")))
    np.testing.assert_allclose(ratios[:4], 1.5 / frequencies[:4] + 0.5e-5 * frequencies[:4], rtol=1e-6)


@pytest.mark.parametrize("ends", [("pin", "pin"), ("weld", "pin"), ("pin", "free")])
def test_a_loss_factor_is_twice_the_ratio_at_its_frequency(ends, condition):
    frequencies, ratios = vibrations(held(beam(condition, LossFactor(0.04, 30.0)), ends))
    np.testing.assert_allclose(ratios[:4], 0.02 * frequencies[:4] / (2.0 * np.pi * 30.0), rtol=1e-6)


def test_a_loss_factor_goes_into_finite_segments():
    mechanism = held(beam(ReferenceCondition.PINNED, LossFactor(0.04, 30.0)), ("pin", "pin"))
    cut = finite_segments(mechanism, {"beam": 4}).mechanism
    spring, damper = cut.springs[0], cut.dampers[0]
    assert damper.coefficient / spring.stiffness == pytest.approx(0.04 / (2.0 * np.pi * 30.0))


@pytest.mark.parametrize("geometry", list(Geometry))
@pytest.mark.parametrize("ends", [("pin", "pin"), ("drive", "free")])
def test_a_run_decays_by_the_ratio(ends, geometry, condition):
    mechanism = held(beam(condition, ModalDamping((0.02,)), points={"A": 0.0, "M": 0.25, "B": 0.5}), ends, geometry)
    mechanism = on_a_roller(mechanism) if ends[1] == "pin" else mechanism
    system = build_system(mechanism)
    still = State(0.0, np.zeros(system.n), np.zeros(system.n))
    found = natural_frequencies(system, still)
    shape, period = found.shapes[:, 0], 2.0 * np.pi / found.frequencies[0]
    start = State(0.0, 1e-4 * shape / middle(system, shape), still.v)
    run = simulate_motion(
        mechanism, 5.0 * period, samples=6, start=start, method="esdirk5", options=IntegrationOptions(tolerance=1e-10)
    )
    decrement = np.log(middle(system, run.solution.q[0]) / middle(system, run.solution.q[-1])) / 5.0
    assert decrement / np.hypot(2.0 * np.pi, decrement) == pytest.approx(0.02, rel=2e-3)
    assert run.solution.energy_balance_max < 1e-4 * np.max(run.solution.strain_energy)


def test_strong_damping_costs_no_more_iterations_in_another_frame():
    # Of linear geometry the pinned frame's matrix is an arrow, the others' are dense.
    found = {}
    for reference in ReferenceCondition:
        body = beam(reference, ModalDamping((0.5,)), points={"A": 0.0, "M": 0.25, "B": 0.5})
        mechanism = replace(on_a_roller(held(body, ("pin", "pin"))), gravity=(0.0, -9.81))
        run = simulate_motion(mechanism, 0.05, samples=6, options=IntegrationOptions(tolerance=1e-7))
        sag = [middle(run.system, q) for q in run.solution.q]
        found[reference] = np.array(sag), run.solution.newton_iterations
    exact, iterations = found[ReferenceCondition.PINNED]
    for sag, more in found.values():
        np.testing.assert_allclose(sag, exact, rtol=0, atol=1e-3 * np.max(np.abs(exact)))
        assert more < 1.3 * iterations


def on_a_roller(mechanism):
    """Its second pin in a slot: between two fixed pins the beam would be stretched."""
    first, last = mechanism.joints
    return replace(mechanism, joints=(first, SlotJoint("B", last.a, last.b)))


def middle(system, q):
    """How far the middle of the beam is off the x axis [m]."""
    body = system.body("beam")
    x, y = system.marker(ref("beam.M")).place(q[body.flexible])
    return q[body.offset + 1] + np.sin(q[body.angle]) * x + np.cos(q[body.angle]) * y


def test_the_default_frame_of_a_pinned_beam_keeps_damping_diagonal():
    system = build_system(held(beam(ReferenceCondition.PINNED, ModalDamping((0.02, 0.05))), ("pin", "pin")))
    body = system.body("beam")
    assert np.all(body.damping == np.diag(np.diag(body.damping)))
    assert system.packed.damping.size == 0


@pytest.mark.parametrize(
    ("table", "damping"),
    [
        ("{ ratios = [0.1, 0.2] }", ModalDamping((0.1, 0.2))),
        ("{ loss_factor = 0.01, frequency = 5 }", LossFactor(0.01, 5.0)),
        ("{ stiffness = 1e-5 }", RayleighDamping(0.0, 1e-5)),
        ("{ loss_factor = 0.01 }", "needs the frequency"),
        ("{ frequency = 5 }", "needs the frequency"),
        ("{ ratios = [0.1], stiffness = 1e-5 }", "exclude one another"),
        ("{ loss_factor = 0.01, frequency = 5, mass = 1 }", "exclude one another"),
    ],
)
def test_a_file_gives_one_kind_of_damping(table, damping, tmp_path):
    file = tmp_path / "damped.toml"
    file.write_text(PENDULUM.replace("DAMPING", table))
    if isinstance(damping, str):
        with pytest.raises(InputError, match=damping) as caught:
            load(file)
        assert caught.value.field == "body.arm.damping"
    else:
        arm = load(file).mechanism.body("arm")
        assert isinstance(arm, FlexibleBeam)
        assert arm.damping == damping


PENDULUM = """
name = "damped"
[section.bar]
width = 0.02
thickness = 0.004
[material.steel]
youngs_modulus = 210e9
density = 7850.0
[ground]
A = [0.0, 0.0]
[body.arm]
type = "beam"
length = 0.5
section = "bar"
material = "steel"
points = { A = 0.0, B = 0.5 }
damping = DAMPING
[joint]
A = ["ground.A", "arm.A"]
[assembly.down]
arm = 0.0
"""


@pytest.mark.parametrize("ends", [("pin", "pin"), ("weld", "pin"), ("pin", "free")])
def test_damping_has_exact_derivatives(ends):
    def matrix(change):
        body = nominal.mechanism.bodies[0]
        damping = with_fields(ModalDamping((0.02, 0.05)), ratios=(0.02 + change, 0.05))
        body = with_fields(
            body, length=0.5 * (1.0 + change), points={"A": 0.0, "B": 0.5 * (1.0 + change)}, damping=damping
        )
        return build_system(with_fields(nominal.mechanism, bodies=(body,)), nominal).body("beam").damping

    nominal = build_system(held(beam(ReferenceCondition.CANTILEVER, ModalDamping((0.02, 0.05)), modes=4), ends))
    tiny, small = 1e-30, 1e-4
    exact = matrix(np.complex128(1j * tiny)).imag / tiny
    weights = ((-2.0, 1.0 / 12.0), (-1.0, -8.0 / 12.0), (1.0, 8.0 / 12.0), (2.0, -1.0 / 12.0))
    by_differences = sum(weight * matrix(place * small) for place, weight in weights) / small
    np.testing.assert_allclose(exact, by_differences, rtol=0, atol=1e-8 * np.max(np.abs(exact)))
