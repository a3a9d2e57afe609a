"""Orders of our own methods on a stiff flexible mechanism with a loop, and where order is lost.

    python benchmarks/orders.py [--write] [FILE.png]

draws the figure in docs/integrators.md and measures its table. A four-bar of three steel strips is driven by a torque
that grows with the fourth power of time: nothing rings, the motion is as smooth as theory asks. With all coordinates
its frequencies reach 290,000 rad/s, with one mode a link 1,600.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import matplotlib.pyplot as plt
import numpy as np
from common import command_line, write_json
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from paraflex.dynamics import State, System, build_system, consistent_state
from paraflex.fem import ReferenceCondition
from paraflex.integrators import METHODS, IntegrationOptions, Method, Solution, integrate
from paraflex.kernel.packed import Signals
from paraflex.mechanism import (
    Assembly,
    Curvature,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    ModalDamping,
    Motor,
    PointRef,
    RevoluteJoint,
    Section,
)
from paraflex.plots.style import journal_style

END, TORQUE = 0.05, 3.0
QUANTITIES = ("positions", "velocities", "multipliers")
METHODS_SHOWN = ("newmark", "generalised-alpha", "tr-bdf2", "esdirk3", "esdirk4")
STEPS = (30, 45, 68, 100, 150, 225)
MODES = {"one mode a link, up to 1,600 rad/s": 1, "all modes, up to 290,000 rad/s": None}
# Errors below this part of what they are errors of are rounding, whose order means nothing.
ROUNDING = 1e-10


def four_bar(modes: int | None = None, geometry: Geometry = Geometry.LINEAR) -> Mechanism:
    """The mechanism, all modes of its links or so many, each damped by two fifths.

    So much that vibrations have died away where orders are measured, those of the trapezoidal rule too.
    """

    def link(name: str, length: float, a: str, b: str) -> FlexibleBeam:
        return FlexibleBeam(
            name, length, Section.rectangle(0.02, 0.003), Material(210e9, 7850.0), points={a: 0.0, b: length},
            elements=2, modes=modes, damping=ModalDamping((0.4,)),
            reference=ReferenceCondition.CANTILEVER, curvature=Curvature.SHARED,
        )  # fmt: skip

    ends = {"O": ("ground", "crank"), "A": ("crank", "coupler"), "B": ("coupler", "rocker"), "Q": ("ground", "rocker")}
    return Mechanism(
        name="four-bar",
        ground={"O": (0.0, 0.0), "Q": (0.4, 0.0)},
        bodies=(link("crank", 0.1, "O", "A"), link("coupler", 0.35, "A", "B"), link("rocker", 0.25, "Q", "B")),
        joints=tuple(RevoluteJoint(k, PointRef(a, k), PointRef(b, k)) for k, (a, b) in ends.items()),
        motors=(Motor("drive", "O"),),
        assemblies=(Assembly("open", {"crank": 1.0, "coupler": 0.4, "rocker": 1.6}),),
        geometry=geometry,
    )


@cache
def started(modes: int | None = None, geometry: Geometry = Geometry.LINEAR) -> tuple[System, State]:
    """The system at rest."""
    system = build_system(four_bar(modes, geometry))
    return system, consistent_state(system, system.mechanism.assembly())


def smooth_torque() -> Signals:
    """Of the crank, up to 1.5 N m."""
    pieces = np.zeros((2, 6))
    pieces[0, 4], pieces[0, 5] = TORQUE / END**4, -0.5 * TORQUE / END**5
    return Signals(np.array([0, 2]), np.array([0.0, END]), pieces)


def run(problem: tuple[System, State], method: Method | str, steps: int, **options) -> Solution:
    """So many even steps, solved to rounding."""
    chosen = IntegrationOptions(method=method, step=END / steps, tolerance=1e-3, newton_fraction=1e-10, **options)
    return integrate(problem[0], smooth_torque(), problem[1], np.array([END]), options=chosen)


@cache
def converged(modes: int | None = None) -> tuple[NDArray, NDArray, NDArray]:
    """Positions, velocities and multipliers at the end."""
    return _at_end(run(started(modes), "esdirk5", 4000))


def errors(method: Method | str, steps: Sequence[int], modes: int | None = None, **options) -> NDArray[np.float64]:
    """Largest errors at the end for each number of steps, in positions, velocities and multipliers: (steps, 3)."""
    found = [_at_end(run(started(modes), method, n, **options)) for n in steps]
    return np.array([[np.max(np.abs(a - b)) for a, b in zip(one, converged(modes), strict=True)] for one in found])


def orders(steps: Sequence[int], found: NDArray[np.float64]) -> NDArray[np.float64]:
    """Between each number of steps and the next."""
    return np.log(found[:-1] / found[1:]) / np.log(np.divide(steps[1:], steps[:-1]))[:, None]


def _at_end(solution: Solution) -> tuple[NDArray, NDArray, NDArray]:
    return solution.q[-1], solution.v[-1], solution.multipliers[-1]


def main() -> None:
    """Print the orders and draw the figure."""
    parser = command_line(__doc__)
    parser.add_argument("file", nargs="?", default="docs/images/orders.png")
    given = parser.parse_args()
    found = {label: {name: errors(name, STEPS, modes) for name in METHODS_SHOWN} for label, modes in MODES.items()}
    medians = {label: {name: typical(one, MODES[label]) for name, one in part.items()} for label, part in found.items()}
    for label, part in medians.items():
        for name, values in part.items():
            print(f"{label:36s} {name:18s}", *("rounding" if x is None else f"{x:.2f}" for x in values))
    with journal_style():
        draw(found).savefig(given.file, metadata={})
    write_json("orders", {"quantities": QUANTITIES, "orders": medians}, given.folder)


def typical(found: NDArray[np.float64], modes: int | None) -> list[float | None]:
    """Median order of each quantity; None where errors are rounding."""
    sizes = [np.max(np.abs(values)) for values in converged(modes)]
    rounding = np.median(found, axis=0) < ROUNDING * np.array(sizes)
    medians = np.median(orders(STEPS, found), axis=0)
    return [None if lost else float(order) for order, lost in zip(medians, rounding, strict=True)]


def draw(found: dict[str, dict[str, NDArray[np.float64]]]) -> Figure:
    """Errors over the step."""
    figure, axes = plt.subplots(2, 3, figsize=(7.2, 5.2), sharex=True, layout="constrained")
    markers: dict[str, str] = dict(zip(METHODS_SHOWN, "vso^D", strict=True))
    for line, (label, part) in zip(axes, found.items(), strict=True):
        for method, of_method in part.items():
            for ax, values in zip(line, of_method.T, strict=True):
                ax.loglog(END / np.array(STEPS), values, marker=markers[method], label=METHODS[method].title)
        for ax, name in zip(line, QUANTITIES, strict=True):
            ax.set_title(f"{name}, {label.partition(', ')[0]}")
            ax.set_xticks([2e-4, 5e-4, 1e-3], ["0.2", "0.5", "1"])
            ax.xaxis.set_minor_formatter(NullFormatter())
    for line in axes:
        for ax, unit in zip(line, ("m, rad", "m/s, rad/s", "N"), strict=True):
            ax.set_ylabel(f"largest error ({unit})")
    for ax in axes[1]:
        ax.set_xlabel("step (ms)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=len(METHODS_SHOWN))
    return figure


if __name__ == "__main__":
    main()
