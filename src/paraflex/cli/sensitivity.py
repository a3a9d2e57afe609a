"""`paraflex sensitivity`: derivatives of the metrics of runs with respect to numbers of the mechanism's file."""

from dataclasses import replace

from paraflex.designs.setting import Setting
from paraflex.designs.units import check_unit_of
from paraflex.errors import InputError
from paraflex.expressions.evaluate import ExpressionError, evaluate
from paraflex.figures.sensitivity import tables
from paraflex.folders import SENSITIVITY
from paraflex.studies import load_sensitivities
from paraflex.studies.sensitivity import FIGURES, LINES, TABLE
from . import COMPLETE
from .commands.studies import SensitivityRequest
from .ending import print_results, write_drawn
from .replacing import hold_results
from .tables import PlainConsole, in_units_of, print_table

# Number of parameters side by side in a table of 80 columns.
_PARAMETERS_ABREAST = 4


def sensitivity_command(request: SensitivityRequest) -> int:
    """Differentiate the runs of a study; write sensitivity.json, the table and figures; return the exit code."""
    named = [name.strip() for entry in request.metrics for name in entry.split(",")]
    study = in_units_of(load_sensitivities(request.study, [name for name in named if name]))
    folder = request.folder
    study = replace(study, at=_values(request.at, study.setting))
    with hold_results(folder, SENSITIVITY, force=request.force, field="--output") as held:
        found = study.run()
        found.save_in(held)
        summary = found.to_dict()

        def show(out: PlainConsole) -> None:
            for run in range(len(found.rows)):
                for first in range(0, len(found.parameters), _PARAMETERS_ABREAST):
                    for table in tables(summary, run, found.parameters[first : first + _PARAMETERS_ABREAST]):
                        print_table(out, table)
            out.print_lines(f"{folder / found.values_file}, {TABLE}, {LINES} and {FIGURES}/")

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
