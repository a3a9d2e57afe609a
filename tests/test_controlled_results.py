"""Results of runs under controllers: datasets, files, tables, metrics."""

import numpy as np
import pandas as pd
import pytest

import paraflex as pf
from paraflex import JointPID, SampledController, Simulation
from paraflex.control.laws.joints import internal_torques
from paraflex.designs.measure import measure
from paraflex.errors import ControllerError, InputError
from paraflex.results import (
    load_results,
    motion_dataset,
    motion_summary,
    save_results,
    settling_times,
    summary,
    tracking_dataset,
)
from paraflex.results.controllers import controllers_of
from paraflex.results.export import export, matlab_struct, result_tables
from paraflex.results.formulas import largest_norm, overshoot, settling_time
from test_simulation import rotor

MODES = ("++++", "+-+-")


def joint_pd(**more):
    limits = more.pop("limits", 3.0)
    return SampledController(JointPID(60.0, 0.5), **{"period": 1e-3, "limits": limits, "name": "pd"} | more)


def brake(**more):
    return SampledController(lambda k, t, y: [-0.2 * y[0]], **{
        "period": 2e-3, "delay": 1e-3, "inputs": ["A1"], "outputs": ["tau1"], "name": "brake", "rates": 100.0,
    } | more)  # fmt: skip


def run_metrics(run):
    return measure(run, ["settling_time", "overshoot", "internal_torque_max", "saturated_share"])


@pytest.fixture(scope="module")
def task():
    """A corner of RAParM-I's square, and a short rest; of rigid links, which take no time."""
    robot = pf.load("raparm_i")
    return pf.plan(robot.mechanism.rigid(), robot.paths["square"], duration=0.08, samples=81)


@pytest.fixture(scope="module")
def runs(task):
    return [Simulation(task, mode=mode, feed_forward=True).run([joint_pd(), brake()]) for mode in MODES]


@pytest.fixture(scope="module")
def data(runs):
    return tracking_dataset(runs)


# --- Datasets ---------------------------------------------------------------------------------------------------------


def test_what_controllers_did_is_kept(runs, data):
    pd_data, brake_data = controllers_of(data)
    for r, run in enumerate(runs):
        one, other = run.controllers
        own = pd_data.data.isel(mode=r).sel(output=list(one.outputs), input=list(one.inputs))
        assert np.array_equal(own["reading"], one.readings)
        assert np.array_equal(own["wanted_torque"], one.requested)
        assert np.array_equal(own["given_torque"], one.applied)
        assert np.array_equal(brake_data.data["given_torque"][r], other.applied)
    assert np.array_equal(pd_data.data["sample"], runs[0].controllers[0].t)
    assert (pd_data.period, pd_data.delay, pd_data.law) == (1e-3, 0.0, "PID of joints")
    assert (brake_data.period, brake_data.delay) == (2e-3, 1e-3)
    assert pd_data.limits["tau1"] == [-3.0, 3.0]
    assert brake_data.limits["tau1"] == [None, None]
    assert brake_data.rates["tau1"] == 100.0


def test_motors_that_a_mode_has_not_are_nan(runs):
    """Two motors move it, so that two of the four may be left out."""
    fewer = Simulation(runs[0].task, mode="tau1,tau5").run(joint_pd())
    own = controllers_of(tracking_dataset([runs[0], fewer]))[0].data
    names = list(own["output"].values)
    known = np.isfinite(own["given_torque"].values).all(axis=1)
    assert names == [motor.name for motor in runs[0].task.mechanism.motors]
    assert known.tolist() == [[True] * 4, [name in ("tau1", "tau5") for name in names]]


def test_units(data):
    given, reading = data["given_torque_pd"], data["reading_pd"]
    assert (given.attrs["units"], reading.attrs["units"], data["sample_pd"].attrs["units"]) == ("N m", "rad", "s")
    assert given.attrs["period"] == 1e-3
    assert "units_each" not in given.attrs


def test_files_keep_it(data, tmp_path):
    save_results(data, tmp_path / "run.nc")
    found = load_results(tmp_path / "run.nc")
    for name in ("sample_pd", "reading_pd", "wanted_torque_pd", "given_torque_brake", "internal_torque"):
        assert np.array_equal(found[name], data[name], equal_nan=True)
        assert found[name].attrs == data[name].attrs
    assert [one.limits for one in controllers_of(found)] == [one.limits for one in controllers_of(data)]


def test_a_run_that_failed_keeps_what_there_is(task, runs):
    def failing(k, t, y):
        return [np.nan if k == 30 else 0.0]

    law = SampledController(failing, period=1e-3, inputs=["A1"], outputs=["tau1"], name="brake")
    with pytest.raises(ControllerError) as caught:
        Simulation(task, feed_forward=True).run([law, joint_pd()])
    partial = caught.value.partial
    failed = tracking_dataset([partial])
    one, _ = controllers_of(failed)
    assert failed["status"].item() == "failed"
    assert one.data.sizes["sample"] == 30
    both = tracking_dataset([partial, Simulation(task, mode=MODES[1], feed_forward=True).run(joint_pd())])
    own = next(each for each in controllers_of(both) if each.name == "pd")
    assert own.samples.values.tolist() == [30, 80]


def test_controllers_that_differ_are_refused(task, runs):
    other = Simulation(task, mode=MODES[1]).run([joint_pd(period=2e-3), brake()])
    with pytest.raises(InputError, match=r"pd\.period: .*differ \(got 0\.002\)"):
        tracking_dataset([runs[0], other])


@pytest.mark.parametrize("name", ["a/b", "a.b", ""])
def test_names_that_files_cannot_have(task, name):
    with pytest.raises(InputError, match="not a name for a controller"):
        Simulation(task).run(joint_pd(name=name))


def test_a_run_without_a_path(tmp_path):
    sim = Simulation(rotor(), duration=0.02, samples=21)
    law = SampledController(lambda k, t, y: [-40.0 * y[0] - 1.2 * y[1]], period=1e-3, inputs=["hub", "rate"],
                            limits=20.0, name="pd")  # fmt: skip
    run = sim.run(law)
    save_results(motion_dataset(run), tmp_path / "run.nc")
    data = load_results(tmp_path / "run.nc")
    assert data["reading_pd"].dims == ("sample_pd", "input_pd")
    assert (data["reading_pd"].attrs["units"], data["reading_pd"].attrs["units_each"]) == ("rad, rad/s", "rad, rad/s")
    assert np.array_equal(data["given_torque_pd"], run.controllers[0].applied)
    told = motion_summary(data)["controllers"]["pd"]
    limited = int(np.sum(np.abs(run.controllers[0].requested) > 20.0))
    assert 0 < limited < 20
    assert told["saturated_share"] == limited / 20
    assert told["torques"]["tau"] == {
        "unit": "N m", "wanted_max": 40.0, "given_max": 20.0, "lowest": -20.0, "highest": 20.0, "rate": None,
    }  # fmt: skip


# --- Tables -----------------------------------------------------------------------------------------------------------


def test_a_table_for_each_controller(runs, data, tmp_path):
    tables = result_tables(data)
    assert list(tables) == ["time_series", "figures", "controller_pd", "controller_brake"]
    table = tables["controller_brake"]
    assert list(table) == ["mode", "sample_brake", "reading_brake_A1", "wanted_torque_brake_tau1",
                           "given_torque_brake_tau1"]  # fmt: skip
    assert len(table) == 2 * 40
    assert table.attrs["units"]["sample_brake"] == "s"
    written = {file.name for file in export(data, tmp_path, "csv")}
    assert "controller_pd.csv" in written
    back = pd.read_csv(tmp_path / "controller_brake.csv")
    assert np.array_equal(back["given_torque_brake_tau1 [N m]"][:40], runs[0].controllers[1].applied[:, 0])


def test_matlab_has_samples_first(data):
    struct = matlab_struct(data)
    assert struct["given_torque_pd"].shape == (80, 4, 2)
    assert struct["sample_pd"].shape == (80,)


# --- Numbers ----------------------------------------------------------------------------------------------------------


def test_internal_torques_are_those_of_the_law(task, runs, data):
    """Of a law without projection, with unlike gains; torques along the plan have none."""
    unlike = JointPID({"tau1": 60.0, "tau5": 6.0}, project=False)
    run = Simulation(task, mode="++++").run(SampledController(unlike, period=1e-3))
    told = summary(tracking_dataset([run]))["modes"]["++++"]
    expected = np.linalg.norm(internal_torques(task, "++++", run.applied), axis=1).max()
    assert told["internal_torque_max"] == pytest.approx(expected, abs=1e-15)
    assert expected > 1e-3
    assert run_metrics(run)["internal_torque_max"] == pytest.approx(expected, abs=1e-15)
    assert "controllers" in told
    assert "controllers" not in summary(tracking_dataset([pf.simulate(task, "++++")]))["modes"]["++++"]


def test_the_share_of_saturated_samples(runs):
    pd, brake = runs[0].controllers
    limited = np.sum(np.any(pd.requested != pd.applied, axis=1)) + np.sum(
        np.any(brake.requested != brake.applied, axis=1)
    )
    assert limited > 0
    assert run_metrics(runs[0])["saturated_share"] == limited / (80 + 40)


def test_settling_of_an_exponential():
    """A e^(-t / T) is within 5 % after T log 20; of an absolute band after T log(A / band)."""
    t = np.linspace(0.0, 1.0, 20001)
    distance = 3e-4 * np.exp(-(t - 0.2) / 0.1) * (t >= 0.2)
    assert settling_time(t, distance, 0.2) == pytest.approx(0.1 * np.log(20.0), abs=1e-6)
    assert settling_time(t, distance, 0.2, 1e-5) == pytest.approx(0.1 * np.log(30.0), abs=1e-6)
    assert settling_time(t, distance, 0.2, 1e-3) == 0.0
    # By hand: 4 falls to 0 within a second, so that it is within 1 after three quarters of it.
    coarse = np.array([0.0, 1.0, 2.0, 3.0]), np.array([8.0, 4.0, 0.0, 0.0])
    assert settling_time(*coarse, 1.0, 1.0) == pytest.approx(0.75, abs=1e-15)
    assert np.isnan(settling_time(*coarse, 3.0, 1.0))
    assert np.isnan(settling_time(np.arange(3.0), np.array([1.0, 2.0, 3.0]), 1.0))
    assert np.isnan(settling_time(np.arange(3.0), np.array([1.0, np.nan, np.nan]), 1.0))


def test_overshoot_of_a_step():
    """A damped oscillator goes beyond its end by exp(-pi zeta / sqrt(1 - zeta^2))."""
    zeta, t = 0.3, np.linspace(0.0, 20.0, 20001)
    w = np.sqrt(1.0 - zeta**2)
    x = 1.0 - np.exp(-zeta * t) * (np.cos(w * t) + zeta / w * np.sin(w * t))
    direction, moving = np.array([0.6, 0.8]), t <= 1.0
    desired = np.minimum(t, 1.0)[:, None] * direction
    position = x[:, None] * direction + 0.3 * np.array([-0.8, 0.6])
    expected = np.exp(-np.pi * zeta / w)
    assert overshoot(position, desired, moving) == pytest.approx(expected, abs=1e-6)
    assert overshoot(0.5 * position, desired, moving) == 0.0
    assert np.isnan(overshoot(position, desired, np.ones_like(moving)))
    assert np.isnan(overshoot(position, 0.0 * desired, moving))


def test_largest_norm_by_hand():
    assert largest_norm(np.array([[3.0, 4.0], [-1.0, 0.0]])) == 5.0
    assert np.isnan(largest_norm(np.zeros((0, 2))))


def test_metrics_of_runs_are_those_of_datasets():
    robot = pf.load("raparm_i")
    path = robot.paths["square"]
    task = pf.plan(robot.mechanism.rigid(), path, duration=path.duration + 0.3, samples=200)
    run = Simulation(task, mode="++++").run(SampledController(JointPID(50.0, 1.0), period=2e-3))
    data = tracking_dataset([run])
    found = run_metrics(run)
    for name in ("settling_time", "overshoot"):
        assert found[name] == pytest.approx(data[name].item(), abs=1e-15, nan_ok=True)
        assert summary(data)["modes"]["++++"][name] == pytest.approx(found[name], abs=1e-15)
    assert found["settling_time"] > 0.01
    assert found["overshoot"] > 0.0
    assert settling_times(data, 1.0).item() == 0.0
    with pytest.raises(InputError, match="band: must be positive"):
        settling_times(data, 0.0)
