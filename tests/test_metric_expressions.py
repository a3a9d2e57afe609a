"""Metrics by expression: against datasets of the same runs, differences of whole runs, and what they refuse."""

import json
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from made_up import write_study
from paraflex.designs.measure import measure, metric_figures, metrics_of
from paraflex.designs.run import run_task
from paraflex.errors import InputError
from paraflex.formatting import display_unit, output_units
from paraflex.mechanism import Encoder, finite_segments
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
    text = STUDY.replace("tolerance = 1e-7", "tolerance = 1e-9").replace(
        "samples = 13", f"samples = 13\nmetrics = [{names}]"
    )
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


def test_identification_and_sensitivities_take_expressions(tmp_path):
    """A thickness is found again from what a run with it gave, by exact derivatives; units are of the expressions."""
    text = STUDY.partition("[vary")[0].replace("tolerance = 1e-7", "tolerance = 1e-9")
    vary = '[vary.thickness]\nfields = ["section.bar.thickness"]\n'
    names = ["rms(tau1.torque[0.02:0.05])", "max(abs(link1.deflection))"]
    study = text.replace("samples = 13", f"samples = 13\nmetrics = {names}") + vary
    found = pf.sensitivities(write_study(tmp_path, study))
    assert found.units == ("N m", "m")
    targets = "".join(
        f"[[target]]\nmetric = '{name}'\nvalue = {value!r}\n"
        for name, value in zip(names, found.values[0].tolist(), strict=True)
    )
    limits = 'low = "4 mm"\nhigh = "6 mm"\nstart = "4.9 mm"\n'
    result = pf.identify(write_study(tmp_path, text + vary + limits + targets, "fit.toml"), tmp_path / "fit", workers=1)
    assert result.derivatives == "exact"
    assert result.values["thickness"] == pytest.approx(0.005, rel=1e-4)


REFUSED = [
    ("max(foo.x)", "no such quantity (got 'foo.x'); choose from "),
    ("max(A1.angel)", "no such quantity (got 'A1.angel'); did you mean \"A1.angle\"?"),
    ("max(tau1.angle)", "no such quantity (got 'tau1.angle'); did you mean \"A1.angle\"?"),
    ("max(A1)", "no such quantity (got 'A1'); choose from A1.angle, A1.rate,"),
    ("max(A1.travel)", "the joint turns: it has no travel (got 'A1.travel'); write A1.angle"),
    ("max(tau1.force)", "the joint of tau1 turns, so that it has a torque (got 'tau1.force'); write tau1.torque"),
    ("max(B1.torque)", "no motor or prescribed motion acts at the joint (got 'B1.torque'); write B1.moment or B1"),
    ("max(link1.B1.z)", "no such quantity (got 'link1.B1.z'); choose from link1.B1.x, link1.B1.y"),
    ("max(sensor.x)", "no such quantity (got 'sensor.x')"),
    ("max(travel.A1)", "no such quantity (got 'travel.A1')"),
    ("max(A1.torque) + max(A1.rate)", "a sum of quantities in N m and in rad/s (got "),
    ("max(A1.torque + A1.force)", "a sum of quantities in N m and in N (got "),
    ("max(error - 0.1)", "a sum of a quantity in m and a number without a unit (got 'max(error - 0.1)'); write a unit"),
    ("max(error - 0.1 N)", "a sum of quantities in m and in N (got "),
    ("max(sqrt(A1.rate))", "its unit is not known (got "),
    ("max(sin(tau1.torque))", "sin of a quantity in N m (got "),
    ("tau1.torque", "unknown metric (got 'tau1.torque'); a quantity of a run needs a function of its samples, as max("),
    ("abs(tau1.torque)", "not one number of a run (got 'abs(tau1.torque)'); write max(abs(tau1.torque)), or"),
    ("(tau1.torque)", "not one number of a run (got '(tau1.torque)'); write max(abs(tau1.torque)), or"),
    ("max(A1.rate) + (tau1.torque)", "not one number of a run (got "),
    ("3 * (2)", "not one number of a run (got '3 * (2)'); write max(abs(body.point.y)), or"),
    ("max(3)", "max of a number, not of a quantity of the run (got 'max(3)'); write max(body.point.y)"),
    ("max(max(A1.rate))", "max of a number, not of a quantity of the run (got "),
    ("max()", "max takes one quantity, not 0 (got 'max()')"),
    ("max(A1.rate, B1.rate)", "max takes one quantity, not 2 (got "),
    ("bigest(A1.rate)", 'unknown function "bigest" (got '),
    ("max(abs(A1.rate)", "no such expression of a metric (got 'max(abs(A1.rate)'); write it like max(abs(body.p"),
    ("rms(A1.rate[0.05:0.02])", "a window that ends before it begins (got "),
    ("rms(A1.rate[0.02:0.04] + B1.rate[0.05:])", "a window that ends before it begins (got "),
    ("rms(A1.rate[0.02:5])", "the window [0.02:5] is not within the run, from 0 s to 0.06 s (got "),
    ("rms(A1.rate[-0.1:])", "a window outside the run (got "),
    ("rms(A1.rate[0.02])", "not a window of time of a quantity (got "),
    ("rms(A1.rate[::2])", "not a window of time of a quantity (got "),
    ("rms(A1.rate[0.02 m:])", "a window in m, not in s (got "),
    ("rms(A1.rate[A1.angle:])", '"A1.angle" in a window of time (got '),
    ("max(A1.rate)[0:0.01]", "not a window of time of a quantity (got "),
    ("max(A1.rate) * (1 / 0)", "a division by zero (got "),
    ("max(9**9**9 * A1.rate)", "too large a number (got "),
    ("max(A1.rate^2)", '"^" is a power only in units (got '),
    ("max(A1.rate" + " + 1 rad/s" * 30 + ")", "too long for an expression (got "),
    ("(" * 150 + "max(A1.rate", "no such expression of a metric (got "),
    ("__import__('os').system('ls')", "only numbers, parameters, + - * / ** and brackets may stand in"),
    ("max(A1.rate) + __import__('os').system('ls')", "only numbers, parameters, + - * / ** and brackets may stand in"),
    ("max(A1.rate if A1.angle else A1.angle)", "only numbers, parameters, + - * / ** and brackets may stand in"),
    ("max([x for x in A1.rate])", "only numbers, parameters, + - * / ** and brackets may stand in"),
    ("max(f'{A1.rate}' + A1.rate)", "only numbers, parameters, + - * / ** and brackets may stand in"),
    ("max(lambda: 0)", "max of a number, not of a quantity of the run (got "),
    ("max(A1.rte) + 1 foo", "no such quantity (got 'A1.rte'); did you mean \"A1.rate\"?"),
    ("max(A1.rte[0:1 kg])", "no such quantity (got 'A1.rte'); did you mean \"A1.rate\"?"),
    ("max(A1.rate) + 1 foo", 'unknown unit "foo" (got '),
    ("max(\n)", "max takes one quantity, not 0"),
    ("max(\x00)", "no such expression of a metric (got "),
]  # fmt: skip


@pytest.mark.parametrize(("metric", "says"), REFUSED)
def test_expressions_that_make_no_sense_are_refused(arms, metric, says):
    task = arms[0].task
    with pytest.raises(InputError) as error:
        metrics_of([metric], "motion", task.mechanism, duration=float(task.motion.t[-1]))
    assert str(error.value).startswith(f"metrics: {says}")
    assert "\n" not in str(error.value)


def test_a_joint_that_slides_and_a_rigid_body_have_other_quantities(crank):
    mechanism = crank[0].system.described
    for metric, says in (
        ("max(rail.angle)", "the joint slides: it has no angle (got 'rail.angle'); write rail.travel"),
        ("max(crank.stress)", "not a flexible beam (got 'crank.stress'); name a beam that bends"),
        ("max(crank.deflection)", "not a flexible body (got 'crank.deflection')"),
        ("max(error)", "no such quantity (got 'error')"),
        ("max(ground.O.x)", "no such quantity (got 'ground.O.x')"),
    ):
        with pytest.raises(InputError) as error:
            metrics_of([metric], "motion", mechanism, "motion")
        assert says in str(error.value)
    with pytest.raises(InputError, match=r"no sample lies in the window \[0.00011:0.00012\] \(got 'max"):
        pf.metrics(crank[0], ["max(rail.rate[0.00011:0.00012])"])
    with pytest.raises(InputError, match=r"metrics: the window \[5:\] is not within the run, from 0 s to [0-9.]* s"):
        pf.metrics(crank[0], ["max(rail.rate[5:])"])
    for metric in ("max(rail.travel)/0", "max(1 / (rail.travel - rail.travel))"):
        with pytest.raises(InputError, match="metrics: not a finite number") as error:
            pf.metrics(crank[0], [metric])
        assert error.value.value == metric
    kept = metric_figures(crank[0], ["max(rail.travel)/0"])["max(rail.travel)/0"]
    assert kept == {"value": None, "unit": "m", "reason": "not a finite number"}
    with pytest.raises(InputError, match="unknown metric"):
        pf.metrics(crank[0], ["tracking"])
    with pytest.raises(InputError, match="a metric of runs along a path, not of runs without a path"):
        pf.metrics(crank[0], ["tracking_rms"])
    assert pf.metrics(crank[0], ["max(rail.travel)"]) == measure(crank[0], ["max(rail.travel)"])


def test_a_motor_by_its_joint_and_a_name_for_two(crank):
    """A prescribed motion may have the name of its joint: force and torque are then its own."""
    drive = replace(crank[0].system.described.prescribed[0], name="O")
    mechanism = replace(crank[0].system.described, prescribed=(drive,))
    members = MetricMembers(mechanism)
    assert METRICS["max(O.torque) + max(O.moment)"].unit_of("", members) == "N m"
    with pytest.raises(InputError, match="the joint of O turns, so that it has a torque"):
        METRICS["max(O.force)"].columns(members)
    assert METRICS["max(O.fx)"].unit_of("", members) == "N"


@pytest.mark.parametrize("segments", [1, 3])
def test_beams_cut_into_segments_keep_the_names_of_their_points(segments):
    """Against the dataset of the same run, which has the points of the whole beams; of segments nothing bends."""
    motion = pf.simulate_motion(finite_segments(pf.load("four_bar").mechanism, segments).mechanism, 0.01, samples=11)
    task = pf.load("raparm_i").plan("square", duration=0.02, samples=11).in_segments(segments)
    for run, data, point in (
        (motion, motion_dataset(motion), "rocker.B"), (tracked := pf.simulate(task, "++++"), None, "link1.B1")
    ):  # fmt: skip
        data = tracking_dataset([tracked]).isel(mode=0) if data is None else data
        got = pf.metrics(run, [f"last({point}.{word})" for word in ("x", "y", "vx", "vy")])
        wanted = [*taken(data, "point_position", point=point)[-1], *taken(data, "point_velocity", point=point)[-1]]
        assert list(got.values()) == pytest.approx(wanted, rel=1e-9)
        beam = point.partition(".")[0]
        for word in ("stress", "deflection"):
            with pytest.raises(InputError, match=f"{beam} is cut into rigid segments, which have no {word}"):
                pf.metrics(run, [f"max({beam}.{word})"])
    speeds = pf.metrics(tracked, ["joint_speed_max"])
    assert list(speeds) == [f"joint_speed_max.{joint.name}" for joint in pf.load("raparm_i").mechanism.joints]
    assert speeds["joint_speed_max.B1"] == pytest.approx(np.abs(taken(data, "joint_speed", joint="B1")).max(), rel=1e-9)


def test_units_of_expressions_follow_the_output_units(arms):
    members = MetricMembers(arms[0].task.mechanism)
    for name, unit, chosen in (("max(A1.rate)", "rad/s", "rpm"), ("rms(tau1.torque * 2)", "N m", "N mm")):
        found = metric_unit(name, members)
        with output_units([chosen]):
            assert (found, display_unit(found, 1.0).name) == (unit, chosen)


def test_a_sweep_has_columns_of_expressions_with_units(tmp_path):
    names = ["max(abs(tau1.torque))", "range(link1.B1.x[:50 ms])"]
    text = STUDY.partition("[vary")[0].replace("samples = 13", f"samples = 13\nmetrics = {names}")
    text += '[vary.lump]\nfields = ["lump.joint.mass"]\nvalues = [0.1, 0.2]\n'
    result = pf.sweep(write_study(tmp_path, text), tmp_path / "out", workers=1)
    assert result.complete
    assert [result.data[name].attrs["units"] for name in names] == ["N m", "m"]
    assert np.ptp(result.data[names[0]].values) > 0.1
    assert (tmp_path / "out" / "report.html").exists() or result.table.exists()


def test_the_command_prints_and_keeps_metrics(tmp_path):
    given = ["run", "five_bar", "--duration", "0.02", "--no-report", "--out", tmp_path / "out", "--json"]
    ran = paraflex(*given, "--metric", "max(abs(A1.rate))", "--metric", "peak_torque")
    assert ran.returncode == 0, ran.stderr
    (mode,) = pf.load_results(tmp_path / "out" / "results.nc")["mode"].values
    summary = pf.summary(pf.load_results(tmp_path / "out" / "results.nc"))["modes"][str(mode)]
    assert summary["metrics"]["max(abs(A1.rate))"]["unit"] == "rad/s"
    for motor, value in summary["peak_torque"].items():
        assert summary["metrics"][f"peak_torque.{motor}"]["value"] == pytest.approx(value, rel=1e-12)
    bad = paraflex(*given[:-3], "--out", tmp_path / "other", "--metric", "max(abs(A1.rat))")
    assert bad.returncode == 2
    assert "error: --metric: no such quantity (got 'A1.rat'); did you mean \"A1.rate\"?" in bad.stderr
    assert not (tmp_path / "other").exists()
    cut = paraflex(*given, "--segments", "1", "--metric", "max(distal1.C.x)", "--mode", "++", "--force")
    assert cut.returncode == 0, cut.stderr
    (mode,) = json.loads(cut.stdout)["modes"].values()
    assert mode["metrics"]["max(distal1.C.x)"]["unit"] == "m"
