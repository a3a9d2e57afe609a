"""What is made of results that are there."""

from __future__ import annotations

from typing import Annotated

import typer


def report(
    results: Annotated[
        str,
        typer.Argument(metavar="RESULTS", help="A folder that run, verify, sweep or optimise wrote, or a file of it."),
    ],
    output: Annotated[
        str | None, typer.Option("--output", metavar="FILE", help="Default: report.html beside the results.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Write over a file that is there.")] = False,
) -> None:
    """Write the report of results that are there: one HTML file that needs no network."""
    from paraflex.cli.report import report_command

    report_command(results, output, force=force)


def animate(
    results: Annotated[str, typer.Argument(metavar="RESULTS", help="The folder of a run or verification, or a file.")],
    output: Annotated[
        str, typer.Argument(metavar="OUT", help="FILE.mp4, .gif, .svg, .png (one picture), or a folder of PNG.")
    ],
    mode: Annotated[
        list[str] | None,
        typer.Option(metavar="MODE", help="Actuation mode; repeated they stand side by side. Default: the first."),
    ] = None,
    magnify: Annotated[float, typer.Option(metavar="TIMES", help="How many times deflections are drawn.")] = 1.0,
    fps: Annotated[float, typer.Option(metavar="N", help="Pictures a second.")] = 30.0,
    speed: Annotated[
        float | None,
        typer.Option(metavar="RATIO", help="0.1 is ten times slower. Default: a round one at which it takes 5 s."),
    ] = None,
    size: Annotated[str | None, typer.Option(metavar="WIDTHxHEIGHT", help="In pixels. Default: what fits.")] = None,
    theme: Annotated[str, typer.Option(metavar="light|dark", help="Colours.")] = "light",
    at: Annotated[float | None, typer.Option(metavar="S", help="Time of one picture. Default: half way.")] = None,
    model: Annotated[
        str | None, typer.Option(metavar="NAME", help="Of a verification. Default: its reference.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Write over what is there.")] = False,
) -> None:
    """Make a film of a run: mp4, gif, animated svg, or pictures."""
    from paraflex.cli.animate import AnimateRequest, animate_command

    request = AnimateRequest(results, output, mode or [], magnify, fps, speed, size, theme, at, model, force)
    raise typer.Exit(animate_command(request))


def export(
    results: Annotated[str, typer.Argument(metavar="RESULTS", help="A folder or file that paraflex wrote.")],
    to: Annotated[str, typer.Option("--to", metavar="csv|parquet|mat|netcdf", help="For which programs.")],
    output: Annotated[
        str | None, typer.Option("--output", "--out", metavar="FILE|DIR", help="Default: export/ beside the results.")
    ] = None,
    shapes: Annotated[
        bool, typer.Option("--shapes", help="A table of deformed shapes too; mat and netcdf always have them.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Write over what is there.")] = False,
) -> None:
    """Write results for other programs: tables as CSV or Parquet, a struct for MATLAB, netCDF."""
    from paraflex.cli.export import ExportRequest, export_command

    raise typer.Exit(export_command(ExportRequest(results, to, output, shapes, force)))


def plot(
    results: Annotated[str, typer.Argument(metavar="RESULTS", help="A folder or file that paraflex wrote.")],
    figure: Annotated[
        list[str] | None, typer.Argument(metavar="FIGURE...", help='Figures by name, or "all". None: they are listed.')
    ] = None,
    mode: Annotated[
        list[str] | None,
        typer.Option(metavar="MODE", help="Actuation mode; repeatable. Default: all, or that with most motors."),
    ] = None,
    metric: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Metric of many designs; repeatable. Default: the first that vary."),
    ] = None,
    style: Annotated[
        str | None,
        typer.Option(metavar="single|double", help="Width of one or two columns. Default: what suits each figure."),
    ] = None,
    format: Annotated[str, typer.Option(metavar="pdf,svg,png", help="One or several.")] = "pdf",
    output: Annotated[
        str | None, typer.Option("--output", "--out", metavar="DIR", help="Folder. Default: figures/ in RESULTS.")
    ] = None,
    dpi: Annotated[float, typer.Option(metavar="N", help="Dots an inch of PNG.")] = 300.0,
    force: Annotated[bool, typer.Option("--force", help="Write over files that are there.")] = False,
    list_figures: Annotated[bool, typer.Option("--list", help="List the figures of these results.")] = False,
) -> None:
    """Draw figures of any results for print: a run's, a verification's, a comparison's, a study's."""
    from paraflex.cli.plot import PlotRequest, plot_command

    request = PlotRequest(
        results=results,
        figures=[] if list_figures else figure or [],
        modes=mode or [],
        metrics=metric or [],
        style=style,
        formats=[name.strip().lower() for name in format.split(",") if name.strip()],
        output=output,
        dpi=dpi,
        force=force,
    )
    raise typer.Exit(plot_command(request))
