"""How good are runs with few flexible coordinates, and how much faster? RAParM-I on its square, in six modes.

    python benchmarks/reduced_runs.py [--write]

Second-order geometry, pinned frames, tolerance 1e-6. For several numbers of coordinates: the tracking error against
the full run's, the largest distance of the end-effector from its place there, and the time over the full run's, the
least of several runs each, taken in turns.

Then every mechanism of the library along up to two of its paths, with as few coordinates as the model's tolerance
allows: their number, the estimated deviation and the largest distance over the tolerance (runs at a tenth of it), and
the time over the full run's at that tolerance.
"""

from __future__ import annotations

import numpy as np
from common import command_line, least_time, single_thread, table, write_json

import paraflex as pf
from paraflex.tracking import TrackingTask

COUNTS, REPEATS = (6, 12, 16, 20), 3
MODES = ("+-+-", "-+-+", "+--+", "+++-", "++-+", "++++")
OPTIONS = pf.IntegrationOptions(tolerance=1e-6)


def main() -> None:
    single_thread()
    given = command_line(__doc__).parse_args()
    robot = pf.load("raparm_i")
    arm = robot.mechanism.with_geometry("second-order").with_beams(reference="pinned", curvature="separate")
    task = pf.plan(arm, robot.paths["square"], duration=0.7)
    rows = []
    for count in COUNTS:
        choosing = least_time(lambda count=count: pf.reduced_mechanism(task, count, modes=MODES), REPEATS)
        few = task.remodelled(pf.reduced_mechanism(task, count, modes=MODES))
        rows.append({"coordinates": count, "choosing": choosing, "modes": {m: beside(few, task, m) for m in MODES}})
    heads = ["coordinates", *MODES]
    print(table(heads, [[str(row["coordinates"]), *map(words, row["modes"].values())] for row in rows]))
    automatic = {f"{name} {path}": library(name, path) for name, path in flexible_paths()}
    heads = ["path", "coordinates", "of", "modes", "estimate", "distance", "time"]
    print(table(heads, [[key, *summary_words(modes)] for key, modes in automatic.items()]))
    largest = max((one["distance"], key, mode) for key, modes in automatic.items() for mode, one in modes.items())
    found = {
        "rows": {str(row["coordinates"]): row for row in rows},
        "automatic": {key.replace(" ", "_"): summarised(modes) | {"modes": modes} for key, modes in automatic.items()},
        "largest": dict(zip(("distance", "path", "mode"), largest, strict=True)),
    }
    write_json("reduced_runs", found, given.folder)


def flexible_paths() -> list[tuple[str, str]]:
    models = {name: pf.load(name) for name in pf.library.names()}
    return [
        (name, path)
        for name, model in models.items()
        if any(isinstance(body, pf.FlexibleBeam) for body in model.mechanism.bodies)
        for path in list(model.paths)[:2]
    ]


def library(name: str, path: str) -> dict[str, dict[str, float]]:
    """Numbers of every mode along a path: coordinates kept and in all, estimate and distance [tolerances], time."""
    model, found = pf.load(name), {}
    task = pf.plan(model.mechanism.with_geometry("second-order"), model.paths[path], duration=model.study.duration)
    tolerance = model.study.integration().tolerance_for(task.system)
    fine = pf.IntegrationOptions(method="esdirk5", tolerance=tolerance / 10.0)
    for mode in task.mechanism.modes or [task.mode("".join("+" for _ in task.mechanism.motors))]:
        chosen = pf.planned_reduction(task, tolerance, modes=[mode])
        few = task.remodelled(chosen.mechanism)
        places = [
            pf.tracking_dataset([one.simulate(mode, options=fine, warning=False)])["end_effector"].values
            for one in (few, task)
        ]
        seconds = [
            min(one.simulate(mode, warning=False).solution.wall_time for _ in range(REPEATS)) for one in (few, task)
        ]
        found[mode.name] = {
            "kept": few.system.n_flexible, "all": task.system.n_flexible, "estimate": chosen.deviation / tolerance,
            "distance": float(np.nanmax(np.linalg.norm(places[0] - places[1], axis=-1))) / tolerance,
            "time": seconds[0] / seconds[1],
        }  # fmt: skip
    return found


def summarised(modes: dict[str, dict[str, float]]) -> dict[str, float]:
    columns = {name: [one[name] for one in modes.values()] for name in ("kept", "all", "estimate", "distance", "time")}
    return {
        "fewest": min(columns["kept"]), "most": max(columns["kept"]), "all": columns["all"][0], "count": len(modes),
        "estimate": max(columns["estimate"]), "distance": max(columns["distance"]),
        "time": float(np.median(columns["time"])),
    }  # fmt: skip


def summary_words(modes: dict[str, dict[str, float]]) -> list[str]:
    one = summarised(modes)
    words = [f"{one['fewest']} to {one['most']}", str(one["all"]), str(one["count"])]
    return [*words, *(f"{one[name]:.2f}" for name in ("estimate", "distance", "time"))]


def beside(few: TrackingTask, full: TrackingTask, mode: str) -> dict[str, float]:
    """Tracking error off the full one [m], largest distance over that error, time over the full run's."""
    runs = [[task.simulate(mode, options=OPTIONS, warning=False) for task in (few, full)] for _ in range(REPEATS)]
    seconds = [min(run.solution.wall_time for run in of_one) for of_one in zip(*runs, strict=True)]
    (error, places), (exact, exactly) = (
        (data["tracking_rms"].item(), data["end_effector"].values[0])
        for data in (pf.tracking_dataset([run]) for run in runs[0])
    )
    distance = np.max(np.linalg.norm(places - exactly, axis=1))
    return {
        "off": error - exact, "size": abs(error - exact), "distance": distance / exact, "time": seconds[0] / seconds[1]
    }  # fmt: skip


def words(one: dict[str, float]) -> str:
    return f"{one['off']:+.1e} m, {one['distance']:.1%}, {one['time']:.2f}"


if __name__ == "__main__":
    main()
