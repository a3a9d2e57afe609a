"""Two runs compared: `pf.compare` and `paraflex compare`."""

import json

import numpy as np
import pytest
import xarray as xr

import paraflex as pf
from paraflex.errors import InputError
from paraflex.plots.compare import overlaid_motion
from reports import tracked, verified
from shell import paraflex


def changed(data: xr.Dataset, **values) -> xr.Dataset:
    """A dataset with other values."""
    return data.copy(deep=True).assign(**values)


def number(found, mode, name):
    """A compared number."""
    return next(pair for pair in found.numbers if (pair.mode, pair.name) == (mode, name))


def motion(found, mode, name, part=""):
    """A compared motion."""
    return next(pair for pair in found.motions if (pair.mode, pair.name, pair.part) == (mode, name, part))


def test_a_run_is_equal_to_itself():
    found = pf.compare(tracked(), tracked())
    assert found.kind == "tracking"
    assert found.modes == tuple(map(str, tracked()["mode"].values))
    assert not found.settings
    assert not found.notes
    # A mode that failed has no errors to compare.
    assert all(pair.difference == 0.0 for pair in found.numbers)
    assert all(pair.difference == 0.0 for pair in found.motions)
    assert len(found.motions) > 3 * 8


def test_differences_are_those_that_were_made():
    data = tracked()
    away = np.zeros(data["end_effector"].shape)
    away[1, 20] = 3e-3, -4e-3
    torque = data["torque"].copy(deep=True)
    torque[0, 7, 2] += 0.5
    found = pf.compare(data, changed(data, end_effector=data["end_effector"] + away, torque=torque,
                                     tracking_rms=1.25 * data["tracking_rms"]))  # fmt: skip
    pair = motion(found, "+-+-", "end_effector")
    assert pair.difference == pytest.approx(5e-3)
    assert pair.time == pytest.approx(data["time"].values[20])
    assert motion(found, "++++", "end_effector").difference == 0.0
    third = str(data["motor"].values[2])
    assert motion(found, "++++", "torque", third).difference == pytest.approx(0.5)
    assert number(found, "++++", "tracking_rms").relative == pytest.approx(0.25)
    # What differs most comes first, the integration last.
    own = [pair for pair in found.numbers if pair.mode == "++++"]
    loads = [pair for pair in own if pair.name == "joint_force_max" or pair.name.startswith(("stress_", "safety_"))]
    assert own[: len(loads)] == loads
    assert loads[-1].name == "joint_force_max"
    own = own[len(loads) :]
    assert own[0].name == "tracking_rms"
    assert [pair.of_solver for pair in own] == sorted(pair.of_solver for pair in own)
    assert {"steps", "wall_time"} <= {pair.name for pair in own if pair.of_solver}


def test_runs_at_other_times_are_interpolated():
    data = tracked().isel(mode=slice(0, 2))
    coarse = data.isel(time=slice(0, 46, 5))
    found = pf.compare(data, coarse)
    assert any("until 0.09 s" in note for note in found.notes)
    pair = motion(found, "++++", "end_effector")
    step = np.linalg.norm(np.diff(data["end_effector"].sel(mode="++++").values, axis=0), axis=1).max()
    # Far less than the path between two samples, which is what taking the nearest would give.
    assert 0.0 < pair.difference < 0.2 * step
    assert pair.time <= 0.09 + 1e-12


def test_a_run_that_stopped_is_compared_until_then():
    data = tracked()
    whole = changed(data)
    for name in ("end_effector", "angle", "deflection"):
        whole[name][2] = data[name][0].values
    whole["status"] = whole["status"].copy(deep=True)
    whole["status"][2] = "complete"
    found = pf.compare(whole, data)
    assert any("complete" in note and "failed" in note and "-+-+" in note for note in found.notes)
    pair = motion(found, "-+-+", "end_effector")
    assert np.isfinite(pair.difference)
    assert pair.time <= data["time"].values[25]


def test_what_only_one_run_has_is_named():
    data = tracked()
    less = data.sel(mode=["+-+-"]).isel(motor=slice(0, 3))
    found = pf.compare(data, less)
    assert found.modes == ("+-+-",)
    assert "modes in A only: ++++, -+-+" in found.notes
    assert f"motors in A only: {data['motor'].values[3]}" in found.notes
    assert len([pair for pair in found.motions if pair.name == "torque"]) == 3
    with pytest.raises(InputError, match="no mode in common"):
        pf.compare(data.sel(mode=["++++"]), less)
    with pytest.raises(InputError, match="unknown mode in B"):
        pf.compare(data, less, ["++++"])


def test_settings_that_differ_are_named():
    first = tracked().assign_attrs(parameters='{"run": {"tolerance": 1e-4, "step": null}, "model": {"name": "a"}}')
    second = tracked().assign_attrs(parameters='{"run": {"tolerance": 1e-5}, "model": {"name": "a", "x": [1]}}')
    assert pf.compare(first, second).settings == {"run.tolerance": (1e-4, 1e-5), "model.x": (None, [1])}


def test_other_results_are_refused(tmp_path):
    with pytest.raises(InputError, match="verification"):
        pf.compare(tracked(), verified()[0])
    (tmp_path / "study.json").write_text("{}")
    with pytest.raises(InputError, match="holds a study of many runs, not a run"):
        pf.compare(tmp_path, tracked())
    with pytest.raises(InputError, match="no such file"):
        pf.compare(tmp_path / "nothing", tracked())


def test_figures_have_the_curves_of_both():
    data = tracked()
    found = pf.compare(data, changed(data, torque=data["torque"] * 1.5))
    figure = overlaid_motion(found, "torque", "++++")
    assert len(figure.axes) == data.sizes["motor"]
    for k, panel in enumerate(figure.axes):
        first, second = (np.asarray(line.get_ydata()) for line in panel.lines[:2])
        np.testing.assert_allclose(first, data["torque"].sel(mode="++++").values[:, k])
        np.testing.assert_allclose(second, 1.5 * first)
    with pytest.raises(InputError, match="one of end_effector, torque"):
        overlaid_motion(found, "temperature", "++++")


def test_the_command_prints_and_writes_what_differs(tmp_path):
    for name, tolerance in (("first", "1e-4"), ("second", "1e-5")):
        done = paraflex("run", "-m", "pendulum", "--duration", "0.1", "--samples", "21", "--tol", tolerance,
                        "--no-report", "--out", str(tmp_path / name))  # fmt: skip
        assert done.returncode == 0, done.stderr
    runs = (str(tmp_path / "first"), str(tmp_path / "second"))
    done = paraflex("compare", *runs, "--out", str(tmp_path / "compared"))
    assert done.returncode == 0, done.stderr
    assert "run.tolerance" in done.stdout
    assert "joint force" in done.stdout
    written = json.loads((tmp_path / "compared" / "compare.json").read_text())
    del written["digest"]
    assert written["settings"]["run.tolerance"] == [1e-4, 1e-5]
    assert written["modes"][""]["motions"]["angle.beam"]["difference"] > 0.0
    figures = {file.name for file in (tmp_path / "compared" / "figures").iterdir()}
    assert {"overlaid_angle.png", "overlaid_joint_force.png"} <= figures
    printed = paraflex("compare", *runs, "--json")
    assert json.loads(printed.stdout) == written
    refused = paraflex("compare", *runs, "--mode", "++")
    assert refused.returncode == 2
    assert "--mode" in refused.stderr
