"""The one list of figures: which there are of each kind of results, what they show, and where their functions are.

`paraflex plot`, the `save_...` functions and the gallery of the documentation read it. A figure more is a function in
this folder and a line here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from paraflex.errors import InputError, suggestion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from paraflex.plots.sources import Source

# What a figure's function takes: all results; results and a mode; results, a mode and a pair of models; results and the
# number of a run; a table of designs; nothing at all.
Takes = Literal["results", "mode", "models", "run", "designs", "nothing"]


@dataclass(frozen=True)
class CatalogueFigure:
    """A figure that can be drawn of some results.

    Attributes
    ----------
    name : str
        Of its function in `paraflex.plots`, and of its files.
    module : str
        Of `paraflex.plots` that the function is in.
    shows : str
        In a line.
    takes : str
        See `Takes`.
    written_as : str
        The name of the file that the command which makes the results writes it to; empty where it does not.
    variables : tuple of str
        Of a dataset, without which there is nothing to draw.
    """

    name: str
    module: str
    shows: str
    takes: Takes = "results"
    written_as: str = ""
    variables: tuple[str, ...] = ()

    @property
    def function(self) -> Callable[..., Figure]:
        """What draws it; its module is imported now."""
        return getattr(import_module(f"paraflex.plots.{self.module}"), self.name)


@dataclass(frozen=True)
class Drawing:
    """A figure to be drawn: of which line of the catalogue, what tells it from others of that line, and how.

    Attributes
    ----------
    figure : CatalogueFigure
    of : str
        The mode, or path and mode, that it shows; empty for all there are.
    draw : callable
    """

    figure: CatalogueFigure
    of: str
    draw: Callable[[], Figure]

    @property
    def stem(self) -> str:
        """Of its files."""
        return f"{self.figure.name}_{self.of}" if self.of else self.figure.name


_RUN = (
    CatalogueFigure(
        "mechanism_drawing", "drawing", "the mechanism half way, links as they bend", "mode", variables=("shape",)
    ),
    CatalogueFigure("energies", "energy", "kinetic and strain energy, work, and how far they balance", "mode"),
    CatalogueFigure(
        "joint_forces", "forces", "magnitude of the force in every joint", "mode", variables=("joint_force",)
    ),
    CatalogueFigure("link_deflections", "time_series", "transverse displacement of the ends of all links", "mode"),
    CatalogueFigure("link_phases", "phase", "angular velocity over angle of every body", "mode"),
)
_DESIGNS = (
    CatalogueFigure("response_curves", "responses", "metrics over parameters", "designs"),
    CatalogueFigure("parallel_coordinates", "parallel", "all numbers of every design, as lines", "designs"),
    CatalogueFigure("pareto_front", "responses", "two metrics of every design, and the best compromises", "designs"),
)
_CONVERGENCE = CatalogueFigure(
    "convergence", "optimisation", "how the search came down, design by design", written_as="convergence"
)
CATALOGUE: Mapping[str, tuple[CatalogueFigure, ...]] = {
    "tracking": (
        CatalogueFigure("desired_path", "workspace", "desired path and the mechanism at its start",
                        written_as="fig11_desired_path"),
        CatalogueFigure("motor_torques", "modes", "torque of every motor in time, a panel a mode",
                        written_as="fig12_motor_torques"),
        CatalogueFigure("tip_deflections", "time_series", "axial and transverse displacement and slope of links' ends",
                        "mode", "fig13_tip_deflections"),
        CatalogueFigure("link_motions", "time_series", "angle, speed and acceleration of links, desired and actual",
                        "mode", "fig14_link_motions"),
        CatalogueFigure("end_effector_path", "workspace", "desired and actual path, deviation magnified", "mode",
                        "fig15_end_effector_path"),
        CatalogueFigure("end_effector_motion", "time_series", "the end-effector's motion, desired and actual", "mode",
                        "fig16_end_effector_motion"),
        CatalogueFigure("phase_diagrams", "phase", "phase diagrams of the end-effector", "mode",
                        "fig17_phase_diagrams"),
        CatalogueFigure("tracking_errors", "modes", "tracking error in x and y in time, a panel a mode",
                        written_as="fig18_tracking_errors"),
        CatalogueFigure("tracking_distance", "driving", "distance from the desired place in time, all modes"),
        CatalogueFigure("mode_comparison", "driving", "tracking error, vibration and largest torque of every mode"),
        CatalogueFigure("actuation_condition", "driving",
                        "condition number of the actuation matrix along the path, all modes",
                        variables=("actuation_condition",)),
        *_RUN,
    ),
    "motion": (
        CatalogueFigure("motion_overview", "overview", "angles, speeds and energies", written_as="motion_overview"),
        CatalogueFigure("coordinates", "free_motion", "generalised coordinates, those of the bodies' modes included"),
        CatalogueFigure("point_paths", "free_motion", "where named points go in the plane"),
        *_RUN,
    ),
    "verification": (
        CatalogueFigure("compared_links", "agreement", "angle and speed of links in two models", "models",
                        "fig22_links"),
        CatalogueFigure("compared_paths", "agreement", "path of the end-effector in two models", "models",
                        "fig23_paths"),
        CatalogueFigure("model_distances", "agreement",
                        "distances of all models from the desired place and the reference",
                        written_as="model_distances"),
        CatalogueFigure("compared_deflections", "agreement", "transverse displacement of links' ends in all models",
                        "mode"),
    ),
    "methods": (
        CatalogueFigure("work_precision", "methods", "wall time and steps over error",
                        written_as="work_precision"),
        CatalogueFigure("numerical_damping", "spectra", "what each method does to a vibration", "nothing"),
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
        CatalogueFigure("elasticities", "derivatives", "change of metrics by change of parameters", "run",
                        "elasticities"),
    ),
    "modes": (
        CatalogueFigure("mode_conditions", "driving", "worst condition number of every mode along the path"),
    ),
}  # fmt: skip

# Of results read from JSON, what must be there for a figure.
_TOLD: Mapping[str, Callable[[Any], bool]] = {
    "convergence": lambda told: any(value is not None for _, value, _ in told.get("history", ())),
    "targets_reached": lambda told: any(target["value"] != 0.0 for target in told.get("targets", ())),
    "sobol_bars": lambda told: any(row["first"] is not None for row in told.get("indices", ())),
    "work_precision": lambda told: any(
        run["status"] == "complete" for method in told["methods"].values() for run in method["runs"]
    ),
    "mode_conditions": lambda told: any("condition_max" in row for row in told),
}


def homes() -> dict[str, str]:
    """The module of `paraflex.plots` that each figure's function is in."""
    return {figure.name: figure.module for figures in CATALOGUE.values() for figure in figures}


def figures_of(source: Source) -> list[CatalogueFigure]:
    """The figures that can be drawn of some results."""
    return [figure for figure in CATALOGUE[source.kind] if _can_be_drawn(figure, source)]


def find_figure(source: Source, name: str) -> CatalogueFigure:
    """A figure by its name, or by that of its file.

    Raises
    ------
    InputError
        There is none of that name of these results.
    """
    there = figures_of(source)
    for figure in there:
        if name in (figure.name, figure.written_as):
            return figure
    names = [figure.name for figure in there]
    near = suggestion(name, names)
    listed = "" if near.startswith("choose from") else f" There are: {', '.join(names)}"
    elsewhere = "" if name not in homes() else f", of results of kind {source.kind}"
    raise InputError(f"no such figure{elsewhere}", field="FIGURE", value=name, remedy=near + listed)


def drawings(
    source: Source, figure: CatalogueFigure, modes: Sequence[str] = (), metrics: Sequence[str] = ()
) -> list[Drawing]:
    """A figure of results: one, or one for each mode or run.

    Parameters
    ----------
    source : Source
    figure : CatalogueFigure
    modes : sequence of str
        Actuation modes that are shown; by default all, or of figures that show one, that with most active motors.
    metrics : sequence of str
        Of figures of many designs; by default the first that vary.

    Raises
    ------
    InputError
        No such mode.
    """
    make = {"mode": _of_modes, "models": _of_models, "run": _of_runs, "designs": _of_designs, "nothing": _of_nothing}
    return make.get(figure.takes, _of_results)(source, figure, modes, metrics)


def _can_be_drawn(figure: CatalogueFigure, source: Source) -> bool:
    if figure.takes == "designs":
        return source.designs is not None and bool(source.designs.series)
    if figure.takes == "models":
        from paraflex.plots.agreement import prototype_pair

        return prototype_pair(source.data) is not None
    if figure.name in _TOLD:
        return _TOLD[figure.name](source.data)
    return all(name in source.data for name in figure.variables)


def _of_results(source: Source, figure: CatalogueFigure, modes: Sequence[str], _: Sequence[str]) -> list[Drawing]:
    data = source.data
    if modes and source.kind in ("tracking", "verification"):
        data = data.isel(mode=[_known(source, mode) for mode in modes])
    elif modes and source.kind == "indices":
        data = data | {"indices": [row for row in data["indices"] if row["mode"] in modes]}
    elif modes:
        raise InputError(
            "this figure has no modes to choose from", field="--mode", value=modes[0], remedy="leave it out"
        )
    return [Drawing(figure, ",".join(modes), partial(figure.function, data))]


def _of_modes(source: Source, figure: CatalogueFigure, modes: Sequence[str], _: Sequence[str]) -> list[Drawing]:
    from paraflex.plots.runs import default_mode

    if source.kind == "motion":
        if modes:
            return _of_results(source, figure, modes, ())
        return [Drawing(figure, "", partial(figure.function, source.data))]
    for mode in modes:
        _known(source, mode)
    chosen = list(modes) or [default_mode(source.data)]
    return [Drawing(figure, mode, partial(figure.function, source.data, mode)) for mode in chosen]


def _of_models(source: Source, figure: CatalogueFigure, modes: Sequence[str], _: Sequence[str]) -> list[Drawing]:
    from paraflex.plots.agreement import prototype_pair

    pair = prototype_pair(source.data)
    for mode in modes:
        _known(source, mode)
    chosen = list(modes) or [str(name) for name in source.data["mode"].values]
    return [Drawing(figure, mode, partial(figure.function, source.data, mode, pair)) for mode in chosen]


def _of_runs(source: Source, figure: CatalogueFigure, modes: Sequence[str], _: Sequence[str]) -> list[Drawing]:
    runs = source.data["runs"]
    known = list(dict.fromkeys(run["mode"] for run in runs))
    for mode in modes:
        if mode not in known:
            raise _no_mode(mode, known)
    return [
        Drawing(figure, f"{run['path']}_{run['mode']}", partial(figure.function, source.data, k))
        for k, run in enumerate(runs)
        if not modes or run["mode"] in modes
    ]


def _of_designs(source: Source, figure: CatalogueFigure, modes: Sequence[str], metrics: Sequence[str]) -> list[Drawing]:
    table = source.designs
    assert table is not None
    shown = table.in_modes(modes) if modes else table
    return [Drawing(figure, ",".join(modes), partial(figure.function, shown, list(metrics) or None))]


def _of_nothing(_: Source, figure: CatalogueFigure, __: Sequence[str], ___: Sequence[str]) -> list[Drawing]:
    return [Drawing(figure, "", figure.function)]


def _known(source: Source, mode: str) -> int:
    names = [str(name) for name in source.data["mode"].values]
    if mode not in names:
        raise _no_mode(mode, names)
    return names.index(mode)


def _no_mode(mode: str, known: list[str]) -> InputError:
    return InputError("no such mode in these results", field="--mode", value=mode, remedy="one of " + ", ".join(known))
