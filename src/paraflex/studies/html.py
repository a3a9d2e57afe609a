"""HTML representation of the results of studies in notebooks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from paraflex.designs.sweep import SweepResult
from paraflex.display import facts, page, sentence, table, view
from paraflex.results import summary
from paraflex.results.findings import finding_lines, verdict_of
from paraflex.results.following import HEADLINE, SPAN_WORDS, ErrorSpan
from paraflex.results.metrics import metric_label
from paraflex.results.validity import validity_line
from paraflex.studies.agreement import Verification
from paraflex.studies.comparison import MethodComparison
from paraflex.studies.law_comparison import LawComparison, unit_shown
from paraflex.studies.optimisation.identify import IdentificationResult
from paraflex.studies.optimisation.indices import IndicesResult
from paraflex.studies.optimisation.optimise import OptimisationResult
from paraflex.studies.optimisation.result import SearchResult
from paraflex.studies.sensitivities.study import Sensitivities
from paraflex.studies.tracking import StudyResult

# Largest number of rows shown of a table that could be long.
_MOST_LISTED = 60


@view.register(StudyResult)
def study_html(result: StudyResult) -> str:
    """Return status, errors and torques of every mode, counts of the solver, and reasons of failures as HTML."""
    if result.data is None:
        reasons = [sentence(f"{mode}: {reason}") for mode, reason in result.failed.items()]
        return page("study: no mode ran", *reasons)
    found = summary(result.data, result.failed)
    motors = [str(name) for name in result.data["motor"].values]
    unit = result.data["torque"].attrs.get("units", "N m")
    span = ErrorSpan(found["error"])
    rows, why = [], []
    for name, mode in found["modes"].items():
        if "message" in mode:
            why.append(sentence(f"{name}: {mode['message']}"))
        if "steps" not in mode:
            rows.append((name, mode["status"], *[""] * (len(motors) + 7)))
            continue
        rows.append((
            name, mode["status"], _millimetres(mode[HEADLINE[span]]), _millimetres(mode["tracking_rms_after"]),
            _millimetres(mode["drift_speed"]), _millimetres(mode["residual_vibration"]),
            *(mode["peak_torque"][motor] for motor in motors),
            mode["steps"], mode["newton_iterations"], mode["wall_time"],
        ))  # fmt: skip
    peaks = [f"peak {motor} [{unit}]" for motor in motors]
    heads = ("mode", "status", f"RMS tracking error {SPAN_WORDS[span]} [mm]", "after the motion [mm]", "drift [mm/s]",
             "residual vibration [mm]", *peaks, "steps", "Newton iterations", "wall time [s]")  # fmt: skip
    title = f"{found['mechanism']}, {len(rows)} mode{'' if len(rows) == 1 else 's'}"
    title += ", interrupted" if result.interrupted else ""
    holds = validity_line({name: mode.get("validity") for name, mode in found["modes"].items()})
    why += [sentence(holds)] if holds else []
    return page(title, *map(sentence, finding_lines(verdict_of(result.data))), table(heads, rows), *why)


@view.register(SweepResult)
def sweep_html(result: SweepResult) -> str:
    """Return the number of runs by status and the path of the table as HTML."""
    rate = f"{result.fresh} runs in {result.seconds:.3g} s" if result.fresh else None
    known = [
        ("runs", f"{result.done} of {result.total}"),
        *sorted(result.counts.items()),
        ("in this session", rate),
        ("table", str(result.table)),
    ]
    return page(f"sweep: {_state(result.complete, result.interrupted)}", facts(known))


@view.register(OptimisationResult)
def optimisation_html(result: OptimisationResult) -> str:
    """Return the best design and the start, with parameters, objective and metrics, as HTML."""
    numbers = [(name, result.start[name], value, result.bounds.get(name, "")) for name, value in result.values.items()]
    metrics = [("objective", result.start_objective, result.objective, "")]
    metrics += [(name, result.start_metrics.get(name), value, "") for name, value in result.metrics.items()]
    limits = "" if result.holds_limits or not result.values else "no design holds all limits"
    return page(
        f"optimisation: {result.stopped}",
        sentence(limits),
        table(("parameter", "start", "best", "at its bound"), numbers),
        table(("", "start", "best", ""), metrics if result.values else ()),
        facts(_search_facts(result)),
    )


@view.register(IdentificationResult)
def identification_html(result: IdentificationResult) -> str:
    """Return the identified parameters, their deviations, and the value of every target as HTML."""
    found = result.confidence
    deviations: Mapping[str, float | None] = {} if found is None else found.deviations
    reasons: Mapping[str, str] = {} if found is None else found.reasons
    numbers = [
        (
            name,
            result.start[name],
            value,
            _value_or_reason(deviations.get(name), reasons.get(name, result.stopped)),
            result.bounds.get(name, ""),
        )
        for name, value in result.values.items()
    ]
    targets = [
        (each.target.column, each.target.path, each.target.mode, each.target.value, each.start, each.reached)
        for each in result.targets
    ]
    residuals = [("RMS residual", result.residual), ("at the start", result.start_residual)]
    return page(
        f"identification: {result.stopped}",
        table(("parameter", "start", "found", "deviation", "at its bound"), numbers),
        table(("target", "path", "mode", "value", "start", "reached"), targets),
        facts([*residuals, ("derivatives", result.derivatives), *_search_facts(result)]),
    )


@view.register(IndicesResult)
def indices_html(result: IndicesResult) -> str:
    """Return first-order and total indices, one row per metric, path, mode and parameter, as HTML."""
    names = ("metric", "path", "mode", "parameter", "first", "first_confidence", "total", "total_confidence")
    rows = [tuple(row[name] for name in names) for row in result.to_dict()["indices"]]
    heads = ("metric", "path", "mode", "parameter", "first order", "±", "total", "±")
    shown = table(heads, rows[:_MOST_LISTED], "with half the widths of the intervals of 95 %")
    return page(f"Sobol indices: {_state(result.sweep.complete, result.sweep.interrupted)}", shown, _more(len(rows)))


@view.register(Sensitivities)
def sensitivities_html(found: Sensitivities) -> str:
    """Return the elasticities of every metric by every parameter, one row per metric, path and mode, as HTML."""
    relative = found.relative
    rows = [
        (metric, path, mode, float(found.values[i, j]), unit, *(float(x) for x in relative[i, j]))
        for i, (path, mode) in enumerate(found.rows)
        for j, (metric, unit) in enumerate(zip(found.metrics, found.units, strict=True))
    ]
    heads = ("metric", "path", "mode", "value", "unit", *(f"by {name}" for name in found.parameters))
    caption = "change of metrics by that of parameters [% / %]"
    return page(f"{found.name}: sensitivities of {found.mechanism}", table(heads, rows[:_MOST_LISTED], caption),
                _more(len(rows)))  # fmt: skip


@view.register(Verification)
def verification_html(verification: Verification) -> str:
    """Return tracking error, distance from the reference and wall time of every model in every mode as HTML."""
    found = verification.to_dict()
    rows = [
        (mode, name, run["status"], _millimetres(run.get("tracking_error")), _millimetres(run.get("distance_max")),
         run.get("steps"), run.get("wall_time"))
        for mode, each in found["modes"].items() for name, run in each["models"].items()
    ]  # fmt: skip
    heads = ("mode", "model", "status", "RMS tracking error [mm]", f"largest distance from {found['reference']} [mm]",
             "steps", "wall time [s]")  # fmt: skip
    why = [
        sentence(f"{mode}, {name}: {run['message']}")
        for mode, each in found["modes"].items()
        for name, run in each["models"].items()
        if run["message"]
    ]
    state = _state(verification.complete, verification.interrupted)
    return page(f"{found['mechanism']}, models compared: {state}", table(heads, rows), *why)


@view.register(MethodComparison)
def comparison_html(comparison: MethodComparison) -> str:
    """Return error, wall time and number of steps of every run of every method as HTML."""
    found = comparison.to_dict()
    rows = [
        (method["title"], run["tolerance"], run["step"], run["status"], run["error"], run["wall_time"], run["steps"])
        for method in found["methods"].values()
        for run in method["runs"]
    ]
    heads = ("method", "tolerance [m]", "step [s]", "status", "error [m]", "wall time [s]", "steps")
    reference = comparison.reference
    title = None if reference is None else f"{reference.method}, {reference.tolerance:g} m"
    return page(
        f"{comparison.mechanism}, {comparison.case}: methods compared",
        facts([("reference", title), ("its uncertainty [m]", None if reference is None else reference.uncertainty)]),
        table(heads, rows[:_MOST_LISTED]),
        _more(len(rows)),
    )


@view.register(LawComparison)
def laws_html(comparison: LawComparison) -> str:
    """Return the status and the metrics of every control law in every mode as HTML."""
    found, data = comparison.to_dict(), comparison.dataset
    units = {name: unit_shown(data, name) for name in comparison.metrics}
    cells = [(law, mode, cell) for law, one in found["laws"].items() for mode, cell in one["modes"].items()]
    rows = [
        (mode, law, cell["status"], *(cell[name] if cell[name] is None else unit.factor * cell[name]
                                      for name, unit in units.items()))
        for law, mode, cell in sorted(cells, key=lambda each: comparison.modes.index(each[1]))
    ]  # fmt: skip
    heads = [metric_label(name) + (f" [{unit.name}]" if unit.name else "") for name, unit in units.items()]
    why = [sentence(f"{law} in {mode}: {cell['reason']}") for law, mode, cell in cells if "reason" in cell]
    state = _state(comparison.complete, comparison.interrupted)
    return page(f"{found['mechanism']}, control laws compared: {state}", table(("mode", "law", "status", *heads), rows),
                *why)  # fmt: skip


def _search_facts(result: SearchResult) -> list[tuple[str, Any]]:
    return [
        ("designs", f"{result.evaluations}, {result.failed} of them not running"),
        ("one that does not run", result.reasons[0] if result.reasons else None),
        ("in this session", f"{result.fresh} designs in {result.seconds:.3g} s" if result.fresh else None),
        ("table", str(result.table)),
        ("folder", str(result.folder)),
    ]


def _state(finished: bool, interrupted: bool) -> str:
    return "interrupted" if interrupted else "finished" if finished else "not finished"


def _value_or_reason(deviation: float | None, reason: str) -> float | str:
    return f"not given: {reason}" if deviation is None else deviation


def _millimetres(metres: float | None) -> float | None:
    return None if metres is None else 1e3 * metres


def _more(rows: int) -> str:
    return sentence(f"and {rows - _MOST_LISTED} more rows") if rows > _MOST_LISTED else ""
