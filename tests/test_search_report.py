"""What a search found, on its page: parameters with their bounds, targets, and how far it is off them."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape

import pytest

from paraflex.figures.search import tables, tiles as search_tiles
from paraflex.formatting import display_unit
from paraflex.reports.choice import best_runs
from paraflex.reports.sweep import StudyAccount, sweep_page
from paraflex.reports.text import sections
from test_sweep_report import made_up

IDENTIFIED = {
    "kind": "identification",
    "values": {"thickness": 0.009, "modulus": 69.9e9},
    "start": {"thickness": 0.005, "modulus": 70e9},
    "bounds": {"thickness": "high"},
    "residual": 0.25,
    "start_residual": 0.5,
    "targets": [
        {"path": "square", "mode": "++", "metric": "tracking_rms", "value": 1e-4, "reached": 1.5e-4, "start": 2e-4},
    ],
    "confidence": {"deviations": {"thickness": None, "modulus": None}, "reasons": {"modulus": "too few targets"}},
}
OPTIMISED = {
    "kind": "optimisation",
    "values": {"thickness": 0.009},
    "start": {"thickness": 0.005},
    "objective": 1.25,
    "start_objective": 2.0,
    "metrics": {"peak_torque_max": 6.0},
    "start_metrics": {"peak_torque_max": 8.0},
    "holds_limits": False,
}
UNITS = {"thickness": "m", "modulus": "Pa", "tracking_rms": "m", "peak_torque_max": "N m"}


def cells(html: str) -> list[str]:
    """Texts of a table's cells, row by row."""
    return [unescape(re.sub("<[^>]*>", " ", one)).strip() for one in re.findall("<t[hd][ >].*?</t[hd]>", html)]


def test_an_identification_shows_its_parameters_and_how_far_it_is_off_its_targets() -> None:
    tiles = search_tiles(IDENTIFIED, UNITS)
    assert tiles[0] == ("residual", "0.25", "0.5 at the start")
    assert tiles[2] == ("modulus", "69.9 GPa", "70 at the start")
    (found, parameters), (aim, targets) = sections(tables(IDENTIFIED, UNITS))
    assert (found, aim) == ("Parameters found", "Targets")
    assert cells(parameters)[5:10] == ["thickness", "9", "5", "mm", "highest allowed"]
    assert "No interval of confidence of modulus: too few targets." in parameters
    assert cells(targets)[-6:] == ["RMS tracking error", "0.1", "0.15", "0.2", "mm", "50"]


def test_an_optimisation_shows_its_metrics_and_says_that_limits_do_not_hold() -> None:
    assert search_tiles(OPTIMISED, UNITS)[1] == ("peak torque", "6 N m", "8 at the start")
    (_, parameters), (_, metrics) = sections(tables(OPTIMISED, UNITS))
    assert "highest allowed" not in parameters
    assert cells(metrics)[-5:] == ["peak torque", "6", "8", "N m", "−25"]
    assert "does not hold all limits" in metrics


def test_less_is_not_better_where_targets_are_to_be_met() -> None:
    studied = made_up(40)
    account = StudyAccount("optimisation", "x", "made up", 40, {})
    sought, met = (sweep_page(studied, best_runs(studied), one) for one in (
        account, replace(account, kind="identification", found=IDENTIFIED)
    ))  # fmt: skip
    charts = [{chart.identity for panel in page.survey for chart in panel.charts} for page in (sought, met)]
    assert charts[0] - charts[1] == {"front"}
    assert "Less is taken as better" in sought.tables[0][1]
    assert "Less is taken as better" not in met.tables[0][1]
    assert [title for title, _ in met.summary] == ["Parameters found", "Targets"]
    assert not sought.summary


@pytest.mark.parametrize(("value", "unit"), [(2e11, "GPa"), (1.2e9, "MPa"), (3e6, "MPa"), (5e3, "MPa"), (0.0, "MPa")])
def test_moduli_are_in_gigapascals_and_stresses_in_megapascals(value, unit) -> None:
    assert display_unit("Pa", value).name == unit
