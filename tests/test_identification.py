"""Identification: known parameters found again, what the data can tell, failures, bad input, the command."""

import json

import numpy as np
import pytest

from made_up import STUDY, made_up, write_study
from paraflex.designs.run import Task, run_task
from paraflex.errors import InputError
from paraflex.plots import targets_reached
from paraflex.studies import identify, load_identification
from paraflex.studies.optimisation.fit import residual_slopes
from paraflex.studies.optimisation.identify import confidence
from shell import paraflex

TARGET = """
[[target]]
metric = "%s"
value = %r
%s
"""


def study_of(folder, *targets, text=STUDY, **search):
    lines = [f"{name} = {json.dumps(value)}" for name, value in search.items()]
    return load_identification(write_study(folder, "\n".join([text, *targets, "[search]", *lines])))


def test_a_thickness_is_found_from_its_tracking_errors(tmp_path):
    """Errors of two modes, made with a thickness; found from another one to a ten-thousandth."""
    text = STUDY.split("[vary.y]")[0].replace('["++++"]', '["++++", "+++-"]')
    text = text.replace("low = 0.002", "low = 0.005\nstart = 0.0055").replace("high = 0.008", "high = 0.007")
    # Steps of one length: runs of near designs differ by nothing else, and want no small tolerance for it.
    text = text.replace("tolerance = 1e-4", "step = 1e-3")
    known = 0.0061
    first = study_of(tmp_path, TARGET % ("tracking_rms", 1.0, 'mode = "++++"'), text=text)
    made = run_task(first.setting, Task(0, 0, (known,), "line")).rows
    targets = [TARGET % ("tracking_rms", row["tracking_rms"], f'mode = "{row["mode"]}"') for row in made]
    result = identify(study_of(tmp_path, *targets, text=text, evaluations=60), tmp_path / "out")
    assert result.values["x"] == pytest.approx(known, rel=1e-4)
    assert result.start_residual > 0.05
    assert result.residual < 1e-4
    assert [each.target.mode for each in result.targets] == ["++++", "+++-"]
    assert result.targets[0].reached == pytest.approx(made[0]["tracking_rms"], rel=1e-4)
    assert result.evaluations < 60
    assert result.confidence is not None
    assert result.confidence.condition == pytest.approx(1.0)
    assert (tmp_path / "out" / "best.toml").exists()


def line(x, y):
    """Linear in the unit cube: y is logarithmic."""
    return 1.0 + 4.0 * (x - 0.002) / 0.006 + 2.0 * np.log10(y / 0.1)


METRICS = {
    "tracking_rms": lambda mode, x, y: line(x, y),
    "peak_torque_max": lambda mode, x, y: 2.0 + 3.0 * (x - 0.002) / 0.006 - np.log10(y / 0.1),
    "total_mass": lambda mode, x, y: 5.0 + (x - 0.002) / 0.006,
}


def linear_targets():
    """Three numbers of x = 0.0035, y = 10^-0.5, the third with an error."""
    x, y = 0.0035, 10**-0.5
    exact = [formula("", x, y) for formula in METRICS.values()]
    values = [*exact[:2], exact[2] + 0.1]
    return [TARGET % (name, float(value), "relative = false") for name, value in zip(METRICS, values, strict=True)]


def test_deviations_are_those_of_a_linear_model(tmp_path):
    """Solution and covariance s^2 (J^T J)^-1 from the normal equations."""
    more = TARGET % ("tracking_rms", float(line(0.0035, 10**-0.5)) - 0.2, "relative = false")
    result = identify(study_of(tmp_path, *linear_targets(), more), tmp_path / "out", run=made_up(**METRICS))
    jacobian = np.array([[4.0, 2.0], [3.0, -1.0], [1.0, 0.0], [4.0, 2.0]])
    data = jacobian @ [0.25, 0.5] + [0.0, 0.0, 0.1, -0.2]
    unit = np.linalg.solve(jacobian.T @ jacobian, jacobian.T @ data)
    left = data - jacobian @ unit
    covariance = left @ left / 2.0 * np.linalg.inv(jacobian.T @ jacobian)
    values = [0.002 + 0.006 * unit[0], 0.1 * 10 ** unit[1]]
    assert list(result.values.values()) == pytest.approx(values, rel=1e-6)
    assert [each.residual for each in result.targets] == pytest.approx(-left, abs=1e-6)
    assert result.residual == pytest.approx(np.sqrt(left @ left / 4.0), rel=1e-6)
    found = result.confidence
    assert found is not None
    scale = np.array([0.006, values[1] * np.log(10.0)])
    errors = np.sqrt(np.diag(covariance)) * scale
    assert list(found.errors.values()) == pytest.approx(errors, rel=1e-5)
    # Of two degrees of freedom: P(|t| < x) = x / sqrt(2 + x^2).
    factor = np.sqrt(2.0 * 0.6826894921**2 / (1.0 - 0.6826894921**2))
    assert list(found.deviations.values()) == pytest.approx(factor * errors, rel=1e-5)
    assert (found.freedom, found.reasons) == (2, {})
    correlation = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert found.correlation == pytest.approx(np.array([[1.0, correlation], [correlation, 1.0]]), rel=1e-5)
    assert found.condition == pytest.approx(np.linalg.cond(jacobian), rel=1e-5)
    assert found.identifiable


def test_weights_and_relative_residuals(tmp_path):
    """One parameter, two targets that contradict: the weighted mean of what each asks for."""
    text = STUDY.split("[vary.y]")[0]
    targets = [
        TARGET % ("tracking_rms", 2.0, "weight = 1.0"),
        TARGET % ("peak_torque_max", 8.0, "weight = 3.0"),
    ]
    run = made_up(tracking_rms=lambda mode, x: 400.0 * x, peak_torque_max=lambda mode, x: 1000.0 * x)
    result = identify(study_of(tmp_path, *targets, text=text), tmp_path / "out", run=run)
    # Residuals 200 x - 1 and 3 (125 x - 1).
    assert result.values["x"] == pytest.approx((200.0 + 9.0 * 125.0) / (200.0**2 + 9.0 * 125.0**2), rel=1e-6)
    assert [each.residual for each in result.targets] == pytest.approx(
        [200.0 * result.values["x"] - 1.0, 3.0 * (125.0 * result.values["x"] - 1.0)], rel=1e-9
    )


def test_parameters_that_the_data_cannot_tell_apart(tmp_path):
    """Two metrics of one combination: the condition says so, and the direction that changes nothing."""
    targets = [TARGET % (name, 3.0, "") for name in ("tracking_rms", "peak_torque_max")]
    run = made_up(tracking_rms=lambda mode, x, y: line(x, y), peak_torque_max=lambda mode, x, y: line(x, y) ** 2 / 3.0)
    result = identify(study_of(tmp_path, *targets), tmp_path / "out", run=run)
    assert result.residual < 1e-6
    found = result.confidence
    assert found is not None
    assert not found.identifiable
    along = np.array(list(found.weakest.values()))
    assert abs(along @ [1.0, -2.0]) / np.sqrt(5.0) == pytest.approx(1.0, abs=1e-4)
    told = json.loads((tmp_path / "out" / "result.json").read_text())["confidence"]
    assert told["telling"] is False
    assert told["deviations"] == {"x": None, "y": None}


def test_fewer_targets_than_parameters(tmp_path):
    result = identify(study_of(tmp_path, TARGET % ("tracking_rms", 3.0, "")), tmp_path / "out", run=made_up(**METRICS))
    found = result.confidence
    assert found is not None
    assert found.condition == np.inf
    assert found.deviations == {"x": None, "y": None}
    assert found.reasons["x"] == "1 targets are too few to judge 2 free parameters"
    assert json.loads((tmp_path / "out" / "result.json").read_text())["confidence"]["condition"] is None


def test_a_parameter_at_its_bound_has_no_deviation(tmp_path):
    """The total mass asks for less than the range allows."""
    targets = [TARGET % ("total_mass", 4.0, "weight = 10.0"), TARGET % ("tracking_rms", 2.0, "")]
    result = identify(study_of(tmp_path, *targets), tmp_path / "out", run=made_up(**METRICS))
    assert result.bounds == {"x": "low"}
    assert result.confidence is not None
    assert result.confidence.free == ("y",)
    assert result.confidence.deviations["x"] is None
    assert result.confidence.reasons == {"x": "at its low bound"}
    assert result.confidence.deviations["y"] is not None


def test_all_parameters_at_bounds(tmp_path):
    study = study_of(tmp_path, *linear_targets())
    folder = tmp_path / "out"
    result = identify(study, folder, run=made_up(**METRICS))
    assert result.confidence is not None
    from paraflex.studies.optimisation.evaluate import EvaluatedDesign

    design = EvaluatedDesign(0, tuple(result.values.values()), (), ())
    slopes = {name: np.ones((1, 2)) for name in METRICS}
    found = confidence(study, study.targets, design, residual_slopes(study.targets, slopes), {"x": "low", "y": "low"})
    assert found.free == ()
    assert found.condition == 1.0


def test_trials_that_fail_shorten_the_step(tmp_path):
    """From the start Newton's step leads beyond x = 0.0057, where nothing runs; the solution is this side of it."""

    def rising(mode, x):
        if x > 0.0057:
            raise ValueError("out of reach")
        return np.exp(8.0 * (x - 0.0055) / 0.006)

    text = STUDY.split("[vary.y]")[0].replace("low = 0.002", "low = 0.002\nstart = 0.0045")
    study = study_of(tmp_path, TARGET % ("tracking_rms", 1.0, ""), text=text)
    result = identify(study, tmp_path / "out", run=made_up(tracking_rms=rising))
    assert result.failed > 0
    assert result.values["x"] == pytest.approx(0.0055, rel=1e-5)


def test_samples_find_the_hollow(tmp_path):
    """A wave with several hollows: from the start alone the nearest, from samples the deepest."""
    text = STUDY.split("[vary.y]")[0].replace("low = 0.002", "low = 0.002\nstart = 0.0028")
    target = TARGET % ("tracking_rms", 1.0, "")
    run = made_up(
        tracking_rms=lambda mode, x: 1.0 + abs(x - 0.007) * 100.0 + 0.2 * (1.0 - np.cos(2000.0 * (x - 0.007)))
    )
    alone = identify(study_of(tmp_path, target, text=text, evaluations=60), tmp_path / "alone", run=run)
    sampled = identify(study_of(tmp_path, target, text=text, samples=16, evaluations=60), tmp_path / "out", run=run)
    assert sampled.residual < 0.1 * alone.residual
    assert sampled.values["x"] == pytest.approx(0.007, abs=1e-4)


def test_stopped_at_the_limit_nothing_is_said_of_confidence(tmp_path):
    study = study_of(tmp_path, *linear_targets(), evaluations=3)
    result = identify(study, tmp_path / "out", run=made_up(**METRICS))
    assert result.stopped == "evaluations = 3 are done"
    assert result.confidence is None
    assert result.evaluations == 3
    more = identify(study_of(tmp_path, *linear_targets(), evaluations=50), tmp_path / "out", run=made_up(**METRICS))
    assert more.confidence is not None
    assert more.fresh == more.evaluations - 3


def test_interrupted(tmp_path):
    study = study_of(tmp_path, *linear_targets())

    def stop(progress):
        if progress.done == 4:
            assert progress.best is not None
            raise KeyboardInterrupt

    stopped = identify(study, tmp_path / "out", run=made_up(**METRICS), on_progress=stop)
    assert stopped.interrupted
    assert stopped.evaluations == 4
    again = identify(study, tmp_path / "out", run=made_up(**METRICS))
    whole = identify(study, tmp_path / "whole", run=made_up(**METRICS))
    assert again.fresh == again.evaluations - 4
    assert again.table.read_bytes() == whole.table.read_bytes()


def test_a_start_that_does_not_run(tmp_path):
    def out(mode, x, y):
        raise ValueError("out of reach")

    with pytest.raises(InputError, match=r"the start cannot be run \(line, .* out of reach\)"):
        identify(study_of(tmp_path, *linear_targets()), tmp_path / "out", run=made_up(tracking_rms=out))


def test_a_target_may_have_a_unit(tmp_path):
    text = TARGET % ("tracking_rms", 0.0, "")
    study = study_of(tmp_path, text.replace("value = 0.0", 'value = "1.1 mm"'))
    (target,) = study.targets
    assert (target.value, type(target.value)) == (0.0011, float)
    text = TARGET % ("peak_torque.tau1", 0.0, "")
    (target,) = study_of(tmp_path, text.replace("value = 0.0", 'value = "7 Nmm"')).targets
    assert target.value == 0.007


def test_the_figure_shows_every_target(tmp_path):
    result = identify(study_of(tmp_path, *linear_targets()), tmp_path / "out", run=made_up(**METRICS))
    figure = targets_reached(result.to_dict())
    panel = figure.axes[0]
    names = [text.get_text() for text in panel.get_yticklabels()]
    assert names == ["RMS tracking error", "peak torque", "mass"]
    best = next(each for each in panel.get_lines() if each.get_label() == "best")
    ratios = [each.reached / each.target.value for each in result.targets]
    assert list(best.get_xdata()) == pytest.approx(ratios)
    with pytest.raises(InputError, match="nothing to show"):
        targets_reached({"targets": []})


ONE = TARGET % ("tracking_rms", 1.0, "")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (ONE, "", "target: is missing"),
        ("value = 1.0", "value = 0.0", "target.0.value: nothing is relative to zero (got 0.0); write relative = false"),
        ("value = 1.0", "value = 1.0\nweight = 0.0", "target.0.weight: must be positive"),
        ("value = 1.0", 'value = "1 kg"', "target.0.value: a quantity in kg where one in m is asked for (got '1 kg')"),
        ("value = 1.0", 'value = "1 mn"', "target.0.value"),
        ("value = 1.0", 'value = 1.0\nmode = "+++"', "target.0.mode: the study has none of that name (got '+++')"),
        ("value = 1.0", 'value = 1.0\npath = "squares"', "target.0.path: the study has none of that name"),
        (
            '["++++"]',
            '["++++", "+++-"]',
            "target.0.mode: the study has several, and none is named; choose from ++++, +++-",
        ),
        ('metric = "tracking_rms"', 'metric = "tracking"', "target.0.metric: unknown metric (got 'tracking')"),
        ("[vary.x]", '[search]\nmethod = "slsqp"\n[vary.x]', "search.method: an identification is a problem of least"),
    ],
)
def test_bad_studies_say_what_to_do(tmp_path, old, new, says):
    text = STUDY + ONE
    assert old in text
    with pytest.raises(InputError) as caught:
        load_identification(write_study(tmp_path, text.replace(old, new)))
    assert says in str(caught.value)
    assert "study.toml" in str(caught.value)


def test_command_line(tmp_path):
    targets = [TARGET % ("tracking_rms", 1e-4, ""), TARGET % ("peak_torque_max", 10.0, "")]
    file, out = write_study(tmp_path, STUDY + "".join(targets) + "[search]\nevaluations = 4\n"), tmp_path / "out"
    done = paraflex("identify", file, "--output", out)
    assert done.returncode == 0, done.stderr
    assert "peak torque" in done.stdout
    assert "root mean square residual" in done.stdout
    assert {file.name for file in (out / "figures").iterdir()} >= {"convergence.png", "targets.png"}
