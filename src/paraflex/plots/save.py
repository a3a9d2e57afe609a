"""Writing of figures: those that accompany the results of a command, and single figures for print."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.campaign.workers import share_out
from paraflex.errors import InputError
from paraflex.figures.charts import TIME
from paraflex.figures.kinematics import kinematics_of
from paraflex.folders import added_to
from paraflex.mechanism.quantities import all_listed
from paraflex.results.kinds import kind_of
from paraflex.writing import portable_name, whole_file
from .layout import column_width
from .planned import PlannedFigure, drawings, figures_of
from .sources import Source, kind_of_numbers
from .style import FIGURE_FORMATS, check_latex, write_figure


@checked_arguments()
def save_figures(results: xr.Dataset | Mapping[str, Any], folder: str | Path, mode: str | None = None) -> list[Path]:
    """Write the figures that a command adds to its results, as PNG (200 dpi) and SVG.

    Files are named after their content, such as `desired_path.png`. Those of a run along a path are the paper's Figs.
    11 to 18, those of a verification its Figs. 22 and 23 for every mode and the distances of all models; for other
    results see `paraflex plot --list`. Figures without content are omitted, such as those of a search in which no
    design ran or of metrics that do not vary.

    Parameters
    ----------
    results : xarray.Dataset or mapping
        Dataset from `paraflex.results`, or the plain numbers of a study's result (its `to_dict()`).
    folder : str or Path
        Output folder; it is created if needed, and files of the same names are overwritten.
    mode : str, optional
        Mode of the figures that show a single mode; by default the one with most active motors if modes are named by
        the signs of their motors, else the first.

    Returns
    -------
    list of Path
        Written files.

    Raises
    ------
    InputError
        There is no such mode, or the numbers are not those of a result.
    OutputError
        The folder cannot be written.
    """
    return _write_beside(_accompanying(results, Path(folder), mode), Path(folder))


def figure_calls(results: xr.Dataset | Mapping[str, Any], folder: Path) -> list[Callable[[], object]]:
    """Return a call for each figure of `save_figures`, which writes it: first those of low panels, which have many."""
    drawn = sorted(_accompanying(results, folder), key=lambda drawing: drawing.figure.height)
    return [partial(_write_beside, [figure], folder) for figure in drawn]


def _write_beside(drawn: Sequence[PlannedFigure], folder: Path) -> list[Path]:
    return write_figures(drawn, folder, ("png", "svg"), dpi=None, force=True)


def _accompanying(
    results: xr.Dataset | Mapping[str, Any], folder: Path, mode: str | None = None
) -> list[PlannedFigure]:
    """Return the figures that `save_figures` writes."""
    kind = kind_of(results) if isinstance(results, xr.Dataset) else kind_of_numbers(results)
    if not kind:
        raise InputError("not the numbers of a result", field="results", remedy="give what its to_dict() returns")
    source = Source(kind, results, folder)
    joint = kinematics_of(results).get("over") if isinstance(results, xr.Dataset) else None
    drawn = []
    for figure in figures_of(source, written=True):
        named, one_of_many = replace(figure, name=figure.written_as), figure.takes in ("models", "run")
        modes = [mode] if mode is not None and figure.takes == "mode" else ()
        # A mechanism with a drive is shown over its angle or travel, as designers know it.
        over = joint if joint and figure.is_over_time(results) else TIME.name
        for drawing in drawings(source, figure, modes, over=over):
            drawn.append(replace(drawing, figure=named, of=drawing.of if one_of_many else ""))
    return drawn


def write_figures(
    drawn: Sequence[PlannedFigure],
    folder: Path,
    formats: Sequence[str] = ("pdf",),
    *,
    style: str | None = None,
    dpi: float | None = 300.0,
    force: bool = False,
) -> list[Path]:
    """Draw figures on all processors and write them, each whole or not at all.

    Parameters
    ----------
    drawn : sequence of PlannedFigure
        Figures to draw.
    folder : Path
        Output folder; it is created if needed.
    formats : sequence of str
        File formats from FIGURE_FORMATS; PDF by default.
    style : str, optional
        Width of the figures, "single" or "double" column; by default each figure has its own width.
    dpi : float, optional
        Resolution of PNG files [dots per inch]; that of the figure if None.
    force : bool
        Whether files of the same names are overwritten; by default they raise an error.

    Returns
    -------
    list of Path
        Written files.

    Raises
    ------
    InputError
        A format is unknown or needs LaTeX, which is missing, or a file exists and `force` is False.
    """
    all_listed(formats or ("",), FIGURE_FORMATS, "--format", "unknown format")
    check_latex(formats)
    files = {drawing.stem: [folder / f"{portable_name(drawing.stem)}.{name}" for name in formats] for drawing in drawn}
    there = [file for each in files.values() for file in each if file.exists()]
    if there and not force:
        more = f" and {len(there) - 1} more" if len(there) > 1 else ""
        raise InputError(
            f"is there already{more}",
            field=str(there[0]),
            remedy="add --force to write over it, or name another --output",
        )
    with added_to(folder) as new:
        share_out([partial(_write, drawing, [new / file.name for file in files[drawing.stem]], style, dpi)
                   for drawing in drawn])  # fmt: skip
    return [file for drawing in drawn for file in files[drawing.stem]]


def _write(drawing: PlannedFigure, files: Sequence[Path], style: str | None, dpi: float | None) -> None:
    with column_width(style):
        figure = drawing.draw()
    for file in files:
        with whole_file(file, field=str(file.parent)) as unfinished:
            write_figure(figure, unfinished, file.suffix[1:], dpi)
