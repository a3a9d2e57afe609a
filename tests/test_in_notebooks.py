"""Work in notebooks: films and reports shown inline, studies from dictionaries, progress, folders made as needed."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from html import unescape
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import paraflex as pf
from paraflex.campaign import Progress
from paraflex.errors import InputError
from paraflex.reports import motion_page, render, tracking_page

SVG = "{http://www.w3.org/2000/svg}"
STUDY = {
    "name": "thick", "mechanism": "raparm_i", "paths": ["line"], "modes": ["++++"], "duration": 0.02, "samples": 11,
    "metrics": ["tracking_rms", "peak_torque_max"], "vary": {"bar.thickness": {"values": (0.005, 0.006)}},
}  # fmt: skip
FILE = """
name = "thick"
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++"]
duration = 0.02
samples = 11
metrics = ["tracking_rms", "peak_torque_max"]
[vary."bar.thickness"]
values = [0.005, 0.006]
"""


@cache
def task():
    return pf.load("raparm_i").plan("line", duration=0.02, samples=11)


@cache
def run():
    return pf.simulate(task(), "++++")


@cache
def motion():
    return pf.simulate_motion(pf.load("slider_crank_flexible"), 0.02, samples=11)


def framed(page) -> str:
    """The document in the frame that a notebook shows."""
    found = re.fullmatch(
        r'<iframe srcdoc="([^"]*)" sandbox="([^"]*)" style="[^"]*"></iframe>', page._repr_html_(), re.DOTALL
    )
    assert found is not None
    # With the notebook's origin it could use the notebook's server.
    assert "allow-same-origin" not in found[2]
    return unescape(found[1])


@pytest.mark.parametrize("make", [run, motion], ids=["tracking", "motion"])
def test_a_film_of_a_run_plays_in_the_notebook(make):
    film = make().animate()
    drawing = ElementTree.fromstring(film._repr_html_())
    assert drawing.tag == f"{SVG}svg"
    moving = [each for each in drawing.iter() if each.tag.startswith(f"{SVG}animate")]
    assert len(moving) > len(film.scenes[0].bodies)


def test_the_film_in_the_notebook_is_the_film_in_a_file(tmp_path):
    options = pf.FilmOptions(magnify=7.0)
    film = run().animate(options=options)
    run().animate(tmp_path / "film.svg", options=options)
    inline, written = film._repr_html_(), (tmp_path / "film.svg").read_text(encoding="utf-8")
    assert "deflections × 7" in inline
    # Clips have identifiers of their own in each drawing.
    assert re.sub(r"p[0-9a-f]{8,}", "", inline) == re.sub(r"p[0-9a-f]{8,}", "", written)


def test_a_film_has_the_modes_of_a_study_side_by_side(tmp_path):
    result = pf.run_study(task(), ["++++", "+-+-"])
    assert [scene.mode for scene in result.animate(modes=["+-+-", "++++"]).scenes] == ["+-+-", "++++"]
    assert pf.animate(result.save(tmp_path / "out")).scenes[0].mode == "++++"


def test_a_single_picture_is_not_shown_as_a_film(tmp_path):
    assert run().animate(tmp_path / "one.png")._repr_html_() is None
    assert (tmp_path / "one.png").read_bytes().startswith(b"\x89PNG")


def test_the_report_of_a_run_is_that_of_its_dataset(tmp_path):
    page = pf.report(run())
    assert framed(page) == render(tracking_page(pf.tracking_dataset([run()])))
    page.save(tmp_path / "new" / "report.html")
    assert (tmp_path / "new" / "report.html").read_text(encoding="utf-8") == framed(page)
    assert framed(pf.report(motion())) == render(motion_page(pf.motion_dataset(motion())))


def test_the_report_of_runs_in_several_modes_compares_them():
    assert list(pf.report([run(), pf.simulate(task(), "+-+-")]).runs) == ["++++", "+-+-"]


def test_the_report_of_a_study_is_that_of_its_folder(tmp_path):
    result = pf.run_study(task(), ["++++"])
    failed = replace(result, failed={"+-+-": "too weak"})
    assert "Mode +-+- could not be run: too weak" in pf.report(failed).notes
    assert framed(pf.report(failed)) == framed(pf.report(failed.save(tmp_path / "run")))
    verified = pf.verify(task(), ["++++"], models=["rigid", "linear"])
    page = pf.report(verified)
    assert page.kind == "verification"
    assert "path" not in page.subtitle
    assert framed(page) == framed(pf.report(str(verified.save(tmp_path / "verified"))))


def test_other_results_have_their_reports(tmp_path):
    linear = pf.linearise(pf.load("four_bar").mechanism)
    assert pf.report(linear).kind == "linear models"
    assert pf.report(pf.statics(pf.load("folded_beam_guide"), steps=1)).kind == "statics"
    told: list[str] = []
    page = pf.report(pf.sweep(STUDY, tmp_path / "out"), on_progress=told.append)
    assert page.kind == "sweep"
    assert len(told) == 1
    assert framed(page) == framed(pf.report(tmp_path / "out"))


@pytest.mark.parametrize("wrong", [None, 3, [], [1], float("nan"), "model", "motion"])
def test_what_is_no_result_has_neither_report_nor_film(wrong):
    given = (
        {"model": pf.load("four_bar"), "motion": [motion(), motion()]}.get(wrong, wrong)
        if isinstance(wrong, str)
        else wrong
    )
    for make, field in ((pf.report, "results"), (pf.animate, "data")):
        with pytest.raises(InputError, match=f"^{field}: (is not given|not results of runs).*give a run"):
            make(given)


def test_a_comparison_of_laws_has_no_report():
    compared = pf.compare_laws("raparm_i", ["++++"], {}, paths=["line"], duration=0.02, samples=11)
    with pytest.raises(InputError, match="has no report"):
        pf.report(compared)
    with pytest.raises(InputError, match="keeps no motions"):
        pf.animate(compared)


def test_a_report_in_a_frame_moves(browser, tmp_path):
    """Without the origin of the notebook: no storage, no requests."""
    (tmp_path / "notebook.html").write_text(f"<body>{pf.report(run())._repr_html_()}</body>", encoding="utf-8")
    page = browser.new_page(viewport={"width": 1100, "height": 900})
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto((tmp_path / "notebook.html").as_uri())
    frame = page.frames[1]
    frame.wait_for_selector(".js-plotly-plot")
    assert frame.evaluate("report.state.time") == 0.0
    frame.evaluate("player.seek(0.01)")
    assert frame.evaluate("report.state.time") == pytest.approx(0.01)
    assert not wrong


@pytest.mark.parametrize("kind", ["dictionary", "model", "mechanism"])
def test_a_study_from_a_dictionary_is_that_of_the_file(kind, tmp_path):
    (tmp_path / "study.toml").write_text(FILE, encoding="utf-8")
    model = pf.load("raparm_i")
    built = pf.Model(model.mechanism, model.paths, model.study)
    study = STUDY | {"model": {"mechanism": model}, "mechanism": {"mechanism": built}}.get(kind, {})
    if kind == "mechanism":
        # Sections have no names in Python.
        study["vary"] = {"bar.thickness": {"fields": ["section1.thickness"], "values": np.array([0.005, 0.006])}}
    file, found = pf.sweep(tmp_path / "study.toml", tmp_path / "a").data, pf.sweep(study, tmp_path / "b").data
    for name in ("bar.thickness", "tracking_rms", "peak_torque_max"):
        assert found[name].values.tolist() == file[name].values.tolist()
    assert kind == "mechanism" or found["id"].values.tolist() == file["id"].values.tolist()


def test_paths_built_in_python_may_be_varied(tmp_path):
    line = pf.Line((-0.05, 0.264), (0.05, 0.264), max_acceleration=40.0)
    own = replace(pf.load("raparm_i").study, path="mine")
    model = pf.Model(pf.library.raparm_i(), paths={"mine": line}, study=own)
    study = STUDY | {
        "mechanism": model,
        "paths": ["mine"],
        "vary": {"a": {"fields": ["path.mine.max_acceleration"], "values": [40.0]}},
    }
    file = pf.sweep(STUDY | {"vary": {"bar.thickness": {"values": [0.005]}}}, tmp_path / "file").data
    assert pf.sweep(study, tmp_path / "own").data["tracking_rms"].values == pytest.approx(
        file["tracking_rms"].values, rel=1e-6
    )


def test_names_in_a_dictionary_are_relative_to_the_current_folder(tmp_path, monkeypatch):
    pf.load("raparm_i").save(tmp_path / "own.toml")
    monkeypatch.chdir(tmp_path)
    assert pf.load_sweep(STUDY | {"mechanism": Path("own.toml"), "set": {"bar.width": 0.02}}).runs == 2
    with pytest.raises(InputError, match=r"^mechanism: neither a library mechanism nor a file"):
        pf.load_sweep(STUDY | {"mechanism": "../nothing"})


def test_every_study_takes_a_dictionary(tmp_path):
    smooth = STUDY | {"metrics": ["tracking_rms"], "integration": {"step": 1e-3, "tolerance": 1e-9}}
    near = smooth | {"vary": {"bar.thickness": {"low": 0.0045, "high": 0.0055}}}
    elasticity = pf.sensitivities(smooth).derivatives.item()
    low, high = (
        pf.sweep(smooth | {"vary": {"bar.thickness": {"values": [0.004999, 0.005001]}}}, tmp_path / "d")
        .data["tracking_rms"]
        .values
    )
    assert elasticity == pytest.approx((high - low) / 2e-6, rel=1e-3)
    start = pf.sweep(smooth, tmp_path / "s").data["tracking_rms"].values[0]
    found = pf.identify(near | {"target": [{"metric": "tracking_rms", "value": start}]}, tmp_path / "i")
    assert found.values["bar.thickness"] == pytest.approx(0.005, rel=1e-3)
    best = pf.optimise(near | {"objective": {"minimise": {"tracking_rms": 1.0}}}, tmp_path / "o")
    assert best.values["bar.thickness"] == pytest.approx(0.0055, rel=1e-3)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"mechanism": 3}, r"^mechanism: should be a valid string \(got 3\)"),
        ({"mechanism": pf.Line}, "^mechanism: should be a valid string"),
        ({"mechanizm": "x"}, '^mechanizm: unknown field .*did you mean "mechanism"'),
        ({"duration": float("nan")}, "^duration: should be a finite number"),
        ({"vary": {"bar.thickness": {"values": ["1 kg"]}}}, "^vary.bar.thickness.values: a quantity in kg"),
        ({"vary": {"bar.nothing": {"values": [1.0]}}}, "^vary.bar.nothing: no such number"),
        ({"vary": {"bar.thickness": 3}}, "^vary.bar.thickness: should be a table"),
    ],
)
def test_wrong_entries_of_a_dictionary_are_named_by_their_fields(changed, message):
    with pytest.raises(InputError, match=message):
        pf.load_sweep(STUDY | changed)


def test_numbers_of_numpy_are_numbers():
    study = STUDY | {"samples": np.int64(11), "vary": {"link1.elements": {"values": [np.int64(2), np.int64(3)]}}}
    assert pf.load_sweep(study).designs.tolist() == [[2.0], [3.0]]


def test_a_dictionary_is_not_changed():
    study = STUDY | {"vary": {"bar.thickness": {"values": np.array([0.005, 0.006])}}}
    pf.load_sweep(study)
    assert isinstance(study["vary"]["bar.thickness"]["values"], np.ndarray)  # pyright: ignore[reportIndexIssue, reportArgumentType]


def test_results_are_saved_into_a_new_folder(tmp_path):
    data = pf.tracking_dataset([run()])
    pf.save_results(data, tmp_path / "of" / "today" / "run.nc")
    assert pf.load_results(tmp_path / "of" / "today" / "run.nc").identical(data)


def test_a_bar_shows_the_share_that_is_done(capsys):
    bar = pf.progress_bar()
    for done in (0, 0, 1, 399, 400):
        bar(Progress(done, 400, doing="mode ++++"))
    lines = [line.rstrip() for line in capsys.readouterr().err.split("\r")]
    # The second report shows nothing new, and the last ends the line although it has the same share in words.
    assert lines == ["", f"{40 * '.'} 0% mode ++++", f"{40 * '#'} 100% mode ++++", f"{40 * '#'} 100% mode ++++"]


@pytest.mark.parametrize(
    ("end", "shown"), [(0.04, "50%"), (None, "0.02"), (0.0, "0.02"), (float("nan"), "0%"), (0.01, "100%")]
)
def test_a_bar_of_a_simulation_shows_its_time(end, shown, capsys):
    pf.progress_bar(end)(0.02)
    assert capsys.readouterr().err.split()[1] == shown


def test_simulations_studies_and_films_report_to_a_bar(tmp_path, capsys):
    pf.simulate(task(), "++++", on_progress=pf.progress_bar(0.02))
    pf.sweep(STUDY, tmp_path / "out", on_progress=pf.progress_bar())
    pf.animate(run(), tmp_path / "film.svg", on_progress=pf.progress_bar())
    assert capsys.readouterr().err.count(" 100% ") == 3
