"""Stated deviations of identified parameters hold as often as they say, or are not given."""

import json
from html import unescape

import numpy as np
import pytest

from made_up import STUDY, made_up, write_study
from paraflex.plots import targets_reached
from paraflex.studies import identify, load_identification
from paraflex.studies.optimisation.identify import ONE_DEVIATION, student_factor
from paraflex.studies.optimisation.slopes import NOISE_POINTS, noise_of

FITS = 60
# Five standard deviations of a binomial distribution would let anything pass; two and a half, one correct code in 80.
SIGMAS = 2.5
KNOWN = {"x": 0.0052, "y": 0.31}
METRICS = {
    "tracking_rms": lambda mode, x, y: (2.0 if mode == "++++" else 1.5) * np.exp(80.0 * x) + np.log(y),
    "peak_torque_max": lambda mode, x, y: 3.0 + 400.0 * x * (1.0 if mode == "++++" else -0.5) + 0.8 * y,
    "total_mass": lambda mode, x, y: 4.0 + 150.0 * x - 0.5 * np.log(y),
}
SEVERAL = STUDY.replace('["++++"]', '["++++", "+++-"]')


def study_with(folder, values, deviation=1.0, more=""):
    targets = [
        f'[[target]]\nmetric = "{metric}"\nmode = "{mode}"\nvalue = {value!r}\nrelative = false\n'
        f"weight = {1.0 / deviation!r}\n"
        for (metric, mode), value in values.items()
    ]
    return load_identification(write_study(folder, SEVERAL + "".join(targets) + "[search]\nevaluations = 400\n" + more))


def exact_values(chosen):
    return {(metric, mode): float(METRICS[metric](mode, *KNOWN.values())) for metric, mode in chosen}


def fitted(folder, chosen, deviation, seed):
    """A fit of measurements that scatter by a known deviation."""
    folder.mkdir()
    random = np.random.default_rng(seed)
    values = {key: value + deviation * float(random.standard_normal()) for key, value in exact_values(chosen).items()}
    return identify(study_with(folder, values), folder / "out", run=made_up(**METRICS), workers=1)


THREE = [("tracking_rms", "++++"), ("peak_torque_max", "++++"), ("total_mass", "++++")]
SIX = [(metric, mode) for metric in METRICS for mode in ("++++", "+++-")]


@pytest.mark.parametrize("chosen", [THREE, SIX], ids=["freedom 1", "freedom 4"])
def test_two_fits_of_three_lie_within_one_stated_deviation(tmp_path, chosen):
    """68.27 % of seeded fits, to what so many of them can scatter by; errors without Student's factor are too small."""
    results = [fitted(tmp_path / str(seed), chosen, 2e-3, seed) for seed in range(FITS)]
    scatter = SIGMAS * np.sqrt(ONE_DEVIATION * (1.0 - ONE_DEVIATION) / FITS)
    for name, known in KNOWN.items():
        away = np.array([abs(result.values[name] - known) for result in results])
        stated = np.array([result.confidence.deviations[name] for result in results], dtype=float)
        errors = np.array([result.confidence.errors[name] for result in results], dtype=float)
        assert np.all(np.isfinite(stated))
        assert np.mean(away < stated) == pytest.approx(ONE_DEVIATION, abs=scatter)
        if len(chosen) == 3:
            assert np.mean(away < errors) < ONE_DEVIATION - scatter


def test_factors_are_those_of_student():
    """One degree of freedom is Cauchy's distribution, two have a closed form, many are normal."""
    assert student_factor(1) == pytest.approx(np.tan(0.5 * np.pi * ONE_DEVIATION))
    assert student_factor(2) == pytest.approx(np.sqrt(2.0 * ONE_DEVIATION**2 / (1.0 - ONE_DEVIATION**2)))
    assert student_factor(10**7) == pytest.approx(1.0, abs=1e-6)


def rough(metric, amplitude):
    """A metric with noise as that of an integrator: the same for the same design, and wild from one to the next."""

    def value(mode, x, y):
        seed = np.array([x, y, amplitude]).view(np.uint64)
        return METRICS[metric](mode, x, y) + amplitude * float(np.random.default_rng(seed).standard_normal())

    return value


def test_where_noise_rules_no_deviation_is_stated(tmp_path):
    """Runs that scatter by more than the measurements: None with the reason, in Python, JSON and the table."""
    values = {key: value + 1e-4 * (-1) ** k for k, (key, value) in enumerate(exact_values(SIX).items())}
    noisy = {metric: rough(metric, 3e-2) for metric in METRICS}
    result = identify(study_with(tmp_path, values), tmp_path / "out", run=made_up(**noisy), workers=1)
    assert result.confidence.deviations == {"x": None, "y": None}
    assert "noise of the runs" in result.confidence.reasons["x"]
    told = json.loads((tmp_path / "out" / "result.json").read_text())["confidence"]
    assert told["deviations"] == {"x": None, "y": None}
    assert told["reasons"] == dict(result.confidence.reasons)
    assert f"No interval of confidence of x, y: {result.confidence.reasons['x']}" in unescape(result._repr_html_())
    assert targets_reached(result.to_dict()).axes


def test_a_step_against_noise_finds_what_a_short_one_does_not(tmp_path):
    """Noise of 1e-4 of the metrics: with the step that fits it, the parameters come out; the fit says differences."""
    noisy = {metric: rough(metric, 2e-4) for metric in METRICS}
    values = exact_values(SIX)
    found = {}
    for name, more in (("chosen", ""), ("short", "difference = 1e-5\n")):
        folder = tmp_path / name
        folder.mkdir()
        result = identify(study_with(folder, values, more=more), folder / "out", run=made_up(**noisy), workers=1)
        found[name] = abs(result.values["x"] / KNOWN["x"] - 1.0)
        assert result.derivatives == "differences"
    assert found["chosen"] < 0.01
    assert found["chosen"] < 0.2 * found["short"]


@pytest.mark.parametrize("deviation", [1e-9, 1e-4, 0.1])
def test_noise_is_measured_and_smooth_functions_have_none(deviation):
    random = np.random.default_rng(4)
    x = np.linspace(0.3, 0.302, NOISE_POINTS)
    smooth = np.stack([np.exp(3.0 * x), np.sin(20.0 * x), x**3], axis=1)
    estimates = [noise_of(smooth + deviation * random.standard_normal(smooth.shape)) for _ in range(50)]
    assert np.sqrt(np.mean(np.square(estimates))) == pytest.approx(deviation, rel=0.3)
    assert noise_of(smooth).max() < 1e-14
