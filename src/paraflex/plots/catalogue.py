"""Catalogue of all figures by kind of results: what they show, and the arguments of their functions.

`paraflex plot`, the `save_...` functions and the gallery of the documentation read it. A new figure is a function in
this folder, a name in `__init__.pyi` and an entry here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

# Arguments of a plotting function: all results; results and a mode; results, a mode and a pair of models; results and
# the number of a run; a table of designs; no argument.
Takes = Literal["results", "mode", "models", "run", "designs", "nothing"]


@dataclass(frozen=True)
class CatalogueFigure:
    """Entry of the catalogue: a figure of one kind of results.

    Attributes
    ----------
    name : str
        Name of the plotting function in `paraflex.plots`, also the stem of the files that `paraflex plot` writes.
    shows : str
        Description in one line.
    takes : str
        Arguments of the function, see `Takes`.
    written_as : str
        Stem of the file that the command which makes the results writes; empty if that command does not write it.
    variables : tuple of str
        Variables of the dataset that the figure requires.
    points : str
        Parameter of the function that selects named points, "point" or "points"; empty if there is none.
    """

    name: str
    shows: str
    takes: Takes = "results"
    written_as: str = ""
    variables: tuple[str, ...] = ()
    points: Literal["", "point", "points"] = ""


_RUN = (
    CatalogueFigure(
        "mechanism_drawing",
        "the mechanism with its deflected links half way through the run",
        "mode",
        variables=("shape",),
        points="point",
    ),
    CatalogueFigure("energies", "kinetic and strain energy, work, and error of the energy balance", "mode"),
    CatalogueFigure(
        "joint_forces", "magnitude of the force in every joint over time", "mode", variables=("joint_force",)
    ),
    CatalogueFigure("beam_stresses", "largest stress of every beam over time", "mode", variables=("stress",)),
    CatalogueFigure(
        "stress_envelope", "largest stress of the run along every beam", "mode", variables=("section_moment",)
    ),
    CatalogueFigure(
        "joint_motions",
        "angle or travel of every joint, and its rate, over time",
        "mode",
        variables=("joint_coordinate",),
    ),
    CatalogueFigure(
        "drive_efforts", "torque, speed and power of motors and prescribed motions", "mode", variables=("input_power",)
    ),
    CatalogueFigure(
        "frame_loads", "shaking force and moment of the mechanism on the ground", "mode", variables=("frame_force",)
    ),
    CatalogueFigure("sensors", "reading of every sensor, a panel for each unit", "mode", variables=("sensor_reading",)),
    CatalogueFigure(
        "controllers", "torques of controllers before and after limits, and their readings", "mode", "controllers"
    ),
    CatalogueFigure("link_deflections", "transverse displacement of the ends of all links", "mode"),
    CatalogueFigure(
        "point_motions",
        "distance from the start, speed and acceleration of named points",
        "mode",
        variables=("point_velocity", "point_acceleration"),
        points="points",
    ),
    CatalogueFigure("link_phases", "angular velocity over angle of every body", "mode"),
)
_DESIGNS = (
    CatalogueFigure("response_curves", "metrics against parameters", "designs"),
    CatalogueFigure("response_map", "contours of metrics over two parameters", "designs"),
    CatalogueFigure("parallel_coordinates", "parameters and metrics of every design on parallel axes", "designs"),
    CatalogueFigure("pareto_front", "two metrics of every design, and the Pareto front", "designs"),
)
_CONVERGENCE = CatalogueFigure(
    "convergence", "objective of every design, and the least up to it", written_as="convergence"
)
CATALOGUE: Mapping[str, tuple[CatalogueFigure, ...]] = {
    "tracking": (
        CatalogueFigure("desired_path", "desired path and the mechanism at its start (Fig. 11)",
                        written_as="desired_path"),
        CatalogueFigure("motor_torques", "torque of every motor over time, one panel per mode (Fig. 12)",
                        written_as="motor_torques"),
        CatalogueFigure("tip_deflections",
                        "axial and transverse displacement and slope of links' ends (Fig. 13)",
                        "mode", "tip_deflections"),
        CatalogueFigure("link_motions",
                        "angle, speed and acceleration of links, desired and actual (Fig. 14)",
                        "mode", "link_motions"),
        CatalogueFigure("end_effector_path",
                        "desired and actual path, deviation magnified (Fig. 15)", "mode",
                        "end_effector_path", points="point"),
        CatalogueFigure("end_effector_motion",
                        "motion of the end-effector, desired and actual (Fig. 16)", "mode",
                        "end_effector_motion", points="point"),
        CatalogueFigure("phase_diagrams", "phase diagrams of the end-effector (Fig. 17)", "mode",
                        "phase_diagrams", points="point"),
        CatalogueFigure("tracking_errors", "tracking error in x and y over time, one panel per mode (Fig. 18)",
                        written_as="tracking_errors"),
        CatalogueFigure("tracking_distance", "distance from the desired position over time, all modes"),
        CatalogueFigure("mode_comparison", "tracking error, vibration and largest torque of every mode"),
        CatalogueFigure("actuation_condition",
                        "condition number of the actuation matrix along the path, all modes",
                        variables=("actuation_condition",)),
        *_RUN,
    ),
    "motion": (
        CatalogueFigure("motion_overview", "angles, speeds and energies", written_as="motion_overview"),
        CatalogueFigure("coordinates", "generalised coordinates, including modal coordinates of bodies"),
        CatalogueFigure("point_paths", "paths of named points in the plane", points="points"),
        *_RUN,
    ),
    "verification": (
        CatalogueFigure("compared_links", "angle and speed of links in two models (Fig. 22)", "models",
                        "compared_links"),
        CatalogueFigure("compared_paths", "path of the end-effector in two models (Fig. 23)", "models",
                        "compared_paths"),
        CatalogueFigure("model_distances",
                        "distances of all models from the desired position and from the reference",
                        written_as="model_distances"),
        CatalogueFigure("compared_deflections", "transverse displacement of links' ends in all models",
                        "mode"),
    ),
    "linear": (
        CatalogueFigure("singular_values",
                        "gains from motors to their encoders and to the end-effector over frequency, all modes",
                        written_as="singular_values"),
        CatalogueFigure("bode",
                        "magnitude and phase from motors to their encoders and to the end-effector", "mode", "bode"),
        CatalogueFigure("pole_zero_map", "poles and zeros in the complex plane, all modes",
                        written_as="pole_zero_map"),
        CatalogueFigure("mode_shapes", "lowest mode shapes, with motors free and held", "mode",
                        "mode_shapes"),
        CatalogueFigure("poles_along_path", "frequencies and real parts of poles along the motion",
                        "mode", "poles_along_path", variables=("branch_real",)),
    ),
    "reduction": (
        CatalogueFigure("reduced_responses", "gains of reduced models and the full model over frequency",
                        "mode", "reduced_responses"),
        CatalogueFigure("reduction_errors", "errors of reduced models over frequency, all modes",
                        written_as="reduction_errors"),
        CatalogueFigure("held_frequency_by_states",
                        "lowest frequency with motors held against number of states", "mode",
                        "held_frequency_by_states"),
        CatalogueFigure("bases_along_path", "errors along the path with bases of one and of several poses",
                        "mode", "bases_along_path", variables=("along_error",)),
    ),
    "statics": (
        CatalogueFigure("force_travel", "force against travel of loaded and moved coordinates",
                        written_as="force_travel", variables=("given_travel",)),
        CatalogueFigure("stiffness_travel", "stiffness and lowest frequencies against travel",
                        written_as="stiffness_travel", variables=("given_travel",)),
        CatalogueFigure("deformed_shapes", "deformed mechanism in all steps",
                        written_as="deformed_shapes", variables=("given_travel",)),
        CatalogueFigure("buckling_shapes", "buckling shapes of the last stable step",
                        written_as="buckling_shapes", variables=("buckling_shape",)),
    ),
    "laws": (
        CatalogueFigure("law_comparison", "error, vibration and largest torque of control laws in all modes",
                        written_as="law_comparison"),
    ),
    "methods": (
        CatalogueFigure("work_precision", "wall time and number of steps against error",
                        written_as="work_precision"),
        CatalogueFigure("numerical_damping", "damping ratio, period error and spectral radius of methods",
                        "nothing"),
    ),
    "sweep": _DESIGNS,
    "optimisation": (_CONVERGENCE, *_DESIGNS),
    "identification": (
        _CONVERGENCE,
        CatalogueFigure("targets_reached", "every target at the start and at the best design",
                        written_as="targets"),
        *_DESIGNS,
    ),
    "indices": (
        CatalogueFigure("sobol_bars", "first-order and total Sobol indices", written_as="indices"),
        *_DESIGNS,
    ),
    "sensitivity": (
        CatalogueFigure("elasticities", "elasticities: change of metrics in % per % of parameter", "run",
                        "elasticities"),
    ),
    "modes": (
        CatalogueFigure("mode_conditions", "worst condition number of every mode along the path"),
    ),
}  # fmt: skip

# Names of all figures.
FIGURES = {figure.name for figures in CATALOGUE.values() for figure in figures}
