"""Examples run as they stand; what they print is what they return, and that is checked by other means."""

import dataclasses
import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

import paraflex as pf
from pages import last_digit
from paraflex.designs.derivatives.plans import nominal_values
from paraflex.designs.run import Task, run_task
from paraflex.dynamics import build_system, consistent_state, natural_frequencies
from paraflex.studies import load_identification, load_optimisation, load_sensitivities, load_sweep
from shell import paraflex

EXAMPLES = Path(__file__).parents[1] / "examples"


def load_example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    return example


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run an example in an empty folder: the module, what it returned and what it printed."""

    def run(name):
        monkeypatch.chdir(tmp_path)
        example = load_example(name)
        return example, example.main(), capsys.readouterr().out

    return run


def test_every_example_is_tested():
    tests = Path(__file__).read_text(encoding="utf-8")
    for path in EXAMPLES.glob("*.py"):
        assert f'run("{path.stem}")' in tests, path


STUDIES = {
    "identification": load_identification, "optimisation": load_optimisation, "sensitivity_study": load_sensitivities,
    "thickness_study": load_sweep,
}  # fmt: skip
MODELS = ("laws",)


def test_every_study_can_be_read_and_its_first_design_runs():
    """To their ends they are run by benchmarks/documented.py, which keeps what they find."""
    assert {path.stem for path in EXAMPLES.glob("*.toml")} == {*STUDIES, *MODELS}
    for name, load in STUDIES.items():
        study = load(EXAMPLES / f"{name}.toml")
        setting, values = study.setting, [parameter.low for parameter in study.parameters]
        if name == "sensitivity_study":
            values = nominal_values(setting)
        if name in ("identification", "optimisation"):
            values = study.start
        short = dataclasses.replace(setting, modes=setting.modes[-1:], duration=0.05, samples=11)
        (row,) = run_task(short, Task(0, 0, tuple(values), "square")).rows
        assert row["status"] == "complete", row["reason"]


def test_raparm_square(run, tmp_path):
    _, errors, printed = run("raparm_square")
    # Computed by an independent prototype of the same model; the default tolerance gives them to 1 %.
    assert errors["++++"] == pytest.approx(6.292e-4, rel=0.01)
    assert errors["+-+-"] == pytest.approx(4.796e-2, rel=0.01)
    assert f"++++: tracking error {errors['++++']:.2e} m" in printed
    assert (tmp_path / "end_effector_path.png").stat().st_size > 10_000


def test_five_bar_of_your_own(run):
    example, found, printed = run("five_bar_of_your_own")
    finer = example.five_bar().with_beams(elements=6)
    system = build_system(finer)
    state = consistent_state(system, finer.assemblies[0])
    frequency = natural_frequencies(system, state, held=["A1", "A2"]).frequencies[0] / (2 * np.pi)
    assert found["frequency"] == pytest.approx(frequency, rel=1e-6)
    # Twice the mesh, another method and a tenth of the tolerance.
    circle = pf.Circle(centre=(0.0, 0.280), radius=0.030, max_acceleration=30.0)
    task = pf.plan(finer, circle, duration=0.5)
    converged = pf.tracking_dataset(
        [task.simulate("++", method="esdirk5", options=pf.IntegrationOptions(tolerance=1e-6))]
    )
    assert found["error"] == pytest.approx(float(converged["tracking_rms_motion"][0]), rel=0.02)
    assert found["torque"] == pytest.approx(float(converged["peak_torque"].max()), rel=1e-3)
    assert f"{found['frequency']:.1f} Hz" in printed
    assert f"error {1e3 * found['error']:.3f} mm, torque up to {found['torque']:.2f} N m" in printed


def test_choosing_modes(run):
    _, errors, printed = run("choosing_modes")
    order = [line.split()[0] for line in printed.splitlines()[1:]]
    assert order == sorted(errors, key=errors.get)
    assert order[0] == "++++"
    robot = pf.load("4rrr")
    task = pf.plan(robot.mechanism.with_geometry("second-order"), robot.paths["circle"], samples=301)
    options = pf.IntegrationOptions(method="esdirk4", tolerance=1e-7)
    converged = pf.tracking_dataset([task.simulate("+++-", options=options)])
    assert errors["+++-"] == pytest.approx(float(converged["tracking_rms_motion"][0]), rel=0.01)
    assert f"{1e6 * errors['+++-']:.1f} um" in printed


def test_second_order_spin_up(run):
    _, found, printed = run("second_order_spin_up")
    # A geometrically exact beam: -0.573835 m, computed; the theory leaves out fourth-order terms of the slopes.
    assert found["deepest"] == pytest.approx(-0.573835, rel=5e-3)
    # The closed form; bending is left over from the ramp.
    assert found["stretch"] == pytest.approx(1.2 * 6.0**2 * 10.0**3 / (3 * 2.8e7), rel=1e-2)
    assert f"deepest {found['deepest']:.4f} m" in printed
    assert "linear: beam bends to a slope of" in printed
    assert "the motion diverges" in printed


def page_of_control():
    """Cells of the table of the closed loop on the page, by the name of the row."""
    page = (EXAMPLES.parent / "docs" / "control.md").read_text(encoding="utf-8")
    _, _, *rows = page[page.index("| | as designed | 20 % more payload |") :].split("\n\n")[0].splitlines()
    return {row.split("|")[1].strip(): [cell.strip() for cell in row.strip("|").split("|")[1:]] for row in rows}


def test_closed_loop(run):
    """What feedback is there for: a payload that learning did not know of. Errors and vibrations in mm."""
    example, (every, undamped), printed = run("closed_loop")
    page = page_of_control()
    found, names = every.found, ("as designed", "20 % more payload")
    rigid, learned, fed_back, quantised = (
        [found[law, name] for name in names] for law in dict.fromkeys(law for law, _ in found)
    )
    # With readings that are exact nothing in the loop enlarges rounding: the page has all digits.
    rows = page["rigid feed-forward"], page["learned torques"], page["learned torques and LQG"]
    for shown, values in zip(rows, (rigid, learned, fed_back), strict=True):
        shown = [float(number) for cell in shown for number in cell.split(", ")]
        assert np.ravel(values) == pytest.approx(np.array(shown), abs=0.6e-4)
    assert fed_back[1][0] < 0.06 * learned[1][0]
    assert fed_back[1][1] < 0.04 * rigid[1][1]  # 28 dB
    # Quantised readings add noise of some 0.005 mm, another sample on every processor; 0.1 mm is asked for with
    # more payload.
    for (exact, still), (error, vibration) in zip(fed_back, quantised, strict=True):
        assert error < exact + 0.02
        assert vibration < still + 0.04
    assert quantised[1][0] < 0.1
    assert f"{fed_back[1][0]:.4f}, {fed_back[1][1]:.4f}" in printed
    assert f"{every.radius:.4f}" in printed
    assert every.radius < 0.9953
    # Without damping some vibration beyond 1 kHz grows slowly in some poses.
    assert 1.0 < undamped < 1.0009
    assert f"{undamped:.4f}" in printed
    gain, delay = every.margins
    assert gain == pytest.approx(2.857, abs=3e-3)
    assert delay == pytest.approx(2.468, abs=2e-3)
    # Steps of 1 ms are fine enough for damped links: error control agrees.
    finely = every.task.remodelled(example.manipulator(0.12)).simulate("++++", method="esdirk4")
    assert example.figures(finely)[0] == pytest.approx(rigid[1][0], rel=2e-3)


@pytest.mark.parametrize(("damping", "states", "stable"), [(5e-4, 44, False), (1e-3, 44, True), (2e-4, 100, True)])
def test_closed_loop_with_little_damping(damping, states, stable):
    """How little suffices in every pose and with 0 to 0.5 kg depends on how many vibrations the design knows."""
    example = load_example("closed_loop")
    task = example.planned(damping)
    radius = example.largest_radius(task, example.design_of(task, states), damping)
    assert (radius < 1.0) == stable


@pytest.fixture(scope="module")
def laws(tmp_path_factory):
    """What the command on the page of control gives, by row and mode."""
    along = ["--path", "square", "--path", "shaped", "--mode", "++++", "--mode=-+-+"]
    done = paraflex("control", "compare", EXAMPLES / "laws.toml", *along, "--json", cwd=tmp_path_factory.mktemp("laws"))
    assert done.returncode == 0, done.stderr
    return {name: law["modes"] for name, law in json.loads(done.stdout)["laws"].items()}


# Of a cell of the page's table, with the factors of its units.
CELL = {"tracking_rms_motion": 1e3, "residual_vibration": 1e3, "peak_torque_max": 1.0, "internal_torque_max": 1.0}


def test_the_table_of_laws_on_the_page_is_what_the_command_gives(laws):
    page = (EXAMPLES.parent / "docs" / "control.md").read_text(encoding="utf-8")
    head, _, *rows = page[page.index("| law |") :].split("\n\n")[0].splitlines()
    modes = [cell.strip(" `") for cell in head.strip("|").split("|")[1:]]
    assert [row.split("|")[1].strip() for row in rows] == list(laws)
    for row in rows:
        name, *cells = (cell.strip() for cell in row.strip("|").split("|"))
        for mode, cell in zip(modes, cells, strict=True):
            found = laws[name][mode]
            assert (cell == "–") == (found["status"] != "complete"), (name, mode)
            for text, (metric, factor) in zip(cell.split(", ") if cell != "–" else (), CELL.items(), strict=False):
                # The last digit that is shown, or 1 %.
                room = max(0.01 * float(text), last_digit(text), 1e-6)
                assert factor * found[metric] == pytest.approx(float(text), abs=room), (name, mode, metric)


def test_steps_from_sample_to_sample_are_fine_enough_for_the_laws(laws):
    """Error control agrees, of the law with the largest gains for gauges too."""
    options = pf.IntegrationOptions(method="esdirk4", tolerance=1e-6)
    finely = pf.compare_laws(EXAMPLES / "laws.toml", ["++++"], ["unprojected", "pd+gauges"], options=options)
    for law in ("open loop", "unprojected", "pd+gauges"):
        for metric in CELL:
            coarse, fine = laws[f"{law}, square"]["++++"][metric], float(finely.data[metric].sel(law=law, mode="++++"))
            # A step of an encoder, 0.16 mrad, is worth 0.05 N m of a damping of 0.3 N m s/rad: which sample it falls in
            # is up to rounding, and moves what motors do against one another.
            rel = 2e-2 if metric == "internal_torque_max" else 5e-3
            assert coarse == pytest.approx(fine, rel=rel, abs=1e-7), (law, metric)
