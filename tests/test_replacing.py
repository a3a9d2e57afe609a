"""What commands say of a folder that holds results already, before they compute."""

import os
import time

import pytest

from paraflex.cli import app as program
from paraflex.cli.replacing import say_replaced

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

    def call(*line):
        monkeypatch.setattr("sys.argv", ["paraflex", *line])
        with pytest.raises(SystemExit) as end:
            program.main()
        assert end.value.code in (0, None)
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
        (RUN, "summary.json", 'a run of five_bar along "square", mode ++'),
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
    date = dated(tmp_path / "here", ["study.json"])
    _, err = paraflex(*RUN, "--out", "here")
    assert err.splitlines()[0] == (
        f'here holds a sweep "bars" of 1 run, {date}; its summary.json will be replaced, and a run comes beside it '
        "(--out another folder keeps them apart)"
    )
    _, err = paraflex(*COMPARE, "--out", "here")
    assert 'here holds a sweep "bars" of 1 run' in err
    assert "and a comparison of methods comes beside it" in err


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
    say_replaced(tmp_path, "run")
    said = " ".join(capsys.readouterr().err.split())
    assert said.endswith(f"holds a run, {date}; it will be replaced (--out another folder keeps both)")


def test_other_folders_are_passed_without_a_word(tmp_path, capsys):
    say_replaced(tmp_path / "none", "run")
    (tmp_path / "notes.txt").write_text("mine")
    say_replaced(tmp_path, "run")
    assert capsys.readouterr().err == ""
