"""Style of every figure: fonts, and lines that are distinguishable in black and white; the user's settings above it."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import Any, TextIO

import matplotlib.style
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, fontManager

from paraflex.errors import InputError, suggestion

# Okabe and Ito (2008), Color Universal Design; their yellow is omitted because it is too light for a thin line.
BLACK, BLUE, VERMILLION, GREEN = "#000000", "#0072B2", "#D55E00", "#009E73"
COLOURS = (BLUE, VERMILLION, GREEN, BLACK, "#CC79A7", "#E69F00", "#56B4E9")

# Fonts are those of Matplotlib, so that a figure without settings of the user is the same on every machine.
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
# Sizes of text and distances from it [pt].
_SIZES = [name for name in STYLE if name.endswith((".size", "titlesize", "labelsize", "fontsize", "lepad", "labelpad"))
          and "major" not in name]  # fmt: skip
# Settings that are not taken from the user: figures have a layout of their own, and no window.
_OWN = ("backend", "figure.autolayout", "figure.constrained_layout.use", "interactive")
# Metadata without dates, so that files do not depend on when they are written.
_METADATA: Mapping[str, dict[str, Any]] = {
    "png": {}, "svg": {"metadata": {"Date": None}}, "pdf": {"metadata": {"CreationDate": None}}, "pgf": {},
}  # fmt: skip
FIGURE_FORMATS = tuple(_METADATA)
# Styles of letters in mathematics, as Matplotlib writes them behind a family of fonts.
_SLANTED = {"rm": "", "it": ":italic", "bf": ":bold", "cal": ":italic"}
# Families that Matplotlib resolves by lists of fonts.
_GENERIC = ("serif", "sans-serif", "monospace", "cursive", "fantasy")


def changed_settings() -> dict[str, Any]:
    """Return the user's settings of Matplotlib, from a matplotlibrc, `rcParams` or a style, that are not its defaults.

    Settings that figures here determine themselves, such as an automatic layout, are left out.
    """
    defaults = matplotlib.rcParamsDefault
    # A copy, because the first access to the backend of the original would choose one.
    now = matplotlib.rcParams.copy()
    return {name: value for name, value in now.items() if name not in _OWN and value != defaults[name]}


@contextmanager
def journal_style() -> Iterator[None]:
    """Draw in the style of this package, below the settings that the user has changed, which it leaves as they are.

    Sizes of text that the user has not changed follow `font.size`.
    """
    changed = changed_settings()
    scale = changed.get("font.size", STYLE["font.size"]) / STYLE["font.size"]
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        settings: Any = STYLE | {name: scale * STYLE[name] for name in _SIZES} | changed
        matplotlib.rcParams.update(settings)
        yield


@contextmanager
def requested_style(styles: Sequence[str] = (), font: str | None = None, *, svg_text: bool = False) -> Iterator[None]:
    """Draw with styles of Matplotlib by name or file, later ones above earlier ones, then a family of fonts.

    Parameters
    ----------
    styles : sequence of str
        Names of Matplotlib's styles, or their files.
    font : str, optional
        Name of a family of fonts, for symbols as well; by default that of the styles.
    svg_text : bool
        Whether SVG has its text as text, in fonts of the viewer; by default it has outlines.

    Raises
    ------
    InputError
        A style is neither a name nor a file that can be read, or no such family is installed.
    """
    with matplotlib.rc_context():
        for style in styles:
            _use(style)
        if font is not None:
            family = _family(font)
            symbols: Any = {f"mathtext.{kind}": f"{family}{how}" for kind, how in _SLANTED.items()}
            names: Any = {"font.family": [family, STYLE["font.family"]], "mathtext.fontset": "custom"}
            matplotlib.rcParams.update(names | symbols)
        if svg_text:
            matplotlib.rcParams["svg.fonttype"] = "none"
        yield


def _use(style: str) -> None:
    """Use a style of Matplotlib; raise InputError if there is none of this name, or its file is no style."""
    if style not in matplotlib.style.library and not Path(style).is_file():
        remedy = suggestion(style, ["single", "double", *matplotlib.style.available])
        raise InputError("neither a width nor a style of Matplotlib", field="--style", value=style, remedy=remedy)
    try:
        if style not in matplotlib.style.library:
            lines = [line.partition("#")[0].strip() for line in Path(style).read_text(encoding="utf-8").splitlines()]
            unknown = [line for line in lines if line and line.partition(":")[0].strip() not in matplotlib.rcParams]
            if unknown:
                raise ValueError(f"there is no setting {unknown[0].partition(':')[0].strip()}")
            matplotlib.rc_params_from_file(style, fail_on_error=True, use_default_template=False)
        matplotlib.style.use(style)
    except (OSError, ValueError) as error:
        raise InputError(
            f"not a style of Matplotlib ({str(error).splitlines()[0]})", field="--style", value=style,
            remedy="write lines such as font.size: 9",
        ) from error  # fmt: skip


def _family(font: str) -> str:
    """Return a family of fonts as it is written; raise InputError if it is not installed."""
    known = {name.casefold(): name for name in (*_GENERIC, *sorted({one.name for one in fontManager.ttflist}))}
    if font.casefold() not in known:
        near = {name.casefold(): name for name in known.values() if font.casefold() in name.casefold()}
        remedy = suggestion(font, near.values() or known.values())
        raise InputError("no such family of fonts is installed", field="--font", value=font, remedy=remedy)
    return known[font.casefold()]


def points(setting: Any) -> float:
    """Return a size of text in the current settings, such as "axes.titlesize" [pt]."""
    return FontProperties(size=matplotlib.rcParams[setting]).get_size_in_points()


def ink() -> str:
    """Return the colour of lines and marks that stand out: black, or that of the user's text."""
    return to_hex(matplotlib.rcParams["text.color"])


def line_colours() -> tuple[str, ...]:
    """Return the colours of curves: those of this package, or of a cycle that the user has set."""
    cycle = matplotlib.rcParams["axes.prop_cycle"]
    return COLOURS if cycle == matplotlib.rcParamsDefault["axes.prop_cycle"] else tuple(cycle.by_key()["color"])


def shade() -> tuple[float, ...]:
    """Return the colour behind a span of time: that of panels, mixed with 8 % of the ink."""
    colours = (to_rgb(ink()), to_rgb(matplotlib.rcParams["axes.facecolor"]))
    return tuple(0.08 * dark + 0.92 * pale for dark, pale in zip(*colours, strict=True))


def check_latex(formats: Sequence[str]) -> None:
    """Check that LaTeX is installed if a format or the user's settings need it; raise InputError if it is not."""
    settings = matplotlib.rcParams
    for needed, program, field, value in (
        ("pgf" in formats, settings["pgf.texsystem"], "--format", "pgf"),
        (settings["text.usetex"], "latex", "text.usetex", True),
    ):
        if needed and shutil.which(program) is None:
            raise InputError(
                f"needs LaTeX, and there is no {program}", field=field, value=value,
                remedy="install it, or choose pdf, svg or png without text.usetex",
            )  # fmt: skip


def write_figure(figure: Figure, file: Path | TextIO, format_name: str, dpi: float | None = None) -> None:
    """Write a figure in one of FIGURE_FORMATS; its bytes do not depend on the date."""
    with journal_style():
        figure.savefig(file, format=format_name, dpi="figure" if dpi is None else dpi, **_METADATA[format_name])


def figure_svg(figure: Figure) -> str:
    """Return a figure as the element of SVG for a page."""
    svg = StringIO()
    write_figure(figure, svg, "svg")
    return svg.getvalue()[svg.getvalue().index("<svg") :]
