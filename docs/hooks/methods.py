"""The table of methods on the page of integrators, from the registry and from characteristic roots."""

from __future__ import annotations

from typing import Any

import numpy as np

from paraflex.integrators import METHODS, Method
from paraflex.integrators.methods import Family
from paraflex.integrators.spectra import highest_formula, spectrum

MARK = "<!-- methods -->"
COLUMNS = ("Method", "In Python", "By", "Equations", "Order", "Amplitude lost in a period", "Period too long by",
           "Radius at infinity")  # fmt: skip
# Twenty steps a period, and as good as infinity [rad].
FREQUENCIES = (2.0 * np.pi / 20.0, 1e7)
# Of methods that change their order, the one whose roots are shown.
ORDERS = {"adams": 4}
FAMILIES = {Family.ESDIRK: "ESDIRK", Family.NEWMARK: "Newmark", Family.SCIPY: "SciPy", Family.SUNDIALS: "SUNDIALS"}


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put the table where the page marks it."""
    return markdown.replace(MARK, table()) if page.file.src_uri == "integrators.md" else markdown


def table() -> str:
    """What each method integrates, its order, and what it makes of a free vibration."""
    head = f"| {' | '.join(COLUMNS)} |"
    return "\n".join([head, "|---" * len(COLUMNS) + "|", *map(_row, METHODS.values())])


def _row(method: Method) -> str:
    order = ORDERS.get(method.name, 2) if method.multistep else None
    found = spectrum(method, FREQUENCIES, order=order)
    shown = "" if order is None else f" (order {order})"
    orders = f"1 to {highest_formula(method)}" if method.multistep else str(method.order)
    parameters = ", ".join(f"{name}={value:g}" for name, value in method.values.items())
    cells = (
        f"`{method}`",
        f"`{type(method).__name__}({parameters})`",
        FAMILIES[method.family],
        method.form.split(" (")[0],
        orders,
        f"{100.0 * round(found.amplitude_decay[0], 12):.2g} %{shown}",
        f"{100.0 * found.period_error[0]:.2g} %",
        "> 1" if found.radius[1] > 1.0 + 1e-9 else f"{round(found.radius[1], 2):g}",
    )
    return f"| {' | '.join(cells)} |"
