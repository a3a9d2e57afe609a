"""The benchmarks' own parts: what they measure is what they say; nothing is timed here."""

import dataclasses
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

import paraflex as pf
from counting import operations_of
from paraflex.kernel.linear import solve_system
from paraflex.kernel.metric import mass_norm
from paraflex.kernel.stage import equations
from paraflex.mechanism import Geometry, RigidBody, proportional_segments

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
sys.path.append(str(BENCHMARKS))

import batch  # noqa: E402
import common  # noqa: E402
import cost_model  # noqa: E402
import default_method  # noqa: E402
import engines  # noqa: E402
import four_bars  # noqa: E402
import iteration  # noqa: E402
import models  # noqa: E402
import operations  # noqa: E402
import paths_and_modes  # noqa: E402
import peers  # noqa: E402
import peers_tables  # noqa: E402
import startup  # noqa: E402


@pytest.fixture(scope="module")
def task():
    model = pf.load("raparm_i")
    return pf.plan(model.mechanism, model.path("square"), duration=0.02, samples=21)


def test_a_lucky_setting_is_passed_over():
    errors = {5: 0.3, 4: 0.05, 3: 0.2, 2: 0.08, 1: 0.01}
    found = common.coarsest_within(errors, lambda k: common.Trial(errors[k], 1.0), 0.1)
    assert found == (2, common.Trial(0.08, 1.0))
    assert common.coarsest_within(errors, lambda k: common.Trial(math.inf, 1.0), 0.1) is None


def dense(flat, widths, p):
    """Matrices of all bodies without zeros but in the columns that only pad them."""
    parts, at = [], 0
    for body, width in zip(p.bodies, widths, strict=True):
        matrix = flat[at : at + body["nf"] * width].reshape(-1, width)
        at += matrix.size
        parts.append(np.where((matrix != 0.0) | ~matrix.any(axis=0), matrix, 1e-9).ravel())
    return np.concatenate(parts)


@pytest.mark.parametrize("geometry", list(Geometry))
def test_operations_are_those_that_the_kernels_do(task, geometry):
    run = iteration.half_way(task.remodelled(task.mechanism.with_geometry(geometry)), 1e-4, 3)
    p, state, ws = run.problem.system.packed, run.state, run.workspace
    motion = (state.q, state.v, state.stage_a[1, 0], state.stage_lam[1, 0], state.torques)
    # Entries that are zero for straight beams count as well: the formulas are those of any body.
    columns, products = dense(p.columns, p.bodies["width"], p), dense(p.products, 2 * p.bodies["stride"], p)
    p = p._replace(columns=columns, products=products)
    # So do coordinates that move mass points in one direction only.
    bodies, nf = p.bodies.copy(), p.bodies["nf"]
    bodies["along"] = 2 * (np.cumsum(nf) - nf)
    bodies["across"], bodies["across_end"] = bodies["along"] + nf, bodies["along"] + 2 * nf
    p = p._replace(bodies=bodies, kinds=np.concatenate([np.tile(np.arange(n), 2) for n in nf]))
    done = {
        "equations": operations_of(equations, p, run.problem.signals, 0.01, (1.0, 40.0, 400.0), *motion, ws),
        "solve": operations_of(solve_system, p, ws, ws.x, ws.mu),
        "norm": operations_of(mass_norm, p, ws, ws.x),
    }
    counted = operations.iteration(p)
    # Products of entries that rounding leaves at zero are counted too.
    for part, count in done.items():
        assert counted[part] == pytest.approx(count, rel=0.25), part


def test_exudyn_runs_the_same_motion_as_its_adapter(task):
    pytest.importorskip("exudyn")
    from paraflex.engines.exudyn import ExudynOptions, simulate_exudyn

    found = engines.run_exudyn(engines.tracking_problem(task, "++++"), engines.ExudynSetting(4))
    record = simulate_exudyn(task, "++++", ExudynOptions(step=2.5e-4))
    assert found.steps == 80
    assert engines.distance(found.path, record.end_effector.position) < 1e-10
    assert np.ptp(found.path, axis=0).max() > 1e-3


def test_mujoco_runs_the_same_motion_as_its_adapter(task):
    pytest.importorskip("mujoco")
    from paraflex.engines.mujoco import MuJoCoOptions, simulate_mujoco

    cut = task.in_segments(proportional_segments(task.mechanism, 8))
    problem = engines.tracking_problem(cut, "++++")
    found = engines.run_mujoco(problem, engines.MuJoCoSetting(30))
    record = simulate_mujoco(cut, "++++", MuJoCoOptions(step=1e-3 / 30.0))
    # Torques of the middle of a step act throughout it.
    assert engines.distance(found.path, record.end_effector.position) < 2e-8
    with pytest.raises(RuntimeError):
        engines.run_mujoco(problem, engines.MuJoCoSetting(3))


def test_choices_are_timed_and_told(task):
    converged = peers.Converged("x", np.zeros((2, 2)), 0.0)

    def run(setting):
        if setting == 0:
            raise RuntimeError("diverges")
        return engines.Run(np.full((2, 2), 0.1**setting), 1.0 / setting, 0.5, 0.1, setting)

    choice = peers.choose("paraflex tr-bdf2, second order, pinned", [0, 1, 2, 3, 4], run, converged, 0.05)
    assert choice.setting == 2
    assert [trial.get("reason") for trial in choice.tried][:2] == ["diverges", None]
    other = peers.choose("Exudyn, x", [1, 2], run, converged, 0.05)
    paper = peers.choose("paraflex tr-bdf2, linear, cantilever", [2, 4], run, converged, 0.05)
    ours, theirs, linear = peers.timed([choice, other, paper], 3)
    assert ours.seconds == 0.5
    assert ours.without_python == 0.4
    lead = peers_tables.leads([dataclasses.asdict(result) for result in (ours, theirs, linear)])["Exudyn"]
    assert lead["like"] == {ours.name: 1.0}
    assert lead["linear"] == {linear.name: 1.0}
    assert peers.choose("none", [1], run, converged, 1e-9).setting is None


def test_our_run_is_the_study_itself(task):
    options = pf.IntegrationOptions(method="tr-bdf2", tolerance=1e-4)
    solution = models.PAPER.task(task).simulate("++++", options=options).solution
    found = peers.run_paraflex(task, models.PAPER, peers.Tolerance("tr-bdf2", 1e-4))
    assert found.steps == solution.steps


def test_links_of_a_flexible_row_weigh_what_rigid_ones_do():
    rigid, flexible = four_bars.row(2, flexible=False), four_bars.row(2, flexible=True)
    for one, other in zip(rigid.bodies, flexible.bodies, strict=True):
        assert isinstance(one, RigidBody)
        section, material = other.section, other.material
        assert section.area * material.density * other.length == pytest.approx(one.mass)
        assert other.points == {name: place[0] for name, place in one.points.items()}


def test_engines_agree_on_a_rigid_row():
    pytest.importorskip("exudyn")
    pytest.importorskip("mujoco")
    problem = four_bars.problem_of(four_bars.row(2, flexible=False))
    ours = four_bars.run_ours(problem, peers.Tolerance("esdirk5", 1e-7)).path
    exudyn = engines.run_exudyn(problem, engines.ExudynSetting(200)).path
    mujoco = engines.run_mujoco(problem, engines.MuJoCoSetting(40)).path
    assert engines.distance(exudyn, ours) < 1e-6
    assert engines.distance(mujoco, ours) < 1e-6
    assert np.ptp(ours, axis=0).max() > 0.1


def test_designs_differ_in_stiffness_alone(task):
    made = [batch.design(task.mechanism, k) for k in range(50)]
    factors = [one.bodies[0].material.youngs_modulus / task.mechanism.bodies[0].material.youngs_modulus for one in made]
    assert min(factors) < 0.82
    assert max(factors) > 1.18
    assert len(set(factors)) == 50
    assert made[7].bodies[2].section == task.mechanism.bodies[2].section
    assert made[7].joints == task.mechanism.joints


def test_fits_find_what_was_put_in():
    bodies, loops = np.array([1.0, 3.0, 5.0, 9.0]), np.array([0.0, 1.0, 0.0, 4.0])
    fit = cost_model.linear_fit([np.ones(4), bodies, loops], 2.0 + 3.0 * bodies + 0.5 * loops, "{} {} {}")
    assert fit.coefficients == pytest.approx((2.0, 3.0, 0.5))
    assert fit.misfit < 1e-9
    fit = cost_model.power_fit([1.0, 2.0, 4.0], [3.0, 3.0 * 2**-0.5, 1.5], "{} {}")
    assert fit.coefficients == pytest.approx((3.0, -0.5))
    design = {"alone": 1.8, "together": 3.6}
    assert cost_model.hours(design, 1) == pytest.approx(500.0)
    assert cost_model.hours(design, 1000) == pytest.approx(1.0)


def test_only_what_is_between_the_marks_is_written(tmp_path):
    begin, end = "<!-- measured: begin -->", "<!-- measured: end -->"
    page = tmp_path / "page.md"
    page.write_text(f"before\n{begin}\nold\n{end}\nafter\n")
    common.write_page("new \\1", page)
    assert page.read_text() == f"before\n{begin}\n\nnew \\1\n\n{end}\nafter\n"
    with pytest.raises(ValueError, match="no part"):
        common.write_page("new", BENCHMARKS / "batch.py")
    for written in (cost_model.PAGE, peers.README):
        assert begin in written.read_text(encoding="utf-8")


def test_the_readme_shows_the_speed_that_was_measured():
    measured = json.loads((common.MEASURED / "peers.json").read_text(encoding="utf-8"))
    table = peers_tables.readme_table(measured["results"], measured["duration"])
    assert table in peers.README.read_text(encoding="utf-8")
    # Like with like comes first.
    rows = [line for line in table.splitlines() if line.startswith("| paraflex")]
    assert [("second order" in row, "linear" in row) for row in rows] == [(True, False), (False, True)]


def test_measurements_keep_their_conditions(tmp_path):
    file = common.write_json("x", {"value": 1.0}, str(tmp_path))
    told = json.loads(file.read_text())
    assert told["value"] == 1.0
    assert told["machine"]["processor"]
    assert told["versions"]["numba"]
    start = startup.timed("python", ["-c", "pass"], 1)
    assert 0.0 < start.least == start.median
    assert start.processor > 0.0


def test_the_default_method_is_shown_by_all_its_cases():
    found = json.loads((common.MEASURED / "default_method.json").read_text(encoding="utf-8"))
    again = default_method.summary(found["cases"])
    assert {name: found[name] for name in again} == again
    assert set(found["cases"]) == {name for name, _ in default_method.cases()}
    assert not again["failed"]


def measured(path, mode):
    """What `paths_and_modes.py` found [m]."""
    rows = json.loads((common.MEASURED / "paths_and_modes.json").read_text(encoding="utf-8"))["rows"]
    return next(row for row in rows if (row["path"], row["mode"]) == (path, mode))


@pytest.mark.parametrize("mode", ["+-+-", "++++"])
def test_errors_of_paths_and_modes_are_those_of_the_models(mode):
    """On the line +-+- is the better one, in the motion and over the whole run, by every model."""
    model = pf.load("raparm_i")
    task = pf.plan(model.mechanism, model.path("line"), duration=paths_and_modes.DURATION)
    found = paths_and_modes.run_models(task, mode, exudyn=False)
    known = measured("line", mode)
    for name in ("second_order", "linear"):
        assert found[name] == pytest.approx(known[name], rel=5e-3)
        for part in ("motion", "run"):
            assert measured("line", "+-+-")[name][part] < measured("line", "++++")[name][part]


def test_second_order_meets_exact_beams_on_every_path_and_mode():
    """As `paths_and_modes.py` measured them: within 0.5 %, where linear beams are off by more than ten times."""
    rows = json.loads((common.MEASURED / "paths_and_modes.json").read_text(encoding="utf-8"))["rows"]
    assert len(rows) == 27
    for row in rows:
        assert row["second_order"] == pytest.approx(row["exact"], rel=5e-3)
    assert max(row["linear"]["run"] / row["exact"]["run"] for row in rows) > 10.0


def test_what_modes_md_says_of_paths_was_measured():
    page = " ".join((Path(__file__).parents[1] / "docs" / "modes.md").read_text(encoding="utf-8").split())
    two, more = ("+-+-", "-+-+", "+--+", "-++-"), ("+++-", "++-+", "+-++", "-+++", "++++")

    def error(path, mode, part="motion", model="second_order"):
        return 1e3 * measured(path, mode)[model][part]

    def ratios(path, part):
        few, many = ([error(path, mode, part) for mode in modes] for modes in (two, more))
        return f"{min(few) / max(many):.2g} to {max(few) / min(many):.2g} times"

    assert f"is {ratios('square', 'motion')} as large, over the whole run {ratios('square', 'run')} (each" in page
    assert f"On the circle during the motion too ({ratios('circle', 'motion')})" in page
    line = {mode: error("line", mode) for mode in (*two, *more)}
    assert min(line, key=line.get) == "+-+-"
    says = f"{line['+-+-']:.3f} mm, where ++++ strays by {line['++++']:.3f} mm and ++-+ by {line['++-+']:.3f} mm"
    assert says in page
    whole = f"it strays by {error('line', '+-+-', 'run'):.3f} mm and ++++ by {error('line', '++++', 'run'):.2f} mm"
    assert whole in page
    assert f"the circle passes: {error('circle', '+-+-'):.0f} mm there" in page
    circle = {part: [error("circle", mode, part) for mode in ("-+++", "-++-")] for part in ("motion", "run")}
    assert "({:.2f} against {:.2f} mm)".format(*circle["motion"]) in page
    assert "({:.1f} against {:.1f} mm)".format(*circle["run"]) in page
    linear = f"by {error('circle', '-++-', model='linear'):.1f} mm on the circle ({error('circle', '-++-'):.2f})"
    assert linear in page


def test_what_the_readme_says_in_prose_was_measured():
    readme = " ".join((Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8").split())

    def run(mode, model="second_order", path="square"):
        return 1e3 * measured(path, mode)[model]["run"]

    study = [run(mode) for mode in ("+-+-", "-+-+", "+--+", "+++-", "++-+", "++++")]
    assert f"between {min(study):.2f} mm and {max(study):.1f} mm on the same square" in readme
    linear, exact, second = (run("+-+-", model) for model in ("linear", "exact", "second_order"))
    assert (
        f"Flexible links miss it by {second:.1f} mm (RMS over the whole run); the linear beams of the paper by "
        in readme
    )
    assert f"by {linear:.0f} mm, which is wrong" in readme
    assert f"{second:.1f}" == f"{exact:.1f}"
    assert f"linear beams give {linear:.0f} mm, second order and exact beams {exact:.1f} mm" in readme
    assert f"({linear:.0f} mm instead of {exact:.1f} mm in mode +-+-;" in readme
    batch_of = json.loads((common.MEASURED / "batch.json").read_text(encoding="utf-8"))
    ours, theirs = (
        next(row["seconds_of_all"] for row in batch_of["rows"] if row["way"].startswith(way))
        for way in ("paraflex, second order", "Exudyn")
    )
    assert f"{batch_of['designs']} designs of other stiffness" in readme
    assert f"take {ours:.0f} s on two cores; Exudyn takes {theirs:.0f} s for as many" in readme


def test_what_validity_md_says_in_prose_was_measured():
    rows = json.loads((common.MEASURED / "validity.json").read_text(encoding="utf-8"))["linear"]
    square = [row for row in rows if (row["mechanism"], row["path"]) == ("raparm_i", "square")]
    between = [row["error"] for row in square if 0.145 < row["shortening"] < 0.55]
    assert [min(between), max(between)] == pytest.approx([0.03, 0.76], abs=5e-3)
    paper = next(row for row in square if (row["mode"], row["frame"]) == ("++++", "cantilever"))
    assert [paper["error"], paper["tracking_error_change"]] == pytest.approx([0.055, -0.04], abs=5e-3)
    free = [row for row in rows if not row["path"] and row["error"] is not None and row["axial_force"]]
    assert max(row["error"] / row["axial_force"] for row in free) == pytest.approx(1.1, abs=0.05)


def test_what_trust_md_says_of_the_models_was_measured():
    """Numbers in the list below the table of "Do the models agree?"."""
    rows = json.loads((common.MEASURED / "model_agreement.json").read_text(encoding="utf-8"))["rows"]

    def off(name):
        return {r["mode"]: r["models"][name]["run"] / r["models"]["exact beams"]["run"] - 1.0 for r in rows}

    pinned = {mode: abs(part) for mode, part in off("second order, pinned").items()}
    assert [pinned.pop("+--+"), pinned.pop("-+-+")] == pytest.approx([4e-4, 15e-4], abs=5e-5)
    assert max(pinned.values()) < 2.5e-4
    assert max(map(abs, off("second order, cantilever").values())) == pytest.approx(75e-4, abs=5e-5)
    linear = {mode: abs(part) for mode, part in off("linear, cantilever").items()}
    assert min(linear.values()) == pytest.approx(0.04, abs=5e-3)
    assert 1.0 + linear["+-+-"] == pytest.approx(5.6, abs=0.06)
    assert off("linear, pinned")["+--+"] == pytest.approx(0.13, abs=5e-3)
    assert 1.0 + off("linear, pinned")["+-+-"] == pytest.approx(0.1, abs=5e-3)
    held = [1.0 + part for part in off("KED").values()]
    assert [min(held), max(held)] == pytest.approx([4.0, 37.0], abs=0.6)
    assert max(row["segments_apart"] for row in rows) == pytest.approx(0.07e-6, abs=5e-9)
    moved = [row["models"]["56 segments"]["changes"]["mesh"] for row in rows]
    assert [min(moved), max(moved)] == pytest.approx([0.05e-3, 0.36e-3], abs=6e-6)


def test_what_trust_md_says_of_table_3_was_measured():
    paper = json.loads((common.MEASURED / "paths_and_modes.json").read_text(encoding="utf-8"))["table_3"]
    redundant = ("+++-", "++-+", "++++")
    off = {mode: measured("square", mode)["linear"]["run"] / measured("square", mode)["exact"]["run"] for mode in paper}
    assert sorted(1.0 - off[mode] for mode in redundant) == pytest.approx([0.04, 0.11, 0.18], abs=5e-3)
    assert [off["+--+"], off["+-+-"]] == pytest.approx([1.8, 5.6], abs=0.06)
    second = {mode: measured("square", mode)["second_order"]["run"] for mode in paper}
    for errors, least, most in ((second, 5.0, 18.0), (paper, 9.0, 170.0)):
        good, bad = ([errors[mode] for mode in paper if (mode in redundant) == kind] for kind in (True, False))
        assert [min(bad) / max(good), max(bad) / min(good)] == pytest.approx([least, most], rel=0.07)


def test_what_trust_md_says_of_other_mechanisms_was_measured():
    rows = json.loads((common.MEASURED / "library_agreement.json").read_text(encoding="utf-8"))["rows"]

    def off(name):
        return {(r["mechanism"], r["mode"]): r["models"][name]["run"] / r["exact"]["run"] - 1.0 for r in rows}

    for name, part, apart in (("pinned", 5e-4, 3e-6), ("cantilever", 3e-3, 18e-6)):
        assert max(map(abs, off(f"second order, {name}").values())) < part
        assert max(row["models"][f"second order, {name}"]["apart"] for row in rows) < apart
    linear, pinned = off("linear, cantilever"), off("linear, pinned")
    assert [linear["RAParM-II", mode] for mode in ("+-+-", "+--+")] == pytest.approx([1.0, 1.0], abs=0.15)
    assert linear["4-RRR", "+++-"] == pytest.approx(3.8, abs=0.05)
    assert sorted(pinned.values())[-2:] == pytest.approx([0.24, 0.37], abs=5e-3)
    at_ease = next(row for row in rows if (row["mechanism"], row["mode"]) == ("RAParM-II", "++++"))
    assert at_ease["exact"]["run"] == pytest.approx(1.4e-3, abs=5e-5)


def test_errors_are_taken_until_the_motion_ends_and_over_the_whole_run():
    model = pf.load("raparm_i")
    task = pf.plan(model.mechanism, model.path("line"), duration=0.2, samples=41)
    run = models.SECOND_ORDER.task(task).simulate("++++", method="esdirk5")
    data = pf.tracking_dataset([run])
    errors = models.tracking_errors(run, task.path.duration)
    assert errors["run"] == pytest.approx(float(data["tracking_rms"][0]))
    part = data.sel(time=slice(0.0, task.path.duration))
    assert errors["motion"] == pytest.approx(float(pf.results.tracking_error(part)[0]))
    assert errors["motion"] < errors["run"]


def test_the_readme_shows_the_agreement_that_was_measured():
    rows = json.loads((common.MEASURED / "model_agreement.json").read_text(encoding="utf-8"))["rows"]
    shown = [line for line in peers.README.read_text(encoding="utf-8").splitlines() if line.startswith(("| +", "| -"))]
    assert len(shown) == 3
    for line in shown:
        mode, *errors = (cell.strip() for cell in line.strip("|").split("|"))
        found = next(row for row in rows if row["mode"] == mode)["models"]
        names = ("second order, pinned", "exact beams", "56 segments", "56 segments, MuJoCo")
        assert errors == [f"{found[name]['run']:.3e}".replace("e-0", "e-") for name in names]
