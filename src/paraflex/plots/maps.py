"""Maps of metrics over two parameters of many designs."""

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator
from matplotlib.tri import Triangulation

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.figures.designs import DesignTable
from paraflex.formatting import logarithmic_number, peak
from .given import drawn
from .labels import mathematics
from .layout import ONE_COLUMN, TWO_COLUMNS, is_narrow, lay_out, panels

# Largest number of panels, approximate number of contour lines of a panel, and shades between two lines.
_MOST_METRICS, _LINES, _BETWEEN = 3, 7, 4
# Ratio of a metric's values above which its lines are at 1, 2 and 5 times powers of ten.
_SPREAD = 20.0
# End of the used part of the colour map: its light end is too light for labels on it.
_LIGHTEST = 0.9


@drawn
def response_map(table: DesignTable, metrics: Sequence[str] | None = None) -> Figure:
    """Plot contours of metrics over the first two parameters that vary, from dark (small) to light (large).

    Dots are designs, which need not form a grid; metrics are interpolated linearly between them. Only runs of the first
    path and mode are used.

    Parameters
    ----------
    metrics : sequence of str, optional
        At most three metrics; by default the first that varies.
    """
    names = table.varied
    series = list(table.series.values())
    if not table.spans_plane:
        raise InputError(
            "a map is over two parameters that vary", field="table", value=", ".join(names) or None,
            remedy="vary two of them, or draw response_curves",
        )  # fmt: skip
    chosen = table.judged_by(metrics, 1)[:_MOST_METRICS]
    columns = 1 if is_narrow() else len(chosen)
    figure, axes = panels(len(chosen), columns, width=ONE_COLUMN if len(chosen) == 1 else TWO_COLUMNS)
    for panel, metric in zip(axes.flat, chosen, strict=True):
        shown = [(series[0].column(name), *table.labelled(name)) for name in (*names[:2], metric)]
        _draw_map(panel, *(factor * values for values, _, factor in shown))
        across, up, title = (mathematics(label) for _, label, _ in shown)
        panel.set(xlabel=across, ylabel=up, title=title)
    return lay_out(figure, axes, panel_height=58.0)


def _draw_map(panel: Axes, x: Array, y: Array, values: Array) -> None:
    known = np.isfinite(values)
    x, y, values = x[known], y[known], values[known]
    # Triangulate in normalised coordinates, so that the triangles do not depend on units.
    unit = [(each - each.min()) / (float(np.ptp(each)) or 1.0) for each in (x, y)]
    areas = Triangulation(x, y, Triangulation(*unit).triangles)
    spread = values.min() > 0.0 and values.max() > _SPREAD * values.min()
    norm = LogNorm(values.min(), values.max()) if spread else Normalize(values.min(), values.max())
    locator = LogLocator(subs=(1.0, 2.0, 5.0)) if spread else MaxNLocator(_LINES)
    lines = np.asarray(locator.tick_values(values.min(), values.max()))
    lines = lines[(lines > values.min()) & (lines < values.max())]
    ends = np.unique([values.min(), *lines, values.max()])
    fine = np.interp(np.linspace(0.0, ends.size - 1.0, _BETWEEN * (ends.size - 1) + 1), np.arange(ends.size), ends)
    shades = ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0.0, _LIGHTEST, 256)))
    panel.tricontourf(areas, values, levels=fine, cmap=shades, norm=norm)
    drawn_lines = panel.tricontour(areas, values, levels=lines, colors="white", linewidths=0.8)
    most = peak(values)
    panel.clabel(
        drawn_lines, fmt=lambda value: logarithmic_number(value) if spread else _plain(value, most), fontsize=7.0
    )
    panel.plot(x, y, linestyle="", marker=".", markersize=2.0, color="white", alpha=0.8, clip_on=False)
    panel.margins(0.0)
    # A number at the right end would extend beyond the figure.
    panel.xaxis.set_major_locator(MaxNLocator(5, prune="upper"))


def _plain(value: float, most: float) -> str:
    return "0" if abs(value) < 1e-12 * most else f"{value:g}"
