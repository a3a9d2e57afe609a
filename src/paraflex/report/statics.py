"""Report of static equilibria: animation of the steps, force and stiffness along the travel, buckling, stresses."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.plots.labels import peak, text_symbol
from paraflex.plots.selection import names_of
from paraflex.report.film import NO_SHAPES, Animation, animation, frames_of
from paraflex.report.page import Page
from paraflex.report.provenance import asked, model_words, repeated, verdict_word
from paraflex.report.statics_charts import statics_panels
from paraflex.report.text import NO_VALUE, number, table
from paraflex.results.findings import finding_lines, verdict_of
from paraflex.results.kinds import check_kind
from paraflex.results.statics_data import as_samples, statics_summary, step_kinds
from paraflex.results.statics_rows import (
    buckling_words,
    four_digits,
    given_coordinates,
    is_stressed,
    last_rows,
    lowest_frequencies,
    no_buckling,
    quantity_word,
    shown_unit,
    step_table,
    unit_of,
)
from paraflex.results.validity import validity_line
from paraflex.units import STRESS

Array = NDArray[np.float64]

# Duration of the animation from the first step to the last [s].
_DURATION = 5.0
# Largest numbers of tiles of given coordinates and of stiffnesses.
_TILES = 2
# Ratio of internal terms, stiffness times length, to the forces that are their differences: the scale for rounding.
_PARTS = 1e5


@checked_arguments()
def statics_page(data: xr.Dataset) -> Page:
    """Return the report of equilibria, a dataset from `results.statics_dataset`."""
    check_kind(data, "statics")
    data = data.transpose("step", ...)
    summary = statics_summary(data)
    film = _film(data)
    return Page(
        title=data.attrs["mechanism"],
        kind="statics",
        subtitle=_subtitle(data),
        verdict=verdict_word(data),
        facts=[("steps", str(summary["steps"])), ("paraflex", str(data.attrs["paraflex_version"]))],
        command=_command(asked(data)),
        figures=_tiles(data, summary),
        more=[*_last_table(data), *_step_table(data), *_stress_table(data), *_reactions(data)],
        panels=statics_panels(data),
        time=_times(data.sizes["step"]),
        runs=("",),
        film=film,
        no_film="" if film else NO_SHAPES,
        notes=[
            *([] if summary["status"] == "complete" else [f"{summary['status']}: {summary['message']}"]),
            *finding_lines(verdict_of(data)),
        ],
        remarks=list(filter(None, [validity_line({"": summary["validity"]}), no_buckling(data)])),
    )


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
    names = [f"{kinds[k]} with {fraction[k]:.3g} of what is given" for k in kept]
    return replace(film, time=_times(steps.sizes["step"])[kept], magnify=1.0, moments=names)


def _subtitle(data: xr.Dataset) -> str:
    """Return a text on the coordinates that are moved, loaded and held."""
    words = {"moved": "moved", "loaded": "loaded", "held": "held"}
    found = {
        word: [text_symbol(str(name)) for name, role in zip(data["named"].values, data["role"].values, strict=True)
               if role == kind] for kind, word in words.items()
    }  # fmt: skip
    return "; ".join(f"{', '.join(names)} {word}" for word, names in found.items() if names) or "at rest"


def _command(run: dict[str, Any]) -> str:
    """Return the command that reproduces these equilibria; empty if it is not known."""
    if not run.get("statics"):
        return ""
    words = ["paraflex", "statics", *model_words(run)]
    for name, flag in (("loads", "--load"), ("torques", "--torque"), ("moved", "--move")):
        words += repeated(flag, (f"{one}={value!r}" for one, value in run.get(name, {}).items()))
    held = run.get("held")
    for name, flag in (("held", "--hold"), ("stiffness", "--stiffness")):
        words += repeated(flag, run.get(name))
    words += ["--hold", "none"] if held == [] else []
    for name in ("steps", "buckling", "assembly"):
        words += [f"--{name}", str(run[name])] if name in run else []
    return shlex.join(words)


# Tiles and tables


def _tiles(data: xr.Dataset, summary: dict[str, Any]) -> list[tuple[str, str, str]]:
    tiles = []
    for k in given_coordinates(data)[:_TILES]:
        one = data.isel(named=k)
        name, role = text_symbol(str(one["named"].item())), str(one["role"].item())
        wanted = "effort" if role == "moved" else "travel"
        value = one[wanted].values[-1]
        given = _shown(one, "travel" if role == "moved" else "effort", -1)
        tiles.append((f"{quantity_word(one, wanted)} of {name}", _text(one, wanted, value), f"{role}: {given}"))
    for k in np.flatnonzero(np.isfinite(data["stiffness"].values).any(axis=0))[:_TILES]:
        one = data.isel(named=k)
        before = f"{_shown(one, 'stiffness', 0)} at the start" if data.sizes["step"] > 1 else ""
        tiles.append((f"stiffness of {text_symbol(str(one['named'].item()))}", _shown(one, "stiffness", -1), before))
    for name, word in lowest_frequencies(data).items():
        lowest = data[name].values[:, 0]
        before = f"{lowest[0]:.4g} Hz at the start" if len(lowest) > 1 else ""
        tiles.append(
            (f"{'lowest' if word == 'lowest' else f'lowest {word}'} frequency", f"{lowest[-1]:.4g} Hz", before)
        )
    if words := buckling_words(data):
        factor, _, rest = words.partition(" of what")
        tiles.append(("buckling", f"{factor} ×", f"of what{rest}"))
    if summary["limit_points"]:
        tiles.append(("first limit point", f"{summary['limit_points'][0]:.4g} ×", "of what is given"))
    if is_stressed(data):
        worst = data.isel(body=int(np.nanargmax(data["stress_max"].values)))
        safety = float(worst["safety_factor"])
        more = "" if np.isnan(safety) else f", safety factor {number(safety)}"
        where = f"{text_symbol(str(worst['body'].item()))} at {number(float(worst['stress_place']))} m{more}"
        tiles.append(("largest stress", f"{number(float(worst['stress_max']), STRESS.factor)} {STRESS.name}", where))
    return tiles


def _shown(one: xr.Dataset, quantity: str, step: int) -> str:
    return _text(one, quantity, one[quantity].values[step])


def _text(one: xr.Dataset, quantity: str, value: float) -> str:
    unit = shown_unit(unit_of(one, quantity))
    return NO_VALUE if np.isnan(value) else f"{four_digits(unit.factor * value)} {unit.name}".replace("-", "−")


def _last_table(data: xr.Dataset) -> Iterator[tuple[str, str]]:
    rows = [
        # Role of the coordinate, then values with their units below.
        (text_symbol(name), [role, *(cell.replace("-", "−").replace(" ", "\n", 1) or NO_VALUE for cell in cells)])
        for name, role, *cells in last_rows(data)
    ]
    if not rows:
        return
    title = "At the last step" if data.sizes["step"] > 1 else "At rest"
    heads = [("coordinate", ""), ("", ""), ("travel", ""), ("force", ""), ("stiffness", ""), ("compliance", "")]
    note = "A force acts on the mechanism along its coordinate. Stiffness: with all held and moved coordinates fixed."
    yield title, table(heads, rows, caption=title, note=note)


def _step_table(data: xr.Dataset) -> Iterator[tuple[str, str]]:
    if data.sizes["step"] < 2:
        return
    found = step_table(data)
    heads = [("", ""), *((name, f"[{unit}]" if unit else "") for name, unit in found.heads)]
    rows = [(kind, [cell.replace("nan", NO_VALUE).replace("-", "−") for cell in cells]) for kind, *cells in found.rows]
    note = "Frequencies are those of small vibrations about each equilibrium, held and moved coordinates fixed."
    yield found.title, table(heads, rows, caption="Steps", note=note)


def _stress_table(data: xr.Dataset) -> Iterator[tuple[str, str]]:
    if not is_stressed(data):
        return
    heads = [("beam", ""), ("stress", f"[{STRESS.name}]"), ("safety", "factor"), ("at", "[m]"), ("step", "")]
    rows = []
    for name in names_of(data, "body"):
        one = data.sel(body=name)
        if np.isfinite(one["stress_max"].item()):
            cells = [number(one["stress_max"].item(), STRESS.factor), number(one["safety_factor"].item()),
                     number(one["stress_place"].item()), f"{one['stress_step'].item():.0f}"]  # fmt: skip
            rows.append((text_symbol(name), cells))
    note = "Bending and axial together, the largest of all steps."
    yield "Stresses of beams", table(heads, rows, caption="Largest stresses of the beams", note=note)


def _reactions(data: xr.Dataset) -> Iterator[tuple[str, str]]:
    """Yield the table of forces and moments of joints at the last step."""
    if not data.sizes.get("joint"):
        return
    force, moment = data["joint_force"].values[-1], data["joint_moment"].values[-1]
    places = data["joint_position"].values[-1]
    wide = float(np.max(np.nan_to_num(np.ptp(places, axis=0)), initial=0.0))
    size = max(peak(force), 1.0)
    turn = max(peak(moment), size * wide)
    rows = [
        (text_symbol(name), [*(number(x, beside=_PARTS * size) for x in force[j]),
                             number(moment[j], beside=_PARTS * turn)])
        for j, name in enumerate(names_of(data, "joint"))
    ]  # fmt: skip
    heads = [("joint", ""), ("force x", "[N]"), ("force y", "[N]"), ("moment", "[N m]")]
    note = "On the joint's second body, in the ground frame, at the last step."
    yield "Reactions", table(heads, rows, caption="Forces and moments of joints", note=note)
