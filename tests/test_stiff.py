"""Magnified drawings of beams held at three places in line: they bend from the rigid mechanism, joints together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from paraflex.dynamics import build_system, consistent_state, static_equilibrium
from paraflex.files import ExpressionProfile
from paraflex.mechanism import (
    Assembly,
    FlexibleBeam,
    Mechanism,
    PointForce,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SlidingJoint,
)
from paraflex.mechanism.bodies import Material, Section
from paraflex.plots.scene import default_magnification, scene, select
from paraflex.reports.film import animation
from paraflex.results import drawing as drawings
from paraflex.results.drawing import drawing_coordinates, drawing_variables, system_drawing
from paraflex.results.outlines import outlines
from test_shapes import closed, point_stations

REF = PointRef.parse


def quick_return() -> Mechanism:
    """A crank whose pin slides along a lever between its pivot and its link to a ram."""
    return Mechanism(
        name="quick return",
        ground={"Q": (0.0, 0.0), "O": (0.0, 0.2), "R": (0.0, 0.45)},
        bodies=(
            RigidBody("crank", 0.4, 4e-4, points={"O": (0.0, 0.0), "A": (0.06, 0.0)}),
            FlexibleBeam("lever", 0.42, Section.rectangle(0.02, 0.012), Material(2.1e11, 7850.0),
                         points={"Q": 0.0, "B": 0.42}, elements=2),
            RigidBody("link", 0.2, 3e-4, (0.06, 0.0), {"B": (0.0, 0.0), "C": (0.12, 0.0)}),
            RigidBody("ram", 4.0, 1e-2, points={"C": (0.0, 0.0)}),
        ),
        joints=(
            RevoluteJoint("Q", REF("ground.Q"), REF("lever.Q")),
            RevoluteJoint("O", REF("ground.O"), REF("crank.O")),
            RevoluteJoint("B", REF("lever.B"), REF("link.B")),
            RevoluteJoint("C", REF("link.C"), REF("ram.C")),
            SlidingJoint("slot", REF("lever.Q"), REF("crank.A")),
            PrismaticJoint("rail", REF("ground.R"), REF("ram.C")),
        ),
        prescribed=(PrescribedAngle("drive", "O", ExpressionProfile("0.4")),),
        loads=(PointForce("cut", REF("ram.C"), (-200.0, 0.0)),),
        assemblies=(Assembly("start", {"crank": 0.4, "lever": 1.2, "link": 0.2, "ram": 0.0}),),
    )  # fmt: skip


@pytest.fixture(scope="module")
def bent():
    """The mechanism, its system, coordinates in balance with the load, and its drawing."""
    mechanism = quick_return()
    system = build_system(mechanism)
    q = static_equilibrium(system, consistent_state(system, mechanism.assembly()), []).q[None]
    return mechanism, system, q, system_drawing(system, q)


def test_the_base_is_the_rigid_mechanism_with_its_motors_where_they_are(bent):
    mechanism, _, _, drawn = bent
    first = 0
    for one in outlines(mechanism):
        base = drawn.base[0, first : first + len(one.places)]
        apart = [np.linalg.norm(places[:, None] - places[None], axis=-1) for places in (base, one.places)]
        np.testing.assert_allclose(*apart, rtol=0, atol=1e-12)
        first += len(one.places)
    stations = point_stations(mechanism)
    np.testing.assert_allclose(drawn.base[0, stations[REF("crank.A")]], drawn.shape[0, stations[REF("crank.A")]],
                               rtol=0, atol=1e-9)  # fmt: skip
    assert drawn.direction_bases[0, 4] != drawn.directions[0, 4]


@pytest.mark.parametrize("magnified", [1.0, 20.0, 200.0])
def test_joints_of_a_quick_return_keep_together(bent, magnified):
    mechanism, _, _, drawn = bent
    stations = point_stations(mechanism)
    places = drawn.base[0] + magnified * (drawn.shape - drawn.base)[0]
    joints = drawn.joint_bases[0] + magnified * (drawn.joints - drawn.joint_bases)[0]
    for joint, place in zip(mechanism.joints[:4], joints, strict=False):
        for ref in (joint.a, joint.b):
            here = np.array(mechanism.ground[ref.point]) if ref.on_ground else places[stations[ref]]
            np.testing.assert_allclose(here, place, rtol=0, atol=1e-9 * magnified)
    # The ram stays on its rail, the pin on the lever but for terms of second order.
    assert places[stations[REF("ram.C")], 1] == pytest.approx(0.45, abs=1e-9 * magnified)
    lever = places[stations[REF("lever.Q")] : stations[REF("lever.B")] + 1] @ [1.0, 1j]
    pin = joints[4] @ [1.0, 1j]
    step = np.diff(lever)
    part = np.clip(((pin - lever[:-1]) / step).real, 0.0, 1.0)
    gap = np.min(np.abs(pin - lever[:-1] - part * step))
    largest = magnified * np.max(np.abs(drawn.shape - drawn.base))
    assert gap <= 0.6 * largest**2 / 0.42 + 1e-4 * magnified * 0.42


def test_a_magnified_lever_is_visibly_bent_without_a_kink(bent):
    mechanism, _, _, drawn = bent
    variables = {name: (("time", *dims), values) for name, (dims, values) in drawing_variables(drawn).items()}
    labels = {"time": np.zeros(1), **drawing_coordinates(mechanism)}
    data = xr.Dataset(variables, labels, {"mechanism": mechanism.name})
    by = default_magnification([data])
    shown = scene(select(data, None), np.zeros(1), by)
    lever = shown.bodies["lever"][0] @ [1.0, 1j]
    chord = lever[-1] - lever[0]
    across = np.max(np.abs(((lever - lever[0]) * np.conj(chord)).imag)) / abs(chord)
    stiff = np.concatenate([places[0] for places in shown.stiff.values()])
    size = np.max(np.ptp(stiff, axis=0))
    offset = np.max(np.linalg.norm(shown.bodies["lever"][0] - shown.stiff["lever"][0], axis=1))
    assert 0.03 < offset / size < 0.08
    assert across > 0.01 * size
    assert by > 1.0
    kinks = np.abs(np.angle(np.diff(lever)[1:] / np.diff(lever)[:-1]))
    assert np.max(kinks) < 4.0 * np.sum(kinks) / len(kinks)
    # Symbols move with the bodies.
    pin = next(joint for joint in shown.joints if joint.name == "B")
    np.testing.assert_allclose(pin.place, shown.bodies["lever"][:, -1], rtol=0, atol=1e-7)
    assert animation(xr.concat([data, data], "mode")).to_dict()["swing"][0] is not None
    old = data.drop_vars(["joint_base", "joint_direction_base"])
    np.testing.assert_array_equal(scene(select(old, None), np.zeros(1), by).joints[2].place, drawn.joints[:, 2])
    assert animation(xr.concat([old, old], "mode")).to_dict()["swing"] == [None, None]


def test_beams_held_at_two_places_are_drawn_between_them(monkeypatch):
    """No rigid mechanism is sought, and joints are where they are."""
    monkeypatch.setattr(drawings, "rigid_frames", None)
    whole = quick_return()
    plain = replace(whole, joints=tuple(one for one in whole.joints if one.name != "B"))
    drawn = system_drawing(*closed(plain))
    assert drawn.joint_bases is drawn.joints
    assert drawn.direction_bases is drawn.directions


def test_a_mechanism_that_does_not_close_rigid_is_drawn_through_its_joints(monkeypatch, bent):
    mechanism, system, q, _ = bent
    monkeypatch.setattr(drawings, "rigid_frames", lambda *_: None)
    drawn = system_drawing(system, q)
    stations = point_stations(mechanism)
    at = stations[REF("lever.B")]
    np.testing.assert_allclose(drawn.base[:, at], drawn.shape[:, at], rtol=0, atol=1e-12)
    assert drawn.joint_bases is drawn.joints
