"""A payload at the end-effector: the same runs as of masses placed by hand."""

from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import paraflex as pf
from paraflex.checks.drawing import pose_of
from paraflex.cli.app import app
from paraflex.cli.inspect import describe
from paraflex.designs.sweep import load_sweep
from paraflex.dynamics import build_system
from paraflex.files import library_text, load_data, model_from
from paraflex.mechanism import (
    Assembly,
    EndEffector,
    LumpedMass,
    Mechanism,
    ModalPoint,
    Payload,
    RevoluteJoint,
    RigidBody,
    WeldJoint,
)
from paraflex.motion import simulate_motion
from test_given_shapes import LENGTH, modal, quintic


def with_table(payload, name="five_bar"):
    data, source = load_data(name)
    return model_from(data | {"payload": payload}, source)


def test_a_beam_carries_it_as_a_lump():
    model = with_table({"mass": "200 g", "inertia": "30 kg mm^2"})
    bare = pf.load("five_bar").mechanism
    body = bare.body("distal1")
    by_hand = bare.with_bodies([replace(body, lumps=(body.lumps[0], LumpedMass("C", 0.3 + 0.2, 5e-5 + 3e-5)))])
    assert model.mechanism == by_hand == bare.with_payload(Payload(0.2, 3e-5))
    heavier = with_table({"mass": 0.2}).mechanism.body("distal1").lumps[1]
    assert (heavier.mass, heavier.inertia) == (0.5, 5e-5)


ROD = RigidBody("rod", 0.3, 2e-3, (0.12, 0.01), {"O": (0.0, 0.0), "P": (0.25, 0.0)})


def pendulum(*bodies, joints=()):
    """A body that hangs at O, its end-effector at P."""
    angles = {body.name: -0.4 for body in bodies}
    return Mechanism(
        "pendulum", {"O": (0.0, 0.0)}, bodies, (RevoluteJoint("O", "ground.O", "rod.O"), *joints),
        gravity=(0.0, -9.81), end_effector=EndEffector("rod.P"), assemblies=(Assembly("start", angles),),
    )  # fmt: skip


def test_a_rigid_body_carries_it_as_a_body_welded_to_it():
    carried = RigidBody("load", 0.4, 3e-3, (0.03, 0.02), {"P": (0.0, 0.0)})
    welded = pendulum(ROD, carried, joints=(WeldJoint("weld", "rod.P", "load.P"),))
    merged = pendulum(ROD).with_payload(Payload(0.4, 3e-3, (0.03, 0.02)))
    assert len(merged.bodies) == 1
    options = pf.IntegrationOptions(tolerance=1e-9)
    runs = [simulate_motion(one, 0.5, samples=11, options=options) for one in (merged, welded)]
    angles = [run.solution.q[:, run.system.body("rod").angle] for run in runs]
    assert np.ptp(angles[0]) > 0.5
    np.testing.assert_allclose(angles[0], angles[1], rtol=0, atol=1e-7)
    energies = [run.solution.kinetic_energy for run in runs]
    np.testing.assert_allclose(energies[0], energies[1], rtol=0, atol=1e-7)


def as_modal(beam):
    """A body by the matrices of a beam."""
    body = build_system(Mechanism("one", {}, (beam,), ())).bodies[0]
    shapes = {name: body.mesh.shape_at(x) for name, x in beam.points.items()}
    D = body.integrals.D
    points = {name: ModalPoint((beam.points[name], 0.0), N @ D, slope @ D) for name, (N, slope) in shapes.items()}
    return modal(body.integrals, points)


@pytest.mark.parametrize("own", [True, False])
def test_a_body_of_given_matrices_carries_it_as_the_beam_that_they_are_of(own):
    beam = quintic(points={"O": 0.0, "P": 0.7 * LENGTH, "Q": LENGTH}, lumps=(LumpedMass("P", 0.1, 1e-4),))
    payload = Payload(0.3, 2e-3)
    if not own:  # a mass matrix without lumped moments of inertia, but with the same mesh
        beam = replace(beam, lumps=(LumpedMass("P", 0.1, 1e-30),))
    body = as_modal(beam) if own else replace(as_modal(beam), I2=None)
    found = pendulum(body).with_payload(payload).body("rod").integrals
    expected = as_modal(pendulum(beam).with_payload(payload).body("rod")).integrals
    for name in ("m", "S1", "I0"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-12, atol=1e-15, err_msg=name)
    # The coordinates are not those of the beam with the payload: what does not depend on them.
    for one, other in zip(invariants(found), invariants(expected), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * np.max(np.abs(other)))
        assert np.max(np.abs(other)) > 1e-6


def invariants(s):
    """Products and eigenvalues of a body's constants in the metric of its mass matrix."""
    rows = np.vstack([s.S2, s.G1 + s.Jf, s.I1])
    yield rows @ np.linalg.solve(s.Mff, rows.T)
    for matrix in (s.K, s.I2, s.G2):
        values = np.linalg.eigvals(np.linalg.solve(s.Mff, matrix))
        yield np.sort(values.imag if matrix is s.G2 else values.real)


@pytest.mark.parametrize(
    ("payload", "says"),
    [
        ({"inertia": 1.0}, "payload.mass: is missing; give the mass in kg"),
        ({"mass": -1.0}, "payload.mass: must not be negative"),
        ({"mass": "3 mm"}, "payload.mass: a quantity in m where one in kg"),
        ({"mass": 1.0, "offset": [0.1, 0.0]}, r'payload.offset: "distal1" bends, and has no lumps beside its points'),
        ({"mass": 1.0, "point": "distal1.C"}, "payload.point: unknown field"),
    ],
)
def test_what_cannot_be_carried_is_refused(payload, says):
    with pytest.raises(pf.InputError, match=f"^five_bar.toml: {says}"):
        with_table(payload)


def test_somebody_must_carry_it():
    data, source = load_data("four_bar")
    assert "end_effector" not in data
    with pytest.raises(pf.InputError, match=r"^four_bar.toml: payload: there is no end-effector"):
        model_from(data | {"payload": {"mass": 1.0}}, source)


def test_saved_files_keep_the_table_unless_its_body_is_another(tmp_path):
    text = library_text("five_bar") + '\n[payload]\nmass = "0.2 kg" # a gripper\n'
    (tmp_path / "model.toml").write_text(text)
    model = pf.load(tmp_path / "model.toml")
    model.save(tmp_path / "same.toml")
    assert (tmp_path / "same.toml").read_text() == text
    other = replace(model, study=replace(model.study, duration=0.8))
    other.save(tmp_path / "longer.toml")
    assert "[payload]" in (tmp_path / "longer.toml").read_text()
    body = model.mechanism.body("distal1")
    for changed in (replace(body, lumps=(body.lumps[0], LumpedMass("C", 0.9))), replace(body, elements=2)):
        heavier = replace(model, mechanism=model.mechanism.with_bodies([changed]))
        heavier.save(tmp_path / "heavier.toml")
        assert pf.load(tmp_path / "heavier.toml").mechanism == heavier.mechanism


def test_it_is_listed_and_drawn_where_it_is(tmp_path):
    rod = pendulum(ROD).with_payload(Payload(0.1, 1e-3, (0.03, 0.02))).with_payload(Payload(0.3, 2e-3, (0.07, -0.02)))
    both = rod.payload
    assert (both.mass, *both.offset) == pytest.approx((0.4, 0.06, -0.01))
    # By Steiner's theorem, 0.05 m being the distance of one from the other.
    assert both.inertia == pytest.approx(3e-3 + 0.1 * 0.3 / 0.4 * (0.04**2 + 0.04**2))
    assert rod.rigid().payload == both
    facts = describe(pf.Model(rod))
    assert facts["payload"]["point"] == "rod.P"
    assert facts["payload"]["mass"] == pytest.approx(0.4)
    assert facts["total_mass"] == pytest.approx(0.7)
    figure = pf.draw(rod)
    assert "payload 0.4 kg" in [text.get_text() for text in figure.legends[0].get_texts()]
    (mark,) = [
        line for line in figure.axes[0].get_lines() if line.get_marker() == "s" and line.get_markersize() == 11.0
    ]
    c, s = np.cos(-0.4), np.sin(-0.4)
    place = [[c, -s], [s, c]] @ np.array([0.25 + 0.06, -0.01])
    np.testing.assert_allclose(mark.get_xydata(), [place], rtol=0, atol=1e-6)
    # Of a beam at the point; without one there is nothing.
    shown = pose_of(with_table({"mass": "200 g"}))
    np.testing.assert_allclose(shown.payload, pose_of("five_bar").desired[0], rtol=0, atol=1e-6)
    assert pose_of("five_bar").payload is None
    assert describe(pf.load("five_bar"))["payload"] is None


def test_info_prints_it(tmp_path):
    text = library_text("five_bar") + '\n[payload]\nmass = "200 g"\ninertia = "30 kg mm^2"\n'
    (tmp_path / "model.toml").write_text(text)
    done = CliRunner().invoke(app, ["info", str(tmp_path / "model.toml")])
    assert "0.2 kg, 3e-05 kg m^2 at distal1.C" in done.output
    assert "including its payload" in done.output
    assert "payload" not in CliRunner().invoke(app, ["info", "five_bar"]).output


def test_it_is_varied_and_differentiated(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.toml").write_text(library_text("five_bar") + "\n[payload]\nmass = 0.2\n")
    study = """
mechanism = "model.toml"
metrics = ["rms_torque_norm", "total_mass"]
duration = "50 ms"
samples = 11
[vary.load]
fields = ["payload.mass"]
"""
    (tmp_path / "slopes.toml").write_text(study.replace(', "total_mass"', ""))
    (tmp_path / "sweep.toml").write_text(study + 'values = ["199 g", "201 g"]\n')
    slope = pf.sensitivities("slopes.toml").derivatives[0, 0, 0]
    runs = load_sweep("sweep.toml").run("runs").data
    assert np.diff(runs["total_mass"].values) == pytest.approx(2e-3, rel=1e-9)
    assert slope == pytest.approx(np.diff(runs["rms_torque_norm"].values).item() / 2e-3, rel=1e-3)
