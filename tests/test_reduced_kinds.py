"""Reduced models of mechanisms of all kinds: a model of all states is the full one, one of few is near it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.dynamics import build_system, natural_frequencies, pose_at_rest
from paraflex.linear import linearise, reduce
from paraflex.mechanism import (
    AccelerationSensor,
    EndEffector,
    FlexibleBeam,
    JointForceSensor,
    Material,
    ModalDamping,
    PointRef,
    PositionSensor,
    Section,
    TorsionalDamper,
)
from test_consistency import parallelogram

FIVE_BAR = pf.load("five_bar")


def driven_four_bar(damping=None):
    """The library's four-bar, its crank's acceleration and a force at the coupler as inputs."""
    mechanism = pf.load("four_bar").mechanism
    sensors = (
        PositionSensor("place", "coupler.B", "x"), JointForceSensor("force", "B", "x"),
        AccelerationSensor("acceleration", "coupler.A", "y"),
    )  # fmt: skip
    bodies = [replace(body, damping=damping) if isinstance(body, FlexibleBeam) else body for body in mechanism.bodies]
    return replace(mechanism.with_bodies(bodies), sensors=sensors)


def redundant_rods():
    """Four parallel rods below a platform, one of them flexible, of the others one too many."""
    rigid = parallelogram(4)
    beam = FlexibleBeam(
        "rod3", 0.5, Section.rectangle(0.02, 0.004), Material(2.1e11, 7850.0), points={"G": 0.0, "P": 0.5}
    )
    bodies = [beam if body.name == "rod3" else body for body in rigid.bodies]
    return replace(rigid.with_bodies(bodies), end_effector=EndEffector(PointRef("platform", "P1"), ("x", "y")))


MODELS = {
    "gears": lambda: linearise(pf.load("geared_five_bar")),
    "sliding motors": lambda: linearise(pf.load("3prr")),
    "a driven crank": lambda: linearise(driven_four_bar(), prescribed=["drive"], forces=["coupler.B"]),
    "forces only": lambda: linearise(pf.load("leaf_spring_guide"), forces=["stage.T"]),
    "several frames": lambda: linearise(
        FIVE_BAR.mechanism.with_bodies(replace(body, frames=2) for body in FIVE_BAR.mechanism.bodies)
    ),
    "second order": lambda: linearise(FIVE_BAR.mechanism.with_geometry("second-order")),
    "redundant rows and rigid links": lambda: linearise(redundant_rods()),
    "a planned motion": lambda: linearise(FIVE_BAR.plan(), mode="++", at=0.1),
    "a run": lambda: linearise(FIVE_BAR.plan(duration=0.05).simulate("++"), at=0.03),
}  # fmt: skip


@pytest.mark.parametrize("kind", MODELS)
def test_all_kinds_of_mechanisms(kind):
    full = MODELS[kind]()
    s = 2.0 * np.pi * np.array([1.0, 10.0]) * (1j + 0.01)
    for method in ("craig-bampton", "rubin", "modal"):
        same, few = reduce(full, len(full.states), method=method), reduce(full, method=method)
        assert same.error(s).max() < 1e-8
        assert max(few.error(s, [one.name]).max() for one in full.outputs) < 5e-3
        lowest = few.frequencies[few.frequencies > 0.0][:1]
        assert lowest == pytest.approx(full.frequencies[full.frequencies > 0.0][:1], rel=1e-3)


def test_what_is_driven_is_a_state_by_name():
    few = reduce(driven := linearise(driven_four_bar(), prescribed=["drive"]), 8)
    assert [one.name for one in few.states[:2]] == ["O", "held_mode1"]
    assert few.B[4] == pytest.approx([1.0])
    assert few.A[4] == pytest.approx(np.zeros(8), abs=1e-9)
    assert few.inputs == driven.inputs


@pytest.mark.parametrize(
    ("damping", "dampers"),
    [(None, ()), (ModalDamping((0.02,)), ()), (ModalDamping((0.02,)), (TorsionalDamper("oil", "A", 1e-3),))],
)
def test_a_drive_that_is_an_input_is_not_released(damping, dampers):
    """Vibrations are those with the crank held, beside its own uniform motion; responses those of A, B, C and D."""
    mechanism = replace(driven_four_bar(damping), dampers=dampers)
    full, system = linearise(mechanism, prescribed=["drive"], forces=["coupler.B"]), build_system(mechanism)
    exact = natural_frequencies(system, pose_at_rest(system, None, None)).frequencies
    assert full.frequencies[:6] == pytest.approx([0.0, *exact[:5]], rel=1e-9)
    found = np.linalg.eigvals(full.A)
    assert np.abs(full.poles()) == pytest.approx(np.sort(np.abs(found)), rel=1e-9, abs=1e-6)
    for s in (3j + 0.1, 200j):
        exact = full.C @ np.linalg.solve(s * np.eye(len(full.A)) - full.A, full.B) + full.D
        response = full.frequency_response([s])[0]
        assert np.linalg.norm(response - exact, axis=0) == pytest.approx(np.zeros(3), abs=1e-9 * np.linalg.norm(exact))


def test_a_drive_that_is_an_input_of_many_bodies_is_not_released():
    """By sparse equations, with more than 200 degrees of freedom."""
    mechanism = driven_four_bar().with_beams(elements=40)
    full = linearise(mechanism, prescribed=["drive"])
    assert len(full.states) > 400
    system = build_system(mechanism)
    exact = natural_frequencies(system, pose_at_rest(system, None, None)).frequencies
    found = np.abs(full.poles(8))
    assert found == pytest.approx(np.repeat([0.0, *exact[:3]], 2), rel=1e-7)


def test_a_mechanism_without_outputs_has_no_table():
    with pytest.raises(pf.InputError, match="outputs: has no outputs whose responses could be compared"):
        pf.reduction_dataset([linearise(pf.load("four_bar"))])


@pytest.mark.parametrize("kind", ["gears", "sliding motors", "forces only", "several frames", "second order"])
def test_bases_of_other_poses_of_all_kinds(kind):
    """Along plans and runs: with its own basis and with that of the first pose."""
    if kind == "forces only":
        model = pf.load("leaf_spring_guide")
        motion, options = pf.simulate_motion(model.mechanism, 0.02, start=model.start), {"forces": ["stage.T"]}
    else:
        model, options = pf.load({"gears": "geared_five_bar", "sliding motors": "3prr"}.get(kind, "five_bar")), {}
        mechanism = model.mechanism
        if kind == "several frames":
            mechanism = mechanism.with_bodies(replace(body, frames=2) for body in mechanism.bodies)
        if kind == "second order":
            mechanism = mechanism.with_geometry("second-order")
        motion = pf.plan(mechanism, model.path())
    poses = pf.poses_along(motion, 3, **options)
    first, s = reduce(poses.models[0]), 2.0 * np.pi * np.array([1.0, 10.0]) * (1j + 0.01)
    for model in poses.models:
        few = reduce(model, basis=first)
        assert few.states == first.states
        assert max(few.error(s, [one.name]).max() for one in few.outputs) < 5e-3
