"""Loads in the results of every run: joints, drives, the ground, stresses, and where they are reported."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import paraflex as pf
from paraflex.designs.measure import measure
from paraflex.dynamics import build_system, consistent_state, momentum, static_equilibrium
from paraflex.dynamics.state import State
from paraflex.errors import InputError
from paraflex.formatting import number
from paraflex.mechanism import (
    Assembly,
    ConstantSpeed,
    LinearSpring,
    Mechanism,
    Motor,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
)
from paraflex.motion import simulate_motion
from paraflex.reports import motion_page, tracking_page
from paraflex.results import load_results, motion_dataset, motion_summary, save_results, summary, tracking_dataset
from paraflex.results.export import result_tables
from paraflex.results.loads import effort_lines, joint_line, load_figures, stress_line
from paraflex.tracking import plan_tracking
from paraflex.units import DisplayUnit
from short_studies import check_derivatives, stress_study

OPTIONS = pf.IntegrationOptions(tolerance=1e-7)


@pytest.fixture(scope="module")
def crank():
    """A crank that turns at a constant speed, a flexible rod, a slider on a rail; a spring from it to the ground."""
    mechanism = pf.load("slider_crank_flexible").mechanism
    spring = LinearSpring("coil", PointRef("ground", "O"), PointRef("slider", "B"), 300.0, 0.1, 2.0)
    mechanism = replace(mechanism, linear_springs=(spring,))
    strong = [replace(body, material=replace(body.material, strength=3e7)) if hasattr(body, "material") else body
              for body in mechanism.bodies]  # fmt: skip
    return simulate_motion(replace(mechanism, bodies=tuple(strong)), 0.02, samples=401, options=OPTIONS)


@pytest.fixture(scope="module")
def data(crank):
    return motion_dataset(crank)


def test_a_prescribed_motion_has_its_torque_speed_and_power(crank, data):
    moment = data["joint_moment"].sel(joint="O")
    np.testing.assert_allclose(data["drive_torque"].sel(drive="drive"), moment, rtol=1e-12)
    # Velocities keep constraints to what the tolerance allows, 1e-7 m in 0.02 s or 5e-6 m/s, on a crank of 0.15 m.
    np.testing.assert_allclose(data["drive_speed"].sel(drive="drive"), 150.0, rtol=2e-7)
    np.testing.assert_allclose(data["drive_power"], data["drive_torque"] * data["drive_speed"])
    assert data["drive_torque"].attrs["units"] == "N m"
    # It does all the work that is stored or damped by the spring.
    power = data["drive_power"].sel(drive="drive").values
    done = np.trapezoid(power, data["time"])
    stored = (data["kinetic_energy"] + data["strain_energy"]).values
    speed = data["joint_speed"].sel(joint=slider_joint(data)).values
    damped = np.trapezoid(2.0 * speed**2, data["time"])
    assert done == pytest.approx(stored[-1] - stored[0] + damped, rel=5e-3)


def test_every_effort_has_its_unit():
    """A motor that turns and one that slides, and two prescribed motions so, in lines, summary and on the page."""
    bodies = tuple(RigidBody(name, 1.0, 0.1, (0.0, 0.0), {"A": (0.0, 0.0)}) for name in ("a", "b", "c", "d"))
    joints = (
        *(RevoluteJoint(name, PointRef("ground", "O"), PointRef(name, "A")) for name in ("a", "c")),
        *(PrismaticJoint(name, PointRef("ground", "O"), PointRef(name, "A")) for name in ("b", "d")),
    )
    mechanism = Mechanism(
        name="four",
        ground={"O": (0.0, 0.0)},
        bodies=bodies,
        joints=joints,
        motors=(Motor("lift", "b"), Motor("turn", "a")),
        prescribed=(
            PrescribedAngle("push", "d", ConstantSpeed(0.0, 2.0)),
            PrescribedAngle("spin", "c", ConstantSpeed(0.0, 3.0)),
        ),
        assemblies=(Assembly("start", dict.fromkeys("abcd", 0.0)),),
    )
    run = simulate_motion(mechanism, 0.1, samples=3, torques={"lift": 5.0, "turn": 0.2}, options=OPTIONS)
    data = motion_dataset(run)
    loads = load_figures(data)
    units = {
        name: (one["torque_unit"], one["speed_unit"]) for name, one in {**loads["motors"], **loads["drives"]}.items()
    }
    turns, slides = ("N m", "rad/s"), ("N", "m/s")
    assert units == {"lift": slides, "turn": turns, "push": slides, "spin": turns}
    push, spin = effort_lines(loads)
    assert push.startswith("prescribed.push: force up to ")
    assert "; speed up to 2 m/s; power up to " in push
    assert spin.startswith("prescribed.spin: torque up to ")
    assert "; speed up to 3 rad/s, 28.65 rpm; power up to " in spin
    efforts = dict(motion_page(data).more)["Motors and prescribed motions"]
    assert efforts.count("m/s") == efforts.count("rad/s") == 2
    # Of results that do not tell which of the two it is, no unit is claimed.
    for name in ("applied_torque", "torque", "drive_torque"):
        if name in data:
            del data[name].attrs["units_each"]
    assert "torque or force up to" in effort_lines(load_figures(data))[0]
    assert "N m or N" in dict(motion_page(data).more)["Motors and prescribed motions"]


def slider_joint(data):
    return next(str(name) for name in data["joint"].values if data["joint_kind"].sel(joint=name) == "slider")


def test_the_travel_of_a_slider_is_the_place_of_its_point(data):
    joint, place = slider_joint(data), data["point_position"].sel(point="slider.B", axis="x")
    np.testing.assert_allclose(data["joint_coordinate"].sel(joint=joint), place, rtol=0, atol=1e-9)
    rate = np.gradient(place.values, data["time"].values)
    np.testing.assert_allclose(
        data["joint_speed"].sel(joint=joint)[1:-1], rate[1:-1], rtol=0, atol=0.01 * np.abs(rate).max()
    )
    assert data["joint_coordinate"].attrs["units"] == "rad, m"


def shaking(run, k):
    """Force and moment on the ground at a sample, and weight less rate of momentum, over the largest of the run."""
    system, solution, data, h = run.system, run.solution, motion_dataset(run), 1e-6
    q, v, a = solution.q[k], solution.v[k], solution.a[k]
    ahead = momentum(system, State(0.0, q + h * v + 0.5 * h**2 * a, v + h * a))
    behind = momentum(system, State(0.0, q - h * v + 0.5 * h**2 * a, v - h * a))
    gained = [(after - before) / (2.0 * h) for after, before in zip(ahead, behind, strict=True)]
    assert not any(system.mechanism.gravity)
    for name, rate in zip(("frame_force", "frame_moment"), gained, strict=True):
        most = np.abs(data[name]).max().item()
        yield data[name][k].values / most, -rate / most


@pytest.mark.parametrize("k", [70, 230, 400])
def test_what_shakes_the_ground_is_what_changes_the_momentum(crank, k):
    """Springs to the ground among it: without them the sum would be wrong by their pull of up to 70 N."""
    system = crank.system
    at_ends = pf.IntegrationOptions(step=5e-5, tolerance=1e-9)
    for found, by_momentum in shaking(simulate_motion(system.mechanism, 0.02, samples=401, options=at_ends), k):
        np.testing.assert_allclose(found, by_momentum, rtol=0, atol=1e-6)
    # Between steps accelerations and multipliers are interpolated, each for itself. What is left falls with the
    # tolerance: up to 2.4e-4 at 1e-8 m, 6.2e-5 at 1e-9, 1.5e-5 at 1e-10, 2.7e-6 at 1e-11, each also with a tenth more
    # and less. How much it is depends on where the steps lie, and so on rounding.
    close = pf.IntegrationOptions(tolerance=1e-11)
    for found, by_momentum in shaking(simulate_motion(system.mechanism, 0.02, samples=401, options=close), k):
        np.testing.assert_allclose(found, by_momentum, rtol=0, atol=1e-5)


def test_the_ground_carries_the_weight_of_what_rests():
    """A bar on a pin and a spring to the ground, in equilibrium: force and moment of all weights about the origin."""
    bar = RigidBody("bar", 2.0, 0.1, (0.4, 0.0), {"A": (0.0, 0.0), "B": (1.0, 0.0)})
    mechanism = Mechanism(
        name="hung",
        ground={"O": (0.3, 0.1), "C": (1.2, 0.9)},
        bodies=(bar,),
        joints=(RevoluteJoint("pin", PointRef("ground", "O"), PointRef("bar", "A")),),
        linear_springs=(LinearSpring("coil", PointRef("ground", "C"), PointRef("bar", "B"), 200.0, 0.5, 3.0),),
        assemblies=(Assembly("start", {"bar": 0.1}),),
        gravity=(0.0, -9.81),
    )
    system = build_system(mechanism)
    rest = static_equilibrium(system, consistent_state(system, None))
    data = motion_dataset(simulate_motion(mechanism, 1e-3, samples=2, start=rest, options=OPTIONS))
    centre = 0.3 + 0.4 * np.cos(rest.q[system.body("bar").angle])
    np.testing.assert_allclose(data["frame_force"], [[0.0, -2.0 * 9.81]] * 2, rtol=0, atol=1e-9 * 2.0 * 9.81)
    np.testing.assert_allclose(data["frame_moment"], -2.0 * 9.81 * centre, rtol=1e-9)


def test_stresses_are_in_tables_and_summary_and_on_the_page(crank, data, tmp_path):
    k, place = float(data["stress_time"].sel(body="rod")), float(data["stress_place"].sel(body="rod"))
    own = data.sel(time=k)
    station = np.flatnonzero(own["section_place"].values == place)[0]
    by_hand = abs(own["section_moment"] / own["section_modulus"]) + abs(own["section_force"] / own["section_area"])
    by_hand = by_hand.values[station]
    most = data["stress_max"].sel(body="rod").item()
    assert most == pytest.approx(by_hand, rel=1e-6)
    assert most == pytest.approx(data["stress"].sel(body="rod").max().item(), rel=1e-6)
    assert data["safety_factor"].sel(body="rod").item() == pytest.approx(3e7 / most)
    assert np.isnan(data["stress_max"].sel(body="crank").item())
    loads = motion_summary(data)["loads"]
    assert loads["beams"]["rod"]["stress_max"] == most
    assert set(loads) == {"beams", "joints", "motors", "drives", "frame"}
    assert list(loads["beams"]) == ["rod"]
    assert "MPa in rod at" in stress_line({"": loads})
    # Times are those of the largest values, of joints and drives too.
    drive = loads["drives"]["drive"]
    for key in ("torque", "power"):
        then = data[f"drive_{key}"].sel(drive="drive", time=drive[f"{key}_time"]).item()
        assert abs(then) == drive[f"{key}_max"] == abs(data[f"drive_{key}"]).max().item()
    name, one = max(loads["joints"].items(), key=lambda each: each[1]["force_max"])
    assert np.linalg.norm(data["joint_force"].sel(joint=name, time=one["force_time"])) == one["force_max"]
    assert joint_line({"": loads}).endswith(f"N in {name} at t = {number(one['force_time'])} s")
    assert {one["unit"] for name, one in loads["joints"].items() if name != slider_joint(data)} == {"rad"}
    assert loads["joints"][slider_joint(data)]["unit"] == "m"
    # Below one, which is said three times.
    assert loads["beams"]["rod"]["safety_factor"] < 1.0
    (over,) = [one for one in crank.findings if one.code == "stress-over-strength"]
    assert " rad/s, " in over.remedy
    assert " rpm)" in over.remedy
    page = motion_page(data)
    tables = dict(page.more)
    assert list(tables)[:3] == ["Stresses of beams", "Motors and prescribed motions", "Joints and ground"]
    assert "over strength" in tables["Stresses of beams"]
    assert any("stress-over-strength" in note for note in page.notes)
    # Angles and travels stand apart, and what a designer asks first stands first.
    assert tables["Joints and ground"].count("<table") == 3
    assert "rad, m" not in tables["Joints and ground"]
    tiles = [name for name, _, _ in page.figures]
    assert tiles[:3] == ["largest stress", "largest drive torque", "largest joint force"]
    shown = {chart.identity: chart for panel in page.panels for chart in panel.charts}
    units = {name: shown[f"joint-{name}"].axis(None).unit for name in ("angle", "rate", "travel", "speed")}
    assert units == {"angle": "rad", "rate": "rad/s", "travel": "m", "speed": "m/s"}
    assert shown["joint-rate"].axis(None).label(DisplayUnit("rad/s", 1.0)) == "angular velocity φ̇ [rad/s]"
    tables = result_tables(data, shapes=True)
    assert "joint_speed_" + slider_joint(data) in tables["time_series"]
    assert len(tables["sections"]) == data.sizes["time"] * data.sizes["section"]
    save_results(data, tmp_path / "results.nc")
    xr.testing.assert_equal(load_results(tmp_path / "results.nc")["stress"], data["stress"])


def test_results_of_earlier_versions_have_no_loads_and_are_drawn(data):
    new = {name for name in data.variables if "section" in str(name) or "drive" in str(name) or "frame" in str(name)}
    new |= {name for name in data.variables if "stress" in str(name) or str(name).startswith(("joint_c", "joint_s"))}
    old = data.drop_vars(new | {"safety_factor", "motor_energy", "input_power"})
    assert load_figures(old) == {}
    assert [title for title, _ in motion_page(old).more] == ["Integration"]
    assert json.loads(json.dumps(motion_summary(old)))["loads"] == {}


@pytest.fixture(scope="module")
def run():
    model = pf.load("five_bar")
    task = plan_tracking(model, "line", duration=0.05, samples=26, assembly="outward")
    return task.simulate("++", options=pf.IntegrationOptions(step=1e-3, tolerance=1e-9))


def test_metrics_are_the_largest_of_the_dataset(run):
    found = measure(run, ("stress_max", "section_moment_max", "safety_factor_min", "motor_energy"))
    data = tracking_dataset([run])
    assert found["stress_max"] == pytest.approx(data["stress_max"].max().item(), rel=1e-6)
    assert found["section_moment_max"] == pytest.approx(np.abs(data["section_moment"]).max().item(), rel=1e-6)
    assert found["motor_energy"] == pytest.approx(data["motor_energy"].sum().item(), rel=1e-6)
    assert np.isnan(found["safety_factor_min"])
    assert summary(data)["modes"]["++"]["loads"]["beams"]
    assert any(title == "Stresses of beams" for title, _ in tracking_page(data).more)


STUDY = stress_study("five_bar", "section.bar.thickness")


def test_the_stress_has_exact_derivatives(tmp_path):
    thickness = pf.load("five_bar").mechanism.bodies[0].section.shape.thickness
    found = check_derivatives(tmp_path, STUDY, thickness, rel=2e-4)
    assert found.to_dict()["units"] == {"stress_max": "Pa", "section_moment_max": "N m"}


SEARCH = (
    STUDY.replace('metrics = ["stress_max", "section_moment_max"]', "")
    + """
low = "4 mm"
high = "6 mm"

[objective]
minimise = { total_mass = 1.0 }

[[objective.at_most]]
metric = "stress_max"
value = "%s MPa"

[search]
evaluations = 40
"""
)


def test_a_search_holds_a_limit_of_the_stress(tmp_path):
    """The lightest bars are the thinnest whose stress is allowed: neither end of the range, as the limit decides."""

    def stress(thickness):
        (tmp_path / "one.toml").write_text(STUDY + f"values = [{thickness}]\n", encoding="utf-8")
        return pf.sweep(tmp_path / "one.toml", tmp_path / f"at_{thickness}", workers=1).data["stress_max"].item()

    thin, thick = stress(0.004), stress(0.006)
    assert thin > 1.1 * thick
    allowed = 0.5 * (thin + thick)
    (tmp_path / "search.toml").write_text(SEARCH % repr(1e-6 * allowed), encoding="utf-8")
    found = pf.optimise(tmp_path / "search.toml", tmp_path / "found", workers=1)
    assert found.holds_limits
    assert stress(found.values["thickness"]) == pytest.approx(allowed, rel=1e-3)


def test_a_limit_of_the_stress_is_no_force(tmp_path):
    (tmp_path / "search.toml").write_text((SEARCH % 50.0).replace("MPa", "kN"), encoding="utf-8")
    with pytest.raises(InputError, match=r"objective.at_most.0.value: a quantity in .* where one in Pa is asked for"):
        pf.load_optimisation(tmp_path / "search.toml")
