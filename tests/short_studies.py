"""A short study of stresses, and its derivatives against differences of a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import paraflex as pf


def stress_study(mechanism: str, field: str) -> str:
    """A study of 50 ms that varies one field."""
    return f"""
mechanism = "{mechanism}"
paths = ["line"]
duration = 0.05
samples = 26
metrics = ["stress_max", "section_moment_max"]

[integration]
step = 1e-3
tolerance = 1e-9

[vary.thickness]
fields = ["{field}"]
"""


def check_derivatives(folder: Path, study: str, value: float, rel: float) -> Any:
    """Derivatives of the study at a value of its field, which differences over +-1e-6 must meet; the sensitivities."""
    (folder / "study.toml").write_text(study, encoding="utf-8")
    found = pf.sensitivities(folder / "study.toml")
    (folder / "near.toml").write_text(study + f"values = [{value - 1e-6}, {value + 1e-6}]\n", encoding="utf-8")
    table = pf.sweep(folder / "near.toml", folder / "out", workers=1).data
    for metric, derivative in zip(found.metrics, np.asarray(found.derivatives).ravel(), strict=True):
        low, high = table[metric].values.ravel()
        assert derivative == pytest.approx((high - low) / 2e-6, rel=rel)
    return found
