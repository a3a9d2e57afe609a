"""The commands that a shell sees: each hands its request to what does the work, which is loaded only then."""

from __future__ import annotations

from typing import Annotated

from typer import Argument, Option

from paraflex.cli.commands.models import InfoRequest
from paraflex.cli.commands.options import Json, ModelChoice, PathOption
from paraflex.cli.commands.results import AnimateRequest, ExportRequest, PlotRequest
from paraflex.cli.commands.runs import CompareRequest, RunRequest, VerifyRequest
from paraflex.cli.commands.studies import IndicesRequest, SearchRequest, SensitivityRequest, SweepRequest


def run(request: RunRequest) -> int:
    """Simulate a path in several actuation modes, or a model without a path on its own.

    Writes report.html, summary.json, results.nc and figures/.
    """
    from paraflex.cli.run import run_command

    return run_command(request)


def verify(request: VerifyRequest) -> int:
    """Run a mechanism at every fidelity and in other engines.

    Writes report.html, verify.json, verify.nc and figures/.
    """
    from paraflex.cli.verify import verify_command

    return verify_command(request)


def compare_methods(request: CompareRequest) -> int:
    """Time every method of integration against its error; write compare-methods.json and figures/."""
    from paraflex.cli.compare import compare_command

    return compare_command(request)


def sensitivity(request: SensitivityRequest) -> int:
    """Differentiate what runs are judged by; write sensitivity.json, a table and figures/."""
    from paraflex.cli.sensitivity import sensitivity_command

    return sensitivity_command(request)


def sweep(request: SweepRequest) -> int:
    """Run a mechanism thousands of times with other numbers; the same command goes on where it was stopped.

    Writes report.html, results.parquet and summary.json, and trajectories/ where the study says so.
    """
    from paraflex.cli.sweep import sweep_command

    return sweep_command(request)


def optimise(request: SearchRequest) -> int:
    """Look for the design whose metrics are least; the same command goes on where it was stopped.

    Writes result.json, best.toml, results.parquet and figures/.
    """
    from paraflex.cli.optimise import optimise_command

    return optimise_command(request)


def identify(request: SearchRequest) -> int:
    """Look for the parameters that reproduce given metrics; the same command goes on where it was stopped.

    Writes result.json, best.toml, results.parquet and figures/.
    """
    from paraflex.cli.identify import identify_command

    return identify_command(request)


def indices(request: IndicesRequest) -> int:
    """Tell which parameters metrics depend on: first-order and total Sobol indices over their ranges.

    Writes indices.json, indices.parquet, results.parquet and figures/.
    """
    from paraflex.cli.indices import indices_command

    return indices_command(request)


def report(
    results: Annotated[
        str, Argument(metavar="RESULTS", help="A folder that run, verify, sweep or optimise wrote, or a file of it.")
    ],
    output: Annotated[
        str | None, Option("--output", metavar="FILE", help="Default: report.html beside the results.")
    ] = None,
    force: Annotated[bool, Option("--force", help="Write over a file that is there.")] = False,
) -> None:
    """Write the report of results that are there: one HTML file that needs no network."""
    from paraflex.cli.report import report_command

    report_command(results, output, force=force)


def animate(request: AnimateRequest) -> int:
    """Make a film of a run: mp4, gif, animated svg, or pictures."""
    from paraflex.cli.animate import animate_command

    return animate_command(request)


def export(request: ExportRequest) -> int:
    """Write results for other programs: tables as CSV or Parquet, a struct for MATLAB, netCDF."""
    from paraflex.cli.export import export_command

    return export_command(request)


def plot(request: PlotRequest) -> int:
    """Draw figures of any results for print: a run's, a verification's, a comparison's, a study's."""
    from paraflex.cli.plot import plot_command

    return plot_command(request)


def modes(model: ModelChoice, path: PathOption = None, json: Json = False) -> None:
    """List the actuation modes and how well each can drive the path."""
    from paraflex.cli.modes import modes_command

    modes_command(model.name, path, json)


def methods(json: Json = False) -> None:
    """List the methods of integration, what each takes and what keeps the constraints."""
    from paraflex.cli.methods import methods_command

    methods_command(json)


def info(request: InfoRequest) -> int:
    """Describe a mechanism and its study, and judge them: sound, doubtful or wrong, each reason with its remedy.

    Exit code 1 where it is wrong. Without a name: what the library has.
    """
    from paraflex.cli.inspect import info_command

    return info_command(request)


def new(
    name: Annotated[str, Argument(metavar="NAME", help="Of the file to write, NAME.toml.")],
    template: Annotated[str, Option("--from", metavar="NAME", help="Library mechanism to start from.")] = "five_bar",
) -> None:
    """Write a commented model file to edit."""
    from paraflex.cli.create import new_command

    new_command(name, template)


def schema() -> None:
    """Print the JSON Schema of model files, for editors to complete and check them."""
    from paraflex.cli.create import schema_command

    schema_command()
