"""Several paths in one run: each in every mode, each with the results that a run of its own would have."""

import json
import re
import signal
import sys
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest
import xarray as xr
from matplotlib.figure import Figure

import paraflex as pf
from paraflex.errors import InputError
from paraflex.files import StudyDefaults, library_file
from paraflex.studies import load_sensitivities, load_sweep
from processes import started
from shell import BEGUN, paraflex

FAST = ("--tol", "1e-3", "--samples", "21", "--no-report")
QUICK = ("--no-report", "--no-figures")
PATHS = ("--path", "line", "--path", "square")


def model_file(folder, study, more=""):
    """`five_bar` with another study and more tables."""
    text = library_file("five_bar").read_text(encoding="utf-8")
    file = folder / "bars.toml"
    file.write_text(f"{text[: text.index('[study]')]}{more}\n[study]\n{study}\n")
    return file


@contextmanager
def unpainted():
    """Figures are laid out and named, and nothing is in their files: to write them takes half of a command's time."""
    with patch.object(Figure, "savefig", lambda figure, file, **_: Path(file).touch()):
        yield


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    out = tmp_path_factory.mktemp("two")
    with unpainted():
        return paraflex("run", "five_bar", *PATHS, "--mode", "++", *FAST, "--out", out), out


def test_each_path_has_the_results_of_a_run_of_its_own(two, tmp_path):
    done, out = two
    assert done.returncode == 0, done.stderr
    assert sorted(each.name for each in out.iterdir()) == ["line", "square"]
    for path in ("line", "square"):
        with unpainted():
            alone = paraflex("run", "five_bar", "--path", path, "--mode", "++", *FAST, "--out", tmp_path / path)
        assert alone.returncode == 0
        own, apart = pf.load_results(out / path), pf.load_results(tmp_path / path)
        xr.testing.assert_identical(own.drop_vars("wall_time").drop_attrs(), apart.drop_vars("wall_time").drop_attrs())
        assert own.attrs["findings"] == apart.attrs["findings"]
        assert own.attrs["parameters"] == apart.attrs["parameters"]
        figures = [sorted(file.name for file in (at / "figures").iterdir()) for at in (out / path, tmp_path / path)]
        assert figures[0] == figures[1] != []
        assert f"results, figures in {out / path}" in done.stderr


def test_one_table_has_all_paths_and_modes(two):
    done, out = two
    summaries = {path: json.loads((out / path / "summary.json").read_text()) for path in ("line", "square")}
    rows = [line.split() for line in done.stdout.splitlines()]
    for path, summary in summaries.items():
        (row,) = [row for row in rows if row[:2] == [path, "++"] and len(row) == 7]
        numbers = summary["modes"]["++"]
        unit = re.search(r"\[(.m)\]", done.stdout)[1]
        error = {"mm": 1e-3, "µm": 1e-6}[unit] * float(row[2])
        assert error == pytest.approx(numbers[f"tracking_rms_{summary['error']}"], rel=1e-3)
        assert [float(one) for one in row[3:5]] == pytest.approx([*numbers["peak_torque"].values()], abs=0.006)
        (stressed,) = [row for row in rows if row[:2] == [path, "++"] and row[2][0].isalpha()]
        most = max(one["stress_max"] for one in numbers["loads"]["beams"].values())
        assert float(stressed[3]) == pytest.approx(1e-6 * most, rel=1e-3)
    assert "mode ++, path " in done.stdout


def test_where_results_are_comes_last(tmp_path):
    done = paraflex("run", "--no-figures", "five_bar", *PATHS, "--mode", "++", *FAST, "--out", tmp_path, mixed=True)
    last = done.stdout.splitlines()[-2:]
    assert [line.rpartition(" ")[2] for line in last] == [str(tmp_path / path) for path in ("line", "square")]


def test_json_lists_both(tmp_path):
    done = paraflex(
        "run", "--no-figures", "five_bar", *PATHS, "--mode", "++", "--mode", "left", *FAST, "--out", tmp_path, "--json"
    )
    assert done.returncode == 1  # one motor cannot drive it
    told = json.loads(done.stdout)["paths"]
    assert [*told] == ["line", "square"]
    for path in told:
        kept = json.loads((tmp_path / path / "summary.json").read_text())
        assert told[path] == {name: value for name, value in kept.items() if name != "digest"}
        assert done.stderr.count(f'error: path "{path}": mode "+-" cannot drive') == 1


def test_the_study_names_paths(tmp_path):
    file = model_file(tmp_path, 'paths = ["square", "line"]\nmodes = ["++"]\nduration = 0.7')
    model = pf.load(file)
    assert model.study.paths == ("square", "line")
    assert model.path_name() == "square"
    assert model.duration("square") == 0.7
    assert model.duration("line") == pytest.approx(0.7 * model.path("line").duration / model.path("square").duration)
    model.save(tmp_path / "again.toml")
    assert pf.load(tmp_path / "again.toml").study == model.study
    done = paraflex("run", "--no-figures", file, "--rigid", *FAST, "--out", tmp_path / "out", "--json")
    assert done.returncode == 0, done.stderr
    assert [*json.loads(done.stdout)["paths"]] == ["square", "line"]
    # What is asked for goes before what the study has, and one path has the folder for itself.
    one = paraflex("run", "--no-figures", file, "--rigid", "--path", "line", *FAST, "--out", tmp_path / "one", "--json")
    assert json.loads(one.stdout)["parameters"]["run"]["path"] == "line"
    assert (tmp_path / "one" / "results.nc").is_file()


FAR = '[path.far]\ntype = "line"\nstart = [0.0, 0.3]\nend = [0.0, 3.0]\nmax_acceleration = 5.0\n'
FASTER = '[path.fast]\ntype = "line"\nstart = [0.0, 0.3]\nend = [0.02, 0.3]\nmax_acceleration = 5e3\n'


def test_info_looks_at_all_paths_of_the_study(tmp_path):
    file = model_file(tmp_path, 'paths = ["line", "far", "fast"]\nmodes = ["++"]', FAR + FASTER)
    found = {one.place: one for one in pf.check(file)}
    assert found["path.far"].code == "path-unreachable"
    assert found["path.fast"].code == "path-fast"
    assert "path.line" not in found
    assert [one.place for one in pf.check(file, path="line")] == []
    assert "path.far" not in {one.place for one in pf.check(file, path="fast")}
    done = paraflex("info", file)
    assert done.returncode == 1
    assert "path.far: " in done.stdout
    file = model_file(tmp_path, 'paths = ["line", "square"]\nmodes = ["++"]')
    assert "the study's paths can be followed" in paraflex("info", file).stdout
    assert "the study's path can be followed" in paraflex("info", file, "--path", "line").stdout


def test_findings_that_differ_between_paths_name_theirs(tmp_path):
    push = '[load.push]\ntype = "torque"\npoint = "distal1.C"\ntable = [[0, 0], [2, 0.1]]\n'
    file = model_file(tmp_path, 'paths = ["line", "square"]\nmodes = ["++"]', push)
    found = [one.text for one in pf.check(file) if one.code == "law-cut-short"]
    assert [text.partition(", ")[0] for text in found] == ["on path line", "on path square"]
    # What is the same for all of them is said once, and of no path.
    file.write_text(re.sub(r"\[mode\]\n.*?\n\n", "\n", file.read_text(), flags=re.DOTALL).replace('modes = ["++"]', ""))
    (one,) = [one for one in pf.check(file) if one.code == "mode-missing"]
    assert not one.text.startswith("on path")


def test_studies_of_many_designs_take_all_paths_of_the_study(tmp_path):
    model_file(tmp_path, 'paths = ["square", "line"]\nmodes = ["++"]')
    text = (
        'mechanism = "bars.toml"\nmetrics = ["tracking_rms"]\nsamples = 11\n[vary.w]\nfields = ["section.bar.width"]\n'
    )
    (tmp_path / "sweep.toml").write_text(text + "values = [0.03]\n[integration]\ntolerance = 1e-3\n")
    sweep = load_sweep(tmp_path / "sweep.toml")
    assert sweep.setting.paths == ("square", "line")
    assert {*sweep.run(tmp_path / "out").data["path"].values.tolist()} == {"square", "line"}
    (tmp_path / "sweep.toml").write_text('paths = ["line"]\n' + text + "values = [0.03]\n")
    assert load_sweep(tmp_path / "sweep.toml").setting.paths == ("line",)
    (tmp_path / "slopes.toml").write_text(text)
    assert load_sensitivities(tmp_path / "slopes.toml").setting.paths == ("square", "line")


@pytest.mark.parametrize(
    ("study", "says"),
    [
        ('paths = ["line", "line"]', "study.paths: is named twice (got 'line')"),
        ('paths = ["line", "lane"]', "study.paths: unknown path (got 'lane'); did you mean \"line\"?"),
        (
            'path = "line"\npaths = ["line", "square"]',
            "study.paths: is given together with path; leave one of them out",
        ),
    ],
)
def test_a_study_that_names_paths_wrongly_is_refused(tmp_path, study, says):
    with pytest.raises(InputError, match=r"study\.paths") as caught:
        pf.load(model_file(tmp_path, study))
    assert says in str(caught.value)


def test_a_study_of_python_with_both_cannot_be_saved(tmp_path):
    model = pf.load("five_bar")
    study = StudyDefaults(path="line", paths=("line", "square"))
    with pytest.raises(InputError, match="is given together with path"):
        replace(model, study=study).save(tmp_path / "model.toml")


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (("five_bar", "--path", "line", "--path", "line"), "--path: is named twice (got 'line'); name each path once"),
        (("five_bar", "--path", "line", "--path", "lane"), "five_bar.toml: path: unknown path (got 'lane'); did you"),
        (("pendulum", "--path", "a", "--path", "b"), "path: unknown path (got 'a'); there is none to choose from"),
    ],
)
def test_paths_that_cannot_be_are_refused_before_anything_runs(tmp_path, line, says):
    done = paraflex("run", *line, *FAST, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert says in done.stderr
    assert not (tmp_path / "out").exists()


FAR = '[path.far]\ntype = "line"\nstart = [0.0, 0.3]\nend = [9.0, 0.3]\nmax_acceleration = 8.0\n'


def test_a_path_out_of_reach_is_refused_before_the_first_is_run(tmp_path):
    file = model_file(tmp_path, 'modes = ["++"]', FAR)
    done = paraflex("run", file, "--path", "line", "--path", "far", *FAST, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "path.far: " in done.stderr
    assert not (tmp_path / "out").exists()


def test_names_are_made_portable_and_two_of_one_folder_refused(tmp_path):
    table = FAR.replace("9.0", "0.05").replace("0.0, 0.3", "-0.05, 0.3")
    more = "".join(table.replace("path.far", f'path."{name}"') for name in ("a:b", "A?B"))
    file = model_file(tmp_path, 'modes = ["++"]', more)
    done = paraflex("run", "--no-figures", file, "--path", "a:b", "--path", "A?B", *FAST, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "results of a:b and A?B would lie in one folder" in done.stderr
    done = paraflex(
        "run", "--no-figures", file, "--path", "a:b", "--path", "line", "--rigid", *FAST, "--out", tmp_path / "out"
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "a_b" / "summary.json").is_file()


def test_what_is_replaced_is_said_of_each_folder(two, tmp_path):
    for path in ("line", "square"):
        (tmp_path / path).mkdir()
    (tmp_path / "square" / "verify.json").write_text("{}")
    refused = paraflex("run", "five_bar", *PATHS, *FAST, "--out", ".", cwd=tmp_path)
    assert refused.returncode == 2
    assert "the folder holds other results, a verification (got 'square')" in refused.stderr


def test_an_interrupt_in_the_second_path_keeps_the_first(tmp_path):
    line = ("run", "raparm_i", "--path", "line", "--path", "circle", "--mode=+-+-", "--samples", "21", *QUICK)
    with started(sys.executable, "-c", BEGUN, *line, "--tol", "1e-4", "--out", str(tmp_path)) as child:
        child.until(lambda: child.err.count("begun\n") == 2)
        child.send(signal.SIGINT)
        done = child.end()
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    assert 'error: path "circle": mode "+-+-": interrupted at t = ' in done.stderr
    status = {path: pf.load_results(tmp_path / path)["status"].item() for path in ("line", "circle")}
    assert status == {"line": "complete", "circle": "interrupted"}
    assert "circle  +-+-  interrupted" in done.stdout


def test_an_interrupt_in_the_first_path_ends_the_run(tmp_path):
    line = ("run", "raparm_i", "--path", "circle", "--path", "line", "--mode=+-+-", "--samples", "21", *QUICK)
    with started(sys.executable, "-c", BEGUN, *line, "--tol", "1e-4", "--out", str(tmp_path)) as child:
        child.until(lambda: "begun\n" in child.err)
        child.send(signal.SIGINT)
        done = child.end()
    assert done.returncode == 130, done.stderr
    assert [folder.name for folder in tmp_path.iterdir()] == ["circle"]
