"""Do the models agree? RAParM-I on its square: both geometries, two reference conditions, exact beams, segments, KED.

    python benchmarks/model_agreement.py [--mode SIGNS ...] [--write]

All models have the same torques and start. "linear, cantilever" is the paper's (shared curvature); the other three of
ours have separate curvature. Exact beams are ANCF cables in Exudyn, with four times the elements of the paper's mesh
and steps of 12.5 us; segments are the paper's virtual prototype, by our kernels and by MuJoCo; KED is
kineto-elastodynamics. Each is run again with a finer step and a finer mesh (Exudyn: coarser ones); how far that moves
the end-effector shows how converged it is. Written are tracking errors during the motion and over the whole run.
Takes a quarter of an hour, most of it Exudyn's.
"""

from __future__ import annotations

from typing import Any

from common import command_line, table, write_json
from engines import distance
from models import LINEAR_PINNED, PAPER, SECOND_ORDER, SECOND_ORDER_CANTILEVER, BeamModel, tracking_errors

import paraflex as pf
from paraflex.engines.exudyn import ExudynOptions, simulate_exudyn
from paraflex.studies import verify
from paraflex.studies.agreement import Refinement
from paraflex.studies.verification import VerificationOptions
from paraflex.tracking import TrackingTask

MODES = ("+-+-", "-+-+", "+--+", "+++-", "++-+", "++++")
BEAMS = (PAPER, LINEAR_PINNED, SECOND_ORDER_CANTILEVER, SECOND_ORDER)
OPTIONS = VerificationOptions(tolerance=5e-6, method="esdirk5")
# Exudyn's, fine to coarse: the second has twice the step of the first, the third half the mesh of the second.
EXUDYN = (ExudynOptions(1.25e-5, 4), ExudynOptions(2.5e-5, 4), ExudynOptions(2.5e-5, 2))

Row = dict[str, Any]


def verified(task: TrackingTask, mode: str, models: dict[str, str]) -> tuple[dict[str, Row], dict[str, Any]]:
    """Rows of models by their names of ours, and the figures of `paraflex verify`.

    Parameters
    ----------
    models : mapping
        Names in `verify` to names in the tables.
    """
    found = verify(task, [mode], models=tuple(models), options=OPTIONS)
    figures, rows = found.to_dict()["modes"][mode], {}
    for name, title in models.items():
        base = found.runs[mode][name].records[Refinement.NONE]
        changes = {
            "step": figures["models"][name]["change_with_finer_step"],
            "mesh": figures["models"][name]["change_with_finer_mesh"],
        }
        rows[title] = {**tracking_errors(base, task.path.duration), "changes": changes}
    return rows, figures


def of_beams(task: TrackingTask, mode: str, model: BeamModel) -> dict[str, Row]:
    """One of our models of beams."""
    rows, _ = verified(model.task(task), mode, {model.geometry.value: model.name})
    return rows


def of_exudyn(task: TrackingTask, mode: str) -> Row:
    """The finest of the three runs, and how far apart they are."""
    fine, coarse_step, coarse_mesh = (simulate_exudyn(task, mode, options) for options in EXUDYN)
    paths = [run.end_effector.position for run in (fine, coarse_step, coarse_mesh)]
    changes = {"step": distance(paths[0], paths[1]), "mesh": distance(paths[1], paths[2])}
    return {**tracking_errors(fine, task.path.duration), "changes": changes}


def of_mode(task: TrackingTask, mode: str) -> dict[str, Any]:
    """All models in one mode; `segments_apart` is the largest distance between our segments and MuJoCo's [m]."""
    models: dict[str, Row] = {}
    for model in BEAMS:
        models |= of_beams(task, mode, model)
        print(f"{mode} {model.name}", flush=True)
    names = {"segments": "56 segments", "mujoco": "56 segments, MuJoCo", "ked": "KED"}
    others, figures = verified(PAPER.task(task), mode, names)
    models |= {"exact beams": of_exudyn(task, mode), **others}
    print(f"{mode} exact beams, segments, KED", flush=True)
    return {"mode": mode, "segments_apart": figures["distances"]["segments"]["mujoco"], "models": models}


def print_rows(rows: list[dict[str, Any]]) -> None:
    """Errors over the whole run, and how far from exact beams."""
    cells = []
    for row in rows:
        exact = row["models"]["exact beams"]["run"]
        cells += [
            [f"{row['mode']} {name}", f"{found['run']:.4e}", f"{found['run'] / exact - 1.0:+.2%}",
             *("-" if moved is None else f"{moved:.1e}" for moved in found["changes"].values())]
            for name, found in row["models"].items()
        ]  # fmt: skip
    print(table(["", "error [m]", "off by", "by step [m]", "by mesh [m]"], cells))


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--mode", action="append", metavar="SIGNS", help="the paper's six by default")
    given = parser.parse_args()
    model = pf.load("raparm_i")
    task = pf.plan(model.mechanism, model.path("square"), duration=0.7)
    rows = [of_mode(task, mode) for mode in given.mode or MODES]
    print_rows(rows)
    exact = [{"step": options.step, "refinement": options.refinement} for options in EXUDYN]
    values = {"path": "square", "motion_end": task.path.duration, "tolerance": OPTIONS.tolerance, "exudyn": exact}
    write_json("model_agreement", {**values, "rows": rows}, given.folder)


if __name__ == "__main__":
    main()
