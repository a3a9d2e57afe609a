"""Requests of commands on stored results."""

from dataclasses import MISSING, dataclass
from functools import partial

from .options import units_option
from .requests import argument, option, repeatable, switch

_results = partial(argument, "RESULTS", "A folder or file that paraflex wrote.")
_overwrite = partial(switch, "--force", "Overwrite existing files.")


@dataclass(frozen=True, kw_only=True)
class ReportRequest:
    """Options of `paraflex report`."""

    results: str = argument("RESULTS", "A folder of run, verify, sweep, optimise or identify, or a file of it.")
    output: str | None = option("--output FILE", "Output. Default: report.html beside the results.")
    units: str | None = units_option()
    force: bool = switch("--force", "Overwrite an existing file.")


@dataclass(frozen=True, kw_only=True)
class AnimateRequest:
    """Options of `paraflex animate`."""

    results: str = argument("RESULTS", "The folder of a run or verification, or a file.")
    output: str = argument("OUT", "FILE.mp4, .gif, .svg, .png (one picture), or a folder of PNG.")
    modes: list[str] = repeatable("--mode MODE", "Actuation mode; repeatable, drawn side by side. Default: the first.")
    magnify: float | None = option(
        "--magnify TIMES", "Scale factor of deflections. Default: a round number that shows bending."
    )
    fps: float = option("--fps N", "Frames per second.", default=30.0)
    speed: float | None = option(
        "--speed RATIO", "Playback speed, 0.1 is ten times slower. Default: a round one for about 5 s."
    )
    size: str | None = option("--size WIDTHxHEIGHT", "Size in pixels. Default: fitted.")
    theme: str = option("--theme light|dark", "Colours.", default="light")
    at: float | None = option("--at S", "Time of one picture. Default: half way.", unit="s")
    model: str | None = option("--model NAME", "Model of a verification. Default: its reference.")
    point: list[str] = repeatable(
        "--point BODY.POINT", "Point whose trail is drawn; repeatable. Default: end-effector."
    )
    force: bool = _overwrite()


@dataclass(frozen=True, kw_only=True)
class CompareRequest:
    """Options of `paraflex compare`."""

    first: str = argument("RESULTS", "The folder of a run, or a file.")
    second: str = argument("RESULTS", "The results compared with it.")
    modes: list[str] = repeatable("--mode MODE", "Actuation mode; repeatable. Default: all that both have.")
    out: str | None = option("--out DIR", "Folder for compare.json and figures.")
    units: str | None = units_option()
    force: bool = _overwrite()
    json: bool = switch("--json", "Print the numbers as JSON.")


@dataclass(frozen=True, kw_only=True)
class ExportRequest:
    """Options of `paraflex export`."""

    results: str = _results()
    to: str = option("--to csv|parquet|mat|netcdf", "Format of the files.", default=MISSING)
    output: str | None = option("--output --out FILE|DIR", "Output. Default: export/ beside the results.")
    shapes: bool = switch("--shapes", "Also a table of deformed shapes; mat and netcdf always have them.")
    units: str | None = units_option()
    force: bool = _overwrite()


@dataclass(frozen=True, kw_only=True)
class PlotRequest:
    """Options of `paraflex plot`."""

    results: str = _results()
    figures: list[str] = argument("FIGURE...", 'Figures by name, or "all". Default: list them.', default=[])
    modes: list[str] = repeatable("--mode MODE", "Actuation mode; repeatable. Default: all, or that with most motors.")
    metrics: list[str] = repeatable(
        "--metric NAME", "Metric of many designs; repeatable. Default: the first that vary."
    )
    points: list[str] = repeatable(
        "--point BODY.POINT",
        "Named point in place of the end-effector; repeatable. With all: in figures that show points.",
    )
    over: str = option(
        "--over NAME", 'Abscissa of curves over time: a joint, or "BODY.POINT.x". With all: of figures that have any.',
        default="time",
    )  # fmt: skip
    styles: list[str] = repeatable(
        "--style STYLE",
        "single or double: width of one or two columns, by default what suits each figure; or a style of Matplotlib, "
        "by name or file; repeatable.",
    )
    font: str | None = option("--font FAMILY", "Family of fonts. Default: DejaVu Sans, or that of the style.")
    svg_text: bool = switch("--svg-text", "Text in SVG as text to edit, in fonts of the viewer; else as outlines.")
    format: str = option("--format pdf,svg,png,pgf", "One or several formats; pgf needs LaTeX.", default="pdf")
    output: str | None = option("--output --out DIR", "Folder. Default: figures/ in RESULTS.")
    dpi: float = option("--dpi N", "Dots per inch of PNG.", default=300.0)
    units: str | None = units_option()
    force: bool = _overwrite()
    only_list: bool = switch("--list", "List the figures of these results.")
