"""Report of linear models: animated mode shapes, gains, poles and zeros."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.figures.selection import default_mode, names_of
from paraflex.formatting import number
from paraflex.results.kinds import check_kind
from paraflex.results.linear_motion import DrawnMode, drawn_modes, modal_motion
from paraflex.results.linear_summary import HELD_WORDS, about, remarks
from .film import Animation, animation
from .kind_page import kind_page
from .page import Page

# Number of frames of a period, and its duration [s].
_FRAMES, _PERIOD = 33, 2.0


@checked_arguments()
def linear_page(data: xr.Dataset) -> Page:
    """Return the report of linear models, a dataset from `results.linear_dataset`."""
    check_kind(data, "linear")
    drawn = list(drawn_modes(data))
    groups: dict[str, int] = {}
    for one in drawn:
        groups[_group(one)] = groups.get(_group(one), 0) + 1
    # The first mode shape that vibrates with motors held, if there is one, is selected.
    mode = default_mode(data)
    wanted = [k for k, one in enumerate(drawn) if one.frequency > 0.0 and one.holding == "held" and one.mode == mode]
    page = kind_page(data)
    return replace(
        page,
        kind="linear models",
        subtitle=f"Linear models {about(data)}, {data.sizes['state']} states",
        facts=[*_facts(data), *page.facts],
        time=np.linspace(0.0, _PERIOD, _FRAMES),
        runs=[_name(one) for one in drawn],
        groups=list(groups.items()),
        selecting="mode shape",
        selected=wanted[0] if wanted else 0,
        film=_film(data, drawn),
        no_film="There is nothing to draw.",
        remarks=[f"{one[0].upper()}{one[1:]}." for one in remarks(data)],
    )


def _group(one: DrawnMode) -> str:
    return ", ".join([*([one.mode] if one.mode else []), HELD_WORDS[one.holding]])


def _name(one: DrawnMode) -> str:
    return f"{_group(one)}: {f'{number(one.frequency)} Hz' if one.frequency else 'free motion'}"


def _film(data: xr.Dataset, drawn: Sequence[DrawnMode]) -> Animation | None:
    """Return the animation of one period of every mode shape; None if there are none."""
    if not drawn:
        return None
    phases = np.linspace(0.0, 2.0 * np.pi, _FRAMES)
    runs = xr.concat([modal_motion(data, one, phases) for one in drawn], "run", join="override", coords="minimal",
                     compat="override", data_vars="all")  # fmt: skip
    film = animation(runs, ("run",))
    if film is None:
        return None
    scenes, stiff = (
        [None if one is None else replace(one, followed=(), trails=()) for one in each]
        for each in (film.scenes, film.stiff)
    )
    time = np.linspace(0.0, _PERIOD, _FRAMES)
    return replace(film, time=time, scenes=scenes, stiff=stiff, magnify=1.0, periodic=True)


def _facts(data: xr.Dataset) -> list[tuple[str, str]]:
    def listed(what: str) -> str:
        names = names_of(data, what)
        units = data[f"{what}_unit"].values.tolist()
        return ", ".join(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))

    return [
        ("about", about(data)), ("states", str(data.sizes["state"])), ("inputs", listed("input")),
        ("outputs", listed("output")),
    ]  # fmt: skip
