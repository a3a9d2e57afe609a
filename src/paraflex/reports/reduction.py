"""Report of reduced linear models: states needed, and errors and responses beside those of the full model."""

from dataclasses import replace

import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.figures.reduction import bound_sentences
from paraflex.formatting import number
from paraflex.results.kinds import check_kind
from .kind_page import kind_page
from .page import Page


@checked_arguments()
def reduction_page(data: xr.Dataset) -> Page:
    """Return the report of reduced models, a dataset from `results.reduction_dataset`."""
    check_kind(data, "reduction")
    attrs, page = data.attrs, kind_page(data)
    of_full = f"{attrs['kept_states']} of {attrs['full_states']}"
    return replace(
        page,
        kind="reduced models",
        subtitle=f"{of_full} states, about {attrs['about']}",
        facts=[
            ("states", of_full), ("up to", f"{number(float(attrs['until']))} Hz"),
            ("damping ratio of responses", number(float(attrs["damping_ratio"]))),
            *page.facts,
        ],
        remarks=list(bound_sentences(data)),
    )  # fmt: skip
