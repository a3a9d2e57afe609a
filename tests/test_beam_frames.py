"""Beams in several floating frames: the same as beams welded end to end, reported as one."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from flexures import LEAF, LENGTH, STEEL, guide, pivot
from paraflex.dynamics import build_system
from paraflex.elastodynamics import simulate_ked
from paraflex.files import ExpressionProfile
from paraflex.mechanism import BodyValues, Deflection, Start, in_frames
from paraflex.results import motion_dataset, tracking_dataset
from shell import paraflex


def framed(mechanism: pf.Mechanism, frames: int) -> pf.Mechanism:
    return mechanism.with_bodies(
        replace(body, frames=frames) for body in mechanism.bodies if isinstance(body, pf.FlexibleBeam)
    )


@pytest.mark.parametrize(("make", "loads"), [(guide, {"stage.T.x": 10.5}), (pivot, {"stage.C.angle": 0.3})])
def test_frames_are_beams_welded_end_to_end(make, loads):
    names = [*loads, *(f"{next(iter(loads)).rpartition('.')[0]}.{axis}" for axis in "xy")]
    one = pf.statics(framed(make(1), 4), loads=loads, stiffness=names, steps=2, warning=False)
    chained = pf.statics(make(4), loads=loads, stiffness=names, steps=2, warning=False)
    for name in names:
        assert one.travel(name) == pytest.approx(chained.travel(name), abs=1e-12)
        assert one.stiffness(name) == pytest.approx(chained.stiffness(name), rel=1e-9)
    assert one.frequencies[:, :6] == pytest.approx(chained.frequencies[:, :6], rel=1e-7)


def test_a_guide_in_four_frames_is_exact_to_a_ten_thousandth():
    found = pf.statics(framed(guide(1), 4), loads={"stage.T.x": 1.05, "stage.T.y": -80.0}, steps=1, warning=False)
    assert found.travel("stage.T.x")[-1] == pytest.approx(12.751017e-3, rel=1e-4)
    assert found.travel("stage.T.y")[-1] == pytest.approx(-1.008472e-3, rel=1e-4)


def test_results_see_one_beam():
    loads = {"stage.T.x": 10.5}
    one, finer = (
        pf.statics_dataset(pf.statics(each, loads=loads, steps=1, warning=False))
        for each in (framed(guide(1), 2), guide(1, elements=2))
    )
    for name in ("body", "joint", "row", "point", "station_body"):
        assert one[name].values.tolist() == finer[name].values.tolist()
    assert list(dict.fromkeys(one["section_body"].values)) == ["left1", "right1"]
    left = one["section_place"].values[one["section_body"].values == "left1"]
    assert (np.diff(left) >= 0.0).all()
    assert (left[0], left[-1]) == pytest.approx((0.0, LENGTH))
    for name, tolerance in (
        ("shape", 1e-6), ("tip_transverse", 1e-6), ("tip_slope", 1e-5), ("deflection", 1e-6), ("chord_angle", 1e-5),
        ("joint_force", 0.03), ("joint_moment", 1e-4), ("strain_energy", 1e-5),
    ):  # fmt: skip
        np.testing.assert_allclose(one[name].values, finer[name].values, atol=tolerance, err_msg=name)
    assert abs(one["tip_transverse"].values[-1, 0]) > 9e-3


def test_runs_sensors_and_stresses_are_those_of_the_whole_beam():
    def pushed(elements: int) -> pf.Mechanism:
        sensors = (
            pf.StrainGauge("root", "left1", 0.02),
            pf.StrainGauge("middle", "left1", 0.5 * LENGTH),
            pf.JointForceSensor("moment", "root_left", "moment"),
            pf.PositionSensor("x", pf.PointRef("stage", "T"), "x"),
        )
        push = pf.PointForce("push", pf.PointRef("stage", "T"), (5.0, 0.0))
        return replace(guide(1, elements=elements), loads=(push,), sensors=sensors)

    options = pf.IntegrationOptions(tolerance=1e-8)
    whole, cut = (
        motion_dataset(pf.simulate_motion(each, 0.05, samples=51, warning=False, options=options))
        for each in (pushed(6), framed(pushed(3), 2))
    )
    assert abs(whole["point_position"] - cut["point_position"]).max() < 1e-8
    assert abs(whole["sensor_reading"] - cut["sensor_reading"]).max() < 5e-4 * float(abs(whole["sensor_reading"]).max())
    assert cut["stress_max"].values[:2] == pytest.approx(whole["stress_max"].values[:2], rel=1e-3)
    assert cut["stress_place"].values[:2] == pytest.approx(whole["stress_place"].values[:2], abs=1e-12)


def test_a_run_whose_energy_does_not_balance_says_so():
    model = pf.load("leaf_spring_guide")
    with pytest.warns(pf.ResultWarning, match="energy and work do not balance"):
        run = pf.simulate_motion(model, 0.1, samples=51, options=pf.IntegrationOptions(method="tr-bdf2", step=1e-2))
    assert any(one.code == "energy-unbalanced" for one in run.findings)
    other = pf.simulate_motion(model, 0.1, samples=51)
    assert not any(one.code == "energy-unbalanced" for one in other.findings)


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
@pytest.mark.parametrize(
    ("method", "frames", "elements", "duration"),
    [
        ("esdirk5", 6, 1, 0.1), ("esdirk5", 2, 4, 0.1), ("esdirk5", 4, 2, 0.3), ("esdirk4", 2, 2, 0.3),
        ("tr-bdf2", 5, 2, 0.1),
    ],
)  # fmt: skip
def test_frames_welded_into_loops_are_no_singular_position(method, frames, elements, duration, geometry):
    """Welds of a guide are redundant but for elasticity; steps as long as of whole beams, without damping."""
    guide = pf.load("leaf_spring_guide").mechanism.with_geometry(geometry)
    runs = [
        pf.simulate_motion(each, duration, samples=201, method=method, warning=False)
        for each in (guide.with_beams(elements=frames * elements), framed(guide.with_beams(elements=elements), frames))
    ]
    whole, cut = (run.solution for run in runs)
    # At a singular position steps would be shorter by orders of magnitude.
    assert cut.steps < 2.5 * whole.steps
    energy = np.max(cut.kinetic_energy + cut.strain_energy)
    assert cut.energy_balance_max < (2e-3 if method == "tr-bdf2" else 1e-3) * energy
    one, other = (float(motion_dataset(run)["stress_max"].max()) for run in runs)
    assert other == pytest.approx(one, rel=1e-2)


def test_stabilised_index_2_takes_frames_welded_into_loops():
    guide = framed(pf.load("leaf_spring_guide").mechanism, 6)
    run = pf.simulate_motion(guide, 0.1, samples=51, options=pf.IntegrationOptions(constraints="ggl"), warning=False)
    assert run.solution.status == "complete"
    assert run.solution.steps < 60
    # Newton's iteration leaves a thousandth of the tolerance.
    assert run.solution.constraint_position_max < 1e-8


@pytest.mark.parametrize(("duration", "frames", "steps"), [(10.0, 2, 60), (1e4, 5, 620)])
def test_stiff_frames_follow_a_slow_load_as_in_statics(duration, frames, steps):
    """However little is left of redundant rows in steps thousands of periods long."""
    thick = pf.load("leaf_spring_guide", set={"section.leaf.thickness": 0.01}).mechanism
    peak, push = 16000.0, thick.loads[0]
    slow = replace(push, force=(ExpressionProfile(f"{peak} * sin(pi * t / {duration})**2"), 0.0))
    guide = framed(replace(thick, loads=(slow,)), frames)
    # How far constraints are violated depends on rounding, in proportion to the tolerance.
    options = pf.IntegrationOptions(tolerance=3e-7, tolerance_per="cycle")
    run = pf.simulate_motion(guide, duration, samples=3, options=options, warning=False)
    at_peak = motion_dataset(run)["point_position"].sel(point="stage.T").isel(time=1)
    still = pf.statics(replace(guide, loads=()), loads={"stage.T.x": peak}, steps=2, warning=False)
    assert float(at_peak[0]) - 0.025 == pytest.approx(still.travel("stage.T.x")[-1], abs=1e-5)
    assert still.travel("stage.T.x")[-1] > 1e-3
    assert run.solution.steps < steps
    assert run.solution.constraint_position_max < 1e-6


def test_tracking_linear_models_and_segments_take_them():
    robot = pf.load("five_bar")
    path = next(iter(robot.paths.values()))
    runs = [
        pf.plan(mechanism, path, samples=51).simulate("++", warning=False)
        for mechanism in (framed(robot.mechanism, 2), robot.mechanism.with_beams(elements=4))
    ]
    cut, fine = (tracking_dataset([run]) for run in runs)
    assert cut["body"].values.tolist() == fine["body"].values.tolist()
    assert float(cut["tracking_rms"][0]) == pytest.approx(float(fine["tracking_rms"][0]), rel=1e-3)
    assert abs(cut["end_effector"] - fine["end_effector"]).max() < 2e-6
    model = pf.linearise(framed(robot.mechanism, 2), balanced=True)
    exact = pf.linearise(robot.mechanism.with_beams(elements=4), balanced=True)
    assert model.held_frequencies()[:4] == pytest.approx(exact.held_frequencies()[:4], rel=1e-4)
    assert runs[0].task.in_segments(4).simulate("++", warning=False).solution.status == "complete"


def test_parts_take_the_spans_lumps_and_points_of_their_beam():
    thick = pf.Section.rectangle(0.02, 0.002)
    beam = pf.FlexibleBeam(
        "rod", 0.3, (LEAF, thick, LEAF), STEEL, {"A": 0.0, "B": 0.1, "C": 0.2, "D": 0.3}, (1, 2, 3),
        lumps=(pf.LumpedMass("B", 0.1), pf.LumpedMass("D", 0.2)), frames=2,
    )  # fmt: skip
    mechanism = pf.Mechanism(
        name="rod", ground={"O": (0.0, 0.0)}, bodies=(beam,),
        joints=(pf.RevoluteJoint("O", pf.PointRef("ground", "O"), pf.PointRef("rod", "A")),),
        assemblies=(pf.Assembly("flat", {"rod": 0.0}),),
    )  # fmt: skip
    first, second = in_frames(mechanism).bodies
    assert (first.section, second.section) == ((LEAF, thick), (thick, LEAF))
    assert (first.elements, second.elements) == ((1, 2), (2, 3))
    assert ([lump.point for lump in first.lumps], [lump.point for lump in second.lumps]) == (["B"], ["D"])
    assert second.points["C"] == pytest.approx(0.05)
    whole, cut = build_system(mechanism.rigid()), build_system(mechanism)
    assert cut.total_mass == pytest.approx(whole.total_mass, rel=1e-12)
    assert in_frames(mechanism.rigid()) == mechanism.rigid()


def test_files_have_them(tmp_path):
    model = pf.load("leaf_spring_guide", set={"left.frames": 3})
    model.mechanism.save(tmp_path / "guide.toml")
    again = pf.load(tmp_path / "guide.toml").mechanism
    assert again == model.mechanism
    assert [body.frames for body in again.bodies if isinstance(body, pf.FlexibleBeam)] == [3, 1]


def test_info_describes_the_whole_beam():
    done = paraflex("info", "leaf_spring_guide", "--set", "left.frames=2", "--json")
    left, right, _ = json.loads(done.stdout)["links"]
    assert (left["name"], left["frames"], left["elements"]) == ("left", 2, 2 * right["elements"])
    assert left["mass"] == pytest.approx(right["mass"], rel=1e-12)


def test_a_warning_names_more_frames_as_the_remedy():
    found = pf.statics(framed(guide(1), 2), loads={"stage.T.x": 100.0}, steps=1, warning=False)
    assert "give left1 more frames (frames = 4)" in found.validity.verdict or "right1 more frames (frames = 4)" in (
        found.validity.verdict
    )


def slot(frames: int) -> pf.Mechanism:
    rail = pf.FlexibleBeam("rail", 0.5, LEAF, STEEL, {"A": 0.0, "B": 0.5}, 4, frames=frames)
    block = pf.RigidBody("block", 0.1, 1e-4, (0.0, 0.0), {"P": (0.0, 0.0)})
    return pf.Mechanism(
        name="slot", ground={"O": (0.0, 0.0)}, bodies=(rail, block),
        joints=(
            pf.WeldJoint("O", pf.PointRef("ground", "O"), pf.PointRef("rail", "A")),
            pf.SlidingJoint("slide", pf.PointRef("rail", "A"), pf.PointRef("block", "P")),
        ),
        assemblies=(pf.Assembly("there", {"rail": 0.0, "block": 0.0}, {"block.P": (0.2, 0.0)}),),
    )  # fmt: skip


def test_what_they_cannot_do_is_refused_in_one_line():
    with pytest.raises(pf.InputError, match=r"body\.a\.modes: modes of the whole beam have no meaning"):
        framed(one_beam(modes=2), 2)
    with pytest.raises(pf.InputError, match=r"body\.a\.damping: a beam in several frames can be damped"):
        framed(one_beam(damping=pf.ModalDamping((0.01,))), 2)
    with pytest.raises(pf.InputError, match=r"body\.a\.frames: no such number of frames \(got 0\)"):
        framed(one_beam(), 0)
    with pytest.raises(pf.InputError, match=r"body\.rail\.frames: a joint slides along it"):
        build_system(slot(2))
    deflected = replace(one_beam(), sensors=(pf.DeflectionSensor("d", pf.PointRef("a", "B"), "y"),))
    with pytest.raises(pf.InputError, match=r"sensor\.d: reads in the frame of a, which has several"):
        build_system(framed(deflected, 2))
    for start in (
        Start(deflection={"a": {"B": Deflection(transverse=0.01)}}),
        Start(coordinates={"a": BodyValues(0, 0, 0)}),
    ):
        with pytest.raises(pf.InputError, match=r"cannot be given for a beam in several frames"):
            pf.simulate_motion(framed(one_beam(), 2), 0.01, samples=3, start=start)
    robot = pf.load("five_bar")
    task = pf.plan(framed(robot.mechanism.with_geometry("linear"), 2), next(iter(robot.paths.values())), samples=11)
    with pytest.raises(pf.InputError, match="kineto-elastodynamics takes one frame per beam"):
        simulate_ked(task, "++")


def one_beam(**more) -> pf.Mechanism:
    beam = pf.FlexibleBeam("a", 0.5, LEAF, STEEL, {"O": 0.0, "B": 0.5}, 2, **more)
    return pf.Mechanism(
        name="one", ground={"O": (0.0, 0.0)}, bodies=(beam,),
        joints=(pf.RevoluteJoint("O", pf.PointRef("ground", "O"), pf.PointRef("a", "O")),),
        assemblies=(pf.Assembly("flat", {"a": 0.0}),),
    )  # fmt: skip
