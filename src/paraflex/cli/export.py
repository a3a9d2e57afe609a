"""`paraflex export`: results in the formats of other programs."""

from pathlib import Path

from paraflex.formatting import number
from paraflex.results import open_results
from paraflex.results.export import export, export_table
from .commands.requests import flagged
from .commands.results import ExportRequest
from .tables import PlainConsole, in_own_units

_TABLE = "results.parquet"


def export_command(request: ExportRequest) -> None:
    """Write the files."""
    results = Path(request.results)
    folder = results if results.is_dir() else results.parent
    output = folder / "export" if request.output is None else Path(request.output)
    table = results / _TABLE if results.is_dir() else results
    with flagged(request):
        if table.name.endswith(".parquet") and table.is_file():
            in_own_units(None, table.parent)
            files = export_table(table, output, request.to, force=request.force)
        else:
            data = in_own_units(open_results(results))
            files = export(data, output, request.to, shapes=request.shapes, force=request.force)
    console = PlainConsole(stderr=True)
    for file in files:
        console.print_lines(f"{file} ({number(file.stat().st_size, 3, factor=1e-6)} MB)")
