"""HTML views of runs in notebooks: status, results, and counts of the solver."""

from typing import Any

import numpy as np

from paraflex.display import facts, page, sentence, table
from paraflex.dynamics.points import point_motion
from paraflex.formatting import number, quantity
from paraflex.integrators import Solution
from paraflex.integrators.methods import title_of
from paraflex.late import view
from paraflex.mechanism import PointRef, TimeProfile
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun
from .metrics import METRICS
from .outlines import deflections
from .run_traces import run_traces

# Largest number of points in the table.
_MOST_LISTED = 20


@view.register(TrackingRun)
def tracking_run_html(run: TrackingRun) -> str:
    """Return the view of a run along a path: status, tracking error, torques, deflection and counts of the solver."""
    task, solution = run.task, run.solution
    whole = task.whole or task
    torque = run.applied
    peaks, rms = np.max(np.abs(torque), axis=0, initial=0.0), np.sqrt(np.mean(torque**2, axis=0))
    motors = [
        (motor.name, "active" if motor.name in run.mode.motors else "passive", float(peak), float(each), unit)
        for motor, peak, each, unit in zip(
            whole.mechanism.motors, peaks, rms, whole.mechanism.motor_units(), strict=True
        )
    ]
    return page(
        f"{whole.mechanism.name}, mode {run.mode.name}: {_ended(solution)}",
        sentence(solution.message),
        sentence(_verdict(run)),
        facts([*_tracking(run), *_solver(solution, run.method)]),
        table(("motor", "", "peak", "RMS", "unit"), motors),
    )


@view.register(MotionRun)
def motion_run_html(run: MotionRun) -> str:
    """Return the view of a run without a path: status, positions of its points at the end and counts of the solver."""
    solution, system = run.solution, run.system
    energies: list[tuple[str, Any]] = []
    points: list[tuple] = []
    if solution.t.size:
        energies = [
            ("largest deflection", _deflection(run)),
            ("kinetic energy, largest", _text(np.max(solution.kinetic_energy), "J")),
            ("strain energy, largest", _text(np.max(solution.strain_energy), "J")),
        ]
        last = [values[-1:] for values in (solution.q, solution.v, solution.a)]
        names = [PointRef(body.name, point) for body in system.described.bodies for point in body.points]
        shown = [ref for ref in names if "._" not in str(ref)][:_MOST_LISTED]
        points = [(str(ref), *map(float, point_motion(system, ref, *last).position[0])) for ref in shown]
    given = {
        name: "in time" if isinstance(law, TimeProfile) else number(law)
        for name, law in run.torques.items()
        if law != 0.0
    }
    torques = [f"{name} {value}" for name, value in given.items()]
    return page(
        f"{system.mechanism.name}: {_ended(solution)}",
        sentence(solution.message),
        sentence(_verdict(run)),
        facts([*energies, ("given torques", torques), *_solver(solution, title_of(solution.method))]),
        table(("point", "x at the end [m]", "y [m]"), points),
    )


def _text(value: float, unit: str) -> str:
    return quantity(value, unit, digits=4, padded=False)


def _verdict(run: TrackingRun | MotionRun) -> str:
    return "" if run.validity is None else run.validity.verdict


def _ended(solution: Solution) -> str:
    if not solution.t.size:
        return solution.status
    # A run fails after its last sample; its message gives the time.
    until = " at" if solution.status in ("complete", "stopped") else ", its last sample at"
    return f"{solution.status}{until} t = {number(solution.t[-1])} s"


def _tracking(run: TrackingRun) -> list[tuple[str, Any]]:
    if run.task.mechanism.end_effector is None or not run.samples:
        return []
    traces = run_traces(run)

    def length(metric: str) -> str:
        return _text(METRICS[metric].value(traces), "m")

    after = [] if traces.moving.all() else [("tracking error after it, RMS", length("tracking_rms_after"))]
    return [
        ("tracking error during the motion, RMS", length("tracking_rms_motion")),
        ("tracking error during the motion, largest", length("tracking_max_motion")),
        *after,
        ("largest deflection", _deflection(run)),
        ("condition number, worst", float(METRICS["actuation_condition_max"].value(traces))),
    ]


def _deflection(run: TrackingRun | MotionRun) -> str | None:
    """Return the largest deflection of any flexible body from its chord as text; None if there is none."""
    bent = np.abs(deflections(run.system, run.solution.q))
    return _text(np.nanmax(bent), "m") if np.isfinite(bent).any() else None


def _solver(solution: Solution, method: str) -> list[tuple[str, Any]]:
    imbalance = solution.energy_balance_max
    return [
        ("method", method),
        ("steps", f"{solution.steps}, {solution.rejected} more rejected"),
        ("Newton iterations", solution.newton_iterations),
        ("factorisations", solution.factorisations),
        ("wall time", quantity(solution.wall_time, "s")),
        ("largest violation of constraints", quantity(solution.constraint_position_max, "m")),
        ("largest imbalance of energy", quantity(imbalance, "J") if np.isfinite(imbalance) else None),
    ]
