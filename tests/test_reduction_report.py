"""The report of reduced linear models."""

from __future__ import annotations

import numpy as np
import pytest

import paraflex as pf
from paraflex.reports import reduction_page, save_page
from paraflex.results import save_results
from shell import paraflex


@pytest.fixture(scope="module")
def reduced():
    model = pf.linearise(pf.load("five_bar"), mode="++")
    return pf.reduction_dataset([model], 12)


def test_tables_tiles_and_charts_have_the_numbers_of_the_dataset(reduced):
    page = reduction_page(reduced)
    most = float(reduced["states"].sel(reduction="craig-bampton").max())
    assert ("states needed, craig-bampton", f"{most:.0f}", "for every mode and output") in page.figures
    charts = {chart.identity: chart for panel in page.panels for chart in panel.charts}
    assert len(charts) == reduced.sizes["output"] + 2
    full = charts["gain-2"].curves[0]
    assert np.asarray(full.y) == pytest.approx(reduced["gain"].isel(mode=0, variant=0, output=2).values)
    titles = [title for title, _ in page.more]
    assert titles == ["States needed for 1 % up to 40 Hz", "Largest error with 12 states up to 40 Hz",
                      "Frequencies, and deviations of reduced models"]  # fmt: skip
    # Static shapes of the motors' coordinates keep the frequencies held.
    assert "0 %" in page.more[2][1]
    assert "e-13" not in page.more[2][1]


def test_it_is_made_from_a_file_and_opens_without_a_clock(reduced, tmp_path, browser):
    save_results(reduced, tmp_path / "reduced.nc")
    assert paraflex("report", "reduced.nc", cwd=tmp_path).returncode == 0
    save_page(reduction_page(reduced), tmp_path / "page.html")
    page, errors = browser.new_page(viewport={"width": 1400, "height": 1000}), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto((tmp_path / "report.html").as_uri())
    page.wait_for_function("document.documentElement.dataset.charts === 'true'")
    assert not page.locator("#dock").is_visible()
    assert not page.locator("#film").is_visible()
    assert page.locator("#chart-errors").bounding_box()["width"] > 500
    assert not errors
    page.close()
