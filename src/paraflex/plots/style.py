"""Style of every figure: fonts, and lines that are distinguishable in black and white."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import matplotlib.style
from matplotlib.figure import Figure

# Okabe and Ito (2008), Color Universal Design; their yellow is omitted because it is too light for a thin line.
BLACK, BLUE, VERMILLION, GREEN = "#000000", "#0072B2", "#D55E00", "#009E73"
COLOURS = (BLUE, VERMILLION, GREEN, BLACK, "#CC79A7", "#E69F00", "#56B4E9")
SHADE = "0.92"

# Fonts are those of Matplotlib, so that a figure is the same on every machine.
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 8.0,
    "axes.titlepad": 3.0,
    "axes.titley": 1.0,  # A fixed position: searching for free room above a panel takes time.
    "axes.labelsize": 8.0,
    "axes.labelpad": 2.0,
    "axes.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.xmargin": 0.0,
    "axes.ymargin": 0.06,
    "axes.formatter.useoffset": False,
    "axes.formatter.use_mathtext": False,  # Parsing each number as mathematics would take most of the time.
    "axes.formatter.limits": (-4, 6),
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "lines.linewidth": 0.9,
    "lines.dash_capstyle": "butt",
    "lines.scale_dashes": True,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "legend.handlelength": 2.8,
    "legend.columnspacing": 1.6,
    "legend.borderaxespad": 0.2,
    "legend.borderpad": 0.1,
    "figure.dpi": 200.0,
    "savefig.dpi": "figure",
    "svg.hashsalt": "paraflex",
    "svg.fonttype": "path",
    # TrueType in PDF and PostScript, as publishers ask: Matplotlib's Type 3 fonts are refused by many.
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
}
# Metadata without dates, so that files do not depend on when they are written.
_METADATA: Mapping[str, dict[str, Any]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
FIGURE_FORMATS = tuple(_METADATA)


@contextmanager
def journal_style() -> Iterator[None]:
    """Draw in the style of this package, on Matplotlib's defaults, without reading or changing the user's settings."""
    with matplotlib.style.context(STYLE, after_reset=True):
        yield


def write_figure(figure: Figure, file: Path | TextIO, format_name: str, dpi: float | None = None) -> None:
    """Write a figure in one of FIGURE_FORMATS; its bytes do not depend on the date."""
    with journal_style():
        figure.savefig(file, format=format_name, metadata=_METADATA[format_name], dpi="figure" if dpi is None else dpi)
