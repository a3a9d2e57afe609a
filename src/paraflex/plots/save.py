"""Figures as files: those written with the results of a command, and single ones for print."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

import xarray as xr
from matplotlib.figure import Figure

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError, suggestion
from paraflex.folders import added_to
from paraflex.plots.layout import column_width
from paraflex.plots.planned import PlannedFigure, drawings, figures_of
from paraflex.plots.sources import Source, kind_of_numbers
from paraflex.plots.style import journal_style
from paraflex.results.kinds import kind_of
from paraflex.writing import portable_name, whole_file

# Files that do not depend on when they were written.
_METADATA: Mapping[str, dict[str, Any]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
FIGURE_FORMATS = tuple(_METADATA)


@checked_arguments()
def save_figures(results: xr.Dataset | Mapping[str, Any], folder: str | Path, mode: str | None = None) -> list[Path]:
    """Write the figures that a command adds to its results, as PNG (200 dpi) and SVG.

    Files are named by what they show, like `desired_path.png`; those of a run along a path are the paper's Figs. 11 to
    18, of a verification its Figs. 22 and 23 of every mode and the distances of all models; of others see
    `paraflex plot --list`. There are none where nothing can be shown: of a search in which no design ran, of metrics
    that do not vary.

    Parameters
    ----------
    results : xarray.Dataset or mapping
        From `paraflex.results`, or a study's result in plain numbers: its `to_dict()`.
    folder : str or Path
        Made if it is not there; files of the same names are written over.
    mode : str, optional
        Of the figures that show one mode; by default the one with most active motors where modes are named by the
        signs of their motors, else the first.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    InputError
        No such mode, or numbers of no result.
    OutputError
        The folder cannot be written.
    """
    folder = Path(folder)
    kind = kind_of(results) if isinstance(results, xr.Dataset) else kind_of_numbers(results)
    if not kind:
        raise InputError("not the numbers of a result", field="results", remedy="give what its to_dict() returns")
    source = Source(kind, results, folder)
    written: list[Path] = []
    with added_to(folder) as new:
        for figure in figures_of(source):
            if not figure.written_as:
                continue
            for drawing in drawings(source, figure, [mode] if mode is not None and figure.takes == "mode" else ()):
                one_of_many = figure.takes in ("models", "run")
                stem = portable_name(f"{figure.written_as}_{drawing.of}" if one_of_many else figure.written_as)
                written += _write(drawing.draw(), [new / f"{stem}.{suffix}" for suffix in ("png", "svg")])
    return [folder / file.name for file in written]


def write_figures(
    drawn: Sequence[PlannedFigure],
    folder: Path,
    formats: Sequence[str] = ("pdf",),
    *,
    style: str | None = None,
    dpi: float = 300.0,
    force: bool = False,
) -> list[Path]:
    """Draw figures for print and write them, each whole or not at all.

    Parameters
    ----------
    drawn : sequence of PlannedFigure
    folder : Path
        Made if it is not there.
    formats : sequence of str
        From FIGURE_FORMATS.
    style : str, optional
        "single" or "double": the width of one or two columns; by default what suits each figure.
    dpi : float
        Dots an inch, of PNG.
    force : bool
        Whether files of the same names are written over.

    Returns
    -------
    list of Path
    """
    for name in formats or ("",):
        if name not in FIGURE_FORMATS:
            raise InputError("unknown format", field="--format", value=name, remedy=suggestion(name, FIGURE_FORMATS))
    files = {drawing.stem: [folder / f"{portable_name(drawing.stem)}.{name}" for name in formats] for drawing in drawn}
    there = [file for each in files.values() for file in each if file.exists()]
    if there and not force:
        more = f" and {len(there) - 1} more" if len(there) > 1 else ""
        raise InputError(
            f"is there already{more}",
            field=str(there[0]),
            remedy="add --force to write over it, or name another --output",
        )
    written: list[Path] = []
    with added_to(folder) as new:
        for drawing in drawn:
            with column_width(style):
                figure = drawing.draw()
            written += _write(figure, [new / file.name for file in files[drawing.stem]], dpi)
    return [folder / file.name for file in written]


def _write(figure: Figure, files: Iterable[Path], dpi: float | None = None) -> list[Path]:
    written = []
    for path in files:
        suffix = path.suffix[1:]
        with whole_file(path, field=str(path.parent)) as unfinished:
            write_figure(figure, unfinished, suffix, dpi)
        written.append(path)
    return written


def write_figure(figure: Figure, file: Path | TextIO, format_name: str, dpi: float | None = None) -> None:
    """Write a figure in one of FIGURE_FORMATS, the same bytes whenever that is."""
    with journal_style():
        figure.savefig(file, format=format_name, metadata=_METADATA[format_name], dpi="figure" if dpi is None else dpi)
