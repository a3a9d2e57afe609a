"""`paraflex plot`: figures of stored results, drawn for print."""

import math
from pathlib import Path

import typer

from paraflex.errors import InputError
from paraflex.figures.charts import TIME
from paraflex.plots.planned import drawings, figures_of, find_figure
from paraflex.plots.sources import Source, open_source
from .commands.results import PlotRequest
from .tables import in_own_units

ALL = "all"
STYLES = ("single", "double")
# Largest resolution [dots per inch]: denser pictures exceed any printer, and memory.
_DENSEST = 2400.0


def plot_command(request: PlotRequest) -> None:
    """Draw the requested figures and print their files, or list the available ones."""
    _check(request)
    source = open_source(request.results)
    in_own_units(source.data, source.folder)
    moved = request.over != TIME.name
    if request.only_list or not (request.figures or moved):
        _list(source, request.results)
        return
    if request.figures in ([ALL], []):
        every = figures_of(source)
        chosen = [one for one in every if one.points or not request.points] or every
        chosen = [one for one in chosen if not moved or one.is_over_time(source.data)] or chosen[:1]
    else:
        chosen = list(dict.fromkeys(find_figure(source, name) for name in request.figures))
    requested = (request.modes, request.metrics, request.points, request.over)
    drawn = [drawing for figure in chosen for drawing in drawings(source, figure, *requested)]
    # Matplotlib takes longer to import than everything up to here, so it is imported only now.
    from paraflex.plots.save import write_figures
    from paraflex.plots.style import requested_style

    folder = source.folder / "figures" if request.output is None else Path(request.output)
    formats = [name.strip().lower() for name in request.format.split(",") if name.strip()]
    width = next((name for name in request.styles if name in STYLES), None)
    styles = [name for name in request.styles if name not in STYLES]
    with requested_style(styles, request.font, svg_text=request.svg_text):
        written = write_figures(drawn, folder, formats, style=width, dpi=request.dpi, force=request.force)
    for file in written:
        typer.echo(file)


def _check(request: PlotRequest) -> None:
    """Check the width and the resolution."""
    widths = [name for name in request.styles if name in STYLES]
    if len(widths) > 1:
        raise InputError("more than one width", field="--style", value=" ".join(widths), remedy="name one of them")
    if not (math.isfinite(request.dpi) and 0.0 < request.dpi <= _DENSEST):
        remedy = f"give a number up to {_DENSEST:g}, such as 300"
        raise InputError("not a number of dots per inch", field="--dpi", value=request.dpi, remedy=remedy)


def _list(source: Source, results: str) -> None:
    figures = figures_of(source)
    typer.echo(f"{results}: results of kind {source.kind}; its figures:")
    width = max((len(figure.name) for figure in figures), default=0)
    for figure in figures:
        typer.echo(f"  {figure.name:<{width}}  {figure.shows}")
