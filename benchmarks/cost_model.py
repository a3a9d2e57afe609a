"""What does a run cost, and a million? Measures, fits and extrapolates; writes the tables of docs/cost-model.md.

    python benchmarks/cost_model.py [--quick] [--designs 5000] [--write]

Measured are the time of a Newton iteration over bodies, loops and modes, and the number of iterations over tolerance
and duration; each is fitted by a formula whose worst misfit is stated. A study of a million runs of RAParM-I is
extrapolated from some designs of a sweep, and from how much slower they get while all processors of this machine do the
same; a sweep of some thousand is predicted in the same way, and measured. With --write the part of docs/cost-model.md
between its two marks is replaced. Takes twenty minutes.
"""

from __future__ import annotations

import multiprocessing
import os
import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import iteration
import numpy as np
from common import command_line, conditions, growth, markdown, single_thread, write_json, write_page
from numpy.typing import NDArray
from scaling import MOVING, fastest
from sweeps import study_of, swept

import paraflex as pf
from paraflex.compilation import compile_kernels
from paraflex.designs.run import Task, run_task
from paraflex.dynamics import build_system, start_state
from paraflex.integrators import IntegrationOptions, Solution
from paraflex.mechanism import Geometry, Start, chain_of_segments, four_bars_in_a_row, loops
from paraflex.tracking import TrackingTask

MODE, METHOD, TOLERANCE = "++++", "tr-bdf2", 1e-4
PAGE = Path(__file__).parents[1] / "docs" / "cost-model.md"
ROWS, CHAINS, MODES = (2, 5, 10, 20, 50, 100), (5, 10, 20, 50, 100, 200), (1, 2, 3, 4, None)
TOLERANCES, DURATIONS = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5), (0.2, 0.35, 0.7, 1.4)
STUDY, CORES = 1_000_000, (1, 128, 1024, 10_240)
REPEATS = 3
DESIGNS = """
mechanism = "raparm_i"
set = {{geometry = "{geometry}"}}
paths = ["square"]
modes = ["{mode}"]
[sampling]
kind = "sobol"
number = {designs}
[integration]
method = "{method}"
tolerance = {tolerance}
[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.0050
high = 0.0051
"""


@dataclass(frozen=True)
class Fit:
    """A formula through measurements.

    Attributes
    ----------
    formula : str
        With its numbers.
    coefficients : tuple of float
    misfit : float
        Largest relative difference from a measurement.
    """

    formula: str
    coefficients: tuple[float, ...]
    misfit: float


def linear_fit(columns: Sequence[Sequence[float]], values: Sequence[float], words: str) -> Fit:
    """Values as a sum of columns with coefficients that are not negative, relative errors least.

    Parameters
    ----------
    words : str
        The formula with a place for each coefficient.
    """
    import scipy.optimize

    measured = np.asarray(values, dtype=float)
    matrix = np.column_stack([np.asarray(column, dtype=float) for column in columns])
    found, _ = scipy.optimize.nnls(matrix / measured[:, None], np.ones(measured.size))
    misfit = float(np.max(np.abs(matrix @ found / measured - 1.0)))
    return Fit(words.format(*(f"{x:.3g}" for x in found)), tuple(found.tolist()), misfit)


def power_fit(sizes: Sequence[float], values: Sequence[float], words: str) -> Fit:
    """Values as c sizes^p."""
    factor, exponent = growth(sizes, values)
    misfit = float(np.max(np.abs(factor * np.asarray(sizes) ** exponent / np.asarray(values) - 1.0)))
    return Fit(words.format(f"{factor:.3g}", f"{exponent:.2f}"), (factor, exponent), misfit)


# --- Measurements --------------------------------------------------------------------------------------------------


def over_bodies(rows: Sequence[int], chains: Sequence[int]) -> list[dict[str, Any]]:
    """Microseconds an iteration of rigid rows of four-bars, a loop to two bodies, and of chains without loops."""
    out = []
    for make, numbers, start in ((four_bars_in_a_row, rows, MOVING), (chain_of_segments, chains, Start())):
        for n in numbers:
            mechanism = make(n)
            system = build_system(mechanism)
            state = start_state(system, start, mechanism.assembly())
            _, seconds, _ = fastest(system, state)
            counts = {"bodies": len(mechanism.bodies), "loops": len(loops(mechanism)), "rows": system.m}
            out.append({"mechanism": mechanism.name, **counts, "microseconds": 1e6 * seconds})
    return out


def plan(duration: float = 0.7) -> TrackingTask:
    """The study of RAParM-I, a sample each millisecond."""
    model = pf.load("raparm_i")
    return pf.plan(model.mechanism, model.path("square"), duration=duration, samples=round(1e3 * duration) + 1)


def quickest(task: TrackingTask, **options: Any) -> Solution:
    """The fastest of a few runs."""
    runs = [task.simulate(MODE, options=IntegrationOptions(**options)).solution for _ in range(REPEATS)]
    return min(runs, key=lambda one: one.wall_time)


def over_modes(task: TrackingTask, modes: Sequence[int | None]) -> list[dict[str, Any]]:
    """Microseconds an iteration of RAParM-I with so many modes a link, or all, in both geometries."""
    out = []
    for geometry in Geometry:
        for count in modes:
            mechanism = task.mechanism.with_beams(modes=count).with_geometry(geometry)
            changed = task.remodelled(mechanism)
            solution = quickest(changed, method=METHOD, tolerance=TOLERANCE)
            sizes = [body.nf for body in changed.system.bodies]
            out.append(
                {
                    "geometry": geometry.value, "modes": "all" if count is None else count, "bodies": len(sizes),
                    "flexible": sum(sizes), "squares": sum(n * n for n in sizes), "seconds": solution.wall_time,
                    "iterations": solution.newton_iterations,
                    "microseconds": 1e6 * solution.wall_time / solution.newton_iterations,
                }
            )  # fmt: skip
    return out


def over_tolerances(task: TrackingTask, tolerances: Sequence[float]) -> list[dict[str, Any]]:
    """Iterations and seconds of a run by the method of the study and by the default one."""
    return [_work(task, method, tolerance) for method in (METHOD, "esdirk5") for tolerance in tolerances]


def over_durations(durations: Sequence[float]) -> list[dict[str, Any]]:
    """The same over duration; the square takes 0.53 s, the end-effector then rests and vibrates."""
    return [_work(plan(duration), METHOD, TOLERANCE) for duration in durations]


def _work(task: TrackingTask, method: str, tolerance: float) -> dict[str, Any]:
    solution = quickest(task, method=method, tolerance=tolerance)
    return {
        "method": method, "tolerance": tolerance, "duration": float(task.motion.t[-1]), "steps": solution.steps,
        "iterations": solution.newton_iterations, "seconds": solution.wall_time,
    }  # fmt: skip


def _text(geometry: str, designs: int) -> str:
    """A sweep of RAParM-I whose designs differ in the thickness of the links, each planned and run in one mode."""
    return DESIGNS.format(geometry=geometry, mode=MODE, designs=designs, method=METHOD, tolerance=TOLERANCE)


def _many(geometry: str, count: int) -> float:
    """Seconds each, of so many designs of a sweep one after the other."""
    study = study_of(_text(geometry, count + 1))
    tasks = [Task(k, k, tuple(row.tolist()), "square") for k, row in enumerate(study.designs)]
    run_task(study.setting, tasks[0])
    began = time.perf_counter()
    for task in tasks[1:]:
        run_task(study.setting, task)
    return (time.perf_counter() - began) / count


def study(count: int, designs: int) -> list[dict[str, Any]]:
    """What a design costs alone, and while every processor of this machine computes one; and a sweep of many."""
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    out = []
    context = multiprocessing.get_context("spawn")
    for geometry in Geometry:
        with context.Pool(processors) as pool:
            alone = min(pool.apply(_many, (geometry.value, count)) for _ in range(REPEATS))
            together = min(
                statistics.mean(pool.starmap(_many, [(geometry.value, count)] * processors, chunksize=1))
                for _ in range(REPEATS)
            )
        out.append(
            {
                "geometry": geometry.value, "alone": alone, "together": together, "processors": processors,
                "designs": designs, "predicted": together * designs / processors,
                "swept": swept(_text(geometry.value, designs), "processes", processors).seconds if designs else None,
            }
        )  # fmt: skip
    return out


def hours(design: dict[str, Any], cores: int, runs: int = STUDY) -> float:
    """Of a study on so many cores as busy as this machine's were, shared evenly."""
    seconds = design["alone"] if cores == 1 else design["together"]
    return np.ceil(runs / cores) * seconds / 3600.0


# --- Fits and tables -----------------------------------------------------------------------------------------------


def fits(found: dict[str, Any]) -> dict[str, Fit]:
    """All formulas, by what they are of."""
    bodies, out = found["bodies"], {}
    columns = [_column(bodies, "bodies"), _column(bodies, "loops")]
    words = "{} µs + {} µs × bodies + {} µs × loops"
    out["bodies and loops"] = linear_fit(
        [np.ones(len(bodies)).tolist(), *map(list, columns)], list(_column(bodies, "microseconds")), words
    )
    for geometry in Geometry:
        rows = [row for row in found["modes"] if row["geometry"] == geometry.value]
        words = "{} µs + {} µs × flexible coordinates + {} µs × sum of their squares, body by body"
        out[f"modes, {geometry.value}"] = linear_fit(
            [[1.0] * len(rows), list(_column(rows, "flexible")), list(_column(rows, "squares"))],
            list(_column(rows, "microseconds")),
            words,
        )
    for method in dict.fromkeys(row["method"] for row in found["tolerances"]):
        rows = [row for row in found["tolerances"] if row["method"] == method]
        relative = list(_column(rows, "tolerance") / TOLERANCE)
        words = f"{{}} iterations × (tolerance / {TOLERANCE:g} m)^{{}}"
        out[f"tolerance, {method}"] = power_fit(relative, list(_column(rows, "iterations")), words)
    rows = found["durations"]
    out["duration"] = power_fit(
        list(_column(rows, "duration")), list(_column(rows, "iterations")), "{} iterations × (duration / 1 s)^{}"
    )
    return out


def _column(rows: Sequence[dict[str, Any]], name: str) -> NDArray[np.float64]:
    return np.array([row[name] for row in rows], dtype=float)


def tables(found: dict[str, Any], fitted: dict[str, Fit], here: dict[str, Any]) -> str:
    """The measured part of the page."""
    machine, load = here["machine"], "unknown" if here["load"] is None else f"{here['load'][0]:.1f}"
    parts = [
        f"`{here['command']}`, {here['date']}: {machine['processor']}, {machine['processors']} processors, "
        f"load {load}, Numba {here['versions']['numba']}."
    ]
    for geometry, values in found["parts"].items():
        parts += [f"### Where time goes: RAParM-I, {geometry} geometry", _shares(values)]
    rows = [[name, fit.formula, f"{fit.misfit:.0%}"] for name, fit in fitted.items()]
    parts += ["### How it grows", markdown(["over", "formula", "worst misfit"], rows)]
    parts += ["### A million designs", _study_table(found["study"])]
    if found["study"][0]["designs"]:
        parts += ["### A sweep, predicted and measured", _swept_table(found["study"])]
    rows = [
        [row["mechanism"], str(row["bodies"]), str(row["loops"]), f"{row['microseconds']:.1f}"]
        for row in found["bodies"]
    ]
    parts += ["### Measured: bodies and loops", markdown(["rigid", "bodies", "loops", "µs an iteration"], rows)]
    rows = [
        [row["geometry"], *(str(row[key]) for key in ("modes", "flexible")), f"{row['microseconds']:.1f}",
         f"{row['seconds']:.3f}"]
        for row in found["modes"]
    ]  # fmt: skip
    headings = ["geometry", "modes a link", "flexible coordinates", "µs an iteration", "run [s]"]
    parts += ["### Measured: modes of RAParM-I", markdown(headings, rows)]
    rows = [
        [row["method"], f"{row['tolerance']:.0e}", f"{row['duration']:g}", str(row["steps"]), str(row["iterations"]),
         f"{row['seconds']:.3f}"]
        for row in [*found["tolerances"], *found["durations"]]
    ]  # fmt: skip
    headings = ["method", "tolerance [m]", "duration [s]", "steps", "iterations", "run [s]"]
    return "\n\n".join([*parts, "### Measured: tolerance and duration of RAParM-I", markdown(headings, rows)])


def _shares(values: dict[str, Any]) -> str:
    whole = values["microseconds_per_iteration"]
    rows = [
        [part["name"], f"{part['microseconds']:.2f}", f"{part['calls']:.2f}",
         f"{part['microseconds'] * part['calls'] / whole:.0%}"]
        for part in values["parts"]
    ]  # fmt: skip
    rows.append(["starting guesses, sampling, all else", "", "", f"{values['rest'] / whole:.0%}"])
    rows.append([f"a run of {values['iterations']} iterations, over their number", f"{whole:.2f}", "1", "100%"])
    return markdown(["part", "µs a call", "calls an iteration", "share"], rows)


def _study_table(designs: Sequence[dict[str, Any]]) -> str:
    rows = [
        [row["geometry"], *(f"{row[key]:.3f}" for key in ("alone", "together")),
         *(f"{hours(row, cores):.3g}" for cores in CORES)]
        for row in designs
    ]  # fmt: skip
    busy = f"while {designs[0]['processors']} compute one [s]"
    cores = [f"on {count:,} core{'s' if count > 1 else ''} [h]" for count in CORES]
    return markdown(["geometry", "design alone [s]", busy, *cores], rows)


def _swept_table(designs: Sequence[dict[str, Any]]) -> str:
    rows = [
        [row["geometry"], f"{row['designs']:,}", f"{row['predicted']:.0f}", f"{row['swept']:.0f}",
         f"{row['predicted'] / row['swept'] - 1.0:+.0%}"]
        for row in designs
    ]  # fmt: skip
    return markdown(["geometry", "designs", "predicted [s]", "measured [s]", "difference"], rows)


def measure(designs: int, *, quick: bool) -> dict[str, Any]:
    """Everything, with a sweep of so many designs; quickly with fewer and smaller cases."""
    task = plan()
    found: dict[str, Any] = {
        "bodies": over_bodies(ROWS[:4] if quick else ROWS, CHAINS[:4] if quick else CHAINS),
        "modes": over_modes(task, MODES),
        "tolerances": over_tolerances(task, TOLERANCES[:3] if quick else TOLERANCES),
        "durations": over_durations(DURATIONS[:3] if quick else DURATIONS),
        "parts": {},
    }
    for geometry in Geometry:
        found["parts"][geometry.value] = iteration.report(geometry, iteration.TOLERANCE, REPEATS)
    found["study"] = study(2 if quick else 10, designs)
    return found


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer and smaller cases")
    parser.add_argument("--designs", type=int, default=5000, help="of the sweep of each geometry; 0 for none")
    given = parser.parse_args()
    single_thread()
    for geometry in Geometry:
        compile_kernels(geometry)
    found = measure(given.designs, quick=given.quick)
    fitted = fits(found)
    text = tables(found, fitted, conditions())
    print(text)
    if given.folder:
        write_page(text, PAGE)
    write_json("cost_model", {**found, "fits": {name: asdict(fit) for name, fit in fitted.items()}}, given.folder)


if __name__ == "__main__":
    main()
