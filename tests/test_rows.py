"""Rows of four-bars and chains of any number: against equations of one and two coordinates, and by name."""

import dataclasses
import json
import re
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import paraflex as pf
from paraflex.dynamics import build_system, consistent_state, start_state
from paraflex.errors import InputError, SingularPositionError
from paraflex.files import generator_names, library_text, load
from paraflex.integrators import METHODS, IntegrationOptions
from paraflex.integrators.methods import Family
from paraflex.kernel.linear import factor_system
from paraflex.kernel.near import NEAR_PART
from paraflex.kernel.packed import CONSTRAINT
from paraflex.mechanism import Motor, Start, chain_of_segments, finite_segments, four_bars_in_a_row
from paraflex.motion import simulate_motion
from shell import paraflex

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

from singular_passages import passage

MOVING = Start(angular={"crank0": -1.0})


def started(mechanism, start=MOVING):
    system = build_system(mechanism)
    return system, start_state(system, start, mechanism.assembly())


def crank_angle(n, times):
    """From the one-coordinate equation: J phi'' = -W cos phi, cranks about their pins, couplers moving with them."""
    J, W = (n + 1) / 3 + n, 9.81 * ((n + 1) / 2 + n)
    run = solve_ivp(
        lambda _, y: [y[1], -W * np.cos(y[0]) / J], (0.0, times[-1]), [np.pi / 2, -1.0],
        method="DOP853", rtol=1e-12, atol=1e-12, t_eval=times,
    )  # fmt: skip
    return run.y[0]


@pytest.mark.parametrize("n", [1, 2, 40])
def test_a_row_of_four_bars_falls_as_its_one_coordinate_says(n):
    system, start = started(four_bars_in_a_row(n))
    assert (system.n, system.m, len(system.bodies)) == (6 * n + 3, 6 * n + 2, 2 * n + 1)
    run = simulate_motion(
        system.mechanism, 0.65, samples=14, start=start, options=IntegrationOptions(tolerance=1e-6)
    ).solution
    exact = crank_angle(n, run.t)
    for body in system.bodies:
        expected = exact if body.name.startswith("crank") else np.zeros_like(exact)
        # The upright start is unstable: 0.65 s multiply an error by four.
        np.testing.assert_allclose(run.q[:, body.angle], expected, rtol=0, atol=5e-6)
    # Of some 15 joules a loop that come free.
    assert run.energy_balance_max < 4e-5 * n


def test_a_row_starts_as_the_benchmark_has_it():
    """Joints alone carry one crank's speed to all others: couplers translate at 1 m/s."""
    # So many that loops are closed with sparse matrices.
    for n in (3, 80):
        system, start = started(four_bars_in_a_row(n))
        for body in system.bodies:
            crank = body.name.startswith("crank")
            np.testing.assert_allclose(start.v[body.all], [0, 0, -1] if crank else [1, 0, 0], rtol=0, atol=1e-9)


def test_two_four_bars_meet_the_benchmark_through_all_singular_positions(capsys):
    """B0 at 10 s (computed from the one-coordinate equation; another program's published run agrees to 8e-7)."""
    system, start = started(four_bars_in_a_row(2))
    run = simulate_motion(
        system.mechanism, 10.0, samples=101, start=start, options=IntegrationOptions(tolerance=4e-6)
    ).solution
    phi = run.q[-1, system.body("crank0").angle]
    # The same at all tolerances from 1e-2 to 1e-6 m: an error of half to one and a half of it.
    np.testing.assert_allclose([np.cos(phi), np.sin(phi)], [0.328458111539, 0.944518538179], rtol=0, atol=1e-5)
    energy = run.kinetic_energy + run.strain_energy - run.work
    with capsys.disabled():
        print(f" drift of energy {energy[-1] - energy[0]:.1e} J, largest {run.energy_balance_max:.1e} J", end=" ")
    # Of some 70 J that come and go.
    assert run.energy_balance_max < 2e-5
    in_line = np.array(run.singular_positions)
    # Ten are met; a step that happens to straddle one passes it without more ado.
    assert 5 <= in_line.size <= 10
    np.testing.assert_allclose(np.cos(2 * crank_angle(2, in_line)), 1.0, rtol=0, atol=1e-5)
    # Nobody strays to another branch: cranks stay parallel, couplers level.
    cranks = run.q[:, [body.angle for body in system.bodies if body.name.startswith("crank")]]
    couplers = run.q[:, [body.angle for body in system.bodies if body.name.startswith("coupler")]]
    assert np.abs(cranks - cranks[:, :1]).max() < 1e-6
    assert np.abs(couplers).max() < 1e-6


def test_two_four_bars_to_1e_7_by_the_method_of_order_4():
    """The same numbers, through ten singular positions."""
    system, start = started(four_bars_in_a_row(2))
    run = simulate_motion(
        system.mechanism, 10.0, samples=2, start=start, method="esdirk4", options=IntegrationOptions(tolerance=1e-9)
    ).solution
    phi = run.q[-1, system.body("crank0").angle]
    np.testing.assert_allclose([np.cos(phi), np.sin(phi)], [0.328458111539, 0.944518538179], rtol=0, atol=1e-7)


# Runs that ended at a singular position, or had a thousand times the tolerance, while rows that depend on others were
# dropped there for a whole step; on one processor or another.
ONCE_LOST = [
    ("esdirk5", 2, 2.9614743996024773, 2.1416488619190514e-9),
    ("esdirk5", 2, 1.0, 6.0402435866691772e-10),
    ("esdirk4", 2, 1.4637997569242769, 1.6227040078768909e-9),
    ("esdirk5", 2, 1.0, 3.6e-9),
    ("esdirk3", 2, 2.0, 2.4e-4),
]


@pytest.mark.parametrize(("method", "n", "speed", "tolerance"), ONCE_LOST)
def test_a_passage_keeps_the_tolerance(method, n, speed, tolerance):
    run = passage(method, n, speed, tolerance)
    assert run.ratio is not None, run.failure
    assert run.ratio < 10.0


@pytest.mark.parametrize("method", [name for name, method in METHODS.items() if method.family is Family.ESDIRK])
def test_passages_keep_the_tolerance_wherever_steps_fall(method):
    """Speeds, tolerances and numbers of loops at random; `benchmarks/singular_passages.py` does so a thousand times."""
    rng = np.random.default_rng(7)
    for _ in range(12):
        n, speed, tolerance = int(rng.integers(1, 4)), rng.uniform(1.0, 3.0), 10.0 ** rng.uniform(-5.0, -2.0)
        run = passage(method, n, speed, tolerance, duration=4.0)
        assert run.ratio is not None, run.failure
        assert run.ratio < 10.0


def test_a_passage_takes_a_handful_of_steps():
    """Steps that shrank towards ten positions in line, and hardly grew again, were 76 thousand."""
    run = passage("esdirk5", 2, 1.0, 1e-6)
    assert run.steps < 5000


def test_an_index_3_method_says_which_position_it_does_not_pass():
    """All links are in line 0.7144 s after the start."""
    system, start = started(four_bars_in_a_row(2))
    with pytest.raises(SingularPositionError, match=r"singular position lies ahead.*newmark.*esdirk4") as caught:
        simulate_motion(
            system.mechanism, 10.0, samples=2, start=start, method="newmark",
            options=IntegrationOptions(tolerance=1e-3),
        )  # fmt: skip
    found = re.search(r"about t = ([\d.]+) s", str(caught.value))
    assert found
    assert caught.value.moment
    ahead = float(found.group(1))
    assert np.cos(2 * crank_angle(2, np.array([0.0, ahead]))[-1]) == pytest.approx(1.0, abs=1e-3)
    remaining = 0.7144 - caught.value.moment.time
    assert remaining > 0.0


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-5])
def test_singular_positions_are_passed_at_any_tolerance(tolerance):
    system, start = started(four_bars_in_a_row(7))
    run = simulate_motion(
        system.mechanism, 3.0, samples=31, start=start, options=IntegrationOptions(tolerance=tolerance)
    ).solution
    # A step of a coarse tolerance straddles one without more ado.
    assert (tolerance < 1e-4) <= len(run.singular_positions) <= 3
    exact = crank_angle(7, run.t)
    # An error of the upright start grows thirtyfold in a swing.
    np.testing.assert_allclose(run.q[:, system.body("crank3").angle], exact, rtol=0, atol=30 * tolerance)


def test_a_motor_works_through_a_singular_position():
    """A torque on the first crank; samples so dense that some fall where the multipliers have their pole."""
    row = four_bars_in_a_row(2)
    system, start = started(dataclasses.replace(row, motors=(Motor("drive", "A0"),), gravity=(0.0, 0.0)))
    run = simulate_motion(
        system.mechanism, 1.2, samples=4801, start=start, torques={"drive": -9.0},
        options=IntegrationOptions(tolerance=1e-7),
    ).solution  # fmt: skip
    # J phi'' = -9 N m with J = 3 kg m^2: from pi/2 at -1 rad/s.
    exact = 0.5 * np.pi - run.t - 1.5 * run.t**2
    np.testing.assert_allclose(run.q[:, system.body("crank0").angle], exact, rtol=0, atol=5e-6)
    np.testing.assert_allclose(run.v[:, system.body("crank2").angle], -1.0 - 3.0 * run.t, rtol=0, atol=2e-4)
    np.testing.assert_allclose(run.work, 9.0 * (0.5 * np.pi - exact), rtol=0, atol=5e-5)
    np.testing.assert_allclose(run.kinetic_energy, 1.5 * (1.0 + 3.0 * run.t) ** 2, rtol=1e-5)
    in_line = (np.sqrt(1.0 + 3.0 * np.pi) - 1.0) / 3.0
    missing = np.isnan(run.multipliers).any(axis=1)
    # A step may straddle the pole; one that ends beside it is told, and may be shorter than the samples are apart.
    assert run.singular_positions or not missing.any()
    np.testing.assert_allclose(run.singular_positions, in_line, rtol=0, atol=1e-3)
    assert np.all(np.abs(run.t[missing] - in_line) < 5e-3)


def test_a_chain_of_two_swings_as_a_double_pendulum_with_a_spring():
    length, mass, stiffness = 0.6, 1.4, 0.3
    mechanism = chain_of_segments(2, length=length, mass=mass, bending_stiffness=stiffness, angle=-0.4)
    l, m, k, g = length / 2, mass / 2, stiffness / (length / 2), 9.81

    def rates(_, y):
        a, b, da, db = y
        c, s = np.cos(a - b), np.sin(a - b)
        M = m * l**2 * np.array([[4 / 3, c / 2], [c / 2, 1 / 3]])
        force = [
            -m * l**2 / 2 * s * db**2 - 1.5 * m * g * l * np.cos(a) - k * (a - b),
            m * l**2 / 2 * s * da**2 - 0.5 * m * g * l * np.cos(b) + k * (a - b),
        ]
        return [da, db, *np.linalg.solve(M, force)]

    times = np.linspace(0.0, 1.0, 21)
    exact = solve_ivp(rates, (0.0, 1.0), [-0.4, -0.4, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=times)
    run = simulate_motion(mechanism, 1.0, samples=21, options=IntegrationOptions(tolerance=1e-6))
    for body, angle in zip(run.system.bodies, exact.y, strict=False):
        np.testing.assert_allclose(run.solution.q[:, body.angle], angle, rtol=0, atol=1e-5)
    assert np.ptp(exact.y[0] - exact.y[1]) > 0.1


def test_many_segments_approach_the_cable():
    """The tip of 40 segments after a tenth of a second against that of 80: of second order in the length of one."""
    tips = []
    for n in (10, 20, 40):
        run = simulate_motion(chain_of_segments(n), 0.3, samples=2, options=IntegrationOptions(tolerance=1e-6))
        q, last = run.solution.q[-1], run.system.body(f"segment{n}")
        phi = q[last.angle]
        tips.append(q[last.position] + np.array([np.cos(phi), np.sin(phi)]) / n)
    coarse, fine = (np.linalg.norm(b - a) for a, b in pairwise(tips))
    assert 3.0 < coarse / fine < 5.0


def test_rows_of_stiff_springs_are_not_taken_for_a_singular_position():
    # The longer a step, the less a spring between segments gives beside their inertia; it always gives something.
    system = build_system(finite_segments(pf.library.raparm_i(), 16).mechanism)
    q = consistent_state(system, system.mechanism.assembly()).q
    least = []
    for b in (1e-14, 1e-8):
        workspace = system.workspace()
        factor_system(system.packed, b, q, workspace)
        least.append(workspace.least[0])
        assert system.packed.rows["kind"][int(workspace.least[1])] == CONSTRAINT
    assert least[1] > NEAR_PART * least[0]


@pytest.mark.parametrize(("name", "make"), [("four_bars:3", four_bars_in_a_row), ("chain:3", chain_of_segments)])
def test_a_name_with_a_number_is_a_model(name, make):
    model = load(name)
    assert model.mechanism == make(3)
    assert model.source == name
    assert (model.start == MOVING) == (name == "four_bars:3")
    assert set(tomllib.loads(library_text(name))) <= set(json.loads(paraflex("schema").stdout)["properties"])


@pytest.mark.parametrize("name", ["four_bars", "four_bars:", "four_bars:0", "four_bars:-1", "four_bars:1e3", "chain:²"])
def test_a_name_without_a_number_that_counts_is_refused(name):
    with pytest.raises(InputError, match=r"mechanism: a mechanism of how many (loops|segments)\? .*write (four_b|ch)"):
        load(name)
    with pytest.raises(InputError, match="at most four_bars:100000"):
        load("four_bars:100001")


def test_names_with_numbers_are_told():
    assert generator_names() == ["four_bars:N", "chain:N"]
    with pytest.raises(InputError, match='did you mean "four_bars:N"'):
        load("fourbars:3")


def test_python_refuses_none_of_them():
    with pytest.raises(InputError, match=r"loops: at least one is needed \(got 0\)"):
        pf.library.four_bars_in_a_row(0)
    with pytest.raises(InputError, match=r"segments: at least one is needed"):
        pf.library.chain_of_segments(0)


def test_a_row_from_the_command_line(tmp_path):
    done = paraflex("run", "-m", "four_bars:3", "--duration", "0.3", "--tol", "1e-6", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    pin = json.loads(done.stdout)["final"]["point_position"]["crank0.B"]
    phi = crank_angle(3, np.array([0.3]))[-1]
    np.testing.assert_allclose(pin, [np.cos(phi), np.sin(phi)], rtol=0, atol=1e-5)
    done = paraflex("new", "mine", "--from", "four_bars:2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert load(tmp_path / "mine.toml").mechanism.bodies == four_bars_in_a_row(2).bodies
