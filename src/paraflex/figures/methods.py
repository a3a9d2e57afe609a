"""Charts and tables of integration methods: work and precision, numerical damping."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from typing import Any

import numpy as np

from paraflex.formatting import number
from .charts import Axis, Chart, Curve, Look, Mark, Span
from .entry import figure
from .tables import Column, Table

# Dashes and marks of the methods of a family; its members differ in colour.
_FAMILIES: Mapping[str, tuple[int, Mark]] = {
    "esdirk": (0, "dot"), "newmark": (1, "square"), "scipy": (3, "triangle"), "sundials": (2, "diamond"),
}  # fmt: skip
# Orders of the multistep methods that are shown; IDA is omitted because its characteristic roots are those of BDF.
_ORDERS = {"adams": (4,), "bdf": (2, 5), "ndf": (2,)}
# Frequencies h omega that a step resolves, and the whole range up to those at which modes need only be damped [rad].
_RESOLVED, _HIGH = np.geomspace(0.1, 3.0, 120), np.geomspace(0.1, 1e4, 240)
# Range of damping ratio and period error shown, and largest spectral radius shown.
_SHOWN, _GROWN = (1e-6, 1.0), 1.5
# Largest number of curves in a panel.
_CURVES = 40


# Charts


@figure("wall time and number of steps against error", written_as="work_precision", columns=2, height=72.0,
        curves=_CURVES, missing=("no run reached its end", "see the reasons in `methods`"))  # fmt: skip
def work_precision(figures: Mapping[str, Any]) -> Iterator[Chart]:
    """Yield charts of wall time and accepted steps of every method over its error, on logarithmic axes.

    Runs with fixed steps and runs with error control form separate lines; the former have rings. Errors below the
    uncertainty of the reference are shaded; runs of zero error are left out.
    """
    members = defaultdict[str, Iterator[int]](count)
    curves: dict[str, list[Curve]] = {"wall_time": [], "steps": []}
    errors: list[float] = []
    for method in figures["methods"].values():
        own = Look(next(members[method["family"]]), _FAMILIES[method["family"]][0])
        done = [run for run in method["runs"] if run["status"] == "complete" and run["error"] > 0.0]
        for fixed in (False, True):
            runs = [run for run in done if (run["step"] is not None) == fixed]
            runs.sort(key=lambda run: -run["error"])
            name = f"{method['title']}, fixed steps" if fixed else method["title"]
            mark: Mark = "ring" if fixed else _FAMILIES[method["family"]][1]
            error = [run["error"] for run in runs]
            errors += error
            for key in curves if runs else ():
                curves[key].append(Curve(name, [run[key] for run in runs], error, own, mark=mark, line=True))
    if errors:
        below = figures["reference"]["uncertainty"]
        spans = [Span(0.0, below, "below the reference's own")] if min(errors) < below < max(errors) else []
        over = Axis("largest error of position", "m", log=True)
        yield Chart("wall_time", "", Axis("wall time", "s", log=True), curves["wall_time"], over, spans=spans)
        yield Chart("steps", "", Axis("accepted steps", log=True), curves["steps"], over, spans=spans)


@figure("damping ratio, period error and spectral radius of methods", takes="nothing", height=62.0, curves=_CURVES)
def numerical_damping(curves: Sequence[tuple[str, int | None]] | None = None) -> Iterator[Chart]:
    """Yield charts of damping ratio, period error and spectral radius over h omega.

    They are those of x'' = -omega^2 x and steps of size h. Damping ratio and period error are shown where the method is
    stable and their magnitude is not negligible.

    Parameters
    ----------
    curves : sequence of (str, int or None)
        Names of methods, each with an order if the method has several; by default all methods but IDA.
    """
    # Imported here because they import the kernels.
    from paraflex.integrators import METHODS
    from paraflex.integrators.spectra import spectrum

    members = defaultdict[str, Iterator[int]](count)
    found: dict[str, list[Curve]] = {"damping": [], "period": [], "radius": []}
    default = [(one, order) for one in METHODS if one != "ida" for order in _ORDERS.get(one, (None,))]
    for name, order in default if curves is None else curves:
        method = METHODS[name]
        own = Look(next(members[method.family.value]), _FAMILIES[method.family.value][0])
        label = method.title if not method.multistep else f"{method.title.split(' ')[0]} {order}"
        low, high = (spectrum(name, frequency, order=order) for frequency in (_RESOLVED, _HIGH))
        for key, values in (("damping", low.damping_ratio), ("period", np.abs(low.period_error))):
            seen = (low.radius < 1.0 + 1e-9) & (values > 0.1 * _SHOWN[0])
            found[key].append(Curve(label, np.where(seen, values, np.nan), low.frequency, own))
        found["radius"].append(Curve(label, np.where(high.radius < _GROWN, high.radius, np.nan), high.frequency, own))
    over, small = Axis("h ω", "rad", log=True), {"log": True, "low": _SHOWN[0], "high": _SHOWN[1]}
    yield Chart("damping", "Damping ratio", Axis("", **small), found["damping"], over)
    yield Chart("period", "Period error, as a fraction", Axis("", **small), found["period"], over)
    yield Chart("radius", "Spectral radius", Axis("", low=0.0, high=_GROWN), found["radius"], over, levels=[1.0])


# Tables


def tables(figures: Mapping[str, Any]) -> Iterator[Table]:
    """Yield tables of error and time of every run, of its work, and of the time to reach an error."""
    done = [(name, run) for name, method in figures["methods"].items() for run in method["runs"]
            if run["status"] == "complete"]  # fmt: skip
    uncertainty = figures["reference"]["uncertainty"] if figures["reference"] else 0.0

    def columns(*keys: tuple[str, str, str]) -> list[Column]:
        return [
            Column("method", [name for name, _ in done]),
            *(Column(head, [run[key] for _, run in done], unit, digits=3, least=uncertainty if key == "error" else 0.0)
              for head, key, unit in (("tolerance", "tolerance", "m"), ("step", "step", "s"), *keys)),
        ]  # fmt: skip

    yield Table("Error, time, violation of constraints, imbalance of energy", columns(
        ("error", "error", "m"), ("wall time", "wall_time", "s"), ("violation", "constraint_position_max", "m"),
        ("its rate", "constraint_velocity_max", "m/s"), ("energy", "energy_balance_max", "J"),
    )).filled()  # fmt: skip
    yield Table("Work", columns(
        ("steps", "steps", ""), ("rejected", "rejected", ""), ("Newton steps", "newton_iterations", ""),
        ("matrices factored", "factorisations", ""), ("evaluations", "evaluations", ""),
    )).filled()  # fmt: skip
    names = list(dict.fromkeys(name for name, _ in done))
    reached = [figures["methods"][name] for name in names]
    yield Table("Wall time to an error; the last column at 1e-5 m", [
        Column("method", names),
        *(Column(f"{number(float(level))} m", [one["time_to_reach"][level] for one in reached], "s", digits=3)
          for level in figures["fastest"]),
        Column("relative to the default", [one["relative_time"] for one in reached], digits=3),
    ])  # fmt: skip
