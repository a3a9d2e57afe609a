"""`paraflex methods`: the methods of integration and what each takes."""

from __future__ import annotations

import json
from typing import Any

from rich import box
from rich.table import Table

from paraflex.cli.tables import plain_console
from paraflex.integrators import DEFAULT_METHOD, METHODS, Method


def methods_command(as_json: bool) -> None:
    """List the methods by name."""
    if as_json:
        print(json.dumps([_figures(method) for method in METHODS.values()], indent=2))
        return
    out = plain_console()
    out.print(_methods_table())
    out.print(_parameters_table())
    out.print(f"The default is {DEFAULT_METHOD}; of what keeps the constraints, the first.")


def _methods_table() -> Table:
    table = _table("methods of integration", ("name", "title", "form", "order", "steps", "constraints"))
    for method in METHODS.values():
        steps = {"by error": method.error_control, "fixed": method.fixed_step}
        table.add_row(
            method.name,
            method.title,
            method.form.replace(" (", "\n("),
            str(method.order),
            "\n".join(how for how, possible in steps.items() if possible),
            "\n".join(treatment.value for treatment in method.treatments),
        )
    return table


def _parameters_table() -> Table:
    table = _table("their parameters", ("method", "parameter", "default", "range", "meaning"))
    for method in METHODS.values():
        for name, known in method.parameters.items():
            bounds = f"{known.low:.4g} to {known.high:.4g}"
            table.add_row(method.name, name, f"{known.default:g}", bounds, known.meaning)
    return table


def _table(title: str, headings: tuple[str, ...]) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE, pad_edge=False, collapse_padding=True)
    for heading in headings:
        table.add_column(heading, no_wrap=heading in ("name", "method", "parameter", "constraints"))
    return table


def _figures(method: Method) -> dict[str, Any]:
    return {
        "name": method.name,
        "title": method.title,
        "default": method.name == DEFAULT_METHOD,
        "form": method.form,
        "order": method.order,
        "fixed_step": method.fixed_step,
        "error_control": method.error_control,
        "explicit": method.explicit,
        "parameters": {
            name: {"default": known.default, "low": known.low, "high": known.high, "meaning": known.meaning}
            for name, known in method.parameters.items()
        },
        "constraints": [treatment.value for treatment in method.treatments],
        "source": method.source,
    }
