"""What is taken where a file or a user says nothing; the paper's studies state the paper's model."""

from __future__ import annotations

import json

import pytest

from paraflex.dynamics import build_system, consistent_state, static_equilibrium
from paraflex.files import library_file, library_names, load
from paraflex.mechanism import (
    Assembly,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    PointForce,
    PointRef,
    RevoluteJoint,
    Section,
    raparm_i,
)
from paraflex.results.links import tip_deflection
from shell import paraflex

PAPER = ("raparm_i", "raparm_ii")


def models(mechanism):
    beams = {(b.reference.value, b.curvature.value) for b in mechanism.bodies if isinstance(b, FlexibleBeam)}
    return mechanism.geometry.value, beams


@pytest.mark.parametrize("name", [name for name in library_names() if ":" not in name])
def test_library_mechanisms_take_the_defaults_and_the_paper_s_state_its_own(name):
    geometry, beams = models(load(name).mechanism)
    if name in PAPER:
        assert (geometry, beams) == ("linear", {("cantilever", "shared")})
    else:
        assert geometry == "second-order"
        assert beams <= {("pinned", "separate")}


def test_python_takes_the_same_defaults_as_files():
    beam = FlexibleBeam("beam", 1.0, Section(1e-4, 1e-9), Material(70e9, 2700.0), {"O": 0.0})
    joint = RevoluteJoint("O", PointRef("ground", "O"), PointRef("beam", "O"))
    mechanism = Mechanism("beam", {"O": (0.0, 0.0)}, (beam,), (joint,))
    assert models(mechanism) == ("second-order", {("pinned", "separate")})
    assert models(raparm_i()) == ("linear", {("cantilever", "shared")})


def test_a_file_states_frame_and_curvature_of_all_its_beams_and_a_beam_its_own(tmp_path):
    text = library_file("five_bar").read_text(encoding="utf-8")
    text = text.replace('name = "five-bar"\n', 'name = "five-bar"\nreference = "free"\ncurvature = "shared"\n')
    text = text.replace("[body.distal1]\n", '[body.distal1]\nreference = "cantilever"\n')
    file = tmp_path / "five.toml"
    file.write_text(text, encoding="utf-8")
    bodies = load(file).mechanism.bodies
    found = {body.name: (body.reference.value, body.curvature.value) for body in bodies}
    assert found.pop("distal1") == ("cantilever", "shared")
    assert set(found.values()) == {("free", "shared")}


def test_frames_are_chosen_on_the_command_line(tmp_path):
    """The paper's model of ++++ in other frames, along the first part of the square."""
    errors = {}
    for arguments in ((), ("--reference", "pinned"), ("--reference", "pinned", "--curvature", "separate")):
        out = tmp_path / str(len(arguments))
        done = paraflex(
            "run",
            "raparm_i",
            "--no-figures",
            "--mode",
            "++++",
            "--duration",
            "0.1",
            "--samples",
            "51",
            "--no-report",
            "--out",
            str(out),
            *arguments,
        )
        assert done.returncode == 0, done.stderr
        summary = json.loads((out / "summary.json").read_text())
        errors[arguments] = summary["modes"]["++++"]["tracking_rms"]
        assert summary["parameters"]["run"]["reference"] == (arguments[1] if arguments else None)
    assert len(set(errors.values())) == 3
    for arguments, says in (
        (("--reference", "pined"), "--reference: unknown reference"),
        (("--rigid", "--curvature", "shared"), "--curvature: has no effect with --rigid"),
    ):
        refused = paraflex("run", "raparm_i", "--no-figures", "--out", str(tmp_path / "none"), *arguments)
        assert refused.returncode == 2
        assert says in refused.stderr


@pytest.mark.parametrize("geometry", list(Geometry))
def test_the_deflection_of_a_tip_is_the_same_in_every_frame(condition, geometry):
    """P L^3 / 3 EI from the tangent at the clamped end, where a small force acts at the other."""
    section, material, force = Section.rectangle(0.02, 0.004), Material(70e9, 2700.0), 0.05
    beam = FlexibleBeam("beam", 0.8, section, material, {"O": 0.0, "P": 0.8}, 2, reference=condition)
    mechanism = Mechanism(
        "clamped", {"O": (0.0, 0.0)}, (beam,), (RevoluteJoint("O", PointRef("ground", "O"), PointRef("beam", "O")),),
        loads=(PointForce("push", PointRef("beam", "P"), (0.0, force)),),
        assemblies=(Assembly("level", {"beam": 0.0}),), geometry=geometry,
    )  # fmt: skip
    system = build_system(mechanism)
    state = static_equilibrium(system, consistent_state(system, mechanism.assembly()), ["O"])
    tip = tip_deflection(system, "beam", state.q[None])[0]
    bending = 70e9 * section.second_moment
    # Slopes of 0.002: what is of second order in them is below 1e-5.
    assert tip[1] == pytest.approx(force * 0.8**3 / (3 * bending), rel=2e-5)
    assert tip[2] == pytest.approx(force * 0.8**2 / (2 * bending), rel=2e-5)
