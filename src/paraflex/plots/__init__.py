"""Figures of results, each a function from a dataset, or from figures read of a file, to a Matplotlib figure.

What they have in common:

data, figures, table
    Results of the kind that `paraflex plot --list` has the figure for: a dataset (from `paraflex.results` or
    `studies.Verification.dataset`), the plain numbers of a study's result, or its table of designs; or the folder or
    file that they were written to.
mode, models, run
    Which of the runs: an actuation mode, two models of a verification, the number of a run. A mode that may be left
    out is then the one with most active motors.
metrics
    Of many designs; by default the first that vary.

An `InputError` says that results are of another kind or hold nothing to show, or that there is no such mode, model, run
or metric.

The names below are imported when they are first used: most commands need one or two of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from paraflex.plots.catalogue import homes

if TYPE_CHECKING:
    from paraflex.plots.agreement import compared_deflections, compared_links, compared_paths, model_distances
    from paraflex.plots.derivatives import elasticities
    from paraflex.plots.drawing import mechanism_drawing
    from paraflex.plots.driving import actuation_condition, mode_comparison, mode_conditions, tracking_distance
    from paraflex.plots.energy import energies
    from paraflex.plots.free_motion import coordinates, motion_overview, point_paths
    from paraflex.plots.methods import work_precision
    from paraflex.plots.modes import motor_torques, tracking_errors
    from paraflex.plots.optimisation import convergence, sobol_bars, targets_reached
    from paraflex.plots.parallel import parallel_coordinates
    from paraflex.plots.phase import link_phases, phase_diagrams
    from paraflex.plots.responses import pareto_front, response_curves
    from paraflex.plots.save import save_figures
    from paraflex.plots.spectra import numerical_damping
    from paraflex.plots.time_series import (
        end_effector_motion,
        joint_forces,
        link_deflections,
        link_motions,
        tip_deflections,
    )
    from paraflex.plots.workspace import desired_path, end_effector_path

__all__ = [
    "actuation_condition",
    "compared_deflections",
    "compared_links",
    "compared_paths",
    "convergence",
    "coordinates",
    "desired_path",
    "elasticities",
    "end_effector_motion",
    "end_effector_path",
    "energies",
    "joint_forces",
    "link_deflections",
    "link_motions",
    "link_phases",
    "mechanism_drawing",
    "mode_comparison",
    "mode_conditions",
    "model_distances",
    "motion_overview",
    "motor_torques",
    "numerical_damping",
    "parallel_coordinates",
    "pareto_front",
    "phase_diagrams",
    "point_paths",
    "response_curves",
    "save_figures",
    "sobol_bars",
    "targets_reached",
    "tip_deflections",
    "tracking_distance",
    "tracking_errors",
    "work_precision",
]


_HOMES = homes() | {"save_figures": "save"}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f"paraflex.plots.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'paraflex.plots' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
