"""What commands say of a folder that holds results already, before they compute."""

import json
import os
import time
from pathlib import Path

import pytest

from paraflex.cli import app as program
from paraflex.cli.replacing import print_replaced

SHORT = ["five_bar", "--duration", "0.05", "--samples", "11"]
RUN = ["run", *SHORT, "--mode", "++", "--tol", "1e-3", "--rigid", "--no-report"]
MOTION = ["run", "pendulum", "--duration", "0.05", "--rigid", "--no-report"]
VERIFY = ["verify", *SHORT, "--model", "rigid", "--no-report"]
COMPARE = ["compare-methods", *SHORT, "--method", "esdirk5", "--tol", "1e-3"]
STUDY = """
name = "bars"
mechanism = "five_bar"
paths = ["square"]
modes = ["++"]
metrics = ["tracking_rms"]
duration = 0.05
samples = 11
{sampling}
[vary.thickness]
fields = ["section.bar.thickness"]
{values}
"""


@pytest.fixture
def paraflex(monkeypatch, capsys):
    """Run a command; what it printed on stdout and stderr."""

    def call(*line, code=0):
        monkeypatch.setattr("sys.argv", ["paraflex", *line])
        with pytest.raises(SystemExit) as end:
            program.main()
        assert (end.value.code or 0) == code
        said = capsys.readouterr()
        return said.out, said.err

    return call


def dated(folder, names):
    """Set the date of files; what it is in a message."""
    when = time.mktime((2026, 11, 22, 23, 11, 0, 0, 0, -1))
    for name in names:
        os.utime(folder / name, (when, when))
    return "2026-11-22 23:11"


@pytest.mark.parametrize(
    ("line", "file", "says"),
    [
        ([*RUN, "--no-figures"], "summary.json", 'a run of five_bar along "square", mode ++'),
        (MOTION, "summary.json", "a run of pendulum"),
        (VERIFY, "verify.json", 'a verification of five_bar along "square", mode ++'),
        (COMPARE, "compare-methods.json", "a comparison of methods of five_bar"),
    ],
)
def test_a_second_run_says_what_it_replaces_before_it_computes(paraflex, monkeypatch, tmp_path, line, file, says):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "here"
    _, first = paraflex(*line, "--out", "here")
    assert "holds" not in first
    date = dated(folder, [file])
    whole = f"here holds {says}, {date}; it will be replaced (--out another folder keeps both)"
    out, err = paraflex(*line, "--out", "here", "--json")
    assert err.splitlines()[0] == whole
    assert "holds" not in out


def test_results_of_another_kind_are_named_with_the_files_they_lose(paraflex, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    sampling = '[sampling]\nkind = "list"'
    (tmp_path / "bars.toml").write_text(STUDY.format(sampling=sampling, values="values = [0.005]"))
    _, err = paraflex("sweep", "bars.toml", "--out", "here", "--no-report")
    assert "here holds" not in err
    _, again = paraflex("sweep", "bars.toml", "--out", "here", "--no-report")
    assert "here holds" not in again, "a sweep goes on: it replaces nothing"
    before = {file.name for file in (tmp_path / "here").iterdir()}
    _, err = paraflex(*RUN, "--out", "here", code=2)
    assert "--out: the folder holds other results, a study of many runs (got 'here'); name another folder" in err
    assert {file.name for file in (tmp_path / "here").iterdir()} == before
    (tmp_path / "here" / "notes.txt").write_text("mine")
    date = dated(tmp_path / "here", ["study.json"])
    _, err = paraflex(*RUN, "--out", "here", "--force")
    said = f'here holds a sweep "bars" of 1 run, {date}; it will be replaced (--out another folder keeps both)'
    assert err.splitlines()[:2] == [said, "here holds files not written by paraflex, which stay: notes.txt"]
    assert {file.name for file in (tmp_path / "here").iterdir()} == {
        ".lock", "figures", "manifest.json", "notes.txt", "results.nc", "summary.json",
    }  # fmt: skip
    _, err = paraflex("sweep", "bars.toml", "--out", "here", code=2)
    assert "--output: the folder holds other results, a run (got 'here'); name another folder\n" in err


def test_a_run_without_a_report_leaves_none_of_the_run_before(paraflex, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    paraflex(*RUN[:-1], "--out", "here")
    paraflex("plot", "here", "tracking_errors", "--format", "pdf")
    drawn = {file.name for file in Path("here/figures").iterdir()}
    paraflex(*MOTION, "--out", "here")
    assert not Path("here/report.html").exists()
    assert not drawn & {file.name for file in Path("here/figures").iterdir()}
    files = {file.relative_to("here").as_posix() for file in Path("here").rglob("*") if file.is_file()}
    listed = json.loads(Path("here/manifest.json").read_text(encoding="utf-8"))["files"]
    assert files == {*listed, "manifest.json", ".lock"}


def test_figures_and_reports_made_later_belong_to_the_results(paraflex, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    paraflex(*RUN, "--out", "here")
    before = json.loads(Path("here/manifest.json").read_text(encoding="utf-8"))
    paraflex("plot", "here", "tracking_errors", "--format", "pdf")
    paraflex("report", "here")
    (drawn,) = Path("here/figures").glob("*.pdf")
    paraflex("export", "here", "--to", "mat")
    after = json.loads(Path("here/manifest.json").read_text(encoding="utf-8"))
    assert after["identity"] == before["identity"]
    new = set(after["files"]) - set(before["files"])
    assert "report.html" in new
    assert new == {"report.html", f"figures/{drawn.name}", "export/results.mat"}
    # The same numbers have the same figures, other numbers others.
    paraflex(*RUN, "--out", "here")
    assert Path("here/export").exists()
    paraflex(*RUN, "--out", "here", "--set", "material.aluminium.density=2600")
    assert not Path("here/export").exists()


def test_sensitivities_made_again_are_named(paraflex, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bars.toml").write_text(STUDY.format(sampling="", values=""))
    _, first = paraflex("sensitivity", "bars.toml", "--out", "here")
    assert "holds" not in first
    date = dated(tmp_path / "here", ["sensitivity.json"])
    _, again = paraflex("sensitivity", "bars.toml", "--out", "here")
    assert f'here holds sensitivities "bars", {date}; it will be replaced' in again


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"parameters": {"run": 3}}'])
def test_damaged_results_are_named_by_their_kind(tmp_path, capsys, text):
    (tmp_path / "summary.json").write_text(text)
    date = dated(tmp_path, ["summary.json"])
    print_replaced(tmp_path)
    said = " ".join(capsys.readouterr().err.split())
    assert said.endswith(f"holds a run, {date}; it will be replaced (--out another folder keeps both)")


def test_other_files_are_named(tmp_path, capsys):
    print_replaced(tmp_path)
    assert capsys.readouterr().err == ""
    for name in "abcde":
        (tmp_path / name).write_text("mine")
    print_replaced(tmp_path)
    said = capsys.readouterr().err
    assert said == f"{tmp_path} holds files not written by paraflex, which stay: a, b, c and 2 more\n"
