"""List of the commands that the shell sees: request, help, and the function that does the work of each.

The module of the function is imported only when the command is called.
"""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib import import_module
from typing import Any, NamedTuple

import typer

from paraflex.cli.signals import exit_code, is_taken, raised
from paraflex.errors import InputError
from . import models, results, runs, studies
from .options import ModelChoice


class ListedCommand(NamedTuple):
    """Entry of a command: name, request, "module.function" in `paraflex.cli`, and help.

    The name of a command in a group follows that of the group: "control compare".
    """

    name: str
    request: type
    function: str
    help: str

    def answer(self, request: Any) -> int | None:
        """Carry out a request; return the exit code, None for that of success."""
        module, _, function = self.function.partition(".")
        do = getattr(import_module(f"paraflex.cli.{module}"), function)
        try:
            with raised(), _outside(request), _of_model(request):
                return do(request)
        except BaseException as error:
            # An interrupted library may raise an error of its own instead.
            if not isinstance(error, KeyboardInterrupt) and not is_taken():
                raise
            if self.request in _STUDIES:
                end = "; what is done is kept, and the same command continues from there"
            elif isinstance(error, KeyboardInterrupt) and error.args:
                end = f": {error.args[0]}"
            else:
                end = "; the same command starts over"
            typer.echo(f"interrupted{end}", err=True)
            return exit_code()


def _outside(request: Any) -> AbstractContextManager[None]:
    """Return a context in which models may name files outside their folders, if the request allows it."""
    if not any(getattr(each, "allow_outside", False) for each in (request, getattr(request, "model", None))):
        return nullcontext()
    from paraflex.files import allowing_outside

    return allowing_outside()


@contextmanager
def _of_model(request: Any) -> Iterator[None]:
    """Add the file of the requested model to errors of its mechanism, which does not know it; name a default."""
    try:
        yield
        if type(model := getattr(request, "model", None)) is ModelChoice and model.given is None:
            typer.echo(f"no model is named: this is {model.name}", err=True)
    except InputError as error:
        named = None if error.source else getattr(getattr(request, "model", None), "given", None)
        raise (error.in_file(named) if named and error.field.startswith(_TABLES) else error) from error.__cause__


# Groups of commands by name, with their help.
GROUPS = {"control": "Sampled controllers of a model."}
# Tables of model files in the fields of errors found after a model was read.
_TABLES = ("body.", "load.", "linear_spring.", "spring.")
# Requests of studies that store every run, so that they can be continued.
_STUDIES = (studies.SweepRequest, studies.SearchRequest, studies.IndicesRequest)
# In the order of `paraflex --help`.
COMMANDS = (
    ListedCommand("run", runs.RunRequest, "run.run_command", """
        Simulate paths in several actuation modes, or a model without a path on its own.

        Writes report.html, summary.json, results.nc and figures/."""),
    ListedCommand("verify", runs.VerifyRequest, "verify.verify_command", """
        Run a mechanism at every fidelity and in other engines.

        Writes report.html, verify.json, verify.nc and figures/."""),
    ListedCommand("report", results.ReportRequest, "report.report_command", """
        Write the report of stored results: one HTML file that needs no network."""),
    ListedCommand("compare-methods", runs.CompareMethodsRequest, "compare_methods.compare_methods_command", """
        Time every method of integration against its error; write compare-methods.json and figures/."""),
    ListedCommand("control compare", runs.CompareLawsRequest, "control.compare_laws_command", """
        Run the controllers of a model, and the open loop, in several modes: errors, vibration, torques, energy.

        Writes laws.csv, laws.json, laws.nc and figures/. Laws that cannot run in a mode are listed with reasons."""),
    ListedCommand("sensitivity", studies.SensitivityRequest, "sensitivity.sensitivity_command", """
        Differentiate the metrics of runs; write sensitivity.json, a table and figures/."""),
    ListedCommand("sweep", studies.SweepRequest, "sweep.sweep_command", """
        Run a mechanism thousands of times with varied parameters; the same command continues an interrupted study.

        Writes report.html, results.parquet and summary.json, and trajectories/ if the study requests it."""),
    ListedCommand("optimise", studies.SearchRequest, "search.optimise_command", """
        Search for the design with the smallest metrics; the same command continues an interrupted study.

        Writes result.json, best.toml, results.parquet and figures/."""),
    ListedCommand("identify", studies.SearchRequest, "search.identify_command", """
        Search for the parameters that reproduce given metrics; the same command continues an interrupted study.

        Writes result.json, best.toml, results.parquet and figures/."""),
    ListedCommand("indices", studies.IndicesRequest, "sweep.indices_command", """
        Show which parameters metrics depend on: first-order and total Sobol indices over their ranges.

        Writes indices.json, indices.parquet, results.parquet and figures/."""),
    ListedCommand("compare", results.CompareRequest, "compare.compare_command", """
        Compare two runs: numbers, settings and motions that differ.

        With --out it writes compare.json and figures/ with the curves of both."""),
    ListedCommand("animate", results.AnimateRequest, "animate.animate_command", """
        Make a film of a run: mp4, gif, animated svg, or pictures."""),
    ListedCommand("plot", results.PlotRequest, "plot.plot_command", """
        Draw figures of any results for print: a run's, a verification's, a comparison's, a study's."""),
    ListedCommand("export", results.ExportRequest, "export.export_command", """
        Write results for other programs: tables as CSV or Parquet, a struct for MATLAB, netCDF."""),
    ListedCommand("modes", models.ModesRequest, "modes.modes_command", """
        List the actuation modes and how well each can drive the path."""),
    ListedCommand("linearise", models.LineariseRequest, "linear.linearise_command", """
        Linear models at a pose or along a motion: frequencies and damping, poles, zeros, motors held and free.

        With --out it writes linear.nc, linear.json, figures/, and report.html with the mode shapes in motion."""),
    ListedCommand("reduce", models.ReduceRequest, "linear.reduce_command", """
        Linear models of few states: how many are needed, frequencies, errors and responses beside the full model.

        With --out it writes reduced.nc, reduced.json and figures/."""),
    ListedCommand("statics", models.StaticsRequest, "statics.statics_command", """
        Equilibria under loads and travel in steps, past limit points: forces, stiffness, buckling, frequencies.

        With --out it writes statics.nc, statics.json and figures/."""),
    ListedCommand("kinematics", models.KinematicsRequest, "kinematics.kinematics_command", """
        Positions, speeds and accelerations of a driven mechanism: ranges, transmission angles, dead points, curves.

        Needs no masses. With --out it writes results.nc, summary.json, figures/ and report.html, with the motion."""),
    ListedCommand("torques", models.TorquesRequest, "kinematics.torques_command", """
        Rigid torques of a driven mechanism, with joint forces, forces on the ground and the flywheel.

        Like kinematics, with masses, loads, springs and friction."""),
    ListedCommand("methods", models.MethodsRequest, "methods.methods_command", """
        List the methods of integration, their options and their treatments of the constraints."""),
    ListedCommand("info", models.InfoRequest, "inspect.info_command", """
        Describe a mechanism and its study, and judge them: sound, doubtful or wrong, each reason with its remedy.

        Exit code 1 if it is wrong. Without a name: list of the library."""),
    ListedCommand("draw", models.DrawRequest, "draw.draw_command", """
        Draw a mechanism before anything runs: bodies, joints by kind, motors, springs, loads, path, and their names.

        Loops that do not close are drawn as given, open joints marked."""),
    ListedCommand("edit", models.EditRequest, "edit.edit_command", """
        Draw a mechanism on a page in the browser, drag it, see its numbers, run it, and save its file.

        The page is served on this machine alone, until it is closed or Ctrl-C ends it."""),
    ListedCommand("new", models.NewRequest, "create.new_command", """
        Write a commented model file to edit."""),
    ListedCommand("schema", models.SchemaRequest, "create.schema_command", """
        Print the JSON Schema of model files, for editors to complete and check them."""),
)  # fmt: skip
