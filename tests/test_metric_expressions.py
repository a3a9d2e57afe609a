"""Metrics by expression: against datasets of the same runs, differences of whole runs, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from made_up import write_study
from paraflex.designs.measure import measure, metrics_of
from paraflex.designs.run import run_task
from paraflex.errors import InputError
from paraflex.formatting import display_unit, output_units
from paraflex.mechanism import Encoder
from paraflex.results import motion_dataset, tracking_dataset
from paraflex.results.metrics import METRICS, MetricMembers, metric_unit
from paraflex.studies import metric_gradients
from shell import paraflex
from test_sensitivities import PLACES, STUDY, Design, load_sensitivities


@pytest.fixture(scope="module")
def crank():
    """A run with a drive, a joint that slides, a flexible rod and a sensor; and its dataset."""
    model = pf.load("slider_crank_flexible")
    mechanism = replace(model.mechanism, sensors=(Encoder("stroke", "rail"),))
    run = pf.simulate_motion(mechanism, duration=0.05, samples=101, start=model.start)
    return run, motion_dataset(run)


@pytest.fixture(scope="module")
def arms():
    """A run along a path; and its dataset."""
    run = pf.simulate(pf.load("raparm_i").plan("square", duration=0.06, samples=61), "++++")
    return run, tracking_dataset([run]).isel(mode=0)


def taken(data, name, **at):
    return data[name].sel(at).values


def test_a_run_without_a_path_has_the_quantities_of_its_dataset(crank):
    run, data = crank
    t = data["time"].values
    angle, stroke = taken(data, "joint_coordinate", joint="O"), taken(data, "joint_coordinate", joint="rail")
    torque, power = taken(data, "drive_torque", drive="drive"), taken(data, "drive_power", drive="drive")
    fx, fy = taken(data, "joint_force", joint="rail").T
    x, y = taken(data, "point_position", point="crank.A").T
    vx, vy = taken(data, "point_velocity", point="crank.A").T
    moment, part = taken(data, "joint_moment", joint="rail"), (t > 0.0199) & (t < 0.0301)
    wanted = {
        "max(O.angle)": (angle.max(), "rad"),
        "range(rail.travel)": (np.ptp(stroke), "m"),
        "max(sensor.stroke) - min(rail.travel)": (np.ptp(stroke), "m"),
        "rms(rail.rate)": (np.sqrt(np.mean(taken(data, "joint_speed", joint="rail") ** 2)), "m/s"),
        "max(abs(drive.torque))": (np.abs(torque).max(), "N m"),
        "mean(O.torque[0.02:0.03])": (torque[part].mean(), "N m"),
        "mean(O.torque[20 ms:30 ms]) / 2 N m": (torque[part].mean() / 2.0, "1"),
        "first(drive.power[0.02 s:]) + last(drive.power)": (power[t > 0.0199][0] + power[-1], "W"),
        "max(O.torque * O.rate - 3 W)": (np.max(torque * 150.0) - 3.0, "W"),
        "integral(drive.power)": (np.trapezoid(power, t), "N m"),
        "max(rail.force)": (np.hypot(fx, fy).max(), "N"),
        "min(rail.fx) + mean(rail.fy)": (fx.min() + fy.mean(), "N"),
        "max(abs(rail.moment))": (np.abs(moment).max(), "N m"),
        "max(abs(crank.A.y - 0.1 m))": (np.abs(y - 0.1).max(), "m"),
        "rms(crank.A.x - mean(crank.A.x))": (np.std(x), "m"),
        "max(sqrt(crank.A.vx**2 + crank.A.vy**2))": (np.hypot(vx, vy).max(), "m/s"),
        "max((crank.A.vx**2 + crank.A.vy**2)**0.5)": (np.hypot(vx, vy).max(), "m/s"),
        "max(sin(O.angle))": (np.sin(angle).max(), "1"),
        "max(abs(rod.deflection))": (taken(data, "deflection", body="rod").max(), "m"),
        "mean(abs('crank.A.x'))": (np.abs(x).mean(), "m"),
    }  # fmt: skip
    members = MetricMembers(run.system.described)
    for (name, value), (expected, unit) in zip(measure(run, list(wanted)).items(), wanted.values(), strict=True):
        assert value == pytest.approx(expected, rel=1e-9), name
        assert metric_unit(name, members) == unit, name


def test_accelerations_are_the_slopes_of_rates(crank):
    """The crank turns at a constant speed: its pin has omega^2 r, and the slider follows from differences."""
    run, data = crank
    got = measure(run, ["max(sqrt(crank.A.ax**2 + crank.A.ay**2))", "last(rail.acceleration[:0.025])"])
    centripetal, slider = got.values()
    assert centripetal == pytest.approx(150.0**2 * 0.15, rel=1e-6)
    near = slice(49, 52)
    speed = taken(data, "joint_speed", joint="rail")[near]
    assert slider == pytest.approx((speed[2] - speed[0]) / 1e-3, rel=0.05)


def test_a_run_along_a_path_has_the_metrics_of_the_same_name(arms):
    run, data = arms
    torque, loads = data["torque"].sel(motor="tau2").values, data["stress"].sel(body="link1").values
    pairs = {
        "max(error)": "tracking_max", "rms(error)": "tracking_rms", "max(abs(tau1.torque))": "peak_torque.tau1",
        "rms(D1.torque)": "rms_torque.tau2", "max(abs(A1.rate))": "joint_speed_max.A1",
    }  # fmt: skip
    got = measure(run, [*pairs, "tracking_max", "tracking_rms", "peak_torque", "rms_torque", "joint_speed_max"])
    for expression, name in pairs.items():
        assert got[expression] == pytest.approx(got[name], rel=1e-12)
    assert measure(run, ["min(tau2.torque)", "max(link1.stress)"]) == pytest.approx(
        {"min(tau2.torque)": torque.min(), "max(link1.stress)": loads.max()}, rel=1e-12
    )


DERIVED = [
    "max(abs(tau1.torque))", "rms(tau1.torque[0.02:0.05])", "max(error)", "max(A1.rate * tau1.torque)",
    "max(sqrt(link4.C.vx**2 + link4.C.vy**2))", "range(link1.B1.y)", "max(abs(link1.deflection))",
    "max(link1.stress) / 1 MPa", "max(B1.force)", "mean(abs(B1.moment + B1.fx * 0.1 m))", "last(C.angle)",
    "max(abs(A1.acceleration))", "integral(tau1.power)", "max(A1.force) / rms(B1.force)",
]  # fmt: skip


def test_derivatives_are_those_of_whole_runs(tmp_path):
    names = ", ".join(f'"{name}"' for name in DERIVED)
    text = STUDY.replace("tolerance = 1e-7", "tolerance = 1e-9").replace("samples = 13", f"samples = 13\nmetrics = [{names}]")
    design = Design(load_sensitivities(write_study(tmp_path, text)))
    ((_, values, gradients),) = metric_gradients(design.setting, design.task)
    assert [name for name in gradients if name in DERIVED] == DERIVED
    for name in ("arm", "thickness", "lump", "modulus"):
        k, rows, step = design.setting.names.index(name), [], 3e-4
        for place, _ in PLACES:
            moved = list(design.task.values)
            moved[k] *= 1.0 + place * step
            rows.append(run_task(design.setting, design.task._replace(values=tuple(moved))).rows[0])
        for metric in DERIVED:
            expected = sum(weight * row[metric] for (_, weight), row in zip(PLACES, rows, strict=True)) / step
            exact = gradients[metric][k] * design.task.values[k]
            assert exact == pytest.approx(expected, rel=1e-3, abs=1e-5 * abs(values[metric])), (name, metric)
