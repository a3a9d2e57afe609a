"""Results: one labelled dataset a study, saved as netCDF with provenance; metrics.

Names are imported when they are first used: files are read without what computes them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

# A module called like what it holds: imported later it would stand in for that.
from paraflex.results.summary import summary

if TYPE_CHECKING:
    from paraflex.results.dataset import tracking_dataset
    from paraflex.results.following import peak_torque, residual_vibration, rms_torque, tracking_error
    from paraflex.results.kinds import kind_of
    from paraflex.results.motion_data import motion_dataset, motion_summary
    from paraflex.results.storage import load_results, open_results, results_file, save_results

_HOME = {
    "load_results": "storage",
    "motion_dataset": "motion_data",
    "motion_summary": "motion_data",
    "kind_of": "kinds",
    "open_results": "storage",
    "peak_torque": "following",
    "residual_vibration": "following",
    "results_file": "storage",
    "rms_torque": "following",
    "save_results": "storage",
    "tracking_dataset": "dataset",
    "tracking_error": "following",
}

__all__ = [
    "kind_of",
    "load_results",
    "motion_dataset",
    "motion_summary",
    "open_results",
    "peak_torque",
    "residual_vibration",
    "results_file",
    "rms_torque",
    "save_results",
    "summary",
    "tracking_dataset",
    "tracking_error",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'paraflex.results' has no attribute {name!r}")
    return getattr(import_module(f"paraflex.results.{_HOME[name]}"), name)
