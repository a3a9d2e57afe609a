"""Derivatives of what comes before a run: eigenpairs, systems, planned motion and torques, and laws they must obey."""

import numpy as np
import pytest

import twins
from paraflex.arguments import with_fields
from paraflex.designs.derivatives.changes import Change
from paraflex.designs.derivatives.plans import nominal_values, run_inputs, size_of
from paraflex.designs.derivatives.stencil import STENCILS
from paraflex.designs.derivatives.steps import COMPLEX_STEP, complex_step, part
from paraflex.designs.run import Task, plan_task
from paraflex.dynamics import build_system, numbers_of
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition, SpanProperties, beam_integrals, mesh_beam, modal_basis
from paraflex.fem.assumed import AssumedShapes, Polynomial, Sine, assumed_integrals
from paraflex.fem.eigen import eigen_derivatives, eigenpairs
from paraflex.mechanism import AssumedModesBeam, Material, Section, raparm_i
from paraflex.paths import Circle, Line, Polygon
from paraflex.studies import load_sensitivities, sensitivities

STENCIL = STENCILS[0]
SCALES = ("density", "modulus", "joint_mass", "joint_inertia", "end_mass", "end_inertia")
STUDY = """
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++"]
duration = 0.03
samples = 7

[integration]
method = "tr-bdf2"
step = 2e-3
tolerance = 1e-11

[vary.density]
fields = ["material.aluminium.density"]

[vary.modulus]
fields = ["material.aluminium.youngs_modulus"]

[vary.joint_mass]
fields = ["lump.joint.mass"]

[vary.joint_inertia]
fields = ["lump.joint.inertia"]

[vary.end_mass]
fields = ["lump.end.mass"]

[vary.end_inertia]
fields = ["lump.end.inertia"]

[vary.arm]
fields = ["body.link1.length", "body.link1.points.B1"]

[vary.acceleration]
fields = ["path.line.max_acceleration"]
"""
NAMES = (*SCALES, "arm", "acceleration")


def cantilever(length=1.0, modulus=70e9, thickness=5e-3, density=2700.0, condition=ReferenceCondition.CANTILEVER):
    area, second = 0.03 * thickness, 0.03 * thickness**3 / 12.0
    span = SpanProperties(density * area, modulus * area, modulus * second)
    return beam_integrals(mesh_beam(length, {}, 4), [span], (), condition)


def elasticities(**moved):
    """Of the squares of frequencies, by one number of the cantilever."""
    ((name, value),) = moved.items()
    omega = modal_basis(cantilever(**{name: np.complex128(complex(value, COMPLEX_STEP * value))})).omega
    return part(omega**2) / omega.real**2


def test_frequencies_of_a_beam_by_its_numbers():
    """omega^2 goes with E / rho, of bending with (t / l^2)^2, of stretching with 1 / l^2: exactly, mesh and all."""
    assert elasticities(modulus=70e9) == pytest.approx(1.0, abs=1e-12)
    assert elasticities(density=2700.0) == pytest.approx(-1.0, abs=1e-12)
    by_thickness, by_length = elasticities(thickness=5e-3), elasticities(length=1.0)
    stretches = np.abs(by_thickness) < 0.5
    assert 0 < stretches.sum() < stretches.size
    assert by_thickness == pytest.approx(np.where(stretches, 0.0, 2.0), abs=1e-11)
    assert by_length == pytest.approx(np.where(stretches, -2.0, -4.0), abs=1e-11)


@pytest.mark.parametrize("condition", ReferenceCondition)
def test_every_reference_condition(condition):
    omega = modal_basis(cantilever(length=np.complex128(1.0 + 1j * COMPLEX_STEP), condition=condition)).omega
    near = [modal_basis(cantilever(length=1.0 + place, condition=condition)).omega for place in STENCIL.places]
    assert part(omega) == pytest.approx(STENCIL.derivative(near).value, rel=1e-10)


def test_soft_modes_are_as_exact_as_stiff_ones():
    """Against extended precision, though stiffnesses lie seven powers of ten apart."""
    body = build_system(raparm_i().with_beams(elements=8)).bodies[0].shape.integrals
    values, vectors = eigenpairs(body.K, body.Mff)
    assert values[-1] > 1e7 * values[0]
    K, M, X = (x.astype(np.longdouble) for x in (body.K, body.Mff, vectors))
    for _ in range(3):
        off, inside = np.eye(values.size) - X.T @ M @ X, X.T @ K @ X
        exact = np.diag(inside) / (1.0 - np.diag(off))
        gaps = exact - exact[:, None] + np.eye(values.size)
        mixing = (inside + off * exact) / gaps
        np.fill_diagonal(mixing, np.diag(off) / 2.0)
        X = X + X @ mixing
    if np.finfo(np.longdouble).eps < 1e-18:
        # Some thousand roundings; where only the stiffest mode is exact to rounding, the softest is to 2e-10.
        assert values == pytest.approx(exact.astype(float), rel=1e-12)
    assert vectors.T @ body.Mff @ vectors == pytest.approx(np.eye(values.size), abs=1e-12)


def test_eigenpairs_with_a_complex_step():
    """Their own equations, differentiated, hold; of one pair by hand."""
    rng = np.random.default_rng(5)
    A, B, dK, dM = rng.standard_normal((4, 6, 6))
    K, M, dK, dM = A @ A.T + 6.0 * np.eye(6), B @ B.T + 6.0 * np.eye(6), dK + dK.T, dM + dM.T
    values, V = eigenpairs(K + 1j * COMPLEX_STEP * dK, M + 1j * COMPLEX_STEP * dM)
    left = (K + 1j * COMPLEX_STEP * dK) @ V - (M + 1j * COMPLEX_STEP * dM) @ V * values
    assert np.abs(left.real).max() < 1e-12
    assert np.abs(part(left)).max() < 1e-11
    assert np.abs(part(V.T @ (M + 1j * COMPLEX_STEP * dM) @ V)).max() < 1e-12


def test_modes_of_one_frequency():
    """Uncoupled they have derivatives; where a parameter parts them they have none."""
    values, V = np.array([1.0, 1.0, 4.0]), np.eye(3)
    found, _ = eigen_derivatives(values, V, np.diag([1.0, 2.0, 3.0]), np.zeros((3, 3)))
    assert found == pytest.approx([1.0, 2.0, 3.0])
    coupled = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(InputError, match="two modes of one frequency separate"):
        eigen_derivatives(values, V, coupled, np.zeros((3, 3)))


def test_assumed_modes():
    def integrals(length):
        shapes = AssumedShapes(length, (Sine(1), Sine(2), Polynomial((0.0, 0.0, 1.0, -1.0))), (Polynomial((0.0, 1.0)),))
        return assumed_integrals(shapes, SpanProperties(0.4, 1e7, 20.0))

    found = modal_basis(integrals(np.complex128(0.5 + 1j * COMPLEX_STEP))).omega
    near = [modal_basis(integrals(0.5 + place)).omega for place in 0.25 * np.array(STENCIL.places)]
    assert part(found) == pytest.approx(4.0 * STENCIL.derivative(near).value, rel=1e-10)


def test_assumed_modes_in_a_system():
    bar = AssumedModesBeam("bar", 0.5, Section(1e-4, 1e-9), Material(70e9, 2700.0), (Sine(1), Sine(2)))
    stepped = with_fields(bar, length=np.complex128(0.5 + 1j * COMPLEX_STEP))
    assert np.iscomplexobj(stepped.integrals.K)
    assert part(stepped.integrals.m) == pytest.approx(0.27)


@pytest.mark.parametrize(
    ("path", "near"),
    [
        (Line((0.0, 0.0), (0.1, 0.2), 3.0), lambda s: Line((0.0, 0.0), (0.1 + s, 0.2), 3.0 + s)),
        (Polygon(((0.0, 0.0), (0.1, 0.0), (0.0, 0.2)), 3.0), lambda s: Polygon(((0.0, 0.0), (0.1, s), (0, 0.2)), 3.0)),
        (Circle((0.0, 0.1), 0.2, 3.0, sweep=-2.0), lambda s: Circle((s, 0.1), 0.2 + s, 3.0, sweep=-2.0 + s)),
    ],
)
def test_paths(path, near):
    stencil = STENCIL
    moved = complex_step(path, [near(place) for place in stencil.places], stencil).value
    # Far from the knots, over which differences must not reach.
    t = np.array([0.1, 0.3, 0.4]) * path.knots[1]
    found = np.stack(moved.evaluate(t))
    expected = stencil.derivative([np.stack(near(0.05 * place).evaluate(t)) for place in stencil.places]).value / 0.05
    assert part(found) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert found.real == pytest.approx(np.stack(path.evaluate(t)), rel=1e-13, abs=1e-16)


def test_what_is_no_number_must_not_change():
    near = [(1.0, 2.0)] * len(STENCIL.places)
    assert complex_step((1.0, 2.0), near, STENCIL).value == (1.0, 2.0)
    for other in ((1.0, 2.0, 3.0), [1.0, 2.0]):
        with pytest.raises(InputError, match="the number of pieces or elements changes"):
            complex_step((1.0, 2.0), [other] * len(STENCIL.places), STENCIL)  # pyright: ignore[reportArgumentType]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    file = tmp_path_factory.mktemp("study") / "study.toml"
    file.write_text(STUDY, encoding="utf-8")
    return load_sensitivities(file)


@pytest.mark.parametrize("name", NAMES)
def test_what_a_run_is_given(study, name):
    """Against differences of whole systems, plans and torques."""
    setting, k = study.setting, NAMES.index(name)
    task = Task(0, 0, nominal_values(setting), "line")
    planned, options = plan_task(setting, task)
    nominal = run_inputs(planned, options, planned.torques("++++"))
    size = size_of(setting, task, k)
    found = Change(setting, task, planned, k, size).of_mode(nominal)
    systems, torques, times = [], [], nominal.torques.times
    for place in STENCIL.places:
        values = list(task.values)
        values[k] += 0.125 * place * size
        near, _ = plan_task(setting, task._replace(values=tuple(values)))
        systems.append(numbers_of(build_system(near.mechanism, like=planned.system).packed))
        like = twins.feed_forward_like(near.plan, nominal.torques)
        torques.append(like.evaluate(like.times))
    here = numbers_of(planned.system.packed)
    expected = 8.0 * STENCIL.derivative(systems).value
    blocks = (twins.blocks_of(planned.system.packed, x) for x in (found.direction.packed, expected, here))
    for exact, difference, value in zip(*blocks, strict=True):
        size_of_block = max(np.abs(difference).max(initial=0.0), np.abs(value).max(initial=0.0))
        assert np.abs(exact - difference).max(initial=0.0) <= 5e-11 * size_of_block
    along = found.torques.evaluate(found.torques.times)
    expected = 8.0 * STENCIL.derivative(torques).value
    assert along.real == pytest.approx(nominal.torques.evaluate(times), abs=1e-12)
    assert part(along) == pytest.approx(expected, abs=1e-9 * max(np.abs(expected).max(), np.abs(along.real).max()))


def test_laws_of_scale(study):
    """All masses and stiffnesses grown alike leave the motion alone; forces, work and energies grow with them."""
    found = sensitivities(study)
    scaled = [found.parameters.index(name) for name in SCALES]
    total = dict(zip(found.metrics, found.relative[0][:, scaled].sum(axis=1), strict=True))
    # Metrics of less digits than others are differences of nearly equal positions.
    for name in ("tracking_rms", "tracking_max"):
        assert total[name] == pytest.approx(0.0, abs=1e-9)
    for name in ("deflection_max", "actuation_condition_max"):
        assert total[name] == pytest.approx(0.0, abs=1e-11)
    for name in ("peak_torque_max", "rms_torque_norm", "work", "kinetic_energy_max", "strain_energy_max", "total_mass"):
        # What these are divided by is the run's own, whose Newton iterations end at its tolerance.
        assert total[name] == pytest.approx(1.0, abs=1e-9), name
