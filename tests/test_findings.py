"""Slips of units, signs and places in models that nobody here had made before, and what is found of each."""

from __future__ import annotations

import json
import re
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest

import paraflex as pf
from paraflex.findings import CODES, Finding, Level, Verdict
from paraflex.mechanism import FlexibleBeam, Material, Section
from paraflex.motion import simulate_motion
from paraflex.results import motion_dataset, motion_summary
from paraflex.results.findings import verdict_of
from shell import paraflex

MODELS = Path(__file__).parent / "data" / "slips"
DOCS = Path(__file__).parents[1] / "docs"

SLIPS = tomllib.loads((MODELS / "slips.toml").read_text(encoding="utf-8"))


def slips(kind):
    """Parameters of a test: one for each slip of a kind."""
    cases = [tuple(slip.values()) for slip in SLIPS[kind]]
    return pytest.mark.parametrize(tuple(SLIPS[kind][0]), cases, ids=[f"{case[0]}-{case[3]}"[:40] for case in cases])


def slipped(tmp_path, model, old, new):
    text = (MODELS / f"{model}.toml").read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / f"{model}.toml"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    return file


def checked(file):
    """The verdict on a file, the warnings of its numbers aside."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pf.ModelWarning)
        return pf.check(file)


@pytest.mark.parametrize(
    "name", ["gantry", "lift", "linkage", "scissor", "tripod", "walker", *pf.library.names(), "chain:4", "four_bars:3"]
)
def test_what_is_meant_is_sound(name):
    file = MODELS / f"{name}.toml"
    verdict = pf.check(file if file.exists() else name)
    assert (verdict.level, list(verdict)) == (Level.SOUND, [])


@slips("doubtful")
def test_a_slip_is_doubted_where_it_stands(tmp_path, model, old, new, code, place):
    verdict = checked(slipped(tmp_path, model, old, new))
    found = {(one.code, one.place): one for one in verdict}
    assert (code, place) in found
    assert found[code, place].level is Level.DOUBTFUL
    assert found[code, place].remedy


@slips("wrong")
def test_what_cannot_be_had_is_wrong(tmp_path, model, old, new, code, place):
    if code == "mode-missing":
        text = (MODELS / f"{model}.toml").read_text(encoding="utf-8")
        text = re.sub(r'(?s)\[mode\].*?\n\n|modes = \["one", "two"\]\n', "", text.replace(old, new))
        file = tmp_path / "none.toml"
        file.write_text(text, encoding="utf-8")
    else:
        file = slipped(tmp_path, model, old, new)
    verdict = checked(file)
    assert verdict.level is Level.WRONG
    assert (code, place) in {(one.code, one.place) for one in verdict}
    # Whatever is wrong comes before what is doubtful.
    assert verdict[0].level is Level.WRONG


@slips("refused")
def test_what_cannot_be_read_is_refused_by_name(tmp_path, model, old, new, says):
    with pytest.raises(pf.InputError) as refusal:
        pf.check(slipped(tmp_path, model, old, new))
    assert says in str(refusal.value)


def test_a_section_of_several_beams_is_doubted_once(tmp_path):
    verdict = checked(slipped(tmp_path, "gantry", "thickness = 0.004", "thickness = 4.0"))
    thick = [one for one in verdict if one.code == "beam-thick"]
    assert len(thick) == 1
    assert "and so of body.rod2.section" in thick[0].text


def test_info_judges_in_three_levels_and_ends_with_1_where_it_is_wrong(tmp_path):
    sound = paraflex("info", str(MODELS / "gantry.toml"), "--json")
    assert (sound.returncode, sound.stderr) == (0, "")
    assert json.loads(sound.stdout)["verdict"] == {"level": "sound", "findings": []}
    steel = slipped(tmp_path, "gantry", "210e9", "210.0")
    doubtful = paraflex("info", str(steel))
    assert doubtful.returncode == 0
    assert "doubtful: body.rod1.material.youngs_modulus: no solid has a modulus of 210 Pa" in doubtful.stdout
    assert doubtful.stderr == ""
    assert "210e9, aluminium 70e9 [modulus]" in doubtful.stdout
    assert "verdict: doubtful, for" in doubtful.stdout
    wrong = slipped(tmp_path, "gantry", 'coordinates = ["x", "y"]', 'coordinates = ["x"]')
    done = paraflex("info", str(wrong), "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["verdict"]["level"] == "wrong"


def test_a_run_says_what_it_doubts_once_before_its_numbers_and_keeps_it(tmp_path):
    file = slipped(tmp_path, "gantry", "thickness = 0.004", "thickness = 0.0004")
    out = tmp_path / "out"
    command = ("run", "-m", str(file), "--samples", "21", "--tol", "1e-3", "--no-figures", "--out", str(out))
    done = paraflex(*command, "--no-report")
    assert done.returncode == 0, done.stderr
    text = done.stdout + done.stderr
    assert text.count("[gravity]") == 0
    slipped(tmp_path, "gantry", "7850.0", "7.85")
    done = paraflex(*command)
    assert done.returncode == 0, done.stderr
    text = done.stdout + done.stderr
    assert text.count("[density]") == 1
    assert done.stdout.startswith("warning: body.rod1.material.density: no solid has a density of 7.85 kg/m^3")
    figures = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert figures["verdict"]["level"] == "doubtful"
    assert "density" in [one["code"] for one in figures["verdict"]["findings"]]
    assert "density" in verdict_of(pf.load_results(out)).codes
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("no solid has a density of 7.85 kg/m^3") == 1
    assert page.index("no solid has a density of 7.85 kg/m^3") < page.index("<table")
    # With --json numbers stand alone on the standard output.
    done = paraflex(*command, "--no-report", "--json")
    assert json.loads(done.stdout)["verdict"]["level"] == "doubtful"
    assert done.stderr.count("[density]") == 1


@pytest.mark.parametrize("command", ["sweep", "verify", "modes", "compare-methods", "control compare"])
def test_other_commands_say_what_they_doubt_when_they_end(tmp_path, command):
    file = slipped(tmp_path, "gantry", "7850.0", "7.85")
    study = tmp_path / "study.toml"
    study.write_text(
        f'mechanism = "{file.name}"\nsamples = 11\n[integration]\ntolerance = 1e-3\n'
        '[vary.thickness]\nfields = ["section.rod.thickness"]\nvalues = [0.004]\n',
        encoding="utf-8",
    )
    short = ["--duration", "0.02", "--samples", "11", "--tol", "1e-3"]
    asked = {
        "sweep": ["study.toml", "--output", "out"],
        "verify": ["-m", file.name, "--model", "rigid", *short],
        "modes": [file.name],
        "compare-methods": ["-m", file.name, "--method", "tr-bdf2", *short],
        "control compare": [file.name, *short],
    }[command]
    done = paraflex(*command.split(), *asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (done.stdout + done.stderr).count("[density]") == 1


def test_python_warns_by_classes_that_can_be_errors(tmp_path):
    file = slipped(tmp_path, "gantry", "7850.0", "7.85")
    with pytest.warns(pf.ModelWarning, match=r"body\.rod1\.material\.density") as caught:
        model = pf.load(file)
    assert caught[0].message.finding.code == "density"
    assert issubclass(pf.ModelWarning, pf.ParaflexWarning)
    for kind in (pf.ResultWarning, pf.ValidityWarning, pf.StiffnessWarning):
        assert issubclass(kind, pf.ParaflexWarning)
    # Of a mechanism alone there is no study to look at.
    assert pf.check(model.mechanism).codes == ("density",)


# --- Results ---------------------------------------------------------------------------------------------------------


def test_forces_beyond_mass_and_loads_are_doubted_with_what_may_be_to_blame(tmp_path):
    model = pf.load(slipped(tmp_path, "lift", "coefficient = 200.0", "coefficient = 2e8"))
    with pytest.warns(pf.ResultWarning, match=r"lift takes .* N .* look at damper\.oil"):
        run = simulate_motion(model.mechanism, 1.0, samples=51)
    # So stiff a damper that rounding decides whether energy balances as well.
    (finding,) = (one for one in run.findings if one.code != "energy-unbalanced")
    assert finding.code == "force-large"
    # The oil's force is its coefficient times the speed, 0.1 m/s at most.
    force = float(re.search(r"takes (\S+) N", finding.text)[1])
    assert 1e7 < force < 2e8 * 0.1
    assert motion_summary(motion_dataset(run))["verdict"]["findings"][-1]["code"] == "force-large"
    assert simulate_motion(pf.load(MODELS / "lift.toml").mechanism, 1.0, samples=51).findings == ()


def test_links_that_bend_like_springs_and_paths_that_are_not_followed_are_doubted(tmp_path):
    soft = slipped(tmp_path, "gantry", "210e9", "210e6")
    with pytest.warns(pf.ModelWarning, match=r"\[material\]"):
        model = pf.load(soft)
    path = model.path("line")
    task = pf.plan(model.mechanism, path, samples=51)
    options = pf.IntegrationOptions(tolerance=1e-3)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = task.simulate("both", options=options)
    codes = {one.code for one in run.findings}
    assert codes == {one.message.finding.code for one in caught if one.category is pf.ResultWarning}
    desired = task.motion.desired.position
    extent = np.linalg.norm(np.ptp(desired, axis=0))
    assert ("error-large" in codes) == (run.driven.deviation > 0.5 * extent)
    assert codes
    for one in run.findings:
        assert one.place == "mode both"
        assert one.remedy.startswith("most likely because of body.rod1.material")


def test_efforts_far_beyond_inertia_are_doubted(tmp_path):
    """Springs of 1e7 N m/rad at the rods' feet: the motors work against them, and next to nothing else."""
    spring = '[spring.s]\njoint = "pin1"\nstiffness = 1e7\n[end_effector]'
    model = pf.load(slipped(tmp_path, "gantry", "[end_effector]", spring))
    task = pf.plan(model.mechanism.rigid(), model.path("line"), samples=21)
    run = task.simulate("both", options=pf.IntegrationOptions(tolerance=1e-3), warning=False)
    found = [one for one in run.findings if one.code == "torque-large"]
    assert found
    assert found[0].remedy == "look at spring.s, and their units"


# --- Codes -----------------------------------------------------------------------------------------------------------


def test_every_code_is_used_and_every_code_used_is_listed():
    source = Path(pf.__file__).parent
    text = "".join(file.read_text(encoding="utf-8") for file in source.rglob("*.py") if file.name != "findings.py")
    used = {code for code in CODES if f'"{code}"' in text}
    assert set(re.findall(r'Finding\(\s*"([a-z-]+)"', text)) <= set(CODES)
    assert used == set(CODES)


def test_an_unknown_code_is_refused():
    with pytest.raises(KeyError, match="no finding has the code"):
        Finding("no-such", "body", "odd", "look")


def test_what_is_no_model_is_refused():
    with pytest.raises(pf.InputError, match="model: not a model"):
        pf.check(5)


def test_a_verdict_is_that_of_its_gravest_finding_and_says_each_once():
    doubt, wrong = Finding("size", "body", "a", "b"), Finding("mode-short", "mode.x", "c", "d")
    verdict = Verdict([doubt, wrong, doubt])
    assert verdict.level is Level.WRONG
    assert list(verdict) == [wrong, doubt]
    assert Verdict().level is Level.SOUND
    assert [Finding.from_dict(one) for one in verdict.to_dict()["findings"]] == list(verdict)


def test_numbers_of_a_mechanism_made_in_python_are_checked():
    beam = FlexibleBeam("bar", 0.12, Section.rectangle(20.0, 4.0), Material(70e9, 2700.0), {"A": 0.0, "B": 0.12})
    mechanism = pf.Mechanism("bar", {"O": (0.0, 0.0)}, (beam,), ())
    assert {"beam-thick", "mass"} <= set(pf.check(mechanism).codes)
