"""`paraflex optimise`: search for the design that minimises metrics."""

from __future__ import annotations

from rich.console import Console

from paraflex.cli.commands.studies import SearchRequest
from paraflex.cli.search import search_command
from paraflex.figures.designs import column_label
from paraflex.formatting import common_unit, quantity
from paraflex.studies import load_optimisation
from paraflex.studies.optimisation.optimise import OptimisationResult


def optimise_command(request: SearchRequest) -> int:
    """Run or continue an optimisation; return the exit code."""
    return search_command(request, load_optimisation(request.study), _report, "objective")


def _report(console: Console, result: OptimisationResult) -> None:
    for name, limit in [] if result.holds_limits else result.goal["limits"]:
        unit, value = result.units[name], result.metrics[name]
        if value > limit:
            shown = common_unit(unit, (limit, value - limit))
            of, over = (quantity(one, unit, shown, digits=5, padded=False) for one in (limit, value - limit))
            console.print(f"limit exceeded: {column_label(name)} is above {of} by {over}", soft_wrap=True)
    if not result.holds_limits:
        console.print("no design satisfies all limits: this one, in best.toml, exceeds them least")
