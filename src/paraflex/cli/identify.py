"""`paraflex identify`: identification of the parameters that reproduce given metrics."""

from __future__ import annotations

from rich.console import Console

from paraflex.cli.commands.studies import SearchRequest
from paraflex.cli.search import parameter_table, search_command
from paraflex.cli.tables import plain_table
from paraflex.studies import IdentificationResult, load_identification


def identify_command(request: SearchRequest) -> int:
    """Run or continue an identification; return the exit code."""
    return search_command(request, load_identification(request.study), _report, "residual")


def _report(console: Console, result: IdentificationResult) -> None:
    found = result.confidence
    # Half-widths of 68 % confidence intervals.
    known = {} if found is None else found.deviations
    widths = {name: known.get(name) for name in result.values}
    deviations = {name: "not given" if value is None else f"{value:.2g}" for name, value in widths.items()}
    console.print(parameter_table(result, deviation=deviations))
    rows = (
        [one.target.mode, one.target.path, one.target.column,
         *(f"{value:.5g}" for value in (one.target.value, one.start, one.reached)), f"{one.residual:+.3g}"]
        for one in result.targets
    )  # fmt: skip
    heads = ("target", "start", "reached", "residual")
    console.print(plain_table("mode", "path", "metric", numbers=heads, rows=rows))
    console.print(f"root mean square residual {result.residual:.4g}, {result.start_residual:.4g} at the start")
    console.print(f"derivatives: {result.derivatives or 'none were needed'}", soft_wrap=True)
    if found is None:
        console.print(f"deviations not given: {result.stopped} before derivatives there were known", soft_wrap=True)
        return
    for reason in dict.fromkeys(found.reasons.values()):
        names = ", ".join(name for name, why in found.reasons.items() if why == reason)
        console.print(f"deviations not given of {names}: {reason}", soft_wrap=True)
    if found.identifiable:
        console.print(f"condition of the Jacobian {found.condition:.3g}, degrees of freedom {found.freedom}")
    else:
        described = ", ".join(f"{share:+.2f} {name}" for name, share in found.weakest.items())
        console.print(
            f"the targets cannot distinguish the parameters (condition {found.condition:.3g}): they hardly change "
            f"along {described}, as fractions of the ranges"
        )
