"""Paths of files: tables of points with a speed profile or with times, sequences; runs along them; what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.errors import InputError
from paraflex.files import load, load_path
from paraflex.paths import Line, PointPath, SequencePath, TabulatedPath
from paraflex.tracking import plan_tracking
from test_loads import five_bar

ARC = [(0.04 * np.sin(0.2 * k), 0.26 + 0.04 * np.cos(0.2 * k)) for k in range(9)]
TABLES = """
[path.drawn]
type = "table"
table = "drawn.csv"
max_acceleration = 8.0
max_speed = 0.5
[path.timed]
type = "table"
table = "timed.csv"
[path.back]
type = "line"
start = [{x}, {y}]
end = [0.0, 0.3]
max_acceleration = 10.0
[path.tour]
type = "sequence"
paths = ["drawn", "back", "drawn"]
dwell = 0.05
"""


def written(folder, text=None):
    model = pf.Model(five_bar())
    model.save(folder / "five.toml")
    (folder / "drawn.csv").write_text("x [m], y [m]\n" + "".join(f"{x!r}, {y!r}\n" for x, y in np.array(ARC).tolist()))
    rows = [f"{x!r} {y!r} {0.1 * k}\n" for k, (x, y) in enumerate(np.array(ARC).tolist())]
    (folder / "timed.csv").write_text("".join(rows))
    (folder / "none.csv").write_text("0 0\n0 nan\n1 1\n2 2\n")
    (folder / "ragged.csv").write_text("0 0\n1 0\n1 1 2\n2 2\n")
    (folder / "one.csv").write_text("0\n1\n2\n3\n")
    x, y = np.array(ARC[-1]).tolist()
    text = TABLES.format(x=x, y=y) if text is None else text
    (folder / "five.toml").write_text((folder / "five.toml").read_text() + text)
    return folder / "five.toml"


def test_files_give_tables_and_sequences_and_take_them(tmp_path):
    model = load(written(tmp_path))
    drawn, timed, back, tour = (model.paths[name] for name in ("drawn", "timed", "back", "tour"))
    assert drawn == TabulatedPath(ARC, max_acceleration=8.0, max_speed=0.5)
    assert timed == TabulatedPath(ARC, times=tuple(0.1 * k for k in range(9)))
    assert tour == SequencePath((drawn, back, drawn), 0.05)
    pf.Model(model.mechanism, model.paths).save(tmp_path / "again.toml")
    assert load(tmp_path / "again.toml").paths == model.paths
    changed = replace(model, mechanism=replace(model.mechanism, gravity=(0.0, -9.81)))
    changed.save(tmp_path / "changed.toml")
    assert load(tmp_path / "changed.toml").paths == model.paths
    assert 'table = "drawn.csv"' in (tmp_path / "changed.toml").read_text()
    with pytest.raises(
        InputError, match=r"path\.tour\.paths: a model file cannot express this .*a path without a name"
    ):
        pf.Model(model.mechanism, {"tour": tour}).save(tmp_path / "no.toml")


def test_a_path_has_a_file_of_its_own_beside_its_table(tmp_path):
    written(tmp_path)
    (tmp_path / "path.toml").write_text('[path]\ntype = "table"\ntable = "drawn.csv"\nmotion_time = 0.6\n')
    assert load_path(tmp_path / "path.toml") == TabulatedPath(ARC, motion_time=0.6)
    (tmp_path / "path.toml").write_text('[path]\ntype = "table"\ntable = "ragged.csv"\nmotion_time = 0.6\n')
    with pytest.raises(InputError, match=r"path\.toml: path\.table: line 3 of ragged\.csv is not two or three numbers"):
        load_path(tmp_path / "path.toml")


@pytest.mark.parametrize("name", ["drawn", "timed", "tour"])
def test_rigid_links_follow_them(tmp_path, name):
    model = load(written(tmp_path))
    task = plan_tracking(model, name, samples=31)
    run = task.simulate("++", options=pf.IntegrationOptions(tolerance=1e-7))
    assert np.max(np.linalg.norm(run.driven.actual - run.driven.desired, axis=1)) < 2e-6
    assert run.solution.energy_balance_max < 1e-5


TABLE = '[path.p]\ntype = "table"\n'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (TABLE + "motion_time = 1", "path.p.table: "),
        (TABLE + 'table = "drawn.csv"', "path.p.max_acceleration: its motion profile is not given; give max_acc"),
        (TABLE + 'table = "timed.csv"\nmotion_time = 1', "path.p.motion_time: its motion profile is given in two ways"),
        (TABLE + 'table = "missing.csv"\nmotion_time = 1', "path.p.table: cannot be read (no such file or directory)"),
        (TABLE + 'table = "one.csv"\nmotion_time = 1', "path.p.table: line 1 of one.csv is not two or three numbers"),
        (TABLE + 'table = "ragged.csv"\nmotion_time = 1', "path.p.table: line 3 of ragged.csv is not two or three"),
        (
            TABLE + 'table = "none.csv"\nmotion_time = 1',
            "path.p.table: line 2 of none.csv has a number that is not finite",
        ),
        (TABLE + "table = [[0, 0], [1, 0], [1, 0], [2, 0]]\nmotion_time = 1", "path.p.table: points 2 and 3 coincide"),
        (TABLE + "table = [[0, 0], [1, 0], [1, 1]]\nmotion_time = 1", "path.p.table: not a list of points"),
        (
            TABLE + "table = [[0, 0, 0], [1, 0, 1], [1, 1, 1], [2, 0, 2]]",
            "path.p.table: its times must ascend, but that of",
        ),
        (TABLE + "table = [[0, 0], [1, 0, 1], [1, 1, 1], [2, 0, 2]]", "path.p.table: some points have a time"),
        ('[path.p]\ntype = "sequence"\npaths = ["q", "p"]', "path.p.paths: unknown path (got 'q')"),
    ],
)
def test_paths_that_make_no_sense_are_refused_by_name(tmp_path, text, says):
    file = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        load(file)
    assert f"{file}: {says}" in str(caught.value)
    assert caught.value.remedy


def test_a_sequence_is_planned_as_its_parts_are():
    there, back = Line((0.0, 0.30), (0.04, 0.27), 20.0), PointPath(((0.04, 0.27), (0.0, 0.28), (0.0, 0.3)), 0.3)
    whole = plan_tracking(five_bar(), SequencePath((there, back), 0.02), samples=11)
    alone = plan_tracking(five_bar(), back, samples=11)
    t = np.linspace(0.0, 0.3, 17)
    found = whole.torques("++").evaluate(there.duration + 0.02 + t)
    np.testing.assert_allclose(found, alone.torques("++").evaluate(t), rtol=0, atol=1e-6 * np.max(np.abs(found)))


def test_every_named_point_is_recorded_with_its_velocity_and_acceleration():
    model = pf.load("raparm_i")
    task = pf.plan(model, "line", duration=0.1, samples=401)
    data = pf.tracking_dataset([task.simulate("++++")])
    effector = str(task.mechanism.end_effector.point)
    for name in ("velocity", "acceleration"):
        of_point = data[f"point_{name}"].sel(point=effector).values
        np.testing.assert_allclose(of_point, data[f"end_effector_{name}"].values, rtol=0, atol=1e-12)
    # Of flexible links, whose points move against their frames.
    elsewhere = data.isel(mode=0).sel(point="link1.B1")
    numeric = np.gradient(elsewhere["point_position"].values, data["time"].values, axis=0)[2:-2]
    np.testing.assert_allclose(numeric, elsewhere["point_velocity"].values[2:-2], rtol=0, atol=2e-3)
    figure = pf.plots.point_motions(data, points=["link1.B1", effector])
    labels = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert {"link1.B1", effector} <= set(labels)
    speed = np.linalg.norm(elsewhere["point_velocity"].values, axis=1)
    np.testing.assert_allclose(figure.axes[1].lines[0].get_ydata(), speed, rtol=1e-12)
    with pytest.raises(InputError, match=r"points: no such point in these results \(got 'link9\.B'\)"):
        pf.plots.point_motions(data, points=["link9.B"])
