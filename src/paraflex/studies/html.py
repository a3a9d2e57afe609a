"""HTML representation of the results of studies in notebooks."""

from paraflex.designs.sweep import SweepResult
from paraflex.display import described, facts, page, sentence
from paraflex.figures import search, sensitivity
from paraflex.figures.laws import law_table
from paraflex.figures.methods import tables
from paraflex.figures.search import IDENTIFICATION
from paraflex.figures.tracking import Runs, after_table, result_table
from paraflex.figures.verification import model_table, path_extent
from paraflex.formatting import number, quantity
from paraflex.late import view
from paraflex.results import summary
from paraflex.results.findings import finding_lines, validity_line, verdict_of
from .agreement import Verification
from .comparison import MethodComparison
from .law_comparison import LawComparison
from .optimisation.indices import IndicesResult
from .optimisation.result import SearchResult
from .sensitivity import Sensitivities
from .tracking import StudyResult


@view.register(StudyResult)
def study_html(result: StudyResult) -> str:
    """Return status, errors and torques of every mode, counts of the solver, and reasons of failures as HTML."""
    if result.data is None:
        reasons = [sentence(f"{mode}: {reason}") for mode, reason in result.failed.items()]
        return page("study: no mode ran", *reasons)
    found = summary(result.data, result.failed)
    why = [sentence(f"{name}: {mode['message']}") for name, mode in found["modes"].items() if "message" in mode]
    rows = Runs({"": result.data}, {"": list(result.failed)})
    title = f"{found['mechanism']}, {len(rows.rows)} mode{'' if len(rows.rows) == 1 else 's'}"
    title += ", interrupted" if result.interrupted else ""
    holds = validity_line({name: mode.get("validity") for name, mode in found["modes"].items()})
    why += [sentence(holds)] if holds else []
    tables = (result_table(rows, brief=True), after_table(rows))
    return page(title, *map(sentence, finding_lines(verdict_of(result.data))), *map(described, tables), *why)


@view.register(SweepResult)
def sweep_html(result: SweepResult) -> str:
    """Return the number of runs by status and the path of the table as HTML."""
    known = [
        ("runs", f"{result.done} of {result.total}"),
        *sorted(result.counts.items()),
        ("in this session", _rate(result.fresh, "runs", result.seconds)),
        ("table", str(result.table)),
    ]
    return page(f"sweep: {_state(result.complete, result.interrupted)}", facts(known))


@view.register(SearchResult)
def search_html(result: SearchResult) -> str:
    """Return the best design and the start, with parameters, and metrics or targets, as HTML."""
    found = result.to_dict()
    ended = [] if found["kind"] == IDENTIFICATION else [("objective", found["objective"])]
    if found["kind"] == IDENTIFICATION:
        ended = [("RMS residual", found["residual"]), ("at the start", found["start_residual"]),
                 ("derivatives", found["derivatives"])]  # fmt: skip
    return page(
        f"{result.kind}: {result.stopped}",
        *(described(table) for table in search.tables(found, result.units)),
        facts(
            [
                *ended,
                ("designs", f"{result.evaluations}, {result.failed} of them not running"),
                ("one that does not run", result.reasons[0] if result.reasons else None),
                ("in this session", _rate(result.fresh, "designs", result.seconds)),
                ("table", str(result.table)),
                ("folder", str(result.folder)),
            ]
        ),
    )


@view.register(IndicesResult)
def indices_html(result: IndicesResult) -> str:
    """Return first-order and total indices, one row per metric, path, mode and parameter, as HTML."""
    state = _state(result.sweep.complete, result.sweep.interrupted)
    return page(f"Sobol indices: {state}", described(search.index_table(result.to_dict())))


@view.register(Sensitivities)
def sensitivities_html(found: Sensitivities) -> str:
    """Return the elasticities of every metric by every parameter, a table for each path and mode, as HTML."""
    numbers = found.to_dict()
    shown = [next(sensitivity.tables(numbers, run)) for run in range(len(found.rows))]
    return page(f"{found.name}: sensitivities of {found.mechanism}", *map(described, shown))


@view.register(Verification)
def verification_html(verification: Verification) -> str:
    """Return tracking error, distance from the reference and wall time of every model in every mode as HTML."""
    found = verification.to_dict()
    why = [
        sentence(f"{mode}, {name}: {run['message']}")
        for mode, each in found["modes"].items()
        for name, run in each["models"].items()
        if run["message"]
    ]
    state = _state(verification.complete, verification.interrupted)
    tables = [described(model_table(found, mode, path_extent(verification.data))) for mode in found["modes"]]
    return page(f"{found['mechanism']}, models compared: {state}", *tables, *why)


@view.register(MethodComparison)
def comparison_html(comparison: MethodComparison) -> str:
    """Return error, wall time and number of steps of every run of every method as HTML."""
    found, reference = comparison.to_dict(), comparison.reference
    known = [] if reference is None else [
        ("reference", f"{reference.method}, {number(reference.tolerance)} m"),
        ("its uncertainty", quantity(reference.uncertainty, "m")),
    ]  # fmt: skip
    return page(f"{comparison.mechanism}, {comparison.case}: methods compared", facts(known),
                *map(described, tables(found)))  # fmt: skip


@view.register(LawComparison)
def laws_html(comparison: LawComparison) -> str:
    """Return the status and the metrics of every control law in every mode as HTML."""
    found = comparison.to_dict()
    why = [sentence(f"{law} in {mode}: {cell['reason']}") for law, one in found["laws"].items()
           for mode, cell in one["modes"].items() if "reason" in cell]  # fmt: skip
    state = _state(comparison.complete, comparison.interrupted)
    return page(f"{found['mechanism']}, control laws compared: {state}", described(law_table(comparison.data)), *why)


def _rate(fresh: int, what: str, seconds: float) -> str | None:
    return f"{fresh} {what} in {quantity(seconds, 's', padded=False)}" if fresh else None


def _state(finished: bool, interrupted: bool) -> str:
    return "interrupted" if interrupted else "finished" if finished else "not finished"
