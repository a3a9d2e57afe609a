"""A mechanism of any size: what closes, plans and runs at one size does so at all others, to scale."""

from dataclasses import replace

import numpy as np
import pytest

from paraflex.dynamics import State, build_system, closure_of, mobility, natural_frequencies, static_equilibrium
from paraflex.dynamics.joint_loads import undetermined_loads
from paraflex.dynamics.rank import dependence
from paraflex.errors import AssemblyError
from paraflex.files import load
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    Assembly,
    ConstantSpeed,
    FlexibleBeam,
    Material,
    Mechanism,
    ModalDamping,
    PointForce,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    Section,
    WeldJoint,
)  # fmt: skip
from paraflex.motion import simulate_motion
from paraflex.paths import Polygon, follow_path
from paraflex.results import motion_dataset
from paraflex.tracking import plan_tracking

FACTORS = [1e-4, 1e-2, 1e2, 1e4]
NAMES = ["four_bar", "five_bar", "slider_crank", "raparm_i"]


def scaled(mechanism, s):
    """Lengths times s, of the same materials and in the same time: masses s^3, accelerations s, torques s^5."""

    def place(xy):
        return tuple(s * x for x in xy)

    def body(one):
        if isinstance(one, RigidBody):
            points = {name: place(xy) for name, xy in one.points.items()}
            return replace(
                one, mass=s**3 * one.mass, inertia=s**5 * one.inertia, centre_of_mass=place(one.centre_of_mass),
                points=points,
            )  # fmt: skip
        lumps = tuple(replace(lump, mass=s**3 * lump.mass, inertia=s**5 * lump.inertia) for lump in one.lumps)
        sections = [one.section] if isinstance(one.section, Section) else one.section
        section = tuple(Section(s**2 * part.area, s**4 * part.second_moment) for part in sections)
        points = {name: s * x for name, x in one.points.items()}
        return replace(
            one, length=s * one.length, points=points, lumps=lumps,
            section=section[0] if isinstance(one.section, Section) else section,
        )  # fmt: skip

    dampers = tuple(
        replace(
            one, coefficient=one.coefficient * s ** (3 if isinstance(mechanism.joint(one.joint), PrismaticJoint) else 5)
        )
        for one in mechanism.dampers
    )
    return replace(
        mechanism, bodies=tuple(body(one) for one in mechanism.bodies), dampers=dampers,
        ground={name: place(xy) for name, xy in mechanism.ground.items()}, gravity=place(mechanism.gravity),
    )  # fmt: skip


def of_library(name, s=1.0):
    return scaled(load(name).mechanism.rigid(), s)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("s", [*FACTORS, 1e3])
def test_flexible_links_close_as_well_as_rigid_ones(name, s):
    system = build_system(scaled(load(name).mechanism, s))
    found = closure_of(system, system.mechanism.assemblies[0])
    # Places up to four sizes away are closed to 1e-12 of that.
    assert found.position < 4e-12 * system.size


def path_of(name, s):
    path = load(name).paths["stroke" if name == "slider_crank" else "square"]
    corners = tuple((s * x, s * y) for x, y in path.corners)
    return Polygon(corners, s * path.max_acceleration, path.closed)


def places_of(system, s):
    """s for the places of bodies, 1 for their angles."""
    return np.tile([s, s, 1.0], len(system.bodies))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("s", FACTORS)
def test_every_assembly_closes_at_every_size(name, s):
    system, plain = build_system(of_library(name, s)), build_system(of_library(name))
    for assembly in system.mechanism.assemblies:
        found, expected = closure_of(system, assembly), closure_of(plain, assembly)
        assert found.problem == ""
        np.testing.assert_allclose(found.state.q / places_of(system, s), expected.state.q, rtol=0, atol=1e-11)
        here, there = mobility(system, found.state), mobility(plain, expected.state)
        assert (here.freedoms, here.nearby_freedoms) == (there.freedoms, there.nearby_freedoms)


@pytest.mark.parametrize("name", NAMES[1:])
@pytest.mark.parametrize("s", FACTORS)
def test_paths_are_followed_at_every_size(name, s):
    times = np.linspace(0.0, 0.3, 31)
    motion = follow_path(of_library(name, s), path_of(name, s), times)
    plain = follow_path(of_library(name), path_of(name, 1.0), times)
    scale = places_of(plain.system, s)
    np.testing.assert_allclose(motion.q / scale, plain.q, rtol=0, atol=1e-11)
    np.testing.assert_allclose(motion.a / scale, plain.a, rtol=0, atol=1e-10 * np.max(np.abs(plain.a)))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("s", FACTORS)
def test_runs_are_the_same_to_scale(name, s):
    def run(factor):
        options = IntegrationOptions(tolerance=1e-7 * factor)
        mechanism = of_library(name, factor)
        if name == "four_bar":
            return simulate_motion(mechanism, 0.2, samples=21, options=options).solution
        task = plan_tracking(mechanism, path_of(name, factor), duration=0.2, samples=21)
        return task.simulate(task.mechanism.modes[-1].name, options=options, warning=False).solution

    found, plain = run(s), run(1.0)
    scale = places_of(build_system(of_library(name)), s)
    # Errors add up to the tolerance of 1e-7 m at most, over links of a decimetre; steps differ by rounding.
    np.testing.assert_allclose(found.q / scale, plain.q, rtol=0, atol=1e-6)
    assert found.steps == pytest.approx(plain.steps, rel=0.1)


@pytest.mark.parametrize("s", [*FACTORS, 1.0])
def test_what_does_not_close_is_refused_at_every_size(s):
    short = of_library("four_bar", s)
    short = replace(short, ground=dict(short.ground) | {"Q": (0.70001 * s, 0.0)})
    with pytest.raises(AssemblyError, match="the loops do not close"):
        simulate_motion(short, 0.1)


@pytest.mark.parametrize("s", FACTORS)
def test_a_pendulum_hangs_at_every_size(s):
    mechanism = replace(of_library("pendulum", s), assemblies=(Assembly("low", {"beam": -1.2}),))
    system = build_system(mechanism)
    start = closure_of(system, mechanism.assemblies[0]).state
    rest = static_equilibrium(system, start)
    np.testing.assert_allclose(np.sin(rest.q[system.bodies[0].angle]), -1.0, atol=1e-9)


@pytest.mark.parametrize(
    ("L", "thickness", "elements"), [(1e-3, 1e-5, 2), (1e-3, 1e-5, 1), (1e-4, 3.3e-7, 2), (100.0, 1.0, 2)]
)
def test_a_welded_beam_of_any_size(L, thickness, elements):
    """Its lowest frequency is right, and its clamp determined: of a small one modes are large beside places."""
    beam = FlexibleBeam("arm", L, Section.rectangle(2.0 * thickness, thickness), Material(2.1e11, 7850.0),
                        {"O": 0.0, "tip": L}, elements)  # fmt: skip
    mechanism = Mechanism(
        name="arm", ground={"O": (0.0, 0.0)}, bodies=(beam,), assemblies=(Assembly("a", {"arm": 0.0}),),
        joints=(WeldJoint("O", PointRef("ground", "O"), PointRef("arm", "O")),),
    )  # fmt: skip
    system = build_system(mechanism)
    start = State(0.0, np.zeros(system.n), np.zeros(system.n))
    lowest = natural_frequencies(system, start).frequencies[0]
    assert lowest == pytest.approx(1.875104**2 * np.sqrt(2.1e11 / 12.0 / 7850.0) * thickness / L**2, rel=1e-3)
    assert dependence(system, start.q).rank == 3
    assert not undetermined_loads(system, ["O"], start.q[None]).force.any()


def beam_of(size, ends, profile=None):
    """A damped steel beam of a length, its section and load scaled alike."""
    beam = FlexibleBeam("beam", size, Section.rectangle(0.02 * size, 0.01 * size), Material(2.1e11, 7850.0),
                        {"A": 0.0, "M": 0.5 * size, "B": size}, 2, damping=ModalDamping((0.01,)))  # fmt: skip
    return Mechanism(
        name="beam", ground={"O": (0.0, 0.0), "P": (size, 0.0)}, bodies=(beam,), joints=ends,
        assemblies=(Assembly("a", {"beam": 0.0}),), prescribed=(profile,) if profile else (),
        loads=() if profile else (PointForce("p", PointRef("beam", "M"), (0.0, LOAD * size**2)),),
    )  # fmt: skip


LOAD = 10.5


@pytest.mark.parametrize("size", [1e-4, 1e-3, 1.0, 100.0])
def test_balanced_starts_are_those_of_beam_theory_at_any_size(size):
    """Clamped on both sides, P L^3 / 192 E I and P L / 8: of small beams clamps were left out, as if dependent."""
    ends = (
        WeldJoint("O", PointRef("ground", "O"), PointRef("beam", "A")),
        PrismaticJoint("P", PointRef("ground", "P"), PointRef("beam", "B"), 0.0, 0.0),
    )
    run = simulate_motion(beam_of(size, ends), 1e-6 * size, samples=2, balanced=True, warning=False)
    data = motion_dataset(run)
    moment = abs(data["joint_moment"].sel(joint="O").values[0])
    assert moment == pytest.approx(LOAD * size**3 / 8.0, rel=1e-4)


@pytest.mark.parametrize("size", [1e-4, 1.0, 100.0])
def test_a_turning_beam_is_balanced_at_any_size(size):
    """It pulls at its pin by rho A L^2 omega^2 / 2, and needs no torque. At 100 m it was 0.7 % off."""
    rate = 5.25 / size
    profile = PrescribedAngle("drive", "O", ConstantSpeed(0.0, rate))
    mechanism = beam_of(size, (RevoluteJoint("O", PointRef("ground", "O"), PointRef("beam", "A")),), profile)
    data = motion_dataset(simulate_motion(mechanism, 0.1 / rate, samples=11, balanced=True, warning=False))
    pull = 7850.0 * 2e-4 * size**2 * (size * rate) ** 2 / 2.0
    np.testing.assert_allclose(np.linalg.norm(data["joint_force"].values[:, 0], axis=-1), pull, rtol=3e-4)
    assert np.max(np.abs(data["drive_torque"].values)) < 1e-5 * pull * size
