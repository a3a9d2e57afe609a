"""The angle of an end-effector along a path: constant from the study, or given at the points of a path."""

import json

import numpy as np
import pytest

from paraflex.errors import InputError
from paraflex.files import load
from paraflex.paths import PointPath, follow_path
from paraflex.results import load_results
from shell import paraflex

# Two links of 0.4 and 0.3 m that carry a tool of 0.1 m.
ARM = """
name = "arm"
[ground]
O = [0.0, 0.0]
[body.upper]
type = "rigid"
mass = 1.0
inertia = 0.01
centre_of_mass = [0.2, 0.0]
points = { a = [0.0, 0.0], b = [0.4, 0.0] }
[body.lower]
type = "rigid"
mass = 1.0
inertia = 0.01
centre_of_mass = [0.15, 0.0]
points = { a = [0.0, 0.0], b = [0.3, 0.0] }
[body.tool]
type = "rigid"
mass = 1.0
inertia = 0.01
centre_of_mass = [0.05, 0.0]
points = { a = [0.0, 0.0], b = [0.1, 0.0] }
[joint]
O = ["ground.O", "upper.a"]
E = ["upper.b", "lower.a"]
W = ["lower.b", "tool.a"]
[motor]
shoulder = "O"
elbow = "E"
wrist = "W"
[end_effector]
point = "tool.b"
coordinates = ["x", "y", "angle"]
[assembly.down]
upper = 0.2
lower = 1.2
tool = 1.5
[path.triangle]
type = "polygon"
corners = [[0.3, 0.4], [0.45, 0.35], [0.4, 0.5]]
max_acceleration = 5.0
[path.turning]
type = "points"
points = [[0.3, 0.4, 1.3], [0.4, 0.4, 0.9], [0.45, 0.35, 1.1]]
motion_time = 0.5
[study]
path = "triangle"
modes = ["+++"]
samples = 51
orientation = 1.3
"""


def write(folder, *changes):
    text = ARM
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = folder / "arm.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_the_study_says_how_the_tool_is_held(tmp_path):
    file = write(tmp_path)
    assert load(file).study.orientation == 1.3
    done = paraflex("run", "--no-figures", "-m", str(file), "--tol", "1e-6", "--out", str(tmp_path / "out"), "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["modes"]["+++"]["tracking_rms"] < 1e-5
    angle = load_results(tmp_path / "out" / "results.nc")["angle_desired"].sel(body="tool")
    np.testing.assert_allclose(angle, 1.3, rtol=0, atol=1e-9)


def test_points_may_say_how_the_tool_turns(tmp_path):
    model = load(write(tmp_path))
    path = model.paths["turning"]
    assert isinstance(path, PointPath)
    t = np.linspace(0.0, 0.5, 101)
    motion = follow_path(model.mechanism, path, t, orientation=5.0)
    tool = motion.system.body("tool").angle
    first, second = np.hypot(0.1, 0.0), np.hypot(0.05, 0.05)
    middle = 0.5 * first / (first + second)
    passed = follow_path(model.mechanism, path, [0.0, middle, 0.5]).q[:, tool]
    np.testing.assert_allclose(passed, [1.3, 0.9, 1.1], rtol=0, atol=1e-10)
    # From rest to rest; rate and acceleration are the derivatives of the angle.
    np.testing.assert_allclose(motion.v[[0, -1], tool], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.gradient(motion.q[:, tool], t)[2:-2], motion.v[2:-2, tool], rtol=0, atol=5e-3)
    np.testing.assert_allclose(np.gradient(motion.v[:, tool], t)[2:-2], motion.a[2:-2, tool], rtol=0, atol=0.2)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ([("orientation = 1.3", "orientation = nan")], "study.orientation: should be a finite number (got nan)"),
        ([("orientation = 1.3", 'orientation = "up"')], 'study.orientation: unknown parameter "up"'),
        (
            [(', "angle"]', "]")],
            'study.orientation: the angle is not a task coordinate (got 1.3); name "angle" among the coordinates',
        ),
        ([("[0.4, 0.4, 0.9]", "[0.4, 0.4]")], "path.turning.points: not a list of points"),
        ([("[0.4, 0.4, 0.9]", "[0.4, 0.4, 0.9, 1.0]")], "path.turning.points.1: list should have at most 3 items"),
    ],
)
def test_what_makes_no_sense_is_named(tmp_path, changes, says):
    with pytest.raises(InputError) as caught:
        load(write(tmp_path, *changes))
    assert says in str(caught.value)


def test_a_path_with_angles_wants_a_task_with_one(tmp_path):
    model = load(write(tmp_path, (', "angle"]', "]"), ("orientation = 1.3\n", ""), ('W = ["lower.b", "tool.a"]', ""),
                       ('wrist = "W"', ""), ('"tool.b"', '"lower.b"'), ('["+++"]', '["++"]'), ("tool = 1.5", ""),
                       (ARM[ARM.index("[body.tool]") : ARM.index("[joint]")], "")))  # fmt: skip
    with pytest.raises(InputError, match=r"end_effector\.coordinates: the path gives angles, but the task has none"):
        follow_path(model.mechanism, model.paths["turning"], [0.0, 0.1])
