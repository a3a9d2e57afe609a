"""Beams whose section and material change from span to span, and textbook frequencies of beams from files."""

import json
from itertools import pairwise

import numpy as np
import pytest
import scipy.integrate
import scipy.optimize

from paraflex.cli.inspect import describe
from paraflex.dynamics import build_system, consistent_state, static_equilibrium
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.files import load
from paraflex.mechanism import (
    Assembly,
    Curvature,
    FlexibleBeam,
    Geometry,
    LumpedMass,
    Material,
    Mechanism,
    PointForce,
    PointRef,
    RevoluteJoint,
    Section,
    finite_segments,
)
from paraflex.results.links import tip_deflection
from shell import paraflex
from test_segments import first_frequency

CLAMPED_FREE = [1.8751040687119611, 4.694091132974175, 7.854757438237613]  # textbook
# Tip mass equal to the beam's: roots of 1 + cos k cosh k + k (cos k sinh k - sin k cosh k) (textbook).
TIP_MASS = [1.24791740960647, 4.03113943671496, 7.13413224093975]

CANTILEVER = """
name = "cantilever"
[parameters]
L = 0.8
[section.bar]
width = 0.02
thickness = 0.005
[section.thin]
width = 0.01
thickness = 0.003
[material.steel]
youngs_modulus = 210e9
density = 7850.0
[material.alloy]
youngs_modulus = 70e9
density = 2700.0
[lump.tip]
mass = "7850 * 0.02 * 0.005 * L"
[body.beam]
type = "beam"
length = "L"
section = "bar"
material = "steel"
points = { tip = "L" }
elements = 8
reference = "cantilever"
"""


def with_lines(tmp_path, *changes):
    source = CANTILEVER
    for old, new in changes:
        assert old in source
        source = source.replace(old, new)
    file = tmp_path / "beam.toml"
    file.write_text(source, encoding="utf-8")
    return file


# --- Textbook frequencies ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lumps", "roots"), [("", CLAMPED_FREE), ('lumps = { tip = "tip" }', TIP_MASS)], ids=["clamped-free", "tip mass"]
)
def test_frequencies_of_a_cantilever_from_a_file_are_the_textbook_roots(tmp_path, lumps, roots):
    file = with_lines(tmp_path, ("elements = 8", f"elements = 8\n{lumps}"))
    done = paraflex("info", str(file), "--json")
    # Nothing holds it: such a mechanism is wrong, but its beam can be looked at.
    assert done.returncode == 1, done.stderr
    found = 2 * np.pi * np.array(json.loads(done.stdout)["links"][0]["frequencies_hz"][:3])
    # omega = (beta L)^2 sqrt(E I / (rho A L^4)), with I / A = h^2 / 12.
    scale = np.sqrt(210e9 * 0.005**2 / 12 / 7850.0) / 0.8**2
    np.testing.assert_allclose(found, np.square(roots) * scale, rtol=1e-6)


# --- A step of section and material --------------------------------------------------------------------------------


def transfer(k, length, stiffness):
    """Transfer matrix (4, 4) of (w, w', M, Q), M = EI w'', Q = EI w''', over a uniform span of wave number k."""
    h, s, c, d = np.cosh(k * length), np.sinh(k * length), np.cos(k * length), np.sin(k * length)
    a, b, e, f = (h + c) / 2, (s + d) / (2 * k), (h - c) / (2 * k**2), (s - d) / (2 * k**3)
    rows = np.array([[a, b, e, f], [k**4 * f, a, b, e], [k**4 * e, k**4 * f, a, b], [k**4 * b, k**4 * e, k**4 * f, a]])
    scale = np.array([1.0, 1.0, stiffness, stiffness])
    return scale[:, None] * rows / scale


def stepped_frequencies(spans, count, tip_mass=0.0):
    """Angular frequencies of a clamped-free beam of spans (length, mass per length, EI), by transfer matrices."""

    def determinant(omega):
        total = np.eye(4)
        for length, mass, stiffness in spans:
            total = transfer((mass * omega**2 / stiffness) ** 0.25, length, stiffness) @ total
        # A mass at the tip: Q = -m omega^2 w there.
        total[3] += tip_mass * omega**2 * total[0]
        return np.linalg.det(total[2:, 2:])

    step = 0.05 * np.sqrt(min(EI / m for _, m, EI in spans)) / sum(length for length, *_ in spans) ** 2
    roots, omega = [], step
    while len(roots) < count:
        if determinant(omega) * determinant(omega + step) < 0.0:
            roots.append(scipy.optimize.brentq(determinant, omega, omega + step, xtol=1e-13, rtol=1e-13))
        omega += step
    return np.array(roots)


def test_transfer_matrices_give_the_textbook_roots():
    spans = [(0.3, 2.0, 5.0), (0.7, 2.0, 5.0)]
    np.testing.assert_allclose(stepped_frequencies(spans, 3), np.sqrt(5 / 2) * np.square(CLAMPED_FREE), rtol=1e-10)
    np.testing.assert_allclose(
        stepped_frequencies(spans, 3, tip_mass=2.0), np.sqrt(5 / 2) * np.square(TIP_MASS), rtol=1e-10
    )


STEP = (
    ("points = {", "points = { step = 0.3,"),
    ('section = "bar"', 'section = ["bar", "thin"]'),
    ('material = "steel"', 'material = ["steel", "alloy"]'),
)
# (length, mass per length, EI) of the two spans.
SPANS = [
    (0.3, 7850.0 * 0.02 * 0.005, 210e9 * 0.02 * 0.005**3 / 12),
    (0.5, 2700.0 * 0.01 * 0.003, 70e9 * 0.01 * 0.003**3 / 12),
]


@pytest.mark.parametrize(("lumps", "tip_mass"), [("", 0.0), ('\nlumps = { tip = "tip" }', 0.628)])
def test_a_stepped_beam_has_the_frequencies_of_its_transfer_matrices(tmp_path, lumps, tip_mass):
    file = with_lines(tmp_path, *STEP, ("elements = 8", f"elements = [4, 6]{lumps}"))
    found = 2 * np.pi * np.array(describe(load(file))["links"][0]["frequencies_hz"][:4])
    # Curvature is free to jump with E I at the step; one that both sides share is 1.7e-2 off in the first frequency.
    np.testing.assert_allclose(found, stepped_frequencies(SPANS, 4, tip_mass), rtol=1e-6)


def test_spans_of_one_name_are_the_plain_beam(tmp_path):
    plain = with_lines(tmp_path, STEP[0])
    mechanism = load(plain).mechanism
    same = with_lines(tmp_path, STEP[0], ('section = "bar"', 'section = ["bar", "bar"]'))
    for name in ("I2", "G1", "K", "S2"):
        one, other = (getattr(build_system(m).bodies[0].integrals, name) for m in (mechanism, load(same).mechanism))
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (STEP[1], "body.beam.section: the beam has 1 span(s) between its points and ends (got 2); give one section"),
        (STEP[2], "body.beam.material: the beam has 1 span(s) between its points and ends (got 2); give one material"),
        (('section = "bar"', 'section = ["bra"]'), "body.beam.section: unknown section (got 'bra'); did you mean"),
        (('section = "bar"', "section = [3]"), "body.beam.section: should be a valid string (got [3]); give the name"),
        (('section = "bar"', "section = 3"), "body.beam.section: should be a valid string (got 3); give the name"),
    ],
)  # fmt: skip
def test_spans_that_do_not_fit_are_named(tmp_path, change, says):
    with pytest.raises(InputError) as caught:
        load(with_lines(tmp_path, change))
    assert says in str(caught.value)


def test_a_bad_section_of_a_span_is_named():
    bars = (Section(1e-4, 1e-9), Section(1e-4, -1e-9))
    beam = FlexibleBeam("beam", 1.0, bars, Material(70e9, 2700.0), {"M": 0.5})
    with pytest.raises(InputError, match=r"body\.beam\.section\.1\.second_moment: must be positive"):
        Mechanism("bad", {}, (beam,), ())


# --- Second-order geometry and finite segments of it ---------------------------------------------------------------


def stepped_beam(elements=2):
    """A step where no segment ends, and a lump amid a span."""
    sections = (Section(1.0, 3e-4), Section(0.6, 1e-4), Section(0.6, 1e-4))
    return FlexibleBeam(
        "beam",
        1.0,
        sections,
        (Material(1e4, 1.0), Material(2e4, 0.5), Material(2e4, 0.5)),
        {"O": 0.0, "M": 0.37, "N": 0.8, "P": 1.0},
        elements,
        lumps=(LumpedMass("N", 0.05, 1e-3),),
        reference=ReferenceCondition.CANTILEVER,
        curvature=Curvature.SHARED,
    )


def cantilever(beam, **changes):
    return Mechanism(
        "cantilever",
        {"O": (0.0, 0.0)},
        (beam,),
        (RevoluteJoint("root", PointRef("ground", "O"), PointRef("beam", "O")),),
        **changes,
    )


def along(places, values):
    """A piecewise constant function of x."""
    return lambda x: values[int(np.searchsorted(places, x, side="right"))]


def test_mass_points_of_second_order_geometry_follow_the_spans():
    body = build_system(cantilever(stepped_beam(), geometry=Geometry.SECOND_ORDER)).bodies[0]
    points, density = body.points, along([0.37], [1.0, 0.3])
    mass, first, second = (
        scipy.integrate.quad(lambda x, n=n: density(x) * x**n, 0.0, 1.0, points=[0.37])[0] for n in range(3)
    )
    for n, value in enumerate((mass + 0.05, first + 0.05 * 0.8, second + 0.05 * 0.8**2)):
        assert points.mass @ points.x**n == pytest.approx(value, rel=1e-13)
    np.testing.assert_allclose(body.integrals.I0, second + 0.05 * 0.8**2, rtol=1e-13)


def test_segments_of_a_stepped_beam_keep_its_mass_and_bend_as_it_does():
    beam, n = stepped_beam(), 5
    segmented = finite_segments(cantilever(beam), n)
    density, stiffness = along([0.37], [1.0, 0.3]), along([0.37], [3.0, 2.0])
    for part in segmented.mechanism.bodies:
        start = segmented.carriers[part.name][1]
        lump = 0.05 if start == pytest.approx(0.8) else 0.0
        mass, first, second = (
            scipy.integrate.quad(
                lambda x, k=k, start=start: density(x) * (x - start) ** k, start, start + 0.2, points=[0.37]
            )[0]
            for k in range(3)
        )
        centre = first / (mass + lump)
        assert part.mass == pytest.approx(mass + lump, rel=1e-12)
        assert part.centre_of_mass[0] == pytest.approx(centre, rel=1e-12)
        # The lump stands at the start of its segment.
        expected = second - (mass + lump) * centre**2 + (1e-3 if lump else 0.0)
        assert part.inertia == pytest.approx(expected, rel=1e-12)
    # Hinges at 0.2, 0.4, ...: the second's halves reach from 0.3 to 0.5 and are of both spans.
    for k, spring in enumerate(segmented.mechanism.springs):
        a, b = 0.2 * k + 0.1, 0.2 * k + 0.3
        flexibility = sum(
            (y - x) / stiffness(0.5 * (x + y)) for x, y in pairwise(sorted({a, b, *([0.37] if a < 0.37 < b else [])}))
        )
        assert spring.stiffness == pytest.approx(1.0 / flexibility, rel=1e-12)


def test_segments_of_a_stepped_beam_converge_to_its_frequency():
    spans = [(0.4, 1.0, 3.0), (0.6, 0.5, 1.0)]
    sections, materials = (Section(1.0, 3e-4), Section(0.5, 1e-4)), Material(1e4, 1.0)
    beam = FlexibleBeam("beam", 1.0, sections, materials, {"O": 0.0, "M": 0.4, "P": 1.0})
    errors = np.array([first_frequency(n, beam) for n in (8, 16, 32)]) / stepped_frequencies(spans, 1)[0] - 1.0
    assert 0.0 < errors[-1] < 0.1
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 1.0, atol=0.15)


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
def test_a_stepped_cantilever_sags_as_in_the_textbook(geometry):
    force = 1e-3
    beam = stepped_beam(1)
    mechanism = cantilever(
        beam,
        loads=(PointForce("pull", PointRef("beam", "P"), (0.0, force)),),
        assemblies=(Assembly("straight", {"beam": 0.0}),),
    ).with_geometry(geometry)
    system = build_system(mechanism)
    state = static_equilibrium(system, consistent_state(system, mechanism.assembly()), ["root"])
    # w = int (P (1 - x) / EI) (1 - x) dx.
    bent = ((1 - 0.37) ** 3) / 3 * force / 2.0 + (1 - (1 - 0.37) ** 3) / 3 * force / 3.0
    assert tip_deflection(system, "beam", state.q[None])[0, 1] == pytest.approx(bent, rel=1e-6)
