"""Results: one labelled dataset a study, saved as netCDF with provenance; metrics."""

from paraflex.results.dataset import load_results, save_results, tracking_dataset
from paraflex.results.metrics import peak_torque, residual_vibration, rms_torque, tracking_error
from paraflex.results.motion_dataset import motion_dataset, motion_summary
from paraflex.results.summary import summary

__all__ = [
    "load_results",
    "motion_dataset",
    "motion_summary",
    "peak_torque",
    "residual_vibration",
    "rms_torque",
    "save_results",
    "summary",
    "tracking_dataset",
    "tracking_error",
]
