"""What `paraflex info` rests on: loops, starts, degrees of freedom, redundancy, what motors reach."""

import json
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

import twins
from conftest import make_five_bar
from paraflex.checks import check
from paraflex.cli.commands.models import InfoRequest
from paraflex.cli.inspect import describe, library
from paraflex.dynamics import (
    build_system,
    closure_of,
    consistent_state,
    driven_freedoms,
    mobility,
    natural_frequencies,
    undeformed,
)
from paraflex.dynamics.signals import moment_signals
from paraflex.errors import InputError
from paraflex.files import library_file, library_names, load
from paraflex.files.model import StudyDefaults
from paraflex.findings import Level
from paraflex.mechanism import (
    ActuationMode,
    Assembly,
    Mechanism,
    Motor,
    PrescribedAngle,
    RigidBody,
    SampledAngle,
    loops,
)
from shell import paraflex
from test_consistency import joint, many, parallelogram


def bar(name: str, length: float) -> RigidBody:
    return RigidBody(name, 1.0, 0.1, (length / 2, 0.0), {"A": (0.0, 0.0), "B": (length, 0.0)})


def stretched(lengths=(0.4, 0.6)) -> Mechanism:
    """Two bars between two pins a metre apart: with a metre of bars they lie in line and cannot leave it."""
    return Mechanism(
        name="stretched",
        ground={"O": (0.0, 0.0), "Q": (1.0, 0.0)},
        bodies=(bar("a", lengths[0]), bar("b", lengths[1])),
        joints=(joint("O", "ground.O", "a.A"), joint("P", "a.B", "b.A"), joint("Q", "b.B", "ground.Q")),
        assemblies=(Assembly("line", {"a": 0.0, "b": 0.0}),),
    )


def seen(mechanism):
    system = build_system(mechanism)
    start = closure_of(system, mechanism.assembly())
    return system, start, None if start.state is None else mobility(system, start.state)


# --- Loops ---------------------------------------------------------------------------------------------------------


def test_loops_of_raparm_are_its_two_branches_and_the_way_across(raparm):
    found = loops(raparm)
    assert [set(loop) for loop in found] == [
        {"A1", "B1", "F1", "E1", "D1"},
        {"A2", "B2", "F2", "E2", "D2"},
        {"A1", "B1", "C", "B2", "A2"},
    ]


@pytest.mark.parametrize("name", library_names())
def test_loops_lead_back_to_where_they_begin_and_are_independent(name):
    mechanism = load(name).mechanism
    found = loops(mechanism)
    assert len(found) == len(mechanism.joints) - len(mechanism.bodies)
    used = np.zeros((len(found), len(mechanism.joints)), dtype=int)
    for k, loop in enumerate(found):
        sides = [{mechanism.joint(name).a.body, mechanism.joint(name).b.body} for name in loop]
        # Neighbouring joints share a body, the last with the first as well.
        assert all(one & other for one, other in zip(sides, sides[1:] + sides[:1], strict=True))
        counts = {body: sum(body in side for side in sides) for side in sides for body in side}
        assert set(counts.values()) == {2}
        used[k, [[j.name for j in mechanism.joints].index(name) for name in loop]] = 1
    assert len(found) == 0 or np.linalg.matrix_rank(used) == len(found)


def test_a_pin_twice_is_a_loop_of_two():
    chain = stretched()
    twice = replace(chain, joints=(*chain.joints[:2], joint("again", "ground.O", "a.A")))
    assert [set(loop) for loop in loops(twice)] == [{"O", "again"}]


# --- Starts --------------------------------------------------------------------------------------------------------


def test_a_start_tells_the_gap_before_and_what_is_left_after(raparm):
    _, start, _ = seen(raparm.rigid())
    assert start.closes
    # Angles are given to three digits, links are a quarter of a metre.
    assert 1e-4 < start.gap_before < 1e-2
    assert start.position < 1e-12
    assert start.velocity < 1e-12


@pytest.mark.parametrize(("lengths", "gap"), [((0.4, 0.3), 0.3), ((1.7, 0.2), 0.5)])
def test_a_link_too_short_or_too_long_is_told_by_the_gap_that_remains(lengths, gap):
    _, start, free = seen(stretched(lengths))
    assert not start.closes
    assert free is None
    assert start.gap == pytest.approx(gap, rel=1e-6)
    assert start.where == ("Q",)
    assert "a gap of" in start.problem


def test_flexible_links_are_not_stretched_to_fit():
    mechanism = load("five_bar").mechanism
    apart = replace(mechanism, ground={"A1": (-0.6, 0.0), "A2": (0.6, 0.0)})
    _, start, _ = seen(apart.rigid())
    assert start.gap == pytest.approx(0.2, rel=1e-6)


# --- Degrees of freedom --------------------------------------------------------------------------------------------


def test_a_third_parallel_rod_is_redundant_everywhere():
    _, _, free = seen(parallelogram(3))
    assert (free.count, free.freedoms, free.nearby_freedoms) == (0, 1, 1)
    assert not free.special
    assert len(free.redundant) == 1
    assert set(free.redundant[0].among) == {"G0", "G1", "G2", "P0", "P1", "P2"}
    assert free.redundant[0].joint in free.redundant[0].among


def test_a_flat_parallelogram_has_a_freedom_of_that_instant():
    for rods, redundant in ((2, 0), (3, 1)):
        _, _, free = seen(parallelogram(rods, angle=0.0))
        assert (free.freedoms, free.nearby_freedoms) == (2, 1)
        assert free.special
        assert len(free.redundant) == redundant + 1


def test_bars_in_line_between_pins_have_a_freedom_they_cannot_follow():
    _, start, free = seen(stretched())
    assert start.closes
    assert (free.count, free.freedoms, free.nearby_freedoms) == (0, 1, 0)
    assert free.special


def test_a_triangle_is_a_structure():
    mechanism = replace(stretched((0.8, 0.6)), assemblies=(Assembly("up", {"a": 0.6, "b": -0.9}),))
    _, _, free = seen(mechanism)
    assert (free.count, free.freedoms, free.nearby_freedoms, free.redundant) == (0, 0, 0, ())


def test_many_bodies_give_the_same_by_sparse_matrices(monkeypatch):
    doubled = many(30)
    doubled = replace(doubled, joints=(*doubled.joints, joint("again", "crank3.P", "coupler3.A")))
    dense = seen(doubled)[2]
    monkeypatch.setattr("paraflex.dynamics.rank.DENSE_ROWS", 10)
    monkeypatch.setattr("paraflex.dynamics.projection.DENSE_ROWS", 10)
    sparse = seen(doubled)[2]
    assert (
        (sparse.count, sparse.freedoms, sparse.nearby_freedoms)
        == (dense.count, dense.freedoms, dense.nearby_freedoms)
        == (-1, 1, 1)
    )
    for free in (dense, sparse):
        assert len(free.redundant) == 2
        assert all(set(one.among) == {"A3", "again"} for one in free.redundant)


# --- Motors --------------------------------------------------------------------------------------------------------


def test_sets_of_motors_are_those_whose_matrix_has_full_rank(raparm):
    """Against B = Z^T S by a null space, motor set by motor set."""
    mechanism = replace(raparm.rigid(), modes=(*raparm.modes, ActuationMode("one", ("tau1",))))
    system, start, free = seen(mechanism)
    found = driven_freedoms(system, start.state, free.freedoms)
    basis = np.linalg.svd(system.jacobian(start.state.q))[2][-2:].T
    S = np.array([twins.joint_angle_row(system, motor.joint) for motor in mechanism.motors]).T
    names = [motor.name for motor in mechanism.motors]
    expected = tuple(
        tuple(names[k] for k in pair) for pair in combinations(range(4), 2)
        if np.linalg.matrix_rank(basis.T @ S[:, pair]) == 2
    )  # fmt: skip
    assert found.sets == expected
    assert found.all_motors == 2
    assert found.modes["one"] == 1
    assert found.modes["++++"] == 2
    assert not found.more


def test_motors_on_one_joint_reach_no_more_than_one():
    five_bar = make_five_bar()
    mechanism = replace(five_bar, motors=(Motor("a", "A1"), Motor("b", "A1"), Motor("c", "A2")))
    system, start, free = seen(mechanism)
    assert driven_freedoms(system, start.state, free.freedoms).sets == (("a", "c"), ("b", "c"))
    stuck = replace(mechanism, motors=mechanism.motors[:2])
    system, start, free = seen(stuck)
    found = driven_freedoms(system, start.state, free.freedoms)
    assert (found.all_motors, found.sets) == (1, ())


# --- The command ---------------------------------------------------------------------------------------------------


def test_info_without_a_name_lists_the_library():
    facts = library()
    assert [one["name"] for one in facts] == library_names()
    raparm = next(one for one in facts if one["name"] == "raparm_i")
    assert (raparm["degrees_of_freedom"], raparm["bodies"], len(raparm["motors"])) == (2, 8, 4)
    assert raparm["paths"] == ["square", "line", "circle"]
    done = paraflex("info")
    assert done.returncode == 0
    for name in library_names():
        assert name in done.stdout


def test_info_says_what_is_sound_and_what_is_not(tmp_path):
    sound = paraflex("info", "raparm_i")
    assert "sound: every assembly closes" in sound.stdout
    assert "loop 3: A1, B1, C, B2, A2" in sound.stdout
    source = library_file("five_bar").read_text(encoding="utf-8")
    broken = tmp_path / "short.toml"
    broken.write_text(source.replace("base = 0.100", "base = 0.600"))
    done = paraflex("info", str(broken), "--json")
    facts = json.loads(done.stdout)
    assert facts["assembly_closes"] is not True
    assert facts["starts"][0]["gap"] == pytest.approx(0.2, rel=1e-3)
    assert facts["starts"][0]["where"] == ["C"]
    assert done.returncode == 1
    assert facts["verdict"]["level"] == "wrong"
    finding = facts["verdict"]["findings"][0]
    assert (finding["code"], finding["place"]) == ("assembly-open", "assembly.outward")
    assert finding["text"].startswith("the loops do not close: a gap of 0.2 m remains in C")
    assert "wrong: assembly.outward: the loops do not close" in paraflex("info", str(broken)).stdout


def test_info_of_an_unknown_assembly_is_refused():
    done = paraflex("info", "raparm_i", "--assembly", "upward")
    assert done.returncode == 2
    assert "assembly: unknown assembly (got 'upward'); this mechanism has: outward" in done.stderr
    assert json.loads(paraflex("info", "raparm_i", "--assembly", "inward", "--json").stdout)["assembly"] == "inward"


def test_frequencies_of_info_are_those_of_the_pose_asked_for(raparm):
    model = load("raparm_i")
    at_rest = describe(model)["frequencies"]
    system, rigid = build_system(raparm), build_system(raparm.rigid())
    state = undeformed(system, rigid, consistent_state(rigid, raparm.assembly()))
    joints = [motor.joint for motor in raparm.motors]
    expected = natural_frequencies(system, state, joints).frequencies[:10] / (2 * np.pi)
    np.testing.assert_allclose(at_rest["motors_held_hz"], expected, rtol=1e-9)
    assert at_rest["motors_free_hz"][:2] == [0.0, 0.0]
    assert at_rest["is_equilibrium"]
    later = describe(model, InfoRequest(at=0.1))["frequencies"]
    assert later["time"] == 0.1
    assert abs(later["motors_held_hz"][0] - at_rest["motors_held_hz"][0]) > 1e-3
    # The first corner of the square, then once around it: the same pose.
    first, last = (describe(model, InfoRequest(at=t))["frequencies"]["motors_held_hz"] for t in (0.0, 0.6))
    np.testing.assert_allclose(first, last, rtol=1e-6)


def test_a_time_leads_along_prescribed_angles_or_nowhere():
    four_bar = load("four_bar")
    speed = four_bar.mechanism.prescribed[0].profile.evaluate(np.zeros(1))[1].item()
    here, round_, half = (
        describe(four_bar, InfoRequest(at=t))["frequencies"]["motors_free_hz"]
        for t in (0.0, 2 * np.pi / speed, np.pi / speed)
    )
    np.testing.assert_allclose(round_, here, rtol=1e-6)
    # Coupler and rocker between a held crank and the ground are a triangle: their bending hardly feels the pose.
    assert 1e-6 < abs(half[0] / here[0] - 1.0) < 1e-4
    with pytest.raises(InputError, match="its prescribed angles do not give its pose at later times"):
        describe(load("pendulum"), InfoRequest(at=0.5))
    with pytest.raises(InputError, match="not a time of the motion"):
        describe(four_bar, InfoRequest(at=-1.0))


def test_a_pose_that_is_no_equilibrium_is_said_to_be_none():
    level = describe(load("pendulum"))["frequencies"]
    assert not level["is_equilibrium"]
    assert level["acceleration"] > 5.0
    balanced = describe(load("pendulum"), InfoRequest(balanced=True))["frequencies"]
    assert balanced["is_equilibrium"]
    assert "not an equilibrium: when released" in paraflex("info", "pendulum").stdout


def test_special_poses_and_modes_that_do_not_reach_are_found():
    model = load("five_bar")
    flat = parallelogram(2, angle=0.0)
    flat_model = replace(model, mechanism=flat, paths={}, study=StudyDefaults())
    flat_one = next(one for one in check(flat_model) if one.code == "special-pose")
    assert "a special pose: 2 degrees of freedom at this instant, 1 a little" in flat_one.text
    one = replace(model.mechanism, modes=(ActuationMode("left only", ("left",)),))
    (short,) = check(replace(model, mechanism=one), modes=["++"])
    assert (short.code, short.place, short.level) == ("mode-short", "mode.left only", Level.WRONG)
    assert short.text == "it reaches 1 of 2 degrees of freedom"


def test_a_law_that_a_mechanism_cannot_follow_is_told_as_its_start():
    law = SampledAngle(lambda t: 1.0 + t, lambda t: 1.0 + 0 * t, lambda t: 0 * t)
    other = SampledAngle(lambda t: 1.0 - t, lambda t: -1.0 + 0 * t, lambda t: 0 * t)
    linkage = parallelogram(2)
    mechanism = replace(
        linkage, motors=(), prescribed=(PrescribedAngle("left", "G0", law), PrescribedAngle("right", "G1", other))
    )
    system, start, _ = seen(mechanism)
    assert not start.closes
    assert "velocities" in start.problem
    assert "left" in start.problem
    assert np.isnan(start.velocity)
    assert moment_signals(mechanism, 0.0).start.size == 3
    assert system.m == 10
