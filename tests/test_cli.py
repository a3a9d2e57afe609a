"""The command line as a user meets it: exit codes, one-line errors, files written, interrupted and repeated runs."""

import json
from pathlib import Path

import numpy as np
import pytest

from paraflex.files import library_file, library_names, load
from paraflex.results import load_results
from paraflex.studies.tracking import StudyResult
from shell import interrupted, paraflex

FAST = ["--tol", "1e-3", "--duration", "0.1", "--samples", "51"]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    out = tmp_path_factory.mktemp("run") / "deep" / "results"
    done = paraflex("run", "raparm_i", "--mode", "++++", "--mode", "-+-+", *FAST, "--out", str(out))
    return done, out


def test_run_writes_summary_results_and_figures(results):
    done, out = results
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "tracking error" in done.stdout
    assert sorted(entry.name for entry in out.iterdir()) == [
        ".lock", "figures", "manifest.json", "report.html", "results.nc", "summary.json",
    ]  # fmt: skip
    # A figure of each mode has its signs in its name.
    names = {entry.stem.split("_+")[0].split("_-")[0] for entry in (out / "figures").iterdir()}
    assert names == {
        "desired_path", "motor_torques", "tip_deflections", "link_motions", "end_effector_path", "end_effector_motion",
        "phase_diagrams", "tracking_errors",
    }  # fmt: skip
    assert {entry.suffix for entry in (out / "figures").iterdir()} == {".png", ".svg"}


def test_summary_has_what_it_promises(results):
    _, out = results
    summary = json.loads((out / "summary.json").read_text())
    mode = summary["modes"]["++++"]
    for key in ("steps", "rejected", "newton_iterations"):
        assert isinstance(mode[key], int)
    for key in (
        "tracking_rms",
        "wall_time",
        "constraint_position_max",
        "constraint_velocity_max",
        "energy_balance_max",
    ):
        assert mode[key] > 0.0
    assert set(mode["peak_torque"]) == {"tau1", "tau2", "tau5", "tau6"}
    assert len(mode["end_effector_final"]) == 2
    assert summary["modes"]["-+-+"]["peak_torque"]["tau1"] == 0.0
    assert summary["parameters"]["run"]["tolerance"] == 1e-3
    assert summary["version"]


def test_results_agree_with_the_summary(results):
    _, out = results
    data = load_results(out / "results.nc")
    summary = json.loads((out / "summary.json").read_text())
    assert data["end_effector"].dims == ("mode", "time", "axis")
    assert data["torque"].dims == ("mode", "time", "motor")
    for name in ("angle", "angular_velocity", "angular_acceleration"):
        assert data[name].dims == data[f"{name}_desired"].dims == ("mode", "time", "body")
    for name in ("tip_axial", "tip_transverse", "tip_slope"):
        assert data[name].dims == ("mode", "time", "body")
    assert data.sizes["time"] == 51
    assert all(data[name].attrs["units"] for name in data.data_vars)
    distance = ((data["end_effector"] - data["end_effector_desired"]) ** 2).sum("axis").sel(mode="++++")
    rms = float(np.sqrt(distance.mean("time")))
    assert rms == pytest.approx(summary["modes"]["++++"]["tracking_rms"], rel=1e-12)
    final = data["end_effector"].sel(mode="++++").isel(time=-1)
    assert list(final.values) == summary["modes"]["++++"]["end_effector_final"]
    assert json.loads(data.attrs["parameters"])["model"]["name"] == "RAParM-I"


def test_runs_are_summarised_once(tmp_path, monkeypatch):
    made, make = [], StudyResult.to_dict
    monkeypatch.setattr(StudyResult, "to_dict", lambda result: made.append(make(result)) or made[-1])
    done = paraflex("run", "raparm_i", "--no-figures", "--no-report", "--mode", "++++", *FAST, "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert len(made) == 1
    assert json.loads((tmp_path / "summary.json").read_text()).items() >= json.loads(json.dumps(made[0])).items()


def test_second_run_gives_the_same_numbers(results, tmp_path):
    _, out = results
    again = paraflex("run", "raparm_i", "--no-figures", "--mode", "++++", *FAST, "--out", str(tmp_path), "--json")
    assert again.returncode == 0
    first, second = json.loads((out / "summary.json").read_text()), json.loads(again.stdout)
    assert first["modes"]["++++"]["tracking_rms"] == second["modes"]["++++"]["tracking_rms"]


def test_json_is_all_that_is_on_stdout(tmp_path):
    done = paraflex(
        "run", "raparm_i", "--no-figures", "--mode", "++++", "--rigid", *FAST, "--out", str(tmp_path), "--json"
    )
    summary = json.loads(done.stdout)
    assert summary["modes"]["++++"]["tracking_rms"] < 1e-3
    assert summary["parameters"]["run"]["rigid"] is True


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--mode", "+-+"], "--mode: not an actuation mode (got '+-+'); write one + or - for each of the 4 motors"),
        (["--mode", "tau1,tau9"], "--mode: not an actuation mode (got 'tau1,tau9')"),
        (
            ["--geometry", "second"],
            "--geometry: unknown geometry (got 'second'); did you mean \"second-order\"?",
        ),
        (["--tol", "0"], "--tol: must be positive (got 0.0); give a length in metres"),
        (["--tol", "nan"], "--tol: must be positive"),
        (["--duration", "-1"], "--duration: must be positive (got -1.0); give it in seconds"),
        (["--samples", "1"], "--samples: too few samples (got 1); ask for at least 2"),
        (["--alpha", "-1"], "--alpha: must not be negative"),
        (["--path", "spiral"], "raparm_i.toml: path: unknown path (got 'spiral'); choose from square, line, circle"),
        (["--path", "none.toml"], "none.toml: file: cannot be read (no such file or directory)"),
        (["--assembly", "sideways"], "--assembly: unknown assembly (got 'sideways')"),
        (
            ["--mechanism", "raparm"],
            "mechanism: neither a library mechanism nor a file (got 'raparm'); did you mean \"",
        ),
        (["--mechanism", "none.toml"], "none.toml: file: cannot be read"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, arguments, says):
    model = [] if "--mechanism" in arguments else ["raparm_i"]
    done = paraflex("run", *model, *arguments, "--out", str(tmp_path / "out"), cwd=tmp_path)
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.rglob("*.nc*"))
    assert not list(tmp_path.rglob("summary*"))


@pytest.mark.parametrize(
    ("command", "options"),
    [("run", []), ("run", ["--rigid", "--out", "there"]), ("run", ["--set", "link1.length=1"]),
     ("kinematics", ["--drive", "O"]), ("torques", ["--out", "there"])],
)  # fmt: skip
def test_run_without_a_model_says_what_can_be_run(tmp_path, command, options):
    done = paraflex(command, *options, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    assert lines[0] == f"error: no model is named; paraflex {command} NAME takes a mechanism of the library:"
    told = dict(line.split(maxsplit=1) for line in lines if line.startswith("  "))
    assert told == {name: load(name).mechanism.description for name in library_names()}
    assert "four_bars:N" in lines[-2]
    assert all(way in lines[-1] for way in (f"paraflex {command} FILE.toml", "paraflex new NAME"))
    assert not list(tmp_path.iterdir())


def test_make_run_names_the_study():
    assert "paraflex run raparm_i --out results\n" in (Path(__file__).parents[1] / "Makefile").read_text()


def test_unwritable_folder(tmp_path):
    (tmp_path / "file").write_text("in the way")
    done = paraflex("run", "raparm_i", *FAST, "--out", str(tmp_path / "file" / "results"))
    assert done.returncode == 2
    assert "--out: cannot be written" in done.stderr
    assert "choose another folder" in done.stderr
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_unreachable_path_names_file_time_and_place(tmp_path):
    source = library_file("raparm_i").read_text(encoding="utf-8")
    model = tmp_path / "far.toml"
    model.write_text(source.replace("[[0.050, 0.314], [-0.050, 0.314]", "[[0.050, 0.314], [-0.050, 0.614]"))
    out = tmp_path / "out"
    done = paraflex("run", "--mechanism", str(model), *FAST[:2], "--out", str(out))
    assert done.returncode == 2
    assert f"error: {model}: path.square: " in done.stderr
    assert "t = 0." in done.stderr
    assert "end-effector at (" in done.stderr
    assert not out.exists()


def test_mode_that_cannot_drive_is_reported_and_the_others_go_on(tmp_path):
    done = paraflex(
        "run", "raparm_i", "--no-figures", "--mode", "tau1", "--mode", "++++", *FAST, "--out", str(tmp_path), "--json"
    )
    assert done.returncode == 1
    assert 'mode "+---" cannot drive the mechanism: 1 active motor for 2 degrees of freedom' in done.stderr
    modes = json.loads(done.stdout)["modes"]
    assert modes["+---"]["status"] == "failed"
    assert modes["++++"]["status"] == "complete"


def test_too_many_steps_keep_what_there_is(tmp_path):
    done = paraflex(
        "run",
        "raparm_i",
        "--no-figures",
        "--mode",
        "++++",
        *FAST,
        "--max-steps",
        "20",
        "--out",
        str(tmp_path),
        "--json",
    )
    assert done.returncode == 1
    assert 'mode "++++": the run has not ended after 20 steps, at t = ' in done.stderr
    data = load_results(tmp_path / "results.nc")
    assert data["status"].item() == "failed"
    assert data["end_effector"].notnull().any()
    assert data["end_effector"].isnull().any()


def test_interrupt_keeps_what_there_is(tmp_path):
    # A tolerance that takes minutes.
    assert "interrupted at t = " in interrupted("run", "raparm_i", "--mode", "+-+-", "--tol", "1e-9", "--out", tmp_path)
    data = load_results(tmp_path / "results.nc")
    assert data["status"].item() == "interrupted"
    assert data["end_effector"].notnull().any()
    assert json.loads((tmp_path / "summary.json").read_text())["modes"]["+-+-"]["tracking_rms"] is None


def test_info_counts():
    done = paraflex("info", "raparm_i", "--json")
    facts = json.loads(done.stdout)
    assert (facts["bodies"], facts["coordinates"], facts["constraints"]) == (8, 104, 22)
    assert facts["degrees_of_freedom"] == 2
    assert facts["redundant_constraints"] == []
    # Eight links of 0.03 x 0.005 m aluminium, 16 joint lumps and two end lumps.
    length = 2 * (0.25 + 0.1 + 0.25 + 0.25)
    assert facts["total_mass"] == pytest.approx(length * 0.00015 * 2700 + 16 * 0.130 + 2 * 0.225, rel=1e-12)
    table = paraflex("info", "raparm_i").stdout
    assert "total mass [kg]" in table
    assert "link8" in table


def test_modes_lists_table_1():
    done = paraflex("modes", "--json")
    rows = json.loads(done.stdout)
    assert [row["mode"] for row in rows] == ["+-+-", "-+-+", "+--+", "-++-", "+++-", "++-+", "+-++", "-+++", "++++"]
    assert all(row["drives_path"] for row in rows)
    assert [row["redundancy"] for row in rows] == [0, 0, 0, 0, 1, 1, 1, 1, 2]
    assert "tau1, tau5" in paraflex("modes").stdout


def without(tables, name, tmp_path):
    """A library mechanism without some tables, as a file."""
    kept, keep = [], True
    for line in library_file(name).read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            keep = not line.startswith(tuple(f"[{table}" for table in tables))
        kept += [line] if keep else []
    file = tmp_path / f"{name}.toml"
    file.write_text("\n".join(kept), encoding="utf-8")
    return str(file)


def test_modes_of_a_model_without_any_are_sets_of_motors_that_suffice(tmp_path):
    done = paraflex("modes", without(["mode", "study"], "raparm_i", tmp_path), "--path", "square", "--json")
    rows = json.loads(done.stdout)
    known = {row["mode"]: row for row in json.loads(paraflex("modes", "--json").stdout)}
    assert all(row["declared"] for row in known.values())
    assert not any(row["declared"] for row in rows)
    # Two motors drive a mechanism of two freedoms; there are six pairs of four. All motors are the last.
    assert [len(row["motors"]) for row in rows] == [2] * 6 + [4]
    conditions = [row["condition_max"] for row in rows[:-1]]
    assert conditions == sorted(conditions)
    for row in rows:
        if row["mode"] in known:
            assert row["condition_max"] == pytest.approx(known[row["mode"]]["condition_max"], rel=1e-12)
    assert "RAParM-I has no [mode] tables" in done.stderr
    assert "choose some by --mode tau2,tau6" in done.stderr
    table = paraflex("modes", without(["mode", "study"], "raparm_i", tmp_path))
    assert "tau5, tau6" in table.stdout
    assert "has no [mode] tables" in table.stderr


def test_modes_of_the_study_are_listed(tmp_path):
    file = without(["mode"], "raparm_i", tmp_path)
    rows = json.loads(paraflex("modes", file, "--json").stdout)
    assert rows
    assert all(row["declared"] for row in rows)


def test_modes_without_a_path_or_motors_say_so(tmp_path):
    done = paraflex("modes", without(["mode", "study", "path"], "raparm_i", tmp_path), "--json")
    rows = json.loads(done.stdout)
    assert [len(row["motors"]) for row in rows] == [2] * 6 + [4]
    assert all("drives_path" not in row for row in rows)
    assert "RAParM-I has no path: add [path.NAME]" in done.stderr
    for how in ([], ["--json"]):
        done = paraflex("modes", "four_bar", *how)
        assert done.stdout.strip() == ("[]" if how else "")
        assert "four-bar has no motors, hence no actuation modes: add [motor]" in done.stderr


def test_modes_of_too_few_motors_are_json_for_all_readers(tmp_path):
    source = library_file("raparm_i").read_text(encoding="utf-8")
    file = tmp_path / "short.toml"
    file.write_text(source.replace("[mode]", '[mode]\nalone = ["tau1"]'), encoding="utf-8")
    done = paraflex("modes", str(file), "--json")
    # Infinity is no JSON.
    row = next(row for row in json.loads(done.stdout, parse_constant=pytest.fail) if row["mode"] == "alone")
    assert row["condition_max"] is None
    assert row["drives_path"] is False
    assert "infinite" in paraflex("modes", str(file)).stdout


def test_version_and_help():
    assert paraflex("--version").stdout.strip().count(".") == 2
    assert "run" in paraflex("--help").stdout
    assert paraflex("rum").returncode == 2


def test_info_speaks_of_no_motors_where_there_are_none():
    driven, fallen, moved = (paraflex("info", name).stdout for name in ("four_bar", "pendulum", "five_bar"))
    assert "  prescribed motions held: " in driven
    assert " rpm" in driven
    assert "  lowest: " in fallen
    assert "motors free" not in driven + fallen
    assert "motors free" in moved
