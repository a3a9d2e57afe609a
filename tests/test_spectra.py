"""Characteristic roots: closed forms, published limits, and what `integrate` really does to an oscillator."""

from pathlib import Path

import numpy as np
import pytest
import scipy.integrate

from paraflex.dynamics import build_system, consistent_state, pack_signals
from paraflex.errors import InputError
from paraflex.integrators import METHODS, IntegrationOptions, integrate
from paraflex.integrators.method import NativeMethod
from paraflex.integrators.methods import HHT, GeneralisedAlpha, Newmark, Wilson
from paraflex.integrators.spectra import multistep_formula, spectrum, stability, tableau_of, wilson_step
from paraflex.mechanism import Assembly, Mechanism, PointRef, RevoluteJoint, RigidBody, TorsionalSpring

NATIVE = [name for name, method in METHODS.items() if isinstance(method, NativeMethod)]
FREQUENCIES = np.geomspace(1e-2, 1e3, 40)


def test_tr_bdf2_is_its_two_formulas_in_turn():
    """The trapezoidal rule to gamma h, then the second backward difference over the three points."""
    gamma = 2.0 - np.sqrt(2.0)
    z = 1j * FREQUENCIES
    middle = (1.0 + 0.5 * gamma * z) / (1.0 - 0.5 * gamma * z)
    weight = 1.0 / (gamma * (2.0 - gamma))
    end = (weight * middle - (1.0 - gamma) ** 2 * weight) / (1.0 - (1.0 - gamma) / (2.0 - gamma) * z)
    found = spectrum("tr-bdf2", FREQUENCIES)
    # Rounding, as a step's equations have entries up to its square beside one.
    assert np.all(np.abs(found.principal - end) < 1e-15 * (4.0 + FREQUENCIES))
    assert np.all(found.radius < 1.0 + 1e-14)
    # L-stable: |R| falls like 1/z.
    assert found.radius[-1] < 10.0 / FREQUENCIES[-1]


@pytest.mark.parametrize(("method", "order"), [(Newmark(gamma=0.5), None), ("adams", 2), ("trapezoidal", None)])
def test_the_trapezoidal_rule_only_lengthens_the_period(method, order):
    found = spectrum(method, FREQUENCIES, order=order)
    assert np.abs(found.principal) == pytest.approx(np.ones(40), abs=1e-9)
    assert found.radius == pytest.approx(np.ones(40), abs=1e-9)
    assert found.period_error == pytest.approx(FREQUENCIES / (2.0 * np.arctan(FREQUENCIES / 2.0)) - 1.0, abs=1e-9)


@pytest.mark.parametrize("radius", [0.0, 0.3, 0.7, 1.0])
def test_generalised_alpha_has_the_radius_it_was_asked_for(radius):
    found = spectrum(GeneralisedAlpha(spectral_radius=radius), FREQUENCIES * 1e4)
    # Three roots meet there, which a small change drives apart by its cube root.
    assert found.radius[-1] == pytest.approx(radius, abs=1e-3)
    assert np.all(found.radius < 1.0 + 1e-9)


@pytest.mark.parametrize("alpha", [-1.0 / 3.0, -0.1])
def test_hht_keeps_what_hilber_hughes_and_taylor_say(alpha):
    found = spectrum(HHT(alpha=alpha), [1e-2, 1e6])
    assert found.radius[-1] == pytest.approx((1.0 + alpha) / (1.0 - alpha), abs=1e-3)
    # Order two, so that damping is of third order in h omega.
    assert found.damping_ratio[0] < 1e-6


def test_newmark_with_a_large_gamma_damps_in_proportion_to_the_step():
    low = spectrum("newmark", [1e-3, 1e-2])
    assert low.damping_ratio == pytest.approx(0.5 * (0.6 - 0.5) * low.frequency, rel=1e-2)
    assert spectrum("newmark", [1e6]).radius[0] == pytest.approx((1.5 - 0.6) / (0.6 + 0.5), abs=1e-5)


def test_wilson_is_stable_from_1_366_on():
    def radius(theta):
        return max(np.max(np.abs(np.linalg.eigvals(wilson_step(x, theta)))) for x in np.geomspace(0.1, 1e4, 60))

    assert radius(1.36) > 1.0 + 1e-3
    assert radius(0.5 * (1.0 + np.sqrt(3.0)) + 1e-9) < 1.0 + 1e-6
    # Bathe (1996), Fig. 9.4: theta = 1.4 lengthens the period of 20 steps a period by 5 %.
    usual = spectrum(Wilson(theta=1.4), [2.0 * np.pi / 20.0])
    assert usual.period_error[0] == pytest.approx(0.02, abs=0.01)


def test_bdf2_has_the_roots_of_its_quadratic():
    found = spectrum("bdf", FREQUENCIES, order=2)
    exact = (2.0 + np.sqrt(1.0 + 2j * FREQUENCIES)) / (3.0 - 2j * FREQUENCIES)
    assert found.principal == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
def test_ndf_is_scipys(order):
    solver = scipy.integrate.BDF(lambda t, y: -y, 0.0, [1.0], 1.0)
    values, _ = multistep_formula(METHODS["ndf"], order)
    # alpha = (1 - kappa) gamma is what multiplies the newest value there.
    assert values[0] == pytest.approx(solver.alpha[order], rel=1e-12)
    gear, _ = multistep_formula(METHODS["bdf"], order)
    assert gear[0] == pytest.approx(solver.gamma[order], rel=1e-12)


def test_backward_differences_beyond_order_two_blow_vibrations_up():
    """Dahlquist's barrier: at order two nothing grows, at order three and more some frequencies do."""
    for method in ("bdf", "ndf", "ida"):
        assert np.max(spectrum(method, FREQUENCIES, order=2).radius) < 1.0 + 1e-12
        assert np.max(spectrum(method, FREQUENCIES, order=5).radius) > 1.1


@pytest.mark.parametrize(
    ("order", "weights"), [(1, [1.0]), (3, [5 / 12, 8 / 12, -1 / 12]), (4, [9 / 24, 19 / 24, -5 / 24, 1 / 24])]
)
def test_adams_weights(order, weights):
    _, rates = multistep_formula(METHODS["adams"], order)
    assert rates[: len(weights)] == pytest.approx(weights, abs=1e-14)


def test_radau_is_the_pade_approximant_and_runge_kutta_a_polynomial():
    for x in (0.1, 1.0, 30.0):
        z = 1j * x
        pade = (1.0 + 0.4 * z + z**2 / 20.0) / (1.0 - 0.6 * z + 0.15 * z**2 - z**3 / 60.0)
        assert stability(*tableau_of(METHODS["radau"]), z) == pytest.approx(pade, rel=1e-12)
    z = 0.7j
    series = sum(z**k / np.prod(np.arange(1.0, k + 1.0)) for k in range(6)) + z**6 / 600.0
    assert stability(*tableau_of(METHODS["rk45"]), z) == pytest.approx(series, abs=1e-14)


@pytest.mark.parametrize(
    ("method", "order", "expected"),
    [("tr-bdf2", None, 2), ("generalised-alpha", None, 2), ("wilson-theta", None, 2), ("hht-alpha", None, 2),
     ("bdf", 3, 3), ("ndf", 3, 3), ("adams", 4, 4), ("rk45", None, 5), ("radau", None, 5)],
)  # fmt: skip
def test_the_root_follows_the_true_one_to_the_order(method, order, expected):
    x = np.array([0.1, 0.2])
    errors = np.abs(spectrum(method, x, order=order).principal - np.exp(1j * x))
    assert np.log2(errors[1] / errors[0]) == pytest.approx(expected + 1, abs=0.2)


def test_decay_and_damping_ratio_say_the_same():
    found = spectrum("tr-bdf2", [0.5])
    steps = 2.0 * np.pi / found.phase[0]
    assert found.amplitude_decay[0] == pytest.approx(1.0 - np.abs(found.principal[0]) ** steps, rel=1e-10)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("bdf2", [0.1]), "unknown method"),
        (("bdf", [0.1]), "needs an order"),
        (("bdf", [0.1], 6), "from 1 to 5"),
        (("tr-bdf2", [0.1], 2), "one order only"),
        (("tr-bdf2", [0.2, 0.1]), "ascend"),
        (("tr-bdf2", []), "ascend"),
    ],
)
def test_bad_input(arguments, says):
    method, frequency, *order = arguments
    with pytest.raises(InputError, match=says):
        spectrum(method, frequency, order=order[0] if order else None)


def test_the_page_has_a_row_for_every_method(monkeypatch):
    docs = Path(__file__).parents[1] / "docs"
    monkeypatch.syspath_prepend(str(docs / "hooks"))
    from methods import on_page_markdown

    page = type("Page", (), {"file": type("File", (), {"src_uri": "integrators.md"})})
    lines = on_page_markdown((docs / "integrators.md").read_text(encoding="utf-8"), page).splitlines()
    rows = [[cell.strip(" `") for cell in line.split("|")[1:-1]] for line in lines if line.startswith("| `")]
    rows = {row[0]: row[1:] for row in rows if len(row) == 8}
    assert list(rows) == list(METHODS)
    # What is known of them from books: nothing is lost, nothing is left, what is asked for, no stable step.
    assert rows["trapezoidal"][4:] == ["0 %", "0.82 %", "1"]
    assert rows["generalised-alpha"] == [
        "GeneralisedAlpha(spectral_radius=0.7)", "Newmark", "index 3", "2", "0.052 %", "0.93 %", "0.7",
    ]  # fmt: skip
    assert {rows[name][6] for name in ("tr-bdf2", "esdirk5", "radau", "bdf", "ndf")} == {"0"}
    assert [rows[name][6] for name in ("rk45", "adams")] == ["> 1", "> 1"]
    assert rows["bdf"][3:5] == ["1 to 5", "4 % (order 2)"]


def oscillator(omega: float) -> Mechanism:
    """A disc on a torsional spring, hinged at its centre of mass."""
    return Mechanism(
        name="disc on a spring",
        ground={"O": (0.0, 0.0)},
        bodies=(RigidBody("disc", mass=2.0, inertia=0.5, points={"O": (0.0, 0.0)}),),
        joints=(RevoluteJoint("hinge", PointRef("ground", "O"), PointRef("disc", "O")),),
        springs=(TorsionalSpring("spring", "hinge", stiffness=0.5 * omega**2),),
        assemblies=(Assembly("turned", {"disc": 0.1}),),
    )


@pytest.mark.parametrize("x", [0.2, 0.8])
@pytest.mark.parametrize("method", NATIVE)
def test_a_run_of_even_steps_decays_as_the_spectrum_says(method, x):
    """The root of a real run, from angles at the ends of its steps; nothing of it knows the amplification matrix."""
    step, steps = 0.01, 240
    system = build_system(oscillator(x / step))
    times = step * np.arange(steps + 1)
    signals, _ = pack_signals(system.mechanism, [], times[-1])
    # A tolerance that only says how exactly Newton's iteration solves.
    even = IntegrationOptions(method=method, step=step, tolerance=1e-10)
    state = consistent_state(system, system.mechanism.assembly())
    angle = integrate(system, signals, state, times, options=even).q[60:, 2]
    # x_{n+2} = 2 Re(root) x_{n+1} - |root|^2 x_n, once other roots have died away.
    (twice, less), *_ = np.linalg.lstsq(np.column_stack([angle[1:-1], -angle[:-2]]), angle[2:], rcond=None)
    root = 0.5 * twice + 1j * np.sqrt(less - 0.25 * twice**2)
    expected = spectrum(method, [x]).principal[0]
    assert root == pytest.approx(complex(expected.real, abs(expected.imag)), abs=1e-6)
