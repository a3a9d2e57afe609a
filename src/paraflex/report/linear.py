"""Report of linear models: animated mode shapes, gains, poles and zeros."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.figures.selection import default_mode, names_of
from paraflex.report.curves import DOTTED, look
from paraflex.report.film import Animation, animation
from paraflex.report.page import PLAIN_LOOK, Chart, Curve, Page, Panel
from paraflex.report.provenance import asked, command_line
from paraflex.report.text import NO_VALUE, number, table
from paraflex.results.kinds import check_kind
from paraflex.results.linear_data import END_EFFECTOR, HOLDINGS
from paraflex.results.linear_motion import DrawnMode, drawn_modes, modal_motion
from paraflex.results.linear_summary import (
    HELD_WORDS,
    MAP_WORDS,
    about,
    common_poles,
    gain_unit,
    gains_of,
    limiting_zero,
    motors_of_mode,
    oscillations,
    poles_of,
    remarks,
    right_half_plane,
    roots,
    zeros_of,
)

Complex = NDArray[np.complex128]

# Number of frames of a period, and its duration [s].
_FRAMES, _PERIOD = 33, 2.0
# Largest numbers of oscillations and zeros in a row of a table; linear.json has all.
_OSCILLATIONS, _ROOTS = 6, 6
_ROUNDING = 1e-7
# Share of the largest shown magnitude below which poles are zero, and largest number of decades that are all numbered.
_NOTHING, _DECADES = 1e-9, 4


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
    of_maps = [chart for name in names_of(data, "map") for chart in (_gain_chart(data, name), _map_chart(data, name))]
    return Page(
        title=data.attrs["mechanism"],
        kind="linear models",
        subtitle=f"Linear models {about(data)}, {data.sizes['state']} states",
        facts=_facts(data),
        command=command_line(asked(data)),
        figures=_tiles(data),
        more=[("Frequencies and damping", _frequencies(data)), *_zero_tables(data)],
        panels=[Panel("Responses, poles and zeros", [*of_maps, *_branch_charts(data)])],
        time=np.linspace(0.0, _PERIOD, _FRAMES),
        runs=[_name(one) for one in drawn],
        groups=list(groups.items()),
        selecting="mode shape",
        selected=wanted[0] if wanted else 0,
        film=_film(data, drawn),
        no_film="" if drawn else "There is nothing to draw.",
        remarks=[f"{one[0].upper()}{one[1:]}." for one in remarks(data)],
    )


def _group(one: DrawnMode) -> str:
    return ", ".join([*([one.mode] if one.mode else []), HELD_WORDS[one.holding]])


def _name(one: DrawnMode) -> str:
    return f"{_group(one)}: {f'{one.frequency:.4g} Hz' if one.frequency else 'free motion'}"


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
        [None if one is None else replace(one, followed=None, trail=None) for one in each]
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
        ("outputs", listed("output")), ("paraflex", str(data.attrs["paraflex_version"])),
    ]  # fmt: skip


def _tiles(data: xr.Dataset) -> list[tuple[str, str, str]]:
    modes = names_of(data, "mode")
    tiles = []
    first = {mode: oscillations(poles_of(data, mode, "held"))[:1] for mode in modes if motors_of_mode(data, mode)}
    known = {mode: found[0].frequency for mode, found in first.items() if found}
    if known:
        for words, choose in (("lowest", min), ("highest", max))[: 2 if len(known) > 1 else 1]:
            mode = choose(known, key=lambda name: known[name])
            tiles.append((f"{words} first frequency, motors held", f"{known[mode]:.4g} Hz", f"mode {mode}"))
    limits = {mode: limiting_zero(zeros_of(data, mode, END_EFFECTOR)) for mode in modes if END_EFFECTOR in data["map"]}
    limits = {mode: limit for mode, limit in limits.items() if limit}
    if limits:
        mode = min(limits, key=lambda name: limits[name])
        tiles.append(("lowest right-half-plane zero to the end-effector", f"{limits[mode]:.4g} rad/s", f"mode {mode}"))
    return tiles


def _frequencies(data: xr.Dataset) -> str:
    """Return the table of frequencies and damping ratios of all modes, motors free and held."""
    modes, common = names_of(data, "mode"), common_poles(data)
    rows: list[tuple[str, Complex]] = []
    for holding in HOLDINGS:
        if holding == "free" and common is not None:
            rows.append(("all modes, motors free", common))
            continue
        shown = modes if holding == "free" else [mode for mode in modes if motors_of_mode(data, mode)]
        rows += [(f"{mode}, {HELD_WORDS[holding]}", poles_of(data, mode, holding)) for mode in shown]

    def cells(poles: Complex) -> list[str]:
        found = oscillations(poles)[:_OSCILLATIONS]
        texts = [f"{one.frequency:.4g}" + (f"\nζ = {number(100.0 * one.damping_ratio)} %"
                                           if abs(one.damping_ratio) > _ROUNDING else "") for one in found]  # fmt: skip
        return texts + [""] * (_OSCILLATIONS - len(texts))

    heads = [("", ""), *((str(k + 1), "Hz") for k in range(_OSCILLATIONS))]
    return table(
        heads, [(name, cells(poles)) for name, poles in rows], caption="Frequencies and damping ratios",
        note="Poles: |s| / 2π and, below it, the damping ratio if there is one. Motions without a frequency are "
        "left out.",
    )  # fmt: skip


def _zero_tables(data: xr.Dataset) -> list[tuple[str, str]]:
    """Return the tables of the zeros of every map, a row for each mode."""
    out = []
    for name in names_of(data, "map"):
        rows = []
        for mode in names_of(data, "mode"):
            zeros = zeros_of(data, mode, name)
            found, limit = roots(zeros), limiting_zero(zeros)
            texts = ", ".join(one.text for one in found[:_ROOTS]) or "none"
            more = f"\nand {len(found) - _ROOTS} more" if len(found) > _ROOTS else ""
            phase = "nearly, beside the axis" if right_half_plane(zeros).size else "yes"
            phase = f"no, from {number(limit)} rad/s on" if limit else phase
            rows.append((mode, [texts + more, phase if found else NO_VALUE]))
        html = table(
            [("mode", ""), ("lowest zeros", ""), ("minimum phase", "")], rows, caption=f"Zeros of {MAP_WORDS[name]}",
            note="Those on the imaginary axis as frequencies [Hz]; * marks the right half plane.",
        )  # fmt: skip
        out.append((f"Zeros: {MAP_WORDS[name]}", html))
    return out


def _gain_chart(data: xr.Dataset, name: str) -> Chart:
    """Return the chart of the largest and the smallest gain over frequency."""
    curves = []
    for k, mode in enumerate(names_of(data, "mode")):
        gains = gains_of(data, mode, name)
        curves.append(Curve(mode, gains[:, 0], data["frequency"].values, look(k)))
        if gains.shape[1] > 1:
            curves.append(Curve(mode, gains[:, -1], data["frequency"].values, look(k)._replace(dash=DOTTED)))
    words = MAP_WORDS[name]
    return Chart(
        f"gain-{name}", f"Gains: {words}", f"gain [{gain_unit(data, name)}]", curves, x="frequency [Hz]", log=True,
        log_x=True, over_time=False, note="Singular values; the least, dotted, dips at zeros.",
    )  # fmt: skip


def _map_chart(data: xr.Dataset, name: str) -> Chart:
    """Return the chart of poles and zeros on symmetrical logarithmic axes."""
    most = 2.0 * np.pi * float(data["frequency"].values[-1])
    modes, common = names_of(data, "mode"), common_poles(data)
    series = [(f"zeros, {mode}", zeros_of(data, mode, name), look(k), "ring") for k, mode in enumerate(modes)]
    series += [("poles, motors free", common, PLAIN_LOOK, "cross")] if common is not None else [
        (f"poles, {mode}", poles_of(data, mode, "free"), look(k), "cross") for k, mode in enumerate(modes)
    ]  # fmt: skip
    kept = [(label, values[np.abs(values) <= most], own, mark) for label, values, own, mark in series]
    sizes = np.abs(np.concatenate([values for _, values, _, _ in kept]))
    least = 10.0 ** np.floor(np.log10(np.min(sizes[sizes > _NOTHING * most], initial=most)))

    def place(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.sign(values) * np.log10(1.0 + np.abs(values) / least)

    curves = [
        Curve(label, place(values.imag), place(values.real), own, mark=mark, texts=[_complex(one) for one in values])
        for label, values, own, mark in kept
    ]
    return Chart(
        f"map-{name}", f"Poles and zeros: {MAP_WORDS[name]}", "imaginary part [rad/s]", curves, x="real part [rad/s]",
        over_time=False, equal=True, layout=_plane(place, least, most),
        note="Symmetrical logarithmic axes. Right of the line, shaded: zeros of non-minimum phase, unstable poles.",
    )  # fmt: skip


def _complex(value: complex) -> str:
    return f"{value.real:.4g} {'−' if value.imag < 0.0 else '+'} {abs(value.imag):.4g}i rad/s".replace("-", "−")


def _plane(place: Callable[[NDArray[np.float64]], NDArray[np.float64]], least: float, most: float) -> dict[str, Any]:
    """Return Plotly's layout of both axes, numbered every decade or every other, with the right half plane shaded."""
    count = int(np.ceil(np.log10(most / least))) + 1
    # The first decade has no number because it would touch that of zero.
    decades = least * 10.0 ** np.arange(1, count, 1 if count <= _DECADES else 2)
    ticks, end = np.concatenate([-decades[::-1], [0.0], decades]), float(place(np.array(2.0 * most)))
    axis = {"tickvals": place(ticks).tolist(), "ticktext": [f"{one:g}".replace("-", "−") for one in ticks],
            "range": [-end, end], "zeroline": True, "tickangle": 0}  # fmt: skip
    shade = {"type": "rect", "xref": "x", "yref": "paper", "x0": 0.0, "x1": 10.0 * end, "y0": 0.0, "y1": 1.0,
             "fillcolor": "rgba(128,128,128,0.14)", "line": {"width": 0}, "layer": "below"}  # fmt: skip
    return {"xaxis": axis, "yaxis": axis, "shapes": [shade]}


def _branch_charts(data: xr.Dataset) -> list[Chart]:
    """Return the charts of pole branches along the motion; empty for models about one instant."""
    if "branch_real" not in data:
        return []
    chosen = [(mode, holding) for mode in names_of(data, "mode") for holding in HOLDINGS]
    choices = [f"{mode}, {HELD_WORDS[holding]}" for mode, holding in chosen]
    curves: tuple[list[Curve], list[Curve]] = ([], [])
    for c, (mode, holding) in enumerate(chosen):
        held = data.sel(mode=mode, holding=holding)
        values = held["branch_real"].values + 1j * held["branch_imag"].values
        for k in range(values.shape[1]):
            if np.isfinite(values[:, k].real).any():
                of = {"x": data["moment"].values, "choice": c, "look": look(k)}
                curves[0].append(Curve(f"branch {k + 1}", np.abs(values[:, k]) / (2.0 * np.pi), **of))
                curves[1].append(Curve(f"branch {k + 1}", values[:, k].real, **of))
    common: dict[str, Any] = {"choices": choices, "choosing": "mode and motors", "over_time": False}
    note = "Each branch is followed by its motion. Frozen at instants, poles say nothing about stability."
    return [
        Chart("branches", "Frequencies along the motion", "frequency [Hz]", curves[0], **common, note=note),
        Chart("branch-real", "Real parts along the motion", "real part [1/s]", curves[1], **common),
    ]
