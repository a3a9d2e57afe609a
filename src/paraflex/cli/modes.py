"""`paraflex modes`: what the actuation modes of a mechanism can do along a path."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from rich.table import Table

from paraflex.actuation import actuation_condition
from paraflex.actuation.allocation import check_mode
from paraflex.cli.tables import plain_console
from paraflex.errors import ActuationError
from paraflex.files import load
from paraflex.simulate import plan_tracking


def modes_command(source: str, path: str | None, as_json: bool) -> None:
    """List the actuation modes with the condition of their actuation matrix along a path."""
    model = load(source)
    rows = []
    effort = None
    if model.mechanism.end_effector is not None and (path is not None or model.paths):
        effort = plan_tracking(
            model.mechanism.rigid(), model.path(path), samples=201, orientation=model.study.orientation, warning=False
        ).effort
    for mode in model.mechanism.modes:
        row: dict[str, Any] = {"mode": mode.name, "motors": list(mode.motors)}
        if effort is not None:
            row["redundancy"] = len(mode.motors) - effort.required.shape[1]
            row["condition_max"] = float(np.max(actuation_condition(effort, mode)))
            try:
                check_mode(effort, mode)
                row["drives_path"] = True
            except ActuationError as error:
                row["drives_path"], row["reason"] = False, str(error)
        rows.append(row)
    if as_json:
        print(json.dumps(rows, indent=2))
        return
    table = Table(title=f"{model.mechanism.name}: actuation modes", title_justify="left")
    for heading in ("mode", "active motors", "redundancy", "worst condition number", "drives the path"):
        table.add_column(heading)
    for row in rows:
        drives = {True: "yes", False: row.get("reason", "no"), None: ""}[row.get("drives_path")]
        condition = f"{row['condition_max']:.3g}" if "condition_max" in row else ""
        table.add_row(row["mode"], ", ".join(row["motors"]), str(row.get("redundancy", "")), condition, drives)
    plain_console().print(table)
