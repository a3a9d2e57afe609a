"""Which figures can be drawn of some results, and each as it is to be drawn: of a mode, a run or many designs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from paraflex.errors import InputError, suggestion
from paraflex.plots.catalogue import CATALOGUE, CatalogueFigure, homes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from paraflex.plots.sources import Source


@dataclass(frozen=True)
class PlannedFigure:
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
) -> list[PlannedFigure]:
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


def _of_results(source: Source, figure: CatalogueFigure, modes: Sequence[str], _: Sequence[str]) -> list[PlannedFigure]:
    data = source.data
    if modes and source.kind in ("tracking", "verification"):
        data = data.isel(mode=[_known(source, mode) for mode in modes])
    elif modes and source.kind == "indices":
        data = data | {"indices": [row for row in data["indices"] if row["mode"] in modes]}
    elif modes:
        raise InputError(
            "this figure has no modes to choose from", field="--mode", value=modes[0], remedy="leave it out"
        )
    return [PlannedFigure(figure, ",".join(modes), partial(figure.function, data))]


def _of_modes(source: Source, figure: CatalogueFigure, modes: Sequence[str], _: Sequence[str]) -> list[PlannedFigure]:
    from paraflex.plots.runs import default_mode

    if source.kind == "motion":
        if modes:
            return _of_results(source, figure, modes, ())
        return [PlannedFigure(figure, "", partial(figure.function, source.data))]
    for mode in modes:
        _known(source, mode)
    chosen = list(modes) or [default_mode(source.data)]
    return [PlannedFigure(figure, mode, partial(figure.function, source.data, mode)) for mode in chosen]


def _of_models(source: Source, figure: CatalogueFigure, modes: Sequence[str], _: Sequence[str]) -> list[PlannedFigure]:
    from paraflex.plots.agreement import prototype_pair

    pair = prototype_pair(source.data)
    for mode in modes:
        _known(source, mode)
    chosen = list(modes) or [str(name) for name in source.data["mode"].values]
    return [PlannedFigure(figure, mode, partial(figure.function, source.data, mode, pair)) for mode in chosen]


def _of_runs(source: Source, figure: CatalogueFigure, modes: Sequence[str], _: Sequence[str]) -> list[PlannedFigure]:
    runs = source.data["runs"]
    known = list(dict.fromkeys(run["mode"] for run in runs))
    for mode in modes:
        if mode not in known:
            raise _no_mode(mode, known)
    return [
        PlannedFigure(figure, f"{run['path']}_{run['mode']}", partial(figure.function, source.data, k))
        for k, run in enumerate(runs)
        if not modes or run["mode"] in modes
    ]


def _of_designs(
    source: Source, figure: CatalogueFigure, modes: Sequence[str], metrics: Sequence[str]
) -> list[PlannedFigure]:
    table = source.designs
    assert table is not None
    shown = table.in_modes(modes) if modes else table
    return [PlannedFigure(figure, ",".join(modes), partial(figure.function, shown, list(metrics) or None))]


def _of_nothing(_: Source, figure: CatalogueFigure, __: Sequence[str], ___: Sequence[str]) -> list[PlannedFigure]:
    return [PlannedFigure(figure, "", figure.function)]


def _known(source: Source, mode: str) -> int:
    names = [str(name) for name in source.data["mode"].values]
    if mode not in names:
        raise _no_mode(mode, names)
    return names.index(mode)


def _no_mode(mode: str, known: list[str]) -> InputError:
    return InputError("no such mode in these results", field="--mode", value=mode, remedy="one of " + ", ".join(known))
