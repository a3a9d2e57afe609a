"""Bases of other poses and between poses: what they keep, how errors grow, tables along a path, bad input."""

from __future__ import annotations

import json

import numpy as np
import pytest
import scipy

import paraflex as pf
from paraflex.linear.bases import interpolated
from paraflex.paths import Line
from paraflex.results import load_results, reduction_summary
from shell import paraflex

MECHANISM = pf.library.raparm_i()
BAND = 2.0 * np.pi * np.linspace(0.5, 40.0, 30) * (1j + 0.01)
METHODS = ["craig-bampton", "rubin"]


def start_at(x, y):
    return pf.plan(MECHANISM, Line((x, y), (x, y - 0.004), max_acceleration=1.0), samples=2).start


def reduced(x, y, mode="+-+-", **options):
    return pf.reduce(MECHANISM, mode=mode, start=start_at(x, y), **options)


@pytest.fixture(scope="module", params=METHODS)
def ends(request):
    """Reduced models of two poses 0.04 m apart."""
    return [reduced(0.0, 0.264, method=request.param), reduced(0.04, 0.264, method=request.param)]


def worst(few):
    return max(few.error(BAND, [one.name]).max() for one in few.outputs)


def angle(one, other):
    """Largest sine of angles between the spans of two bases, in the metric of the mass."""
    mass = one.full.second_order.mass
    root = np.linalg.cholesky(mass).T
    first, second = (np.linalg.qr(root @ few.shapes)[0] for few in (one, other))
    return float(np.linalg.norm(second - first @ (first.T @ second), 2))


# --- One pose ---------------------------------------------------------------------------------------------------------


def test_a_mechanism_is_linearised_first():
    few, model = reduced(0.03, 0.28), pf.linearise(MECHANISM, mode="+-+-", start=start_at(0.03, 0.28))
    assert few.frequency_response(BAND) == pytest.approx(pf.reduce(model).frequency_response(BAND), rel=1e-9)
    run = pf.load("raparm_i").plan()
    moving = pf.reduce(run, 12, mode="++++", at=0.1)
    assert (moving.full.about, moving.full.time) == ("a planned motion", pytest.approx(0.1, abs=1e-3))
    assert len(moving.states) == 12


@pytest.mark.parametrize("renewed", [True, False])
def test_the_basis_of_its_own_pose_is_its_own(ends, renewed):
    few = ends[0]
    again = pf.reduce(few.full, basis=few, renewed=renewed)
    assert again.states == few.states
    assert again.frequency_response(BAND) == pytest.approx(few.frequency_response(BAND), rel=1e-8)


def test_the_basis_of_another_pose_by_hand(ends):
    """(s^2 T^T M T + T^T K T) z = T^T F u and y = C T z, with the shapes of the other pose."""
    there = pf.reduce(MECHANISM, basis=ends[0], mode="+-+-", start=start_at(0.04, 0.264), renewed=False,
                      feed_through=False)  # fmt: skip
    model, T, f = there.full, ends[0].shapes, len(there.shapes)
    assert there.shapes == pytest.approx(T, abs=1e-9)
    equations = model.second_order
    mass, stiffness = (T.T @ part @ T for part in (equations.mass, equations.stiffness))
    forces = T.T @ equations.mass @ model.B[f:]
    for s in BAND[::10]:
        z = np.linalg.solve(s * s * mass + stiffness, forces)
        # Near the frequency of the rigid motion, zero, rounding is that of the largest entry.
        by_hand = model.C[:, :f] @ T @ z
        assert there.frequency_response([s])[0] == pytest.approx(by_hand, abs=1e-8 * np.abs(by_hand).max())


@pytest.mark.parametrize("renewed", [True, False])
def test_the_first_states_are_the_motors_coordinates_in_any_coordinates(renewed):
    """Of coordinates of the end-effector, of which motors' angles are different combinations in every pose."""
    models = [pf.linearise(MECHANISM, start=start_at(x, 0.264), coordinates="task") for x in (0.0, 0.03)]
    few = pf.reduce(models[1], basis=pf.reduce(models[0]), renewed=renewed)
    joints = [one.name for one in few.states[:4]]
    assert models[1].joint_rows(joints) @ few.shapes == pytest.approx(np.eye(4, 8), abs=1e-9)
    assert worst(few) < 0.01


def test_renewed_static_shapes_keep_rigid_motions_and_stiffness(ends):
    """A basis of another pose as a whole does not: there the motors turn in another ratio in a rigid motion."""
    start = start_at(0.1, 0.2)
    renewed, carried = (pf.reduce(MECHANISM, basis=ends[0], mode="+-+-", start=start, renewed=each)
                        for each in (True, False))  # fmt: skip
    assert renewed.frequencies[:2] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert carried.frequencies[1] > 0.1
    # Still slower, rounding of the rigid motions grows as the frequency's square falls.
    slow = [2.0 * np.pi * 0.1]
    assert renewed.error(slow).max() < 1e-7
    assert renewed.held_frequencies()[:2] == pytest.approx(renewed.full.held_frequencies()[:2], rel=1e-4)
    assert worst(renewed) < 0.1 * worst(carried)


def test_errors_grow_with_the_second_power_of_the_distance(ends):
    """Of frequencies: by Rayleigh's quotient they do as the square of the error of shapes, which grows linearly."""
    shapes, frequencies = [], []
    for x in (0.02, 0.04):
        far = pf.reduce(MECHANISM, basis=ends[0], mode="+-+-", start=start_at(x, 0.264), renewed=False)
        own = pf.reduce(far.full, method=ends[0].method)
        shapes.append(angle(own, far))
        frequencies.append(np.abs(far.frequencies[3] / far.full.frequencies[3] - own.frequencies[3]
                                  / own.full.frequencies[3]))  # fmt: skip
    assert 1.8 < shapes[1] / shapes[0] < 2.3
    assert 3.0 < frequencies[1] / frequencies[0] < 5.5


# --- Between poses ----------------------------------------------------------------------------------------------------


def test_between_poses_an_end_has_its_own_basis(ends):
    for part, few in enumerate(ends):
        again = pf.reduce(few.full, basis=ends, part=part, renewed=False)
        assert again.frequency_response(BAND) == pytest.approx(few.frequency_response(BAND), rel=1e-6)
        assert angle(few, again) < 1e-9


def test_interpolated_shapes_err_by_the_second_power_of_the_distance(ends):
    """Halfway between poses 0.04 m apart, and 0.02 m."""
    found = []
    for x in (0.04, 0.02):
        pair = [ends[0], reduced(x, 0.264, method=ends[0].method)]
        halfway = pf.reduce(MECHANISM, basis=pair, part=0.5, mode="+-+-", start=start_at(0.5 * x, 0.264), renewed=False)
        found.append(angle(pf.reduce(halfway.full, method=ends[0].method), halfway))
        assert worst(halfway) < 1e-3
    assert 3.7 < found[0] / found[1] < 4.4


def test_signs_and_crossings_of_vibrations_do_not_matter():
    random = np.random.default_rng(3)
    mass = np.diag(random.uniform(0.5, 2.0, 9))
    shapes = scipy.linalg.qr(random.standard_normal((9, 5)), mode="economic")[0] / np.sqrt(np.diag(mass))[:, None]
    other = shapes[:, [0, 1, 4, 2, 3]] * [1.0, 1.0, -1.0, 1.0, -1.0]
    assert interpolated([shapes, other, shapes], mass, 2, 1.3) == pytest.approx(shapes, abs=1e-12)
    assert interpolated([shapes], mass, 2, 0.0) is shapes


# --- Along a path -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def line():
    model = pf.load("raparm_i")
    task = model.plan(path="line")
    return [pf.poses_along(task, 5, mode=mode) for mode in ("+-+-", "++++")]


def test_poses_are_evenly_along_the_path(line):
    """Of a straight line of 0.1 m from (-0.05, 0.264)."""
    found = line[0]
    assert found.unit == "m"
    assert found.places == pytest.approx(np.linspace(0.0, 0.1, 5), abs=5e-4)
    for model, place in zip(found.models, found.places, strict=True):
        assert model.about == "a pose at rest"
        assert model.states == found.models[0].states
        start = pf.plan(MECHANISM, Line((-0.05 + place, 0.264), (-0.05 + place, 0.26), max_acceleration=1.0), samples=2)
        same = pf.linearise(MECHANISM, mode="+-+-", start=start.start)
        assert model.held_frequencies()[:4] == pytest.approx(same.held_frequencies()[:4], rel=1e-7)


def test_errors_along_the_path(line):
    data = pf.reduction_dataset([one.models[0] for one in line], methods=["modal", "rubin"], along=line)
    assert data.attrs["along_method"] == "rubin"
    own, one = (data["along_error"].sel(mode="+-+-", static="carried", basis=name).values
                for name in ("of each pose", "of one pose"))  # fmt: skip
    assert np.all(own < 7e-4)
    assert one[0] == own[0]
    assert np.all(np.diff(one[2:]) > 0.0)
    basis, last = pf.reduce(line[0].models[0], method="rubin"), line[0].models[-1]
    s = 2.0 * np.pi * np.geomspace(0.4, 40.0, 60) * (1j + 0.01)
    few = pf.reduce(last, basis=basis, renewed=False)
    assert one[-1] == pytest.approx(max(few.error(s, [each.name]).max() for each in few.outputs), rel=1e-9)
    off = data["along_frequency_error"].sel(mode="+-+-", static="carried", basis="of one pose", holding="held").values
    few, full = few.held_frequencies()[:2], last.held_frequencies()[:2]
    assert off[-1] == pytest.approx(np.max(np.abs(few / full - 1.0)), rel=1e-6)
    summary = reduction_summary(data)["modes"]["+-+-"]["along"]
    assert summary["renewed"]["of one pose"]["within"] == (0.0, pytest.approx(0.1))
    start, end = summary["carried"]["of one pose"]["within"]
    assert start == 0.0
    assert end == line[0].places[one <= 0.01][-1]


def test_a_basis_between_more_poses_where_fewer_are_not_enough(line):
    data = pf.reduction_dataset([line[0].models[0]], along=line[:1], error=1e-3)
    worst = data["along_error"].sel(mode="+-+-", static="carried").max("place").values
    assert list(data["basis"].values[:3]) == ["of each pose", "of one pose", "between 2 poses"]
    assert worst[-1] <= 1e-3 < worst[-2]


def test_the_command_along_a_path(tmp_path):
    done = paraflex("reduce", "raparm_i", "--mode", "+-+-", "--path", "line", "--along", "5", "--basis", "0,0.264",
                    "--no-report", "--out", "r", cwd=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Bases of other poses, craig-bampton: errors at 5 poses along 100 mm up to 40 Hz" in done.stdout
    data = load_results(tmp_path / "r" / "reduced.nc")
    error = data["along_error"].sel(mode="+-+-", static="carried", basis="of one pose").values
    # The basis is that of the middle.
    assert error[2] == pytest.approx(
        data["along_error"].sel(static="carried", basis="of each pose").values[0, 2], rel=0.2
    )
    assert min(error[0], error[4]) > 2.0 * error[2]
    numbers = json.loads((tmp_path / "r" / "reduced.json").read_text())
    assert numbers["modes"]["+-+-"]["along"]["carried"]["of one pose"]["largest_error"] == error.max()
    assert (tmp_path / "r" / "figures" / "bases_along_path.png").exists()


@pytest.mark.parametrize(("model", "path", "unit"), [("five_bar", None, "m"), ("slider_crank_flexible", None, "s")])
def test_other_mechanisms_along_their_motion(model, path, unit):
    source = pf.load(model)
    motion = source.plan() if source.paths else pf.simulate_motion(source.mechanism, 0.05, start=source.start)
    found = pf.poses_along(motion, 3)
    assert found.unit == unit
    assert len({one.states for one in found.models}) == 1


# --- Bad input --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"states": 12}, "states: are those of the basis, 16"),
        ({"method": "rubin"}, "method: is that of the basis"),
        ({"part": 0.5}, "part: is not between the bases"),
        ({"mode": "++++"}, "mode: has no meaning for a linear model"),
        ({"basis": []}, "basis: names none"),
        ({"basis": None, "part": 0.5}, "basis: names none"),
    ],
)
def test_arguments_that_do_not_go_together(given, says):
    few = reduced(0.0, 0.264)
    with pytest.raises(pf.InputError, match=says):
        pf.reduce(few.full, **{"basis": few} | given)


def test_bases_that_cannot_be_taken_over():
    few, full = reduced(0.0, 0.264), pf.linearise(MECHANISM, mode="+-+-", start=start_at(0.0, 0.264))
    with pytest.raises(pf.InputError, match="basis: does not keep the motors' coordinates"):
        pf.reduce(full, basis=pf.reduce(full, method="modal"))
    with pytest.raises(pf.InputError, match="basis: belongs to a mechanism with other bodies or motors than five-bar"):
        pf.reduce(pf.load("five_bar"), basis=few)
    with pytest.raises(pf.InputError, match="basis: belongs to a mechanism with other bodies or motors than five-bar"):
        pf.reduce(pf.linearise(pf.load("five_bar")), basis=few)
    task = pf.linearise(MECHANISM, mode="+-+-", start=start_at(0.0, 0.264), coordinates="task")
    with pytest.raises(pf.InputError, match="basis: has other coordinates than the model"):
        pf.reduce(task, basis=few)
    with pytest.raises(pf.InputError, match="basis: has coordinates that do not describe the motion in this pose"):
        pf.reduce(MECHANISM, basis=few, assembly="inward")
    with pytest.raises(pf.InputError, match="basis: have different states"):
        pf.reduce(full, basis=[few, reduced(0.0, 0.264, states=12)])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--along", "5", "--basis", "0,9"], "--basis: the end-effector cannot reach it (got '0,9')"),
        (["--along", "5", "--basis", "nowhere"], "--basis: no such pose (got 'nowhere')"),
        (["--basis", "0,0.264"], "--basis: is the pose whose basis is taken along a path"),
        (["--along", "5", "--method", "modal"], "--method: have no basis that other poses could take over"),
        (["--along", "5", "--pose", "0,0.264"], "--along: is about a motion, --pose about rest"),
        (["--along", "1"], "--along: not a valid number of times"),
        (["--along", "9999"], "--along: more poses than samples of the motion that lie apart"),
    ],
)
def test_bad_input_is_one_line(arguments, message):
    done = paraflex("reduce", "raparm_i", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
