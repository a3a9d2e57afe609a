"""Runs with few flexible coordinates: how they are chosen, how far off the runs are, and where all of it is said."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

import paraflex as pf
from paraflex.dynamics import build_system
from paraflex.dynamics.completed import Completion
from paraflex.dynamics.joint_coordinates import joint_coordinate
from paraflex.dynamics.points import marker_place
from paraflex.dynamics.sparse import sparse_mass, stiffness_diagonal
from paraflex.dynamics.state import State, carried, nearest_state
from paraflex.errors import InputError
from paraflex.files.profiles import ExpressionProfile
from paraflex.reduced_bodies import mechanism as reducing
from paraflex.reduced_bodies.planned import PlannedDeflections
from paraflex.results import load_results
from paraflex.tracking import undeformed_at
from shell import paraflex

MODES = ("+-+-", "-+-+", "+--+", "+++-", "++-+", "++++")


@pytest.fixture(scope="module")
def arm():
    return (
        pf.load("raparm_i").mechanism.with_geometry("second-order").with_beams(reference="pinned", curvature="separate")
    )


@pytest.fixture(scope="module")
def task(arm):
    return pf.plan(arm, pf.load("raparm_i").paths["square"], duration=0.7)


@pytest.fixture(scope="module")
def full(task):
    return task.simulate("++++", warning=False)


def study(task, reduced, modes):
    return pf.run_study(task.remodelled(reduced), modes, full=task, warning=False)


def off(data, mode):
    """Deviation of the tracking error from the full run's, and of points over that error."""
    run = data.sel(mode=mode)
    exact = run["full_tracking_rms"].item()
    return run["tracking_rms"].item() - exact, run["reduction_distance"].item() / exact


def admissible(system, rows):
    """A basis (n, free) of the displacements that rows allow, stiff coordinates scaled down."""
    scale = 1.0 / np.sqrt(1.0 + stiffness_diagonal(system) / 1e4)
    return scale[:, None] * scipy.linalg.null_space(rows * scale, rcond=1e-10)


def check_deflections(system, found, expected):
    for body in system.bodies:
        size = np.max(np.abs(expected[body.flexible]))
        np.testing.assert_allclose(found[body.flexible], expected[body.flexible], atol=1e-4 * size)


# --- How coordinates are chosen ---------------------------------------------------------------------------------------


def test_planned_deflections_are_those_of_links_held_by_two_motors(task):
    """Two motors for supports, which bear nothing as the forces are in balance; forces by differences of energies."""
    system, planned = task.system, PlannedDeflections(task, 12)
    found = planned.under(planned.loading(task.mode("+-+-")))
    samples = planned.samples
    for k in (0, 5):
        q, v, a = undeformed_at(system, task.motion, samples[k])
        mass = sparse_mass(system, q).toarray()
        # h = M' v - d(v^T M v / 2)/dq, by differences of the mass matrix.
        step = 1e-6
        slopes = np.array(
            [
                (sparse_mass(system, q + step * row).toarray() - sparse_mass(system, q - step * row).toarray())
                / (2.0 * step)
                for row in np.eye(system.n)
            ]
        )
        h = np.einsum("kij,k,j->i", slopes, v, v) - 0.5 * np.einsum("kij,i,j->k", slopes, v, v)
        joints = [joint_coordinate(system, name, q[None]).rows[0] for name in ("A1", "D1", "A2", "D2")]
        torques = task.torques("+-+-").evaluate(task.motion.t[samples[k] : samples[k] + 1])[0]
        forces = -(mass @ a + h) + torques @ np.array(joints)
        held = admissible(system, np.vstack([system.jacobian(q), joints[0], joints[2]]))
        stiffness = held.T @ (stiffness_diagonal(system)[:, None] * held)
        expected = held @ np.linalg.solve(stiffness, held.T @ forces)
        check_deflections(system, found[k], expected)


def test_deflections_of_the_end_effector_are_balanced_by_free_motion(task):
    """The sum over all modes but the two that are free."""
    system, planned = task.system, PlannedDeflections(task, 12)
    q = undeformed_at(system, task.motion, planned.samples[3])[0]
    free = admissible(system, system.jacobian(q))
    mass, stiffness = sparse_mass(system, q).toarray(), np.diag(stiffness_diagonal(system))
    squares, shapes = scipy.linalg.eigh(free.T @ stiffness @ free, free.T @ mass @ free)
    elastic = free @ shapes[:, 2:]
    row = marker_place(system, system.marker(task.mechanism.end_effector.point), q[None])[1][0, 0]
    found = planned.of_end_effector()
    expected = elastic @ ((elastic.T @ row) / squares[2:])
    check_deflections(system, found[6], expected)


def test_of_two_directions_the_one_with_more_strain_energy_is_kept(task):
    """Deflections of known energies in single modes: the order of the energies is the order in which they are kept."""
    system = task.system
    link, other = system.body("link1"), system.body("link4")
    deflections = np.zeros((3, system.n))
    for k, (body, mode, energy) in enumerate([(link, 2, 9.0), (other, 0, 4.0), (link, 5, 1.0)]):
        deflections[k, body.offset + 3 + mode] = np.sqrt(energy) / body.modes.omega[mode]
    found = reducing._directions(system, deflections)
    kept = {name: np.array(rows) for name, rows in reducing._bases(system, found[:2]).items()}
    assert {name: rows.shape[1] for name, rows in kept.items() if rows.size} == {"link1": 1, "link4": 1}
    for body, mode in ((link, 2), (other, 0)):
        shape = kept[body.name][:, 0]
        assert np.abs(shape / np.linalg.norm(shape)) == pytest.approx(
            np.abs(body.modes.vectors[:, mode] / np.linalg.norm(body.modes.vectors[:, mode])), abs=1e-9
        )


def test_all_coordinates_are_the_whole_mechanism(arm, task, full):
    rng = np.random.default_rng(3)
    system = task.system
    found = reducing._directions(system, rng.standard_normal((40, system.n)))
    whole = replace(arm, bases=reducing._bases(system, found[: system.n_flexible]))
    assert [body.nf for body in build_system(whole).bodies] == [body.nf for body in system.bodies]
    run = task.remodelled(whole).simulate("++++", warning=False)
    errors = [pf.tracking_dataset([one])["tracking_rms"].item() for one in (run, full)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-3)


# --- How far off runs are ---------------------------------------------------------------------------------------------


def test_sixteen_coordinates_of_raparm_i(task):
    data = study(task, pf.reduced_mechanism(task, 16, modes=MODES), MODES).data
    sizes = [
        data.attrs[name] for name in ("flexible_coordinates", "states", "full_flexible_coordinates", "full_states")
    ]
    assert sizes == [16, 36, 90, 184]
    for mode, far in zip(MODES, (5e-5, 5e-6, 5e-5, 1e-5, 1e-5, 2e-6), strict=True):
        error, distance = off(data, mode)
        assert abs(error) < far
        assert distance < 0.05
    # Steps and coordinates are fewer. Times depend on the machine, and steps of a single mode on rounding.
    assert data["steps"].sum() < data["full_steps"].sum()
    assert not [code for code in codes(data) if code == "reduced-too-far"]


def codes(data):
    return [one["code"] for one in json.loads(data.attrs["findings"])]


def test_so_it_is_by_proper_orthogonal_decomposition_of_a_run(task, full):
    data = study(task, pf.reduced_mechanism(full, 16), ["++++"]).data
    error, distance = off(data, "++++")
    assert abs(error) < 2e-6
    assert distance < 0.02


def test_more_coordinates_are_nearer_and_too_few_are_said(task, full):
    errors = []
    for count in (2, 14, 24):
        data = study(task, pf.reduced_mechanism(full, count), ["++++"]).data
        errors.append(off(data, "++++")[1])
        assert ("reduced-too-far" in codes(data)) is (errors[-1] > 0.1)
    assert errors[0] > 0.1 > errors[1] > 3.0 * errors[2]


def test_linear_models_and_statics_take_such_a_mechanism(arm, task):
    few = pf.reduced_mechanism(task, 16, modes=MODES)
    model, exact = (pf.linearise(each, mode="+-+-") for each in (few, arm))
    assert (len(model.states), len(exact.states)) == (36, 184)
    assert model.held_frequencies()[:2] == pytest.approx(exact.held_frequencies()[:2], rel=2e-5)
    assert model.frequencies[2:4] == pytest.approx(exact.frequencies[2:4], rel=1e-4)
    load = {"loads": {"link4.C.y": 10.0}, "steps": 1}
    travel, right = (pf.statics(each, **load).travel("link4.C.y")[-1] for each in (few, arm))
    assert travel == pytest.approx(right, rel=1e-3)


def test_beams_of_the_paper_too(tmp_path):
    model = pf.load("raparm_i")
    task = pf.plan(model, "square", duration=0.7)
    data = study(task, pf.reduced_mechanism(task, 16, modes=["++++"]), ["++++"]).data
    assert abs(off(data, "++++")[0]) < 5e-6


def test_beams_in_several_frames_are_reduced_part_by_part():
    arm = pf.load("five_bar").mechanism
    task = pf.plan(arm.with_bodies(replace(body, frames=2) for body in arm.bodies), pf.load("five_bar").paths["line"])
    few = pf.reduced_mechanism(task, 10)
    assert set(few.bases) == {body.name for body in task.system.bodies}
    data = study(task, few, ["++"]).data
    assert off(data, "++")[1] < 0.1


def test_the_nearest_state_of_few_coordinates():
    model = pf.load("slider_crank_flexible")
    run = pf.simulate_motion(model, 0.02, samples=21, warning=False)
    few = build_system(pf.reduced_mechanism(run, 2))
    start = State(0.0, run.solution.q[0], run.solution.v[0])
    near = nearest_state(few, run.system, start)
    phi, rate = few.constraints(*signals_at(few), near.q, near.v)
    assert few.gap(phi) < 1e-9
    assert np.max(np.abs(rate)) < 1e-9
    # Of all coordinates it is the state itself.
    same = nearest_state(run.system, run.system, start)
    np.testing.assert_allclose(same.q, start.q, atol=1e-12)


def signals_at(system):
    from paraflex.dynamics.signals import moment_signals

    return moment_signals(system.mechanism, 0.0), 0.0


# --- The command, files and studies -----------------------------------------------------------------------------------


def test_the_command_says_how_far_off_it_is(tmp_path):
    done = paraflex("run", "--no-figures", "five_bar", "--reduced", "14", "--out", "r", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "14 of 52 flexible coordinates, 32 of 108 states" in " ".join(done.stdout.split())
    numbers = json.loads((tmp_path / "r" / "summary.json").read_text())["modes"]["++"]
    data = load_results(tmp_path / "r" / "results.nc").sel(mode="++")
    reduction = numbers["reduction"]
    assert reduction["distance"] == data["reduction_distance"].item() < 0.05 * numbers["tracking_rms_motion"]
    assert reduction["full_tracking_rms_motion"] == pytest.approx(numbers["tracking_rms_motion"], rel=0.02)
    assert (reduction["flexible_coordinates"], reduction["full_flexible_coordinates"]) == (14, 52)
    page = (tmp_path / "r" / "report.html").read_text()
    assert "Reduced bodies" in page
    assert "--reduced 14" in page


def test_a_motion_without_a_path_takes_what_its_own_run_shows(tmp_path):
    done = paraflex("run", "slider_crank_flexible", "--reduced", "2", "--out", "r", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    numbers = json.loads((tmp_path / "r" / "summary.json").read_text())
    # The tolerance of each of the two runs is 1e-5 m; two shapes are left out.
    assert numbers["reduction"]["distance"] < 2.5e-5
    assert (numbers["reduction"]["states"], numbers["reduction"]["full_states"]) == (4, 8)
    assert "2 of 4 flexible coordinates, 4 of 8 states: points are up to" in done.stdout
    assert "Reduced bodies" in (tmp_path / "r" / "report.html").read_text()


@pytest.fixture(scope="module")
def reduced_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reduced")
    text = pf.library.text("five_bar").replace("[study]", "[study]\nreduced = 10", 1)
    (folder / "few.toml").write_text(text, encoding="utf-8")
    return folder


def test_a_study_may_say_it(reduced_file):
    done = paraflex("run", "--no-figures", "few.toml", "--json", "--no-report", "--out", "a", cwd=reduced_file)
    assert json.loads(done.stdout)["modes"]["++"]["reduction"]["flexible_coordinates"] == 10
    done = paraflex(
        "run", "--no-figures", "few.toml", "--reduced", "0", "--json", "--no-report", "--out", "b", cwd=reduced_file
    )
    assert "reduction" not in json.loads(done.stdout)["modes"]["++"]


def test_sweeps_take_few_coordinates_anew_for_each_design(reduced_file):
    sweep = 'mechanism = "{}"\npaths = ["line"]\nmetrics = ["tracking_rms"]\n[vary.thickness]\n' \
            'fields = ["section.bar.thickness"]\nvalues = [0.004, 0.006]\n'  # fmt: skip
    errors = []
    for name in ("few.toml", "five_bar"):
        file = reduced_file / f"sweep_{name}.toml"
        file.write_text(sweep.format(name), encoding="utf-8")
        table = pf.sweep(file, reduced_file / f"out_{name}", workers=1).data
        assert set(table["status"].values.ravel()) == {"complete"}
        errors.append(table["tracking_rms"].values.ravel())
    assert errors[0] == pytest.approx(errors[1], rel=0.02)
    assert not np.array_equal(*errors)


def refusal(folder, *words):
    done = paraflex(*words, "--out", "no", cwd=folder)
    assert done.returncode == 2
    assert not (folder / "no").exists()
    (line,) = done.stderr.splitlines()
    return line


def test_what_cannot_be_reduced_is_said_in_a_line(tmp_path, reduced_file, task, full):
    assert refusal(tmp_path, "run", "five_bar", "--reduced", "53").endswith(
        "--reduced: no such number of flexible coordinates (got 53); from 1 to 52"
    )
    assert "--reduced: has no effect with --rigid" in refusal(tmp_path, "run", "raparm_i", "--rigid", "--reduced", "4")
    assert "--reduced: has rigid bodies only" in refusal(tmp_path, "run", "slider_crank", "--reduced", "4")
    text = (reduced_file / "few.toml").read_text().replace("reduced = 10", "reduced = -1")
    (tmp_path / "bad.toml").write_text(text)
    assert "study.reduced: no such number of flexible coordinates (got -1)" in refusal(tmp_path, "run", "bad.toml")
    derived = 'mechanism = "few.toml"\npaths = ["line"]\nmetrics = ["tracking_rms"]\n[vary.thickness]\n' \
              'fields = ["section.bar.thickness"]\n'  # fmt: skip
    (reduced_file / "derived.toml").write_text(derived)
    with pytest.raises(InputError, match=r"study.reduced: derivatives need runs with all .*craig-bampton"):
        pf.sensitivities(reduced_file / "derived.toml")
    with pytest.raises(InputError, match="are not of one mechanism"):
        pf.reduced_mechanism([full, pf.load("five_bar").plan().simulate("++", warning=False)])
    with pytest.raises(InputError, match="modes: are those of the runs"):
        pf.reduced_mechanism(full, modes=["++++"])
    few = pf.reduced_mechanism(task, 16, modes=["++++"])
    with pytest.raises(InputError, match=r"bases: .* write reduced = N in its \[study\]"):
        few.save(tmp_path / "few.toml")
    with pytest.raises(InputError, match=r"bases\.link1: has shapes in 13 coordinates, and the body 25"):
        build_system(few.with_beams(elements=6))


def test_a_sweep_of_a_motion_without_a_path_cannot_choose(tmp_path):
    text = pf.library.text("slider_crank_flexible").replace("[study]", "[study]\nreduced = 2", 1)
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    (tmp_path / "sweep.toml").write_text(
        'mechanism = "own.toml"\nmetrics = ["joint_force_max"]\n[vary.width]\nfields = ["parameters.width"]\n'
        "values = [0.008]\n"
    )
    with pytest.raises(InputError, match=r"study\.reduced: few flexible coordinates are chosen from a planned path"):
        pf.sweep(tmp_path / "sweep.toml", tmp_path / "out")


# --- As few coordinates as the tolerance allows -----------------------------------------------------------------------

# Of every mechanism of the library with flexible links and a path.
LIBRARY = (
    ("raparm_i", "square", "+-+-"), ("raparm_i", "square", "-+-+"), ("raparm_i", "square", "++++"),
    ("raparm_i", "line", "-+-+"), ("raparm_ii", "square", "+--+"), ("raparm_ii", "line", "-+++"),
    ("3rrr", "square", "++++++"), ("3rrr", "circle", "++-+--"), ("4rrr", "square", "++-+"), ("4rrr", "circle", "++++"),
    ("five_bar", "square", "++"), ("five_bar", "line", "++"), ("3prr", "circle", "+++"),
    ("geared_five_bar", "stroke", "+-"),
)  # fmt: skip


@pytest.mark.parametrize(("name", "path", "mode"), LIBRARY)
def test_as_few_coordinates_as_the_tolerance_allows(name, path, mode):
    """Three tolerances are allowed; all modes are in `benchmarks/reduced_runs.py`."""
    model = pf.load(name)
    mechanism = model.mechanism.with_geometry("second-order")
    task = pf.plan(mechanism, model.paths[path], duration=model.study.duration)
    tolerance = model.study.integration().tolerance_for(task.system)
    chosen = pf.planned_reduction(task, tolerance, modes=[mode])
    few = task.remodelled(chosen.mechanism)
    assert chosen.deviation <= tolerance
    assert few.system.n_flexible < 0.4 * task.system.n_flexible
    options = pf.IntegrationOptions(method="esdirk5", tolerance=tolerance / 10.0)
    runs = [pf.tracking_dataset([each.simulate(mode, options=options, warning=False)]) for each in (few, task)]
    apart = np.linalg.norm(runs[0]["end_effector"].values - runs[1]["end_effector"].values, axis=-1)
    # Near singular positions of the motors, as in +-+-, deviations are magnified.
    assert np.max(apart) < (3.0 if mode == "+-+-" else 1.5) * tolerance


def test_the_estimated_deviation_falls_with_the_coordinates_that_it_asks_for(task):
    found = [pf.planned_reduction(task, deviation, modes=["++++"]) for deviation in (1e-3, 1e-4, 1e-5, 1e-6)]
    counts = [build_system(one.mechanism).n_flexible for one in found]
    assert counts == sorted(set(counts))
    assert all(one.deviation <= deviation for one, deviation in zip(found, (1e-3, 1e-4, 1e-5, 1e-6), strict=True))
    # Of several modes the worst counts.
    both = pf.planned_reduction(task, 1e-4, modes=["++++", "-+-+"])
    assert build_system(both.mechanism).n_flexible >= counts[1]
    assert pf.reduced_mechanism(task, modes=["++++"], deviation=1e-4) == found[1].mechanism


def test_large_mechanisms_are_estimated_without_all_their_vibrations(task, monkeypatch):
    """By factors of sparse matrices, and combinations of deflections for the vibrations that loads excite."""
    whole = PlannedDeflections(task, 12)
    monkeypatch.setattr("paraflex.reduced_bodies.planned.DENSE_COORDINATES", 0)
    sparse = PlannedDeflections(task, 12)
    loading = whole.loading(task.mode("++++"))
    for found, expected in (
        (sparse.under(loading), whole.under(loading)),
        (sparse.of_end_effector(), whole.of_end_effector()),
    ):
        np.testing.assert_allclose(found, expected, atol=3e-5 * np.abs(expected).max())
    rows = whole._rows[2]
    exact, near = (one._structures[2] for one in (whole, sparse))
    free = exact.free_displacements(rows)
    np.testing.assert_allclose(near.free_displacements(rows), free, atol=1e-4 * np.abs(free).max())
    statics = near.static_displacements(np.concatenate([loading.forces[whole.samples[2]][None], rows]))
    lowest = near.vibrations(statics)[1]
    assert sorted(lowest)[:2] == pytest.approx(sorted(exact.vibrations(statics)[1])[:2], rel=1e-3)
    # The estimate has fewer vibrations to count.
    estimates = [pf.planned_reduction(task, 1e-4, modes=["++++"]), None]
    monkeypatch.undo()
    estimates[1] = pf.planned_reduction(task, 1e-4, modes=["++++"])
    counts = [build_system(one.mechanism).n_flexible for one in estimates]
    assert abs(counts[0] - counts[1]) <= 6


def test_vibrations_of_a_spring_that_a_force_begins():
    """A ramp that stops: two kinks, whose vibrations add up or cancel; a step: a vibration as large as itself."""
    from paraflex.reduced_bodies.planned import _vibrating

    omega, t = np.array([10.0, 20.0]), np.linspace(0.0, 2.0 * np.pi / 10.0, 201)
    ramp = np.minimum(t / (np.pi / 10.0), 1.0)
    slope = 10.0 / np.pi
    smooth = np.zeros(200, dtype=bool)
    found = _vibrating(t, np.column_stack([ramp, ramp]), omega, smooth)
    # Half a period of the first: the second kink doubles its vibration. A whole period of the second.
    assert found == pytest.approx([2.0 * slope / 10.0, slope / 20.0], rel=1e-6)
    assert _vibrating(t, np.ones((201, 2)), omega, smooth) == pytest.approx([1.0, 1.0])


def test_vibrations_of_a_spring_that_a_jump_begins():
    """Against a simulated oscillator, however long an interval is; the force begins with a jump itself."""
    from paraflex.reduced_bodies.planned import _vibrating

    t, omega, jumping = np.linspace(0.0, 1.0, 51), np.array([37.0, 301.0]), np.arange(50) == 20
    force = np.sin(5.0 * t) + 1.3 - 2.2 * (t > 0.405)
    # Velocity u' / omega and deflection u under a force that is linear in each interval: u - force turns.
    u, most = np.zeros((2, 2)), np.zeros(2)
    for k in range(50):
        slope = 0.0 if jumping[k] else (force[k + 1] - force[k]) / 0.02
        u -= np.array([[force[k + 1] if jumping[k] else force[k]] * 2, slope / omega])
        cosine, sine = np.cos(0.02 * omega), np.sin(0.02 * omega)
        u = np.array([cosine * u[0] + sine * u[1], cosine * u[1] - sine * u[0]])
        most = np.maximum(most, np.hypot(*u))
        u += np.array([[force[k + 1]] * 2, slope / omega])
    assert _vibrating(t, np.column_stack([force, force]), omega, jumping) == pytest.approx(most, rel=1e-9)


def test_a_load_that_jumps_is_a_finding_and_shapes_for_it_do_not_depend_on_samples():
    model, kept = pf.load("five_bar"), []
    blow = pf.PiecewiseProfile((pf.ConstantSpeed(0.0, 0.0), pf.ConstantSpeed(20.0, 0.0)), (0.2,))
    push = pf.PointForce("push", pf.PointRef("distal1", "C"), (blow, 0.0))
    for samples in (51, 701):
        task = pf.plan(replace(model.mechanism, loads=(push,)), model.paths["square"], duration=0.5, samples=samples)
        chosen = pf.planned_reduction(task, 1e-4)
        kept.append(task.remodelled(chosen.mechanism).system.n_flexible)
    # The choice at one number of samples is that at another but for rounding of a shape at the limit.
    assert abs(kept[0] - kept[1]) <= 2
    # As many again as without the jump, whose steep slope few samples would hide.
    still = pf.plan(model.mechanism, model.paths["square"], duration=0.5, samples=51)
    assert kept[0] > 1.5 * still.remodelled(pf.planned_reduction(still, 1e-4).mechanism).system.n_flexible
    few = task.remodelled(chosen.mechanism)
    assert "reduced-jumps" in codes(pf.run_study(few, ["++"], reduction=chosen, warning=False).data)
    assert "reduced-jumps" not in codes(pf.run_study(task, ["++"], warning=False).data)


def test_the_command_keeps_as_few_as_the_tolerance_allows(tmp_path):
    done = paraflex("run", "--no-figures", "five_bar", "--reduced", "auto", "--out", "r", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    data = load_results(tmp_path / "r" / "results.nc")
    kept, deviation = data.attrs["flexible_coordinates"], data["reduction_estimate"].item()
    assert 4 < kept < 26
    assert 0.0 < deviation <= 1e-5
    words = " ".join(done.stdout.split())
    assert f"{kept} of 52 flexible coordinates" in words
    assert "estimated deviation" in words
    numbers = json.loads((tmp_path / "r" / "summary.json").read_text())["modes"]["++"]["reduction"]
    assert numbers["estimate"] == deviation
    assert "distance" not in numbers
    assert "estimated deviation" in (tmp_path / "r" / "report.html").read_text()
    # A looser tolerance needs fewer.
    loose = paraflex("run", "--no-figures", "five_bar", "--reduced", "auto", "--tol", "1e-3", "--json", cwd=tmp_path)
    assert json.loads(loose.stdout)["modes"]["++"]["reduction"]["flexible_coordinates"] < kept


def test_a_run_that_bends_far_beyond_its_plan_is_a_finding():
    model = pf.load("five_bar")
    task = pf.plan(model, "line")
    chosen = pf.planned_reduction(task, 1e-5)
    few = task.remodelled(chosen.mechanism)
    data = pf.run_study(few, ["++"], reduction=chosen, warning=False).data
    assert "reduced-beyond-plan" not in codes(data)
    data = pf.run_study(few, ["++"], reduction=chosen._replace(energy=chosen.energy / 100.0), warning=False).data
    assert "reduced-beyond-plan" in codes(data)


def test_sweeps_choose_coordinates_for_the_tolerance_of_each_design(reduced_file):
    text = (reduced_file / "few.toml").read_text().replace("reduced = 10", 'reduced = "auto"')
    (reduced_file / "auto.toml").write_text(text)
    sweep = 'mechanism = "{}"\npaths = ["line"]\nmetrics = [{}]\n[vary.thickness]\n' \
            'fields = ["section.bar.thickness"]\nvalues = [0.004, 0.006]\n'  # fmt: skip
    errors = []
    for name in ("auto.toml", "five_bar"):
        file = reduced_file / f"sweep_{name}.toml"
        file.write_text(sweep.format(name, '"tracking_rms"'), encoding="utf-8")
        errors.append(pf.sweep(file, reduced_file / f"auto_{name}", workers=1).data["tracking_rms"].values.ravel())
    assert errors[0] == pytest.approx(errors[1], abs=3e-5)


def test_wrong_ways_to_ask_for_as_few_as_the_tolerance_allows(tmp_path, task, full):
    assert "--reduced: no number of flexible coordinates (got 'few')" in refusal(
        tmp_path, "run", "five_bar", "--reduced", "few"
    )
    assert "--reduced: has no effect with --rigid" in refusal(
        tmp_path, "run", "raparm_i", "--rigid", "--reduced", "auto"
    )
    assert "--reduced: as few coordinates as the tolerance allows are chosen from a planned path" in refusal(
        tmp_path, "run", "slider_crank_flexible", "--reduced", "auto"
    )
    for deviation in (0.0, -1e-5, np.nan, np.inf):
        with pytest.raises(InputError, match="deviation"):
            pf.planned_reduction(task, deviation)
    with pytest.raises(InputError, match="deviation: determines the number of coordinates"):
        pf.reduced_mechanism(task, 16, deviation=1e-5)
    with pytest.raises(InputError, match="deviation: is estimated for a plan, not for runs"):
        pf.reduced_mechanism(full, deviation=1e-5)
    # Rigid bodies are as they are.
    rigid = pf.load("five_bar").mechanism.rigid()
    assert pf.planned_reduction(pf.plan(rigid, pf.load("five_bar").paths["line"]), 1e-5).mechanism is rigid
    # Nothing finer than all independent shapes.
    assert build_system(pf.planned_reduction(task, 1e-300, modes=["++++"]).mechanism).n_flexible <= 90


# --- Stresses ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "path", "mode"),
    [
        ("raparm_i", "square", "++++"),
        ("raparm_i", "square", "-+-+"),
        ("five_bar", "line", "++"),
        ("3rrr", "circle", "++++++"),
    ],
)
def test_stresses_are_those_of_all_coordinates(name, path, mode):
    """With curvatures of the kept shapes those of RAParM-I were three times as large."""
    model = pf.load(name)
    task = pf.plan(model.mechanism.with_geometry("second-order"), model.paths[path], duration=model.study.duration)
    options = model.study.integration()
    few = task.remodelled(pf.reduced_mechanism(task, modes=[mode], deviation=options.tolerance_for(task.system)))
    data = [pf.tracking_dataset([one.simulate(mode, options=options, warning=False)]) for one in (few, task)]
    stress, right = (one["stress_max"].max().item() for one in data)
    assert stress == pytest.approx(right, rel=0.04)


def test_stresses_under_weight_and_loads_in_time():
    model = pf.load("five_bar")
    load = pf.PointForce("push", model.mechanism.end_effector.point, (ExpressionProfile("40 * t"), -3.0))
    arm = replace(model.mechanism, gravity=(0.0, -9.81), loads=(load,))
    task = pf.plan(arm, model.paths["line"])
    few = task.remodelled(pf.reduced_mechanism(task, modes=["++"], deviation=1e-5))
    data = [pf.tracking_dataset([one.simulate("++", warning=False)]) for one in (few, task)]
    stress, right = (one["stress"].max("time").values for one in data)
    np.testing.assert_allclose(stress, right, atol=0.04 * right.max())


def test_completed_motions(task, full):
    """All coordinates are as they are; under forces that nobody knows they are none."""
    rng = np.random.default_rng(5)
    system = task.system
    found = reducing._directions(system, rng.standard_normal((40, system.n)))
    same = task.remodelled(replace(task.mechanism, bases=reducing._bases(system, found[: system.n_flexible])))
    motion = same.simulate("++++", warning=False).solution
    few = [part[::20] for part in (motion.q, motion.v, motion.a, motion.multipliers)]
    complete = Completion(same.system)
    for part, lifted in zip(complete(*few), few, strict=False):
        same_part = carried(complete.whole, same.system, lifted)
        np.testing.assert_allclose(part, same_part, atol=1e-6 * np.abs(part).max())
    hardest = np.argmax(np.max(np.abs(few[3]), axis=1))
    assert np.isnan(complete(*few[:3], 1.1 * few[3])[0][hardest]).all()


def test_stresses_of_bodies_without_coordinates_have_no_bound_of_errors():
    task = pf.plan(pf.load("geared_five_bar"), next(iter(pf.load("geared_five_bar").paths)), samples=51)
    run = task.remodelled(pf.reduced_mechanism(task, 4, modes=["++"])).simulate("++", warning=False)
    error = pf.tracking_dataset([run]).isel(mode=0)["stress_max_error"]
    kept = {name: len(rows[0]) for name, rows in run.task.mechanism.bases.items()}
    assert 0 in kept.values()
    for name, count in kept.items():
        assert np.isfinite(error.sel(body=name).item()) == (count > 0)


def test_rows_close_to_one_another_are_a_jump_and_slow_ramps_are_none():
    model = pf.load("five_bar")

    def task(rise, samples=101):
        force = pf.TabulatedProfile((0.0, 0.2, 0.2 + rise, 1.0), (0.0, 0.0, 20.0, 20.0), "linear")
        push = pf.PointForce("push", pf.PointRef("distal1", "C"), (force, 0.0))
        return pf.plan(replace(model.mechanism, loads=(push,)), model.paths["square"], duration=0.5, samples=samples)

    kept = []
    for rise, steep in ((2e-5, True), (1e-2, False)):
        chosen = pf.planned_reduction(task(rise), 1e-4)
        few = task(rise).remodelled(chosen.mechanism)
        kept.append(few.system.n_flexible)
        assert ("reduced-jumps" in codes(pf.run_study(few, ["++"], reduction=chosen, warning=False).data)) == steep
    assert kept[0] > kept[1]
    # Between few samples it is not taken for a slow change.
    other = task(2e-5, 51)
    few = other.remodelled(pf.planned_reduction(other, 1e-4).mechanism)
    assert few.system.n_flexible > kept[1]
