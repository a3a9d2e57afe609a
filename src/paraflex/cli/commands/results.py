"""Requests of commands on stored results."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from typer import Argument, Option

from paraflex.cli.commands.options import SECONDS

Results = Annotated[str, Argument(metavar="RESULTS", help="A folder or file that paraflex wrote.")]
Force = Annotated[bool, Option("--force", help="Overwrite existing files.")]


@dataclass(frozen=True, kw_only=True)
class ReportRequest:
    """Options of `paraflex report`."""

    results: Annotated[
        str,
        Argument(metavar="RESULTS", help="A folder of run, verify, sweep, optimise or identify, or a file of it."),
    ]
    output: Annotated[
        str | None, Option("--output", metavar="FILE", help="Output. Default: report.html beside the results.")
    ] = None
    force: Annotated[bool, Option("--force", help="Overwrite an existing file.")] = False


@dataclass(frozen=True, kw_only=True)
class AnimateRequest:
    """Options of `paraflex animate`."""

    results: Annotated[str, Argument(metavar="RESULTS", help="The folder of a run or verification, or a file.")]
    output: Annotated[
        str, Argument(metavar="OUT", help="FILE.mp4, .gif, .svg, .png (one picture), or a folder of PNG.")
    ]
    modes: Annotated[
        list[str],
        Option("--mode", metavar="MODE", help="Actuation mode; repeatable, drawn side by side. Default: the first."),
    ] = field(default_factory=list)
    magnify: Annotated[
        float | None,
        Option(metavar="TIMES", help="Scale factor of deflections. Default: a round number that shows bending."),
    ] = None
    fps: Annotated[float, Option(metavar="N", help="Frames per second.")] = 30.0
    speed: Annotated[
        float | None,
        Option(metavar="RATIO", help="Playback speed, 0.1 is ten times slower. Default: a round one for about 5 s."),
    ] = None
    size: Annotated[str | None, Option(metavar="WIDTHxHEIGHT", help="Size in pixels. Default: fitted.")] = None
    theme: Annotated[str, Option(metavar="light|dark", help="Colours.")] = "light"
    at: Annotated[float | None, Option(metavar="S", parser=SECONDS, help="Time of one picture. Default: half way.")] = (
        None
    )
    model: Annotated[str | None, Option(metavar="NAME", help="Model of a verification. Default: its reference.")] = None
    point: Annotated[
        str | None, Option(metavar="BODY.POINT", help="Point whose trail is drawn. Default: the end-effector.")
    ] = None
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class CompareRequest:
    """Options of `paraflex compare`."""

    first: Annotated[str, Argument(metavar="RESULTS", help="The folder of a run, or a file.")]
    second: Annotated[str, Argument(metavar="RESULTS", help="The results compared with it.")]
    modes: Annotated[
        list[str], Option("--mode", metavar="MODE", help="Actuation mode; repeatable. Default: all that both have.")
    ] = field(default_factory=list)
    out: Annotated[str | None, Option(metavar="DIR", help="Folder for compare.json and figures.")] = None
    force: Force = False
    json: Annotated[bool, Option("--json", help="Print the numbers as JSON.")] = False


@dataclass(frozen=True, kw_only=True)
class ExportRequest:
    """Options of `paraflex export`."""

    results: Results
    to: Annotated[str, Option("--to", metavar="csv|parquet|mat|netcdf", help="Format of the files.")]
    output: Annotated[
        str | None, Option("--output", "--out", metavar="FILE|DIR", help="Output. Default: export/ beside the results.")
    ] = None
    shapes: Annotated[
        bool, Option("--shapes", help="Also a table of deformed shapes; mat and netcdf always have them.")
    ] = False
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class PlotRequest:
    """Options of `paraflex plot`."""

    results: Results
    figures: Annotated[
        list[str], Argument(metavar="FIGURE...", help='Figures by name, or "all". Default: list them.')
    ] = field(default_factory=list)
    modes: Annotated[
        list[str],
        Option("--mode", metavar="MODE", help="Actuation mode; repeatable. Default: all, or that with most motors."),
    ] = field(default_factory=list)
    metrics: Annotated[
        list[str],
        Option("--metric", metavar="NAME", help="Metric of many designs; repeatable. Default: the first that vary."),
    ] = field(default_factory=list)
    points: Annotated[
        list[str],
        Option(
            "--point",
            metavar="BODY.POINT",
            help="Named point in place of the end-effector; repeatable. With all: in figures that show points.",
        ),
    ] = field(default_factory=list)
    style: Annotated[
        str | None,
        Option(metavar="single|double", help="Width of one or two columns. Default: what suits each figure."),
    ] = None
    format: Annotated[str, Option(metavar="pdf,svg,png", help="One or several formats.")] = "pdf"
    output: Annotated[
        str | None, Option("--output", "--out", metavar="DIR", help="Folder. Default: figures/ in RESULTS.")
    ] = None
    dpi: Annotated[float, Option(metavar="N", help="Dots per inch of PNG.")] = 300.0
    force: Annotated[bool, Option("--force", help="Overwrite existing files.")] = False
    only_list: Annotated[bool, Option("--list", help="List the figures of these results.")] = False
