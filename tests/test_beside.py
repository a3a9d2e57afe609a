"""Runs of the paper's study in second-order geometry beside its linear beams, with errors from elsewhere."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from paraflex.cli.along import _errors_elsewhere
from paraflex.cli.commands.options import FramesChoice, PlanChoice
from paraflex.cli.commands.runs import RunRequest
from paraflex.figures.tracking import beside_table, beside_words, end_effector_path
from paraflex.files import library_file, library_names, load
from paraflex.files.library import errors_elsewhere
from paraflex.findings import Level
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import parse_mode
from paraflex.reports import render, tracking_page
from paraflex.results import load_results, save_results, summary
from paraflex.results.beside import BESIDE, PLACES, beside_of
from paraflex.studies.tracking import TrackingStudy
from reports import task
from shell import paraflex

MEASURED = Path(__file__).parents[1] / "benchmarks" / "measured"
ELSEWHERE = {"second-order": {"exact beams": {"++++": 1e-4}}, "linear": {"Table 3": {"+-+-": 2e-4}}}


def second_order():
    beams = task().mechanism.with_beams(reference="pinned", curvature="separate")
    return task().remodelled(beams.with_geometry("second-order"))


@pytest.fixture(scope="module")
def data():
    study = TrackingStudy(task(), ("++++", "+-+-"), IntegrationOptions(tolerance=1e-3), warning=False,
                          beside=second_order(), elsewhere=ELSEWHERE)  # fmt: skip
    return study.run().data


def beside(data):
    found = beside_of(data)
    assert found is not None
    return found


def told(data, **changes):
    """The dataset with other content beside it."""
    return data.assign_attrs({BESIDE: json.dumps(json.loads(data.attrs[BESIDE]) | changes)})


def test_errors_beside_are_those_of_a_study_of_their_own(data):
    alone = (
        TrackingStudy(second_order(), ("++++", "+-+-"), IntegrationOptions(tolerance=1e-3), warning=False).run().data
    )
    assert alone is not None
    errors = [beside(data).errors[mode] for mode in ("++++", "+-+-")]
    assert errors == alone["tracking_rms_motion"].values.tolist()
    np.testing.assert_array_equal(data[PLACES], alone["end_effector"])
    assert np.abs(data[PLACES] - data["end_effector"]).max() > 1e-5


def test_the_table_has_both_geometries_with_the_errors_from_elsewhere(data):
    table = beside_table(data)
    assert [column.name for column in table.columns] == ["mode", "second order", "exact beams", "linear", "Table 3"]
    assert table.columns[3].cells == data["tracking_rms_motion"].values.tolist()
    assert table.columns[4].cells == [None, 2e-4]
    assert not beside_table(without(data))


def test_the_sentence_says_which_geometry_to_trust_and_how_far_the_other_is_off(data):
    right = {"++++": 1.1e-4, "+-+-": 1e-3}
    data = told(data, errors=right, findings=[])
    own = data["tracking_rms_motion"].values
    factor = max(max(own[0] / 1.1e-4, 1.1e-4 / own[0]), max(own[1] / 1e-3, 1e-3 / own[1]))
    words = beside_words(data)
    assert words.startswith(
        "Trust second-order geometry: no check gives reason for doubt, and its errors are within 10 % "
    )
    assert f"up to a factor of {factor:.2g} (mode " in words
    assert "exact" not in beside_words(told(data, elsewhere={}))
    assert beside_words(told(data, errors={"++++": None, "+-+-": 1e-3})) == (
        "Runs in second-order geometry fail in ++++."
    )
    doubt = [{"code": "validity", "place": "mode ++++", "text": "no", "remedy": "", "level": "doubtful"}]
    assert beside_words(told(data, findings=doubt)) == "Runs in second-order geometry are doubtful as well."


def test_the_page_begins_with_the_verdict_on_what_to_trust(data):
    page = tracking_page(data)
    assert (page.verdict, page.judged) == (beside(data).verdict.level.value, "second-order geometry")
    assert [heading for heading, _ in page.summary] == ["Which geometry to trust"]
    # The doubts about linear beams stand below the table, not above everything.
    plain = tracking_page(without(data))
    assert plain.verdict == Level.DOUBTFUL.value
    assert any("[validity]" in note for note in plain.notes)
    assert not any("[validity]" in note for note in page.notes)
    assert "[validity]" in page.summary[0][1]
    assert f"{page.judged}: {page.verdict}" in render(page)


def without(data):
    """The same results without those in another geometry."""
    data = data.copy()
    del data.attrs[BESIDE]
    return data


def test_doubts_about_the_other_geometry_are_on_the_page_too(data):
    doubt = [{"code": "validity", "place": "mode ++++", "text": "bends too far", "remedy": "", "level": "doubtful"}]
    page = tracking_page(told(data, findings=doubt))
    assert page.verdict == "doubtful"
    assert any("second-order geometry: warning: mode ++++: bends too far" in note for note in page.notes)
    tracking_page(told(data, errors={"++++": None, "+-+-": None}))


def test_paths_and_summaries_have_them_and_files_keep_them(data, tmp_path):
    [chart] = end_effector_path(data, magnification=1.0)
    curve = next(curve for curve in chart.curves if curve.name == "second order" and curve.run == 1)
    np.testing.assert_allclose(np.asarray(curve.x), data[PLACES].values[1, :, 0], rtol=0, atol=1e-15)
    save_results(data, tmp_path / "results.nc")
    again = load_results(tmp_path / "results.nc")
    assert beside(again) == beside(data)
    assert summary(again)["beside"]["errors"] == beside(data).errors
    assert "beside" not in summary(without(data))


def test_errors_from_elsewhere_are_those_measured_and_published():
    known = errors_elsewhere(library_file("raparm_i").read_text(encoding="utf-8"))
    agreement = json.loads((MEASURED / "model_agreement.json").read_text())
    exact = {row["mode"]: row["models"]["exact beams"]["run"] for row in agreement["rows"]}
    assert known["second-order"]["exact beams"] == pytest.approx(exact, rel=1e-4)
    published = json.loads((MEASURED / "paths_and_modes.json").read_text())["table_3"]
    assert known["linear"]["Table 3"] == published
    mechanism = load("raparm_i").mechanism
    for by_source in known.values():
        for errors in by_source.values():
            assert all(parse_mode(mechanism, mode) for mode in errors)


def test_no_other_file_has_errors_from_elsewhere():
    names = [name for name in library_names() if errors_elsewhere(library_file(name).read_text(encoding="utf-8"))]
    assert names == ["raparm_i"]


@pytest.mark.parametrize(
    "changed",
    [
        {"geometry": "second-order"},
        {"rigid": True},
        {"ked": True},
        {"segments": 8},
        {"reduced": "auto"},
        {"servo": True},
        {"balanced": True},
        {"after": "hold"},
        {"paths": ["line"]},
        {"controllers": ["none"]},
        {"tolerance": 1e-3},
        {"plan": PlanChoice(duration=0.2)},
        {"frames": FramesChoice(reference="pinned")},
    ],
)
def test_a_changed_study_has_none(changed):
    model, request = load("raparm_i"), RunRequest()
    assert _errors_elsewhere(replace(request, modes=["++++"], out="elsewhere", json=True), model)
    assert not _errors_elsewhere(replace(request, **changed), model)


def test_a_changed_model_has_none(tmp_path):
    assert not _errors_elsewhere(RunRequest(), load("raparm_i", set={"link1.length": 0.25}))
    text = library_file("raparm_i").read_text(encoding="utf-8")
    (tmp_path / "raparm_i.toml").write_text(text, encoding="utf-8")
    assert _errors_elsewhere(RunRequest(), load(tmp_path / "raparm_i.toml"))
    (tmp_path / "raparm_i.toml").write_text(text.replace("0.130", "0.131"), encoding="utf-8")
    assert not _errors_elsewhere(RunRequest(), load(tmp_path / "raparm_i.toml"))


def test_the_study_of_the_paper_shows_what_is_right_first(tmp_path):
    done = paraflex("run", "raparm_i", "--mode", "++++", "--no-figures", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "RAParM-I: RMS tracking error over the whole run, dwell included"
    assert next(k for k, line in enumerate(lines) if line.startswith("Trust second-order geometry")) < next(
        k for k, line in enumerate(lines) if line.startswith("warning")
    )
    own = json.loads((tmp_path / "summary.json").read_text())
    # Within two percent of exact beams, and farther from the paper's.
    assert own["beside"]["errors"]["++++"] == pytest.approx(6.5503e-4, rel=0.02)
    assert own["modes"]["++++"]["tracking_rms"] == pytest.approx(6.288e-4, rel=0.02)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "second-order geometry: sound" in html
    assert "Table 3" in html
