"""Starts by names: static shapes, velocities of least kinetic energy, published coordinates."""

import dataclasses
import json

import numpy as np
import pytest

from paraflex.dynamics import build_system, consistent_state, moment_signals, start_state
from paraflex.dynamics.points import point_motion
from paraflex.dynamics.start import point_rows, static_shape
from paraflex.dynamics.state import mass_matrix, point_position
from paraflex.errors import AssemblyError, InputError
from paraflex.fem import ReferenceCondition
from paraflex.files import library_file, load
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    Assembly,
    BodyValues,
    ConstantSpeed,
    Curvature,
    Deflection,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    RigidBody,
    Section,
    Start,
)
from paraflex.motion import simulate_motion
from shell import paraflex

LENGTH, EI = 0.8, 70e9 * 0.02 * 0.004**3 / 12
TIP = PointRef("beam", "tip")


def clamped(**changes):
    beam = FlexibleBeam("beam", LENGTH, Section.rectangle(0.02, 0.004), Material(70e9, 2700.0),
                        {"root": 0.0, "middle": LENGTH / 2, "tip": LENGTH}, elements=2,
                        reference=ReferenceCondition.CANTILEVER, curvature=Curvature.SHARED)  # fmt: skip
    mechanism = Mechanism(
        "clamped",
        {"O": (0.0, 0.0)},
        (dataclasses.replace(beam, **changes),),
        (RevoluteJoint("root", PointRef("ground", "O"), PointRef("beam", "root")),),
        prescribed=(PrescribedAngle("clamp", "root", ConstantSpeed(0.3, 0.0)),),
        assemblies=(Assembly("start", {"beam": 0.3}),),
    )
    return mechanism


def rods(*angles):
    """Uniform rigid rods of 1 kg and 1 m in a chain from the ground."""
    names = [f"rod{k}" for k in range(len(angles))]
    bodies = [RigidBody(name, 1.0, 1 / 12, (0.5, 0.0), {"a": (0.0, 0.0), "b": (1.0, 0.0)}) for name in names]
    ends = [PointRef("ground", "O"), *(PointRef(name, "b") for name in names)]
    joints = [RevoluteJoint(name, end, PointRef(name, "a")) for name, end in zip(names, ends, strict=False)]
    return Mechanism("rods", {"O": (0.0, 0.0)}, tuple(bodies), tuple(joints),
                     assemblies=(Assembly("start", dict(zip(names, angles, strict=True))),))  # fmt: skip


# --- Deflection ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("geometry", list(Geometry))
def test_a_deflected_tip_bends_the_beam_as_a_force_does(geometry):
    mechanism = clamped().with_geometry(geometry)
    system = build_system(mechanism)
    state = start_state(system, Start(deflection={"beam": {"tip": Deflection(transverse=0.01)}}), mechanism.assembly())
    u = state.q[system.bodies[0].flexible]
    assert 0.5 * u @ (system.bodies[0].modes.omega ** 2 * u) == pytest.approx(1.5 * EI * 0.01**2 / LENGTH**3, rel=1e-7)
    marker = system.marker(PointRef("beam", "middle"))
    assert marker.N[1] @ u == pytest.approx(5 / 16 * 0.01, rel=1e-7)
    assert system.marker(TIP).slope @ u == pytest.approx(1.5 * 0.01 / LENGTH, rel=1e-7)
    np.testing.assert_array_equal(state.v, 0.0)


def test_slope_and_stretch_of_a_tip_are_those_of_a_moment_and_a_pull():
    system = build_system(clamped())
    u = static_shape(system, "beam", {"tip": Deflection(axial=1e-4, slope=0.02)})
    # A constant moment bends into an arc; the paper's element has no curvature at its end: two elements come near.
    assert system.marker(TIP).N[1] @ u == pytest.approx(0.5 * 0.02 * LENGTH, rel=0.1)
    assert system.marker(PointRef("beam", "middle")).N[0] @ u == pytest.approx(0.5e-4, rel=1e-9)


def test_given_deflections_are_met_whatever_the_frame(condition):
    mechanism = clamped(reference=condition)
    system = build_system(mechanism)
    given = {"middle": Deflection(transverse=0.002, slope=-0.01)}
    u = static_shape(system, "beam", given)
    marker, root = system.marker(PointRef("beam", "middle")), system.marker(PointRef("beam", "root"))
    C = np.vstack([marker.N[1] - root.N[1] - LENGTH / 2 * root.slope, marker.slope - root.slope])
    np.testing.assert_allclose(C @ u, [0.002, -0.01], rtol=1e-9)
    # Nothing else that meets them has less energy.
    stiffness = system.bodies[0].modes.omega ** 2
    for other in np.random.default_rng(3).normal(size=(20, u.size)) / np.sqrt(stiffness):
        free = other - np.linalg.pinv(C) @ (C @ other)
        assert abs(u @ (stiffness * free)) < 1e-8 * np.linalg.norm(np.sqrt(stiffness) * u) * np.linalg.norm(
            np.sqrt(stiffness) * free
        )


def test_a_deflection_is_the_same_whatever_the_frame(condition):
    """It counts from the tangent at the first end, which the assembly places."""
    places = []
    for reference in (ReferenceCondition.CANTILEVER, condition):
        mechanism = dataclasses.replace(clamped(reference=reference, elements=4), prescribed=())
        system = build_system(mechanism)
        given = Start(deflection={"beam": {"tip": Deflection(1e-5, 0.01)}})
        q = start_state(system, given, mechanism.assembly()).q
        places.append([point_motion(system, PointRef("beam", name), *q[None, None].repeat(3, 0)).position[0]
                       for name in ("root", "middle", "tip")])  # fmt: skip
    # Alike to what a turn by the slope takes from displacements to first order.
    np.testing.assert_allclose(places[1], places[0], rtol=0, atol=2e-6)


def test_what_contradicts_itself_is_refused():
    system = build_system(clamped(reference=ReferenceCondition.PINNED))
    with pytest.raises(
        InputError, match=r"start\.deflection\.beam\.root\.transverse: the shapes of the body, or its other"
    ):
        static_shape(system, "beam", {"root": Deflection(transverse=0.01)})


def test_a_loop_closes_around_a_deflected_link():
    mechanism = load("four_bar").mechanism
    system = build_system(mechanism)
    shape = {"coupler": {"A": Deflection(0.0, 0.0), "B": Deflection(transverse=0.02)}}
    state = start_state(system, Start(deflection=shape), mechanism.assembly())
    u = state.q[system.body("coupler").flexible]
    np.testing.assert_allclose(u, static_shape(system, "coupler", shape["coupler"]), rtol=0, atol=1e-15)
    phi, rate = system.constraints(moment_signals(mechanism, 0.0), 0.0, state.q, state.v)
    assert np.max(np.abs(phi)) < 1e-11
    assert np.max(np.abs(rate)) < 1e-8


def test_a_beam_let_go_swings_at_its_first_frequency():
    """A clamped beam bent by a tip force: mostly its first mode, (1.8751)^2 sqrt(EI / (rho A L^4))."""
    mechanism = clamped()
    system = build_system(mechanism)
    start = start_state(system, Start(deflection={"beam": {"tip": Deflection(0.0, 0.01)}}), mechanism.assembly())
    omega = 1.8751040687119611**2 * np.sqrt(EI / (2700.0 * 8e-5 * LENGTH**4))
    run = simulate_motion(mechanism, np.pi / omega, samples=3, start=start, options=IntegrationOptions(tolerance=1e-7))
    tip = run.solution.q[:, system.bodies[0].flexible] @ system.marker(TIP).N[1]
    # The higher modes have 3 % of the tip's displacement.
    np.testing.assert_allclose(tip, [0.01, 0.0, -0.01], rtol=0, atol=6e-4)


# --- Velocities ---------------------------------------------------------------------------------------------------


def test_rates_of_angles_leave_the_rest_to_least_kinetic_energy():
    """Two rods: M12 w1 + M22 w2 = 0, so w2 = -3/2 cos(difference) w1."""
    mechanism = rods(0.4, 1.5)
    state = start_state(build_system(mechanism), Start(angular={"rod0": 2.0}), mechanism.assembly())
    np.testing.assert_allclose(state.v[[2, 5]], [2.0, -1.5 * np.cos(1.1) * 2.0], rtol=1e-12)


def test_the_velocity_of_a_point_turns_what_carries_it():
    mechanism = rods(0.4, 1.5)
    system = build_system(mechanism)
    state = start_state(system, Start(point={PointRef("rod1", "b"): (0.3, -0.7)}), mechanism.assembly())
    w1, w2 = state.v[[2, 5]]
    tip = w1 * np.array([-np.sin(0.4), np.cos(0.4)]) + w2 * np.array([-np.sin(1.5), np.cos(1.5)])
    np.testing.assert_allclose(tip, [0.3, -0.7], rtol=0, atol=1e-12)


@pytest.mark.parametrize("geometry", list(Geometry))
def test_rows_of_a_point_are_the_derivative_of_its_place(geometry):
    system = build_system(load("four_bar").mechanism.with_geometry(geometry))
    q = np.random.default_rng(4).normal(size=system.n) * 0.01
    for ref in (PointRef("coupler", "B"), PointRef("crank", "A")):
        h = 1e-6
        numeric = [(point_position(system, q + e, ref) - point_position(system, q - e, ref)) / (2 * h)
                   for e in h * np.eye(system.n)]  # fmt: skip
        np.testing.assert_allclose(point_rows(system, q, ref), np.array(numeric).T, rtol=0, atol=1e-8)


def test_flexible_links_start_unbent_beside_what_moves():
    """The rate of the angle of a flexible rocker: the four-bar without its drive turns as the rigid one does."""
    mechanism = dataclasses.replace(load("four_bar").mechanism, prescribed=())
    found = []
    for model in (mechanism, mechanism.rigid()):
        system = build_system(model)
        state = start_state(system, Start(angular={"rocker": 5.0}), model.assembly())
        for name in ("coupler", "rocker"):
            assert np.max(np.abs(state.v[system.body(name).flexible]), initial=0.0) < 1e-6
        found.append([state.v[system.body(name).angle] for name in ("crank", "coupler", "rocker")])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-5)
    assert found[0][2] == pytest.approx(5.0, rel=1e-9)


@pytest.mark.parametrize(
    ("start", "says"),
    [
        # The tip of a rod goes across it and not along.
        (Start(point={PointRef("rod0", "b"): (1.0, 0.0)}), r"start\.velocity\.point\.rod0\.b: .* contradict"),
        (Start(angular={"rod0": 1.0}, point={PointRef("rod0", "b"): (0.0, 2.0)}), r"contradict .* by 0\."),
        (
            Start(rates={"rod0": BodyValues(0.1, 0.0, 1.0), "rod1": BodyValues(0.0, 1.0, 0.0)}),
            r"by 0\.1 m/s .* rod[01] x .got 0\.1",
        ),
    ],
)
def test_velocities_that_joints_do_not_allow_are_refused_with_the_residual(start, says):
    mechanism = rods(0.0, 0.0)
    with pytest.raises(InputError, match=says):
        start_state(build_system(mechanism), start, mechanism.assembly())


def test_a_prescribed_profile_is_not_contradicted_silently():
    mechanism = load("four_bar").mechanism
    system = build_system(mechanism)
    with pytest.raises(InputError, match=r"start\.velocity\.angular\.crank: .* contradict each other"):
        start_state(system, Start(angular={"crank": 10.0}), mechanism.assembly())
    state = start_state(system, Start(angular={"crank": 20.0}), mechanism.assembly())
    np.testing.assert_allclose(state.v, consistent_state(system, mechanism.assembly()).v, rtol=0, atol=1e-6)


def test_an_empty_start_is_an_assembly_at_rest():
    mechanism = load("four_bar").mechanism
    system = build_system(mechanism)
    found, expected = start_state(system, Start(), mechanism.assembly()), consistent_state(system, mechanism.assembly())
    np.testing.assert_allclose(found.q, expected.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.v, expected.v, rtol=0, atol=1e-9)


# --- Coordinates --------------------------------------------------------------------------------------------------


def values(system, x, flexible=True):
    return {
        body.name: BodyValues(
            *x[body.offset : body.offset + 3],
            tuple(body.modes.vectors @ x[body.flexible]) if flexible and body.nf else None,
        )
        for body in system.bodies
    }


def swinging():
    mechanism = dataclasses.replace(load("four_bar").mechanism, prescribed=())
    mechanism = mechanism.with_beams(reference=ReferenceCondition.CANTILEVER, curvature=Curvature.SHARED)
    system = build_system(mechanism)
    shape = {"coupler": {"B": Deflection(transverse=0.01)}}
    return mechanism, system, start_state(system, Start(deflection=shape, angular={"crank": 3.0}), mechanism.assembly())


def test_published_coordinates_are_taken_as_they_are_and_need_no_assembly():
    _, system, state = swinging()
    found = start_state(system, Start(coordinates=values(system, state.q), rates=values(system, state.v)))
    np.testing.assert_allclose(found.q, state.q, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.v, state.v, rtol=0, atol=1e-10)
    # Its own coordinates of the cantilever: the tip's displacement across stands among them.
    own = np.array(values(system, state.q)["coupler"].flexible)
    assert np.min(np.abs(own - 0.01)) < 1e-12


def test_coordinates_that_leave_a_joint_open_are_refused_with_the_gap():
    _, system, state = swinging()
    moved = values(system, state.q)
    moved["rocker"] = dataclasses.replace(moved["rocker"], x=moved["rocker"].x + 2e-3)
    with pytest.raises(InputError, match=r"start\.coordinates: the joints do not close .* 0\.002 remains in [QB] x"):
        start_state(system, Start(coordinates=moved))
    near = values(system, state.q)
    near["rocker"] = dataclasses.replace(near["rocker"], x=near["rocker"].x + 2e-8)
    found = start_state(system, Start(coordinates=near))
    assert found.q[system.body("rocker").offset] == near["rocker"].x


def test_coordinates_of_some_bodies_are_kept_and_the_others_close_around_them():
    mechanism, system, state = swinging()
    crank = {"crank": values(system, state.q)["crank"]}
    found = start_state(system, Start(coordinates=crank), mechanism.assembly())
    np.testing.assert_array_equal(found.q[system.body("crank").all], state.q[system.body("crank").all])
    phi, _ = system.constraints(moment_signals(mechanism, 0.0), 0.0, found.q, found.v)
    assert np.max(np.abs(phi)) < 1e-11


def test_rates_of_some_bodies_carry_the_others_along():
    _, system, state = swinging()
    rates = {"crank": BodyValues(*state.v[:2], 3.0)}
    found = start_state(system, Start(coordinates=values(system, state.q), rates=rates))
    np.testing.assert_allclose(found.v, state.v, rtol=0, atol=1e-6)
    # With as many velocities as degrees of freedom the mass matrix has no say.
    assert found.v @ mass_matrix(system, found.q) @ found.v == pytest.approx(
        state.v @ mass_matrix(system, state.q) @ state.v, rel=1e-6
    )


@pytest.mark.parametrize(
    ("start", "says"),
    [
        (Start(deflection={"copler": {}}), "start.deflection: unknown body (got 'copler'); did you mean \"coupler\"?"),
        (Start(deflection={"crank": {}}), "start.deflection.crank: a rigid body has no deflection"),
        (Start(deflection={"coupler": {"Z": Deflection()}}), "start.deflection.coupler: unknown point (got 'Z')"),
        (Start(angular={"crnk": 1.0}), "start.velocity.angular: unknown body (got 'crnk')"),
        (Start(point={PointRef("ground", "O"): (1.0, 0.0)}), "start.velocity.point: unknown body (got 'ground')"),
        (
            Start(rates={"crank": BodyValues(0, 0, 0)}, angular={"crank": 1.0}),
            "start.rates: rates and velocity are both given",
        ),
        (
            Start(deflection={"coupler": {}}, coordinates={"coupler": BodyValues(0, 0, 0)}),
            "start.deflection.coupler: its coordinates are given",
        ),
        (
            Start(coordinates={"coupler": BodyValues(0, 0, 0, (0.0, 1.0))}),
            "start.coordinates.coupler.flexible: the body has 13 flexible coordinates (got 2); give 13 numbers",
        ),
        (
            Start(coordinates={"crank": BodyValues(0, 0, 0, (1.0,))}),
            "start.coordinates.crank.flexible: the body has 0 flexible coordinates (got 1)",
        ),
    ],
)
def test_starts_that_make_no_sense_are_named(start, says):
    mechanism = load("four_bar").mechanism
    with pytest.raises(InputError) as caught:
        start_state(build_system(mechanism), start, mechanism.assembly())
    assert says in str(caught.value)


def test_coordinates_need_all_bodies_or_an_assembly():
    mechanism = dataclasses.replace(load("four_bar").mechanism, assemblies=())
    with pytest.raises(
        InputError, match=r"start\.coordinates: the coordinates of this body are not given, .* \(got 'coupler'\)"
    ):
        start_state(build_system(mechanism), Start(coordinates={"crank": BodyValues(0, 0, 1.0)}))


def test_modes_kept_must_hold_the_shape_given():
    mechanism, system, state = swinging()
    reduced = build_system(mechanism.with_beams(modes=2))
    with pytest.raises(InputError, match=r"start\.coordinates\.coupler\.flexible: the modes kept of the body"):
        start_state(reduced, Start(coordinates=values(system, state.q)))


# --- Files and the command line -----------------------------------------------------------------------------------

PENDULUM = """
name = "rod"
[ground]
O = [0.0, 0.0]
[body.rod]
type = "rigid"
mass = 1.0
inertia = 0.1
points = { O = [-0.5, 0.0], P = [0.5, 0.0] }
[joint]
pin = ["ground.O", "rod.O"]
[assembly.start]
rod = 0.0
[study]
duration = 0.5
samples = 3
"""


def run(folder, text, *arguments):
    file = folder / "rod.toml"
    file.write_text(text, encoding="utf-8")
    return paraflex("run", "-m", str(file), "--json", "--out", str(folder / "out"), *arguments)


@pytest.mark.parametrize(
    "start",
    [
        "[start.velocity]\nangular = { rod = 2.0 }\n",
        '[start.velocity]\npoint = { "rod.P" = [0.0, 2.0] }\n',
        "[start.coordinates]\nrod = { x = 0.5, y = 0.0, phi = 0.0 }\n[start.rates]\nrod = { x = 0, y = 1, phi = 2 }\n",
    ],
)
def test_a_rod_without_weight_goes_on_turning(tmp_path, start):
    done = run(tmp_path, PENDULUM + start, "--tol", "1e-6")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["final"]["angle"]["rod"] == pytest.approx(1.0, abs=1e-5)


def test_equilibrium_gives_the_place_and_the_file_the_velocity(tmp_path):
    """Hanging down and struck: the height follows from energy, w^2 J / 2 = m g r (1 - cos)."""
    text = PENDULUM.replace("[ground]", "gravity = [0.0, -9.81]\n[ground]").replace("rod = 0.0", "rod = -1.3")
    text += "[start.velocity]\nangular = { rod = 2.0 }\n"
    done = run(tmp_path, text, "--balanced", "--tol", "1e-6")
    assert done.returncode == 0, done.stderr
    turned = json.loads(done.stdout)["final"]["angle"]["rod"] + np.pi / 2
    plain = load(tmp_path / "rod.toml")
    system = build_system(plain.mechanism)
    low = consistent_state(system, Assembly("low", {"rod": -np.pi / 2}))
    start = start_state(system, plain.start, q=low.q)
    tight = IntegrationOptions(tolerance=1e-7)
    expected = simulate_motion(plain.mechanism, 0.5, samples=3, start=start, options=tight).solution.q[-1, 2]
    assert turned == pytest.approx(expected + np.pi / 2, abs=1e-5)
    assert 0.0 < turned < np.arccos(1.0 - 0.35 * 2.0**2 / (2 * 9.81 * 0.5))


def test_a_deflection_from_a_file(tmp_path):
    text = library_file("pendulum").read_text(encoding="utf-8")
    file = tmp_path / "bent.toml"
    forms = ("tip = [0.0, 0.03]", "tip = { axial = 0.0, transverse = 0.03 }")
    for form in forms:
        file.write_text(f"{text}\n[start.deflection]\nbeam = {{ {form} }}\n", encoding="utf-8")
        model = load(file)
        assert model.start == Start(deflection={"beam": {"tip": Deflection(0.0, 0.03)}})


@pytest.mark.parametrize(
    ("extra", "arguments", "says"),
    [
        ("[start.velocity]\nangular = { rud = 1.0 }", [], "rod.toml: start.velocity.angular: unknown body (got 'rud')"),
        ("[start.velocity]\nangular = { rod = nan }", [], "rod.toml: start.velocity.angular.rod: should be a finite"),
        ('[start.velocity]\npoint = { "rod.P" = [1.0, 0.0] }', [], "rod.toml: start.velocity.point.rod.P: joints,"),
        ("[start.coordinates]\nrod = { x = 0.6, y = 0.0, phi = 0.0 }", [], "a gap of 0.1 remains in pin x"),
        ("[start.coordinates]\nrod = { x = 0.5, y = 0.0 }", [], "start.coordinates.rod.phi: is missing"),
        (
            "[start.coordinates]\nrod = { x = 0.5, y = 0.0, phi = 0.0 }",
            ["--balanced"],
            "--balanced: the [start] gives",
        ),
        ("[start.velocity]\nangular = { rod = 1.0 }", ["--segments", "4"], "--segments: the file's [start] refers to"),
        (
            "[start.velocity]\nangualr = { rod = 1.0 }",
            [],
            "unknown field (got {'rod': 1.0}); did you mean \"angular\"?",
        ),
    ],
)
def test_starts_in_files_are_refused_in_one_line(tmp_path, extra, arguments, says):
    done = run(tmp_path, PENDULUM + extra, *arguments)
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_path_and_a_start_do_not_go_together(tmp_path):
    text = library_file("five_bar").read_text(encoding="utf-8")
    file = tmp_path / "five.toml"
    name = next(iter(load("five_bar").mechanism.bodies)).name
    file.write_text(f"{text}\n[start.velocity]\nangular = {{ {name} = 1.0 }}\n", encoding="utf-8")
    done = paraflex("run", "-m", str(file), "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert f"error: {file}: start: a path says where and how the mechanism starts; drop the [start]" in done.stderr


def test_a_loop_is_not_closed_by_stretching_a_link_to_twice_its_length():
    """In linear theory a beam of 0.2 m reaches from one pin to another 0.5 m away; no one means that."""
    points = {"O": 0.0, "P": 0.2}
    beam = FlexibleBeam("beam", 0.2, Section.rectangle(0.02, 0.004), Material(70e9, 2700.0), points=points)
    mechanism = Mechanism(
        name="short",
        ground={"O": (0.0, 0.0), "P": (0.5, 0.0)},
        bodies=(beam,),
        joints=tuple(RevoluteJoint(k, PointRef("ground", k), PointRef("beam", k)) for k in points),
        assemblies=(Assembly("along", {"beam": 0.0}),),
    )
    with pytest.raises(AssemblyError, match=r"a gap of 0\.3 m remains in P"):
        consistent_state(build_system(mechanism), mechanism.assembly())
