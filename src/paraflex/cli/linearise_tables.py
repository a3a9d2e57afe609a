"""Tables that `paraflex linearise` prints: frequencies and damping, poles, zeros, and remarks on them."""

from __future__ import annotations

import numpy as np
import xarray as xr
from rich.console import Console

from paraflex.cli.tables import print_table
from paraflex.figures.linear import held_rows, tables
from paraflex.figures.selection import names_of
from paraflex.results.linear_summary import about, remarks, roots, zeros_of


def print_linear(out: Console, data: xr.Dataset) -> None:
    """Print linear models: frequencies and damping ratios, poles, zeros and remarks."""
    out.print(f"{data.attrs['mechanism']}, {about(data)}: {data.sizes['state']} states", soft_wrap=True)
    frequencies, *others = tables(data)
    print_table(out, frequencies)
    poles = [values for _, _, values in held_rows(data)]
    if all(one.on_axis for values in poles for one in roots(values)):
        zero = int(np.count_nonzero(poles[0] == 0.0))
        free = f"; {zero} at zero" + (" with motors free" if len(poles) > 1 else "") if zero else ""
        out.print(f"All poles are on the imaginary axis, 2 pi times these frequencies{free}")
    for table in others:
        print_table(out, table)
    zeros = [zeros_of(data, mode, name) for name in names_of(data, "map") for mode in names_of(data, "mode")]
    if any(one.right for values in (*poles, *zeros) for one in roots(values)):
        out.print("* in the right half plane")
    for sentence in remarks(data):
        out.print(sentence, soft_wrap=True)
