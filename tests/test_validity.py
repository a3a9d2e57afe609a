"""Does the model hold: indicators against closed forms and exact beams, and where users come across them."""

import json
import math
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import paraflex as pf
from paraflex.cli.app import app
from paraflex.dynamics import build_system, consistent_state, static_equilibrium
from paraflex.errors import IntegrationError, ValidityWarning
from paraflex.fem import ReferenceCondition
from paraflex.findings import Finding
from paraflex.mechanism import Assembly, Geometry, Mechanism, PointForce, PointRef, WeldJoint
from paraflex.motion import simulate_motion
from paraflex.results import motion_dataset, motion_summary, summary, tracking_dataset
from paraflex.results.findings import finding_lines, validity_line, validity_summary
from paraflex.validity import FOURTH_ORDER_LIMIT, Following, Validity, assess, fourth_order
from test_given_shapes import as_modal

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
sys.path.append(str(BENCHMARKS))

import validity as bench  # noqa: E402

PINNED, CANTILEVER = ReferenceCondition.PINNED, ReferenceCondition.CANTILEVER


@pytest.fixture(scope="module")
def task():
    """RAParM-I as the paper has it, to the end of the square's third side."""
    model = pf.load("raparm_i")
    mechanism = bench.variant(model.mechanism, Geometry.LINEAR, CANTILEVER)
    return pf.plan(mechanism, model.path("square"), duration=0.45, samples=91)


@pytest.fixture(scope="module")
def invalid(task):
    return task.simulate("+-+-")


@pytest.fixture(scope="module")
def valid():
    """RAParM-II's bars are thicker: in this mode linear geometry is 0.2 % off the deviation."""
    model = pf.load("raparm_ii")
    mechanism = bench.variant(model.mechanism, Geometry.LINEAR, PINNED)
    return pf.plan(mechanism, model.path("square"), duration=0.45, samples=401).simulate("++++")


def indicators(validity: Validity | None):
    assert validity is not None
    return {one.name: one for one in validity.indicators}


# --- The numbers ---------------------------------------------------------------------------------------------------


def pulled(frame, geometry=Geometry.LINEAR, force=(-20.0, 0.0), body=lambda strip: strip, **changes):
    """A strip clamped to the ground under a force at its tip, at rest, for a moment."""
    strip = replace(bench.strip(), reference=frame, **changes)
    mechanism = Mechanism(
        name="strip",
        ground={"O": (0.0, 0.0)},
        bodies=(body(strip),),
        joints=(WeldJoint("root", PointRef("ground", "O"), PointRef("beam", "A")),),
        loads=(PointForce("F", PointRef("beam", "B"), force),),
        assemblies=(Assembly("straight", {"beam": 0.0}),),
        geometry=geometry,
    )
    system = build_system(mechanism)
    start = static_equilibrium(system, consistent_state(system, mechanism.assembly(None)))
    return simulate_motion(mechanism, 1e-3, samples=3, start=start)


@pytest.mark.parametrize(("frame", "fixity"), [(CANTILEVER, 0.25), (PINNED, 1.0)])
def test_axial_force_is_told_over_eulers_load_of_the_frame(frame, fixity):
    """The mesh of four quintics has both loads to six digits."""
    found = indicators(pulled(frame).validity)["axial force"]
    assert found.value == pytest.approx(20.0 * bench.LENGTH**2 / (fixity * np.pi**2 * bench.EI), rel=1e-4)
    assert found.body == "beam"


def test_joint_forces_tell_the_axial_force_where_modes_do_not_stretch():
    """The two lowest modes bend: their coordinates know of no stretch."""
    full, few = (indicators(pulled(PINNED, modes=modes).validity)["axial force"].value for modes in (None, 2))
    assert few == pytest.approx(full, rel=1e-3)


def test_slope_is_the_largest_in_the_frame():
    """A tip force F bends by F L^2 / 2 E I at the end, by two thirds of that from the chord."""
    force = 0.2 * bench.EI / bench.LENGTH**2
    for frame, slope in ((CANTILEVER, 0.1), (PINNED, 0.2 / 3.0)):
        found = indicators(pulled(frame, force=(0.0, force)).validity)["slope"]
        assert found.value == pytest.approx(slope, rel=0.01)


def test_shortening_is_that_of_a_parabola_of_slopes():
    """1/2 int slope^2 dx is 3 w^2 / (5 L) of a cantilever under a force at its tip, which moves by w."""
    found = pulled(CANTILEVER, force=(0.0, 0.2 * bench.EI / bench.LENGTH**2))
    validity = assess(found.system, found.solution, Following(deviation=1e-3, condition=2.0))
    deflection = 0.2 / 3.0 * bench.LENGTH
    shortening = 0.6 * deflection**2 / bench.LENGTH
    assert indicators(validity)["shortening"].value == pytest.approx(shortening * 2.0 / 1e-3, rel=1e-3)


@pytest.mark.parametrize("load", [0.3, 1.0])
def test_fourth_order_terms_are_not_told_too_small_of_a_clamped_beam(load):
    for case in bench.compared("tip", load, 0.0, bench.tip_force(load), bench.clamped(load * bench.EI / 0.3**2)):
        assert abs(case["error"]) <= case["estimate"], case


@pytest.mark.parametrize("compression", [0.0, 0.8, 0.95])
def test_fourth_order_terms_are_those_of_a_hinged_beam_near_buckling(compression):
    """Against the exact elastica; the error grows sixfold towards buckling."""
    load = 16.0 * 0.1 * (1.0 - compression)
    exact = bench.middle_force(load, compression)
    for case in bench.compared("middle", load, compression, exact, bench.hinged(load, compression)):
        if case["frame"] == "cantilever":
            assert abs(case["error"]) <= 1.05 * case["estimate"]
        else:
            assert case["error"] == pytest.approx(case["estimate"], rel=0.06)


def test_limits_of_slope_are_those_documented():
    """1 % at 0.148 rad from the chord and 0.126 rad from the tangent, without axial force."""
    for slope, tangent in ((0.1477, False), (0.1256, True)):
        assert fourth_order(slope, 0.0, tangent=tangent) == pytest.approx(FOURTH_ORDER_LIMIT, rel=2e-3)


def test_compression_in_a_run_of_second_order_counts():
    """A fifth of the buckling load adds 6 % to what a slope tells by itself; tension takes nothing off."""
    for axial, compression in ((-20.0, 20.0 * bench.LENGTH**2 / (np.pi**2 * bench.EI)), (20.0, 0.0)):
        run = pulled(PINNED, Geometry.SECOND_ORDER, (axial, 0.2))
        slope = float(np.max(np.abs(run.system.body("beam").slopes(run.solution.q[0]))))
        expected = fourth_order(slope, compression, tangent=False)
        assert indicators(run.validity)["fourth order"].value == pytest.approx(expected, rel=0.01)


def test_measured_limits_let_nothing_pass_that_is_off():
    """What the documentation says of the library, from the file that `benchmarks/validity.py` writes."""
    measured = json.loads(bench.MEASURED.read_text(encoding="utf-8"))
    rows = [row | {"error": math.inf if row["error"] is None else row["error"]} for row in measured["linear"]]
    assert bench.counts(rows) == measured["counts"]
    assert measured["counts"]["off_without_warning"] == 0
    assert bench.page(measured) in bench.PAGE.read_text(encoding="utf-8")


# --- Where users come across it --------------------------------------------------------------------------------------


def test_the_papers_mode_near_the_singularity_warns(task):
    with pytest.warns(ValidityWarning, match=r"mode \+-\+-: linear geometry does not hold: .*second-order"):
        task.simulate("+-+-")


def test_a_study_in_threads_warns_of_each_mode(task):
    short = pf.plan(task.mechanism, task.path, duration=0.05, samples=11)
    with pytest.warns(ValidityWarning) as caught:
        pf.run_study(short, ["++++", "+++-"])
    assert [str(each.message).split(":")[0] for each in caught] == ["mode ++++", "mode +++-"]


def test_a_run_that_the_model_can_describe_does_not_warn(valid):
    assert valid.validity.holds
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        valid.task.simulate("++++")


@pytest.mark.parametrize("frame", [PINNED, CANTILEVER])
def test_second_order_holds_in_the_mode_of_the_papers_headline(frame, task):
    second = task.remodelled(bench.variant(task.mechanism, Geometry.SECOND_ORDER, frame))
    validity = second.simulate("++++").validity
    assert validity is not None
    assert validity.holds
    assert validity.verdict.startswith("second-order geometry holds: link")


def test_there_is_nothing_to_say_of_rigid_bodies_and_finite_segments(task):
    short = pf.plan(task.mechanism, task.path, duration=0.02, samples=5)
    runs = [short.remodelled(task.mechanism.rigid()).simulate("++++"), short.in_segments(2).simulate("++++")]
    assert [run.validity for run in runs] == [None, None]
    data = tracking_dataset(runs[:1])
    assert np.isnan(data["validity"].item())
    assert summary(data)["modes"]["++++"]["validity"] is None


def test_a_beam_too_steep_for_any_theory_is_still_an_error_and_tells_how_far_it_was_valid():
    model = pf.load("spin_up")
    mechanism = bench.variant(model.mechanism, Geometry.LINEAR, CANTILEVER)
    with pytest.raises(IntegrationError, match="beam bends to a slope of") as caught:
        simulate_motion(mechanism, 12.0, samples=121, start="start")
    assert indicators(caught.value.partial.validity)["axial force"].value > 1.0


def test_bars_of_assumed_modes_are_linear_in_any_mechanism():
    model = pf.load("slider_crank_flexible")
    mechanism = model.mechanism.with_geometry("second-order")
    run = simulate_motion(mechanism, 5e-3, samples=11, start="stretched")
    found = indicators(run.validity)
    assert set(found) == {"axial force", "slope"}
    assert 'type = "beam"' in found["slope"].remedy
    assert run.validity is not None
    assert run.validity.verdict.startswith("linear geometry ")


def test_a_bar_that_does_not_stretch_tells_its_axial_force_by_its_joints():
    model = pf.load("slider_crank_flexible")
    rod = model.mechanism.body("rod")
    mechanism = model.mechanism.with_bodies([replace(rod, axial=())])
    runs = [simulate_motion(each, 5e-3, samples=51, start="stretched") for each in (model.mechanism, mechanism)]
    stretching, stiff = (indicators(run.validity)["axial force"].value for run in runs)
    # The mean of the stretch is that of both ends; the joint at the crank carries the rod's own inertia as well.
    assert stiff == pytest.approx(stretching, rel=0.6)
    assert stiff > 0.02


def test_of_a_modal_body_slopes_at_its_points_are_all_there_is_to_tell():
    """A strip by its own matrices: the slope at its tip is that of the beam."""
    force = (0.0, 0.1 * bench.EI / bench.LENGTH**2)
    beam, run = (
        pulled(CANTILEVER, force=force),
        pulled(CANTILEVER, force=force, body=lambda strip: as_modal(strip, name="beam")),
    )
    found = indicators(run.validity)
    assert set(found) == {"slope"}
    assert found["slope"].value == pytest.approx(indicators(beam.validity)["slope"].value, rel=1e-6)


def test_dataset_and_summary_say_what_the_run_says(invalid, valid):
    run = summary(tracking_dataset([invalid]))["modes"]["+-+-"]["validity"]
    assert run["holds"] is False
    assert run["verdict"] == invalid.validity.verdict
    assert run["ratio"] == invalid.validity.ratio > 1.0
    assert run["slope"] == indicators(invalid.validity)["slope"].value
    assert "fourth_order" not in run
    good = summary(tracking_dataset([valid]))["modes"]["++++"]["validity"]
    assert good["holds"] is True


def test_files_of_earlier_versions_say_nothing(invalid, tmp_path):
    data = tracking_dataset([invalid])
    pf.save_results(data, tmp_path / "new.nc")
    assert validity_summary(pf.load_results(tmp_path / "new.nc").sel(mode="+-+-")) == validity_summary(
        data.sel(mode="+-+-")
    )
    old = data.drop_vars([name for name in data if str(name).startswith("validity")])
    assert summary(old)["modes"]["+-+-"]["validity"] is None


def test_a_run_without_a_path_says_it_too():
    model = pf.load("pendulum")
    mechanism = bench.variant(model.mechanism, Geometry.LINEAR, CANTILEVER)
    with pytest.warns(ValidityWarning, match="beam's axial force reaches .* of its buckling load"):
        run = simulate_motion(mechanism, 0.6, samples=61, start="level")
    figures = motion_summary(motion_dataset(run))
    assert figures["validity"]["verdict"] == run.validity.verdict


def test_one_line_says_that_all_models_hold():
    good, better, bad = ({"ratio": r, "holds": r <= 1.0, "verdict": f"v{r}"} for r in (0.5, 0.2, 2.0))
    assert validity_line({"": good}) == "validity: v0.5"
    assert validity_line({"a": better, "b": good}) == "validity: mode b: v0.5; further from its limit in the others"
    assert validity_line({"a": good, "b": bad}) == validity_line({"a": None}) == ""


def test_further_modes_with_the_same_doubt_share_a_line():
    one, other, third = (Finding("validity", place, "too far", "go back") for place in ("mode a", "mode b", "mode c"))
    gravity = Finding("gravity", "gravity", "odd", "look")
    assert finding_lines([one, gravity, other, third]) == [
        "warning: mode a: too far; go back [validity]",
        "warning: gravity: odd; look [gravity]",
        "warning: the same in mode b, c [validity]",
    ]


def test_the_command_line_and_the_report_say_it_once(tmp_path):
    command = ["run", "-m", "raparm_i", "--geometry", "linear", "--mode=+++-", "--duration", "0.05", "--samples", "11"]
    result = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0
    said = [line for line in result.output.splitlines() if "does not hold" in line]
    assert len(said) == 1
    assert said[0].startswith("warning: mode +++-: linear geometry does not hold: ")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.count("linear geometry does not hold") == 1
    figures = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert figures["modes"]["+++-"]["validity"]["holds"] is False


SWEEP = """
mechanism = "raparm_i"
modes = ["+++-"]
duration = 0.05
samples = 11
metrics = ["tracking_rms"]

[vary.thickness]
fields = ["section.bar.thickness"]
values = [0.005, 0.05]
"""


def test_a_sweep_tells_the_designs_that_are_beyond(tmp_path):
    (tmp_path / "study.toml").write_text(SWEEP)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = pf.sweep(pf.load_sweep(tmp_path / "study.toml"), tmp_path / "out", workers=1)
    import pandas

    table = pandas.read_parquet(found.table)
    assert list(table["validity"] > 1.0) == [True, False]
    assert found.beyond == 1
    assert json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["beyond_validity"] == 1
