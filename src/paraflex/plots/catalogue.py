"""Catalogue of all figures by kind of results: what they show, and the modules of their functions.

`paraflex plot`, the `save_...` functions and the gallery of the documentation read it. A new figure is a function in
this folder and an entry here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
    module : str
        Module of `paraflex.plots` that defines the function.
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
    module: str
    shows: str
    takes: Takes = "results"
    written_as: str = ""
    variables: tuple[str, ...] = ()
    points: Literal["", "point", "points"] = ""

    @property
    def function(self) -> Callable[..., Figure]:
        """Plotting function of the figure; its module is imported on access."""
        return getattr(import_module(f"paraflex.plots.{self.module}"), self.name)


_RUN = (
    CatalogueFigure(
        "mechanism_drawing",
        "drawing",
        "the mechanism with its deflected links half way through the run",
        "mode",
        variables=("shape",),
        points="point",
    ),
    CatalogueFigure("energies", "energy", "kinetic and strain energy, work, and error of the energy balance", "mode"),
    CatalogueFigure(
        "joint_forces",
        "time_series",
        "magnitude of the force in every joint over time",
        "mode",
        variables=("joint_force",),
    ),
    CatalogueFigure("beam_stresses", "stress", "largest stress of every beam over time", "mode", variables=("stress",)),
    CatalogueFigure(
        "stress_envelope",
        "stress",
        "largest stress of the run along every beam",
        "mode",
        variables=("section_moment",),
    ),
    CatalogueFigure(
        "joint_motions",
        "stress",
        "angle or travel of every joint, and its rate, over time",
        "mode",
        variables=("joint_coordinate",),
    ),
    CatalogueFigure(
        "drive_efforts",
        "stress",
        "torque, speed and power of motors and prescribed motions",
        "mode",
        variables=("input_power",),
    ),
    CatalogueFigure(
        "frame_loads",
        "stress",
        "shaking force and moment of the mechanism on the ground",
        "mode",
        variables=("frame_force",),
    ),
    CatalogueFigure(
        "sensors", "measured", "reading of every sensor, a panel for each unit", "mode", variables=("sensor_reading",)
    ),
    CatalogueFigure(
        "controllers",
        "controlled",
        "torques of controllers before and after limits, and their readings",
        "mode",
        "controllers",
    ),
    CatalogueFigure("link_deflections", "time_series", "transverse displacement of the ends of all links", "mode"),
    CatalogueFigure(
        "point_motions",
        "free_motion",
        "distance from the start, speed and acceleration of named points",
        "mode",
        variables=("point_velocity", "point_acceleration"),
        points="points",
    ),
    CatalogueFigure("link_phases", "phase", "angular velocity over angle of every body", "mode"),
)
_DESIGNS = (
    CatalogueFigure("response_curves", "responses", "metrics against parameters", "designs"),
    CatalogueFigure("response_map", "maps", "contours of metrics over two parameters", "designs"),
    CatalogueFigure(
        "parallel_coordinates", "parallel", "parameters and metrics of every design on parallel axes", "designs"
    ),
    CatalogueFigure("pareto_front", "responses", "two metrics of every design, and the Pareto front", "designs"),
)
_CONVERGENCE = CatalogueFigure(
    "convergence", "optimisation", "objective of every design, and the least up to it", written_as="convergence"
)
CATALOGUE: Mapping[str, tuple[CatalogueFigure, ...]] = {
    "tracking": (
        CatalogueFigure("desired_path", "workspace", "desired path and the mechanism at its start (Fig. 11)",
                        written_as="desired_path"),
        CatalogueFigure("motor_torques", "modes", "torque of every motor over time, one panel per mode (Fig. 12)",
                        written_as="motor_torques"),
        CatalogueFigure("tip_deflections", "time_series",
                        "axial and transverse displacement and slope of links' ends (Fig. 13)",
                        "mode", "tip_deflections"),
        CatalogueFigure("link_motions", "time_series",
                        "angle, speed and acceleration of links, desired and actual (Fig. 14)",
                        "mode", "link_motions"),
        CatalogueFigure("end_effector_path", "workspace",
                        "desired and actual path, deviation magnified (Fig. 15)", "mode",
                        "end_effector_path", points="point"),
        CatalogueFigure("end_effector_motion", "time_series",
                        "motion of the end-effector, desired and actual (Fig. 16)", "mode",
                        "end_effector_motion", points="point"),
        CatalogueFigure("phase_diagrams", "phase", "phase diagrams of the end-effector (Fig. 17)", "mode",
                        "phase_diagrams", points="point"),
        CatalogueFigure("tracking_errors", "modes", "tracking error in x and y over time, one panel per mode (Fig. 18)",
                        written_as="tracking_errors"),
        CatalogueFigure("tracking_distance", "driving", "distance from the desired position over time, all modes"),
        CatalogueFigure("mode_comparison", "driving", "tracking error, vibration and largest torque of every mode"),
        CatalogueFigure("actuation_condition", "driving",
                        "condition number of the actuation matrix along the path, all modes",
                        variables=("actuation_condition",)),
        *_RUN,
    ),
    "motion": (
        CatalogueFigure("motion_overview", "free_motion", "angles, speeds and energies", written_as="motion_overview"),
        CatalogueFigure("coordinates", "free_motion", "generalised coordinates, including modal coordinates of bodies"),
        CatalogueFigure("point_paths", "free_motion", "paths of named points in the plane", points="points"),
        *_RUN,
    ),
    "verification": (
        CatalogueFigure("compared_links", "agreement", "angle and speed of links in two models (Fig. 22)", "models",
                        "compared_links"),
        CatalogueFigure("compared_paths", "agreement", "path of the end-effector in two models (Fig. 23)", "models",
                        "compared_paths"),
        CatalogueFigure("model_distances", "agreement",
                        "distances of all models from the desired position and from the reference",
                        written_as="model_distances"),
        CatalogueFigure("compared_deflections", "agreement", "transverse displacement of links' ends in all models",
                        "mode"),
    ),
    "linear": (
        CatalogueFigure("singular_values", "linear",
                        "gains from motors to their encoders and to the end-effector over frequency, all modes",
                        written_as="singular_values"),
        CatalogueFigure("bode", "linear",
                        "magnitude and phase from motors to their encoders and to the end-effector", "mode", "bode"),
        CatalogueFigure("pole_zero_map", "linear", "poles and zeros in the complex plane, all modes",
                        written_as="pole_zero_map"),
        CatalogueFigure("mode_shapes", "mode_shapes", "lowest mode shapes, with motors free and held", "mode",
                        "mode_shapes"),
        CatalogueFigure("poles_along_path", "linear", "frequencies and real parts of poles along the motion",
                        "mode", "poles_along_path", variables=("branch_real",)),
    ),
    "reduction": (
        CatalogueFigure("reduced_responses", "reduction", "gains of reduced models and the full model over frequency",
                        "mode", "reduced_responses"),
        CatalogueFigure("reduction_errors", "reduction", "errors of reduced models over frequency, all modes",
                        written_as="reduction_errors"),
        CatalogueFigure("held_frequency_by_states", "reduction",
                        "lowest frequency with motors held against number of states", "mode",
                        "held_frequency_by_states"),
        CatalogueFigure("bases_along_path", "reduction", "errors along the path with bases of one and of several poses",
                        "mode", "bases_along_path", variables=("along_error",)),
    ),
    "statics": (
        CatalogueFigure("force_travel", "equilibria", "force against travel of loaded and moved coordinates",
                        written_as="force_travel", variables=("given_travel",)),
        CatalogueFigure("stiffness_travel", "equilibria", "stiffness and lowest frequencies against travel",
                        written_as="stiffness_travel", variables=("given_travel",)),
        CatalogueFigure("deformed_shapes", "equilibria", "deformed mechanism in all steps",
                        written_as="deformed_shapes", variables=("given_travel",)),
        CatalogueFigure("buckling_shapes", "equilibria", "buckling shapes of the last stable step",
                        written_as="buckling_shapes", variables=("buckling_shape",)),
    ),
    "laws": (
        CatalogueFigure("law_comparison", "laws", "error, vibration and largest torque of control laws in all modes",
                        written_as="law_comparison"),
    ),
    "methods": (
        CatalogueFigure("work_precision", "methods", "wall time and number of steps against error",
                        written_as="work_precision"),
        CatalogueFigure("numerical_damping", "spectra", "damping ratio, period error and spectral radius of methods",
                        "nothing"),
    ),
    "sweep": _DESIGNS,
    "optimisation": (_CONVERGENCE, *_DESIGNS),
    "identification": (
        _CONVERGENCE,
        CatalogueFigure("targets_reached", "optimisation", "every target at the start and at the best design",
                        written_as="targets"),
        *_DESIGNS,
    ),
    "indices": (
        CatalogueFigure("sobol_bars", "optimisation", "first-order and total Sobol indices", written_as="indices"),
        *_DESIGNS,
    ),
    "sensitivity": (
        CatalogueFigure("elasticities", "derivatives", "elasticities: change of metrics in % per % of parameter", "run",
                        "elasticities"),
    ),
    "modes": (
        CatalogueFigure("mode_conditions", "driving", "worst condition number of every mode along the path"),
    ),
}  # fmt: skip


def homes() -> dict[str, str]:
    """Return the module of `paraflex.plots` that defines each figure's function."""
    return {figure.name: figure.module for figures in CATALOGUE.values() for figure in figures}
