"""Sobol indices through the sweep: known ones of formulas, what is left out, bad input, the command."""

import json
import sys

import numpy as np
import pandas as pd
import pytest

from made_up import STUDY, made_up, write_study
from paraflex.errors import InputError
from paraflex.plots import sobol_bars
from paraflex.studies import indices, load_indices
from shell import paraflex

ISHIGAMI = """
mechanism = "raparm_i"
modes = ["++++"]
metrics = ["tracking_rms", "total_mass"]

[vary.a]
fields = ["section.bar.thickness"]
low = 0.0
high = 1.0

[vary.b]
fields = ["lump.end.mass"]
low = 0.0
high = 1.0

[vary.c]
fields = ["lump.joint.mass"]
low = 0.0
high = 1.0
"""


def ishigami(mode, *share):
    x = np.pi * (2.0 * np.array(share) - 1.0)
    return np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0])


def known_ishigami():
    """First-order and total indices in closed form (Ishigami and Homma 1990)."""
    a, b = 7.0, 0.1
    one = 0.5 * (1.0 + b * np.pi**4 / 5.0) ** 2
    two, both = a**2 / 8.0, b**2 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    variance = one + two + both
    return np.array([one, two, 0.0]) / variance, np.array([one + both, two, both]) / variance


@pytest.mark.parametrize("seed", [0, 1])
def test_indices_of_ishigami(tmp_path, seed):
    file = write_study(tmp_path, ISHIGAMI)
    run = made_up(tracking_rms=ishigami, total_mass=lambda mode, a, b, c: 3.0)
    given = {"metrics": ["tracking_rms", "total_mass"], "samples": 1024, "seed": seed}
    result = indices(file, tmp_path / "out", run=run, **given)
    varying, constant = (result.data.isel(index=k) for k in (0, 1))
    first, total = known_ishigami()
    assert varying.first.values == pytest.approx(first, abs=0.05)
    assert varying.total.values == pytest.approx(total, abs=0.05)
    # What is left is within the intervals told, or hardly out of them.
    assert (np.abs(varying.first - first) < 1.5 * varying.first_confidence).all()
    assert (np.abs(varying.total - total) < 1.5 * varying.total_confidence).all()
    assert (varying.total_confidence < 0.15).all()
    assert varying["mean"].item() == pytest.approx(3.5, abs=0.1)
    assert varying.samples == 1024
    assert len(run.designs) == 1024 * 5
    assert np.isnan(constant.first).all()
    table = pd.read_parquet(result.table)
    assert list(table["parameter"]) == ["a", "b", "c"] * 2
    assert table["first"][:3].tolist() == varying.first.values.tolist()
    told = json.loads((tmp_path / "out" / "indices.json").read_text())["indices"]
    assert told[0]["total"] == varying.total[0].item()
    assert told[3]["total"] is None
    # The same seed says the same, from the runs that are there.
    again = indices(file, tmp_path / "out", run=pytest.fail, **given)
    assert again.to_dict() == result.to_dict()
    figure = sobol_bars(result.to_dict())
    assert len(figure.axes) == 1
    lengths = [patch.get_width() for patch in figure.axes[0].patches]
    assert lengths == pytest.approx([*varying.first.values, *varying.total.values])


def test_indices_of_a_sum_follow_the_ranges(tmp_path):
    """Of x + 2 y, x uniform over 0.006 and y over 0.003: variances as the squares of weighted widths, 1 to 1."""
    text = STUDY.replace('low = 0.1\nhigh = 1.0\nscale = "log"', "low = 0.1\nhigh = 0.103")
    run = made_up(tracking_rms=lambda mode, x, y: x + 2.0 * y)
    result = indices(write_study(tmp_path, text), tmp_path / "out", metrics=["tracking_rms"], samples=256, run=run)
    found = result.data.squeeze("index")
    assert found.first.values == pytest.approx([0.5, 0.5], abs=0.02)
    assert found.total.values == pytest.approx([0.5, 0.5], abs=0.02)


def test_base_samples_with_a_failure_are_left_out(tmp_path):
    def sometimes(mode, x, y):
        if x > 0.0076:
            raise ValueError("out of reach")
        return x

    file = write_study(tmp_path, STUDY)
    given = {"metrics": ["tracking_rms"], "samples": 128}
    result = indices(file, tmp_path / "out", run=made_up(tracking_rms=sometimes), **given)
    found = result.data.squeeze("index")
    assert found.dropped + found.samples == 128
    assert 0 < found.dropped < 30
    assert found.first.values == pytest.approx([1.0, 0.0], abs=0.15)
    with pytest.raises(InputError, match=r"only 0 of 128 base samples are complete in \+\+\+\+"):
        indices(file, tmp_path / "none", run=made_up(tracking_rms=lambda *_: float("nan")), **given)


def test_an_unfinished_sweep_has_no_indices(tmp_path):
    file = write_study(tmp_path, STUDY)

    def stop(progress):
        raise KeyboardInterrupt

    run = made_up(tracking_rms=lambda mode, x, y: x)
    given = {"metrics": ["tracking_rms"], "samples": 16}
    stopped = indices(file, tmp_path / "out", run=run, on_progress=stop, **given)
    assert stopped.data.sizes["index"] == 0
    assert not stopped.table.exists()
    assert len(indices(file, tmp_path / "out", run=run, **given).data["index"]) == 1


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"samples": 100}, "--samples: Sobol's sequence needs a power of two, 8 at least (got 100); give 128"),
        ({"samples": 4}, "give 8"),
        ({"metrics": ["deflection_max"]}, "--metric: not a metric of the study"),
        ({"metrics": ["tracking_rm"]}, 'did you mean "tracking_rms"?'),
        ({"seed": -1}, "sampling.seed: must not be negative"),
    ],
)
def test_bad_requests_say_what_to_do(tmp_path, given, says):
    with pytest.raises(InputError) as caught:
        load_indices(write_study(tmp_path, STUDY), **given)
    assert says in str(caught.value)


def test_without_salib(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "SALib", None)
    with pytest.raises(InputError, match=r"global indices need SALib; pip install 'paraflex\[indices\]'"):
        load_indices(write_study(tmp_path, STUDY))


def test_a_figure_of_nothing_is_refused():
    with pytest.raises(InputError, match="nothing to show"):
        sobol_bars({"indices": [{"first": None}]})


def test_command_line(tmp_path):
    text, out = STUDY.split("[vary.y]")[0].replace("low = 0.002", "low = 0.005"), tmp_path / "out"
    file = write_study(tmp_path, text)
    asked = ("indices", file, "--metric", "tracking_rms", "--samples", "8", "--output", out)
    done = paraflex(*asked)
    assert done.returncode == 0, done.stderr
    assert "RMS tracking error" in done.stdout
    assert (out / "figures" / "indices.png").exists()
    again = paraflex(*asked, "--json")
    assert again.returncode == 0, again.stderr
    (row,) = json.loads(again.stdout)["indices"]
    # One parameter explains all there is; the standard error of eight samples is some 0.3.
    assert row["total"] == pytest.approx(1.0, abs=0.5)
