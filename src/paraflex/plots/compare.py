"""Figures that compare two runs by curves in common panels."""

from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from paraflex.arguments import checked_arguments
from paraflex.figures import comparison as described
from paraflex.figures.entry import Figure as CatalogueFigure
from paraflex.results.comparison import RunComparison
from .charts import print_figure
from .planned import PlannedFigure
from .save import write_figures
from .style import journal_style

# Heights of a panel [mm], and number of panels from which they are low.
_HIGH, _LOW, _MANY = 38.0, 26.0, 6


@checked_arguments()
def overlaid_motion(comparison: RunComparison, name: str, mode: str = "") -> Figure:
    """Plot a quantity of two runs over time, one panel for each of the parts that differ most.

    See `figures.comparison.overlaid_motion` for the parameters and the error.
    """
    charts = list(described.overlaid_motion(comparison, name, mode))
    with journal_style():
        return print_figure(CatalogueFigure(name, "", height=_HIGH if len(charts) < _MANY else _LOW), charts)


def save_overlays(comparison: RunComparison, folder: Path) -> list[Path]:
    """Write figures of all compared motions in all modes as PNG and return the files."""
    drawn = []
    for name, mode in dict.fromkeys((pair.name, pair.mode) for pair in comparison.motions):
        listed = CatalogueFigure(f"overlaid_{name}", "curves of two runs")
        drawn.append(PlannedFigure(listed, mode, partial(overlaid_motion, comparison, name, mode)))
    return write_figures(drawn, folder, ("png",), dpi=200.0, force=True)
