"""`paraflex identify`: identification of the parameters that reproduce given metrics."""

from __future__ import annotations

from rich.console import Console

from paraflex.cli.commands.studies import SearchRequest
from paraflex.cli.search import search_command
from paraflex.formatting import number
from paraflex.studies import load_identification
from paraflex.studies.optimisation.identify import IdentificationResult


def identify_command(request: SearchRequest) -> int:
    """Run or continue an identification; return the exit code."""
    return search_command(request, load_identification(request.study), _report, "residual")


def _report(console: Console, result: IdentificationResult) -> None:
    found = result.confidence
    now, start = number(result.residual), number(result.start_residual)
    console.print(f"root mean square residual {now}, {start} at the start")
    console.print(f"derivatives: {result.derivatives or 'none were needed'}", soft_wrap=True)
    if found is None:
        console.print(f"deviations not given: {result.stopped} before derivatives there were known", soft_wrap=True)
        return
    for reason in dict.fromkeys(found.reasons.values()):
        names = ", ".join(name for name, why in found.reasons.items() if why == reason)
        console.print(f"deviations not given of {names}: {reason}", soft_wrap=True)
    if found.identifiable:
        console.print(f"condition of the Jacobian {number(found.condition, 3)}, degrees of freedom {found.freedom}")
    else:
        described = ", ".join(f"{share:+.2f} {name}" for name, share in found.weakest.items())
        console.print(
            f"the targets cannot distinguish the parameters (condition {number(found.condition, 3)}): they hardly "
            f"change along {described}, as fractions of the ranges"
        )
