"""Sweeps in threads: one table whatever the order, resumed runs, rows of what cannot run, bad input, a full disk."""

import json
import sqlite3
import threading
import tracemalloc
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import paraflex
from paraflex.campaign import journal, tables
from paraflex.campaign.journal import read_journal
from paraflex.designs.measure import metrics_of
from paraflex.designs.run import Outcome, Task, run_task
from paraflex.errors import InputError, OutputError
from paraflex.files import Model, load, load_data
from paraflex.files.overlay import find_place, number_places, overlaid
from paraflex.results import load_results, summary, tracking_dataset
from paraflex.results.metrics import METRICS, PATH
from paraflex.studies import load_sweep, sweep
from paraflex.tracking import plan_tracking
from paraflex.writing import read_json, write_json
from shell import paraflex as shell

STUDY = """
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++", "+++-"]
duration = 0.2
samples = 51

[integration]
method = "esdirk5"
tolerance = 1e-3

[vary.thickness]
fields = ["section.bar.thickness"]
values = [0.005, 0.006]

[vary.end]
fields = ["lump.end.mass"]
values = [0.2, 0.3]
"""


# Besides the error over the whole run.
FOLLOWING = (
    "tracking_max", "tracking_rms_motion", "tracking_max_motion", "tracking_rms_after", "tracking_max_after",
    "residual_vibration", "drift_speed",
)  # fmt: skip


def write(folder, text=STUDY, **replaced):
    for old, new in replaced.items():
        text = text.replace(old, new)
    file = folder / "study.toml"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The study done in one go by one thread."""
    folder = tmp_path_factory.mktemp("sweep")
    file = write(folder)
    return file, sweep(load_sweep(file), folder / "one", workers=1)


def stub(setting, task, watch=None):
    """A run that takes no time; its metric is told by its number."""
    modes = len(setting.modes)
    rows = [
        {"run": task.number * modes + k, "id": f"{task.number}-{mode}", "design": task.design, "path": task.path}
        | {"mode": mode, "status": "complete", "reason": "", "tracking_rms": 1.0 / (1 + task.number)}
        for k, mode in enumerate(setting.modes)
    ]
    return Outcome(task, rows)


def test_every_run_has_its_row(finished):
    _, result = finished
    assert result.complete
    assert result.counts == {"complete": 8}
    data = pd.read_parquet(result.table)
    assert list(data["run"]) == list(range(8))
    # Every combination, the last parameter fastest.
    assert list(zip(data["thickness"], data["end"], data["mode"], strict=True))[:3] == [
        (0.005, 0.2, "++++"),
        (0.005, 0.2, "+++-"),
        (0.005, 0.3, "++++"),
    ]
    assert data["id"].is_unique
    assert np.allclose(data["time_reached"], 0.2)
    assert not (result.folder / "unfinished.parquet").exists()
    assert json.loads((result.folder / "summary.json").read_text())["status"] == {"complete": 8}


def test_metrics_are_those_of_the_dataset(finished):
    """The same numbers from the dataset of the same runs, made another way."""
    file, result = finished
    data, source = load_data("raparm_i")
    study = load_sweep(file)
    changed = overlaid(data, study.setting.numbers((0.006, 0.3)))
    model = paraflex.files.model_from(changed, source)
    task = plan_tracking(model.mechanism, model.path("line"), duration=0.2, samples=51, assembly="outward")
    run = task.simulate("+++-", options=study.setting.options(model))
    dataset = tracking_dataset([run])
    figures = summary(dataset)["modes"]["+++-"]
    row = pd.read_parquet(result.table).set_index(["thickness", "end", "mode"]).loc[(0.006, 0.3, "+++-")]
    assert row["tracking_rms"] == pytest.approx(figures["tracking_rms"], rel=1e-12)
    for name in FOLLOWING:
        assert row[name] == pytest.approx(figures[name], rel=1e-9), name
    for motor in ("tau1", "tau2", "tau5", "tau6"):
        assert row[f"peak_torque.{motor}"] == pytest.approx(figures["peak_torque"][motor], rel=1e-12)
        assert row[f"rms_torque.{motor}"] == pytest.approx(figures["rms_torque"][motor], rel=1e-12)
    torque = dataset["torque"].sel(mode="+++-").values
    assert row["peak_torque_max"] == pytest.approx(np.abs(torque).max(), rel=1e-12)
    assert row["rms_torque_norm"] == pytest.approx(np.sqrt((torque**2).sum(axis=1).mean()), rel=1e-12)
    assert row["deflection_max"] == pytest.approx(float(dataset["deflection"].max()), rel=1e-9)
    away = np.hypot(*(dataset["end_effector"] - dataset["end_effector_desired"]).sel(mode="+++-").values.T)
    assert row["tracking_max"] == pytest.approx(away.max(), rel=1e-12)
    moving = dataset["time"].values <= task.path.duration
    assert row["tracking_rms_motion"] == pytest.approx(np.sqrt(np.mean(away[moving] ** 2)), rel=1e-12)
    assert row["tracking_max_after"] == pytest.approx(away[~moving].max(), rel=1e-12)
    assert row["work"] == pytest.approx(float(dataset["work"][0, -1]), rel=1e-12)
    assert row["steps"] == figures["steps"]
    assert row["total_mass"] == pytest.approx(sum(_mass(body) for body in model.mechanism.bodies), rel=1e-12)
    # Three active motors; their speeds from the angles of the links they drive at the base.
    speeds = dataset["angular_velocity"].sel(mode="+++-", body=["link1", "link2", "link5"]).values
    power = np.abs(torque[:, :3] * speeds)
    assert row["motor_energy"] == pytest.approx(np.trapezoid(power.sum(axis=1), dataset["time"].values), rel=1e-9)
    assert row["motor_power_max"] == pytest.approx(power.max(), rel=1e-9)


def _mass(body):
    return body.length * 0.030 * 0.006 * 2700.0 + sum(lump.mass for lump in body.lumps)


def test_the_table_is_the_same_whatever_the_number_of_threads_and_the_order(finished, tmp_path):
    file, one = finished

    def backwards(setting, task, watch=None):
        # The first design waits for the others.
        if task.number == 0:
            waited.wait(30)
        outcome = run_task(setting, task, watch)
        if task.number == 3:
            waited.set()
        return outcome

    waited = threading.Event()
    two = sweep(load_sweep(file), tmp_path / "two", workers=2, run=backwards)
    assert waited.is_set()
    assert two.table.read_bytes() == one.table.read_bytes()


def test_a_stopped_sweep_goes_on_and_makes_no_run_twice(finished, tmp_path):
    file, one = finished
    made = []

    def counted(setting, task, watch=None):
        made.append(task.number)
        return run_task(setting, task, watch)

    study = load_sweep(file)
    first = sweep(study, tmp_path / "out", workers=1, limit=2, run=counted)
    assert not first.complete
    assert first.done == 2
    assert len(pd.read_parquet(first.table)) == 2

    def stopped(progress):
        if progress.done >= 4:
            raise KeyboardInterrupt

    second = sweep(study, tmp_path / "out", workers=1, run=counted, on_progress=stopped)
    assert second.interrupted
    assert second.done >= 4
    third = sweep(study, tmp_path / "out", workers=1, run=counted)
    fourth = sweep(study, tmp_path / "out", workers=1, run=counted)
    # What Ctrl-C met half done may be begun again; what has a row is not.
    assert len(made) - len(set(made)) <= 2
    assert fourth.fresh == 0
    assert third.counts == fourth.counts == {"complete": 8}
    assert fourth.table.read_bytes() == one.table.read_bytes()


def test_what_cannot_run_is_a_row_with_its_reason(tmp_path):
    text = STUDY.replace("[0.005, 0.006]", "[-0.001, 0.006]").replace("[0.2, 0.3]", "[0.25]")
    text += '\n[vary.corner]\nfields = ["path.line.end.1"]\nvalues = [0.264, 0.9]\n'
    result = sweep(load_sweep(write(tmp_path, text)), tmp_path / "out")
    data = pd.read_parquet(result.table).set_index(["thickness", "corner", "mode"])
    thin = data.loc[(-0.001, 0.264, "++++")]
    assert thin["status"] == "invalid"
    assert "section.bar.thickness: must be positive (got -0.001)" in thin["reason"]
    assert np.isnan(thin["tracking_rms"])
    far = data.loc[(0.006, 0.9, "++++")]
    assert far["status"] == "failed"
    assert "out of reach" in far["reason"] or "singularity" in far["reason"]
    assert 0.0 < far["time_reached"] < 0.2
    assert data.loc[(0.006, 0.264, "++++")]["status"] == "complete"
    assert result.counts["complete"] == 2


def test_a_run_given_up_says_when(tmp_path):
    file = write(tmp_path, STUDY.replace("tolerance = 1e-3", "tolerance = 1e-3\nmax_steps = 3"))
    result = sweep(load_sweep(file), tmp_path / "out")
    data = pd.read_parquet(result.table)
    assert result.counts == {"failed": 8}
    assert data["reason"].str.contains("the run has not ended after 3 steps, at t = ").all()
    assert (data["time_reached"] > 0.0).all()
    assert (data["time_reached"] < 0.2).all()


def test_an_error_nobody_thought_of_is_a_row(tmp_path, monkeypatch):
    def strange(*_, **__):
        raise ZeroDivisionError("by a strange design")

    monkeypatch.setattr(Model, "plan", strange)
    result = sweep(load_sweep(write(tmp_path)), tmp_path / "out")
    assert result.counts == {"failed": 8}
    assert set(pd.read_parquet(result.table)["reason"]) == {"ZeroDivisionError: by a strange design"}


def test_trajectories_are_kept_by_run_id(tmp_path):
    text = "trajectories = true\n" + STUDY.replace("[0.005, 0.006]", "[0.005]").replace("[0.2, 0.3]", "[0.225]")
    result = sweep(load_sweep(write(tmp_path, text)), tmp_path / "out")
    data = pd.read_parquet(result.table)
    files = sorted(file.stem for file in (tmp_path / "out" / "trajectories").iterdir())
    assert files == sorted(data["id"])
    row = data[data["mode"] == "+++-"].iloc[0]
    kept = load_results(tmp_path / "out" / "trajectories" / f"{row['id']}.nc")
    assert float(kept["tracking_rms"][0]) == pytest.approx(row["tracking_rms"], rel=1e-12)
    assert kept.attrs["id"] == row["id"]


def test_ids_follow_content(finished, tmp_path):
    """The same design has the same id in another study; another tolerance is another run."""
    file, one = finished
    fewer = tmp_path / "fewer.toml"
    fewer.write_text(file.read_text().replace("[0.005, 0.006]", "[0.006]"))
    other = tmp_path / "other.toml"
    other.write_text(file.read_text().replace("1e-3", "2e-3"))
    ids = set(pd.read_parquet(one.table)["id"])
    same = {row["id"] for row in run_task_rows(fewer)}
    assert same < ids
    assert not ids & {row["id"] for row in run_task_rows(other)}


def run_task_rows(file):
    from paraflex.designs.run import Task, lost

    study = load_sweep(file)
    tasks = [Task(k, k, tuple(values), "line") for k, values in enumerate(study.designs.tolist())]
    return [row for task in tasks for row in lost(study.setting, task, "").rows]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("section.bar.thickness", "section.bar.thicknes", 'did you mean "section.bar.thickness"?'),
        ("section.bar.thickness", "body.link1.material", "not a number in the mechanism's file (got"),
        ("section.bar.thickness", "ground.A1", 'write "ground.A1.0"'),
        ("section.bar.thickness", "ground.A1.2", "no such number"),
        ('paths = ["line"]', 'paths = ["lin"]', "paths: unknown path (got 'lin'); did you mean \"line\"?"),
        ('"+++-"', '"+++"', "modes: not an actuation mode (got '+++')"),
        ("esdirk5", "esdirk6", "integration.method: unknown method"),
        ("values = [0.2, 0.3]", "values = []", "vary.end.values: has no values"),
        ("values = [0.2, 0.3]", 'values = ["x"]', "vary.end.values: not a number (got 'x')"),
        ("values = [0.2, 0.3]", "low = 0.2", "vary.end.high: is missing"),
        ("values = [0.2, 0.3]", "low = 0.2\nhigh = 0.1", "vary.end.high: below low, 0.2 (got 0.1)"),
        ("values = [0.2, 0.3]", 'low = 0.0\nhigh = 1.0\nscale = "log"', "a logarithmic range must be positive"),
        ("[vary.end]", "[vary.mode]", "vary.mode: a column of the table has that name"),
        ("samples = 51", "samples = 1", "samples: too few samples (got 1)"),
        ("samples = 51", 'metrics = ["tracking_rm"]', 'did you mean "tracking_rms"?'),
        ("samples = 51", 'assembly = "sideways"', "unknown assembly (got 'sideways')"),
        ('mechanism = "raparm_i"', 'mechanism = "raparm"', 'did you mean "raparm_i"?'),
        ("[integration]", '[sampling]\nkind = "sobol"\n[integration]', "sobol samples are taken from a range"),
        ("[integration]", '[sampling]\nkind = "lisst"\n[integration]', 'did you mean "list"?'),
        ("samples = 51", "sample = 51", 'did you mean "samples"?'),
    ],
)
def test_bad_studies_say_what_to_do(tmp_path, old, new, says):
    assert old in STUDY
    with pytest.raises(InputError) as caught:
        load_sweep(write(tmp_path, STUDY.replace(old, new)))
    assert says in str(caught.value)
    assert "study.toml" in str(caught.value) or "mechanism" in str(caught.value)


def test_a_folder_of_another_study_is_left_alone(finished, tmp_path):
    file, one = finished
    changed = write(tmp_path, STUDY.replace("0.3]", "0.4]"))
    before = one.table.read_bytes()
    with pytest.raises(InputError, match=r"results of another study.*name a new folder"):
        sweep(load_sweep(changed), one.folder, run=stub)
    assert one.table.read_bytes() == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with pytest.raises(InputError, match=r"the folder holds other files \(thesis.tex\)"):
        sweep(load_sweep(file), tmp_path / "mine", run=stub)


def test_other_versions_do_not_mix(finished, tmp_path):
    file, _ = finished
    study = load_sweep(file)
    sweep(study, tmp_path / "out", run=stub, limit=1)
    said = read_json(tmp_path / "out" / "study.json")
    said["versions"]["numba"] = "0.1"
    write_json(tmp_path / "out" / "study.json", said)
    with pytest.raises(InputError, match=r"study.json: damaged, or of other results"):
        sweep(study, tmp_path / "out", run=stub)
    (tmp_path / "out" / "manifest.json").unlink()
    with pytest.raises(InputError, match=r"begun with numba 0.1"):
        sweep(study, tmp_path / "out", run=stub)


def test_two_sweeps_do_not_write_to_one_folder(finished, tmp_path):
    study = load_sweep(finished[0])

    def inside(setting, task, watch=None):
        with pytest.raises(InputError, match="another process writes to it"):
            sweep(study, tmp_path / "out", run=stub)
        return stub(setting, task)

    assert sweep(study, tmp_path / "out", run=inside, workers=1).complete


def test_a_full_disk_loses_nothing_that_is_written(tmp_path, monkeypatch):
    study = load_sweep(write(tmp_path))
    connect = sqlite3.connect

    def small(*arguments, **options):
        """A disk with room for the rows of two tasks: SQLite itself says that there is no more."""
        connection = connect(*arguments, **options)
        if "rwc" in str(arguments[0]):
            connection.execute("PRAGMA max_page_count = 50")
        return connection

    def long(setting, task, watch=None):
        outcome = stub(setting, task)
        return Outcome(task, [row | {"reason": "x" * 40_000} for row in outcome.rows])

    with monkeypatch.context() as patch:
        patch.setattr(sqlite3, "connect", small)
        patch.setattr(journal, "_ROWS", 1)
        with pytest.raises(OutputError, match=r"no space left on device.*what is written stays.*run the same command"):
            sweep(study, tmp_path / "out", workers=1, run=long)
    with read_journal(tmp_path / "out" / "journal.sqlite") as kept:
        assert [row["run"] for row in kept.rows()] == [0, 1, 2, 3]
    made = []

    def counted(setting, task, watch=None):
        made.append(task.number)
        return stub(setting, task)

    result = sweep(study, tmp_path / "out", workers=1, run=counted)
    assert result.complete
    assert sorted(made) == [2, 3]


def test_a_damaged_journal_is_named(tmp_path):
    study = load_sweep(write(tmp_path))
    sweep(study, tmp_path / "out", workers=1, run=stub, limit=2)
    file = tmp_path / "out" / "journal.sqlite"
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(OutputError, match=r"journal.sqlite: damaged: .*delete this file"):
        sweep(study, tmp_path / "out", workers=1, run=stub)
    file.unlink()
    assert sweep(study, tmp_path / "out", workers=1, run=stub).complete


MANY = """
mechanism = "raparm_i"
modes = ["++++"]
metrics = ["tracking_rms"]

[sampling]
kind = "random"
number = %d
seed = 3

[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.004
high = 0.006
"""


def test_memory_is_flat(tmp_path):
    """Ten times the runs take hardly more memory: what grows is a bit a run and the designs themselves."""
    peaks = {}
    for number in (500, 5000):
        study = load_sweep(write(tmp_path, MANY % number))
        tracemalloc.start()
        result = sweep(study, tmp_path / str(number), workers=2, run=stub)
        peaks[number] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert result.complete
        assert len(pd.read_parquet(result.table)) == number
    assert peaks[5000] < peaks[500] + 2e6


def test_exporting_holds_one_group_at_a_time(tmp_path, monkeypatch):
    """Groups smaller than the table, commits that overlap them: the same file as from rows in order."""
    monkeypatch.setattr(tables, "_GROUP", 64)
    study = load_sweep(write(tmp_path, MANY % 300))
    one = sweep(study, tmp_path / "one", workers=1, run=stub)
    monkeypatch.setattr(journal, "_ROWS", 7)
    two = sweep(study, tmp_path / "two", workers=4, run=stub)
    assert two.table.read_bytes() == one.table.read_bytes()
    assert pq.ParquetFile(one.table).num_row_groups == 5


def test_designs():
    from paraflex.designs.samples import SweptParameter, designs

    a = SweptParameter("a", ("a",), low=1.0, high=100.0, log=True)
    b = SweptParameter("b", ("b",), low=2, high=5, whole=True)
    for kind in ("random", "sobol"):
        many = designs([a, b], kind, 1000, seed=1)
        assert np.array_equal(many[:100], designs([a, b], kind, 100, seed=1))
        assert not np.array_equal(many, designs([a, b], kind, 1000, seed=2))
        # Half of a logarithmic range is below its geometric mean.
        assert np.mean(many[:, 0] < 10.0) == pytest.approx(0.5, abs=0.05)
        assert sorted(set(many[:, 1])) == [2, 3, 4, 5]
        assert np.bincount(many[:, 1].astype(int))[2:] == pytest.approx([250] * 4, abs=50)
    grid = designs([SweptParameter("a", ("a",), low=1.0, high=100.0, number=3, log=True), b_values()], "grid", None, 0)
    assert np.allclose(grid, [[1, 7], [1, 8], [10, 7], [10, 8], [100, 7], [100, 8]])
    pairs = designs([b_values(), b_values()], "list", None, 0)
    assert pairs.tolist() == [[7, 7], [8, 8]]
    with pytest.raises(InputError, match="lists of different lengths"):
        designs([b_values(), SweptParameter("c", ("c",), values=(1.0,))], "list", None, 0)


def b_values():
    from paraflex.designs.samples import SweptParameter

    return SweptParameter("b", ("b",), values=(7.0, 8.0))


def test_overlays_leave_the_data_as_they_are():
    data, _ = load_data("raparm_i")
    place = find_place(data, "ground.A1.0")
    changed = overlaid(data, [(place, -0.2), (find_place(data, "body.link1.length"), 0.3)])
    assert changed["ground"]["A1"] == [-0.2, 0.0]
    assert data["ground"]["A1"] == [-0.1, 0.0]
    assert changed["body"]["link1"]["length"] == 0.3
    assert changed["body"]["link2"] is data["body"]["link2"]
    assert ("section", "bar", "thickness") in number_places(data)
    assert find_place({"a": {"b.c": [1.0]}}, 'a."b.c".0') == ("a", "b.c", 0)


def test_an_expression_is_a_number_that_can_vary():
    data = {"parameters": {"l": 0.2}, "body": {"bar": {"length": "2 * l", "section": "bar"}}}
    assert find_place(data, "body.bar.length") == ("body", "bar", "length")
    assert find_place(data, "parameters.l") == ("parameters", "l")
    with pytest.raises(InputError, match="not a number"):
        find_place(data, "body.bar.section")


def test_metrics_stand_in_the_order_asked_for(tmp_path):
    names = ["total_mass", "tracking_rms", "peak_torque", "tracking_rms_motion"]
    text = STUDY.replace("[integration]", f"metrics = {json.dumps(names)}\n\n[integration]")
    study = load_sweep(write(tmp_path, text))
    # Whether a design is within what its model can describe is always kept.
    assert study.setting.metrics == (*names, "validity")
    row = run_task(study.setting, Task(0, 0, (0.005, 0.2), "line")).rows[0]
    assert [name for name in row if name.partition(".")[0] in METRICS] == [
        "total_mass", "tracking_rms", *(f"peak_torque.tau{k}" for k in (1, 2, 5, 6)), "tracking_rms_motion", "validity"
    ]  # fmt: skip


@pytest.mark.parametrize(("error", "first"), [("motion", "tracking_rms_motion"), ("whole", "tracking_rms")])
def test_the_error_of_the_mechanism_s_study_comes_first(error, first):
    """Of metrics that nobody chose; the first is what figures show."""
    data, _ = load_data("raparm_i")
    study = data["study"] | {"error": error}
    setting = paraflex.files.model_from(data | {"study": study}, "raparm_i.toml").study
    assert setting.error == error
    assert metrics_of([], setting.error)[0] == first
    along_path = {name for name, metric in METRICS.items() if PATH in metric.runs}
    others = {
        "drive_torque_error",
        "joint_force_error",
        "stress_max_error",
        "joint_force_max",
        "joint_speed_max",
        "settling_time",
        "overshoot",
        "internal_torque_max",
        "saturated_share",
        "current_max",
        "rms_current",
        "voltage_max",
        "copper_energy",
    }
    assert set(metrics_of([], setting.error)) == along_path - others


def test_metrics_are_documented(monkeypatch):
    docs = Path(__file__).parents[1] / "docs"
    monkeypatch.syspath_prepend(str(docs / "hooks"))
    from metrics import on_page_markdown

    page = type("Page", (), {"file": type("File", (), {"src_uri": "sweeps.md"})})
    page = on_page_markdown((docs / "sweeps.md").read_text(encoding="utf-8"), page)
    for name in METRICS:
        assert f"`{name}`" in page, name


def test_command_line(tmp_path):
    file = write(tmp_path, STUDY.replace("[0.005, 0.006]", "[0.005]"))
    command = ["sweep", str(file), "--output", str(tmp_path / "out")]
    first = shell(*command, "--limit", "2")
    assert first.returncode == 0, first.stderr
    assert "2 of 4 runs: 2 complete" in first.stdout
    assert "the same command continues from there" in first.stderr
    again = shell(*command, "--json")
    assert again.returncode == 0, again.stderr
    figures = json.loads(again.stdout)
    assert (figures["done"], figures["fresh"], figures["runs"]) == (4, 2, 4)
    said = shell(*command[:-1], str(tmp_path / "other"), "--engine", "thread")
    assert said.returncode == 2
    assert said.stderr.strip() == "error: --engine: unknown engine (got 'thread'); did you mean \"threads\"?"


def test_path_durations_keep_the_share_of_dwell():
    model = load("raparm_i")
    square, line = model.path("square"), model.path("line")
    assert model.duration(square) == model.duration("square") == 0.7
    assert model.duration(line) == pytest.approx(0.7 * line.duration / square.duration)


def test_threads_that_were_asked_for_take_no_cluster(tmp_path):
    elsewhere = ("--engine", "threads", "--cluster", "tcp://127.0.0.1:9")
    done = shell("sweep", write(tmp_path), "--output", tmp_path / "out", *elsewhere)
    assert done.returncode == 2
    assert "--cluster: only the engine dask takes a cluster" in done.stderr
