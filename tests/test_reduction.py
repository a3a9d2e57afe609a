"""Beams reduced to few modes under the moments that joints bring in: who is told, and how far off they are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

import paraflex as pf
from paraflex.checks import check
from paraflex.dynamics import build_system, missing_rotations
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.files import load
from paraflex.linear import linearise
from paraflex.mechanism import AppliedTorque, Assembly, PointForce, PointRef, RigidBody, Section, SlidingJoint, raparm_i
from short_studies import check_derivatives, stress_study
from test_damping import STEEL, beam, held, on_a_roller, unit_frequency, vibrations
from test_linear import hub_beam

PINNED, CANTILEVER, FREE = ReferenceCondition.PINNED, ReferenceCondition.CANTILEVER, ReferenceCondition.FREE


def clamped(reference, modes):
    return held(beam(reference, None, modes=modes, elements=8), ("weld", "free"))


@pytest.mark.parametrize("modes", [1, 2, 4, 8])
def test_modes_of_the_pinned_frame_miss_the_turn_of_a_clamped_end(modes):
    (missed,) = missing_rotations(build_system(clamped(PINNED, modes)))
    assert (str(missed.point), missed.cause, missed.modes) == ("beam.A", "the weld A", modes)
    # Of a beam on two pins: L / 3EI in all, 2 L / (n pi)^2 EI from its mode n.
    exact = 1.0 - 6.0 / np.pi**2 * np.sum(1.0 / np.arange(1, modes + 1) ** 2)
    assert missed.part == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(
    ("reference", "modes", "off"),
    [
        (PINNED, 1, 0.48),
        (PINNED, 2, 0.20),
        (PINNED, 4, 0.10),
        (PINNED, 8, 0.050),
        (FREE, 2, 0.35),
        (CANTILEVER, 1, 0.0),
    ],
)
def test_a_clamped_beam_is_too_stiff_by_what_they_miss(reference, modes, off):
    frequencies, _ = vibrations(clamped(reference, modes))
    assert frequencies[0] / (1.8751041**2 * unit_frequency()) - 1.0 == pytest.approx(off, rel=0.03, abs=1e-5)
    assert bool(missing_rotations(build_system(clamped(reference, modes)))) == (off > 0.0)


def bending(mechanism, force=0.0, moment=0.0):
    """Static transverse displacement and slope of the beam's end B under a force and a moment there."""
    system = build_system(mechanism)
    body, end = system.body("beam"), system.marker(PointRef("beam", "B"))
    row, turn = np.zeros(system.n), np.zeros(system.n)
    row[[1, 2]], row[body.flexible] = (1.0, end.x0[0]), end.N[1]
    turn[2], turn[body.flexible] = 1.0, end.slope
    stiffness = np.concatenate([np.zeros(3), body.modes.omega**2])
    sizes = 1.0 / np.sqrt(1.0 + stiffness)
    free = sizes[:, None] * scipy.linalg.null_space(system.jacobian(np.zeros(system.n)) * sizes, rcond=1e-10)
    x = free @ np.linalg.solve(free.T @ np.diag(stiffness) @ free, free.T @ (force * row + moment * turn))
    return row @ x, turn @ x


def errors_of_reduction(reference, modes):
    """The columns of the table in theory.md."""
    one_end = clamped(reference, modes)
    pins = on_a_roller(held(beam(reference, None, modes=modes, elements=8), ("pin", "pin")))
    flexural = STEEL.youngs_modulus * Section.rectangle(width=0.02, thickness=0.004).second_moment
    return (
        vibrations(one_end)[0][0] / (1.8751041**2 * unit_frequency()) - 1.0,
        bending(one_end, force=1.0)[0] / (0.5**3 / (3.0 * flexural)) - 1.0,
        bending(one_end, moment=1.0)[0] / (0.5**2 / (2.0 * flexural)) - 1.0,
        bending(pins, moment=1.0)[1] / (0.5 / (3.0 * flexural)) - 1.0,
        vibrations(pins)[0][0] / (np.pi**2 * unit_frequency()) - 1.0,
    )


def documented():
    """Rows of the table in theory.md: frame, modes and the errors as they are written."""
    page = (Path(__file__).parents[1] / "docs" / "theory.md").read_text(encoding="utf-8")
    lines = page.split("| frame | modes |")[1].split("\n\n")[0].splitlines()[2:]
    frame = ""
    for line in lines:
        name, modes, *errors = (cell.strip() for cell in line.strip("|").split("|"))
        frame = name or frame
        yield pytest.param(ReferenceCondition(frame), int(modes), errors, id=f"{frame} {modes}")


@pytest.mark.parametrize(("reference", "modes", "errors"), list(documented()))
def test_the_table_in_theory_md(reference, modes, errors):
    for found, written in zip(errors_of_reduction(reference, modes), errors, strict=True):
        digits = written.removesuffix(" %")
        # Half a unit of the last digit; a plain 0 is less than 0.001 %.
        unit = 0.001 if digits == "0" else 10.0 ** -len(digits.partition(".")[2])
        assert 100.0 * found == pytest.approx(float(digits), abs=0.51 * unit)


def test_pins_and_whole_beams_are_not_complained_of():
    assert not missing_rotations(build_system(held(beam(PINNED, None, modes=1), ("pin", "pin"))))
    assert not missing_rotations(build_system(held(beam(PINNED, None), ("weld", "drive"))))


def test_info_complains_of_a_beam_that_is_too_stiff_under_its_motor():
    model = load("spin_up")
    reduced = model.mechanism.with_beams(reference=PINNED, modes=2)
    (finding,) = check(replace(model, mechanism=reduced))
    assert (finding.code, finding.place) == ("modes-too-stiff", "body.beam.modes")
    assert finding.text.startswith("2 modes miss 24 % of its rotation under a moment at root from the prescribed")
    assert "craig-bampton" in finding.remedy
    assert not check(replace(model, mechanism=model.mechanism.with_beams(reference=CANTILEVER, modes=2)))


# --- Craig-Bampton: static shapes of what acts on a beam, and modes with that held ------------------------------------


def with_static_shapes(mechanism, modes, reference=PINNED):
    return mechanism.with_beams(modes=modes, reduction="craig-bampton", reference=reference)


# Exact frequencies of a beam on a hub with a tip mass, and how far off those of its reductions are: from roots of the
# transcendental equation, and from another program with cubic elements that holds the slope of the tip too.
HUB = [5.69177290724, 18.100719840919]
HUB_OFF = {0: (1.7e-3, 3.5e-1), 1: (1.1e-4, 8.3e-4), 2: (4.0e-6, 1.8e-6), 3: (3.5e-6, 1.7e-6)}


@pytest.mark.parametrize("reference", [PINNED, CANTILEVER, FREE])
@pytest.mark.parametrize("modes", [0, 1, 2, 3])
def test_a_beam_on_a_hub_in_every_frame(modes, reference):
    # A moment of inertia that is nothing beside the beam's makes the turn of the tip a part of the interface.
    found = linearise(with_static_shapes(hub_beam(0.1, 0.5, 1e-12), modes, reference)).poles()
    off = np.sort(np.abs(found))[::2][1:3] / HUB - 1.0
    assert off == pytest.approx(HUB_OFF[modes], rel=0.03)


@pytest.mark.parametrize("reference", [PINNED, CANTILEVER, FREE])
def test_static_shapes_carry_moments_and_forces_exactly(reference):
    mechanism = clamped(reference, None)
    end = PointRef("beam", "B")
    mechanism = replace(mechanism, loads=(PointForce("push", end, (0.0, 1.0)), AppliedTorque("turn", end, 1.0)))
    few = with_static_shapes(mechanism, 0, reference)
    # Stretch, force and moment at the end.
    assert build_system(few).n_flexible == 3
    assert not missing_rotations(build_system(few))
    for given in ({"force": 1.0}, {"moment": 1.0}):
        assert bending(few, **given) == pytest.approx(bending(mechanism, **given), rel=1e-9)


def test_coordinates_that_are_kept_of_the_links_of_raparm_i():
    """Of each bar two static shapes in bending, as lumps turn at both ends, and its stretch; more at a third pin."""
    system = build_system(with_static_shapes(raparm_i(), 1))
    assert [body.nf for body in system.bodies] == [4, 4, 4, 7, 4, 4, 4, 7]


def test_so_many_shapes_are_the_whole_beam():
    """With all vibrations nothing is missing, and nothing there twice."""
    whole = build_system(clamped(FREE, None)).body("beam")
    all_kept = build_system(with_static_shapes(clamped(FREE, None), whole.nf, FREE)).body("beam")
    assert all_kept.modes.omega == pytest.approx(whole.modes.omega, rel=1e-7)


def test_derivatives_of_runs_with_reduced_beams(tmp_path):
    model = pf.load("five_bar")
    few = with_static_shapes(model.mechanism, 1)
    replace(model, mechanism=few).save(tmp_path / "few.toml")
    study = stress_study(str(tmp_path / "few.toml"), "section.bar.thickness")
    check_derivatives(tmp_path, study, value=0.005, rel=2e-4)


def test_a_file_says_what_is_kept(tmp_path):
    few = with_static_shapes(pf.load("five_bar").mechanism, 2)
    few.save(tmp_path / "few.toml")
    read = pf.load(tmp_path / "few.toml").mechanism
    assert read == few
    assert 'reduction = "craig-bampton"' in (tmp_path / "few.toml").read_text(encoding="utf-8")


def test_what_cannot_be_reduced_is_said():
    with pytest.raises(InputError, match=r"body\.beam\.reduction: has no meaning without modes .* modes = 2"):
        clamped(PINNED, None).with_beams(reduction="craig-bampton")
    with pytest.raises(InputError, match="no such number of modes"):
        with_static_shapes(clamped(PINNED, None), -1)
    lever = clamped(PINNED, None)
    carriage = RigidBody("carriage", 0.1, 1e-5, points={"P": (0.0, 0.0)})
    sliding = SlidingJoint("rail", PointRef("beam", "A"), PointRef("carriage", "P"))
    pose = (Assembly("straight", {"beam": 0.0, "carriage": 0.0}),)
    lever = replace(lever, bodies=(*lever.bodies, carriage), joints=(*lever.joints, sliding), assemblies=pose)
    with pytest.raises(InputError, match=r"body\.beam\.reduction: a joint slides along it"):
        build_system(with_static_shapes(lever, 1))


def test_runs_complain_too():
    model = pf.load("spin_up")
    reduced = replace(model, mechanism=model.mechanism.with_beams(reference=PINNED, modes=2))
    with pytest.warns(pf.ResultWarning, match=r"body\.beam\.modes: 2 modes miss 24 % .*craig-bampton"):
        run = pf.simulate_motion(reduced, 0.1, samples=11)
    assert "modes-too-stiff" in [one.code for one in run.findings]
    sound = pf.simulate_motion(replace(model, mechanism=with_static_shapes(model.mechanism, 2)), 0.1, samples=11)
    assert "modes-too-stiff" not in [one.code for one in sound.findings]
