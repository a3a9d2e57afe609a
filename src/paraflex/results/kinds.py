"""Kinds of datasets of results, and the error for a dataset of a wrong kind."""

from collections.abc import Iterable

import xarray as xr

from paraflex.arguments import checked_arguments, named_in_errors
from paraflex.errors import InputError, suggestion
from paraflex.folders import RESULT_KINDS

# Names of the figures on the course of a run, which every record has.
RUN_FIGURES = (
    "status",
    "message",
    "steps",
    "rejected",
    "newton_iterations",
    "factorisations",
    "wall_time",
    "constraint_position_max",
    "constraint_velocity_max",
    "energy_balance_max",
    "event",
    "event_time",
)
# Energy absorbed by brakes, if there were any.
BRAKE_ENERGY = "brake_energy"

named_in_errors(
    "a dataset of results", "a dataset: what tracking_dataset or open_results returns, or the data of a study"
)(xr.Dataset)


@checked_arguments()
def kind_of(data: xr.Dataset) -> str:
    """Return "verification", "motion" (without a path), "linear", "reduction", "statics", "laws" or "tracking"."""
    if "model" in data.dims:
        return "verification"
    kind = str(data.attrs.get("kind", "tracking"))
    if kind not in RESULT_KINDS or not RESULT_KINDS[kind].producers:
        known = [name for name, one in RESULT_KINDS.items() if one.producers]
        raise InputError("unknown kind of results", field="kind", value=kind, remedy=suggestion(kind, known))
    return kind


def check_kind(data: xr.Dataset, *kinds: str) -> None:
    """Check that a dataset is of one of the given kinds.

    Raises
    ------
    InputError
        The dataset is of another kind, or does not hold results of paraflex.
    """
    kind = kind_of(data)
    if kind not in kinds:
        raise wrong_kind(kind, kinds)
    if kind == "tracking" and "mode" not in data.coords:
        raise InputError("not results of paraflex", field="data", remedy="give what open_results returns")


def wrong_kind(kind: str, kinds: Iterable[str], field: str = "data") -> InputError:
    """Return the error for results of a wrong kind."""
    expected = list(kinds)
    makers = [kind.producers for kind in (RESULT_KINDS.get(each) for each in expected) if kind and kind.producers]
    remedy = "give those of the kind " + " or ".join(f'"{each}"' for each in expected)
    remedy += f", as {' or '.join(makers)} makes them" if len(makers) == len(expected) else ""
    return InputError(f'these are results of the kind "{kind}"', field=field, remedy=remedy)
