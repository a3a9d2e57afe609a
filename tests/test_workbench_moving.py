"""Drags of mechanisms by hand: they follow the target, stop at limits, and stay in their assembly."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from conftest import QUICK_RETURN
from paraflex.errors import AssemblyError, InputError
from paraflex.figures.kinematics import kinematics_of, kinematics_tiles
from paraflex.files import load
from paraflex.results import motion_dataset
from paraflex.results.posed import posed
from paraflex.workbench.assembling import assemblies
from paraflex.workbench.computing import model_of
from paraflex.workbench.document import Document
from paraflex.workbench.moving import Mover
from paraflex.workbench.session import EditSession
from paraflex.workbench.turning import turning


def mover_of(name):
    return Mover(pf.load(name).mechanism)


def without_motors(mover):
    """Return a mover of the same mechanism whose end-effector is held instead of its motors."""
    return Mover(replace(mover.mechanism, motors=(), modes=()))


def link(name, length, *more):
    return pf.RigidBody(name, points={"a": (0.0, 0.0), "b": (length, 0.0), **dict(more)})


def chain(*lengths, angles):
    """Return a chain of massless links from the origin."""
    bodies = tuple(link(f"l{k}", length) for k, length in enumerate(lengths))
    points = ["ground.O", *(f"l{k}.b" for k in range(len(lengths)))]
    joints = tuple(pf.RevoluteJoint(f"j{k}", points[k], f"l{k}.a") for k in range(len(lengths)))
    given = {f"l{k}": angle for k, angle in enumerate(angles)}
    return pf.Mechanism(
        "chain", bodies=bodies, joints=joints, ground={"O": (0.0, 0.0)}, assemblies=(pf.Assembly("drawn", given),)
    )


def four_bar(crank, coupler, rocker, base, angles):
    bodies = (link("crank", crank), link("coupler", coupler), link("rocker", rocker))
    joints = (
        pf.RevoluteJoint("O", "ground.O", "crank.a"),
        pf.RevoluteJoint("A", "crank.b", "coupler.a"),
        pf.RevoluteJoint("B", "coupler.b", "rocker.b"),
        pf.RevoluteJoint("Q", "ground.Q", "rocker.a"),
    )
    given = dict(zip(("crank", "coupler", "rocker"), angles, strict=True))
    return pf.Mechanism(
        "four-bar", bodies=bodies, joints=joints, ground={"O": (0.0, 0.0), "Q": (base, 0.0)},
        assemblies=(pf.Assembly("drawn", given),),
    )  # fmt: skip


def place(mover, ref):
    return np.array(mover.places()[ref])


def gap(mover):
    return mover.system.gap(mover.system.constraints(mover.loops.signals, 0.0, mover.q)[0])


def sines(mover):
    """Return the sines of the elbows of the mechanism, computed from its angles."""
    return np.array([math.sin(mover.q[one.b] - mover.q[one.a] + one.offset) for one in mover._branches.elbows])


def turned(a, b, system):
    """Return the distance of two poses, whole turns apart or not."""
    off = (a - b) / system.units
    angles = [body.angle for body in system.bodies]
    off[angles] = (off[angles] + np.pi) % (2.0 * np.pi) - np.pi
    return np.max(np.abs(off))


@pytest.mark.parametrize("bend", [0.8, -0.8])
def test_two_links_follow_to_their_limits_and_keep_their_elbow(bend):
    mover = Mover(chain(1.0, 0.4, angles=(0.3, 0.3 + bend)))
    for r, angle in [(1.0, 1.0), (0.7, -2.0), (1.39, 3.0), (0.61, 0.0)]:
        target = r * np.array([math.cos(angle), math.sin(angle)])
        moved = mover.drag("l1", "b", target)
        assert moved.reached
        assert moved.stop == ""
        assert np.hypot(*(place(mover, "l1.b") - target)) < 1e-8
        assert math.sin(mover.angles()["l1"] - mover.angles()["l0"]) * bend > 0.0
    for far, limit in [(3.0, 1.4), (0.1, 0.6), (50.0, 1.4)]:
        for angle in np.linspace(0.0, 2.0 * np.pi, 9):
            moved = mover.drag("l1", (0.4, 0.0), (far * math.cos(angle), far * math.sin(angle)))
            assert (moved.reached, moved.stop) == (False, "reach")
            assert "l0 and l1 in line" in moved.problem
            assert math.isclose(np.hypot(*place(mover, "l1.b")), limit, rel_tol=1e-6)
            assert math.sin(mover.angles()["l1"] - mover.angles()["l0"]) * bend > 0.0


def test_a_straight_chain_bends():
    mover = Mover(chain(1.0, 1.0, angles=(0.0, 0.0)))
    assert mover.drag("l1", "b", (1.5, 0.0)).reached
    assert np.allclose(place(mover, "l1.b"), [1.5, 0.0], atol=1e-8)


def test_a_chain_with_more_freedoms_moves_least():
    mover = Mover(chain(1.0, 1.0, 1.0, angles=(0.2, 0.9, 1.4)))
    start = mover.q.copy()
    target = place(mover, "l2.b") + [0.01, -0.02]
    assert mover.drag("l2", "b", target).reached
    assert turned(mover.q, start, mover.system) < 0.1
    moved = mover.drag("l2", "b", (9.0, 0.0))
    assert moved.stop == "reach"
    assert math.isclose(np.hypot(*place(mover, "l2.b")), 3.0, rel_tol=1e-6)


def test_a_five_bar_stops_at_its_boundary():
    mover = mover_of("five_bar")
    # Both legs of 0.25 + 0.25 m are stretched above the middle, one of them at the side.
    for target, expected in [((0.0, 2.0), (0.0, math.sqrt(0.24))), ((2.0, 0.0), (0.4, 0.0))]:
        moved = mover.drag("distal1", "C", target)
        assert (moved.reached, moved.stop) == (False, "reach")
        assert np.allclose(place(mover, "distal1.C"), expected, atol=1e-6)


def test_a_five_bar_stays_in_its_assembly_by_any_body():
    mover = mover_of("five_bar")
    for pose in assemblies(without_motors(mover)):
        mover.at(pose)
        start, signs, random = mover.q.copy(), np.sign(sines(mover)), np.random.default_rng(5)
        home = place(mover, "distal1.C")
        for body in ("distal1", "proximal1", "distal2", "proximal2"):
            for _ in range(2):
                mover.drag(body, (0.25, 0.0), random.normal(scale=0.5, size=2))
                assert np.array_equal(np.sign(sines(mover)), signs)
                assert gap(mover) < 1e-9
        mover.at(start)
        mover.drag("distal1", "C", home)
        for _ in range(4):
            mover.drag("distal1", "C", random.normal(scale=0.5, size=2))
        assert mover.drag("distal1", "C", home).reached
        assert turned(mover.q, start, mover.system) < 1e-6


def test_a_five_bar_stops_at_parallel_singular_positions():
    mover = mover_of("five_bar")
    moved = mover.drag("distal1", "C", (0.0, 0.0))
    assert (moved.reached, moved.stop) == (False, "singular")
    assert "distal1 and distal2 in line" in moved.problem


def test_a_crank_turns_through_the_dead_points_of_its_rocker():
    mover = Mover(four_bar(1.0, 3.0, 2.5, 3.5, (1.0, 0.5, 1.8)))
    for angle in np.linspace(1.0, 1.0 + 4.0 * np.pi, 81):
        moved = mover.drag("crank", "b", (math.cos(angle), math.sin(angle)))
        assert moved.reached
        assert moved.stop == ""
        assert gap(mover) < 1e-9
    assert math.isclose(mover.angles()["crank"], 1.0 + 4.0 * np.pi, abs_tol=1e-7)


def test_a_rocker_stops_where_crank_and_coupler_are_in_line():
    mover = Mover(four_bar(1.0, 3.0, 2.5, 3.5, (1.0, 0.5, 1.8)))
    side = math.copysign(1.0, math.sin(mover.angles()["coupler"] - mover.angles()["crank"]))
    for reach, beyond in [(4.0, 0.3), (2.0, 2.9), (4.0, 0.3)]:
        target = np.array([3.5, 0.0]) + 2.5 * np.array([math.cos(beyond), math.sin(beyond)])
        moved = mover.drag("rocker", "b", target)
        assert (moved.reached, moved.stop) == (False, "reach")
        assert "crank and coupler in line" in moved.problem
        # Distance of the pins of crank and rocker, from the ground pivot of the crank.
        assert math.isclose(np.hypot(*place(mover, "rocker.b")), reach, rel_tol=1e-6)
        assert side * math.sin(mover.angles()["coupler"] - mover.angles()["crank"]) > 0.0


def test_another_side_is_reached_by_the_crank_and_kept_by_the_rocker():
    mover = Mover(four_bar(1.0, 3.0, 2.5, 3.5, (1.0, 0.5, 1.8)))
    mover.drag("rocker", "b", (9.0, 1.0))
    mover.release()
    for angle in np.linspace(mover.angles()["crank"], mover.angles()["crank"] - 2.0, 9):
        mover.drag("crank", "b", (math.cos(angle), math.sin(angle)))
    side = math.copysign(1.0, math.sin(mover.angles()["coupler"] - mover.angles()["crank"]))
    place_before = place(mover, "rocker.b")
    mover.drag("rocker", "b", (9.0, 1.0))
    assert side * math.sin(mover.angles()["coupler"] - mover.angles()["crank"]) > 0.0
    assert mover.drag("rocker", "b", place_before).reached


def test_a_slider_stops_at_its_dead_centres():
    mover = mover_of("slider_crank")
    crank, rod = (mover.mechanism.body(name) for name in ("crank", "rod"))
    r, l = (max(x for x, _ in body.points.values()) for body in (crank, rod))
    slider = next(body.name for body in mover.mechanism.bodies if body.name not in ("crank", "rod"))
    moved = mover.drag(slider, (0.0, 0.0), (9.0, 0.0))
    assert moved.stop == "reach"
    at = mover.q[mover.system.body(slider).position]
    assert math.isclose(at[0], r + l, rel_tol=1e-6)


def test_prescribed_motions_are_released():
    mover = mover_of("four_bar")
    assert mover.mechanism.prescribed
    before = mover.angles()["crank"]
    r = np.hypot(*(place(mover, "crank.A") - place(mover, "crank.O")))
    target = place(mover, "crank.O") + r * np.array([math.cos(before + 2.0), math.sin(before + 2.0)])
    assert mover.drag("crank", "A", target).reached
    assert math.isclose(mover.angles()["crank"], before + 2.0, abs_tol=1e-7)


@pytest.mark.parametrize("name", [name for name in pf.library.names() if name != "raparm_ii"])
def test_loops_stay_closed_and_branches_are_kept_along_random_paths(name):
    mover, random = mover_of(name), np.random.default_rng(3)
    start, size = mover.q.copy(), mover.system.size
    refs = [(body.name, point) for body in mover.mechanism.bodies for point in body.points]
    for k in random.permutation(len(refs))[:2]:
        body, point = refs[k]
        mover.at(start)
        home = place(mover, f"{body}.{point}")
        mover.drag(body, point, home)
        guards = [guard for guard in mover._drag.dragging.guards if guard.sign]
        for j in range(8):
            moved = mover.drag(body, point, home + random.normal(scale=(2.0, 0.1)[j % 2] * size, size=2))
            assert gap(mover) < 1e-9
            assert moved.stop in ("", "reach", "singular")
            assert bool(moved.problem) == bool(moved.stop)
            assert all(guard.sign * guard.value(mover.q) > 0.0 for guard in guards)
        mover.drag(body, point, home)
        if mover._drag.determined:
            assert turned(mover.q, start, mover.system) < 1e-6


def test_a_changed_length_keeps_the_pose():
    mechanism = four_bar(1.0, 3.0, 2.5, 3.5, (1.0, 0.5, 1.8))
    mover = Mover(mechanism)
    mover.drag("crank", "b", (math.cos(2.5), math.sin(2.5)))
    before = mover.angles()
    assert mover.redraw(four_bar(1.0, 3.1, 2.5, 3.5, (1.0, 0.5, 1.8)))
    assert all(abs(mover.angles()[name] - angle) < 0.2 for name, angle in before.items())
    assert gap(mover) < 1e-9
    again = Mover(replace(mechanism, assemblies=(pf.Assembly("here", mover.angles()),)))
    assert again.freedoms == 1
    with pytest.raises(AssemblyError):
        mover.redraw(four_bar(1.0, 9.0, 2.5, 3.5, (1.0, 0.5, 1.8)))
    assert mover.mechanism.body("coupler").points["b"] == (3.1, 0.0)


def test_all_assemblies_of_a_five_bar():
    mover = mover_of("five_bar")
    at_point, at_drives = assemblies(without_motors(mover)), assemblies(mover)
    assert (len(at_point), len(at_drives)) == (4, 2)
    places = []
    for q in at_point:
        mover.at(q)
        places.append(place(mover, "distal1.C"))
    assert np.ptp(places, axis=0).max() < 1e-9
    # With the drives held the end-effector is mirrored at the line of the distal links' first points.
    mover.at(at_drives[0])
    first, b1, b2 = (place(mover, ref) for ref in ("distal1.C", "distal1.B1", "distal2.B2"))
    along = (b2 - b1) / np.hypot(*(b2 - b1))
    mover.at(at_drives[1])
    mirrored = b1 + 2.0 * along * (along @ (first - b1)) - (first - b1)
    assert np.allclose(place(mover, "distal1.C"), mirrored, atol=1e-9)


def test_wrong_drags_are_refused_in_one_line():
    mover = mover_of("five_bar")
    for arguments in (("nobody", "C", (0, 0)), ("distal1", "nowhere", (0, 0)), ("distal1", "C", (math.nan, 0))):
        with pytest.raises(InputError):
            mover.drag(*arguments)


QUICK_RETURN_DRIVEN = f"""{QUICK_RETURN}
[prescribed.drive]
joint = "O"
speed = 2.0
"""


@pytest.mark.parametrize(
    ("name", "drive", "arguments"),
    [
        ("four_bar", "O", {}),
        ("slider_crank", "O", {}),
        ("spin_up", None, {}),
        ("five_bar", None, {}),
        ("five_bar", "A1", {"drive": "A1"}),
        ("quick_return", "O", {}),
    ],
)
def test_a_turn_has_the_numbers_of_kinematics(name, drive, arguments):
    model = model_of(QUICK_RETURN_DRIVEN) if name == "quick_return" else pf.load(name)
    found, held = turning(model, **arguments), {}
    if name == "five_bar" and drive:
        # The other motor stays at its angle in the assembly.
        held = {"A2": Mover(model.mechanism, model.study.assembly).angles()["proximal2"]}
    if name == "spin_up":
        drive = model.mechanism.prescribed[0].joint
    data = motion_dataset(pf.kinematics(model, drive, **({"held": held} if held else {})))
    expected = kinematics_of(data)
    json.dumps(found, allow_nan=False)
    assert found["over"]["joint"] == (drive or "")
    if drive:
        turned = data["joint_coordinate"].sel(joint=drive).values
        assert found["over"]["values"] == pytest.approx(turned, abs=1e-9)
        assert not expected["drive"]["full_turn"] or abs(turned[-1] - turned[0]) == pytest.approx(2.0 * np.pi)
    assert found["time"] == pytest.approx(data["time"].values, abs=1e-9)
    assert [one["of"] for one in found["trails"]]
    curve = {(one["of"], one["quantity"], one["part"]): one["values"] for one in found["curves"]}
    for one in found["trails"]:
        place = data["point_position"].sel(point=one["of"]).transpose("time", "axis").values
        assert np.array(one["path"]) == pytest.approx(place, abs=1e-9)
        assert curve[one["of"], "position", "y"] == [y for _, y in one["path"]]
    for one in expected["transmission_angles"]:
        values = curve[one["joint"], "transmission angle", one["coupler"]]
        assert math.isclose(min(values), one["smallest"]["value"], abs_tol=1e-3)
        assert min(values) >= one["smallest"]["value"] - 1e-9
    assert found["tiles"] == [list(tile) for tile in kinematics_tiles(data)]
    assert found["film"] is not None
    # At constant speed without weight a balanced rotor needs no torque.
    efforts = any(one["quantity"] in ("torque", "force") for one in found["curves"])
    assert efforts == (not found["loads_problem"]) or name == "spin_up"


def test_a_turn_without_masses_has_no_torques():
    sketch = replace(pf.load("four_bar"), mechanism=four_bar(1.0, 3.0, 2.5, 3.5, (1.0, 0.5, 1.8)))
    with pytest.raises(InputError, match="drive: is missing"):
        turning(sketch)
    found = turning(sketch, drive="O")
    assert abs(found["over"]["values"][-1] - found["over"]["values"][0]) == pytest.approx(2.0 * np.pi)
    assert "mass" in found["loads_problem"]
    assert not any(one["quantity"] == "torque" for one in found["curves"])
    # Transmission angle by the law of cosines, of the distances between the pins of crank and rocker.
    (values,) = [one["values"] for one in found["curves"] if one["quantity"] == "transmission angle"]
    angles = [math.acos((9.0 + 6.25 - d * d) / 15.0) for d in (2.5, 4.5)]
    least = min(min(angle, np.pi - angle) for angle in angles)
    assert min(values) == pytest.approx(least, abs=1e-3)
    assert min(values) >= least - 1e-9


@pytest.mark.parametrize("name", ["four_bar", "slider_crank_flexible", "spin_up", "five_bar"])
def test_the_pose_is_that_in_which_a_run_begins(name):
    model = load(name)
    begun = posed(model.mechanism, model.study.assembly)
    assert Mover(model.mechanism, model.study.assembly).angles() == pytest.approx(begun.angles, abs=1e-9)


SLIDER_DRIVEN = """
name = "slider driven"
[ground]
O = [0, 0]
R = ["-100 mm", 0]
[body.crank]
points = { O = [0, 0], A = ["100 mm", 0] }
[body.rod]
points = { A = [0, 0], B = ["300 mm", 0] }
[body.block]
points = { B = [0, 0] }
[joint]
O = ["ground.O", "crank.O"]
A = ["crank.A", "rod.A"]
B = ["rod.B", "block.B"]
S = { type = "prismatic", points = ["ground.R", "block.B"] }
[prescribed.push]
joint = "S"
displacement = "450 mm"
speed = -0.1
[assembly.drawn]
crank = 0.8
rod = -0.3
block = 0
"""


def test_a_slider_that_drives_begins_where_the_pose_is_kept(tmp_path):
    session = EditSession(Document(text=SLIDER_DRIVEN, drafts=tmp_path), lambda _: None)
    mover = session.bench.mover
    assert mover.places()["block.B"] == pytest.approx([0.35, 0.0], abs=1e-9)
    session.bench.drag("crank", "A", [0.0, 0.1])
    kept = mover.places()
    assert "ok" in session.answer({"id": 1, "do": "pose"})
    assert 'displacement = "' in session.document.text
    again = EditSession(Document(text=session.document.text, drafts=tmp_path), lambda _: None).bench.mover
    for name, place in again.places().items():
        assert place == pytest.approx(kept[name], abs=1e-6)
    assert kept["block.B"][0] == pytest.approx(math.sqrt(0.3**2 - 0.1**2), abs=1e-6)
    assert "ok" in session.answer({"id": 2, "do": "undo"})
    assert session.document.text == SLIDER_DRIVEN
