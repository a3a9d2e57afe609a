"""Which method and tolerance are right by default? Work and accuracy of our methods over the library and hard cases.

    python benchmarks/default_method.py [--only CASE ...] [--write]

Every library mechanism with its own study, in second-order geometry, pinned frames and separate curvature where it has
flexible beams; then what makes integration hard: dry friction, torques and loads that jump, singular positions on the
way. Each is run by the ESDIRK methods at three tolerances and compared with a converged run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import numpy as np
from common import command_line, markdown, single_thread, write_json

from paraflex import load
from paraflex.dynamics import build_system, consistent_state, start_state
from paraflex.errors import IntegrationError
from paraflex.fem import ReferenceCondition
from paraflex.files import Model
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import Curvature, FlexibleBeam, Geometry, JointFriction, Mechanism, PiecewiseProfile
from paraflex.studies import compare_methods, motion_case, tracking_case
from paraflex.studies.cases import Case
from paraflex.studies.compare import ComparisonOptions

METHODS = ("tr-bdf2", "esdirk3", "esdirk4", "esdirk5")
TOLERANCES = (1e-4, 1e-5, 1e-6)
KEPT = ("method", "tolerance", "status", "reason", "error", "wall_time", "steps", "newton_iterations")
TRACKED = ("raparm_i", "raparm_ii", "3rrr", "4rrr", "3prr", "five_bar", "slider_crank")
FREE = ("pendulum", "four_bar", "andrews", "slider_crank_flexible", "spin_up", "chain:20", "four_bars:2", "four_bars:7")


def right(mechanism: Mechanism) -> Mechanism:
    """In the geometry and frames that are the defaults."""
    if not any(isinstance(body, FlexibleBeam) and body.flexible for body in mechanism.bodies):
        return mechanism
    beams = [body for body in mechanism.bodies if isinstance(body, FlexibleBeam)]
    changed = [replace(beam, reference=ReferenceCondition.PINNED, curvature=Curvature.SEPARATE) for beam in beams]
    return mechanism.with_bodies(changed).with_geometry(Geometry.SECOND_ORDER)


def tracked(model: Model, mechanism: Mechanism, mode: str) -> Case:
    """A mode of the model's own study."""
    return tracking_case(model.plan(mechanism=mechanism, after="free"), mode)


def free(model: Model, mechanism: Mechanism) -> Case:
    """The model's own motion."""
    system, assembly = build_system(mechanism), mechanism.assembly(model.study.assembly)
    start = consistent_state(system, assembly) if model.start is None else start_state(system, model.start, assembly)
    return motion_case(
        mechanism, model.study.duration or 3.0, samples=model.study.samples, torques=model.study.torques, start=start
    )


def stepped(model: Model, mechanism: Mechanism) -> Case:
    """Constant torques from rest on."""
    system = build_system(mechanism)
    start = consistent_state(system, mechanism.assembly(model.study.assembly))
    torques = {mechanism.motors[0].name: 0.2, mechanism.motors[1].name: -0.1}
    return motion_case(mechanism, 0.3, samples=301, torques=torques, start=start)


@dataclass(frozen=True)
class Quadratic:
    """An angle of constant acceleration: angle and rate at a time [rad, rad/s, s], acceleration [rad/s^2]."""

    angle: float
    rate: float
    acceleration: float
    since: float
    knots: tuple[float, ...] = ()

    def evaluate(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Value, rate and acceleration at times t."""
        x = t - self.since
        angle = self.angle + x * (self.rate + 0.5 * self.acceleration * x)
        return angle, self.rate + self.acceleration * x, np.full_like(t, self.acceleration)


def jerked(mechanism: Mechanism) -> Mechanism:
    """Turned faster, evenly, slower and not at all, each for 4 s or more: the acceleration jumps."""
    pieces = Quadratic(0, 0, 0.5, 0), Quadratic(4, 2, 0, 4), Quadratic(12, 2, -0.5, 8), Quadratic(16, 0, 0, 12)
    spin = replace(mechanism.prescribed[0], profile=PiecewiseProfile(pieces, (4.0, 8.0, 12.0)))
    return replace(mechanism, prescribed=(spin,))


def cases() -> Iterator[tuple[str, Callable[[], Case]]]:
    """All of them by name."""
    for name in TRACKED:
        model = load(name)
        for mode in model.study.modes or [each.name for each in model.mechanism.modes]:
            yield f"{name} {mode}", lambda model=model, mode=mode: tracked(model, right(model.mechanism), mode)
    for name in FREE:
        model = load(name)
        yield name, lambda model=model: free(model, right(model.mechanism))
    five = load("five_bar")
    rubbing = replace(right(five.mechanism), frictions=(JointFriction("rub", "A1", limit=0.4, speed=0.3),))
    yield "five_bar with friction", lambda: tracked(five, rubbing, "++")
    yield "five_bar under steps of torque", lambda: stepped(five, right(five.mechanism))
    yield "spin_up in jerks", lambda: free(load("spin_up"), right(jerked(load("spin_up").mechanism)))
    sticking = replace(right(five.mechanism), frictions=(JointFriction("rub", "A1", limit=0.4, speed=0.01),))
    yield "five_bar with sharp friction", lambda: tracked(five, sticking, "++")


def measured(case: Case, limit: float) -> dict[str, Any]:
    """What every method took at every tolerance, and how far off it is."""
    comparison = compare_methods(
        case, METHODS, options=ComparisonOptions(tolerances=TOLERANCES, limit=limit, repetitions=2)
    )
    assert comparison.reference is not None
    return {
        "coordinates": comparison.coordinates,
        "uncertainty": comparison.reference.uncertainty,
        "runs": [{name: getattr(run, name) for name in KEPT} for run in comparison.measurements],
    }


def rows(found: dict[str, dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Of each method and tolerance: failures, error over tolerance, error and time against TR-BDF2 at 1e-4 m."""
    for method in METHODS:
        for tolerance in TOLERANCES:
            runs, base = [], []
            for result in found.values():
                runs += [r for r in result["runs"] if r["method"] == method and r["tolerance"] == tolerance]
                base += [r for r in result["runs"] if r["method"] == METHODS[0] and r["tolerance"] == TOLERANCES[0]]
            pairs = [(r, b) for r, b in zip(runs, base, strict=True) if r["status"] == b["status"] == "complete"]
            times = [r["wall_time"] / b["wall_time"] for r, b in pairs]
            yield {
                "method": method,
                "tolerance": tolerance,
                "failed": sum(r["status"] != "complete" for r in runs),
                "error": median(r["error"] / tolerance for r, _ in pairs),
                "largest_error": max(r["error"] / tolerance for r, _ in pairs),
                "error_ratio": median(r["error"] / b["error"] for r, b in pairs),
                "time": median(times),
                "largest_time": max(times),
            }


def summary(found: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """What the documentation shows: the rows, and the largest error over tolerance of each method with its case."""
    worst = {}
    for method in METHODS:
        runs = [(r, name) for name, case in found.items() for r in case["runs"] if r["method"] == method]
        run, case = max(runs, key=lambda pair: (pair[0]["error"] or 0.0) / pair[0]["tolerance"])
        worst[method] = {"case": case, "ratio": run["error"] / run["tolerance"]}
    lines, ours = list(rows(found)), IntegrationOptions(tolerance=1e-5)
    return {
        "number": len(found),
        "failed": sum(line["failed"] for line in lines),
        "worst": worst,
        "default": next(
            row for row in lines if (row["method"], row["tolerance"]) == (ours.method.name, ours.tolerance)
        ),
        "rows": lines,
    }


def main() -> None:
    """Run, print, write."""
    single_thread()
    parser = command_line(__doc__)
    parser.add_argument("--only", nargs="*", help="cases whose names begin so")
    parser.add_argument("--limit", type=float, default=30.0, help="seconds at which a run is given up")
    given = parser.parse_args()
    found: dict[str, dict[str, Any]] = {}
    for name, make in cases():
        if given.only and not name.startswith(tuple(given.only)):
            continue
        try:
            found[name] = measured(make(), given.limit)
        except IntegrationError as error:
            print(f"{name}: {error}")
            continue
        for run in found[name]["runs"]:
            figures = f"{run['error']:.1e} m, {run['wall_time']:.3f} s, {run['steps']} steps" if run["error"] else ""
            print(
                f"{name:28} {run['method']:8} {run['tolerance']:g}: {run['status']} {figures}{run['reason']}",
                flush=True,
            )
    shown = summary(found)
    lines = [
        [f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values()] for row in shown["rows"]
    ]
    print(markdown(list(shown["rows"][0]), lines))
    write_json("default_method", {**shown, "cases": found}, given.folder)


if __name__ == "__main__":
    main()
