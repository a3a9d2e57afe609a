"""Controllers in the report of a run: a table of their settings, and charts of torques and readings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.plots.labels import display_unit, text_symbol
from paraflex.plots.selection import names_of
from paraflex.report.curves import DOTTED, MOST_SAMPLES, look
from paraflex.report.page import Chart, Curve, Look, Panel
from paraflex.report.text import NO_VALUE, count, number, table
from paraflex.results.controllers import (
    APPLIED,
    CONTROLLERS,
    INPUT,
    OUTPUT,
    READINGS,
    REQUESTED,
    SAMPLE,
    ControllerData,
    controller_figures,
    controllers_of,
)


def controller_tables(data: xr.Dataset) -> list[tuple[str, str]]:
    """Return a title and the table of controllers, one row for each in each mode; empty if there are none."""
    modes = names_of(data, "mode") if "mode" in data.dims else [""]
    figures = {mode: controller_figures(data.sel(mode=mode) if mode else data) for mode in modes}
    rows = [(mode, name, one) for mode in modes for name, one in figures[mode].get(CONTROLLERS, {}).items()]
    if not rows:
        return []
    several = len(modes) > 1
    heads = [("mode" if several else "controller", ""), *([("controller", "")] if several else []), ("law", ""),
             ("period", "[ms]"), ("delay", "[ms]"), ("samples", ""), ("limited", "[%]"), ("limits", ""),
             ("largest", "torque")]  # fmt: skip
    cells = [
        (mode if several else name, [
            *([name] if several else []), one["law"], number(1e3 * one["period"]), number(1e3 * one["delay"]),
            count(one["samples"]), number(one["saturated_share"], 100.0),
            "\n".join(_limits(one["torques"])), "\n".join(_largest(one["torques"])),
        ])
        for mode, name, one in rows
    ]  # fmt: skip
    note = "Limited: samples at which a limit of torques or of their rates was reached."
    known = [f"{most}{f' in mode {mode}' if several else ''}" for mode, most in _internal(figures)]
    if known:
        note += f" Largest internal torque, which only strains links: {', '.join(known)}."
    return [("Controllers", table(heads, cells, caption="Controllers", note=note))]


def _internal(figures: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    """Yield the modes with controllers, and the largest internal torque of each in words."""
    for mode, one in figures.items():
        if CONTROLLERS in one and one.get("internal_torque_max") is not None:
            efforts = [each["given_max"] or 0.0 for of in one[CONTROLLERS].values() for each in of["torques"].values()]
            yield mode, f"{number(one['internal_torque_max'], beside=max(efforts))} N m"


def _limits(torques: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the limits in words, only once if they are the same for all motors."""
    words = {}
    for motor, one in torques.items():
        bounds = [one["lowest"], one["highest"]]
        word = [] if bounds == [None, None] else [" to ".join(NO_VALUE if x is None else number(x) for x in bounds)]
        rate = [] if one["rate"] is None else [f"{number(one['rate'])} {one['unit']}/s"]
        words[motor] = ", ".join([*(f"{each} {one['unit']}" for each in word), *rate]) or "none"
    if len(set(words.values())) == 1:
        return [next(iter(words.values()))]
    return [f"{text_symbol(motor)}: {word}" for motor, word in words.items()]


def _largest(torques: Mapping[str, Mapping[str, Any]]) -> list[str]:
    known = [(one["given_max"], motor, one["unit"]) for motor, one in torques.items() if one["given_max"] is not None]
    if not known:
        return [NO_VALUE]
    most, motor, unit = max(known)
    return [f"{number(most)} {unit}", text_symbol(motor)]


def controller_panels(data: xr.Dataset, runs: Sequence[str]) -> list[Panel]:
    """Return charts over time of runs (run, ...): torques and readings of every controller; empty if there are none."""
    charts = [chart for one in controllers_of(data) for chart in _charts(one, runs)]
    return [Panel("Controllers", charts)] if charts else []


def _charts(one: ControllerData, runs: Sequence[str]) -> Iterator[Chart]:
    every = max(1, -(-one.data.sizes[SAMPLE] // MOST_SAMPLES))
    few = one.data.isel({SAMPLE: slice(None, None, every)})
    times = few[SAMPLE].values
    note = "Solid: torques as they act, after the delay and until the next sample; dotted: those of the law."
    label = f"torque [{', '.join(dict.fromkeys(one.units[name] for name in names_of(few, OUTPUT)))}]"
    torques = Chart(f"torques-{one.name}", f"Controller {one.name}: torques", label, note=note)
    given, wanted = (few[name].transpose(..., SAMPLE, OUTPUT).values for name in (APPLIED, REQUESTED))
    curves = []
    for r in range(len(runs)):
        for p, motor in enumerate(names_of(few, OUTPUT)):
            if np.isfinite(given[r, :, p]).any():
                acts, law = _stairs(times + one.delay, given[r, :, p]), _stairs(times, wanted[r, :, p])
                dotted = Look(look(p).colour, DOTTED)
                curves.append(Curve(text_symbol(motor), acts[1], acts[0], Look(look(p).colour), run=r, shown=(r,)))
                curves.append(Curve("wanted", law[1], law[0], dotted, run=r, shown=(r,), quiet=True))
    yield replace(torques, curves=curves)
    for k, unit in enumerate(dict.fromkeys(one.units[name] for name in names_of(few, INPUT))):
        names = [name for name in names_of(few, INPUT) if one.units[name] == unit]
        values = few[READINGS].sel({INPUT: names}).transpose(..., SAMPLE, INPUT).values
        shown = display_unit(unit, values)
        chart = Chart(f"readings-{one.name}-{k}", f"Controller {one.name}: readings", f"reading [{shown.name}]")
        curves = []
        for r in range(len(runs)):
            for p, name in enumerate(names):
                if np.isfinite(values[r, :, p]).any():
                    x, y = _stairs(times, shown.factor * values[r, :, p])
                    curves.append(Curve(text_symbol(name), y, x, look(p), run=r, shown=(r,)))
        yield replace(chart, curves=curves)


def _stairs(times: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the corners of the step curve of values that are held until the next one."""
    return np.repeat(times, 2)[1:], np.repeat(values, 2)[:-1]
