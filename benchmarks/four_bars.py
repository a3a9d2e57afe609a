"""Rows of n four-bars, rigid and flexible: time per n of paraflex, Exudyn and MuJoCo, each close to its own path.

    python benchmarks/four_bars.py [--target METRES] [--limit S] [--repeats N] [--write] [n ...]

The row of the IFToMM library (benchmark A02), cranks upright and B0 moving at 1 m/s; 0.3 s of it, before the first
position with all links in line. Flexible links are beams of the same mass with two elements each. Compared is the place
of B0, whose deviation from the path with much finer steps is at most the target; each engine is timed with the coarsest
steps that are that close, as in `peers.py`. An engine that takes longer than the limit for an n is not asked for larger
ones. MuJoCo has no flexible links but by segments, and runs the rigid row only. The last line is the growth exponent p
of time = c n^p over the larger half of the n. How one step of paraflex grows up to n = 1000 is in `scaling.py`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from common import command_line, growth, single_thread, table, write_json
from engines import ExudynSetting, MuJoCoSetting, Problem, Run, run_exudyn, run_mujoco
from peers import Choice, Converged, Result, Tolerance, choose, timed

from paraflex.compilation import compile_kernels_for
from paraflex.dynamics import build_system, constant_signals, pack_signals, start_state
from paraflex.dynamics.points import point_motion
from paraflex.integrators import IntegrationOptions, integrate
from paraflex.mechanism import (
    FlexibleBeam,
    Material,
    Mechanism,
    PointRef,
    RigidBody,
    Section,
    Start,
    four_bars_in_a_row,
)

NUMBERS, TARGET, LIMIT, REPEATS = (1, 2, 5, 10, 20, 50), 1e-5, 20.0, 3
DURATION, SAMPLES = 0.3, 31
MOVING = Start(angular={"crank0": -1.0})
# A solid bar of 1 kg and 1 m that bends by some millimetres here.
SECTION, MATERIAL = Section.rectangle(0.05, 0.01), Material(2e9, 2000.0)
TOLERANCES = tuple(1e-2 * 10.0 ** (-k / 10.0) for k in range(46))
# Steps a sample of the others, and those that they are converged with.
COUNTS, FINE = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 22, 27, 33, 40, 50, 65, 80, 100, 130, 160, 200, 260, 320), 800


def row(n: int, *, flexible: bool) -> Mechanism:
    """The mechanism."""
    rigid = four_bars_in_a_row(n)
    if not flexible:
        return rigid
    return replace(rigid, bodies=tuple(map(_beam, rigid.bodies)))


def _beam(rod: Any) -> FlexibleBeam:
    assert isinstance(rod, RigidBody)
    points = {name: float(place[0]) for name, place in rod.points.items()}
    return FlexibleBeam(rod.name, 1.0, SECTION, MATERIAL, points=points, elements=2)


def problem_of(mechanism: Mechanism) -> Problem:
    """Its motion without motors."""
    system = build_system(mechanism)
    start = start_state(system, MOVING, mechanism.assembly())
    times = np.linspace(0.0, DURATION, SAMPLES)
    return Problem(mechanism, system, start, times, PointRef("crank0", "B"), lambda t: np.zeros((t.size, 0)))


def run_ours(problem: Problem, setting: Tolerance) -> Run:
    """By one of our methods."""
    signals, _ = pack_signals(problem.mechanism, constant_signals([], DURATION), DURATION)
    options = IntegrationOptions(method=setting.method, tolerance=setting.tolerance)
    solution = integrate(problem.system, signals, problem.start, problem.times, options=options)
    path = point_motion(problem.system, problem.point, solution.q, solution.v, solution.a).position
    return Run(path, solution.wall_time, 0.0, steps=solution.steps)


@dataclass(frozen=True)
class Engine:
    """One that is compared: its settings from coarse to fine, and the one it is converged with."""

    name: str
    run: Callable[[Problem, Any], Run]
    settings: Sequence[Any]
    fine: Any


def engines(*, flexible: bool) -> list[Engine]:
    """All that can run the row."""
    ours = [
        Engine(f"paraflex {method}", run_ours, [Tolerance(method, x) for x in TOLERANCES], Tolerance("esdirk5", 1e-7))
        for method in ("tr-bdf2", "esdirk5")
    ]
    exudyn = Engine("Exudyn", run_exudyn, [ExudynSetting(k, 0.9) for k in COUNTS], ExudynSetting(FINE, 0.9))
    mujoco = Engine("MuJoCo", run_mujoco, [MuJoCoSetting(k) for k in COUNTS], MuJoCoSetting(FINE))
    return [*ours, exudyn] if flexible else [*ours, exudyn, mujoco]


def choice_of(engine: Engine, problem: Problem, target: float) -> Choice:
    """The setting that is close enough."""

    def run(setting: Any) -> Run:
        return engine.run(problem, setting)

    fine = run(engine.fine)
    return choose(engine.name, engine.settings, run, Converged(str(engine.fine), fine.path, 0.0), target)


def compare(*, flexible: bool, given: argparse.Namespace) -> list[dict[str, Any]]:
    """Times of all engines for every n, as they come."""
    rows, slow = [], set[str]()
    for n in given.n:
        problem = problem_of(row(n, flexible=flexible))
        choices = []
        for engine in engines(flexible=flexible):
            if engine.name in slow:
                continue
            choice = choice_of(engine, problem, given.target)
            choices.append(choice)
            if choice.trial is None or choice.trial.seconds > given.limit:
                slow.add(engine.name)
        results = {result.name: result for result in timed(choices, given.repeats)}
        rows.append({"n": n, "coordinates": problem.system.n, "rows": problem.system.m, "results": results})
        said = ", ".join(f"{name} {result.seconds:.4f} s" for name, result in results.items())
        print(f"{'flexible' if flexible else 'rigid'} n = {n}: {said or 'nothing close enough'}", flush=True)
    return rows


def exponents(rows: Sequence[dict[str, Any]], names: Sequence[str]) -> dict[str, float]:
    """Growth exponents over the larger half of the n of every engine."""
    out = {}
    for name in names:
        points = [(entry["n"], entry["results"][name].seconds) for entry in rows if name in entry["results"]]
        points = points[len(points) // 2 - 1 :] if len(points) > 3 else points
        if len(points) > 1:
            out[name] = growth(*zip(*points, strict=True))[1]
    return out


def print_rows(rows: Sequence[dict[str, Any]], names: Sequence[str], grown: dict[str, float]) -> None:
    """The table."""

    def cell(result: Result | None) -> str:
        return "" if result is None else f"{result.seconds:.4f} ({result.deviation:.0e} m)"

    lines = [
        [str(entry["n"]), str(entry["coordinates"]), *(cell(entry["results"].get(name)) for name in names)]
        for entry in rows
    ]
    lines.append(["growth", "", *(f"{grown[name]:.2f}" if name in grown else "" for name in names)])
    print(table(["n", "coordinates", *(f"{name} [s]" for name in names)], lines))


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("n", type=int, nargs="*", default=list(NUMBERS))
    parser.add_argument("--target", type=float, default=TARGET, help="deviation from the converged path [m]")
    parser.add_argument("--limit", type=float, default=LIMIT, help="of a run [s]")
    parser.add_argument("--repeats", type=int, default=REPEATS)
    given = parser.parse_args()
    single_thread()
    setattr(sys, "exudynFast", True)  # noqa: B010
    values: dict[str, Any] = {"target": given.target, "duration": DURATION}
    for flexible in (False, True):
        compile_kernels_for(row(1, flexible=flexible))
        names = [engine.name for engine in engines(flexible=flexible)]
        rows = compare(flexible=flexible, given=given)
        grown = exponents(rows, names)
        print_rows(rows, names, grown)
        values["flexible" if flexible else "rigid"] = {
            "growth": grown,
            "rows": [
                {**entry, "results": {name: _told(result) for name, result in entry["results"].items()}}
                for entry in rows
            ],
        }
    write_json("four_bars", values, given.folder)


def _told(result: Result) -> dict[str, Any]:
    return {key: value for key, value in asdict(result).items() if key != "tried"}


if __name__ == "__main__":
    main()
