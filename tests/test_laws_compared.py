"""Control laws in several actuation modes: cells are those of single runs, failures are marked, rows are in order."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex

import paraflex as pf
from paraflex import plots
from paraflex.campaign import Workers
from paraflex.cli.commands.runs import CompareLawsRequest
from paraflex.cli.control import print_laws
from paraflex.cli.tables import PlainConsole
from paraflex.control import ControllerDescription, simulate_controlled
from paraflex.control.laws.joints import internal_torques
from paraflex.errors import InputError
from paraflex.plots.style import BLUE, VERMILLION
from paraflex.reduced_bodies import reduced_mechanism
from paraflex.studies.laws import LawStudy, laws_of
from shell import interrupted, paraflex

LAWS = Path(__file__).parents[1] / "examples" / "laws.toml"
SHORT = {"duration": 0.1, "samples": 101}
WORDS = [str(word) for name, value in SHORT.items() for word in (f"--{name}", value)]


def pid(name="pd", stiffness=1.0, **more):
    return ControllerDescription(name, pf.JointPID(stiffness), 1e-3, **more)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """The laws of the example, of which the gauges' needs four motors."""
    head, motors = '[controller.gauges]\ntype = "rate-feedback"\n', 'outputs = ["tau1", "tau2", "tau5", "tau6"]\n'
    text = LAWS.read_text(encoding="utf-8")
    assert head in text
    path = tmp_path_factory.mktemp("laws") / "laws.toml"
    path.write_text(text.replace(head, head + motors), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def model(file):
    return pf.load(file)


@pytest.fixture(scope="module")
def five_bar():
    """A five-bar with a controller for both motors, and one for a motor alone."""
    controllers = {"pd": pid(), "left": pid("left", outputs=("left",))}
    return replace(pf.load("five_bar"), controllers=controllers)


@pytest.fixture(scope="module")
def compared(model):
    """Two laws and both together in two modes, of which one has not the motors of the gauges."""
    return pf.compare_laws(model, ["++++", "-+-+"], ["pd", "unprojected", "pd+gauges"], **SHORT)


def cell(result, law, mode):
    return result.data.sel(law=law, mode=mode)


# --- Cells ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["++++", "-+-+"])
@pytest.mark.parametrize("law", ["pd", "unprojected"])
def test_a_cell_has_the_numbers_of_the_same_single_run(model, compared, law, mode):
    task = model.plan(**SHORT)
    run = simulate_controlled(task, mode, model.acting([law]), options=model.study.integration())
    distance = np.linalg.norm(run.driven.actual - run.driven.desired, axis=1)
    found = cell(compared, law, mode)
    assert found["status"] == "complete"
    assert float(found["tracking_rms_motion"]) == pytest.approx(np.sqrt(np.mean(distance**2)), rel=1e-12)
    assert float(found["tracking_max_motion"]) == pytest.approx(distance.max(), rel=1e-12)
    assert float(found["peak_torque_max"]) == pytest.approx(np.abs(run.applied).max(), rel=1e-12)
    internal = np.linalg.norm(internal_torques(task, mode, run.applied), axis=1).max()
    assert float(found["internal_torque_max"]) == pytest.approx(internal, rel=1e-12, abs=1e-15)
    assert float(found["time_reached"]) == SHORT["duration"]


def test_the_open_loop_is_that_of_simulate(model, compared):
    run = pf.simulate(model.plan(**SHORT), "++++", options=model.study.integration())
    data = pf.tracking_dataset([run])
    found = cell(compared, "open loop", "++++")
    assert float(found["tracking_rms_motion"]) == pytest.approx(float(data["tracking_rms_motion"][0]), rel=1e-12)
    assert float(found["saturated_share"]) == 0.0


def test_controllers_joined_by_plus_act_together(model, compared):
    options, task = model.study.integration(), model.plan(**SHORT)
    both = simulate_controlled(task, "++++", model.acting(["pd", "gauges"]), options=options)
    found = float(cell(compared, "pd+gauges", "++++")["peak_torque_max"])
    assert found == pytest.approx(np.abs(both.applied).max(), rel=1e-12)
    assert found != pytest.approx(float(cell(compared, "pd", "++++")["peak_torque_max"]), rel=1e-4)


def test_results_do_not_depend_on_threads(model, compared):
    again = pf.compare_laws(model, ["++++", "-+-+"], ["pd", "unprojected", "pd+gauges"], workers=1, **SHORT)
    assert again.data.identical(compared.data)


def test_projection_takes_internal_torques_out(compared):
    """What the table is there for: four motors may strain links, two cannot."""
    internal = compared.data["internal_torque_max"]
    assert float(internal.sel(law="unprojected", mode="++++")) > 10.0 * float(internal.sel(law="pd", mode="++++"))
    assert float(internal.sel(law="unprojected", mode="-+-+")) < 1e-12


def test_a_study_with_few_coordinates_is_compared_with_them(five_bar):
    few = replace(five_bar, study=replace(five_bar.study, reduced=2))
    task = five_bar.plan(**SHORT)
    small = task.remodelled(reduced_mechanism(task, 2, modes=["++"]))
    expected = simulate_controlled(small, "++", [five_bar.controllers["pd"]], options=five_bar.study.integration())
    found = pf.compare_laws(few, laws=["pd"], metrics=["tracking_max"], **SHORT)
    distance = np.linalg.norm(expected.driven.actual - expected.driven.desired, axis=1)
    assert float(cell(found, "pd", "++")["tracking_max"]) == pytest.approx(distance.max(), rel=1e-12)


def test_python_laws_are_compared_and_start_anew_in_every_run(five_bar):
    """An object with a state gives the same whatever ran before it."""

    class Growing:
        def __init__(self):
            self.torque = 0.0

        def step(self, k, t, y):
            self.torque += 1e-3
            return np.full(2, self.torque)

    laws = {"grows": [pf.SampledController(Growing(), period=1e-3, name="growing")]}
    both = pf.compare_laws(five_bar, laws=laws, paths=["square", "line"], workers=1, **SHORT)
    alone = pf.compare_laws(five_bar, laws=laws, paths=["line"], **SHORT)
    assert both.laws[2:] == ("grows, square", "grows, line")
    for metric in ("tracking_rms_motion", "motor_energy"):
        found = float(cell(both, "grows, line", "++")[metric])
        assert found == float(cell(alone, "grows", "++")[metric])
        assert found != float(cell(alone, "open loop", "++")[metric])


# --- Failures ---------------------------------------------------------------------------------------------------------


def test_a_law_that_has_not_its_motors_is_a_marked_cell(compared):
    found = cell(compared, "pd+gauges", "-+-+")
    assert found["status"] == "invalid"
    assert "controller.gauges.outputs: unknown motor" in str(found["reason"].item())
    assert np.isnan([float(found[name]) for name in (*compared.metrics, "time_reached")]).all()
    assert (compared.data["status"] == "complete").sum() == 7
    assert compared.complete


def test_a_law_that_raises_is_a_marked_cell(five_bar):
    def raises(k, t, y):
        if k == 5:
            raise RuntimeError("no idea")
        return np.zeros(2)

    laws = {"raises": [pf.SampledController(raises, period=1e-3, name="raises")], "pd": [pid()]}
    found = pf.compare_laws(five_bar, laws=laws, **SHORT)
    failed = cell(found, "raises", "++")
    assert failed["status"] == "failed"
    assert "no idea" in str(failed["reason"].item())
    assert float(failed["time_reached"]) == pytest.approx(5e-3)
    assert cell(found, "pd", "++")["status"] == "complete"
    assert found.to_dict()["laws"]["raises"]["modes"]["++"]["tracking_rms_motion"] is None


def test_a_run_that_comes_apart_is_a_marked_cell(five_bar):
    wild = pid("wild", 1e7)
    found = pf.compare_laws(five_bar, laws={"wild": [wild]}, options=pf.IntegrationOptions(max_steps=2000), **SHORT)
    assert cell(found, "wild", "++")["status"] == "failed"
    assert cell(found, "open loop", "++")["status"] == "complete"


def test_an_interruption_keeps_what_is_there(five_bar, tmp_path):
    study = LawStudy({"line": five_bar.plan(**SHORT)}, laws_of(five_bar), ["++"])

    def stop(progress):
        if progress.done:
            raise KeyboardInterrupt

    found = study.run(tmp_path / "out", workers=Workers(number=1), on_progress=stop)
    assert found.interrupted
    assert not found.complete
    assert cell(found, "open loop", "++")["status"] == "complete"
    assert cell(found, "left", "++")["status"] == "not run"
    written = pf.load_results(tmp_path / "out")
    assert written.identical(found.data)


def test_nothing_is_written_of_a_comparison_that_was_not_begun(five_bar, tmp_path):
    def stop(progress):
        raise KeyboardInterrupt

    study = LawStudy({"line": five_bar.plan(**SHORT)}, laws_of(five_bar), ["++"])
    assert not study.run(tmp_path / "out", on_progress=stop).begun
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"laws": ["pdd"]}, r"controllers: unknown controller \(got 'pdd'\); did you mean \"pd\""),
        ({"laws": ["pd+"]}, r"controllers: names no controllers \(got 'pd\+'\)"),
        ({"laws": ["pd+none"]}, r"controllers: names no controllers"),
        ({"modes": ["+++"]}, r"not an actuation mode"),
        ({"paths": ["squre"]}, r"path: unknown path \(got 'squre'\); did you mean \"square\""),
        ({"metrics": ["tracking"]}, r"metrics: unknown metric \(got 'tracking'\)"),
        ({"metrics": ["travel"]}, r"metrics: a metric of statics"),
        ({"workers": 0}, r"--workers: must be positive"),
        ({"laws": {"a": [lambda k, t, y: y]}}, r"laws.a: not a list of controllers .*SampledController"),
        ({"laws": {"a": pid()}}, r"laws.a: not a list of controllers"),
        ({"model": 3}, r"model: not .*give a model, or the name or file of one"),
    ],
)
def test_what_cannot_be_compared(five_bar, arguments, said):
    with pytest.raises(InputError, match=said):
        pf.compare_laws(**{"model": five_bar} | arguments)


def test_processes_are_not_for_laws(five_bar):
    with pytest.raises(InputError, match="workers: laws run in threads"):
        LawStudy({"line": five_bar.plan(**SHORT)}, {"open loop": ()}, ["++"]).run(workers=Workers("processes"))
    with pytest.raises(InputError, match="laws: nothing to compare"):
        LawStudy({"line": five_bar.plan(**SHORT)}, {}, ["++"])


# --- Rows and columns -------------------------------------------------------------------------------------------------


def test_rows_are_in_the_order_of_the_file_after_the_open_loop(model):
    assert list(laws_of(model)) == ["open loop", "pd", "pid", "stiff", "unprojected", "gauges", "ct", "lqg",
                                    "pd+gauges"]  # fmt: skip
    assert list(laws_of(model, ["stiff", "pd", "stiff"])) == ["open loop", "stiff", "pd"]
    assert list(laws_of(model, ["none"])) == ["open loop"]
    assert [one.name for one in laws_of(model)["pd+gauges"]] == ["pd", "gauges"]


def test_a_name_with_a_plus_is_a_name_first(five_bar):
    named = replace(five_bar, controllers={"a": pid("a"), "b": pid("b"), "a+b": pid("a+b")})
    assert [one.name for one in laws_of(named, ["a+b"])["a+b"]] == ["a+b"]
    assert [one.name for one in laws_of(named, ["b+a"])["b+a"]] == ["b", "a"]


def test_along_several_paths_each_law_has_a_row_for_each(five_bar):
    found = pf.compare_laws(five_bar, laws=["pd"], paths=["line", "square"], **SHORT)
    assert found.laws == ("open loop, line", "open loop, square", "pd, line", "pd, square")
    assert found.data["path"].values.tolist() == ["line", "square"] * 2
    assert found.data["controllers"].values.tolist() == ["", "", "pd", "pd"]
    alone = pf.compare_laws(five_bar, laws=["pd"], paths=["square"], **SHORT)
    assert cell(found, "pd, square", "++")["peak_torque_max"] == cell(alone, "pd", "++")["peak_torque_max"]


def test_the_table_has_units_and_a_row_for_each_cell(compared):
    table = compared.table
    assert table[["law", "mode"]].values.tolist() == [[law, mode] for law in compared.laws for mode in compared.modes]
    assert table.attrs["units"] == {
        "law": "", "mode": "", "tracking_rms_motion": "m", "tracking_max_motion": "m", "residual_vibration": "m",
        "settling_time": "s", "overshoot": "m", "peak_torque_max": "N m", "internal_torque_max": "N m",
        "motor_energy": "J", "saturated_share": "", "validity": "", "status": "", "reason": "", "time_reached": "s",
        "controllers": "", "path": "",
    }  # fmt: skip
    assert table["residual_vibration"].isna().all()  # the runs end within the motion


def test_errors_are_those_that_the_study_ranks_by(five_bar):
    whole = replace(five_bar, study=replace(five_bar.study, error="whole"))
    assert pf.compare_laws(whole, laws=["none"], **SHORT).metrics[:2] == ("tracking_rms", "tracking_max")


def test_metrics_of_every_motor_are_columns(five_bar):
    found = pf.compare_laws(five_bar, laws=["pd"], metrics=["peak_torque", "tracking_max"], **SHORT)
    assert found.metrics == ("peak_torque.left", "peak_torque.right", "tracking_max", "validity")
    assert found.data["peak_torque.left"].attrs["units"] == "N m"


# --- The figure -------------------------------------------------------------------------------------------------------


def test_the_figure_shows_every_cell(compared):
    figure = plots.law_comparison(compared.data)
    # The runs end within the motion: there is no vibration after it.
    assert [panel.get_title() for panel in figure.axes] == [
        "RMS error in the motion", "peak torque", "largest error in the motion"
    ]  # fmt: skip
    panel = figure.axes[0]
    assert [text.get_text() for text in panel.get_yticklabels()] == list(compared.laws)
    errors = compared.data["tracking_rms_motion"]
    shown = {line.get_label(): line for line in panel.get_lines()}
    for mode, colour in (("++++", BLUE), ("-+-+", VERMILLION)):
        line = shown[f"mode {mode}"]
        assert to_hex(line.get_color()) == colour.lower()
        factor = {"[mm]": 1e3, "[µm]": 1e6}[panel.get_xlabel()]
        assert np.asarray(line.get_xdata()) == pytest.approx(factor * errors.sel(mode=mode).values, nan_ok=True)
        assert np.asarray(line.get_ydata()).round().tolist() == [0.0, 1.0, 2.0, 3.0]
    crosses = [line for line in panel.get_lines() if line.get_marker() == "x" and np.size(line.get_xdata())]
    assert [np.asarray(line.get_ydata()).round().tolist() for line in crosses] == [[3.0]]
    assert to_hex(crosses[0].get_color()) == VERMILLION.lower()
    assert "not run to the end" in shown


def test_the_figure_marks_models_that_do_not_hold(compared):
    data = compared.data.copy()
    data["validity"] = data["validity"].where(data["law"] != "pd", 2.0)
    panel = plots.law_comparison(data).axes[0]
    hollow = [line for line in panel.get_lines() if line.get_markerfacecolor() == "white" and np.size(line.get_xdata())]
    there = [np.flatnonzero(np.isfinite(np.asarray(line.get_xdata(), dtype=float))).tolist() for line in hollow]
    assert there == [[1], [1]]
    filled = next(line for line in panel.get_lines() if line.get_label() == "mode ++++")
    assert np.isnan(np.asarray(filled.get_xdata())[1])


def test_no_figure_where_no_law_ran(five_bar):
    found = pf.compare_laws(five_bar, laws=["none"], options=pf.IntegrationOptions(max_steps=1), **SHORT)
    assert found.data["status"].values.tolist() == [["failed"]]
    with pytest.raises(InputError, match="no law ran in any mode"):
        plots.law_comparison(found.data)


# --- The command ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def done(tmp_path_factory, file):
    folder = tmp_path_factory.mktemp("compared")
    chosen = ["--mode", "++++", "--mode=-+-+", "--controller", "pd", "--controller", "pd+gauges"]
    return paraflex("control", "compare", file, *WORDS, *chosen, "--output", folder / "out", cwd=folder), folder / "out"


def test_the_command_writes_table_numbers_and_figure(done, compared):
    answer, out = done
    assert answer.returncode == 0, answer.stderr
    assert {file.name for file in out.glob("[!.]*")} == {"laws.nc", "laws.json", "laws.csv", "figures", "manifest.json"}
    assert {file.name for file in (out / "figures").iterdir()} == {"law_comparison.png", "law_comparison.svg"}
    table = pd.read_csv(out / "laws.csv")
    assert table.columns[:4].tolist() == ["law", "mode", "tracking_rms_motion [m]", "tracking_max_motion [m]"]
    assert table["law"].tolist() == ["open loop", "open loop", "pd", "pd", "pd+gauges", "pd+gauges"]
    found = json.loads((out / "laws.json").read_text(encoding="utf-8"))
    expected = float(cell(compared, "pd", "++++")["peak_torque_max"])
    assert found["laws"]["pd"]["modes"]["++++"]["peak_torque_max"] == expected
    assert found["laws"]["pd+gauges"]["controllers"] == ["pd", "gauges"]
    assert found["parameters"]["run"]["modes"] == ["++++", "-+-+"]
    assert pf.load_results(out)["peak_torque_max"].sel(law="pd", mode="++++") == expected


def test_the_command_prints_a_block_for_each_mode(done, compared):
    lines = done[0].stdout.splitlines()
    at = next(k for k, line in enumerate(lines) if line.split()[:3] == ["++++", "open", "loop"])
    assert [line.split()[0] for line in lines[at : at + 6]] == ["++++", "pd", "pd+gauges", "-+-+", "pd", "pd+gauges"]
    error = 1e3 * float(cell(compared, "pd", "++++")["tracking_rms_motion"])
    assert lines[at + 1].split()[1:3] == ["complete", f"{error:.3g}"]
    assert lines[at + 5].split()[1] == "invalid"
    assert "pd+gauges in -+-+: invalid, controller.gauges.outputs: unknown motor (got 'tau1')" in done[0].stdout
    assert all(len(line) <= 80 for line in lines[: at + 6])


def test_what_has_room_is_one_table(compared, capsys):
    console = PlainConsole()
    console.width = 200
    print_laws(console, compared)
    printed = capsys.readouterr().out
    assert "continued" not in printed
    row = next(line for line in printed.splitlines() if line.split()[:1] == ["unprojected"])
    # Law, status and nine numbers.
    assert len(row.split()) == 11


def test_a_second_comparison_says_what_it_replaces(done, file):
    _, out = done
    answer = paraflex("control", "compare", "five_bar", *WORDS, "--output", out)
    assert answer.returncode == 0
    assert f"{out} holds a comparison of control laws of {file}" in answer.stderr
    # A model without controllers has the open loop alone.
    assert list(json.loads((out / "laws.json").read_text())["laws"]) == ["open loop"]
    assert paraflex("run", "five_bar", *WORDS, "--out", out).returncode == 2


def test_the_command_prints_json(tmp_path):
    answer = paraflex("control", "compare", "five_bar", *WORDS, "--json", "--metric", "tracking_max", cwd=tmp_path)
    found = json.loads(answer.stdout)
    assert list(found["metrics"]) == ["tracking_max", "validity"]
    assert found["laws"]["open loop"]["modes"]["++"]["status"] == "complete"
    assert (tmp_path / CompareLawsRequest().out / "laws.json").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([LAWS, "--controller", "pdd"], r"--controller: unknown controller (got 'pdd'); did you mean"),
        ([LAWS, "--mode", "+++"], "--mode: not an actuation mode (got '+++')"),
        ([LAWS, "--metric", "peak"], "--metric: unknown metric (got 'peak')"),
        ([LAWS, "--path", "squre"], "laws.toml: path: unknown path (got 'squre'); did you mean \"square\"?"),
        ([LAWS, "--path", "square", "--path", "square"], "--path: is named twice (got 'square')"),
        ([LAWS, "--method", "esdirk9"], "--method: unknown method"),
        ([LAWS, "--workers", "0"], "--workers: must be positive (got 0)"),
        (["pendulum"], "path: the model has no path"),
        (["nothing.toml"], "nothing.toml"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(tmp_path, words, said):
    answer = paraflex("control", "compare", *words, *WORDS, "--output", "out", cwd=tmp_path)
    assert answer.returncode == 2
    (line,) = (line for line in answer.stderr.splitlines() if line.strip())
    assert said in line
    assert not (tmp_path / "out").exists()


def test_modes_that_cannot_be_driven_are_marked_and_alone_are_exit_code_1(tmp_path):
    answer = paraflex("control", "compare", "five_bar", *WORDS, "--mode", "left", "--output", tmp_path / "out")
    assert answer.returncode == 1
    assert "open loop in +-: failed, " in answer.stdout
    assert json.loads((tmp_path / "out" / "laws.json").read_text())["laws"]["open loop"]["modes"]["+-"]["reason"]
    assert not (tmp_path / "out" / "figures").exists()
    both = paraflex("control", "compare", "five_bar", *WORDS, "--mode", "left", "--mode", "++", "--output", tmp_path)
    assert both.returncode == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["animate", "film.svg"], "a comparison of control laws keeps no motions; paraflex plot draws law_comparison"),
        (["report"], "a comparison of control laws has no report; laws.csv has its table"),
    ],
)
def test_a_comparison_has_no_film_and_no_report(done, tmp_path, words, said):
    command, *rest = words
    answer = paraflex(command, done[1], *rest, cwd=tmp_path)
    assert answer.returncode == 2
    (line,) = answer.stderr.splitlines()
    assert said in line
    assert not any(tmp_path.iterdir())


def test_ctrl_c_ends_it_in_one_line(tmp_path):
    long = ["--duration", "30", "--samples", "3001", "--controller", "pd"]
    said = interrupted("control", "compare", str(LAWS), *long, "--output", str(tmp_path / "out"))
    assert "interrupted before any law had run; nothing is written" in str(said)
    assert not (tmp_path / "out").exists()


def test_help_of_the_group_lists_it():
    assert "compare" in paraflex("control", "--help").stdout
    assert "--controller" in paraflex("control", "compare", "--help").stdout
