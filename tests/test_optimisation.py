"""Optimisation: known minima by every method, limits, failures, going on, bad input, the command."""

import json
import signal
import sys
import tomllib
from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import paraflex as pf
from journals import forge, rows_in
from made_up import STUDY, made_up, write_study
from paraflex.campaign import open_engine
from paraflex.campaign.journal import write_journal
from paraflex.cli.search import _report_optimum as report
from paraflex.cli.tables import PlainConsole
from paraflex.designs.run import run_task
from paraflex.errors import InputError, OutputError
from paraflex.files import library_names, load_data
from paraflex.files.document import document_text
from paraflex.plots import convergence
from paraflex.studies import load_optimisation, optimise
from paraflex.studies.optimisation.evaluate import Evaluate
from paraflex.studies.optimisation.problem import DesignProblem
from paraflex.studies.optimisation.slopes import differences
from processes import started
from shell import paraflex

OBJECTIVE = """
[objective]
minimise = { tracking_rms = 1.0 }
relative = false
"""
METHODS = ("slsqp", "trust-constr", "l-bfgs-b", "nelder-mead", "differential-evolution", "optuna")
NO_LIMITS = ("l-bfgs-b",)


def study_of(folder, *parts, method=None, **search):
    given = search | ({} if method is None else {"method": method})
    lines = [f"{name} = {json.dumps(value)}" for name, value in given.items()]
    return load_optimisation(write_study(folder, "\n".join([STUDY, *parts, "[search]", *lines])))


def bowl(mode, x, y):
    """Least, 0.5, at x = 0.004 and y = 0.3."""
    return 0.5 + ((x - 0.004) / 0.006) ** 2 + 0.3 * np.log10(y / 0.3) ** 2


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_the_least(tmp_path, method):
    study = study_of(tmp_path, OBJECTIVE, method=method, evaluations=400 if method != "optuna" else 120)
    result = optimise(study, tmp_path / "out", run=made_up(tracking_rms=bowl))
    close = {"optuna": 0.02, "nelder-mead": 1e-3}.get(method, 2e-3)
    assert result.objective == pytest.approx(0.5, abs=close)
    assert result.values["x"] == pytest.approx(0.004, abs=0.006 * np.sqrt(close))
    assert result.start == {"x": 0.005, "y": 0.225}
    assert result.start_objective == pytest.approx(bowl("", 0.005, 0.225), rel=1e-15)
    assert result.bounds == {}
    assert not result.interrupted
    table = pd.read_parquet(result.table)
    assert list(table["run"]) == list(range(result.evaluations))
    best = table.iloc[table["tracking_rms"].argmin()]
    assert (best["x"], best["y"]) == tuple(result.values.values())


@pytest.mark.parametrize("method", [name for name in METHODS if name not in NO_LIMITS])
def test_limits_are_held(tmp_path, method):
    """The least of the bowl where x is at least 0.005: on the limit."""
    limit = '[[objective.at_most]]\nmetric = "total_mass"\nvalue = 2.0'
    study = study_of(tmp_path, OBJECTIVE, limit, method=method, evaluations=300, seed=3)
    run = made_up(tracking_rms=bowl, total_mass=lambda mode, x, y: 0.01 / x)
    result = optimise(study, tmp_path / "out", run=run)
    assert result.holds_limits
    assert result.metrics["total_mass"] <= 2.0 * (1.0 + 2e-6)
    rough = method in ("optuna", "nelder-mead")
    assert result.objective == pytest.approx(0.5 + 1.0 / 36.0, abs=0.02 if rough else 1e-3)


def test_a_limit_nothing_holds_is_said(tmp_path):
    limit = '[[objective.at_most]]\nmetric = "total_mass"\nvalue = 1.0'
    study = study_of(tmp_path, OBJECTIVE, limit, method="nelder-mead", evaluations=60)
    run = made_up(tracking_rms=bowl, total_mass=lambda mode, x, y: 0.01 / x)
    result = optimise(study, tmp_path / "out", run=run)
    assert not result.holds_limits
    # What passes it least: the thickest.
    assert result.values["x"] == pytest.approx(0.008, rel=0.05)


def test_a_limit_nothing_holds_is_named_with_its_unit(capsys):
    found = SimpleNamespace(
        values={"x": 1.0}, start={"x": 2.0}, bounds={}, start_objective=1.0, objective=0.5, holds_limits=False,
        metrics={"stress_max": 2.5e7, "total_mass": 1.0}, start_metrics={"stress_max": 3e7, "total_mass": 2.0},
        goal={"limits": (("stress_max", 1e7), ("total_mass", 1.5))}, units={"stress_max": "Pa", "total_mass": "kg"},
    )  # fmt: skip
    report(PlainConsole(width=100), found)
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if line.startswith("limit")] == [
        "limit exceeded: largest stress is above 10 MPa by 15 MPa"
    ]


@pytest.mark.parametrize("over", ["worst", "mean"])
def test_over_all_modes(tmp_path, over):
    """Two parabolas about 0.002 and 0.008, the second twice as steep: they cross elsewhere than their mean is least."""

    def parabola(mode, x, y):
        share = (x - 0.002) / 0.006
        return 1.0 + (share**2 if mode == "++++" else 2.0 * (share - 1.0) ** 2 - 0.25)

    objective = OBJECTIVE.replace("relative", f'over = "{over}"\nrelative')
    text = STUDY.replace('["++++"]', '["++++", "+++-"]') + objective
    text += '[search]\nmethod = "nelder-mead"\ntolerance = 1e-10\n'
    study = load_optimisation(write_study(tmp_path, text))
    result = optimise(study, tmp_path / "out", run=made_up(tracking_rms=parabola))
    share = np.linspace(0.0, 1.0, 100_001)
    both = np.array([1.0 + share**2, 0.75 + 2.0 * (share - 1.0) ** 2])
    known = 0.002 + 0.006 * share[np.argmin(both.max(axis=0) if over == "worst" else both.mean(axis=0))]
    assert result.values["x"] == pytest.approx(known, abs=2e-6)
    rows = pd.read_parquet(result.table)
    assert len(rows) == 2 * result.evaluations
    assert list(rows["run"]) == list(range(len(rows)))


def test_a_relative_sum_weighs_metrics_by_the_start(tmp_path):
    """Minimise a (x/x0) + b (x0/x) (units cancel): least at x0 sqrt(b/a)."""
    objective = "[objective]\nminimise = { tracking_rms = 4.0, peak_torque_max = 1.0 }"
    study = study_of(tmp_path, objective, tolerance=1e-8)
    run = made_up(tracking_rms=lambda mode, x, y: 1e-3 * x, peak_torque_max=lambda mode, x, y: 70.0 / x)
    result = optimise(study, tmp_path / "out", run=run)
    assert result.start_objective == pytest.approx(5.0)
    assert result.objective == pytest.approx(4.0, rel=1e-6)
    assert result.values["x"] == pytest.approx(0.0025, rel=1e-3)


@pytest.mark.parametrize("method", ["slsqp", "trust-constr", "l-bfgs-b", "nelder-mead", "differential-evolution"])
def test_designs_that_fail_do_not_end_it(tmp_path, method):
    """Below x = 0.0045 nothing runs, and that is where the metric would be least."""

    def slope(mode, x, y):
        if x < 0.0045:
            raise ValueError("out of reach")
        return x / 0.005 + 0.01 * y

    study = study_of(tmp_path, OBJECTIVE, method=method, evaluations=150)
    result = optimise(study, tmp_path / "out", run=made_up(tracking_rms=slope))
    assert result.failed > 0
    assert result.reasons == ('line, mode "++++": out of reach',)
    assert result.values["x"] >= 0.0045
    assert result.values["x"] < 0.00475
    table = pd.read_parquet(result.table)
    assert set(table["status"]) == {"complete", "failed"}
    assert ((table["status"] == "failed") == (table["x"] < 0.0045)).all()


def test_where_nothing_runs_the_slope_leads_back(tmp_path, evaluate_of):
    """Value and slope beyond the designs that run fit each other and lie above the start."""

    def slope(mode, x, y):
        if x < 0.0045:
            raise ValueError("out of reach")
        return x / 0.005

    study = study_of(tmp_path, OBJECTIVE)
    evaluate = evaluate_of(study, tmp_path / "out", made_up(tracking_rms=slope))
    problem = DesignProblem(study.objective, evaluate)
    problem.slope(problem.start)
    x, step = np.array([0.1, 0.7]), np.diag([1e-4, 1e-4])
    rise = [(problem.value(x + h) - problem.value(x - h)) / 2e-4 for h in step]
    assert problem.value(x) > problem.value(problem.start)
    assert problem.slope(x) == pytest.approx(rise, rel=1e-5)
    assert problem.slope(x) @ (x - problem.start) > 0.0


def test_a_metric_that_is_no_number_does_not_count(tmp_path):
    study = study_of(tmp_path, OBJECTIVE, method="nelder-mead", evaluations=40)
    run = made_up(tracking_rms=lambda mode, x, y: np.nan if x < 0.0045 else x)
    result = optimise(study, tmp_path / "out", run=run)
    assert result.reasons == ('line, mode "++++": tracking_rms is not a number',)
    assert result.values["x"] >= 0.0045


def test_a_start_that_does_not_run(tmp_path):
    def out(mode, x, y):
        raise ValueError("out of reach")

    study = study_of(tmp_path, OBJECTIVE)
    with pytest.raises(InputError, match=r"the start cannot be run \(line, .* out of reach\).*x = 0.005, y = 0.225"):
        optimise(study, tmp_path / "out", run=made_up(tracking_rms=out))
    study = study_of(tmp_path, OBJECTIVE.replace("false", "true"))
    with pytest.raises(InputError, match=r"objective.minimise.tracking_rms: the metric is zero.*relative = false"):
        optimise(study, tmp_path / "zero", run=made_up(tracking_rms=lambda mode, x, y: 0.0))


@pytest.fixture
def evaluate_of():
    with ExitStack() as opened:

        def make(study, folder, run):
            folder.mkdir()
            journal, engine = write_journal(folder), open_engine("threads", 1)
            return Evaluate(study, opened.enter_context(journal), opened.enter_context(engine), run)

        yield make


def test_differences_are_slopes_of_the_unit_cube(tmp_path, evaluate_of):
    study = study_of(tmp_path, OBJECTIVE)
    evaluate = evaluate_of(study, tmp_path / "out", made_up(tracking_rms=bowl))
    (at,) = evaluate([study.start])
    x, y = study.start
    exact = [2.0 * (x - 0.004) / 0.006, 0.6 * np.log10(y / 0.3)]  # y goes over one decade
    assert differences(evaluate, at, 1e-3)["tracking_rms"] == pytest.approx(np.array([exact]), rel=1e-6)
    # At a bound they are one-sided, and no design is outside.
    (corner,) = evaluate([(0.002, 1.0)])
    exact = [2.0 * (0.002 - 0.004) / 0.006, 0.6 * np.log10(1.0 / 0.3)]
    assert differences(evaluate, corner, 1e-3)["tracking_rms"] == pytest.approx(np.array([exact]), rel=3e-3)
    designs = np.array(evaluate.run.designs)
    assert (designs.min(axis=0) >= [0.002, 0.1]).all()
    assert (designs.max(axis=0) <= [0.008, 1.0]).all()


def test_unit_cube_and_back(tmp_path):
    study = study_of(tmp_path, OBJECTIVE)
    assert study.design(np.array([0.5, 0.5])) == pytest.approx((0.005, 10**-0.5))
    assert study.unit((0.005, 10**-0.5)) == pytest.approx([0.5, 0.5])
    assert study.design(np.array([1.0, 1.0])) == (0.008, 1.0)
    assert study.design(np.array([-0.1, 2.0])) == (0.002, 1.0)
    step = 1e-4
    rise = (np.array(study.design(np.full(2, 0.3 + step))) - study.design(np.full(2, 0.3 - step))) / (2.0 * step)
    assert study.per_unit(study.design(np.full(2, 0.3))) == pytest.approx(rise, rel=1e-7)


def fake_sensitivities(monkeypatch, metric_gradients):
    monkeypatch.setattr(sys.modules["paraflex.designs.derivatives.gradient"], "metric_gradients", metric_gradients)


def test_exact_gradients_are_asked_for_where_slopes_are_used(tmp_path, monkeypatch):
    run, asked = made_up(tracking_rms=bowl), []

    def metric_gradients(setting, task, *, sizes):
        assert sizes == [None, None]
        asked.append(task.values)
        x, y = task.values
        slope = [2.0 * (x - 0.004) / 0.006**2, 0.6 * np.log10(y / 0.3) / (y * np.log(10.0))]
        return [(mode, {"tracking_rms": bowl(mode, x, y)}, {"tracking_rms": np.array(slope)}) for mode in setting.modes]

    fake_sensitivities(monkeypatch, metric_gradients)
    study = study_of(tmp_path, OBJECTIVE, gradients="exact", tolerance=1e-10)
    result = optimise(study, tmp_path / "out", run=run)
    assert result.values == pytest.approx({"x": 0.004, "y": 0.3}, rel=1e-4)
    # No differences: a dozen designs, those whose slopes were used with these in the table.
    assert result.evaluations < 25
    assert len(run.designs) == result.evaluations
    table = pd.read_parquet(result.table)
    with_slopes = table.dropna(subset=["slope.tracking_rms.x"])
    assert 2 < len(with_slopes) == len(set(asked)) == len(asked) <= result.evaluations
    assert np.allclose(with_slopes["slope.tracking_rms.x"], 2.0 * (with_slopes["x"] - 0.004) / 0.006**2, rtol=1e-12)
    again = optimise(study, tmp_path / "out", run=run)
    assert again.fresh == 0
    assert len(set(asked)) == len(asked)
    assert again.values == result.values


def test_exact_gradients_that_cannot_be(tmp_path, monkeypatch):
    study = study_of(tmp_path, OBJECTIVE.replace("tracking_rms", "steps"), gradients="exact")
    with pytest.raises(InputError, match=r"no exact derivatives \(metrics: has no derivative.*write \"differences\""):
        optimise(study, tmp_path / "one", run=made_up(steps=bowl))
    study = study_of(tmp_path, OBJECTIVE, gradients="exact", method="optuna")
    with pytest.raises(InputError, match="optuna uses no gradients"):
        optimise(study, tmp_path / "four")


def test_differences_stand_in_for_designs_without_exact_slopes(tmp_path, monkeypatch):
    """Below x = 0.0045 derivatives fail: the least is found all the same, and the table says why."""

    def stumbles(setting, task, *, sizes):
        x, y = task.values
        if x < 0.0045:
            raise ZeroDivisionError("at a strange design")
        slope = [2.0 * (x - 0.004) / 0.006**2, 0.6 * np.log10(y / 0.3) / (y * np.log(10.0))]
        return [(mode, {}, {"tracking_rms": np.array(slope)}) for mode in setting.modes]

    fake_sensitivities(monkeypatch, stumbles)
    result = optimise(
        study_of(tmp_path, OBJECTIVE, gradients="exact"), tmp_path / "out", run=made_up(tracking_rms=bowl)
    )
    assert result.objective == pytest.approx(0.5, abs=1e-4)
    assert result.failed == 0
    table = pd.read_parquet(result.table)
    assert set(table["slope.reason"].dropna()) == {"ZeroDivisionError: at a strange design"}
    assert (table[table["slope.reason"].notna()]["x"] < 0.0045).all()


class Interrupt:
    """Ctrl-C when so many designs are done."""

    def __init__(self, number):
        self.number = number

    def __call__(self, progress):
        if progress.done >= self.number:
            raise KeyboardInterrupt


@pytest.mark.parametrize("method", ["slsqp", "nelder-mead", "differential-evolution", "optuna"])
def test_a_stopped_search_goes_on_as_if_it_had_not_been(tmp_path, method):
    study = study_of(tmp_path, OBJECTIVE, method=method, evaluations=60, samples=8, seed=2)
    whole_run, parts_run = made_up(tracking_rms=bowl), made_up(tracking_rms=bowl)
    whole = optimise(study, tmp_path / "whole", run=whole_run, workers=2)
    stopped = optimise(study, tmp_path / "parts", run=parts_run, workers=1, on_progress=Interrupt(14))
    assert stopped.interrupted
    assert stopped.stopped == "interrupted"
    assert stopped.evaluations == 14
    assert stopped.table.name == "unfinished.parquet"
    assert len(pd.read_parquet(stopped.table)) == 14
    assert json.loads((tmp_path / "parts" / "result.json").read_text())["values"] == stopped.values
    gone_on = optimise(study, tmp_path / "parts", run=parts_run, workers=1)
    assert gone_on.fresh == gone_on.evaluations - 14
    assert gone_on.table.read_bytes() == whole.table.read_bytes()
    for name in ("result.json", "best.toml"):
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    # The one that Ctrl-C met may have been begun twice, no other.
    assert len(parts_run.designs) <= len(whole_run.designs) + 2
    assert not (tmp_path / "parts" / "unfinished.parquet").exists()


def test_interrupted_before_anything_is_known(tmp_path):
    def interrupted(setting, task, watch=None):
        raise KeyboardInterrupt

    result = optimise(study_of(tmp_path, OBJECTIVE), tmp_path / "out", run=interrupted)
    assert result.interrupted
    assert (result.values, result.objective, result.evaluations) == ({}, None, 0)


def test_more_evaluations_go_on_from_fewer(tmp_path):
    run = made_up(tracking_rms=bowl)
    few = optimise(study_of(tmp_path, OBJECTIVE, method="nelder-mead", evaluations=10), tmp_path / "out", run=run)
    assert few.stopped == "evaluations = 10 are done"
    assert few.evaluations == 10
    more = optimise(study_of(tmp_path, OBJECTIVE, method="nelder-mead", evaluations=20), tmp_path / "out", run=run)
    assert (more.evaluations, more.fresh) == (20, 10)
    assert len(run.designs) == 20
    assert more.objective <= few.objective
    with pytest.raises(InputError, match="results of another study"):
        optimise(study_of(tmp_path, OBJECTIVE, method="slsqp"), tmp_path / "out", run=run)


def test_a_damaged_table_is_named(tmp_path):
    study = study_of(tmp_path, OBJECTIVE, evaluations=5)
    result = optimise(study, tmp_path / "out", run=made_up(tracking_rms=bowl))
    whole = result.table.read_bytes()
    result.table.write_bytes(whole[:60])
    # A table is made of the journal again ...
    assert optimise(study, tmp_path / "out", run=pytest.fail).table.read_bytes() == whole
    journal = tmp_path / "out" / "journal.sqlite"
    journal.write_bytes(journal.read_bytes()[:60])
    with pytest.raises(OutputError, match=r"journal.sqlite: damaged: .*delete this file"):
        optimise(study, tmp_path / "out", run=made_up(tracking_rms=bowl))
    # ... and a journal of the table.
    journal.unlink()
    result.table.write_bytes(whole[:60])
    with pytest.raises(InputError, match=r"results.parquet: damaged.*; .*delete it and run"):
        optimise(study, tmp_path / "out", run=made_up(tracking_rms=bowl))


def test_rows_of_a_journal_that_hold_texts_for_numbers_are_damage(tmp_path):
    study = study_of(tmp_path, OBJECTIVE, evaluations=5)
    optimise(study, tmp_path / "out", run=made_up(tracking_rms=bowl))
    for file in ("results.parquet", "manifest.json"):
        (tmp_path / "out" / file).unlink()
    forge(tmp_path / "out", tracking_rms="x")
    with pytest.raises(OutputError, match=r"journal\.sqlite: damaged: a row does not fit its columns"):
        optimise(study, tmp_path / "out", run=pytest.fail)


def test_a_worker_that_died_is_a_design_that_failed(tmp_path, monkeypatch):
    from paraflex.campaign import LostWorker
    from paraflex.studies.optimisation import evaluate as module

    whole = module.outcomes

    def losing(engine, function, jobs):
        for job, outcome in whole(engine, function, jobs):
            yield job, LostWorker("killed") if job.task.values[0] < 0.0045 else outcome

    monkeypatch.setattr(module, "outcomes", losing)
    study = study_of(tmp_path, OBJECTIVE, method="nelder-mead", evaluations=30)
    result = optimise(study, tmp_path / "out", run=made_up(tracking_rms=lambda mode, x, y: x))
    assert result.reasons == ('line, mode "++++": killed',)


def test_the_best_design_is_a_mechanism(tmp_path):
    study = study_of(tmp_path, OBJECTIVE)
    result = optimise(study, tmp_path / "out", run=made_up(tracking_rms=bowl))
    data = tomllib.loads((tmp_path / "out" / "best.toml").read_text(encoding="utf-8"))
    before, _ = load_data("raparm_i")
    assert data["section"]["bar"].pop("thickness") == result.values["x"]
    assert data["lump"]["end"].pop("mass") == result.values["y"]
    del before["section"]["bar"]["thickness"], before["lump"]["end"]["mass"]
    assert data == before
    model = pf.load(tmp_path / "out" / "best.toml")
    assert next(each for each in model.mechanism.bodies if each.name == "link1").section.area == pytest.approx(
        0.030 * result.values["x"]
    )


@pytest.mark.parametrize("name", library_names())
def test_models_as_text_are_the_same(name):
    data, _ = load_data(name)
    assert tomllib.loads(document_text(data)) == data


def test_odd_keys_and_texts_as_text():
    data = {
        "a b": 'say "\\x"\n\t\x7fé😀',
        "n": [1, 1e-300, -0.0, 1e22, True, [], {"x.y": "ü"}],
        "t": {"+-": {}, "q": {"u": 1}},
    }
    assert tomllib.loads(document_text(data)) == data


def test_real_runs(tmp_path):
    """Thicker links follow better and weigh more: with limits on both the search goes to the limit it should."""
    text = STUDY.split("[vary.y]")[0].replace("low = 0.002", "low = 0.004")
    text += '[objective]\nminimise = { tracking_max = 1.0 }\n[search]\nevaluations = 9\nmethod = "l-bfgs-b"\n'
    text = text.replace('"tracking_rms", "peak_torque_max", "total_mass"', '"tracking_rms"')
    result = optimise(write_study(tmp_path, text), tmp_path / "out")
    assert result.objective < 1.0
    one = run_best(tmp_path / "out" / "best.toml")
    assert one == pytest.approx(result.metrics["tracking_max"], rel=1e-12)
    figure = convergence(result.to_dict())
    assert figure.axes[0].get_ylabel() == "objective"


def run_best(file):
    model = pf.load(file)
    task = pf.plan(model.mechanism, model.path("line"), duration=0.15, samples=26, assembly="outward")
    run = task.simulate("++++", options=pf.IntegrationOptions(method="esdirk5", tolerance=1e-4, max_steps=200_000))
    data = pf.tracking_dataset([run])
    return float(np.hypot(*(data["end_effector"] - data["end_effector_desired"]).isel(mode=0).values.T).max())


def test_modes_of_one_design_are_run_apart_with_the_same_rows(tmp_path):
    """Whether workers take whole designs or single modes, the rows are the same."""
    text = STUDY.replace('["++++"]', '["++++", "+++-"]') + OBJECTIVE
    study = load_optimisation(write_study(tmp_path, text))
    rows = []
    for workers in (1, 3):
        folder = tmp_path / str(workers)
        folder.mkdir()
        with write_journal(folder) as journal, open_engine("threads", workers) as engine:
            evaluate = Evaluate(study, journal, engine)
            rows.append(evaluate([study.start])[0].rows)
    assert rows[0] == rows[1]
    assert run_task is evaluate.run


BAD = [
    (OBJECTIVE, "", "objective: is missing"),
    ("{ tracking_rms = 1.0 }", "{}", "objective.minimise: nothing to minimise"),
    ("tracking_rms = 1.0", "tracking_rm = 1.0", 'did you mean "tracking_rms"?'),
    ("tracking_rms = 1.0", "tracking_rms = -1.0", "objective.minimise.tracking_rms: must be positive (got -1.0)"),
    (
        "tracking_rms = 1.0",
        "peak_torque = 1.0",
        "objective.minimise.peak_torque: this metric is one of each motor, and no motor is named (got 'peak_torque')",
    ),
    ("tracking_rms = 1.0", '"tracking_rms.tau1" = 1.0', "not a metric per motor"),
    ("relative = false", 'over = "wurst"', 'did you mean "worst"?'),
    ("low = 0.002", "low = 0.006", "outside the bounds, 0.006 to 0.008 (got 0.005)"),
    ("low = 0.002", "low = 0.002\nstart = 0.001", "vary.x.start: outside the bounds, 0.002 to 0.008 (got 0.001)"),
    ("low = 0.002", "low = 0.008", "vary.x.high: low and high are equal"),
    ("low = 0.002", "values = [1.0]", "vary.x.values: only sweeps have it"),
    ("low = 0.1\n", "", "vary.y.low: is missing"),
    ('["section.bar.thickness"]', '["section.bar.thickness", "section.bar.width"]', "its fields have different values"),
    ("[objective]", '[search]\nmethod = "newton"\n[objective]', 'give "slsqp", "trust-constr"'),
    ("[objective]", "[search]\nevaluations = 0\n[objective]", "search.evaluations: must be positive"),
    ("[objective]", "[search]\nseed = -1\n[objective]", "search.seed: must not be negative"),
    ("[objective]", "[search]\ndifference = 0.5\n[objective]", "search.difference: too large"),
]


@pytest.mark.parametrize(("old", "new", "says"), BAD)
def test_bad_studies_say_what_to_do(tmp_path, old, new, says):
    text = STUDY + OBJECTIVE
    assert old in text
    with pytest.raises(InputError) as caught:
        load_optimisation(write_study(tmp_path, text.replace(old, new)))
    assert says in str(caught.value)
    assert "study.toml" in str(caught.value)


def test_what_a_method_cannot_do(tmp_path, monkeypatch):
    limit = '[[objective.at_most]]\nmetric = "total_mass"\nvalue = 2.0'
    study = study_of(tmp_path, OBJECTIVE, limit, method="l-bfgs-b")
    run = made_up(tracking_rms=bowl, total_mass=lambda mode, x, y: 1.0)
    with pytest.raises(
        InputError, match=r"search.method: the method takes no limits \(at_most\) .*\"slsqp\" or \"trust-constr\""
    ):
        optimise(study, tmp_path / "one", run=run)
    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(InputError, match=r"Optuna is not installed.*pip install 'paraflex\[optuna\]'"):
        optimise(study_of(tmp_path, OBJECTIVE, method="optuna"), tmp_path / "two", run=run)


def test_a_figure_of_nothing_is_refused():
    with pytest.raises(InputError, match="nothing to show"):
        convergence({"kind": "optimisation", "history": [[0, None, False]]})


def test_command_line(tmp_path):
    text = STUDY + OBJECTIVE + "[search]\nevaluations = 4\n"
    file, out = write_study(tmp_path, text), tmp_path / "out"
    first = paraflex("optimise", file, "--output", out)
    assert first.returncode == 0, first.stderr
    assert "RMS tracking error" in first.stdout
    assert "4 designs; evaluations = 4 are done" in first.stdout
    again = paraflex("optimize", file, "--output", out, "--json")
    assert again.returncode == 0, again.stderr
    figures = json.loads(again.stdout)
    assert (figures["evaluations"], figures["fresh"]) == (4, 0)
    assert (out / "figures" / "convergence.svg").exists()
    wrong = paraflex("optimise", file, "--output", out, "--engine", "x")
    assert wrong.returncode == 2
    assert "unknown engine (got 'x')" in wrong.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_control_c_keeps_what_is_done(tmp_path):
    text = STUDY + OBJECTIVE + '[search]\nevaluations = 5000\nmethod = "differential-evolution"\n'
    file, out = write_study(tmp_path, text), tmp_path / "out"
    command = [sys.executable, "-W", "error", "-m", "paraflex", "optimise", file, "--output", out]
    with started(*command) as child:
        child.until(lambda: rows_in(out))
        child.send(signal.SIGINT)
        done = child.end()
    assert done.returncode == 130, done.stderr
    assert "interrupted" in done.stdout
    assert "objective" in done.stdout
    assert "the same command continues from there" in done.stderr
    assert len(pd.read_parquet(out / "unfinished.parquet")) > 0
    assert json.loads((out / "result.json").read_text())["interrupted"]


@pytest.mark.parametrize("metrics", ["", 'metrics = ["tracking_rms"]'])
def test_an_objective_that_is_not_kept_by_default_is_computed(tmp_path, metrics):
    text = STUDY.replace('metrics = ["tracking_rms", "peak_torque_max", "total_mass"]', metrics)
    objective = "[objective]\nminimise = { joint_force_max = 1.0 }\n"
    study = load_optimisation(write_study(tmp_path, f"{text}\n{objective}[search]\nevaluations = 1\n"))
    assert "joint_force_max" in study.base.setting.metrics
    assert "tracking_rms" in study.base.setting.metrics
    result = optimise(study, tmp_path / "out")
    row = pd.read_parquet(result.table).iloc[0]
    assert row["joint_force_max"] == pytest.approx(result.metrics["joint_force_max"])
    assert row["joint_force_max"] > 0.0


@pytest.mark.parametrize("over", ["worst", "mean"])
@pytest.mark.parametrize("method", METHODS)
def test_a_target_is_met(tmp_path, method, over):
    """The bowl draws the mass below its target: u = x / 0.006 makes (u - 2/3)^2 + 100 (u - 1)^2 least."""
    target = '[[objective.targets]]\nmetric = "total_mass"\ntarget = "2000 g"\nweight = 100.0'
    objective = OBJECTIVE + f'over = "{over}"\n'
    study = study_of(tmp_path, objective, target, method=method, evaluations=400 if method != "optuna" else 150, seed=3)
    run = made_up(tracking_rms=bowl, total_mass=lambda mode, x, y: x / 0.003)
    result = optimise(study, tmp_path / "out", run=run)
    u = (2.0 / 3.0 + 100.0) / 101.0
    close = 2e-3 if method in ("optuna", "nelder-mead") else 1e-4
    assert result.metrics["total_mass"] == pytest.approx(2.0 * u, rel=5.0 * close)
    assert result.objective == pytest.approx(0.5 + (u - 2.0 / 3.0) ** 2 + 100.0 * (u - 1.0) ** 2, abs=close)
    assert result.to_dict()["goal"]["targets"] == (("total_mass", 2.0, 100.0),)


def test_the_negative_of_a_metric_is_least_where_the_metric_is_largest(tmp_path):
    """Besides, a metric in W has limits in W."""
    limit = '[[objective.at_most]]\nmetric = "motor_power_max"\nvalue = "0.3 kW"'
    study = study_of(tmp_path, '[objective]\nminimise = { "-max(tau1.torque)" = 1.0 }\nrelative = false', limit)
    run = made_up(**{"-max(tau1.torque)": lambda mode, x, y: -y, "motor_power_max": lambda mode, x, y: 500.0 * y})
    assert optimise(study, tmp_path / "out", run=run).values["y"] == pytest.approx(0.6, rel=1e-4)


def test_of_several_runs_the_one_farthest_from_a_target_counts(tmp_path):
    target = '[[objective.targets]]\nmetric = "total_mass"\ntarget = 2.0'
    modes = STUDY.replace('modes = ["++++"]', 'modes = ["++++", "+++-"]')
    study = load_optimisation(write_study(tmp_path, "\n".join([modes, target])))
    run = made_up(tracking_rms=bowl, total_mass=lambda mode, x, y: (x - (0.001 if mode == "+++-" else 0.0)) / 0.002)
    result = optimise(study, tmp_path / "out", run=run)
    # Halfway: 2 kg +- 0.25 kg.
    assert result.values["x"] == pytest.approx(0.0045, rel=1e-3)
    assert abs(result.metrics["total_mass"] - 2.0) == pytest.approx(0.25, rel=5e-3)
    # It has a kink where the other mode becomes the worst, so that the search may end beside it, but not far.
    assert result.objective == pytest.approx((0.25 / 2.0) ** 2, rel=0.01)


@pytest.mark.parametrize(
    ("target", "says"),
    [
        ('metric = "total_mass"\ntarget = "2 m"',
         "objective.targets.0.target: a quantity in m where one in kg is asked for (got '2 m'); give total_mass in kg"),
        ('metric = "total_mass"\ntarget = 0.0', "objective.targets.0.target: nothing is relative to zero (got 0.0)"),
        ('metric = "total_mass"\ntarget = 2.0\nweight = 0.0', "objective.targets.0.weight: must be positive"),
        ('metric = "tracking_rms"\ntarget = 2.0', "objective.targets.0.metric: the objective has this metric already"),
        ('metric = "mass"\ntarget = 2.0', "objective.targets.0.metric: unknown metric (got 'mass')"),
        ('metric = "max(tau1.torqe)"\ntarget = 2.0',
         "objective.targets.0.metric: no such quantity (got 'tau1.torqe'); did you mean \"tau1.torque\"?"),
        ('metric = "max(tau1.torque)"\ntarget = "2 N"',
         "objective.targets.0.target: a quantity in N where one in N m is asked for (got '2 N'); give max("),
        ('metric = "max(tau1.torqe) + 1 foo"\ntarget = 2.0', "objective.targets.0.metric: no such quantity"),
        ('metric = "max(tau1.torque[3:5])"\ntarget = 2.0',
         "objective.targets.0.metric: the window [3:5] is not within the run, from 0 s to"),
        ('metric = "total_mass"\nvalue = 2.0', "objective.targets.0.target"),
        ('metric = "total_mass"\ntarget = nan', "objective.targets.0.target"),
    ],
)  # fmt: skip
def test_targets_that_make_no_sense_are_refused(tmp_path, target, says):
    with pytest.raises(InputError) as error:
        study_of(tmp_path, OBJECTIVE, f"[[objective.targets]]\n{target}")
    assert says in str(error.value)
    assert "\n" not in str(error.value)
