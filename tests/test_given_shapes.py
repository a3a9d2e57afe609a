"""Bodies whose shapes are the user's: bars of assumed modes, and bodies by their own matrices."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate

from conftest import RUBBER
from paraflex import plots
from paraflex.cli.inspect import describe
from paraflex.dynamics import build_system, consistent_state, static_equilibrium
from paraflex.dynamics.points import point_motion
from paraflex.dynamics.state import mass_matrix
from paraflex.elastodynamics import simulate_ked
from paraflex.engines.exudyn import simulate_exudyn
from paraflex.engines.mujoco import simulate_mujoco
from paraflex.errors import InputError
from paraflex.fem import (
    AssumedShapes,
    PlacedLump,
    ReferenceCondition,
    SpanProperties,
    assumed_integrals,
    modal_basis,
    natural_frequencies,
)
from paraflex.files import load
from paraflex.integrators import METHODS, IntegrationOptions
from paraflex.kernel.bodies import motion_forces
from paraflex.kernel.packed import make_scratch
from paraflex.mechanism import (
    Assembly,
    AssumedModesBeam,
    Curvature,
    EndEffector,
    FlexibleBeam,
    Geometry,
    LumpedMass,
    Mechanism,
    ModalBody,
    ModalPoint,
    Motor,
    PointForce,
    PointRef,
    Polynomial,
    RevoluteJoint,
    RigidBody,
    Section,
    Sine,
    finite_segments,
)
from paraflex.motion import simulate_motion
from paraflex.results import tracking_dataset
from paraflex.results.links import tip_deflection
from paraflex.results.record import record
from paraflex.studies import verify
from paraflex.tracking import plan_tracking
from records import values
from shell import paraflex
from test_elastodynamics import SWING

CLAMPED_FREE = [1.8751040687119611, 4.694091132974175, 7.854757438237613]  # textbook
UNIT = SpanProperties(mass_per_length=1.0, axial_stiffness=1e5, bending_stiffness=1.0)


def powers(first, last):
    """z^first to z^last."""
    return tuple(Polynomial((0.0,) * k + (1.0,)) for k in range(first, last + 1))


# --- Integrals of assumed modes ------------------------------------------------------------------------------------


def test_sines_on_a_pinned_bar_are_its_modes():
    shapes = AssumedShapes(2.0, tuple(Sine(n) for n in range(1, 9)))
    # omega = (n pi / L)^2 sqrt(E I / rho A).
    np.testing.assert_allclose(
        natural_frequencies(assumed_integrals(shapes, UNIT)), (np.arange(1, 9) * np.pi / 2.0) ** 2, rtol=1e-13
    )


def test_powers_converge_to_the_cantilever():
    def errors(last):
        omega = natural_frequencies(assumed_integrals(AssumedShapes(1.0, powers(2, last)), UNIT))[:3]
        return omega / np.square(CLAMPED_FREE) - 1.0

    coarse, fine, finest = errors(5), errors(8), errors(12)
    # From above, as Ritz has it.
    assert np.all(coarse > 1e-7)
    assert np.all(fine < coarse / 50)
    np.testing.assert_allclose(finest, 0.0, atol=1e-8)


def test_the_slider_cranks_rod_has_the_published_blocks():
    """Two sines across; mid and end node of a quadratic along: rho A L/15 [8 1; 1 2] and E A/3L [16 -8; -8 7]."""
    L, mass, EA, EI = 0.3, 0.5, 2e4, 0.7
    shapes = AssumedShapes(L, (Sine(1), Sine(2)), (Polynomial((0.0, 4.0, -4.0)), Polynomial((0.0, -1.0, 2.0))))
    s = assumed_integrals(shapes, SpanProperties(mass, EA, EI))
    own = np.linalg.inv(s.D)
    expected = np.zeros((2, 4, 4))
    expected[0, :2, :2] = mass * L / 2 * np.eye(2)
    expected[0, 2:, 2:] = mass * L / 15 * np.array([[8, 1], [1, 2]])
    expected[1, :2, :2] = EI * np.pi**4 / (2 * L**3) * np.diag([1, 16])
    expected[1, 2:, 2:] = EA / (3 * L) * np.array([[16, -8], [-8, 7]])
    for found, matrix in zip((s.Mff, s.K), expected, strict=True):
        np.testing.assert_allclose(own.T @ found @ own, matrix, rtol=1e-12, atol=1e-12 * matrix.max())


def test_integrals_are_those_of_adaptive_quadrature():
    """Sines and polynomials together, with lumps; every integral one by one, derivatives of the functions by hand."""
    L, mass, EA, EI = 0.7, 0.6, 40.0, 2.0
    shapes = AssumedShapes(L, (Sine(3), Polynomial((0.0, 0.0, 1.0, 0.5))), (Polynomial((0.0, 1.0)), Sine(2)))
    lumps = (PlacedLump(0.25, 0.13, 2e-3), PlacedLump(0.7, 0.2, 5e-3))
    s = assumed_integrals(shapes, SpanProperties(mass, EA, EI), lumps)

    def N(x):
        z = x / L
        return np.array([[0, 0, z, np.sin(2 * np.pi * z)], [np.sin(3 * np.pi * z), z**2 + 0.5 * z**3, 0, 0]]) @ s.D

    def slope(x):
        z = x / L
        return np.array([3 * np.pi * np.cos(3 * np.pi * z), 2 * z + 1.5 * z**2, 0, 0]) / L @ s.D

    def strain(x):
        return np.array([0, 0, 1, 2 * np.pi * np.cos(2 * np.pi * x / L)]) / L @ s.D

    def curvature(x):
        z = x / L
        return np.array([-((3 * np.pi) ** 2) * np.sin(3 * np.pi * z), 2 + 3 * z, 0, 0]) / L**2 @ s.D

    def over_mass(f):
        return scipy.integrate.quad_vec(lambda x: mass * np.asarray(f(x)), 0.0, L, epsabs=1e-13, epsrel=1e-13)[0] + sum(
            lump.mass * np.asarray(f(lump.x)) for lump in lumps
        )

    cross = np.array([[0.0, 1.0], [-1.0, 0.0]])
    expected = {
        "m": over_mass(lambda x: 1.0),
        "S1": over_mass(lambda x: [x, 0.0]),
        "S2": over_mass(N),
        "I0": over_mass(lambda x: x * x),
        "I1": over_mass(lambda x: x * N(x)[0]),
        "I2": over_mass(lambda x: N(x).T @ N(x)),
        "G1": over_mass(lambda x: x * N(x)[1]),
        "G2": over_mass(lambda x: N(x).T @ cross @ N(x)),
        "J": sum(lump.inertia for lump in lumps),
        "Jf": sum(lump.inertia * slope(lump.x) for lump in lumps),
        "Jff": sum(lump.inertia * np.outer(slope(lump.x), slope(lump.x)) for lump in lumps),
        "K": scipy.integrate.quad_vec(
            lambda x: EA * np.outer(strain(x), strain(x)) + EI * np.outer(curvature(x), curvature(x)), 0.0, L
        )[0],
    }
    for name, value in expected.items():
        np.testing.assert_allclose(
            getattr(s, name), value, rtol=1e-10, atol=1e-11 * max(1.0, np.max(np.abs(value))), err_msg=name
        )
    # The coordinates have unit mass: nearly dependent functions do no harm.
    np.testing.assert_allclose(s.Mff, np.eye(4), atol=1e-13)


@pytest.mark.parametrize(
    ("transverse", "axial", "says"),
    [
        ((), (), "transverse: has no shape functions"),
        ((Sine(1), Sine(1)), (), "transverse: its shape functions are linearly dependent"),
        ((*powers(2, 3), Polynomial((0.0, 0.0, 1.0, -2.0))), (), "transverse: its shape functions are linearly dep"),
        ((Polynomial((0.0,)),), (), "transverse: its shape functions are linearly dependent"),
        (powers(2, 20), (), "transverse: its shape functions are linearly dependent, or nearly so"),
        (powers(1, 3), (), "transverse: its shape functions contain a rigid motion of the bar"),
        ((Polynomial((1.0,)),), (), "transverse: its shape functions contain a rigid motion of the bar"),
        # None is rigid by itself: (1 + z^2) - z^2.
        ((Polynomial((1.0, 0.0, 1.0)), *powers(2, 3)), (), "transverse: its shape functions contain a rigid motion"),
        ((Sine(1),), (Polynomial((2.0,)),), "axial: its shape functions contain a rigid motion of the bar"),
        ((Sine(1),), (Polynomial((0.0, 1.0)), Polynomial((0.0, 2.0))), "axial: its shape functions are linearly dep"),
        ((Polynomial(()),), (), "transverse: has no coefficients"),
        ((Polynomial((0.0, 0.0, np.nan)),), (), "transverse: not a finite number"),
    ],
)
def test_functions_that_make_no_body_are_named(transverse, axial, says):
    with pytest.raises(InputError) as caught:
        pendulum(rod(transverse=transverse, axial=axial))
    assert str(caught.value).startswith(f"body.rod.{says}")


# --- The same motion as with elements that span the same space -----------------------------------------------------

LENGTH, SECTION = 0.5, Section.rectangle(0.03, 0.01)
LUMPS = (LumpedMass("O", 0.02, 1e-5), LumpedMass("P", 0.05, 4e-5))


def rod(**changes):
    """Powers 2 to 5 across and the first along."""
    values = {"transverse": powers(2, 5), "axial": powers(1, 1), "points": {"O": 0.0, "P": LENGTH}, "lumps": LUMPS}
    return AssumedModesBeam("rod", LENGTH, SECTION, RUBBER, **(values | changes))


def quintic(**changes):
    """One quintic element, free to curve at its tip: the same space as that of `rod`."""
    values = {"points": {"O": 0.0, "P": LENGTH}, "lumps": LUMPS, "curvature": Curvature.SEPARATE}
    values["reference"] = ReferenceCondition.CANTILEVER
    return FlexibleBeam("rod", LENGTH, SECTION, RUBBER, **(values | changes))


def modal(s, named, **changes):
    """A body by the matrices of another one; J and its relatives in the places a user puts them."""
    values = {
        "name": "rod",
        "mass": s.m,
        "first_moment": s.S1,
        "inertia": s.I0 + s.J,
        "mass_matrix": s.Mff,
        "stiffness": s.K,
        "S2": s.S2,
        "I1": s.I1,
        "G1": s.G1 + s.Jf,
        "G2": s.G2,
        "I2": s.I2,
        "points": named,
    }
    return ModalBody(**(values | changes))


def as_modal(beam, turn=0.0, **changes):
    """A body by the matrices of a beam in its own coordinates, turned by an angle in its frame."""
    body = build_system(Mechanism("one", {}, (beam,), ())).bodies[0]
    s = body.integrals
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    # Coordinates of no particular scale or order.
    mix = np.random.default_rng(1).normal(size=(s.nf, s.nf)) / np.sqrt(s.m)
    s = s.in_basis(mix)
    s = replace(s, S1=R @ s.S1, S2=R @ s.S2)
    points = {}
    for name, x in beam.points.items():
        N, slope = body.mesh.shape_at(x)
        points[name] = ModalPoint(R @ [x, 0.0], R @ N @ s.D, slope @ s.D)
    return modal(s, points, **changes)


def pendulum(body, start=0.4, **changes):
    """The rod on the ground and a rigid body at its end, under gravity, with a motor at the root."""
    bob = RigidBody("bob", 0.1, 1e-3, (0.05, 0.02), {"P": (0.0, 0.0)})
    values = {
        "ground": {"O": (0.1, 0.2)},
        "bodies": (body, bob),
        "joints": (
            RevoluteJoint("root", PointRef("ground", "O"), PointRef("rod", "O")),
            RevoluteJoint("hinge", PointRef("rod", "P"), PointRef("bob", "P")),
        ),
        "motors": (Motor("drive", "root"),),
        "gravity": (0.0, -9.81),
        "assemblies": (Assembly("start", {"rod": start, "bob": -0.3}),),
        "geometry": Geometry.LINEAR,
    }
    return Mechanism("pendulum", **(values | changes))


def swing(mechanism, tolerance=1e-9):
    """Joint positions, joint force multipliers, energies; equal steps, which rounding does not move."""
    options = IntegrationOptions(tolerance=tolerance, step=2e-5)
    run = simulate_motion(mechanism, 0.3, samples=31, torques={"drive": 0.2}, options=options)
    assert run.solution.status == "complete"
    return run, run.solution


def assert_same_motion(one, other, turn=0.0):
    """To what fifteen thousand steps make of rounding."""
    (run, mine), (twin, theirs) = one, other
    for point in ("P", "O"):
        motions = [point_motion(r.system, PointRef("rod", point), s.q, s.v, s.a) for r, s in (one, other)]
        for a, b, within in zip(*motions, (1e-12, 1e-9, 1e-4), strict=True):
            np.testing.assert_allclose(b, a, rtol=0, atol=within)
    angles = [s.q[:, r.system.body("rod").angle] for r, s in (one, other)]
    # Frames turn with the slope of shapes, whose rounding is a hundred times (1/m) that of points, from the start on.
    np.testing.assert_allclose(angles[1] + turn, angles[0], rtol=0, atol=1e-10)
    order = [twin.system.rows.index(row) for row in run.system.rows]
    scale = np.abs(mine.multipliers).max()
    np.testing.assert_allclose(theirs.multipliers[:, order], mine.multipliers, rtol=0, atol=1e-5 * scale)
    np.testing.assert_allclose(theirs.strain_energy, mine.strain_energy, rtol=0, atol=1e-9)
    assert mine.strain_energy.max() > 1e-3
    assert theirs.steps == mine.steps


@pytest.fixture(scope="module")
def swung():
    return swing(pendulum(quintic()))


def test_powers_move_as_the_quintic_element_does(swung):
    assert_same_motion(swung, swing(pendulum(rod())))


def test_the_tip_is_told_alike(swung):
    """As far as 20 mm."""
    run, solution = swing(pendulum(rod()))
    tips = [tip_deflection(r.system, "rod", s.q) for r, s in (swung, (run, solution))]
    np.testing.assert_allclose(tips[1], tips[0], rtol=0, atol=1e-9)
    assert np.abs(tips[0][:, 1]).max() > 0.01
    body = run.system.body("rod")
    np.testing.assert_allclose(body.slopes(solution.q[-1])[-1], tips[0][-1, 2], rtol=0, atol=1e-9)


def test_a_start_may_be_given_in_the_functions_own_coordinates():
    system = build_system(arm(rod()))
    own = np.array([0.01, -0.02, 0.005, 0.0, 1e-4])
    state = consistent_state(system, system.mechanism.assembly(), deflection={"rod": own})
    np.testing.assert_allclose(
        tip_deflection(system, "rod", state.q[None])[0],
        [1e-4, own[:4].sum(), own[:4] @ [2, 3, 4, 5] / LENGTH],
        rtol=0,
        atol=1e-7,
    )


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_body_by_the_matrices_of_a_beam_moves_as_the_beam(swung, turn):
    body = as_modal(quintic(reference=ReferenceCondition.CANTILEVER), turn)
    assert_same_motion(swung, swing(pendulum(body, start=0.4 - turn)), turn)


def test_held_rigid_they_are_one_body():
    runs = [swing(pendulum(body).rigid()) for body in (quintic(), rod(), as_modal(quintic()))]
    for run, solution in runs[1:]:
        assert run.system.n_flexible == 0
        np.testing.assert_allclose(solution.q, runs[0][1].q, rtol=0, atol=1e-9)
    off = swing(pendulum(rod(flexible=False)))
    np.testing.assert_array_equal(off[1].q, runs[1][1].q)


@pytest.mark.parametrize("make", [rod, lambda **changes: as_modal(quintic(), **changes)], ids=["assumed", "modal"])
def test_modes_of_lowest_frequency_may_be_kept(make):
    all_of_them, few = (build_system(pendulum(make(modes=modes))).bodies[0] for modes in (None, 2))
    np.testing.assert_array_equal(few.modes.omega, all_of_them.modes.omega[:2])
    assert pendulum(make()).with_beams(modes=2).bodies[0].modes == 2
    with pytest.raises(InputError, match=r"body\.rod\.modes: no such number of modes \(got 9\); from 1 to 5"):
        pendulum(make(modes=9))


def test_points_may_lie_anywhere_along_a_bar():
    """A cantilever under a force at its tip is a cubic, and so within the powers: w = F (3 L x^2 - x^3) / 6 E I."""
    force, x = 1e-3, 0.31
    bar = rod(points={"O": 0.0, "M": x, "P": LENGTH})
    mechanism = Mechanism(
        "cantilever",
        {"O": (0.0, 0.0)},
        (bar,),
        (RevoluteJoint("root", PointRef("ground", "O"), PointRef("rod", "O")),),
        loads=(PointForce("pull", PointRef("rod", "P"), (0.0, force)),),
        assemblies=(Assembly("straight", {"rod": 0.0}),),
    )
    system = build_system(mechanism)
    q = static_equilibrium(system, consistent_state(system, mechanism.assembly()), ["root"]).q
    marker, u = system.marker(PointRef("rod", "M")), q[system.bodies[0].flexible]
    EI = RUBBER.youngs_modulus * SECTION.second_moment
    assert marker.place(u)[1] == pytest.approx(force * (3 * LENGTH * x**2 - x**3) / (6 * EI), rel=1e-6)
    assert marker.slope @ u == pytest.approx(force * (6 * LENGTH * x - 3 * x**2) / (6 * EI), rel=1e-6)


# --- Second-order geometry -----------------------------------------------------------------------------------------


def chain(geometry):
    """A flexible beam and a bar of assumed modes at its end."""
    first = FlexibleBeam("first", 0.3, SECTION, RUBBER, {"A": 0.0, "O": 0.3}, 2)
    return Mechanism(
        "chain",
        {"A": (0.0, 0.0)},
        (first, rod()),
        (
            RevoluteJoint("A", PointRef("ground", "A"), PointRef("first", "A")),
            RevoluteJoint("O", PointRef("first", "O"), PointRef("rod", "O")),
        ),
        gravity=(0.0, -9.81),
        assemblies=(Assembly("start", {"first": 0.2, "rod": 0.9}),),
    ).with_geometry(geometry)


def test_beside_beams_of_second_order_geometry_given_shapes_stay_linear():
    systems = [build_system(chain(geometry)) for geometry in ("linear", "second-order")]
    rng = np.random.default_rng(4)
    q, v, a = 0.02 * rng.normal(size=(3, 1, systems[0].n))
    forces = []
    for system in systems:
        f = np.zeros_like(q)
        motion_forces(system.packed, q, v, a, np.zeros((1, 0)), f, make_scratch(system.packed))
        forces.append(f[0])
    own, other = systems[0].body("rod").all, systems[0].body("first").all
    np.testing.assert_allclose(forces[1][own], forces[0][own], rtol=1e-12)
    assert np.abs(forces[1][other] - forces[0][other]).max() > 1e-6
    masses = [mass_matrix(system, q[0])[own, own] for system in systems]
    np.testing.assert_allclose(masses[1], masses[0], rtol=0, atol=1e-14)


def test_the_mixture_keeps_its_energy():
    run = simulate_motion(chain("second-order"), 0.3, samples=31, options=IntegrationOptions(tolerance=1e-6))
    solution = run.solution
    assert solution.energy_balance_max < 1e-4 * solution.kinetic_energy.max()
    assert solution.constraint_position_max < 1e-7
    # As few Newton iterations as with one kind of body alone: about two a stage.
    stages = METHODS[solution.method].scheme.c.size - 1
    assert solution.newton_iterations < 4 * stages * solution.steps


def test_alone_they_run_with_the_kernels_of_linear_geometry(swung):
    assert build_system(pendulum(rod()).with_geometry("second-order")).packed.bending is None
    assert_same_motion(swung, swing(pendulum(rod()).with_geometry("second-order")))


# --- Studies -------------------------------------------------------------------------------------------------------


def arm(body):
    """One link turned by a motor at its root, its end to be moved in x."""
    return Mechanism(
        "arm",
        {"O": (0.0, 0.0)},
        (body,),
        (RevoluteJoint("shoulder", PointRef("ground", "O"), PointRef(body.name, "O")),),
        (Motor("torque", "shoulder"),),
        end_effector=EndEffector(PointRef(body.name, "P"), ("x",)),
        assemblies=(Assembly("up", {body.name: 0.4}),),
        geometry=Geometry.LINEAR,
    )


def tracked(body):
    return plan_tracking(arm(body), SWING, samples=16)


def stiff(body):
    """As stiff as ten thousand times rubber: the end-effector is to follow a path."""
    return replace(body, material=replace(RUBBER, youngs_modulus=5e10))


TIP = {"points": {"O": 0.0, "P": 0.4}, "length": 0.4}
KINDS = {
    "assumed": lambda: replace(stiff(rod()), **TIP),
    "modal": lambda: as_modal(replace(stiff(quintic()), **TIP)),
}


@pytest.mark.parametrize("kind", list(KINDS))
def test_a_tracking_study_tells_of_them_what_it_tells_of_a_beam(kind):
    beam, body = replace(stiff(quintic()), **TIP), KINDS[kind]()
    options = IntegrationOptions(method="esdirk5", tolerance=1e-8, newton_fraction=1e-6)
    theirs, mine = (record(tracked(link).simulate("+", options=options)) for link in (beam, body))
    for name in ("angle", "chord_angle", "chord_velocity", "tip", "point_position", "strain_energy", "torque"):
        one, other = (values(run, name) for run in (mine, theirs))
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-6 * np.abs(other).max(), err_msg=name)
    assert np.abs(values(theirs, "tip")[:, 0, 1]).max() > 1e-5
    theirs, mine = (record(simulate_ked(tracked(link), "+", step=1e-3)) for link in (beam, body))
    one, other = (values(run, "tip") for run in (mine, theirs))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-6 * np.abs(other).max())


def test_a_turned_modal_body_has_the_chord_of_the_beam():
    """Of the line from its first point to its last, told from the undeformed one."""
    turn = 0.7
    beam = replace(stiff(quintic()), **TIP)
    body = as_modal(beam, turn)
    options = IntegrationOptions(method="esdirk5", tolerance=1e-8, newton_fraction=1e-6)
    theirs = record(tracked(beam).simulate("+", options=options))
    turned = replace(arm(body), assemblies=(Assembly("up", {"rod": 0.4 - turn}),))
    mine = record(plan_tracking(turned, SWING, samples=16).simulate("+", options=options))
    np.testing.assert_allclose(mine.links["chord_angle"] + turn, theirs.links["chord_angle"], rtol=0, atol=1e-6)
    np.testing.assert_allclose(mine.links["chord_velocity"], theirs.links["chord_velocity"], rtol=0, atol=1e-4)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    one, other = (values(run, "tip")[:, 0, :2] for run in (mine, theirs))
    np.testing.assert_allclose(one, other @ R.T, rtol=0, atol=1e-7)


def test_a_body_of_one_point_tells_of_no_tip():
    bar = as_modal(replace(stiff(quintic()), **TIP))
    bob = as_modal(
        replace(quintic(), **TIP), name="bob", points={"P": ModalPoint((0.0, 0.0), np.zeros((2, 5)), [0] * 5)}
    )
    mechanism = replace(
        arm(bar),
        bodies=(bar, bob),
        joints=(*arm(bar).joints, RevoluteJoint("P", PointRef("rod", "P"), PointRef("bob", "P"))),
        motors=(Motor("torque", "shoulder"), Motor("wrist", "P")),
        end_effector=EndEffector(PointRef("bob", "P"), ("x", "angle")),
        assemblies=(Assembly("up", {"rod": 0.4, "bob": 0.1}),),
    )
    data = tracking_dataset([plan_tracking(mechanism, SWING, samples=11).simulate("++")])
    assert np.all(np.isnan(data["tip_transverse"].sel(body="bob")))
    np.testing.assert_array_equal(data["chord_angle"].sel(body="bob"), data["angle"].sel(body="bob"))
    for figure in (plots.tip_deflections(data, "++"), plots.link_motions(data, "++")):
        assert figure.axes


@pytest.mark.parametrize("kind", list(KINDS))
def test_what_needs_a_mesh_is_refused_by_name(kind):
    task = tracked(KINDS[kind]())
    mechanism = task.mechanism
    for change in ({"elements": 2}, {"reference": ReferenceCondition.FREE}, {"curvature": Curvature.SHARED}):
        with pytest.raises(InputError, match=rf"body\.rod\.{next(iter(change))}: the shapes of this body are given"):
            mechanism.with_beams(**change)
    with pytest.raises(InputError, match=r"body\.rod\.elements: the shapes of this body are given"):
        mechanism.refined(2)
    with pytest.raises(InputError, match=r"body\.rod: a body of given shapes cannot be cut into segments"):
        finite_segments(mechanism)
    for engine, simulate in (("Exudyn", simulate_exudyn), ("MuJoCo", simulate_mujoco)):
        with pytest.raises(InputError, match=rf"body\.rod: {engine} cannot express a flexible body of given shapes"):
            simulate(task, "+")
    with pytest.raises(InputError, match=r"body\.rod: a body of given shapes cannot be cut into segments"):
        verify(task, ["+"])
    assert mechanism.refined(1) == mechanism
    rigid = mechanism.rigid()
    assert rigid.refined(2) == rigid.with_beams(elements=3) == rigid
    assert finite_segments(rigid, {}).mechanism.bodies == rigid.bodies


def test_models_that_take_them_can_be_verified():
    found = verify(tracked(KINDS["assumed"]()), ["+"], models=["rigid", "ked", "linear"])
    assert found.complete
    assert {name: list(map(str, runs.records)) for name, runs in found.runs["+"].items()}["linear"] == [
        "Refinement.NONE",
        "Refinement.STEP",
    ]


# --- Consistency of a body's own matrices --------------------------------------------------------------------------


def changed(matrix, row, column, value):
    out = np.array(matrix, dtype=float)
    out[row, column] = value
    return out


S = build_system(Mechanism("one", {}, (quintic(),), ())).bodies[0].integrals
POINT = {"O": ModalPoint((0.0, 0.0), np.zeros((2, 5)), np.zeros(5))}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"mass": 0.0}, "mass: must be positive"),
        ({"inertia": 1e-9}, "inertia: is not positive definite"),
        ({"stiffness": ()}, "stiffness: has no flexible coordinates"),
        ({"stiffness": np.eye(4)}, "mass_matrix: not of the size of the stiffness matrix (got '5 x 5')"),
        ({"S2": np.zeros((5, 2))}, "S2: not of the size of the stiffness matrix (got '5 x 2'); give 2 x 5 numbers"),
        ({"I1": [0.0, 1.0]}, "I1: not of the size of the stiffness matrix (got '2'); give 5 numbers"),
        ({"G1": [[0.0], [1.0, 2.0]]}, "G1: is not a table of numbers; give 5 of them"),
        ({"G1": [np.inf] * 5}, "G1: not all finite numbers"),
        ({"stiffness": changed(S.K, 0, 1, S.K[0, 0])}, "stiffness: is not symmetric"),
        ({"mass_matrix": changed(S.Mff, 2, 1, 0.1)}, "mass_matrix: is not symmetric"),
        ({"G2": np.eye(5)}, "G2: is not skew"),
        ({"stiffness": changed(S.K, 0, 0, 0.0)}, "stiffness: is not positive definite; leave out coordinates that"),
        ({"mass_matrix": changed(S.Mff, 0, 0, -1.0)}, "mass_matrix: is not positive definite"),
        ({"S2": 10.0 * S.S2}, "mass_matrix: is not positive definite; check S2 and G1"),
        ({"I2": 2.0 * S.Mff}, "I2: is more than the mass matrix"),
        ({"points": {"P": ModalPoint((0.0, 0.0), np.zeros((2, 4)), np.zeros(5))}}, "points.P.shape: not of the size"),
        ({"points": {"P": ModalPoint((0.0, 0.0), np.zeros((2, 5)), [0.0])}}, "points.P.slope: not of the size"),
        ({"points": {"P": ModalPoint((0.0,), np.zeros((2, 5)), np.zeros(5))}}, "points.P.position: not of the size"),
    ],
)  # fmt: skip
def test_matrices_that_make_no_body_are_named(changes, says):
    with pytest.raises(InputError) as caught:
        Mechanism("one", {}, (modal(S, POINT, **changes),), ())
    assert str(caught.value).startswith(f"body.rod.{says}")


def test_bodies_of_arrays_compare_by_value():
    assert modal(S, POINT) == modal(S, {"O": ModalPoint([0.0, 0.0], [[0.0] * 5] * 2, [0.0] * 5)})
    assert modal(S, POINT) != modal(S, POINT, stiffness=2.0 * S.K)


# --- Files ---------------------------------------------------------------------------------------------------------

FILE = """
name = "pendulum"
gravity = [0.0, -9.81]
[parameters]
L = 0.5
[section.bar]
width = 0.03
thickness = 0.01
[material.rubber]
youngs_modulus = 5e6
density = 1100.0
[lump.root]
mass = 0.02
inertia = 1e-5
[lump.tip]
mass = 0.05
inertia = 4e-5
[ground]
O = [0.1, 0.2]
[body.rod]
type = "assumed-modes"
length = "L"
section = "bar"
material = "rubber"
points = { O = 0.0, P = "L" }
lumps = { O = "root", P = "tip" }
transverse_polynomials = [[0, 0, 1], [0, 0, 0, 1], [0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 1]]
axial_polynomials = [[0, "L / 0.5"]]
[body.bob]
type = "rigid"
mass = 0.1
inertia = 1e-3
centre_of_mass = [0.05, 0.02]
points = { P = [0.0, 0.0] }
[joint]
root = ["ground.O", "rod.O"]
hinge = ["rod.P", "bob.P"]
[motor]
drive = "root"
[assembly.start]
rod = 0.4
bob = -0.3
[study]
duration = 0.1
samples = 11
"""


def written(tmp_path, source=FILE):
    file = tmp_path / "pendulum.toml"
    file.write_text(source, encoding="utf-8")
    return file


def rows(values):
    return np.array(values).tolist()


def modal_source():
    """The file with the rod by its matrices."""
    body = as_modal(quintic())
    lines = ["[body.rod]", 'type = "modal"', f"mass = {float(body.mass)!r}", f"inertia = {float(body.inertia)!r}"]
    for name in ("first_moment", "mass_matrix", "stiffness", "S2", "I1", "G1", "G2", "I2"):
        lines.append(f"{name} = {rows(getattr(body, name))}")
    for name, point in body.points.items():
        lines.append(f"[body.rod.points.{name}]")
        lines += [f"{key} = {rows(getattr(point, key))}" for key in ("position", "shape", "slope")]
    start, end = FILE.index("[body.rod]"), FILE.index("[body.bob]")
    return FILE[:start] + "\n".join(lines) + "\n" + FILE[end:]


def test_a_file_gives_the_bodies_that_python_gives(tmp_path):
    assert load(written(tmp_path)).mechanism == pendulum(rod(), geometry=Geometry.SECOND_ORDER)
    by_matrices = pendulum(as_modal(quintic()), geometry=Geometry.SECOND_ORDER)
    assert load(written(tmp_path, modal_source())).mechanism == by_matrices
    sines = FILE.replace("transverse_polynomials = [[0, 0, 1], ", "transverse_sines = 2\ntransverse_polynomials = [")
    functions = load(written(tmp_path, sines)).mechanism.body("rod").transverse
    assert functions == (Sine(1), Sine(2), *powers(3, 5))
    held = FILE.replace("[body.bob]", "modes = 3\nflexible = false\n[body.bob]")
    assert load(written(tmp_path, held)).mechanism.body("rod") == rod(modes=3, flexible=False)


@pytest.mark.parametrize("source", [FILE, modal_source()], ids=["assumed", "modal"])
def test_info_and_run_take_them(tmp_path, source):
    file = written(tmp_path, source)
    link = describe(load(file))["links"][0]
    assert (link["kind"], link["elements"], link["coordinates"]) == ("flexible", None, 8)
    omega = modal_basis(build_system(pendulum(quintic())).bodies[0].integrals).omega
    np.testing.assert_allclose(2 * np.pi * np.array(link["frequencies_hz"]), omega, rtol=1e-8)
    done = paraflex("run", "-m", str(file), "--out", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    assert "pendulum: complete at t = 0.1 s" in done.stdout
    assert (tmp_path / "out" / "figures").exists()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("transverse_poly", "tranverse_poly", 'body.rod.tranverse_polynomials: unknown field'),
        ("[0, 0, 1],", "[0, 1],", "body.rod.transverse: its shape functions contain a rigid motion of the bar"),
        ("[0, 0, 1],", '[0, 0, "l"],', 'body.rod.transverse_polynomials.0.2: unknown parameter "l"'),
        ('"assumed-modes"', '"assumed"', "body.rod.type: unknown type (got 'assumed'); did you mean \"assumed-modes"),
        ('section = "bar"', 'section = "bra"', "body.rod.section: unknown section (got 'bra')"),
        ('P = "tip" }', 'Q = "tip" }', "body.rod.lumps: a lumped mass at an unknown point (got 'Q')"),
        ('P = "L" }', "P = 0.6 }", "body.rod.points.P: the point lies beyond the beam's end"),
        ("[[0, 0, 1]", "[[]", "body.rod.transverse: has no coefficients"),
        ("transverse_poly", "transverse_sines = -1\ntransverse_poly", "body.rod.transverse_sines: must not be neg"),
    ],
)  # fmt: skip
def test_a_broken_file_is_refused_by_name(tmp_path, old, new, says):
    assert old in FILE
    with pytest.raises(InputError) as caught:
        load(written(tmp_path, FILE.replace(old, new, 1)))
    assert says in str(caught.value)


def test_a_broken_matrix_in_a_file_is_refused_by_name(tmp_path):
    source = modal_source()
    for old, new, says in (
        ("G2 = [[", "G2 = [[1.0, ", "body.rod.G2: is not a table of numbers"),
        ("slope = [", "slpoe = [", "body.rod.points.O.slpoe: unknown field"),
        ("G1 = [", 'G1 = ["x", ', 'body.rod.G1.0: unknown parameter "x"'),
    ):
        with pytest.raises(InputError) as caught:
            load(written(tmp_path, source.replace(old, new, 1)))
        assert says in str(caught.value)
