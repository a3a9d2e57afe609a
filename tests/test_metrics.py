"""The table of metrics: what one entry of it reaches."""

import json

import numpy as np
import pandas as pd
import pytest

import paraflex as pf
from paraflex.designs.measure import measure
from paraflex.figures.designs import read_designs
from paraflex.results import summary
from paraflex.results.following import FOLLOWING, KEPT_METRICS
from paraflex.results.metrics import METRICS, PATH, metric_label
from paraflex.tracking import plan_tracking

METRIC = "motor_power_max"
# So damped that a largest power is not one of vibrations, of which other ones are the largest in other designs.
MODEL = pf.library.text("five_bar").replace("elements = 3\n", "elements = 3\ndamping = { ratios = [0.3] }\n")
STUDY = f"""
mechanism = "model.toml"
paths = ["line"]
duration = 0.05
samples = 26
metrics = ["{METRIC}"]

[integration]
step = 1e-3
tolerance = 1e-9

[vary.thickness]
fields = ["section.bar.thickness"]
"""
# What a search says besides.
RANGE = "low = 0.004\nhigh = 0.006\n"
OBJECTIVE = f"""
[objective]
minimise = {{ {METRIC} = 1.0 }}

[[objective.at_most]]
metric = "{METRIC}"
value = 1e3

[search]
evaluations = 3
gradients = "exact"
"""


def write(folder, text):
    (folder / "model.toml").write_text(MODEL, encoding="utf-8")
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder / "study.toml"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    file = tmp_path_factory.mktemp("model") / "model.toml"
    file.write_text(MODEL, encoding="utf-8")
    model = pf.load(file)
    task = plan_tracking(model, "line", duration=0.05, samples=26, assembly="outward")
    return task.simulate("++", options=pf.IntegrationOptions(step=1e-3, tolerance=1e-9))


def test_a_metric_of_the_table_reaches_sweeps_and_figures(tmp_path, run):
    done = pf.sweep(write(tmp_path, STUDY + "values = [0.005]\n"), tmp_path / "out", workers=1)
    table = pd.read_parquet(done.table)
    assert table[METRIC].item() == measure(run, (METRIC,))[METRIC]
    shown = read_designs([done.table])
    assert shown.labelled(METRIC) == ("largest motor power [W]", 1.0)
    assert metric_label(METRIC) == "largest motor power"


def test_a_metric_of_the_table_has_derivatives(tmp_path, run):
    found = pf.sensitivities(write(tmp_path, STUDY))
    assert (found.metrics, found.units) == ((METRIC,), ("W",))
    assert found.values.item() == measure(run, (METRIC,))[METRIC]
    near = {}
    for thickness in (0.00499, 0.00501):
        (tmp_path / str(thickness)).mkdir()
        text = STUDY + f"values = [{thickness}]\n"
        done = pf.sweep(write(tmp_path / str(thickness), text), tmp_path / str(thickness) / "out", workers=1)
        near[thickness] = pd.read_parquet(done.table)[METRIC].item()
    difference = (near[0.00501] - near[0.00499]) / 2e-5
    assert found.derivatives.item() == pytest.approx(difference, rel=1e-4)


def test_a_metric_of_the_table_is_an_objective_a_limit_and_a_target(tmp_path):
    result = pf.optimise(write(tmp_path, STUDY + RANGE + OBJECTIVE), tmp_path / "least", workers=1)
    # Thin links are light.
    assert result.metrics[METRIC] < result.start_metrics[METRIC]
    table = pd.read_parquet(result.table)
    assert np.isfinite(table[f"slope.{METRIC}.thickness"]).any()
    aim = 0.5 * (result.metrics[METRIC] + result.start_metrics[METRIC])
    target = f'\n[[target]]\nmetric = "{METRIC}"\nvalue = {aim!r}\n'
    found = pf.identify(write(tmp_path, STUDY + RANGE + target), tmp_path / "found", workers=1)
    assert found.targets[0].reached == pytest.approx(aim, rel=1e-4)
    assert found.derivatives == "exact"


def test_a_metric_of_the_table_has_indices(tmp_path):
    pytest.importorskip("SALib")
    found = pf.indices(write(tmp_path, STUDY + RANGE), tmp_path / "out", samples=16, workers=1)
    assert found.data["metric"].values[0] == METRIC
    assert found.data["total"].values[0].item() == pytest.approx(1.0, abs=0.2)


def test_datasets_hold_what_sweeps_measure(run):
    """All metrics that are kept, under one name with one unit and meaning, and one value but for rounding."""
    data = pf.tracking_dataset([run])
    figures = summary(data)["modes"]["++"]
    measured = measure(run, tuple(name for name, metric in METRICS.items() if PATH in metric.runs))
    for name in KEPT_METRICS:
        metric = METRICS[name]
        assert data[name].attrs["comment"] == metric.meaning
        for column, value in zip(
            metric.columns({"motor": ["left", "right"]}), np.ravel(data[name].values), strict=True
        ):
            assert measured[column] == pytest.approx(value, rel=1e-12, nan_ok=True), name
    for name in (*FOLLOWING, "deflection_max", "actuation_condition_max"):
        told = np.nan if figures[name] is None else figures[name]
        assert measured[name] == pytest.approx(told, rel=1e-9, nan_ok=True), name
    json.dumps(figures)


def test_every_metric_has_a_meaning_and_a_unit():
    for name, metric in METRICS.items():
        assert (metric.name, bool(metric.meaning), bool(metric.unit)) == (name, True, True)
        # Datasets call their variables by the label.
        assert metric.label or not metric.kept
