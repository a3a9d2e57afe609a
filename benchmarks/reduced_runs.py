"""How good are runs with few flexible coordinates, and how much faster? RAParM-I on its square, in six modes.

    python benchmarks/reduced_runs.py [--write]

Second-order geometry, pinned frames, tolerance 1e-6. For several numbers of coordinates: the tracking error against
the full run's, the largest distance of the end-effector from its place there, and the time over the full run's, the
least of several runs each, taken in turns.
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
    write_json("reduced_runs", {"rows": {str(row["coordinates"]): row for row in rows}}, given.folder)


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
