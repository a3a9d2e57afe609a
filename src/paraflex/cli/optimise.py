"""`paraflex optimise`: the design whose metrics are least."""

from __future__ import annotations

from rich.console import Console

from paraflex.cli.commands.studies import SearchRequest
from paraflex.cli.search import parameter_table, search_command
from paraflex.cli.tables import plain_table
from paraflex.studies import OptimisationResult, load_optimisation


def optimise_command(request: SearchRequest) -> int:
    """Do what is left of an optimisation; the exit code."""
    return search_command(request, load_optimisation(request.study), _report, "objective")


def _report(console: Console, result: OptimisationResult) -> None:
    console.print(parameter_table(result))
    values = [("objective", result.start_objective, result.objective)]
    values += [(name, result.start_metrics[name], value) for name, value in result.metrics.items()]
    rows = ([name, f"{start:.6g}", f"{best:.6g}"] for name, start, best in values)
    console.print(plain_table("", numbers=("start", "best"), rows=rows))
    if not result.holds_limits:
        console.print("no design holds all limits; this one passes them least")
