"""`paraflex modes`: actuation modes of a mechanism, and how well each can drive it along a path."""

import json
from collections.abc import Iterable
from dataclasses import replace
from itertools import combinations, islice
from typing import Any

import numpy as np

from paraflex.actuation import Effort, actuation_condition
from paraflex.actuation.allocation import check_mode
from paraflex.dynamics import build_system, closure_of, driven_freedoms, mobility
from paraflex.errors import ActuationError
from paraflex.figures.modes import mode_table
from paraflex.files import Model
from paraflex.mechanism import ActuationMode, mode_of_motors, parse_mode
from paraflex.results.numbers import finite_or_none
from .commands.models import ModesRequest
from .request import find_path, requested_model
from .tables import PlainConsole, print_table

# Number of samples of the path at which modes are assessed.
_SAMPLES = 201
# Largest numbers of motor sets tried and listed for a mechanism without named modes.
_TRIED, _LISTED = 20_000, 20


def modes_command(request: ModesRequest) -> None:
    """List the actuation modes with the condition number of their actuation matrix along a path.

    For a model without named modes, list the sets of motors that could be requested.
    """
    model, path = requested_model(request.model), request.path
    effort = _effort(model, path)
    # Modes of [mode] tables, and further ones of the study.
    studied = [parse_mode(model.mechanism, name) for name in model.study.modes]
    named = list(dict.fromkeys([*model.mechanism.modes, *studied]))
    rows, more = [_row(mode, effort) for mode in named], 0
    if not named and model.mechanism.motors:
        rows, more = _possible_rows(model, effort)
    for row in rows:
        row["declared"] = bool(named)
    PlainConsole(stderr=True).print_lines(*_explain(model, path, rows, more))
    if request.json:
        print(json.dumps(rows, indent=2))
    elif rows:
        what = "actuation modes" if rows[0]["declared"] else "sets of motors"
        print_table(PlainConsole(), mode_table(f"{model.mechanism.name}: {what}", rows))


def _effort(model: Model, path: str | None) -> Effort | None:
    """Return the effort that the path requires of the motors; None without a path or an end-effector."""
    if model.mechanism.end_effector is None or not (path is not None or model.paths):
        return None
    followed, _ = find_path(model, path)
    rigid = model.mechanism.rigid()
    # The path determines the start.
    placed = replace(model, start=None)
    return placed.plan(
        followed, mechanism=rigid, duration=placed.driven_for(followed), samples=_SAMPLES, warning=False
    ).effort


def _row(mode: ActuationMode, effort: Effort | None) -> dict[str, Any]:
    row: dict[str, Any] = {"mode": mode.name, "motors": list(mode.motors)}
    if effort is None:
        return row
    row["redundancy"] = len(mode.motors) - effort.required.shape[1]
    row["condition_max"] = finite_or_none(np.max(actuation_condition(effort, mode)))
    try:
        check_mode(effort, mode)
        row["drives_path"] = True
    except ActuationError as error:
        row["drives_path"], row["reason"] = False, str(error)
    return row


def _possible_rows(model: Model, effort: Effort | None) -> tuple[list[dict[str, Any]], int]:
    """Return rows of the smallest sufficient sets of motors, the best first, and of all motors.

    The second value is the number of sufficient sets that are left out.
    """
    motors = [motor.name for motor in model.mechanism.motors]
    sets = _sets_of_pose(model) if effort is None else combinations(motors, effort.required.shape[1])
    rows = [_row(mode_of_motors(model.mechanism, chosen), effort) for chosen in islice(sets, _TRIED)]
    fit = sorted(
        (row for row in rows if row.get("drives_path", True)), key=lambda row: row.get("condition_max") or np.inf
    )
    everything = _row(mode_of_motors(model.mechanism, motors), effort)
    shown = [row for row in fit[:_LISTED] if row["mode"] != everything["mode"]]
    return [*shown, everything], max(0, len(fit) - _LISTED)


def _sets_of_pose(model: Model) -> Iterable[tuple[str, ...]]:
    """Return the smallest sets of motors that drive all degrees of freedom at the assembly's pose.

    The result is empty if the assembly does not close.
    """
    if not model.mechanism.assemblies:
        return ()
    system = build_system(model.mechanism.rigid())
    start = closure_of(system, model.mechanism.assembly(model.study.assembly)).state
    return () if start is None else driven_freedoms(system, start, mobility(system, start).freedoms).sets


def _explain(model: Model, path: str | None, rows: list[dict[str, Any]], more: int) -> list[str]:
    """Return lines that explain the table: its rows if no modes are named, and missing motors, path or end-effector."""
    mechanism = model.mechanism
    lines = []
    if not rows:
        lines.append(f"{mechanism.name} has no motors, hence no actuation modes: add [motor] with a joint for each")
    elif not rows[0]["declared"]:
        sets = "the smallest sets of motors that suffice, and all motors" if len(rows) > 1 else "all motors"
        left = f" ({more} more sets suffice)" if more else ""
        lines.append(
            f"{mechanism.name} has no [mode] tables; listed are {sets}{left}: "
            f"choose some by --mode {','.join(rows[0]['motors'])}"
        )
    if not model.paths and path is None:
        lines.append(f"{mechanism.name} has no path: add [path.NAME], or name a file by --path, to see what drives it")
    elif mechanism.end_effector is None:
        lines.append(f"{mechanism.name} has no [end_effector] to follow a path: what drives it cannot be determined")
    return lines
