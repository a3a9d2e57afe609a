"""What no joint allows or no equilibrium carries, by name and with the steps until then; mechanisms of every kind."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from flexures import EI, LENGTH, guide
from paraflex.errors import EquilibriumError, LimitPointError
from paraflex.results import load_results
from shell import paraflex


def test_travel_beyond_the_reach_of_a_crank_names_the_joint_and_keeps_the_steps():
    crank = pf.load("slider_crank")
    with pytest.raises(LimitPointError, match=r"travel of rail by 1 m\): the branch turns back there") as caught:
        pf.statics(crank, moved={"rail": 1.0}, held=[], steps=100, stiffness=["slider.B.x"])
    found = caught.value.partial
    assert found.status == "failed"
    assert "give at most 0.086" in found.message
    assert "t = " not in found.message
    # Dead centre: crank and rod in one line.
    lengths = [np.ptp(list(body.points.values()), axis=0)[0] for body in crank.mechanism.bodies[:2]]
    assert found.place("slider.B.x")[found.limit][0] == pytest.approx(sum(lengths), rel=1e-9)
    assert found.fraction.max() == pytest.approx(found.fraction[found.limit][0])
    assert np.sum(~found.limit & (found.fraction > 0.0)) >= 8


@pytest.mark.parametrize(
    ("name", "arguments", "stuck"),
    [
        ("slider_crank", {"moved": {"rail": 0.01}}, "rail"),
        ("leaf_spring_guide", {"moved": {"stage.T.x": 1e-3}, "held": ["left.A.x"]}, "stage.T.x"),
        ("leaf_spring_guide", {"moved": {"stage.A.x": 1e-3, "stage.B.x": 2e-3}}, "stage.B.x"),
    ],
)
def test_a_travel_that_follows_from_joints_and_what_is_held_is_named(name, arguments, stuck):
    with pytest.raises(EquilibriumError, match=f"the travel of {stuck} follows from the joints") as caught:
        pf.statics(pf.load(name), **arguments, steps=2)
    assert caught.value.partial.fraction.tolist() == [0.0]


def test_travels_that_follow_from_one_another_and_agree_are_no_error():
    found = pf.statics(pf.load("leaf_spring_guide"), moved={"stage.A.x": 1e-3, "stage.B.x": 1e-3}, steps=2)
    assert found.travel("stage.T.x")[-1] == pytest.approx(1e-3, rel=1e-9)
    # What both take together is what one does.
    alone = pf.statics(pf.load("leaf_spring_guide"), moved={"stage.A.x": 1e-3}, held=["stage.T.angle"], steps=2)
    both = found.effort("stage.A.x")[-1] + found.effort("stage.B.x")[-1]
    assert both == pytest.approx(alone.effort("stage.A.x")[-1], rel=1e-4)


def test_the_command_keeps_the_steps_and_says_in_a_line_why_it_ends(tmp_path):
    done = paraflex("statics", "slider_crank", "--move", "rail=200 mm", "--hold", "none", "--steps", "10", "--out", "o",
                    "--no-figures", cwd=tmp_path)  # fmt: skip
    assert done.returncode == 1
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("error: ")]
    assert "travel of rail by 0.2 m" in line
    data = load_results(tmp_path / "o" / "statics.nc")
    assert data["status"].item() == "failed"
    assert float(data["fraction"].max()) == pytest.approx(0.430, abs=1e-3)
    assert (tmp_path / "o" / "report.html").exists()


def test_nothing_free_is_called_rigid():
    told = paraflex("statics", "slider_crank", "--move", "O=0.1", "--steps", "1").stdout
    assert "rigid" not in told
    assert "free" in told
    assert "largest stress" not in told
    assert "rigid" in paraflex("statics", "slider_crank", "--load", "rail=1", "--steps", "1").stdout


# Mechanisms of every kind: a force does the work of what holds it.


def test_a_slide_and_a_crank_hold_one_another():
    crank = pf.load("slider_crank")
    held = pf.statics(crank, loads={"rail": 10.0}, steps=1)
    moved = pf.statics(crank, moved={"O": 1e-5}, stiffness=["rail"], steps=1)
    ratio = moved.travel("rail")[-1] / 1e-5
    assert held.effort("O")[-1] == pytest.approx(-10.0 * ratio, rel=1e-4)


def test_gears_carry_a_load_to_the_joint_that_is_held():
    rigid = pf.load("geared_five_bar").mechanism.rigid()
    held = pf.statics(rigid, loads={"distal1.C.y": -5.0}, held=["A1"], steps=1)
    moved = pf.statics(rigid, moved={"A1": 1e-6}, held=[], stiffness=["distal1.C.y", "A2"], steps=1)
    assert held.effort("A1")[-1] == pytest.approx(5.0 * moved.travel("distal1.C.y")[-1] / 1e-6, rel=1e-4)
    assert abs(moved.travel("A2")[-1]) == pytest.approx(1e-6, rel=1e-9)


def test_motors_without_a_torque_hold_a_weight():
    heavy = replace(pf.load("five_bar").mechanism, gravity=(0.0, -9.81))
    found = pf.statics(heavy)
    assert {one.name for one in found.coordinates} == {"A1", "A2"}
    data = pf.statics_dataset(found)
    weight = 9.81 * sum(body.integrals.m for body in found.system.bodies)
    assert data["frame_force"].values[-1] == pytest.approx([0.0, -weight], abs=1e-6 * weight)
    # It is its own mirror image but for the third digit of the angles in its file: the motors hold as much.
    assert found.effort("A1")[0] == pytest.approx(-found.effort("A2")[0], rel=0.01)
    assert found.effort("A1")[0] != pytest.approx(0.0, abs=0.1)
    assert data["torque"].values[0] == pytest.approx([found.effort("A1")[0], found.effort("A2")[0]])


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
def test_both_geometries_agree_where_little_bends(geometry):
    found = pf.statics(guide(1, elements=4).with_geometry(geometry), loads={"stage.T.x": 1e-3}, steps=1)
    assert found.stiffness("stage.T.x")[0] == pytest.approx(24.0 * EI / LENGTH**3, rel=2e-4)
    assert found.travel("stage.T.x")[-1] == pytest.approx(1e-3 / (24.0 * EI / LENGTH**3), rel=2e-4)


def test_linear_geometry_far_bent_is_doubted():
    told = paraflex("statics", "leaf_spring_guide", "--set", "geometry=linear", "--steps", "2").stdout
    assert "linear geometry does not hold" in told


def test_frames_change_little_and_angles_beyond_a_turn_count_on():
    one, four = (
        pf.statics(pf.load("leaf_spring_guide", set={"left.frames": n, "right.frames": n}), steps=1) for n in (1, 4)
    )
    assert one.effort("stage.T.x")[-1] == pytest.approx(four.effort("stage.T.x")[-1], rel=1e-3)
    turned = pf.statics(pf.load("pendulum"), moved={"pivot": 3.0 * math.pi}, held=[], steps=3, warning=False)
    assert turned.travel("pivot") == pytest.approx([0.0, math.pi, 2.0 * math.pi, 3.0 * math.pi])
