"""`paraflex optimise`: search for the design that minimises metrics."""

from __future__ import annotations

from functools import partial

from rich.console import Console

from paraflex.cli.commands.studies import SearchRequest
from paraflex.cli.search import parameter_table, search_command
from paraflex.cli.tables import plain_table
from paraflex.results.metrics import Members, metric_unit
from paraflex.studies import OptimisationResult, load_optimisation
from paraflex.units import printed_unit


def optimise_command(request: SearchRequest) -> int:
    """Run or continue an optimisation; return the exit code."""
    study = load_optimisation(request.study)
    return search_command(request, study, partial(_report, study.base.members), "objective")


def _report(members: Members, console: Console, result: OptimisationResult) -> None:
    console.print(parameter_table(result))
    rows = [["objective", "", *(f"{value:.6g}" for value in (result.start_objective, result.objective))]]
    for name, value in result.metrics.items():
        unit = printed_unit(metric_unit(name, members))
        rows.append([name, unit.name, *(f"{unit.factor * one:.6g}" for one in (result.start_metrics[name], value))])
    console.print(plain_table("", "unit", numbers=("start", "best"), rows=rows))
    for name, limit in [] if result.holds_limits else result.goal["limits"]:
        unit, value = printed_unit(metric_unit(name, members)), result.metrics[name]
        if value > limit:
            of, over = (f"{unit.factor * one:.6g} {unit.name}".rstrip() for one in (limit, value - limit))
            console.print(f"limit exceeded: {name} is above {of} by {over}", soft_wrap=True)
    if not result.holds_limits:
        console.print("no design satisfies all limits: this one, in best.toml, exceeds them least")
