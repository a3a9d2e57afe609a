"""Runs that reports are made of in tests: short, with a mode that stops on the way and one that could not start."""

from __future__ import annotations

import base64
import json
import re
import zlib
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import raparm_i
from paraflex.paths import Polygon
from paraflex.reports import Page, render
from paraflex.reports.packing import MISSING
from paraflex.studies import run_study
from paraflex.studies.verification import VerificationOptions, VerificationStudy
from paraflex.tracking import plan_tracking

MODES = ("++++", "+-+-", "-+-+")
STOPPED = "-+-+"
SQUARE = Polygon(((0.05, 0.314), (-0.05, 0.314), (-0.05, 0.214), (0.05, 0.214)), 40.0)
FAILED = {"+---": 'mode "+---" cannot drive the mechanism: 1 active motor for 2 degrees of freedom'}


@cache
def task():
    """RAParM-I on the first side of its square."""
    return plan_tracking(raparm_i(), SQUARE, duration=0.1, samples=51)


@cache
def tracked() -> xr.Dataset:
    """Three modes; the last stops half-way."""
    data = run_study(task(), MODES, options=IntegrationOptions(tolerance=1e-3)).data
    assert data is not None
    stopped = {"mode": 2, "time": slice(26, None)}
    for name in data.data_vars:
        if (
            "time" in data[name].dims
            and not name.endswith("_desired")
            and name not in ("torque", "actuation_condition")
        ):
            data[name][stopped] = np.nan
    data["tracking_rms"][2] = data["tracking_rms_motion"][2] = np.nan
    data["status"] = data["status"].astype(object)
    data["message"] = data["message"].astype(object)
    data["status"][2], data["message"][2] = "failed", "the run has not ended after 20 steps, at t = 0.05 s"
    return data


@cache
def verified() -> tuple[xr.Dataset, dict[str, Any]]:
    """Three models in one mode, and what they say of each other."""
    options = VerificationOptions(tolerance=1e-4, segments=3)
    models, provenance = ("rigid", "linear", "segments"), {"run": {"path": "square"}}
    verification = VerificationStudy(task(), ["++++"], models, options, provenance).run()
    return verification.data, verification.to_dict()


def html_of(page: Page) -> str:
    """The page without Plotly's script, which is none of ours."""
    whole = render(page)
    start = whole.index('<script type="text/plain" id="plotly">')
    return whole[:start] + whole[whole.index("</script>", start) + len("</script>") :]


def told(html: str) -> dict[str, Any]:
    """What the scripts are told, strictly as JSON has it."""
    text = re.search(r'<script type="application/json" id="report-data">(.*?)</script>', html, re.DOTALL)
    assert text is not None

    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text.group(1), parse_constant=refuse)


def rows_of(series: dict[str, Any]) -> list[np.ndarray]:
    """Rows of numbers as the page reads them."""
    raw = zlib.decompress(base64.b64decode(series["data"]))
    flat = np.frombuffer(raw, dtype=np.uint8).reshape(4, -1).T.copy().view("<f4").ravel()
    return np.split(flat, np.cumsum(series["lengths"])[:-1])


def array_of(packed: dict[str, Any]) -> np.ndarray:
    """An array as the page reads it: sums of 16-bit differences that wrap round, with their sign in the lowest bit."""
    raw = zlib.decompress(base64.b64decode(packed["data"]))
    folded = np.frombuffer(raw, dtype=np.uint8).reshape(2, -1).T.copy().view("<u2").reshape(packed["shape"])
    whole = (folded >> 1).astype(np.int16) ^ -(folded & 1).astype(np.int16)
    for axis, order in ((2, packed["orders"][1]), (1, packed["orders"][0])):
        for _ in range(order):
            whole = np.cumsum(whole, axis=axis, dtype=np.int16)
    values = packed["scale"] * whole + np.array(packed["offset"])
    return np.where(whole == MISSING, np.nan, values)


def chart_of(page: dict[str, Any], identity: str) -> dict[str, Any]:
    """A chart by its identity."""
    return next(chart for panel in page["panels"] for chart in panel["charts"] if chart["identity"] == identity)
