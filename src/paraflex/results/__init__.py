"""Results: one labelled dataset a study, saved as netCDF with provenance; metrics."""

from paraflex.results.dataset import tracking_dataset
from paraflex.results.metrics import peak_torque, residual_vibration, rms_torque, tracking_error
from paraflex.results.motion_dataset import motion_dataset, motion_summary
from paraflex.results.storage import load_results, open_results, save_results
from paraflex.results.summary import summary

__all__ = [
    "load_results",
    "motion_dataset",
    "motion_summary",
    "open_results",
    "peak_torque",
    "residual_vibration",
    "rms_torque",
    "save_results",
    "summary",
    "tracking_dataset",
    "tracking_error",
]
