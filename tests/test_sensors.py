"""Sensors: readings against closed forms, exact derivatives against differences, checks, files."""

import copy
import dataclasses
import math
import tomllib
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

import paraflex as pf
from paraflex.control.loop.inside import packed_readings
from paraflex.control.loop.readings import Readings
from paraflex.dynamics import (
    build_system,
    consistent_state,
    joint_coordinate,
    sensor_readings,
    sensor_rows,
    static_equilibrium,
)
from paraflex.dynamics.joint_loads import joint_loads
from paraflex.dynamics.modal_truncation import missing_rotations
from paraflex.dynamics.points import marker_position, point_motion
from paraflex.dynamics.state import reference_pose
from paraflex.elastodynamics import simulate_ked
from paraflex.errors import InputError
from paraflex.files import model_from
from paraflex.kernel.sampled import place_of
from paraflex.mechanism import SENSOR_KINDS, Encoder, Sensor, StrainGauge
from paraflex.mechanism.segments import in_frames
from paraflex.mechanism.sensors import Location
from paraflex.motion import simulate_motion
from paraflex.reports.motion import motion_page
from paraflex.results import motion_summary
from paraflex.results.export import result_tables
from paraflex.units import DisplayUnit

EVERYTHING = tomllib.loads("""
name = "everything"
gravity = [0.0, -9.81]

[parameters]
x = "0.1 m"
reach = "120 mm"

[section.bar]
width = 0.02
thickness = 0.005

[section.thin]
width = 0.02
thickness = 0.003

[material.aluminium]
youngs_modulus = 70e9
density = 2700

[ground]
O = [0.0, 0.0]
R = [0.3, 0.7]

[body.first]
type = "beam"
length = 0.5
section = ["bar", "thin"]
material = "aluminium"
points = { O = 0.0, M = 0.2, P = 0.5 }
elements = 2

[body.second]
type = "beam"
length = 0.4
section = "bar"
material = "aluminium"
points = { P = 0.0, E = 0.4 }
reference = "cantilever"

[body.block]
type = "rigid"
mass = 0.5
inertia = 1e-3
points = { C = [0.01, 0.02], D = [0.1, 0.0] }

[body.collar]
type = "rigid"
mass = 0.2
inertia = 1e-4
points = { K = [0.0, 0.0] }

[body.bar]
type = "assumed-modes"
length = 0.3
section = "thin"
material = "aluminium"
transverse_polynomials = [[0, 0, 1], [0, 0, 0, 1]]
axial_polynomials = [[0, 1]]
points = { A = 0.0, T = 0.3 }

[joint]
A = ["ground.O", "first.O"]
B = ["first.P", "second.P"]

[joint.rail]
type = "prismatic"
points = ["second.E", "block.C"]
direction = 0.3

[joint.track]
type = "sliding"
points = ["first.O", "collar.K"]

[joint.foot]
type = "weld"
points = ["block.D", "bar.A"]

[joint.slot]
type = "slot"
points = ["ground.R", "bar.T"]

[motor]
drive = "A"
push = "rail"
elbow = "B"

[spring.hinge]
joint = "B"
stiffness = 2.0

[damper.rail]
joint = "rail"
coefficient = 1.0

[friction.track]
joint = "track"
limit = 0.5
speed = 0.01

[gear.mesh]
joints = ["A", "B"]
ratio = -0.5

[assembly.start]
first = 0.3
second = 0.8
block = 1.0
collar = 0.0
bar = 1.0
points = { "collar.K" = [0.2, 0.06] }

[sensor]
angle = { type = "encoder", joint = "B" }
travel = { type = "encoder", joint = "rail" }
slid = { type = "encoder", joint = "track" }
rate = { type = "tachometer", joint = "A" }
speed = { type = "tachometer", joint = "rail" }
place = { type = "position", point = "second.E", axis = "x" }
seen = { type = "position", point = "bar.T", axis = "y", body = "first" }
velocity = { type = "velocity", point = "first.M", axis = "30 deg" }
carried = { type = "velocity", point = "block.D", axis = 0.4, body = "second" }
shaken = { type = "acceleration", point = "first.P", axis = "y", body = "first" }
heavy = { type = "acceleration", point = "bar.T", axis = "x" }
gauge = { type = "strain", body = "first", at = "reach" }
step = { type = "strain", body = "first", at = "M", distance = "-1 mm" }
root = { type = "strain", body = "bar", at = 0.0 }
pull = { type = "joint_force", joint = "track", axis = "y" }
pushed = { type = "joint_force", joint = "rail", axis = "along" }
turned = { type = "joint_force", joint = "B", axis = "moment" }
held = { type = "joint_force", joint = "slot", axis = 0.7 }
welded = { type = "joint_force", joint = "foot", axis = "moment" }
bent = { type = "deflection", point = "first.M", axis = "y" }
short = { type = "deflection", point = "second.E", axis = "x" }
slope = { type = "deflection", point = "second.E", axis = "angle" }
stiff = { type = "deflection", point = "block.D", axis = "x" }
""")


def everything(geometry="second-order", **changed):
    data = copy.deepcopy(EVERYTHING) | {"geometry": geometry}
    for name, fields in changed.items():
        data["sensor"][name] |= fields
    return model_from(data, "everything.toml").mechanism


def any_state(system, seed=1):
    """Coordinates, derivatives, multipliers and torques, none of them zero: readings ask for no consistent state."""
    random = np.random.default_rng(seed)
    q, v, a = random.normal(size=(3, system.n))
    for body in system.bodies:
        # Of the size of real deflections: u ~ 1e-2 m.
        q[body.flexible] *= 1e-3
        q[body.position] *= 0.2
    return q, v, a, 10.0 * random.normal(size=system.m), random.normal(size=len(system.mechanism.motors))


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
def test_rows_are_the_derivatives_of_readings(geometry):
    mechanism = everything(geometry)
    assert {sensor.kind for sensor in mechanism.sensors} == set(SENSOR_KINDS)
    system = build_system(mechanism)
    state = any_state(system)
    rows = sensor_rows(system, *state)
    # Readings are at most quadratic in all but q.
    steps = [1e-6, 0.1, 1.0, 1.0, 1.0]
    for k, (name, matrix, step) in enumerate(zip(rows._fields, rows, steps, strict=True)):
        assert matrix.shape == (len(mechanism.sensors), state[k].size)
        moved = [np.tile(each, (2 * state[k].size, 1)) for each in state]
        moved[k] += step * np.vstack([np.eye(state[k].size), -np.eye(state[k].size)])
        ahead, behind = np.split(sensor_readings(system, *moved), 2)
        differences = (ahead - behind).T / (2.0 * step)
        scale = 1.0 + np.max(np.abs(differences), axis=1, keepdims=True)
        assert np.max(np.abs(matrix.toarray() - differences) / scale) < 2e-7, name
    assert min(rows.multipliers.nnz, rows.torques.nnz, rows.a.nnz) > 0


def test_rows_touch_only_what_a_sensor_depends_on():
    system = build_system(everything())
    rows = sensor_rows(system, *any_state(system))
    names = [sensor.name for sensor in system.mechanism.sensors]
    touched = {
        name: {body.name for body in system.bodies if rows.q[[i], :][:, range(body.all.start, body.all.stop)].nnz}
        for i, name in enumerate(names)
    }
    assert touched["angle"] == {"first", "second"}
    assert touched["place"] == {"second"}
    assert touched["seen"] == {"first", "bar"}
    assert touched["gauge"] == {"first"}
    assert touched["stiff"] == set()


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
def test_the_place_of_a_point_in_kernels_at_an_instant_and_over_time_is_one(geometry):
    system = build_system(everything(geometry))
    readings = Readings(system, [sensor for sensor in system.mechanism.sensors if sensor.name == "place"])
    (place,), (point, _) = readings.places, readings.sensors[0].fixed_point
    assert (place.marker.bending is not None) == (geometry == "second-order")
    q = np.array([any_state(system, seed)[0] for seed in range(5)])
    law = SimpleNamespace(**packed_readings(readings))
    kernel = [place_of.py_func(law, 0, each) for each in q]
    over_time = marker_position(system, place.marker, q)
    assert kernel == pytest.approx([over_time[k] @ place.axis for k in range(5)], rel=1e-14)
    assert np.array([marker_position(system, place.marker, each) for each in q]) == pytest.approx(over_time, rel=1e-14)
    assert point_motion(system, point, q, q, q).position == pytest.approx(over_time, rel=1e-14)


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
def test_readings_are_what_the_package_gives_elsewhere(geometry):
    mechanism = everything(geometry)
    system = build_system(mechanism)
    q, v, a, multipliers, torques = (each[None] for each in any_state(system))
    found = dict(zip([one.name for one in mechanism.sensors], sensor_readings(system, q, v, a, multipliers, torques)[0],
                     strict=True))  # fmt: skip
    assert found["travel"] == pytest.approx(joint_coordinate(system, "rail", q).value[0], rel=1e-12)
    assert found["speed"] == pytest.approx(joint_coordinate(system, "rail", q, v).rate[0], rel=1e-12)
    tip = point_motion(system, pf.PointRef("first", "P"), q, v, a)
    phi = q[0, system.body("first").angle]
    assert found["shaken"] == pytest.approx(tip.acceleration[0] @ [-math.sin(phi), math.cos(phi)], rel=1e-12)
    loads = joint_loads(system, ["track", "rail", "B", "slot"], q, multipliers, torques)
    assert found["pull"] == pytest.approx(loads.force[0, 0, 1], rel=1e-12)
    assert found["turned"] == pytest.approx(loads.moment[0, 2], rel=1e-12)
    assert found["held"] == pytest.approx(loads.force[0, 3] @ [math.cos(0.7), math.sin(0.7)], rel=1e-12)
    E = point_motion(system, pf.PointRef("second", "E"), q, v, a).position[0]
    second = system.body("second")
    c, s = math.cos(q[0, second.angle]), math.sin(q[0, second.angle])
    away = E - q[0, second.position]
    first, T = system.body("first"), point_motion(system, pf.PointRef("bar", "T"), q, v, a).position[0]
    apart = T - q[0, first.position]
    assert found["seen"] == pytest.approx(-math.sin(phi) * apart[0] + math.cos(phi) * apart[1], rel=1e-12)
    assert found["short"] == pytest.approx(c * away[0] + s * away[1] - 0.4, abs=1e-15)
    assert abs(found["short"]) > 1e-7


PENDULUM = tomllib.loads("""
name = "pendulum"
gravity = [0.0, -9.81]

[section.bar]
width = 0.02
thickness = 0.005

[material.aluminium]
youngs_modulus = 70e9
density = 2700

[ground]
O = [0.0, 0.0]

[body.rod]
type = "beam"
length = 0.5
section = "bar"
material = "aluminium"
points = { O = 0.0, T = 0.5 }
elements = 2

[joint]
O = ["ground.O", "rod.O"]

[motor]
drive = "O"

[assembly.start]
rod = 0.3

[sensor]
angle = { type = "encoder", joint = "O" }
rate = { type = "tachometer", joint = "O" }
along = { type = "acceleration", point = "rod.T", axis = "x", body = "rod" }
across = { type = "acceleration", point = "rod.T", axis = "y", body = "rod" }
height = { type = "position", point = "rod.T", axis = "y" }
radius = { type = "position", point = "rod.T", axis = "x", body = "rod" }
velocity = { type = "velocity", point = "rod.T", axis = "y", body = "rod" }
tension = { type = "joint_force", joint = "O", axis = "x" }
torque = { type = "joint_force", joint = "O", axis = "moment" }
strain = { type = "strain", body = "rod", at = 0.2 }
""")


def readings_of(run, torque=0.0):
    """Readings of a run (time, sensors) by the names of sensors."""
    solution, mechanism = run.solution, run.system.mechanism
    torques = np.full((len(solution.q), len(mechanism.motors)), torque)
    found = sensor_readings(run.system, solution.q, solution.v, solution.a, solution.multipliers, torques)
    return {sensor.name: found[:, k] for k, sensor in enumerate(mechanism.sensors)}


def test_a_rigid_pendulum():
    """A uniform rod that swings: theta'' = -3 g cos(theta) / 2 l, energy, force of the bearing on the rod."""
    mechanism = model_from(PENDULUM, "pendulum.toml").mechanism
    options = pf.IntegrationOptions(tolerance=1e-12)
    read = readings_of(simulate_motion(mechanism.rigid(), 0.4, samples=41, options=options))
    g, length, theta = 9.81, 0.5, read["angle"]
    assert theta[0] == pytest.approx(0.3, abs=1e-12)
    assert np.ptp(theta) > 1.0
    turning = -1.5 * g / length * np.cos(theta)
    squared = 3.0 * g / length * (np.sin(0.3) - np.sin(theta))
    # Accelerations come from the last stage of a step.
    close = {"rel": 1e-6, "abs": 1e-5}
    assert read["rate"] ** 2 == pytest.approx(squared, **close)
    assert read["along"] == pytest.approx(-length * squared, **close)
    assert read["across"] == pytest.approx(length * turning, **close)
    assert read["height"] == pytest.approx(length * np.sin(theta), **close)
    assert read["radius"] == pytest.approx(length, **close)
    assert read["velocity"] == pytest.approx(length * read["rate"], **close)
    mass = 2700 * 0.02 * 0.005 * length
    centre = 0.5 * length * (-squared * np.cos(theta) - turning * np.sin(theta))
    assert read["tension"] == pytest.approx(mass * centre, **close)
    assert np.max(np.abs(read["torque"])) < 1e-9
    assert np.all(read["strain"] == 0.0)


def test_strain_of_a_spinning_rod():
    """Of a rod that spins steadily N(x) = rho A w^2 (l^2 - x^2) / 2, which one element's stretch has in the mean."""
    data = copy.deepcopy(PENDULUM) | {"gravity": [0.0, 0.0]}
    data["body"]["rod"]["elements"] = 1
    data["sensor"]["strain"] |= {"at": 0.0, "distance": 0.0}
    system = build_system(model_from(data, "spun.toml").mechanism)
    state = consistent_state(system, system.mechanism.assemblies[0])
    body, w, length, density, modulus = system.body("rod"), 40.0, 0.5, 2700, 70e9
    v, a = np.zeros(system.n), np.zeros(system.n)
    v[body.angle] = w
    # The mean stretch, rho w^2 l^2 / 3 E, by the shape of the undamped axial equilibrium.
    q = state.q.copy()
    loads = [weight * density * 1e-4 * w**2 * x * body.mesh.shape_at(x)[0][0] for x, weight in gauss(length)]
    q[body.flexible] = np.sum(loads, axis=0) @ body.integrals.D / body.modes.omega**2
    tip = system.marker(pf.PointRef("rod", "T")).N[0]
    mean = density * w**2 * length**2 / (3.0 * modulus)
    assert tip @ q[body.flexible] == pytest.approx(mean * length, rel=1e-9)
    read = sensor_readings(system, *(x[None] for x in (q, v, a, np.zeros(system.m), np.zeros(1))))[0, -1]
    # The stretch itself moves the mass outwards.
    assert read == pytest.approx(density * w**2 * length**2 / (2.0 * modulus), rel=1e-5)


def gauss(length):
    x, weights = np.polynomial.legendre.leggauss(4)
    return zip(0.5 * length * (x + 1.0), 0.5 * length * weights, strict=True)


CANTILEVER = """
name = "cantilever"

[section.bar]
width = 0.02
thickness = 0.005

[material.aluminium]
youngs_modulus = 70e9
density = 2700

[ground]
O = [0.0, 0.0]

[body.beam]
type = "beam"
length = 0.4
section = "bar"
material = "aluminium"
points = { O = 0.0, T = 0.4 }
elements = 2

[joint.clamp]
type = "weld"
points = ["ground.O", "beam.O"]

[load.end]
type = "force"
point = "beam.T"
force = [300.0, -1.5]

[assembly.start]
beam = 0.0

[sensor]
upper = { type = "strain", body = "beam", at = "150 mm" }
lower = { type = "strain", body = "beam", at = "150 mm", distance = "-2.5 mm" }
core = { type = "strain", body = "beam", at = "O", distance = 0.0 }
sag = { type = "deflection", point = "beam.T", axis = "y" }
slope = { type = "deflection", point = "beam.T", axis = "angle" }
longer = { type = "deflection", point = "beam.T", axis = "x" }
"""


def test_a_cantilever_under_an_end_load():
    """Statics: M(x) = F (l - x), N constant; the load's tension moves the linear model's equilibrium little."""
    data = tomllib.loads(CANTILEVER) | {"geometry": "linear", "reference": "cantilever"}
    mechanism = model_from(data, "cantilever.toml").mechanism
    system = build_system(mechanism)
    found = static_equilibrium(system, consistent_state(system, mechanism.assemblies[0]))
    zero = np.zeros((1, system.n))
    read = dict(zip([one.name for one in mechanism.sensors],
                    sensor_readings(system, found.q[None], zero, zero, np.zeros((1, system.m)), np.zeros((1, 0)))[0],
                    strict=True))  # fmt: skip
    E, area, moment_of_area, length = 70e9, 1e-4, 0.02 * 0.005**3 / 12.0, 0.4
    bending = 0.0025 * (-1.5 * 0.25) / (E * moment_of_area)
    tension = 300.0 / (E * area)
    assert read["upper"] == pytest.approx(tension - bending, rel=1e-9)
    assert read["lower"] == pytest.approx(tension + bending, rel=1e-9)
    assert read["upper"] > 0.0 > read["lower"]
    assert read["core"] == pytest.approx(tension, rel=1e-9)
    assert read["sag"] == pytest.approx(-1.5 * length**3 / (3.0 * E * moment_of_area), rel=1e-9)
    assert read["slope"] == pytest.approx(-1.5 * length**2 / (2.0 * E * moment_of_area), rel=1e-9)
    assert read["longer"] == pytest.approx(tension * length, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "fields", "says"),
    [
        ("angle", {"joint": "C"}, "sensor.angle.joint: unknown joint (got 'C'); choose from"),
        ("angle", {"joint": "foot"}, "sensor.angle.joint: a weld does not move (got 'foot'); name another joint"),
        ("place", {"point": "second.X"}, "sensor.place.point: unknown point (got 'second.X'); choose from P, E"),
        ("place", {"point": "ground.O"}, "sensor.place.point: the ground does not move"),
        ("place", {"axis": "z"}, "sensor.place.axis: neither a known word nor a number (got 'z'); give \"x\", \"y\""),
        ("place", {"axis": "3 mm"}, "sensor.place.axis: a quantity in m where one in rad is asked for"),
        ("seen", {"body": "frist"}, "sensor.seen.body: unknown body (got 'frist'); did you mean \"first\"?"),
        ("gauge", {"at": 0.6}, "sensor.gauge.at: the place lies beyond the beam's end (got 0.6); choose it between 0"),
        ("gauge", {"at": "Q"}, "sensor.gauge.at: unknown point of the beam (got 'Q'); choose from O, M, P"),
        ("gauge", {"body": "block"}, "sensor.gauge.body: strain is measured on beams (got 'block'); choose from"),
        ("pushed", {"joint": "B"}, "sensor.pushed.axis: a revolute joint has no axis to measure along (got 'along')"),
        ("held", {"axis": "angle"}, "sensor.held.axis: neither a known word nor a number (got 'angle')"),
        ("bent", {"axis": 0.3}, "sensor.bent.axis: should be 'x', 'y' or 'angle' (got 0.3)"),
        ("angle", {"type": "encode"}, "sensor.angle.type: unknown type (got 'encode'); did you mean \"encoder\"?"),
    ],
)  # fmt: skip
def test_what_cannot_be_measured_is_refused(name, fields, says):
    with pytest.raises(pf.InputError) as error:
        everything(**{name: fields})
    assert says in str(error.value)


def test_sensors_made_in_python_are_checked_too():
    mechanism = everything()
    beams = [body for body in mechanism.bodies if body.name == "second"]
    bare = mechanism.with_bodies([dataclasses.replace(beams[0], section=pf.Section(1e-4, 2e-10))])
    system = build_system(bare)
    state = [each[None] for each in any_state(system)]
    with pytest.raises(pf.InputError, match=r"sensor.s.distance: the outermost fibre of the section is not known"):
        sensor_readings(system, *state, sensors=[pf.StrainGauge("s", "second", 0.1)])
    with pytest.raises(pf.InputError, match=r"sensor.e.joint: unknown joint"):
        sensor_readings(system, *state, sensors=[pf.Encoder("e", "Q")])
    with pytest.raises(
        pf.InputError, match=r'sensor.p.axis: not an axis \(got \'z\'\); give "x", "y" or an angle in rad'
    ):
        sensor_readings(system, *state, sensors=[pf.PositionSensor("p", "first.P", "z")])
    with pytest.raises(pf.InputError, match=r"sensor: duplicate name"):
        dataclasses.replace(mechanism, sensors=[pf.Encoder("e", "A"), pf.Encoder("e", "B")])
    assert sensor_readings(system, *state, sensors=[pf.StrainGauge("s", "second", 0.1, 0.001)]).shape == (1, 1)


def test_units():
    mechanism = everything()
    units = dict(zip([sensor.name for sensor in mechanism.sensors], mechanism.sensor_units(), strict=True))
    assert [units[name] for name in ("angle", "travel", "slid", "rate", "speed")] == ["rad", "m", "m", "rad/s", "m/s"]
    assert [units[name] for name in ("place", "carried", "shaken", "gauge")] == ["m", "m/s", "m/s^2", "1"]
    assert [units[name] for name in ("pull", "turned", "bent", "slope")] == ["N", "N m", "m", "rad"]


def test_a_model_with_sensors_is_read_back_equal(tmp_path):
    mechanism = everything()
    # An axis is a word though a parameter is called so, and a place may be a parameter or a point.
    assert mechanism.sensors[5].axis == "x"
    assert [sensor.at for sensor in mechanism.sensors if sensor.kind == "strain"] == [0.12, "M", 0.0]
    mechanism.save(tmp_path / "saved.toml")
    assert pf.load(tmp_path / "saved.toml").mechanism == mechanism


def test_sensors_do_not_act():
    mechanism = everything()
    plain = dataclasses.replace(mechanism, sensors=())
    assert build_system(mechanism).rows == build_system(plain).rows
    # A sensor turns nothing that a reduced beam could not follow.
    few = dataclasses.replace(model_from(PENDULUM, "p.toml").mechanism.with_beams(modes=1), motors=())
    assert not missing_rotations(build_system(few))


def test_a_motion_holds_its_readings(tmp_path):
    mechanism = model_from(PENDULUM, "pendulum.toml").mechanism
    run = simulate_motion(mechanism, 0.05, samples=6, torques={"drive": 0.05})
    data = pf.motion_dataset(run)
    readings = data["sensor_reading"]
    assert list(readings["sensor"].values) == [sensor.name for sensor in mechanism.sensors]
    assert readings.attrs["units_each"].split(", ") == list(mechanism.sensor_units())
    for name, values in readings_of(run, 0.05).items():
        np.testing.assert_array_equal(readings.sel(sensor=name), values)
    np.testing.assert_allclose(readings.sel(sensor="angle"), data["joint_coordinate"].sel(joint="O"), rtol=1e-12)
    tip = data["point_acceleration"].sel(point="rod.T")
    phi = data["angle"].sel(body="rod")
    across = np.cos(phi) * tip.sel(axis="y") - np.sin(phi) * tip.sel(axis="x")
    np.testing.assert_allclose(readings.sel(sensor="across"), across, rtol=1e-9)
    np.testing.assert_allclose(readings.sel(sensor="torque"), 0.05, rtol=1e-9)

    pf.save_results(data, tmp_path / "run.nc")
    read = pf.load_results(tmp_path / "run.nc")
    found = motion_summary(read)["sensors"]
    assert found["strain"] == {"largest": float(np.max(np.abs(readings.sel(sensor="strain")))), "unit": "1"}
    assert found["rate"]["unit"] == "rad/s"
    units = result_tables(read)["time_series"].attrs["units"]
    assert units["sensor_reading_angle"] == "rad"
    assert units["sensor_reading_tension"] == "N"
    assert units["sensor_reading_strain"] == ""
    (panel,) = [panel for panel in motion_page(read).panels if panel.title == "Sensors"]
    assert len(panel.charts) == len(set(mechanism.sensor_units()))
    strain = next(chart for chart in panel.charts if chart.title == "Sensors: strain")
    assert (strain.y.name, strain.y.shown) == ("strain", DisplayUnit("µm/m", 1e6))
    panels = [panel for panel in pf.plots.sensors(read).axes if panel.get_visible()]
    assert len(panels) == len(set(mechanism.sensor_units()))
    strain = next(panel for panel in panels if panel.get_ylabel() == "strain [µm/m]")
    np.testing.assert_allclose(strain.get_lines()[0].get_ydata(), 1e6 * readings.sel(sensor="strain"))


def test_a_mechanism_without_sensors_has_no_readings():
    data = copy.deepcopy(PENDULUM)
    del data["sensor"]
    found = pf.motion_dataset(simulate_motion(model_from(data, "p.toml").mechanism.rigid(), 0.01, samples=3))
    assert "sensor_reading" not in found
    assert "sensor" not in found.dims
    assert "sensors" not in motion_summary(found)
    assert "Sensors" not in [panel.title for panel in motion_page(found).panels]
    with pytest.raises(pf.InputError, match="sensor"):
        pf.plots.sensors(found)


@pytest.fixture(scope="module")
def short_task():
    """A flexible 5R on a short line, with sensors."""
    model = pf.load("five_bar")
    first = model.mechanism.joints[0]
    link, point = (
        first.b.body,
        next(name for name in model.mechanism.body(first.b.body).points if name != first.b.point),
    )
    end = f"{link}.{point}"
    sensors = (
        pf.Encoder("angle", first.name), pf.PositionSensor("place", end, "x"),
        pf.JointForceSensor("pull", first.name, "y"), pf.StrainGauge("strain", link, 0.1, 0.001),
        pf.AccelerationSensor("felt", end, "y", link), pf.DeflectionSensor("bent", end, "x"),
    )  # fmt: skip
    mechanism = dataclasses.replace(model.mechanism, sensors=sensors)
    return pf.plan(mechanism, model.path("line"), duration=0.02, samples=5)


def test_finite_segments_measure_what_has_a_meaning_in_them(short_task):
    data = pf.tracking_dataset([short_task.in_segments(4).simulate("++")]).isel(mode=0)
    known = np.isfinite(data["sensor_reading"].values).all(axis=0)
    assert dict(zip(data["sensor"].values, known, strict=True)) == {
        "angle": True, "place": True, "pull": True, "strain": False, "felt": False, "bent": False,
    }  # fmt: skip
    whole = pf.tracking_dataset([short_task.simulate("++")]).isel(mode=0)
    assert np.isfinite(whole["sensor_reading"].values).all()
    for name in ("angle", "place"):
        here, there = (each["sensor_reading"].sel(sensor=name) for each in (data, whole))
        np.testing.assert_allclose(here, there, rtol=1e-2)


def test_kineto_elastodynamics_and_rigid_links_are_measured(short_task):
    ked = pf.tracking_dataset([simulate_ked(short_task, "++")]).isel(mode=0)
    assert np.isfinite(ked["sensor_reading"].values).all()
    assert np.max(np.abs(ked["sensor_reading"].sel(sensor="strain"))) > 0.0
    # The motors are held to the planned motion.
    np.testing.assert_allclose(
        ked["sensor_reading"].sel(sensor="angle"), ked["joint_coordinate"].isel(joint=0), rtol=1e-12
    )
    rigid = short_task.remodelled(short_task.mechanism.rigid())
    found = pf.tracking_dataset([rigid.simulate("++")])["sensor_reading"].isel(mode=0)
    assert np.all(found.sel(sensor="strain") == 0.0)


@pytest.fixture
def own():
    """Kinds of sensors that a test defines are known within it only."""
    before = dict(SENSOR_KINDS)
    yield
    SENSOR_KINDS.clear()
    SENSOR_KINDS.update(before)


def two_points(read, location=None):
    """A sensor of a user's own: something between two points of the pendulum's rod."""

    @dataclass(frozen=True)
    class RefinedTimes(Sensor, kind="between", units=("m",)):
        point: pf.PointRef

        def read(self, moving):
            return read(moving.position(self.point))

        @property
        def location(self):
            return Location(point=self.point) if location is None else location

    return RefinedTimes("own", pf.PointRef("rod", "T"))


def pendulum_with(sensor):
    mechanism = model_from(PENDULUM, "pendulum.toml").mechanism
    return replace(mechanism, sensors=(*mechanism.sensors, sensor))


def test_a_reading_that_divides_by_a_distance_has_derivatives_and_is_not_taken_for_linear(own):
    """The tip's distance from where it is at zero coordinates, at which the reading is 0/0."""

    def read(place):
        apart = place - np.array([0.5, 0.0])
        return apart[:, 0] ** 2 / np.sqrt(np.sum(apart**2, axis=1))

    sensor = two_points(read)
    system = build_system(pendulum_with(sensor).rigid())
    assert Readings(system, [sensor]).linear == []
    q = reference_pose(system, system.mechanism.assembly("start"))
    still = np.zeros(system.n)
    rows = sensor_rows(system, q, still, still, np.zeros(system.m), np.zeros(1), [sensor])
    dx, dy = 0.5 * np.cos(0.3) - 0.5, 0.5 * np.sin(0.3)
    r = math.hypot(dx, dy)
    assert rows.q.toarray()[0, :2] == pytest.approx([2.0 * dx / r - dx**3 / r**3, -(dx**2) * dy / r**3], rel=1e-9)


@pytest.mark.parametrize(
    ("read", "says"),
    [
        (lambda place: place, r"sensor.own: its `read` returns an array of the shape \(1, 2\)"),
        (lambda place: 1.0, r"shape \(\)"),
        (lambda place: np.linalg.norm(place, axis=1), "its `read` returns real numbers for complex ones"),
        (lambda place: np.abs(place[:, 0]), "its `read` returns real numbers for complex ones"),
    ],
)
def test_what_a_sensor_of_a_users_own_returns_is_checked(own, read, says):
    sensor = two_points(read)
    system = build_system(pendulum_with(sensor))
    with pytest.raises(InputError, match=says):
        sensor_rows(system, *any_state(system), [sensor])


@pytest.mark.parametrize(
    ("location", "says"),
    [
        (Location(), "sensor.own.location.joint: unknown joint"),
        (Location(joint="nope"), "sensor.own.location.joint: unknown joint"),
        (Location(point=pf.PointRef("rod", "ZZ")), "unknown point"),
        (Location(joint="O", frame="nob"), "sensor.own.location.frame: unknown body"),
    ],
)
def test_the_location_of_a_sensor_exists(own, location, says):
    with pytest.raises(InputError, match=says):
        pendulum_with(two_points(lambda place: place[:, 0], location))


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (lambda apart: np.sqrt(np.sum(apart**2, axis=1)), "sensor.own: its reading has no derivative here"),
        (lambda apart: apart[:, 0] / apart[:, 1], "sensor.own: its reading is no number here"),
    ],
)
def test_a_reading_without_a_derivative_is_refused_with_its_name(own, read, message):
    """A distance where it is zero, and a number divided by zero."""
    sensor = two_points(lambda place: read(place - place.real))
    system = build_system(pendulum_with(sensor))
    with np.errstate(all="ignore"), pytest.raises(InputError, match=message):
        sensor_rows(system, *any_state(system), [sensor])


def test_kinds_of_sensors_have_a_name_of_their_own_and_a_unit(own):
    with pytest.raises(TypeError, match="there is a sensor of kind"):

        class Other(Sensor, kind="encoder", units=("rad",)):
            pass

    with pytest.raises(TypeError, match=r'units=\("m/s",\)'):

        class Text(Sensor, kind="text", units="m/s"):  # pyright: ignore[reportArgumentType]
            pass

    with pytest.raises(TypeError, match="has no unit"):

        class Unitless(Sensor, kind="unitless"):
            pass


def test_sensors_inside_beams_of_several_frames_are_moved_or_refused(own):
    @dataclass(frozen=True)
    class Bridge(Sensor, kind="bridge", units=("1",), rigid=False):
        body: str
        at: float
        other: float

        def read(self, moving):
            return moving.strain(self.body, self.at, None) - moving.strain(self.body, self.other, None)

        @property
        def location(self):
            return Location(at=self.at, axis="own", frame=self.body)

    bridge = Bridge("own", "rod", 0.05, 0.4)
    rod = replace(pendulum_with(bridge).body("rod"), frames=2)
    kept = (Encoder("angle", "O"), StrainGauge("one", "rod", 0.4))
    whole = replace(pendulum_with(bridge), bodies=(rod,), sensors=kept)
    assert [one.location.frame for one in in_frames(whole).sensors] == ["ground", "rod_2"]
    with pytest.raises(InputError, match=r"sensor.own: measures in a beam of several frames"):
        in_frames(replace(whole, sensors=(*kept, bridge)))
