"""The report of a study: it holds the table's numbers, the best runs are those of the table, failures are told."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from paraflex.designs.reopen import open_study, rerun
from paraflex.designs.units import unit_of
from paraflex.errors import InputError
from paraflex.figures.designs import DesignTable, failure_table, fronts, in_conflict, read_designs, undominated
from paraflex.files import library_file
from paraflex.reports.choice import MOST_RUNS, best_runs, drawn_rows
from paraflex.reports.film import frames_of
from paraflex.reports.sweep import StudyAccount, sweep_page
from paraflex.studies import load_optimisation, load_sweep, optimise, sweep
from paraflex.studies.sweeps.report import study_page
from paraflex.writing import read_json, write_json
from reports import array_of, chart_of, html_of, rows_of, told
from shell import paraflex

STUDY = """
name = "thickness <& mass>"
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++", "+++-"]
duration = 0.12
samples = 25
metrics = ["tracking_rms", "deflection_max", "peak_torque_max", "total_mass", "steps"]

[sampling]
kind = "sobol"
number = 8
seed = 1

[integration]
method = "esdirk5"
tolerance = 1e-3

[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.0005
high = 0.008
scale = "log"

[vary.end]
fields = ["lump.end.mass"]
low = -0.1
high = 0.3
"""

SEARCH = """
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++"]
duration = 0.12
samples = 25
metrics = ["tracking_rms"]

[integration]
method = "esdirk5"
tolerance = 1e-3

[objective]
minimise = { tracking_rms = 1.0 }

[search]
evaluations = 5

[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.004
high = 0.008
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A study, some designs of which have a negative mass."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return sweep(load_sweep(folder / "study.toml"), folder / "out", workers=1)


@pytest.fixture(scope="module")
def report(finished):
    return study_page(finished.folder)


@pytest.fixture(scope="module")
def html(report):
    return html_of(report)


@pytest.fixture(scope="module")
def page(html):
    return told(html)


def made_up(rows, seed=0, modes=("a", "b")):
    """A table of so many runs with two metrics in conflict and one that fails now and then."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.1, 1.0, (2, rows))
    complete = rng.uniform(size=rows) > 0.1
    metrics = {"tracking_rms": np.where(complete, x + 0.1 * y, np.nan), "total_mass": np.where(complete, y / x, np.nan)}
    reason = np.where(complete, "", [f"the run has not ended after {k} steps, at t = 0.1 s" for k in range(rows)])
    number = np.arange(rows)
    return DesignTable(
        parameters={"x": x, "y": y}, metrics=metrics, units={"tracking_rms": "m", "total_mass": "kg"},
        run=number, design=number // len(modes),
        path=np.full(rows, "p"), mode=np.array([modes[k % len(modes)] for k in range(rows)]),
        status=np.where(complete, "complete", "failed"), reason=reason,
    )  # fmt: skip


def column(page, identity):
    found = next(one for one in page["designs"]["columns"] if one["identity"] == identity)
    return found, rows_of(page["series"])[found["row"]]


def test_the_page_holds_the_tables_numbers_in_units_that_suit_them(finished, page):
    data = pd.read_parquet(finished.table)
    good = data[data["status"] == "complete"]
    assert 0 < len(good) < len(data)
    for identity, unit, factor in (("thickness", "mm", 1e3), ("end", "kg", 1.0), ("tracking_rms", "mm", 1e3)):
        told_column, values = column(page, identity)
        assert told_column["unit"] == unit
        np.testing.assert_allclose(values, factor * good[identity], rtol=1e-5)
    series = [one["name"] for one in page["designs"]["series"]]
    member = rows_of(page["series"])[page["designs"]["member"]].astype(int)
    assert [series[k] for k in member] == list(good["mode"])
    np.testing.assert_array_equal(rows_of(page["series"])[page["designs"]["number"]], good["design"])


def test_charts_of_all_designs_offer_every_parameter_and_metric(page):
    drawers = [chart["drawer"] for panel in page["survey"] for chart in panel["charts"]]
    assert drawers == ["responses", "responses", "front", "distribution", "parallel"]
    chart = page["survey"][0]["charts"][0]
    names = [[page["designs"]["columns"][k]["identity"] for k in picker["columns"]] for picker in chart["pickers"]]
    assert names[1] == ["thickness", "end"]
    assert names[0] == ["tracking_rms", "deflection_max", "peak_torque_max", "total_mass", "validity", "steps"]


def test_the_best_runs_are_made_again_and_move(finished, page, html):
    data = pd.read_parquet(finished.table)
    best = data.loc[data["tracking_rms"].idxmin()]
    assert page["runs"][0] == f"#{best['design']} {best['mode']}"
    assert page["selecting"] == "design"
    film = page["film"]
    assert array_of(film["base"]).shape[0] == len(page["runs"]) <= MOST_RUNS
    # The first run's error over time has the RMS that the table tells.
    chart = chart_of(page, "errors")
    error = 1e-3 * rows_of(page["series"])[chart["curves"][0]["y"]]
    if chart["y"][0].endswith("[µm]"):
        error *= 1e-3
    # The rise from the start at rest is left out: nothing beside the rest.
    assert np.sqrt(np.nansum(error**2) / error.size) == pytest.approx(best["tracking_rms"], rel=1e-4)
    assert "runs differ from the table" not in html
    # Each row of the table of best designs selects its run.
    rows = re.findall(r'<tr data-run="(\d+)"', html)
    assert [int(row) for row in rows] == list(range(len(page["runs"])))


def test_a_run_that_differs_from_its_row_is_told(finished, tmp_path):
    for name in ("study.json", "results.parquet"):
        (tmp_path / name).write_bytes((finished.folder / name).read_bytes())
    study = read_json(tmp_path / "study.json")
    study["study"]["mechanism"]["material"]["aluminium"]["density"] = 2600.0
    write_json(tmp_path / "study.json", study)
    assert any("runs differ from the table" in note for note in study_page(tmp_path).notes)


def test_failures_are_counted_and_grouped(finished, report, html):
    data = pd.read_parquet(finished.table)
    invalid = int((data["status"] == "invalid").sum())
    assert invalid > 0
    name, value, of = report.figures[0]
    assert (name, value) == ("complete", str((data["status"] == "complete").sum()))
    assert of.startswith(f"of {len(data)} runs")
    assert f"{invalid} invalid" in of
    assert "Runs that are not complete" in html
    assert "lump.end.mass" in html
    (told_reason,) = failure_table(made_up(500)).texts()
    assert told_reason[1] == str(int((~made_up(500).complete).sum()))


def test_names_are_escaped_and_parameters_told(html):
    assert "thickness &lt;&amp; mass&gt;" in html
    assert "<& mass>" not in html
    assert "section.bar.thickness" in html
    assert "in their logarithm" in html


def test_units_are_those_of_the_files_schema():
    expected = {
        ("section", "bar", "thickness"): "m", ("lump", "end", "inertia"): "kg m^2", ("ground", "A1", 0): "m",
        ("material", "x", "density"): "kg/m^3", ("path", "square", "max_acceleration"): "m/s^2",
        ("integration", "tolerance"): "m", ("parameters", "l1"): "", ("body", "a", "points", "P"): "m",
    }  # fmt: skip
    assert {place: unit_of({}, place) for place in expected} == expected


def test_the_best_are_chosen_by_each_metric_and_from_the_front():
    studied = made_up(60)
    picked = best_runs(studied)
    rows = [one.row for one in picked]
    values = {name: np.where(studied.complete, v, np.inf) for name, v in studied.metrics.items()}
    assert rows[0] == np.argmin(values["tracking_rms"])
    assert np.argmin(values["total_mass"]) in rows
    assert len(rows) == len(set(rows)) <= MOST_RUNS
    for mode in ("a", "b"):
        own = np.where(studied.mode == mode, values["tracking_rms"], np.inf)
        assert np.argmin(own) in rows
    front = undominated(values["tracking_rms"], values["total_mass"])
    assert any("front" in reason and one.row in front for one in picked for reason in one.why)


def test_of_many_runs_a_part_is_drawn_and_the_best_and_the_fronts_stay():
    studied = made_up(100_000)
    best = [one.row for one in best_runs(studied)]
    rows = drawn_rows(studied, best)
    assert rows.size == np.unique(rows).size == 5000
    assert set(best) <= set(rows.tolist())
    for front in fronts(studied, *in_conflict(studied, studied.judged)):
        assert set(front.tolist()) <= set(rows.tolist())
    assert studied.complete[rows].all()
    account = StudyAccount("sweep", "many", "made up", 100_000, {})
    html = html_of(sweep_page(studied, best_runs(studied), account))
    assert len(html) < 500_000
    assert "complete runs, drawn by lot" in html


def test_of_few_runs_all_are_drawn_but_those_that_failed():
    studied = made_up(300)
    np.testing.assert_array_equal(drawn_rows(studied, []), np.flatnonzero(studied.complete))


def test_a_study_without_a_complete_run_has_a_report():
    studied = made_up(6)
    studied = replace(studied, status=np.full(6, "failed"))
    html = html_of(sweep_page(studied, best_runs(studied), StudyAccount("sweep", "none", "made up", 6, {})))
    assert told(html)["survey"] == []
    assert "Runs that are not complete" in html


def test_a_design_that_cannot_be_made_again_is_told():
    studied = made_up(40)
    picked = best_runs(studied)
    account = StudyAccount("sweep", "x", "made up", 40, {}, failed={picked[0].row: "out of reach"})
    page = sweep_page(studied, picked, account)
    assert f"{studied.label(picked[0].row)} is not shown in motion: out of reach" in page.notes
    assert page.film is None


def test_the_command_writes_it_also_of_a_part_and_again(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    out = tmp_path / "out"
    command = ["sweep", tmp_path / "study.toml", "--output", out, "--workers", "1"]
    assert paraflex(*command, "--limit", "6", "--no-report").returncode == 0
    assert not (out / "report.html").exists()
    done = paraflex(*command, "--limit", "6")
    assert done.returncode == 0, done.stderr
    assert f"report: {out / 'report.html'}" in done.stderr
    written = (out / "report.html").read_text(encoding="utf-8")
    assert "The study is not finished: these are 12 of 16 runs" in written
    again = paraflex("report", out)
    assert again.returncode == 2
    assert "--force" in again.stderr
    assert paraflex("report", out, "--output", tmp_path / "other.html").returncode == 0
    assert (tmp_path / "other.html").is_file()


def test_a_search_has_one_with_its_convergence(tmp_path):
    (tmp_path / "study.toml").write_text(SEARCH, encoding="utf-8")
    result = optimise(load_optimisation(tmp_path / "study.toml"), tmp_path / "out", workers=1)
    page = told(html_of(study_page(tmp_path / "out")))
    history = page["survey"][0]["charts"][0]
    assert history["identity"] == "convergence"
    (curve,) = (one for one in history["curves"] if one["name"] == "least until then")
    least = rows_of(page["series"])[curve["y"]]
    assert least[-1] == pytest.approx(result.objective, rel=1e-5)
    assert len(page["runs"]) >= 2
    assert page["film"] is not None


MARKED = """
name = "a mark along the link"
mechanism = "marked.toml"
paths = ["square"]
modes = ["++"]
duration = 0.05
samples = 11
metrics = ["tracking_rms"]

[sampling]
kind = "list"

[integration]
method = "esdirk5"
tolerance = 1e-3

[vary.mark]
fields = ["body.proximal1.points.mark"]
values = [0.010, 0.100, 0.245]

[vary.elements]
fields = ["body.distal1.elements"]
whole = true
values = [2, 3, 4]
"""


def test_designs_with_other_stations_move_as_each_is_drawn(tmp_path):
    model = library_file("five_bar").read_text(encoding="utf-8")
    marked = model.replace('points = { A1 = 0.0, B1 = "l1" }', 'points = { A1 = 0.0, mark = 0.1, B1 = "l1" }')
    assert marked != model
    (tmp_path / "marked.toml").write_text(marked, encoding="utf-8")
    (tmp_path / "study.toml").write_text(MARKED, encoding="utf-8")
    result = sweep(load_sweep(tmp_path / "study.toml"), tmp_path / "out", workers=1)
    assert dict(result.counts) == {"complete": 3}
    study = open_study(tmp_path / "out")
    runs = [
        rerun(study.setting, values, "square", "++")[0] for values in ((0.010, 2), (0.100, 3), (0.245, 4))
    ]  # fmt: skip
    # What made the report leave designs out: stations are laid between the points of a beam.
    assert len({run.sizes["station"] for run in runs}) > 1
    page = study_page(tmp_path / "out")
    assert not any("not shown in motion" in note for note in page.notes)
    film = page.film
    assert film is not None
    assert sorted(page.runs) == ["#0 ++", "#1 ++", "#2 ++"]
    kept = frames_of(runs[0].sizes["time"])
    for label, shape in zip(page.runs, film.shape, strict=True):
        own = runs[int(label[1])].isel(mode=0)
        for body, first, end in film.bodies:
            mine = own["shape"].values[kept][:, own["station_body"].values == body]
            # The very stations of this design in their order, some of them twice.
            drawn = shape[:, first:end]
            same = [np.all(drawn[:, k] == drawn[:, k - 1]) for k in range(1, drawn.shape[1])]
            np.testing.assert_array_equal(drawn[:, [True, *(not one for one in same)]], mine)


def test_a_folder_without_rows_is_refused(finished, tmp_path):
    (tmp_path / "study.json").write_bytes((finished.folder / "study.json").read_bytes())
    with pytest.raises(InputError, match="no run is done yet"):
        study_page(tmp_path)
    (tmp_path / "study.json").write_text('{"content": "x"}', encoding="utf-8")
    with pytest.raises(InputError, match=r"not a study\.json of paraflex"):
        study_page(tmp_path)


def test_rows_of_parts_stand_in_order_of_runs(finished, tmp_path):
    data = pd.read_parquet(finished.table)
    import pyarrow.parquet as pq

    table = pq.read_table(finished.table)
    files = []
    for k, rows in enumerate((table.slice(8), table.slice(0, 8))):
        files.append(tmp_path / f"part-{k}.parquet")
        pq.write_table(rows, files[-1])
    studied = read_designs(files)
    np.testing.assert_array_equal(studied.run, data["run"])
    np.testing.assert_array_equal(studied.metrics["tracking_rms"], data["tracking_rms"])
