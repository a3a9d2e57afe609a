"""Report of static equilibria: animation of the steps, force and stiffness along the travel, buckling, stresses."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.figures import equilibria
from paraflex.figures.charts import Panel
from paraflex.figures.equilibria import quantity_word, unit_of
from paraflex.figures.selection import names_of
from paraflex.formatting import NO_VALUE, number, quantity, text_symbol
from paraflex.results.findings import validity_line
from paraflex.results.kinds import check_kind
from paraflex.results.statics_data import statics_summary
from paraflex.results.statics_steps import as_samples, step_kinds
from .film import NO_SHAPES, Animation, animation, frames_of
from .kind_page import kind_page
from .page import Page

# Duration of the animation from the first step to the last [s].
_DURATION = 5.0
# Largest numbers of tiles of given coordinates and of stiffnesses.
_TILES = 2


@checked_arguments()
def statics_page(data: xr.Dataset) -> Page:
    """Return the report of equilibria, a dataset from `results.statics_dataset`."""
    check_kind(data, "statics")
    data = data.transpose("step", ...)
    summary, page = statics_summary(data), kind_page(data)
    return replace(
        page,
        subtitle=_subtitle(data),
        facts=[("steps", str(summary["steps"])), *page.facts],
        figures=_tiles(data, summary),
        panels=_panels(data, page.panels),
        time=_times(data.sizes["step"]),
        runs=("",),
        film=_film(data),
        no_film=NO_SHAPES,
        notes=[
            *([] if summary["status"] == "complete" else [f"{summary['status']}: {summary['message']}"]),
            *page.notes,
        ],
        remarks=list(filter(None, [validity_line({"": summary["validity"]}), equilibria.no_buckling(data)])),
    )


def _panels(data: xr.Dataset, along: Sequence[Panel]) -> list[Panel]:
    """Return the charts along the travel and of buckling, or else of the shape."""
    buckling = list(equilibria.buckling_chart(data))
    panels = [*along, *([Panel("Buckling", buckling)] if buckling else [])]
    return panels or [Panel("Shape", [equilibria.shape_chart(data)])]


def _times(steps: int) -> Array:
    return np.linspace(0.0, _DURATION, max(steps, 2))


def _film(data: xr.Dataset) -> Animation | None:
    """Return the animation from step to step; a single equilibrium is repeated. None if there are no shapes."""
    steps = data.isel(step=[0, 0]) if data.sizes["step"] == 1 else data
    film = animation(as_samples(steps), ())
    if film is None:
        return None
    kept = frames_of(steps.sizes["step"])
    kinds, fraction = step_kinds(steps), steps["fraction"].values
    names = [f"{kinds[k]} at load factor {number(float(fraction[k]), 3)}" for k in kept]
    return replace(film, time=_times(steps.sizes["step"])[kept], magnify=1.0, moments=names)


def _subtitle(data: xr.Dataset) -> str:
    """Return a text on the coordinates that are moved, loaded and held."""
    found = {role: list(map(text_symbol, names_of(data.isel(named=data["role"].values == role), "named")))
             for role in ("moved", "loaded", "held")}  # fmt: skip
    return "; ".join(f"{', '.join(names)} {role}" for role, names in found.items() if names) or "at rest"


def _tiles(data: xr.Dataset, summary: dict[str, Any]) -> list[tuple[str, str, str]]:
    tiles = []
    for k in equilibria.given_coordinates(data)[:_TILES]:
        one = data.isel(named=k)
        name, role = text_symbol(str(one["named"].item())), str(one["role"].item())
        found, given = ("effort", "travel") if role == "moved" else ("travel", "effort")
        tiles.append(
            (f"{quantity_word(one, found)} of {name}", _text(one, found, -1), f"{role}: {_text(one, given, -1)}")
        )
    for k in np.flatnonzero(np.isfinite(data["stiffness"].values).any(axis=0))[:_TILES]:
        one = data.isel(named=k)
        before = f"{_text(one, 'stiffness', 0)} at the start" if data.sizes["step"] > 1 else ""
        tiles.append((f"stiffness of {text_symbol(str(one['named'].item()))}", _text(one, "stiffness", -1), before))
    for name, word in equilibria.lowest_frequencies(data).items():
        lowest = data[name].values[:, 0]
        before = f"{number(lowest[0])} Hz at the start" if len(lowest) > 1 else ""
        tiles.append(
            (f"{'lowest' if word == 'lowest' else f'lowest {word}'} frequency", f"{number(lowest[-1])} Hz", before)
        )
    if words := equilibria.buckling_words(data):
        factor, _, rest = words.removeprefix("load factor ").partition(" ")
        tiles.append(("buckling", factor, f"load factor, {rest}"))
    if summary["limit_points"]:
        tiles.append(("first limit point", number(summary["limit_points"][0]), "load factor"))
    if equilibria.is_stressed(data):
        worst = data.isel(body=int(np.nanargmax(data["stress_max"].values)))
        safety = float(worst["safety_factor"])
        more = "" if np.isnan(safety) else f", safety factor {number(safety)}"
        where = f"{text_symbol(str(worst['body'].item()))} at {quantity(float(worst['stress_place']), 'm')}{more}"
        tiles.append(("largest stress", quantity(float(worst["stress_max"]), "Pa"), where))
    return tiles


def _text(one: xr.Dataset, quantity_name: str, step: int) -> str:
    value = float(one[quantity_name].values[step])
    return NO_VALUE if np.isnan(value) else quantity(value, unit_of(one, quantity_name), digits=4, padded=False)
