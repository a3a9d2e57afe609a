"""Selection of the figures that can be drawn of some results, one for each mode, run or point as needed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from paraflex import plots
from paraflex.errors import InputError, suggestion
from paraflex.figures.abscissae import find_abscissa
from paraflex.figures.charts import TIME
from paraflex.figures.entry import Figure as CatalogueFigure, prepared
from paraflex.figures.selection import default_mode, names_of, place_of, point_number, prototype_pair
from .catalogue import CATALOGUE, figure_names

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .sources import Source


@dataclass(frozen=True)
class PlannedFigure:
    """Figure to be drawn, with its arguments bound.

    Attributes
    ----------
    figure : CatalogueFigure
        Entry of the catalogue.
    of : str
        Mode, or path and mode, or point that the figure shows; empty if it shows all.
    draw : callable
        Function without arguments that draws the figure.
    """

    figure: CatalogueFigure
    of: str
    draw: Callable[[], Figure]

    @property
    def stem(self) -> str:
        """Stem of the figure's files."""
        return f"{self.figure.name}_{self.of}" if self.of else self.figure.name


def _vibrates(found: Any) -> bool:
    from paraflex.results.linear_motion import drawn_modes  # imported for linear models only

    return any(True for _ in drawn_modes(found, rigid=False))


def figures_of(source: Source, *, written: bool = False) -> list[CatalogueFigure]:
    """Return the figures that can be drawn of some results; only those that their command writes if `written`."""
    figures = (one for one in CATALOGUE[source.kind] if not written or one.is_written(source.data))
    return [figure for figure in figures if _can_be_drawn(figure, source)]


def find_figure(source: Source, name: str) -> CatalogueFigure:
    """Return a figure by its name or by the stem of its file; raise InputError if there is none."""
    there = figures_of(source)
    for figure in there:
        if name in (figure.name, figure.written_as):
            return figure
    if not there:
        raise InputError("nothing in these results can be drawn", field="FIGURE", value=name, remedy="see their report")
    names = [figure.name for figure in there]
    near = suggestion(name, names)
    listed = "" if near.startswith("choose from") else f" There are: {', '.join(names)}"
    elsewhere = "" if name not in figure_names() else f", of results of kind {source.kind}"
    raise InputError(f"no such figure{elsewhere}", field="FIGURE", value=name, remedy=near + listed)


def drawings(
    source: Source,
    figure: CatalogueFigure,
    modes: Sequence[str] = (),
    metrics: Sequence[str] = (),
    points: Sequence[str] = (),
    over: str = TIME.name,
) -> list[PlannedFigure]:
    """Plan a figure of some results: one drawing, or one for each mode, run or point.

    Parameters
    ----------
    source : Source
        Results to be drawn.
    figure : CatalogueFigure
        Figure to be drawn.
    modes : sequence of str
        Actuation modes to show; by default all, or the mode with most active motors for a figure of one mode.
    metrics : sequence of str
        Metrics, for figures of many designs; by default the first that vary.
    points : sequence of str
        Named points to show; by default the end-effector, or those that travel most.
    over : str
        Abscissa of curves over time, see `figures.abscissae`.

    Returns
    -------
    list of PlannedFigure

    Raises
    ------
    InputError
        There is no such mode, point or abscissa, or the figure does not show points or has no curves over time.
    """
    figures = _of_modes(source, figure, modes, metrics)
    if over != TIME.name:
        if not figure.is_over_time(source.data):
            problem = f"{figure.name} has no curves over time"
            raise InputError(problem, field="--over", value=over, remedy="leave it out")
        find_abscissa(prepared(source.data), over, "--over")
        chosen: dict[str, Any] = {"over": over}
        figures = [PlannedFigure(figure, f"{one.of}_over_{over}".lstrip("_"), partial(one.draw, **chosen))
                   for one in figures]  # fmt: skip
    if not points:
        return figures
    if not figure.points:
        able = [one.name for one in figures_of(source) if one.points]
        raise InputError(
            f"{figure.name} is not of a named point", field="--point", value=points[0],
            remedy=f"choose from {', '.join(able)}" if able else "leave it out",
        )  # fmt: skip
    for point in points:
        point_number(source.data, point, "--point")
    shown: list[tuple[str, dict[str, Any]]] = [(point, {"point": point}) for point in points]
    if figure.points == "points":
        shown = [(",".join(points), {"points": list(points)})]
    return [PlannedFigure(figure, "_".join(filter(None, (one.of, named))), partial(one.draw, **chosen))
            for one in figures for named, chosen in shown]  # fmt: skip


def _of_modes(
    source: Source, figure: CatalogueFigure, modes: Sequence[str], metrics: Sequence[str]
) -> list[PlannedFigure]:
    """Plan a figure of some results: one drawing, or one for each mode or run."""

    def planned(of: str, *given: Any) -> PlannedFigure:
        return PlannedFigure(figure, of, partial(getattr(plots, figure.name), *given))

    data, shown = source.data, ",".join(modes)
    if figure.takes == "nothing":
        return [planned("")]
    if figure.takes == "designs":
        assert source.designs is not None
        table = source.designs.in_modes(modes) if modes else source.designs
        return [planned(shown, table, list(metrics) or None)]
    chosen = _chosen(source, modes)
    if figure.takes == "run":
        runs = enumerate(data["runs"])
        return [planned(f"{run['path']}_{run['mode']}", data, k) for k, run in runs if run["mode"] in chosen]
    if figure.takes == "models":
        return [planned(mode, data, mode, prototype_pair(data)) for mode in chosen]
    if figure.takes == "mode" and chosen:
        return [planned(mode, data, mode) for mode in modes or [default_mode(data)]]
    if modes and "indices" in data:
        data = data | {"indices": [row for row in data["indices"] if row["mode"] in modes]}
    elif modes:
        data = data.sel(mode=list(modes))
    return [planned(shown, data)]


def _can_be_drawn(figure: CatalogueFigure, source: Source) -> bool:
    if figure.takes == "designs":
        table = source.designs
        return table is not None and (table.spans_plane if figure.name == "response_map" else bool(table.series))
    if figure.takes == "models":
        return prototype_pair(source.data) is not None
    return figure.can_show(source.data) and (figure.name != "mode_shapes" or _vibrates(source.data))


def _chosen(source: Source, modes: Sequence[str]) -> list[str]:
    """Return the requested modes, by default all; an empty list for results without modes."""
    data, known = source.data, list[str]()
    if "mode" in getattr(data, "dims", ()):
        known = names_of(data, "mode")
    elif isinstance(data, Mapping) and "runs" in data:
        known = list(dict.fromkeys(run["mode"] for run in data["runs"]))
    elif isinstance(data, Mapping) and "indices" in data:
        return list(modes)
    if modes and not known:
        raise InputError(
            "this figure has no modes to choose from", field="--mode", value=modes[0], remedy="leave it out"
        )
    for mode in modes:
        place_of(mode, known, "mode", field="--mode")
    return list(modes) or known
