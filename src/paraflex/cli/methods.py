"""`paraflex methods`: the methods of integration and what each takes."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from rich import box
from rich.table import Table

from paraflex.cli.commands.models import MethodsRequest
from paraflex.cli.tables import plain_console
from paraflex.integrators import DEFAULT_METHOD, METHODS, Method


def methods_command(request: MethodsRequest) -> None:
    """List the methods by name."""
    if request.json:
        print(json.dumps([_figures(method) for method in METHODS.values()], indent=2))
        return
    out = plain_console()
    out.print(_table("methods of integration", ("name", "title", "form", "order", "steps", "constraints"),
                     map(_row, METHODS.values())))  # fmt: skip
    parameters = (
        [method.name, name, f"{one.default:g}", f"{one.low:.4g} to {one.high:.4g}", one.meaning]
        for method in METHODS.values()
        for name, one in method.parameters.items()
    )
    out.print(_table("their parameters", ("method", "parameter", "default", "range", "meaning"), parameters))
    out.print(f"The default is {DEFAULT_METHOD}; of what keeps the constraints, the first.")


def _row(method: Method) -> list[str]:
    steps = {"by error": method.error_control, "fixed": method.fixed_step}
    return [
        method.name,
        method.title,
        method.form.replace(" (", "\n("),
        str(method.order),
        "\n".join(how for how, possible in steps.items() if possible),
        "\n".join(treatment.value for treatment in method.treatments),
    ]


def _table(title: str, headings: tuple[str, ...], rows: Iterable[list[str]]) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE, pad_edge=False, collapse_padding=True)
    for heading in headings:
        table.add_column(heading, no_wrap=heading in ("name", "method", "parameter", "constraints"))
    for row in rows:
        table.add_row(*row)
    return table


def _figures(method: Method) -> dict[str, Any]:
    plain = ("form", "order", "fixed_step", "error_control", "explicit")
    return (
        {"name": method.name, "title": method.title, "default": method.name == DEFAULT_METHOD}
        | {name: getattr(method, name) for name in plain}
        | {
            "parameters": {name: asdict(one) for name, one in method.parameters.items()},
            "constraints": [treatment.value for treatment in method.treatments],
            "source": method.source,
        }
    )
