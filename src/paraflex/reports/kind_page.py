"""Report of any kind of results whose charts and tables are described in `paraflex.figures`.

Reports of single kinds add to it what only they have.
"""

from importlib import import_module
from pathlib import Path

import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.figures.abscissae import offered
from paraflex.figures.catalogue import page_panels
from paraflex.figures.entry import prepared
from paraflex.figures.runs import thinned
from paraflex.folders.kinds import RESULT_KINDS
from paraflex.results.findings import finding_lines, verdict_of
from paraflex.results.kinds import kind_of
from .page import Page
from .provenance import asked, command_line, verdict_word
from .text import sections


def page_of(data: xr.Dataset, folder: Path) -> Page:
    """Return the report of a dataset of any kind, and of the summary in its folder."""
    kind = RESULT_KINDS[kind_of(data)]
    kind.refuse("page", str(folder))
    module, _, function = (kind.page or "kind_page.kind_page").partition(".")
    page = getattr(import_module(f"paraflex.reports.{module}"), function)
    return page(data, folder) if kind.with_folder else page(data)


@checked_arguments()
def kind_page(data: xr.Dataset) -> Page:
    """Return the report of results: the tables and charts of the modules that their kind names.

    A module of `paraflex.figures` may define `tables(data)`, which yields tables, and `tiles(data)`, which returns the
    main numbers as name, value, and the member that they refer to.
    """
    kind, few = kind_of(data), thinned(data)
    modules = [import_module(f"paraflex.figures.{name}") for name in RESULT_KINDS[kind].figures]
    tables = (table for module in modules if hasattr(module, "tables") for table in module.tables(data))
    return Page(
        title=str(data.attrs.get("mechanism", kind)),
        kind=kind,
        verdict=verdict_word(data) if "status" in data else "",
        facts=[("paraflex", str(data.attrs.get("paraflex_version", "")))],
        command=command_line(asked(data)),
        figures=[tile for module in modules if hasattr(module, "tiles") for tile in module.tiles(data)],
        more=sections(tables),
        panels=page_panels(kind, few),
        abscissae=offered(prepared(few)) if "time" in few.dims else (),
        time=few["time"].values if "time" in few.dims else (),
        notes=finding_lines(verdict_of(data)),
    )
