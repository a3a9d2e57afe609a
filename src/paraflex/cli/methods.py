"""`paraflex methods`: list of the integration methods and their parameters."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

from rich.table import Table

from paraflex.formatting import number
from paraflex.integrators import DEFAULT_METHOD, METHODS, Method
from .commands.models import MethodsRequest
from .tables import PlainConsole, plain_table


def methods_command(request: MethodsRequest) -> None:
    """Print the integration methods and their parameters, as tables or JSON."""
    if request.json:
        print(json.dumps([_figures(method) for method in METHODS.values()], indent=2))
        return
    out = PlainConsole()
    heads = ("name", "title", "form", "order", "steps", "constraints")
    out.print(_table("methods of integration", heads, ("title", "form"), map(_row, METHODS.values())))
    parameters = (
        [method.name, name, number(one.default, 6), f"{number(one.low)} to {number(one.high)}", one.meaning]
        for method in METHODS.values()
        for name, one in method.parameters.items()
    )
    heads = ("method", "parameter", "default", "range", "meaning")
    out.print(_table("their parameters", heads, heads[2:], parameters))
    out.print(f"The default is {DEFAULT_METHOD}; of the treatments of constraints, the first.")


def _table(title: str, heads: Sequence[str], wrapped: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Return a table of texts; columns may be broken if their heads are in `wrapped`."""
    table = plain_table(title)
    for head in heads:
        table.add_column(head, no_wrap=head not in wrapped)
    for row in rows:
        table.add_row(*row)
    return table


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
