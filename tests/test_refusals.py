"""Refusals of figures, options and tables that no other test provokes: each names the field and what to do."""

from __future__ import annotations

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import paraflex as pf
from paraflex.errors import InputError
from paraflex.fem import mesh_beam
from paraflex.figures.designs import read_designs
from paraflex.figures.entry import prepared
from paraflex.figures.selection import one_run
from paraflex.integrators.run import make_problem
from paraflex.integrators.sensitivity import check_differentiable
from paraflex.integrators.spectra import spectrum
from paraflex.motion import simulate_motion
from paraflex.plots import end_effector_path, link_deflections, mode_conditions
from paraflex.plots.film import FilmOptions, plan_film
from paraflex.plots.planned import drawings, figures_of, find_figure
from paraflex.plots.scene import check_shapes, scene, select
from paraflex.plots.sources import open_source
from paraflex.results import motion_dataset, save_results, tracking_dataset


@pytest.fixture(scope="module")
def motion():
    """A crank-rocker of rigid links, half a turn."""
    mechanism = pf.load("four_bar").mechanism.rigid()
    return motion_dataset(simulate_motion(mechanism, 0.1, samples=11))


@pytest.fixture(scope="module")
def tracking():
    """RAParM-I, rigid, the beginning of its square."""
    model = pf.load("raparm_i")
    task = pf.plan(model.mechanism.rigid(), model.path("square"), duration=0.02, samples=5)
    return tracking_dataset([task.simulate("++++")])


def refused(call, field, problem, remedy):
    with pytest.raises(InputError) as caught:
        call()
    error = caught.value
    assert (error.field, error.problem) == (field, problem)
    assert remedy in error.remedy


def test_figures_of_a_run_without_modes_or_models(motion):
    refused(lambda: one_run(motion, "++"), "mode", "these results have no modes", "leave it out")
    refused(lambda: select(motion, "++"), "mode", "this run has no modes", "leave it out")
    refused(lambda: select(motion, None, "linear"), "model", "these results are of one model", "leave it out")
    none = "these results hold no shapes of links: they are of an earlier version"
    refused(lambda: check_shapes(motion.drop_vars("shape")), "results", none, "run the study again")
    empty = motion.assign(shape=motion["shape"] * np.nan)
    refused(lambda: scene(empty, np.zeros(1)), "results", "this run has no sample", "choose another mode")
    refused(lambda: link_deflections(motion), "figure", "no body of these results bends", "choose another figure")


def test_figures_of_models_and_magnifications(tracking):
    runs = tracking.expand_dims(model=["linear"])
    refused(lambda: prepared(runs, models=["rigid"]), "model", "no such model in these results", "one of linear")
    refused(lambda: select(runs, None, "rigid"), "model", "no such model in these results", "choose from linear")
    refused(lambda: end_effector_path(tracking, magnification=-1.0), "magnification", "not a magnification",
            "positive number")  # fmt: skip


def test_figures_that_are_not_there(motion, tmp_path):
    save_results(motion, tmp_path / "results.nc")
    source = open_source(tmp_path / "results.nc")
    refused(lambda: find_figure(source, "animals"), "FIGURE", "no such figure", "choose from")
    figure = next(one for one in figures_of(source) if one.takes not in ("run", "mode"))
    refused(
        lambda: drawings(source, figure, ["++"]), "--mode", "this figure has no modes to choose from", "leave it out"
    )
    rows = [{"mode": "++", "condition_max": None}]
    refused(lambda: mode_conditions(rows), "figure", "no condition numbers: the mechanism has no path", "--path")


def test_files_that_figures_cannot_be_made_of(motion, tmp_path):
    table = tmp_path / "other.parquet"
    pq.write_table(pa.table({"a": [1.0]}), table)
    refused(lambda: read_designs([table]), str(table), "not a table of designs", "results.parquet that paraflex wrote")
    cut = tmp_path / "cut.json"
    cut.write_text('{"modes": ', encoding="utf-8")
    refused(lambda: open_source(cut), str(cut), "damaged: not complete JSON", "make these results again")
    folder = tmp_path / "several"
    folder.mkdir()
    save_results(motion, folder / "results.nc")
    (folder / "verify.nc").write_bytes((folder / "results.nc").read_bytes())
    with pytest.raises(InputError, match="holds several results") as caught:
        open_source(folder)
    assert caught.value.remedy == "name one of the files"
    file = tmp_path / "summary.json"
    file.write_text(json.dumps({"a": 1}), encoding="utf-8")
    with pytest.raises(InputError):
        open_source(file)


def test_options_of_methods():
    refused(
        lambda: pf.methods.Newmark(gamma=0.9, beta=0.3),
        "beta", "too small for unconditional stability", "at least (gamma + 1/2)^2 / 4 = 0.49",
    )  # fmt: skip
    refused(
        lambda: pf.IntegrationOptions(constraints="projection", automatic_gains=True),
        "automatic_gains", "projection has no Baumgarte coefficients", "constraints = baumgarte",
    )  # fmt: skip
    refused(
        lambda: spectrum("tr-bdf2", [1.0, 0.5]), "frequency", "frequencies must be positive and ascend", "geomspace"
    )
    refused(lambda: spectrum("tr-bdf2", [1.0], order=2), "order", "tr-bdf2 has one order only", "leave it out")
    refused(
        lambda: check_differentiable(pf.IntegrationOptions(constraints="projection")),
        "constraints", "derivatives need Baumgarte's treatment of the constraints", "baumgarte",
    )  # fmt: skip
    stops = pf.IntegrationOptions(events=(pf.JointLimit("O", low=0.0),))
    refused(
        lambda: check_differentiable(stops), "events", "a run that an event ends has no derivatives", "leave them out"
    )


def test_times_that_do_not_ascend():
    run = simulate_motion(pf.load("pendulum").mechanism.rigid(), 0.1, samples=3)
    from paraflex.dynamics import State, moment_signals

    start = State(0.0, run.solution.q[0], run.solution.v[0])
    signals = moment_signals(run.system.mechanism, 0.0)
    refused(
        lambda: make_problem(run.system, signals, start, np.array([0.0, 0.0])),
        "times", "times must ascend from the start", "at least one later time",
    )  # fmt: skip


def test_a_mesh_needs_a_length():
    refused(lambda: mesh_beam(-1.0, {}), "length", "a beam needs a positive length", "give it in m")


@pytest.mark.parametrize("module", ["paraflex", "paraflex.plots", "paraflex.results"])
def test_modules_name_what_they_do_not_have(module):
    from importlib import import_module

    with pytest.raises(AttributeError, match=f"(?i)(module '|no ){module}'? (has no )?attribute '?animals"):
        _ = import_module(module).animals


def test_films_of_too_many_pictures(motion):
    with pytest.raises(InputError, match=r"the film would have .* pictures, more than") as caught:
        plan_film(motion, options=FilmOptions(speed=1e-6))
    assert caught.value.remedy.startswith("choose a higher speed")


def test_numbers_that_no_file_needs(tmp_path):
    file = tmp_path / "digits.toml"
    file.write_text("a = " + "9" * 5000, encoding="utf-8")
    digits = "not valid TOML: a number of too many digits, or too many nested brackets"
    refused(lambda: pf.load(file), "file", digits, "name a model file")
    refused(lambda: pf.methods.BDF(max_order=2.5), "max_order", "not a whole number", "give a whole number")
