"""Deformed shapes in the results: against points, closed forms and quintics; stiff between joints; old files."""

import shutil
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

import paraflex as pf
from conftest import make_linkage
from paraflex.dynamics import build_system, consistent_state, static_equilibrium
from paraflex.dynamics.points import point_motion
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    Assembly,
    AssumedModesBeam,
    FlexibleBeam,
    Geometry,
    LinearSpring,
    Material,
    Mechanism,
    ModalBody,
    ModalPoint,
    PointForce,
    PointRef,
    RevoluteJoint,
    RigidBody,
    Section,
    Sine,
    SlidingJoint,
    WeldJoint,
)
from paraflex.motion import simulate_motion
from paraflex.results import motion_dataset
from paraflex.results.drawing import drawing_coordinates, system_drawing
from paraflex.results.outlines import Hold, Outline, outline, outline_motion, stiff_shape
from paraflex.results.storage import SCHEMA

DATA = Path(__file__).parent / "data"
STEEL = Material(youngs_modulus=2.1e11, density=7850.0)
SECTION = Section.rectangle(width=0.03, thickness=0.004)
EI = STEEL.youngs_modulus * SECTION.second_moment
LENGTH = 0.6


def cantilever(force=0.02, geometry=Geometry.LINEAR, reference=ReferenceCondition.CANTILEVER, **changes):
    """A beam clamped to the ground at its first end, a force across its tip."""
    values = {"points": {"root": 0.0, "tip": LENGTH}, "elements": 2, "reference": reference}
    beam = FlexibleBeam("beam", LENGTH, SECTION, STEEL, **(values | changes))
    return Mechanism(
        name="cantilever",
        ground={"wall": (0.1, 0.2)},
        bodies=(beam,),
        joints=(WeldJoint("clamp", PointRef("ground", "wall"), PointRef("beam", "root")),),
        loads=(PointForce("force", PointRef("beam", "tip"), (0.0, force)),),
        assemblies=(Assembly("straight", {"beam": 0.0}),),
        geometry=geometry,
    )


def bent(system, seed=0, size=0.05):
    """Coordinates of three instants, bent by some hundredths of a radian."""
    q = np.random.default_rng(seed).normal(size=(3, system.n))
    for body in system.bodies:
        if body.nf:
            D = body.integrals.D
            scale = np.linalg.norm(D[2::4], axis=0) + 10.0 * np.linalg.norm(D[0::4], axis=0)
            q[:, body.flexible] *= size / scale / np.arange(1, body.nf + 1)
    return q


def closed(mechanism, seed=1, size=0.03):
    """A system and coordinates (1, n) at which its loops close with links bent."""
    system = build_system(mechanism)
    nodal = {
        body.name: body.integrals.D @ bent(system, seed, size)[0, body.flexible] for body in system.bodies if body.nf
    }
    state = consistent_state(system, mechanism.assembly(), deflection=nodal)
    return system, state.q[None]


def point_stations(mechanism):
    """Station of every named point."""
    names = [PointRef(body.name, point) for body in mechanism.bodies for point in body.points]
    return dict(zip(names, drawing_coordinates(mechanism)["point_station"][1], strict=True))


# --- Where stations are ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("geometry", list(Geometry))
def test_shapes_pass_through_the_named_points(condition, geometry):
    mechanism = replace(make_linkage(condition), geometry=geometry)
    system = build_system(mechanism)
    q = bent(system)
    shape = system_drawing(system, q).shape
    for ref, station in point_stations(mechanism).items():
        place = point_motion(system, ref, q, 0 * q, 0 * q).position
        np.testing.assert_allclose(shape[:, station], place, rtol=0, atol=1e-14)


def test_a_cantilever_bends_as_the_closed_form_says(condition):
    """w(x) = F x^2 (3 L - x) / (6 E I), which cubic shape functions and better hold exactly."""
    system = build_system(cantilever(reference=condition))
    state = static_equilibrium(system, consistent_state(system, system.mechanism.assembly()), [])
    shape = system_drawing(system, state.q[None]).shape[0] - [0.1, 0.2]
    x = np.linspace(0.0, LENGTH, 17)
    np.testing.assert_allclose(shape[:, 1], 0.02 * x**2 * (3 * LENGTH - x) / (6 * EI), rtol=0, atol=1e-10)
    # A straight line between its ends, were shape functions left out, is far off.
    assert np.max(np.abs(shape[:, 1] - shape[-1, 1] * x / LENGTH)) > 5e-6


def test_between_nodes_lies_the_quintic_of_displacement_slope_and_curvature():
    system = build_system(cantilever())
    body, q = system.bodies[0], bent(system)
    nodal = (body.integrals.D @ q[0, body.flexible]).reshape(-1, 4)
    q[0, :3] = 0.0
    found = system_drawing(system, q).shape[0]
    x, h = np.linspace(0.0, LENGTH, 17), LENGTH / 2
    for k in range(2):
        powers = np.arange(6)
        value = [0.0**powers, h**powers]
        slope = [powers * np.array([0.0, 1, 0, 0, 0, 0]), powers * h ** (powers - 1.0)]
        curvature = [[0, 0, 2, 0, 0, 0], powers * (powers - 1) * h ** (powers - 2.0)]
        rows = np.array([value[0], slope[0], curvature[0], value[1], slope[1], curvature[1]], dtype=float)
        quintic = np.linalg.solve(rows, np.concatenate([nodal[k, 1:], nodal[k + 1, 1:]]))
        own = slice(8 * k, 8 * k + 9)
        local = x[own] - k * h
        np.testing.assert_allclose(found[own, 1], local[:, None] ** powers @ quintic, rtol=0, atol=1e-13)
        along = nodal[k, 0] + (nodal[k + 1, 0] - nodal[k, 0]) * local / h
        np.testing.assert_allclose(found[own, 0], x[own] + along, rtol=0, atol=1e-13)


@pytest.mark.parametrize(("geometry", "order"), [(Geometry.SECOND_ORDER, 4), (Geometry.LINEAR, 2)])
def test_second_order_geometry_keeps_the_length_of_the_arc(geometry, order):
    """ds = 1 + w'^4 / 8 instead of 1 + w'^2 / 2: the error of the length falls with the fourth power of the slope."""
    system = build_system(cantilever(geometry=geometry))
    body = system.bodies[0]
    fine = Outline("beam", np.column_stack([np.linspace(0.0, LENGTH, 4001), np.zeros(4001)]), {})
    errors = []
    nodal = np.zeros(body.mesh.n_nodal)
    nodal[1::4], nodal[2::4], nodal[3::4] = (body.mesh.nodes**k for k in (2, 1, 0))
    nodal[2::4] *= 2.0
    nodal[3::4] *= 2.0
    for size in (0.2, 0.1):
        q = np.zeros((1, system.n))
        # The tip's own curvature is no coordinate: any bent shape near the parabola will do.
        q[0, body.flexible] = np.linalg.lstsq(body.integrals.D, size * nodal, rcond=None)[0]
        curve = outline_motion(system, fine, q)[0]
        errors.append(np.sum(np.linalg.norm(np.diff(curve, axis=0), axis=1)) - LENGTH)
    assert errors[0] > 1e-6
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


def test_a_bar_of_assumed_modes_is_a_sine():
    bar = AssumedModesBeam("bar", 0.8, SECTION, STEEL, transverse=(Sine(1),), points={"A": 0.0, "B": 0.8})
    mechanism = Mechanism(
        "bar", {"O": (0.0, 0.0)}, (bar,), (RevoluteJoint("O", PointRef("ground", "O"), PointRef("bar", "A")),)
    )
    system = build_system(mechanism)
    q = np.zeros((1, 4))
    q[0, 3] = 0.01 / system.bodies[0].integrals.D[0, 0]
    x = np.linspace(0.0, 0.8, 17)
    np.testing.assert_allclose(
        system_drawing(system, q).shape[0], np.column_stack([x, 0.01 * np.sin(np.pi * x / 0.8)]), rtol=0, atol=1e-15
    )


def test_a_rigid_body_is_drawn_round_its_points():
    points = {"a": (0.0, 0.0), "b": (1.0, 1.0), "c": (1.0, 0.0), "d": (0.0, 1.0)}
    drawn = outline(RigidBody("plate", 1.0, 1.0, (0.5, 0.5), points))
    np.testing.assert_array_equal(drawn.places[0], drawn.places[-1])
    assert len(drawn.places) == 5
    # Neighbours are a side apart, not a diagonal.
    np.testing.assert_allclose(np.linalg.norm(np.diff(drawn.places, axis=0), axis=1), 1.0)
    assert all(tuple(drawn.places[drawn.points[name]]) == place for name, place in points.items())
    bar = outline(RigidBody("bar", 1.0, 1.0, (0.5, 0.0), {"far": (1.0, 0.0), "near": (0.0, 0.0), "mid": (0.3, 0.0)}))
    assert np.all(np.diff(bar.places[:, 0]) * np.sign(bar.places[-1, 0] - bar.places[0, 0]) > 0.0)
    # A bob has its pivot and its mass.
    np.testing.assert_array_equal(
        outline(RigidBody("bob", 1.0, 1.0, (0.4, 0.0), {"O": (0.0, 0.0)})).places[-1], [0.4, 0]
    )
    assert len(outline(RigidBody("block", 1.0, 1.0, (0.0, 0.0), {"O": (0.0, 0.0)})).places) == 1


# --- Drawn stiff -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("geometry", list(Geometry))
@pytest.mark.parametrize("make", [make_linkage, pf.library.raparm_i], ids=["linkage", "RAParM-I"])
def test_joints_keep_together_however_much_is_magnified(make, geometry):
    mechanism = make() if make is pf.library.raparm_i else replace(make(), prescribed=(), assemblies=(LINKED,))
    system, q = closed(mechanism.with_geometry(geometry))
    drawn, stations = system_drawing(system, q), point_stations(mechanism)
    assert np.max(np.abs(drawn.shape - drawn.base)) > 1e-4
    for magnified in (0.0, 50.0):
        places = drawn.base + magnified * (drawn.shape - drawn.base)
        joints = drawn.joint_bases + magnified * (drawn.joints - drawn.joint_bases)
        for i, joint in enumerate(mechanism.joints):
            for ref in (joint.a, joint.b):
                if not ref.on_ground:
                    np.testing.assert_allclose(places[:, stations[ref]], joints[:, i], rtol=0, atol=1e-8)
                else:
                    np.testing.assert_allclose(joints[:, i], [mechanism.ground[ref.point]], rtol=0, atol=1e-8)


LINKED = Assembly("linked", {"crank": 0.6, "coupler": 0.1, "rocker": 2.0, "flap": 0.4})


def test_between_two_pins_a_link_is_straight_and_beyond_them_as_long_as_it_was():
    whole = make_linkage()
    mechanism = replace(
        whole,
        bodies=whole.bodies[:3],
        joints=whole.joints[:4],
        motors=whole.motors[:3],
        prescribed=(),
        assemblies=(Assembly("linked", {"crank": 0.6, "coupler": 0.1, "rocker": 2.0}),),
    )
    system, q = closed(mechanism)
    stations = point_stations(mechanism)
    base = system_drawing(system, q).base[0]
    p, knee, r = (stations[PointRef("coupler", name)] for name in "PQR")
    coupler = base[p : r + 1]
    direction = (coupler[knee - p] - coupler[0]) / np.linalg.norm(coupler[knee - p] - coupler[0])
    across = (coupler - coupler[0]) @ [-direction[1], direction[0]]
    np.testing.assert_allclose(across, 0.0, atol=1e-12)
    assert np.linalg.norm(coupler[-1] - coupler[knee - p]) == pytest.approx(0.25, abs=1e-12)


def test_a_cantilever_is_drawn_stiff_along_its_clamped_end(condition):
    """Whatever the floating frame: its angle differs by the slope there under other reference conditions."""
    system = build_system(cantilever(reference=condition))
    state = static_equilibrium(system, consistent_state(system, system.mechanism.assembly()), [])
    base = system_drawing(system, state.q[None]).base[0]
    x = np.linspace(0.0, LENGTH, 17)
    np.testing.assert_allclose(base, np.column_stack([0.1 + x, np.full(17, 0.2)]), rtol=0, atol=1e-10)


def test_a_body_held_at_three_corners_passes_through_them():
    corners = {"a": (0.0, 0.0), "b": (1.0, 0.0), "c": (0.2, 0.9), "middle": (0.4, 0.3)}
    points = {name: ModalPoint(place, [[0.0], [0.0]], [0.0]) for name, place in corners.items()}
    body = ModalBody(
        "plate", 1.0, (0.0, 0.0), 1.0, [[1.0]], [[1.0]], [[0.0], [0.0]], [0.0], [0.0], [[0.0]], points=points
    )
    drawn = outline(body)
    turned = np.exp(0.3j)
    z = drawn.places[:, 0] + 1j * drawn.places[:, 1]
    for off in (0.0, 0.01):
        places = 2.0 + turned * z[:3] + off * np.array([1.0, 1j, -1.0])
        base = stiff_shape(drawn, [Hold(z[[i]], places[[i]]) for i in range(3)], np.zeros(1))[0]
        found = base[:, 0] + 1j * base[:, 1]
        np.testing.assert_allclose(found[:3], places, rtol=0, atol=1e-13)
        assert abs(found[3] - 2.0 - turned * z[3]) <= (1e-13 if off == 0.0 else 0.01)


def test_what_slides_along_a_beam_stays_on_it():
    """A bead on a beam between two pins: drawn stiff the beam is straight, and the bead on it; magnified both move."""
    beam = FlexibleBeam("beam", 1.0, SECTION, STEEL, points={"A": 0.0, "B": 1.0}, elements=2)
    ref = PointRef.parse
    mechanism = Mechanism(
        name="bead",
        ground={"A": (0.0, 0.0), "B": (1.0, 0.0)},
        bodies=(beam, RigidBody("bead", 0.1, 1e-5, points={"C": (0.0, 0.0)})),
        joints=(
            RevoluteJoint("left", ref("ground.A"), ref("beam.A")),
            RevoluteJoint("right", ref("ground.B"), ref("beam.B")),
            SlidingJoint("wire", ref("beam.A"), ref("bead.C")),
        ),
        assemblies=(Assembly("level", {"beam": 0.0, "bead": 0.0}, {ref("bead.C"): (0.375, 0.0)}),),
    )
    system, q = closed(mechanism)
    drawn = system_drawing(system, q)
    bead = drawn.shape[0, -1]
    assert abs(bead[1]) > 1e-3
    for m in (0.0, 1.0, 50.0):
        places = drawn.base[0] + m * (drawn.shape - drawn.base)[0]
        np.testing.assert_allclose(places[-1], drawn.joint_bases[0, 2] + m * (drawn.joints - drawn.joint_bases)[0, 2])
        gap = np.interp(places[-1, 0], places[:17, 0], places[:17, 1]) - places[-1, 1]
        # It stands within a station's width of place 6 / 16, between stations.
        assert abs(gap) < 0.01 * m * abs(bead[1]) + 1e-12
    assert np.max(np.abs(drawn.base[0, :17, 1])) < 1e-12
    assert drawn.directions[0, 2] == pytest.approx(q[0, 2])
    assert np.isnan(drawn.directions[0, 0])


# --- In the datasets -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def short(raparm, square):
    """A run of RAParM-I, whole and cut into segments, and its plan."""
    task = pf.plan(raparm, square, duration=0.1, samples=21)
    options = IntegrationOptions(tolerance=1e-4)
    return task.simulate("++++", options=options), task.in_segments(6).simulate("++++", options=options)


def test_a_dataset_tells_shapes_of_links_whatever_they_were_cut_into(short):
    run, segments = short
    data, other = pf.tracking_dataset([run]), pf.tracking_dataset([segments])
    assert data.attrs["schema"] == 3
    assert data["shape"].dims == data["shape_base"].dims == ("mode", "time", "station", "axis")
    assert data["shape"].dtype == np.float32
    assert list(dict.fromkeys(data["station_body"].values)) == list(data["body"].values)
    assert set(data["joint_kind"].values) == {"pin"}
    assert int(data["joint_grounded"].sum()) == 4
    at_points = data["shape"].values[:, :, data["point_station"].values]
    np.testing.assert_allclose(at_points, data["point_position"].values, rtol=0, atol=1e-7)
    effector = list(data["point"].values).index(data.attrs["end_effector_point"])
    np.testing.assert_allclose(at_points[:, :, effector], data["end_effector"].values, rtol=0, atol=1e-7)
    assert other.sizes["station"] == data.sizes["station"]
    assert float(abs(data["shape"] - other["shape"]).max()) < 1e-3
    # Segments are straight: half a bend between their joints is missing, no more.
    assert float(abs(other["shape"] - other["shape_base"]).max()) > 1e-5


def test_runs_that_stop_have_no_shape_afterwards(raparm, square):
    task = pf.plan(raparm, square, duration=0.1, samples=21)
    with pytest.raises(pf.NumericalError) as caught:
        task.simulate("++++", options=IntegrationOptions(tolerance=1e-4, max_steps=40))
    data = pf.tracking_dataset([caught.value.partial])
    reached = np.isfinite(data["end_effector"].values[0, :, 0])
    assert 0 < reached.sum() < 21
    np.testing.assert_array_equal(np.isfinite(data["shape"].values[0, :, 0, 0]), reached)


def test_springs_are_told_where_they_hang():
    mechanism = cantilever(force=0.0)
    spring = LinearSpring("helper", PointRef("ground", "wall"), PointRef("beam", "tip"), 10.0, 0.5)
    data = motion_dataset(simulate_motion(replace(mechanism, linear_springs=(spring,)), 0.01, samples=3))
    assert list(data["spring_station"].values[0]) == [-1, data.sizes["station"] - 1]
    np.testing.assert_allclose(data["spring_position"].values[:, 0, 0], [[0.1, 0.2]] * 3, atol=1e-7)
    np.testing.assert_array_equal(data["spring_position"][:, 0, 1], data["shape"][:, -1])
    assert "mode" not in data["shape"].dims


# --- Files -----------------------------------------------------------------------------------------------------------


def test_files_are_compressed_and_come_back(short, tmp_path):
    data = pf.tracking_dataset([short[0]])
    data = xr.concat([data] * 20, "mode", data_vars="minimal")
    pf.save_results(data, tmp_path / "results.nc")
    data.to_netcdf(tmp_path / "plain.nc")
    assert (tmp_path / "results.nc").stat().st_size < (tmp_path / "plain.nc").stat().st_size
    for path in (tmp_path, tmp_path / "results.nc", str(tmp_path)):
        back = pf.open_results(path)
        assert back["shape"].equals(data["shape"])
        assert back["shape"].dtype == np.float32
        assert back["joint_grounded"].dtype == bool
    assert pf.load_results(tmp_path / "results.nc").identical(back)


def test_files_of_the_first_schema_stay_readable():
    data = pf.open_results(DATA / "schema1.nc")
    assert data.attrs["schema"] == 1
    assert "shape" not in data
    assert data["end_effector"].shape == (1, 5, 2)
    assert float(data["tracking_rms"][0]) >= 0.0


def test_what_is_no_result_is_named_for_what_it_is(tmp_path):
    def refused(path, message):
        with pytest.raises(InputError, match=message) as caught:
            pf.open_results(path)
        assert caught.value.remedy

    whole = (DATA / "schema1.nc").read_bytes()
    (tmp_path / "cut.nc").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "empty.nc").write_bytes(b"")
    (tmp_path / "summary.json").write_text("{}")
    refused(tmp_path / "cut.nc", "damaged: cut short")
    refused(tmp_path / "empty.nc", "an empty file")
    refused(tmp_path / "summary.json", "not a netCDF file")
    refused(tmp_path / "sumary.json", 'no such file or folder.*did you mean "summary.json"')
    refused(tmp_path, "no results in this folder")
    with netCDF4.Dataset(tmp_path / "weather.nc", "w") as foreign:
        foreign.title = "rain"
    refused(tmp_path / "weather.nc", "not of paraflex")
    shutil.copy(DATA / "schema1.nc", tmp_path / "later.nc")
    with netCDF4.Dataset(tmp_path / "later.nc", "a") as later:
        later.schema = SCHEMA + 1
        later.paraflex_version = "9.1.0"
    refused(tmp_path / "later.nc", rf"later version, paraflex 9\.1\.0 \(schema {SCHEMA + 1}.*update paraflex")


def test_the_folder_of_a_sweep_leads_to_its_runs(tmp_path):
    (tmp_path / "results.parquet").write_bytes(b"PAR1")
    with pytest.raises(InputError, match=r"many runs.*trajectories = true"):
        pf.open_results(tmp_path)
    with pytest.raises(InputError, match="a table of many runs"):
        pf.open_results(tmp_path / "results.parquet")
    (tmp_path / "trajectories").mkdir()
    shutil.copy(DATA / "schema1.nc", tmp_path / "trajectories" / "a1.nc")
    with pytest.raises(InputError, match=r"name one of its runs: trajectories/a1\.nc"):
        pf.open_results(tmp_path)
    assert "tracking_rms" in pf.open_results(tmp_path / "trajectories" / "a1.nc")
