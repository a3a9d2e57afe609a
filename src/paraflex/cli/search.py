"""`paraflex optimise` and `paraflex identify`: searches for designs, continued when called again."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from paraflex.campaign import Progress
from paraflex.compilation import compile_kernels_for
from paraflex.figures.designs import column_label
from paraflex.figures.search import tables
from paraflex.formatting import common_unit, number, quantity
from paraflex.studies import load_identification, load_optimisation
from paraflex.studies.optimisation.identify import IdentificationResult
from paraflex.studies.optimisation.optimise import OptimisationResult
from paraflex.studies.optimisation.study import DesignStudy
from . import signals
from .bars import bars
from .commands.studies import SearchRequest
from .ending import exit_code, print_results
from .tables import PlainConsole, in_units_of, print_table

R = TypeVar("R", OptimisationResult, IdentificationResult)


def optimise_command(request: SearchRequest) -> int:
    """Run or continue an optimisation; return the exit code."""
    return _search(request, load_optimisation(request.study), _report_optimum, "objective")


def identify_command(request: SearchRequest) -> int:
    """Run or continue an identification; return the exit code."""
    return _search(request, load_identification(request.study), _report_fit, "residual")


def _search(request: SearchRequest, study: DesignStudy[R], report: Callable[[PlainConsole, R], None], what: str) -> int:
    """Run or continue a search, print its result and write its figures; return the exit code."""
    console = PlainConsole(stderr=True)
    compile_kernels_for(in_units_of(study.base).model().mechanism, console.print)
    result = _with_bar(console, study, request, what)
    if result.interrupted and not result.values:
        console.print("interrupted before the first design was done")
        return signals.exit_code()
    numbers = result.to_dict()
    verdict = study.base.setting.verdict()

    def show(out: PlainConsole) -> None:
        for table in tables(numbers, result.units):
            print_table(out, table)
        report(out, result)
        _print_ending(console, result, request.folder)

    more = {"folder": str(result.folder), "fresh": result.fresh, "verdict": verdict.to_dict()}
    print_results(numbers | more, show, as_json=request.json, findings=verdict)
    if not result.interrupted:
        from paraflex.plots import save_figures

        save_figures(numbers, request.folder / "figures")
    return exit_code(bool(result.values), interrupted=result.interrupted)


def _with_bar(console: PlainConsole, study: DesignStudy[R], request: SearchRequest, what: str) -> R:
    with bars(console, "{task.completed} designs, at most {task.total}", "{task.fields[best]}") as progress:
        bar = progress.add_task(study.name, total=study.search.evaluations, best="")

        def show_progress(at: Progress) -> None:
            best = "" if at.best is None else f"{what} {number(at.best)}"
            progress.update(bar, completed=at.done, best=best)

        return study.run(request.folder, workers=request.workers.chosen, on_progress=show_progress)


def _print_ending(console: PlainConsole, result: OptimisationResult | IdentificationResult, folder: Path) -> None:
    out = PlainConsole()
    failed = f", {result.failed} of them failed" if result.failed else ""
    out.print(f"{result.evaluations} designs{failed}; {result.stopped}")
    for reason in result.reasons[:1]:
        console.print_lines(f"a design that failed: {reason}")
    console.print(f"{result.fresh} designs in {quantity(result.seconds, 's', padded=False)} now")
    if result.interrupted:
        console.print_lines(f"interrupted; so far: {result.table}; the same command continues from there")
    else:
        console.print_lines(f"every run: {result.table}; the best mechanism: {folder / 'best.toml'}")


def _report_optimum(console: PlainConsole, result: OptimisationResult) -> None:
    for name, limit in [] if result.holds_limits else result.goal["limits"]:
        unit, value = result.units[name], result.metrics[name]
        if value > limit:
            shown = common_unit(unit, (limit, value - limit))
            of, over = (quantity(one, unit, shown, digits=5, padded=False) for one in (limit, value - limit))
            console.print_lines(f"limit exceeded: {column_label(name)} is above {of} by {over}")
    if not result.holds_limits:
        console.print("no design satisfies all limits: this one, in best.toml, exceeds them least")


def _report_fit(console: PlainConsole, result: IdentificationResult) -> None:
    found = result.confidence
    now, start = number(result.residual), number(result.start_residual)
    console.print(f"root mean square residual {now}, {start} at the start")
    console.print_lines(f"derivatives: {result.derivatives or 'none were needed'}")
    if found is None:
        console.print_lines(f"deviations not given: {result.stopped} before derivatives there were known")
        return
    for reason in dict.fromkeys(found.reasons.values()):
        names = ", ".join(name for name, why in found.reasons.items() if why == reason)
        console.print_lines(f"deviations not given of {names}: {reason}")
    if found.identifiable:
        console.print(f"condition of the Jacobian {number(found.condition, 3)}, degrees of freedom {found.freedom}")
    else:
        described = ", ".join(f"{share:+.2f} {name}" for name, share in found.weakest.items())
        console.print(
            f"the targets cannot distinguish the parameters (condition {number(found.condition, 3)}): they hardly "
            f"change along {described}, as fractions of the ranges"
        )
