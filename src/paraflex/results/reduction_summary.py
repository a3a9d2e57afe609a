"""Summaries of reduced linear models as plain numbers, and the names that their datasets use."""

import json
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from .kinds import check_kind
from .linear_summary import HOLDINGS
from .numbers import by_label, finite_or_none

FULL = "full"
OWN, ONE = "of each pose", "of one pose"
# Static shapes: those of each pose ("renewed"), or those of the other poses ("carried"), like the vibration modes.
STATIC = ("renewed", "carried")


@checked_arguments()
def reduction_summary(data: xr.Dataset) -> dict[str, Any]:
    """Return reduced models as plain numbers for JSON.

    Raises
    ------
    InputError
        The dataset is of another kind.
    """
    check_kind(data, "reduction")

    def of(mode: str, name: str) -> dict[str, Any]:
        run = data.sel(mode=mode, reduction=name)
        frequencies = data["natural_frequency"].sel(mode=mode, variant=name)
        return {
            "states_needed": by_label(run["states"], "output"),
            "largest_error": by_label(run["largest_error"], "output"),
            "bound": finite_or_none(float(run["bound"])),
            "held_frequency_by_states": by_label(run["held_frequency"], "kept"),
            **{f"frequencies_{holding}": _list(frequencies.sel(holding=holding)) for holding in HOLDINGS},
        }

    modes = [str(mode) for mode in data["mode"].values]
    return {
        "mechanism": data.attrs["mechanism"],
        "about": data.attrs["about"],
        "states": int(data.attrs["kept_states"]),
        "full_states": int(data.attrs["full_states"]),
        "until": float(data.attrs["until"]),
        "accuracy": float(data.attrs["accuracy"]),
        "modes": {
            mode: {
                FULL: {f"frequencies_{holding}": _list(data["natural_frequency"].sel(mode=mode, variant=FULL,
                                                                                     holding=holding))
                       for holding in HOLDINGS},
                **{str(name): of(mode, str(name)) for name in data["reduction"].values},
                **({"along": along_summary(data, mode)} if "along_error" in data else {}),
            }
            for mode in modes
        },
        "parameters": json.loads(data.attrs["parameters"]),
        "version": data.attrs["paraflex_version"],
    }  # fmt: skip


def along_summary(data: xr.Dataset, mode: str) -> dict[str, Any]:
    """Return the errors along a path of reduced models of a mode as plain numbers, by static shapes and basis."""
    error = float(data.attrs["accuracy"])

    def of(run: xr.Dataset) -> dict[str, Any]:
        frequency = run["along_frequency_error"].max("place")
        return {
            "largest_error": float(run["along_error"].max()),
            **{f"frequency_error_{name}": finite_or_none(float(frequency.sel(holding=name))) for name in HOLDINGS},
            "within": within(run["along_error"].values, data["place"].values, error),
        }

    bases = {static: {str(name): data.sel(mode=mode, static=static, basis=name) for name in data["basis"].values}
             for static in STATIC}  # fmt: skip
    return {static: {name: of(run) for name, run in runs.items() if run["along_error"].notnull().all()}
            for static, runs in bases.items()}  # fmt: skip


def within(errors: Array, places: Array, error: float) -> tuple[float, float] | None:
    """Return the ends of the longest interval of places where errors (k,) do not exceed a limit; None without one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], errors <= error, [False]]).astype(int)))
    if not edges.size:
        return None
    firsts, lasts = edges[::2], edges[1::2] - 1
    longest = int(np.argmax(places[lasts] - places[firsts]))
    return float(places[firsts[longest]]), float(places[lasts[longest]])


def _list(values: xr.DataArray) -> list[float]:
    return [float(x) for x in values.values if np.isfinite(x)]
