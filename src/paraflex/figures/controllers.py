"""Charts and tables of controllers: their settings, torques before and after limits, and readings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.formatting import NO_VALUE, ROUNDING, number, quantity, text_symbol
from paraflex.results.controllers import APPLIED, CONTROLLERS, READINGS, REQUESTED, ControllerData, controllers_of
from paraflex.units import EFFORTS, DisplayUnit
from .charts import DOTTED, Axis, Chart, Curve, look, stairs
from .entry import figure
from .loads import run_columns
from .runs import after_motion
from .tables import Column, Table, columns_of

_WORDS = {"rad": "angle", "m": "position", "rad/s": "rate", "m/s": "speed", **EFFORTS}
# Internal torques below this share of the largest torque are rounding errors.
_INTERNAL = 1e-9


@figure(
    "torques of controllers before and after limits, and their readings", heading="Controllers", takes="mode",
    written_as="controllers", height=40.0,
    missing=("no controllers in these results", "run it with --controller, or with [study] controllers in the model"),
)  # fmt: skip
def controllers(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the torques of every controller and of its readings, one for each unit.

    Torques as they act are solid, held from the end of the delay to the next sample; those of the law before limits are
    dotted. A dashed line is a limit that a torque reaches.
    """
    for one in controllers_of(data):
        for variable in (APPLIED, READINGS):
            names, values = one.signals(variable)
            # A mode lacks the signals of motors that it does not drive.
            known = [k for k in range(values.shape[1]) if np.isfinite(values[:, k]).any()]
            units = [one.units[name] for name in names]
            for number_of_unit, unit in enumerate(dict.fromkeys(units[k] for k in known)):
                own = [k for k in known if units[k] == unit]
                chart = _signals(one, variable, names, values, own, Axis(_WORDS.get(unit, "reading"), unit))
                yield replace(chart, identity=f"{chart.identity}-{number_of_unit}", spans=after_motion(data))


def _signals(
    one: ControllerData, variable: str, names: Sequence[str], values: Array, own: Sequence[int], axis: Axis
) -> Chart:
    """Return the chart of the torques or readings of a controller, by index, that share a unit."""

    def held(name: str, r: int, p: int, times: Array, values: Array, **more: Any) -> Curve:
        x, y = stairs(times, values)
        return Curve(name, y, x, **{"look": look(p), "run": r, "shown": (r,)} | more)

    known = [(r, p, k) for r in range(len(values)) for p, k in enumerate(own) if np.isfinite(values[r, k]).any()]
    from_delay = one.times + one.delay if variable == APPLIED else one.times
    curves = [held(text_symbol(names[k]), r, p, from_delay, values[r, k]) for r, p, k in known]
    if variable == READINGS:
        return Chart(f"readings-{one.name}", f"Controller {one.name}: readings", axis, curves)
    _, wanted = one.signals(REQUESTED)
    curves += [
        held("wanted by the law", r, p, one.times, wanted[r, k], look=look(p)._replace(dash=DOTTED), desired=True,
             quiet=True) for r, p, k in known
    ]  # fmt: skip
    bounds = [(bound, k) for k in own for bound in one.limits[names[k]]]
    levels = dict.fromkeys(bound for bound, k in bounds if bound is not None and np.any(values[:, k] == bound))
    note = "Solid: torques as they act, after the delay and until the next sample; dotted: those of the law."
    title = f"Controller {one.name}: {axis.name}s"
    return Chart(f"torques-{one.name}", title, axis, curves, levels=tuple(levels), note=note)


def controller_table(runs: Mapping[tuple[str, ...], Mapping[str, Any]], heads: Sequence[str] = ()) -> Table:
    """Return the table of controllers, one row for each in each run.

    Runs are numbers of `results.controllers.controller_figures` by names, such as path and mode, which have headings.
    """
    rows = [(run, name, one) for run, of in runs.items() for name, one in of.get(CONTROLLERS, {}).items()]
    controllers = [one for *_, one in rows]
    return Table("Controllers", [
        *run_columns([run for run, *_ in rows], heads),
        Column("controller", [f"{name}\n{one['law']}" for _, name, one in rows], "law"),
        *columns_of(controllers, ("period", "period", "s"), ("delay", "delay", "s"), shown=DisplayUnit("ms", 1e3)),
        Column("limited", [_limited(one) for one in controllers], "samples"),
        Column("limits", [_limits(one["torques"]) for one in controllers]),
        Column("largest", [_largest(one["torques"]) for one in controllers], "torque"),
        Column("internal", [_internal(runs[run]) for run, *_ in rows], "N m"),
    ], "Limited: samples at which a limit of torques or of their rates was reached. Internal: the largest torque that "
       "only strains links.").filled()  # fmt: skip


def _limited(one: Mapping[str, Any]) -> str:
    share = one["saturated_share"]
    return f"{NO_VALUE if share is None else f'{number(share, 3, factor=100.0)} %'}\nof {one['samples']}"


def _limits(torques: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the limits in words, only once if they are the same for all motors."""
    limits = {}
    for motor, one in torques.items():
        low, high, unit, words = one["lowest"], one["highest"], one["unit"], []
        if low is not None or high is not None:
            both = high is not None and low == -high
            words.append(f"±{number(high)} {unit}" if both else f"{number(low)} to {number(high)} {unit}")
        if one["rate"] is not None:
            words.append(f"{number(one['rate'])} {unit}/s")
        limits[motor] = ", ".join(words) or "none"
    if len(set(limits.values())) == 1:
        return next(iter(limits.values()))
    return "\n".join(f"{text_symbol(motor)}: {words}" for motor, words in limits.items())


def _largest(torques: Mapping[str, Mapping[str, Any]]) -> str:
    known = [(one["given_max"], motor, one["unit"]) for motor, one in torques.items() if one["given_max"] is not None]
    if not known:
        return NO_VALUE
    most, motor, unit = max(known)
    return f"{quantity(most, unit, padded=False)}\n{motor}"


def _internal(run: Mapping[str, Any]) -> float | None:
    """Return the largest internal torque of a run [N m]; zero if it is a rounding error."""
    value = run.get("internal_torque_max")
    efforts = [each["given_max"] or 0.0 for of in run[CONTROLLERS].values() for each in of["torques"].values()]
    return 0.0 if value is not None and value < max(ROUNDING, _INTERNAL * max(efforts, default=0.0)) else value
