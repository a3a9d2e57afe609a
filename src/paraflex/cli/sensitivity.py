"""`paraflex sensitivity`: derivatives of the metrics of runs with respect to numbers of the mechanism's file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from paraflex.cli import COMPLETE
from paraflex.cli.commands.studies import SensitivityRequest
from paraflex.cli.ending import print_results
from paraflex.cli.replacing import hold_results
from paraflex.cli.tables import number, plain_table, print_titled
from paraflex.cli.writing import write_drawn
from paraflex.designs.setting import Setting
from paraflex.designs.units import check_unit_of
from paraflex.errors import InputError
from paraflex.files.expressions import ExpressionError, evaluate
from paraflex.folders import SENSITIVITY
from paraflex.studies import Sensitivities, load_sensitivities
from paraflex.studies.sensitivities.study import FIGURES, LINES, TABLE

# Number of parameters side by side in a table of 80 columns.
_PARAMETERS_ABREAST = 4


def sensitivity_command(request: SensitivityRequest) -> int:
    """Differentiate the runs of a study; write sensitivity.json, the table and figures; return the exit code."""
    named = [name.strip() for entry in request.metrics for name in entry.split(",")]
    study = load_sensitivities(request.study, [name for name in named if name])
    folder = request.folder
    study = replace(study, at=_values(request.at, study.setting))
    with hold_results(folder, SENSITIVITY, force=request.force, field="--output") as held:
        found = study.run()
        found.save_in(held)
        summary = found.to_dict()

        def show(out: Console) -> None:
            for row in range(len(found.rows)):
                _print(out, found, row)
            out.print(f"{folder / found.values_file}, {TABLE}, {LINES} and {FIGURES}/", soft_wrap=True)

        print_results(summary, show, as_json=request.json)
        write_drawn(summary, held)
    return COMPLETE


def _values(entries: list[str], setting: Setting) -> dict[str, float]:
    """Return values by parameter in SI units; a unit must suit the fields of the parameter."""
    values = {}
    for entry in entries:
        name, _, value = (part.strip() for part in entry.partition("="))
        try:
            values[name] = evaluate(value, {})
        except ExpressionError:
            raise InputError("not NAME=VALUE", field="--at", value=entry, remedy="give --at thickness=0.006") from None
        for place in dict(zip(setting.names, setting.places, strict=True)).get(name, ()):
            check_unit_of(setting.data, place, value, "--at")
    return values


def _print(console: Console, found: Sensitivities, row: int) -> None:
    """Print elasticities and derivatives of one run, in tables of a few parameters each."""
    path, mode = found.rows[row]
    where, relative = f"{found.mechanism}, {path}, mode {mode}", found.relative
    for first in range(0, len(found.parameters), _PARAMETERS_ABREAST):
        some = slice(first, first + _PARAMETERS_ABREAST)
        for title, values, form in (
            (f"{where}: change of metrics by that of parameters [% / %]", relative, "+.2f"),
            ("Derivatives, in the units of metrics and parameters", found.derivatives, ".2e"),
        ):
            print_titled(console, title, _table(found, row, values[row, :, some], some, form))


def _table(found: Sensitivities, row: int, shown: NDArray[np.float64], some: slice, form: str) -> Table:
    table = plain_table("metric", numbers=("value",))
    for name, value in zip(found.parameters[some], found.nominal[some], strict=True):
        table.add_column(f"{name}\n{value:g}", justify="right")
    named = zip(found.metrics, found.units, found.values[row], shown, strict=True)
    for metric, unit, value, numbers in named:
        table.add_row(f"{metric} [{unit}]", _number(value, ".3e"), *(_number(x, form) for x in numbers))
    return table


def _number(value: float, form: str) -> str:
    return number(value, form) if np.isfinite(value) else ""
