"""Figures of a tracking study, each a function from its dataset to a Matplotlib figure; their files."""

from paraflex.plots.agreement import compared_links, compared_paths, model_distances
from paraflex.plots.drawing import mechanism_drawing
from paraflex.plots.elasticities import elasticities
from paraflex.plots.modes import motor_torques, tracking_errors
from paraflex.plots.numerical_damping import numerical_damping
from paraflex.plots.optimisation import convergence, sobol_bars, targets_reached
from paraflex.plots.overview import motion_overview
from paraflex.plots.phase import phase_diagrams
from paraflex.plots.save import (
    save_agreement_figures,
    save_elasticities,
    save_figures,
    save_overview,
    save_search_figures,
    save_work_precision,
)
from paraflex.plots.time_series import end_effector_motion, link_motions, tip_deflections
from paraflex.plots.work_precision import work_precision
from paraflex.plots.workspace import desired_path, end_effector_path

__all__ = [
    "compared_links",
    "compared_paths",
    "convergence",
    "desired_path",
    "elasticities",
    "end_effector_motion",
    "end_effector_path",
    "link_motions",
    "mechanism_drawing",
    "model_distances",
    "motion_overview",
    "motor_torques",
    "numerical_damping",
    "phase_diagrams",
    "save_agreement_figures",
    "save_elasticities",
    "save_figures",
    "save_overview",
    "save_search_figures",
    "save_work_precision",
    "sobol_bars",
    "targets_reached",
    "tip_deflections",
    "tracking_errors",
    "work_precision",
]
