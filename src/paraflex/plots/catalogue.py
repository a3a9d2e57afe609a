"""Catalogue of all figures by kind of results: those with charts, and drawings by Matplotlib.

A figure with charts is a function of `paraflex.figures`. A drawing is a function in this folder and an entry here; its
kinds of results name it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING

from paraflex.figures.catalogue import Figure, figures_of_kind
from paraflex.folders.kinds import RESULT_KINDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

_DRAWINGS: Mapping[str, Figure] = {
    one.name: one
    for one in (
        Figure(
            "desired_path",
            "desired path and the mechanism at its start (Fig. 11)",
            module="workspace",
            written_as="desired_path",
        ),
        Figure(
            "motor_torques",
            "torque of every motor over time, one panel per mode (Fig. 12)",
            module="modes",
            written_as="motor_torques",
        ),
        Figure(
            "tip_deflections",
            "axial and transverse displacement and slope of links' ends (Fig. 13)",
            module="time_series",
            takes="mode",
            written_as="tip_deflections",
        ),
        Figure(
            "link_motions",
            "angle, speed and acceleration of links, desired and actual (Fig. 14)",
            module="time_series",
            takes="mode",
            written_as="link_motions",
        ),
        Figure(
            "end_effector_path",
            "desired and actual path, deviation magnified (Fig. 15)",
            module="workspace",
            takes="mode",
            written_as="end_effector_path",
            points="point",
        ),
        Figure(
            "end_effector_motion",
            "motion of the end-effector, desired and actual (Fig. 16)",
            module="time_series",
            takes="mode",
            written_as="end_effector_motion",
            points="point",
        ),
        Figure(
            "phase_diagrams",
            "phase diagrams of the end-effector (Fig. 17)",
            module="phase",
            takes="mode",
            written_as="phase_diagrams",
            points="point",
        ),
        Figure(
            "tracking_errors",
            "tracking error in x and y over time, one panel per mode (Fig. 18)",
            module="modes",
            written_as="tracking_errors",
        ),
        Figure("tracking_distance", "distance from the desired position over time, all modes", module="driving"),
        Figure("mode_comparison", "tracking error, vibration and largest torque of every mode", module="driving"),
        Figure(
            "actuation_condition",
            "condition number of the actuation matrix along the path, all modes",
            module="driving",
            variables=("actuation_condition",),
        ),
        Figure(
            "mechanism_drawing",
            "the mechanism with its deflected links half way through the run",
            module="drawing",
            takes="mode",
            variables=("shape",),
            points="point",
        ),
        Figure(
            "energies",
            "kinetic and strain energy, work, and error of the energy balance",
            module="energy",
            takes="mode",
        ),
        Figure(
            "joint_forces",
            "magnitude of the force in every joint over time",
            module="time_series",
            takes="mode",
            variables=("joint_force",),
        ),
        Figure(
            "beam_stresses",
            "largest stress of every beam over time",
            module="stress",
            takes="mode",
            variables=("stress",),
        ),
        Figure(
            "stress_envelope",
            "largest stress of the run along every beam",
            module="stress",
            takes="mode",
            variables=("section_moment",),
        ),
        Figure(
            "joint_motions",
            "angle or travel of every joint, and its rate, over time",
            module="stress",
            takes="mode",
            variables=("joint_coordinate",),
        ),
        Figure(
            "drive_efforts",
            "torque, speed and power of motors and prescribed motions",
            module="stress",
            takes="mode",
            variables=("input_power",),
        ),
        Figure(
            "frame_loads",
            "shaking force and moment of the mechanism on the ground",
            module="stress",
            takes="mode",
            variables=("frame_force",),
        ),
        Figure(
            "sensors",
            "reading of every sensor, a panel for each unit",
            module="measured",
            takes="mode",
            variables=("sensor_reading",),
        ),
        Figure(
            "controllers",
            "torques of controllers before and after limits, and their readings",
            module="controlled",
            takes="mode",
            written_as="controllers",
        ),
        Figure(
            "link_deflections", "transverse displacement of the ends of all links", module="time_series", takes="mode"
        ),
        Figure(
            "point_motions",
            "distance from the start, speed and acceleration of named points",
            module="free_motion",
            takes="mode",
            variables=("point_velocity", "point_acceleration"),
            points="points",
        ),
        Figure("link_phases", "angular velocity over angle of every body", module="phase", takes="mode"),
        Figure("motion_overview", "angles, speeds and energies", module="free_motion", written_as="motion_overview"),
        Figure("coordinates", "generalised coordinates, including modal coordinates of bodies", module="free_motion"),
        Figure("point_paths", "paths of named points in the plane", module="free_motion", points="points"),
        Figure(
            "compared_links",
            "angle and speed of links in two models (Fig. 22)",
            module="agreement",
            takes="models",
            written_as="compared_links",
        ),
        Figure(
            "compared_paths",
            "path of the end-effector in two models (Fig. 23)",
            module="agreement",
            takes="models",
            written_as="compared_paths",
        ),
        Figure(
            "model_distances",
            "distances of all models from the desired position and from the reference",
            module="agreement",
            written_as="model_distances",
        ),
        Figure(
            "compared_deflections",
            "transverse displacement of links' ends in all models",
            module="agreement",
            takes="mode",
        ),
        Figure(
            "singular_values",
            "gains from motors to their encoders and to the end-effector over frequency, all modes",
            module="linear",
            written_as="singular_values",
        ),
        Figure(
            "bode",
            "magnitude and phase from motors to their encoders and to the end-effector",
            module="linear",
            takes="mode",
            written_as="bode",
        ),
        Figure(
            "pole_zero_map",
            "poles and zeros in the complex plane, all modes",
            module="linear",
            written_as="pole_zero_map",
        ),
        Figure(
            "mode_shapes",
            "lowest mode shapes, with motors free and held",
            module="mode_shapes",
            takes="mode",
            written_as="mode_shapes",
        ),
        Figure(
            "poles_along_path",
            "frequencies and real parts of poles along the motion",
            module="linear",
            takes="mode",
            written_as="poles_along_path",
            variables=("branch_real",),
        ),
        Figure(
            "reduced_responses",
            "gains of reduced models and the full model over frequency",
            module="reduction",
            takes="mode",
            written_as="reduced_responses",
        ),
        Figure(
            "reduction_errors",
            "errors of reduced models over frequency, all modes",
            module="reduction",
            written_as="reduction_errors",
        ),
        Figure(
            "held_frequency_by_states",
            "lowest frequency with motors held against number of states",
            module="reduction",
            takes="mode",
            written_as="held_frequency_by_states",
        ),
        Figure(
            "bases_along_path",
            "errors along the path with bases of one and of several poses",
            module="reduction",
            takes="mode",
            written_as="bases_along_path",
            variables=("along_error",),
        ),
        Figure(
            "deformed_shapes",
            "deformed mechanism in all steps",
            module="equilibria",
            written_as="deformed_shapes",
            variables=("given_travel",),
        ),
        Figure(
            "buckling_shapes",
            "buckling shapes of the last stable step",
            module="equilibria",
            written_as="buckling_shapes",
            variables=("buckling_shape",),
        ),
        Figure(
            "law_comparison",
            "error, vibration and largest torque of control laws in all modes",
            module="laws",
            written_as="law_comparison",
        ),
        Figure(
            "work_precision",
            "wall time and number of steps against error",
            module="methods",
            written_as="work_precision",
        ),
        Figure(
            "numerical_damping",
            "damping ratio, period error and spectral radius of methods",
            module="spectra",
            takes="nothing",
        ),
        Figure("response_map", "contours of metrics over two parameters", module="maps", takes="designs"),
        Figure(
            "parallel_coordinates",
            "parameters and metrics of every design on parallel axes",
            module="parallel",
            takes="designs",
        ),
        Figure("mode_conditions", "worst condition number of every mode along the path", module="driving"),
    )
}


# Figures of each kind of results that has any: those with charts, then drawings.
CATALOGUE: Mapping[str, tuple[Figure, ...]] = {
    kind: found for kind, each in RESULT_KINDS.items()
    if (found := (*figures_of_kind(kind).values(), *(_DRAWINGS[name] for name in each.drawings)))
}  # fmt: skip


def plotting_function(figure: Figure) -> Callable[..., MatplotlibFigure]:
    """Return the plotting function of a figure; its module is imported on access."""
    return getattr(import_module(f"paraflex.plots.{figure.module or 'charts'}"), figure.name)


def figure_names() -> set[str]:
    """Return the names of all figures."""
    return {figure.name for figures in CATALOGUE.values() for figure in figures}
