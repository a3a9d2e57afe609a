"""The `paraflex` command."""

from __future__ import annotations

import gc
import os
import sys
from typing import Annotated

import typer

from paraflex.errors import InputError, ParaflexError

app = typer.Typer(
    name="paraflex",
    help="Rigid-flexible dynamics of planar mechanisms with closed loops and several actuation modes.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

BAD_INPUT, TROUBLE, INTERRUPTED = 2, 1, 130

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
PathOption = Annotated[
    str | None,
    typer.Option(
        "--path", metavar="NAME|FILE", help="A path of the model (square, line, circle, ...) or a TOML file with one."
    ),
]
MechanismOption = Annotated[
    str, typer.Option("--mechanism", "-m", metavar="NAME|FILE", help="A library mechanism or a TOML file.")
]
DurationOption = Annotated[float | None, typer.Option(metavar="S", help="Duration, dwell included.")]
SamplesOption = Annotated[int | None, typer.Option(metavar="N", help="Samples kept.")]
MethodOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="Method of integration: paraflex methods lists them.")
]
AssemblyOption = Annotated[str | None, typer.Option(metavar="NAME", help="Which way the mechanism is put together.")]
StudyArgument = Annotated[
    str, typer.Argument(metavar="STUDY.toml", help="What is free within which bounds, what is run.")
]
OutputOption = Annotated[
    str | None, typer.Option("--output", "--out", metavar="DIR", help="Folder for results. Default: results/STUDY.")
]
EngineOption = Annotated[
    str, typer.Option("--engine", metavar="threads|processes|dask", help="Who computes; results are the same.")
]
WorkersOption = Annotated[
    int | None, typer.Option("--workers", metavar="N", help="How many. Default: one a processor.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster", metavar="ADDRESS", help="Of a Dask scheduler, tcp://host:8786. Default: one on this machine."
    ),
]
ReportOption = Annotated[bool, typer.Option("--report/--no-report", help="Write report.html, or leave it out.")]
Source = Annotated[str, typer.Argument(metavar="NAME|FILE", help="A library mechanism or a TOML file.")]


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"paraflex {version('paraflex')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


@app.command()
def run(
    mechanism: MechanismOption = "raparm_i",
    path: PathOption = None,
    mode: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MODE",
            help="Actuation mode: signs (+-+-) or motor names (tau1,tau5); repeatable. Default: the study's.",
        ),
    ] = None,
    tol: Annotated[float | None, typer.Option(metavar="METRES", help="Tolerance of the integration.")] = None,
    duration: DurationOption = None,
    samples: SamplesOption = None,
    assembly: AssemblyOption = None,
    alpha: Annotated[float | None, typer.Option(metavar="1/S", help="Baumgarte coefficient alpha.")] = None,
    beta: Annotated[float | None, typer.Option(metavar="1/S", help="Baumgarte coefficient beta.")] = None,
    max_steps: Annotated[int | None, typer.Option(metavar="N", help="Steps before a run is given up.")] = None,
    method: MethodOption = None,
    method_parameter: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="A parameter of the method; repeatable.")
    ] = None,
    step: Annotated[
        float | None, typer.Option(metavar="S", help="A fixed step. Default: steps are chosen by their errors.")
    ] = None,
    constraints: Annotated[
        str | None,
        typer.Option(metavar="baumgarte|projection|ggl", help="What keeps the constraints. Default: the method's."),
    ] = None,
    automatic_gains: Annotated[
        bool, typer.Option("--automatic-gains", help="Baumgarte coefficients that follow the step.")
    ] = False,
    stop_at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EVENT",
            help="Where the run ends: joint:NAME=LOW..HIGH, deflection:BODY=METRES, singular=DISTANCE, "
            "singular:MOTOR,...=DISTANCE; repeatable.",
        ),
    ] = None,
    rigid: Annotated[bool, typer.Option("--rigid", help="Take all bodies as rigid.")] = False,
    geometry: Annotated[
        str | None, typer.Option(metavar="linear|second-order", help="Shape of the beams. Default: the model's.")
    ] = None,
    segments: Annotated[
        int | None,
        typer.Option(metavar="N", help="Cut beams into finite segments, so many the longest (the paper's: 8)."),
    ] = None,
    ked: Annotated[
        bool, typer.Option("--ked", help="Kineto-elastodynamics: active motors held on the rigid motion.")
    ] = False,
    balanced: Annotated[
        bool, typer.Option("--balanced", help="Start from static equilibrium, active motors held; else undeformed.")
    ] = False,
    out: Annotated[str, typer.Option(metavar="DIR", help="Folder for results and figures.")] = "results",
    report: ReportOption = True,
    json: Json = False,
) -> None:
    """Simulate a path in several actuation modes, or a model without a path on its own.

    Writes report.html, summary.json, results.nc and figures/.
    """
    from paraflex.cli.integration import IntegrationRequest
    from paraflex.cli.run import RunRequest, run_command

    integration = IntegrationRequest(
        tolerance=tol,
        alpha=alpha,
        beta=beta,
        max_steps=max_steps,
        method=method,
        parameters=method_parameter or [],
        step=step,
        constraints=constraints,
        automatic_gains=automatic_gains,
        stop_at=stop_at or [],
    )
    request = RunRequest(
        mechanism=mechanism,
        path=path,
        modes=mode or [],
        duration=duration,
        samples=samples,
        assembly=assembly,
        out=out,
        json=json,
        integration=integration,
        rigid=rigid,
        geometry=geometry,
        segments=segments,
        ked=ked,
        balanced=balanced,
        report=report,
    )
    raise typer.Exit(run_command(request))


@app.command()
def verify(
    mechanism: MechanismOption = "raparm_i",
    path: PathOption = None,
    mode: Annotated[
        list[str] | None,
        typer.Option(metavar="MODE", help="Actuation mode; repeatable. Default: the study's with most motors."),
    ] = None,
    engine: Annotated[
        list[str] | None, typer.Option(metavar="exudyn|mujoco", help="Another engine to compare with; repeatable.")
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Fidelity: rigid, ked, linear, second-order, segments; repeatable. Default: all of them.",
        ),
    ] = None,
    tol: Annotated[float | None, typer.Option(metavar="METRES", help="Tolerance of runs with error control.")] = None,
    method: MethodOption = None,
    segments: Annotated[int | None, typer.Option(metavar="N", help="Finite segments on the longest beam.")] = None,
    duration: DurationOption = None,
    samples: SamplesOption = None,
    assembly: AssemblyOption = None,
    out: Annotated[str, typer.Option(metavar="DIR", help="Folder for numbers and figures.")] = "verification",
    report: ReportOption = True,
    json: Json = False,
) -> None:
    """Run a mechanism at every fidelity and in other engines.

    Writes report.html, verify.json, verify.nc and figures/.
    """
    from paraflex.cli.verify import VerifyRequest, verify_command

    request = VerifyRequest(
        mechanism=mechanism,
        path=path,
        modes=mode or [],
        tolerance=tol,
        duration=duration,
        samples=samples,
        assembly=assembly,
        out=out,
        json=json,
        engines=engine or [],
        fidelities=model or [],
        segments=segments,
        method=method,
        report=report,
    )
    raise typer.Exit(verify_command(request))


@app.command()
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


@app.command("compare-methods")
def compare_methods(
    mechanism: MechanismOption = "raparm_i",
    path: PathOption = None,
    mode: Annotated[
        str | None, typer.Option(metavar="MODE", help="Actuation mode. Default: the study's with most motors.")
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Method of integration; repeatable. Default: all of them.")
    ] = None,
    tol: Annotated[
        list[float] | None,
        typer.Option(metavar="METRES", help="Tolerance; repeatable. Default: 1e-3, 1e-4, 1e-5, 1e-6."),
    ] = None,
    step: Annotated[
        list[float] | None,
        typer.Option(metavar="S", help="Fixed step; repeatable. Without --tol fixed steps are all there is."),
    ] = None,
    limit: Annotated[float | None, typer.Option(metavar="S", help="Wall time of a run. Default: 60.")] = None,
    duration: DurationOption = None,
    samples: SamplesOption = None,
    assembly: AssemblyOption = None,
    out: Annotated[str, typer.Option(metavar="DIR", help="Folder for numbers and figure.")] = "comparison",
    json: Json = False,
) -> None:
    """Time every method of integration against its error; write compare-methods.json and figures/."""
    from paraflex.cli.compare import CompareRequest, compare_command

    request = CompareRequest(
        mechanism=mechanism,
        path=path,
        modes=[] if mode is None else [mode],
        duration=duration,
        samples=samples,
        assembly=assembly,
        out=out,
        json=json,
        methods=method or [],
        tolerances=tol or [],
        steps=step or [],
        limit=limit,
    )
    raise typer.Exit(compare_command(request))


@app.command()
def sensitivity(
    study: Annotated[str, typer.Argument(metavar="STUDY.toml", help="What is run, and by what it is differentiated.")],
    output: OutputOption = None,
    at: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="Where derivatives are taken; repeatable. Default: the mechanism's."),
    ] = None,
    metrics: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,...", help="What is differentiated; repeatable. Default: the study's."),
    ] = None,
    json: Json = False,
) -> None:
    """Differentiate what runs are judged by; write sensitivity.json, a table and figures/."""
    from paraflex.cli.sensitivity import SensitivityRequest, sensitivity_command

    raise typer.Exit(sensitivity_command(SensitivityRequest(study, output, at or [], metrics or [], json)))


@app.command()
def sweep(
    study: Annotated[str, typer.Argument(metavar="STUDY.toml", help="What varies, what is run, what is kept.")],
    output: OutputOption = None,
    engine: EngineOption = "threads",
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    limit: Annotated[int | None, typer.Option(metavar="N", help="Runs this time, rounded up to whole designs.")] = None,
    report: ReportOption = True,
    json: Json = False,
) -> None:
    """Run a mechanism thousands of times with other numbers; the same command goes on where it was stopped.

    Writes report.html, results.parquet and summary.json, and trajectories/ where the study says so.
    """
    from paraflex.cli.sweep import SweepRequest, sweep_command

    raise typer.Exit(
        sweep_command(SweepRequest(study, output, _engine(engine, cluster), workers, cluster, limit, report, json))
    )


@app.command()
@app.command("optimize", hidden=True)
def optimise(
    study: StudyArgument,
    output: OutputOption = None,
    engine: EngineOption = "threads",
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    json: Json = False,
) -> None:
    """Look for the design whose metrics are least; the same command goes on where it was stopped.

    Writes result.json, best.toml, results.parquet and figures/.
    """
    from paraflex.cli.optimise import optimise_command
    from paraflex.cli.search import SearchRequest

    request = SearchRequest(study, output, _engine(engine, cluster), workers, cluster, json)
    raise typer.Exit(optimise_command(request))


@app.command()
def identify(
    study: StudyArgument,
    output: OutputOption = None,
    engine: EngineOption = "threads",
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    json: Json = False,
) -> None:
    """Look for the parameters that reproduce given metrics; the same command goes on where it was stopped.

    Writes result.json, best.toml, results.parquet and figures/.
    """
    from paraflex.cli.identify import identify_command
    from paraflex.cli.search import SearchRequest

    request = SearchRequest(study, output, _engine(engine, cluster), workers, cluster, json)
    raise typer.Exit(identify_command(request))


@app.command()
def indices(
    study: StudyArgument,
    metric: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="A metric; repeatable. Default: the study's.")
    ] = None,
    samples: Annotated[
        int | None, typer.Option(metavar="N", help="Base samples, a power of two; (parameters + 2) N designs are run.")
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Of the samples. Default: the study's.")] = None,
    output: OutputOption = None,
    engine: EngineOption = "threads",
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    json: Json = False,
) -> None:
    """Tell which parameters metrics depend on: first-order and total Sobol indices over their ranges.

    Writes indices.json, indices.parquet, results.parquet and figures/.
    """
    from paraflex.cli.indices import IndicesRequest, indices_command

    chosen = _engine(engine, cluster)
    request = IndicesRequest(study, output, metric or [], samples, seed, chosen, workers, cluster, json)
    raise typer.Exit(indices_command(request))


@app.command()
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


@app.command()
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


@app.command()
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


@app.command()
def modes(source: Source = "raparm_i", path: PathOption = None, json: Json = False) -> None:
    """List the actuation modes and how well each can drive the path."""
    from paraflex.cli.modes import modes_command

    modes_command(source, path, json)


@app.command()
def methods(json: Json = False) -> None:
    """List the methods of integration, what each takes and what keeps the constraints."""
    from paraflex.cli.methods import methods_command

    methods_command(json)


@app.command()
def info(
    source: Annotated[
        str | None, typer.Argument(metavar="NAME|FILE", help="A library mechanism or a TOML file; all of the library.")
    ] = None,
    assembly: AssemblyOption = None,
    path: PathOption = None,
    at: Annotated[
        float | None, typer.Option(metavar="S", help="Frequencies where the path, or prescribed angles, lead by then.")
    ] = None,
    balanced: Annotated[
        bool, typer.Option("--balanced", help="Frequencies about static equilibrium, motors held; else undeformed.")
    ] = False,
    json: Json = False,
) -> None:
    """Describe a mechanism and say whether it is sound: loops, freedoms, motors, starts, frequencies.

    Without a name: what the library has.
    """
    from paraflex.cli.inspect import InfoRequest, info_command

    info_command(InfoRequest(source, assembly, path, at, balanced, json))


@app.command()
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the file to write, NAME.toml.")],
    template: Annotated[
        str, typer.Option("--from", metavar="NAME", help="Library mechanism to start from.")
    ] = "five_bar",
) -> None:
    """Write a commented model file to edit."""
    from paraflex.cli.create import new_command

    new_command(name, template)


@app.command()
def schema() -> None:
    """Print the JSON Schema of model files, for editors to complete and check them."""
    from paraflex.cli.create import schema_command

    schema_command()


def main() -> None:
    """Run the command line; every error that is ours becomes one line."""
    _start_quickly()
    try:
        app()
    except InputError as error:
        _complain(error)
        sys.exit(BAD_INPUT)
    except ParaflexError as error:
        _complain(error)
        sys.exit(TROUBLE)
    except KeyboardInterrupt:
        typer.echo("interrupted", err=True)
        sys.exit(INTERRUPTED)


def _engine(name: str, cluster: str | None) -> str:
    """The engine asked for; a cluster is Dask's."""
    return "dask" if cluster is not None and name == "threads" else name


def _start_quickly() -> None:
    """Settings of the process that commands start faster with; before NumPy is imported."""
    # Imports make a hundred thousand objects that stay: looking among them for garbage takes a tenth of the time.
    gc.set_threshold(100_000, 20, 100)
    # Dense matrices are small here, and threads on them wait for one another where cores are busy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _complain(error: Exception) -> None:
    typer.echo(f"error: {error}", err=True)
