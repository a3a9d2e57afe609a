"""Tables that `paraflex reduce` prints: states needed, frequencies and errors of reduced models."""

from __future__ import annotations

import xarray as xr
from rich.console import Console

from paraflex.cli.tables import print_table
from paraflex.figures.reduction import bound_sentences, tables


def print_reduction(out: Console, data: xr.Dataset) -> None:
    """Print reduced models: states needed, errors, frequencies, errors along the path, and error bounds."""
    attrs = data.attrs
    out.print(
        f"{attrs['mechanism']}, about {attrs['about']}: {attrs['kept_states']} of {attrs['full_states']} states",
        soft_wrap=True,
    )
    for table in tables(data):
        print_table(out, table)
    for sentence in bound_sentences(data):
        out.print(sentence, soft_wrap=True)
