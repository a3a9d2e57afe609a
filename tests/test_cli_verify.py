"""`paraflex verify` as a user meets it, and the fidelities of `paraflex run`."""

import json
import sys

import pytest

from paraflex.files import load
from paraflex.paths import length_fraction
from paraflex.results import load_results
from shell import interrupted, paraflex
from test_cli import FAST

SHORT = ["--duration", "0.02", "--samples", "11", "--tol", "1e-5"]


def test_verify_prints_and_saves_how_models_agree(tmp_path):
    out = tmp_path / "deep" / "verification"
    done = paraflex("verify", "--model", "linear", "--model", "second-order", "--engine", "mujoco", *SHORT,
                    "--out", str(out))  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("warning: study.duration: only a part of the path was run: 0.02 of 0.532 s")
    assert (
        "error over the whole run, dwell included, and distances from the path of second-order geometry" in done.stdout
    )
    assert "Models, mode ++++\n" in done.stdout
    assert "Distances of paths, mode ++++\n" in done.stdout
    assert "Difference of angular velocities from second-order geometry, mode ++++\n" in done.stdout
    # Whole numbers at eighty columns, none cut short.
    assert "…" not in done.stdout
    assert sorted(entry.name for entry in out.iterdir()) == [
        ".lock", "figures", "manifest.json", "report.html", "verify.json", "verify.nc",
    ]  # fmt: skip
    figures = json.loads((out / "verify.json").read_text())
    models = figures["modes"]["++++"]["models"]
    assert list(models) == ["linear", "second-order", "mujoco"]
    assert figures["parameters"]["run"]["path"] == "square"
    assert figures["complete"]
    assert figures["part"]["length"] == pytest.approx(length_fraction(load("raparm_i").paths["square"], 0.02))
    data = load_results(out / "verify.nc")
    kept = float(data["tracking_rms"].sel(model="linear", mode="++++"))
    # Sums of the same squares, in another order.
    assert models["linear"]["tracking_error"] == pytest.approx(kept, rel=1e-14)
    assert {path.name for path in (out / "figures").iterdir()} >= {"model_distances.png", "compared_links_++++.svg"}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--engine", "mujuco"], "--engine: unknown engine (got 'mujuco'); did you mean \"mujoco\"?"),
        (["--model", "KED"], "--model: unknown model (got 'KED'); "),
        (["--segments", "0"], "--segments: must be positive (got 0)"),
        (["--tol", "-1"], "--tol: must be positive (got -1.0)"),
        (["--mode", "+-+"], "--mode: not an actuation mode"),
        (["--path", "spiral"], "path: unknown path (got 'spiral')"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, arguments, says):
    done = paraflex("verify", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_an_engine_that_is_not_there_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "exudyn", None)
    done = paraflex("verify", "--engine", "exudyn", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == (
        "error: engine: not installed (got 'exudyn'); install it with pip install 'paraflex[engines]'\n"
    )


def test_an_engine_that_diverges_is_reported_and_the_others_go_on(tmp_path):
    # Forty segments are 25 times as stiff as eight: MuJoCo's step no longer resolves them.
    done = paraflex("verify", "--model", "rigid", "--engine", "mujoco", "--segments", "40", *SHORT,
                    "--out", str(tmp_path), "--json")  # fmt: skip
    assert done.returncode == 1
    assert 'error: mode "++++", mujoco: base: MuJoCo diverges with steps of ' in done.stderr
    models = json.loads(done.stdout)["modes"]["++++"]["models"]
    assert (models["rigid"]["status"], models["mujoco"]["status"]) == ("complete", "failed")
    assert load_results(tmp_path / "verify.nc")["status"].sel(model="mujoco").item() == "failed"


def test_interrupt_keeps_the_models_that_are_done(tmp_path):
    interrupted("verify", "--model", "rigid", "--model", "second-order", "--tol", "1e-9", "--out", str(tmp_path))


@pytest.mark.parametrize(
    ("flag", "extra", "largest"), [("--segments", ["6"], 1e-3), ("--ked", [], 2e-2)], ids=["segments", "ked"]
)
def test_run_at_other_fidelities(tmp_path, flag, extra, largest):
    fast = [part for part in FAST if flag == "--segments" or part not in ("--tol", "1e-3")]
    done = paraflex("run", "raparm_i", "--mode", "++++", flag, *extra, *fast, "--out", str(tmp_path), "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert 1e-6 < summary["modes"]["++++"]["tracking_rms"] < largest
    assert summary["parameters"]["run"][flag[2:]]
    data = load_results(tmp_path / "results.nc")
    assert list(data["body"].values) == [f"link{i}" for i in range(1, 9)]
    assert (tmp_path / "figures" / "link_motions.png").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--rigid", "--ked"], "--rigid: cannot be combined (got '--rigid --ked'); choose one of them"),
        (["--segments", "4", "--geometry", "linear"], "--segments: cannot be combined"),
        (["--segments", "0"], "--segments: must be positive (got 0); give 8"),
        (["--ked", "--tol", "1e-4"], "--tol: has no effect with --ked (got 0.0001); its steps are fixed"),
        (["--ked", "--balanced"], "--balanced: has no effect with --ked"),
    ],
)
def test_fidelities_exclude_one_another(tmp_path, arguments, says):
    done = paraflex("run", "raparm_i", *arguments, "--out", str(tmp_path / "out"), cwd=tmp_path)
    assert done.returncode == 2
    assert says in done.stderr
    assert list(tmp_path.iterdir()) == []
