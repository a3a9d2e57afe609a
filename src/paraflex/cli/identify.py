"""`paraflex identify`: the parameters that reproduce given metrics."""

from __future__ import annotations

from paraflex.cli.search import SearchRequest, parameter_table, plain_table, search_command
from paraflex.cli.tables import plain_console
from paraflex.studies import IdentificationResult, identify, load_identification


def identify_command(request: SearchRequest) -> int:
    """Do what is left of an identification; the exit code."""
    return search_command(request, load_identification(request.study), identify, _report, "residual")


def _report(result: IdentificationResult) -> None:
    console = plain_console()
    found = result.confidence
    deviations = {} if found is None else found.deviations
    told = {name: "" if value is None else f"{value:.2g}" for name, value in deviations.items()}
    console.print(parameter_table(result, deviation=told))
    table = plain_table()
    for heading in ("mode", "path", "metric"):
        table.add_column(heading, no_wrap=True)
    for heading in ("target", "start", "reached", "residual"):
        table.add_column(heading, justify="right", no_wrap=True)
    for each in result.targets:
        target = each.target
        numbers = [f"{value:.5g}" for value in (target.value, each.start, each.reached)]
        table.add_row(target.mode, target.path, target.column, *numbers, f"{each.residual:+.3g}")
    console.print(table)
    console.print(f"root mean square residual {result.residual:.4g}, {result.start_residual:.4g} at the start")
    if found is not None and found.telling:
        console.print(f"condition of the Jacobian {found.condition:.3g}")
    elif found is not None:
        told = ", ".join(f"{share:+.2f} {name}" for name, share in found.weakest.items())
        console.print(
            f"the targets cannot tell the parameters apart (condition {found.condition:.3g}): they hardly change along "
            f"{told}, in shares of the ranges"
        )
