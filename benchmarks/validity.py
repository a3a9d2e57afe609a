"""Do the validity indicators tell when a model does not hold? Each against the error that it is to tell of.

    python benchmarks/validity.py [--skip-engine] [--write]
    python benchmarks/validity.py --page     # tables of docs/validity.md from benchmarks/measured/validity.json

Three parts, a few minutes: beams bent statically against the exact elastica; the library's mechanisms with every path
and mode in linear geometry, in both frames, against second order; RAParM-I in second order against Exudyn's exact
beams. The limits in `paraflex/validity/indicators.py` come from here.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from common import command_line, markdown, single_thread, table, write_json
from cost_model import write_page
from scipy.integrate import solve_bvp
from scipy.stats import spearmanr

import paraflex as pf
from paraflex.cli.motion import start_of
from paraflex.dynamics import build_system, consistent_state, static_equilibrium
from paraflex.dynamics.joint_coordinates import marker_place
from paraflex.errors import IntegrationError, NumericalError
from paraflex.fem import ReferenceCondition
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    AppliedTorque,
    Assembly,
    AssumedModesBeam,
    Curvature,
    FlexibleBeam,
    Geometry,
    Load,
    Material,
    Mechanism,
    PointForce,
    PointRef,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    Section,
    WeldJoint,
)
from paraflex.motion import simulate_motion
from paraflex.results.drawing import system_drawing
from paraflex.tracking import plan_tracking, simulate
from paraflex.validity import FOURTH_ORDER_LIMIT, fourth_order

ROOT = Path(__file__).parents[1]
MEASURED, PAGE = ROOT / "benchmarks" / "measured" / "validity.json", ROOT / "docs" / "validity.md"

OPTIONS = IntegrationOptions(method="esdirk5", tolerance=2e-6)
FRAMES = (ReferenceCondition.CANTILEVER, ReferenceCondition.PINNED)
# Static cases are shown up to this slope [rad].
_STEEPEST = 0.4
# A linear run is off if its path is further than this from that of second order, as a share of the deviation.
OFF = 0.05
TRACKED = ("raparm_i", "raparm_ii", "3rrr", "4rrr", "3prr", "five_bar")
FREE = ("four_bar", "pendulum", "spin_up", "slider_crank_flexible")
STUDY = ("+-+-", "-+-+", "+--+", "+++-", "++-+", "++++")

# --- Statics: a strip of aluminium, 0.3 m x 20 mm x 2 mm --------------------------------------------------------------

LENGTH = 0.3
SECTION, MATERIAL = Section.rectangle(0.02, 0.002), Material(70e9, 2700.0)
EI = MATERIAL.youngs_modulus * SECTION.second_moment


def static_cases() -> Iterator[dict[str, Any]]:
    """Deflection of every case in every frame: error of second order, and what `fourth_order` says of it."""
    for load in (0.1, 0.3, 0.5, 1.0, 2.0):
        exact = tip_force(load)
        yield from compared("tip force", load, 0.0, exact, clamped(force=load * EI / LENGTH**2))
    for load in (0.1, 0.3, 0.6, 1.0):
        exact = LENGTH / load * (1.0 - math.cos(load))
        yield from compared("tip moment", load, 0.0, exact, clamped(torque=load * EI / LENGTH))
    for compression in (0.0, 0.5, 0.8, 0.9, 0.95):
        for slope in (0.1, 0.2, 0.3):
            load = 16.0 * slope * (1.0 - compression)
            exact = middle_force(load, compression)
            yield from compared("force in the middle", load, compression, exact, hinged(load, compression))


def tip_force(load: float) -> float:
    """Deflection of an inextensible cantilever under F = load E I / L^2 across it: theta'' = -F/(E I) cos theta."""
    s = np.linspace(0.0, 1.0, 200)
    guess = min(load, 1.2) * np.vstack([s - 0.5 * s**2, 1.0 - s, s / max(load, 1.0), s**2 / 3.0])
    solved = solve_bvp(
        lambda s, y: np.vstack([y[1], -load * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]),
        lambda a, b: np.array([a[0], b[1], a[2], a[3]]), s, guess, tol=1e-10, max_nodes=20_000,
    )  # fmt: skip
    assert solved.success
    return LENGTH * float(solved.sol(1.0)[3])


def middle_force(load: float, compression: float) -> float:
    """Deflection in the middle of a beam hinged at both ends, one of which slides, under F and an axial force P."""
    axial = compression * np.pi**2
    s = np.linspace(0.0, 0.5, 200)
    size = load / 48.0 / (1.0 - compression)
    guess = np.vstack([np.pi * size * np.cos(np.pi * s), s, size * np.sin(np.pi * s)])
    solved = solve_bvp(
        lambda s, y: np.vstack([-(0.5 * load * y[1] + axial * y[2]), np.cos(y[0]), np.sin(y[0])]),
        lambda a, b: np.array([b[0], a[1], a[2]]), s, guess, tol=1e-10, max_nodes=50_000,
    )  # fmt: skip
    assert solved.success
    return LENGTH * float(solved.sol(0.5)[2])


def strip(middle: bool = False) -> FlexibleBeam:
    points = {"A": 0.0, "M": LENGTH / 2, "B": LENGTH} if middle else {"A": 0.0, "B": LENGTH}
    return FlexibleBeam("beam", LENGTH, SECTION, MATERIAL, points, 4, curvature=Curvature.SEPARATE)


def clamped(force: float = 0.0, torque: float = 0.0) -> Mechanism:
    tip = PointRef("beam", "B")
    loads: tuple[Load, ...] = (PointForce("F", tip, (0.0, force)), AppliedTorque("M", tip, torque))
    return Mechanism(
        name="cantilever",
        ground={"O": (0.0, 0.0)},
        bodies=(strip(),),
        joints=(WeldJoint("root", PointRef("ground", "O"), PointRef("beam", "A")),),
        loads=loads,
        assemblies=(Assembly("straight", {"beam": 0.0}),),
        geometry=Geometry.SECOND_ORDER,
    )


def hinged(load: float, compression: float) -> Mechanism:
    end, slider = PointRef("beam", "B"), PointRef("slider", "B")
    return Mechanism(
        name="column",
        ground={"O": (0.0, 0.0)},
        bodies=(strip(middle=True), RigidBody("slider", 0.1, 1e-4, points={"B": (0.0, 0.0)})),
        joints=(
            RevoluteJoint("A", PointRef("ground", "O"), PointRef("beam", "A")),
            RevoluteJoint("B", end, slider),
            PrismaticJoint("rail", PointRef("ground", "O"), slider),
        ),
        loads=(
            PointForce("F", PointRef("beam", "M"), (0.0, load * EI / LENGTH**2)),
            PointForce("P", slider, (-compression * np.pi**2 * EI / LENGTH**2, 0.0)),
        ),
        assemblies=(Assembly("straight", {"beam": 0.0, "slider": 0.0}, {end: (LENGTH, 0.0), slider: (LENGTH, 0.0)}),),
        geometry=Geometry.SECOND_ORDER,
    )


def compared(case: str, load: float, compression: float, exact: float, model: Mechanism) -> Iterator[dict[str, Any]]:
    point = "M" if "M" in model.bodies[0].points else "B"
    for frame in ReferenceCondition:
        system = build_system(model.with_beams(reference=frame))
        state = static_equilibrium(system, consistent_state(system, model.assembly("straight")))
        place = marker_place(system, system.marker(PointRef("beam", point)), state.q[None])[0][0]
        slope = float(np.max(np.abs(system.body("beam").slopes(state.q))))
        yield {
            "case": case,
            "load": load,
            "compression": compression,
            "frame": frame.value,
            "slope": slope,
            "error": float(place[1] / exact - 1.0),
            "estimate": float(fourth_order(slope, compression, tangent=frame is ReferenceCondition.CANTILEVER)),
        }


# --- The library: linear geometry against second order ----------------------------------------------------------------


def tracked(name: str) -> Iterator[dict[str, Any]]:
    """Linear runs of a mechanism in both frames, all its paths and modes."""
    model = pf.load(name)
    for path in model.paths:
        along = model.path(path)
        task = plan_tracking(
            model.mechanism, along, duration=1.25 * along.duration, samples=501, assembly=model.study.assembly
        )
        linear = {frame: task.remodelled(variant(model.mechanism, Geometry.LINEAR, frame)) for frame in FRAMES}
        second = task.remodelled(variant(model.mechanism, Geometry.SECOND_ORDER, ReferenceCondition.PINNED))
        desired = task.motion.desired.position
        for mode in model.mechanism.modes:
            try:
                truth = path_of(simulate(second, mode, options=OPTIONS, warning=False))
            except NumericalError as error:
                print(f"left out: {name} {path} {mode.name}: {error}")
                continue
            for frame, modelled in linear.items():
                run = simulate(modelled, mode, options=OPTIONS, warning=False)
                found, deviation = path_of(run), rms(truth - desired)
                yield {
                    "mechanism": name,
                    "path": path,
                    "mode": mode.name,
                    "frame": frame.value,
                    "error": rms(found - truth) / deviation,
                    "tracking_error_change": rms(found - desired) / deviation - 1.0,
                    **judged(run),
                }


def free(name: str) -> Iterator[dict[str, Any]]:
    """Linear runs of a mechanism without a path; an infinite error where they diverge."""
    model = pf.load(name)

    def run(geometry: Geometry, frame: ReferenceCondition):
        mechanism = variant(with_beams_for_bars(model.mechanism), geometry, frame)
        # Deflections of a bar of assumed modes are none of a beam's.
        known = not any(isinstance(body, AssumedModesBeam) for body in model.mechanism.bodies)
        start = start_of(model, mechanism, model.study.assembly, balanced=False) if known else None
        assert model.study.duration is not None
        try:
            return simulate_motion(
                mechanism, model.study.duration, samples=model.study.samples, torques=model.study.torques,
                start=start or model.study.assembly, options=OPTIONS,
            )  # fmt: skip
        except IntegrationError as error:
            return error.partial

    truth = run(Geometry.SECOND_ORDER, ReferenceCondition.PINNED)
    drawn = system_drawing(truth.system, truth.solution.q)
    for frame in FRAMES:
        linear = run(Geometry.LINEAR, frame)
        error = math.inf
        if linear.solution.status == "complete":
            apart = system_drawing(linear.system, linear.solution.q).shape - drawn.shape
            error = rms(apart) / rms(drawn.shape - drawn.base)
        yield {"mechanism": name, "path": "", "mode": "", "frame": frame.value, "error": error, **judged(linear)}


def with_beams_for_bars(mechanism: Mechanism) -> Mechanism:
    """A beam in place of every bar of assumed modes."""
    bars = [body for body in mechanism.bodies if isinstance(body, AssumedModesBeam)]
    return mechanism.with_bodies(
        FlexibleBeam(bar.name, bar.length, bar.section, bar.material, bar.points, 2, bar.lumps) for bar in bars
    )


def variant(mechanism: Mechanism, geometry: Geometry, frame: ReferenceCondition) -> Mechanism:
    return mechanism.with_beams(reference=frame).with_geometry(geometry)


def path_of(run) -> np.ndarray:
    system, effector = run.task.system, run.task.mechanism.end_effector
    return marker_place(system, system.marker(effector.point), run.solution.q)[0]


def rms(distances: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(distances**2, axis=-1))))


def judged(run) -> dict[str, Any]:
    values = {one.name.replace(" ", "_"): one.value for one in run.validity.indicators}
    return {"warns": not run.validity.holds, "ratio": run.validity.ratio, **values}


def counts(rows: list[dict[str, Any]]) -> dict[str, int]:
    """Runs that are off and those that are not, with and without a warning."""
    off = [row for row in rows if row["error"] > OFF]
    right = [row for row in rows if row["error"] <= OFF]
    return {
        "off": len(off),
        "off_without_warning": sum(not row["warns"] for row in off),
        "right": len(right),
        "right_with_warning": sum(row["warns"] for row in right),
    }


# --- Second order against exact beams ---------------------------------------------------------------------------------


def against_exact() -> Iterator[dict[str, Any]]:
    """RAParM-I on the square: second order in both frames against Exudyn's cables, meshes twice as fine."""
    from paraflex.engines.exudyn import ExudynOptions, simulate_exudyn

    model = pf.load("raparm_i")
    task = plan_tracking(model.mechanism, model.path("square"), duration=0.7)
    finer = task.mechanism.refined(2)
    desired = task.motion.desired.position
    tasks = {frame: task.remodelled(variant(finer, Geometry.SECOND_ORDER, frame)) for frame in FRAMES}
    for mode in STUDY:
        exact = simulate_exudyn(task, mode, ExudynOptions(refinement=2)).end_effector.position
        for frame, modelled in tasks.items():
            run = simulate(modelled, mode, options=OPTIONS, warning=False)
            found, deviation = path_of(run), rms(exact - desired)
            yield {
                "mode": mode,
                "frame": frame.value,
                "error": rms(found - exact) / deviation,
                "tracking_error_change": rms(found - desired) / deviation - 1.0,
                **judged(run),
            }


def page(values: dict[str, Any]) -> str:
    """The tables of the documentation."""
    return "\n\n".join([_library(values), _rows(values["linear"]), _statics(values["statics"]), _exact(values)])


def _library(values: dict[str, Any]) -> str:
    found, rows = values["counts"], [row for row in values["linear"] if row["path"]]
    error = [row["error"] for row in rows]
    names = ("shortening", "slope", "axial_force")
    ranks = [spearmanr(error, [row[name] for row in rows]).statistic for name in names]  # pyright: ignore[reportAttributeAccessIssue]
    return (
        f"Of {found['off'] + found['right']} linear runs {found['off']} are further off than 5 %; "
        f"{found['off'] - found['off_without_warning']} of these warn. So do {found['right_with_warning']} of the "
        f"other {found['right']}. Rank correlation with the error, runs along a path: shortening {ranks[0]:.2f}, slope "
        f"{ranks[1]:.2f}, axial force {ranks[2]:.2f}."
    )


def _rows(rows: list[dict[str, Any]]) -> str:
    """RAParM-I on the square, and what has no path."""
    shown = [row for row in rows if (row["mechanism"] == "raparm_i" and row["path"] == "square") or not row["path"]]
    heads = ("Linear run", "Frame", "Off by", "Shortening", "Axial force", "Slope [rad]", "Warns")

    def number(row: dict[str, Any], name: str) -> str:
        # A run that diverged has no end.
        return "–" if name not in row or row["error"] is None else f"{row[name]:.3f}"

    return markdown(heads, [
        (f"{row['mechanism']} {row['mode']}".rstrip(), row["frame"],
         "diverges" if row["error"] is None else f"{100 * row['error']:.1f} %",
         *(number(row, name) for name in ("shortening", "axial_force", "slope")), "yes" if row["warns"] else "no")
        for row in shown
    ])  # fmt: skip


def _statics(rows: list[dict[str, Any]]) -> str:
    heads = ("Second order, at rest", "Frame", "P/P_cr", "Slope [rad]", "Off by", "Indicator")
    return markdown(heads, [
        (row["case"], row["frame"], f"{row['compression']:g}", f"{row['slope']:.3f}", f"{100 * row['error']:.2f} %",
         f"{100 * row['estimate']:.2f} %")
        for row in rows if row["frame"] != "free" and row["slope"] < _STEEPEST
    ])  # fmt: skip


def _exact(values: dict[str, Any]) -> str:
    heads = ("RAParM-I, second order", "Frame", "Off from exact beams by", "Tracking error", "Indicator")
    return markdown(heads, [
        (row["mode"], row["frame"], f"{100 * row['error']:.2f} %", f"{100 * row['tracking_error_change']:+.2f} %",
         f"{100 * row['fourth_order']:.2f} %")
        for row in values["second_order"]
    ])  # fmt: skip


def main() -> None:
    single_thread()
    parser = command_line(__doc__)
    parser.add_argument("--skip-engine", action="store_true")
    parser.add_argument("--page", action="store_true")
    asked = parser.parse_args()
    if asked.page:
        write_page(page(json.loads(MEASURED.read_text(encoding="utf-8"))), PAGE)
        return
    statics = list(static_cases())
    print(table(
        ("case", "frame", "N/N_cr", "slope [rad]", "error", "estimate"),
        [(s["case"], s["frame"], f"{s['compression']:.2f}", f"{s['slope']:.3f}", f"{100 * s['error']:.2f} %",
          f"{100 * s['estimate']:.2f} %") for s in statics],
    ))  # fmt: skip
    rows = []
    for name in TRACKED:
        rows += tracked(name)
        print(f"{name}: {counts([row for row in rows if row['mechanism'] == name])}", flush=True)
    for name in FREE:
        rows += free(name)
    print(table(
        ("run", "frame", "error", "shortening", "axial force", "slope", "warns"),
        [(f"{r['mechanism']} {r['path']} {r['mode']}", r["frame"], f"{100 * r['error']:.1f} %",
          f"{r.get('shortening', math.nan):.3f}", f"{r['axial_force']:.3f}", f"{r['slope']:.3f}",
          "yes" if r["warns"] else "") for r in sorted(rows, key=lambda r: r["error"])],
    ))  # fmt: skip
    linear = counts(rows)
    print(f"linear runs: {linear}")
    exact = [] if asked.skip_engine else list(against_exact())
    print(table(
        ("mode", "frame", "apart", "fourth order", "warns"),
        [(r["mode"], r["frame"], f"{100 * r['error']:.2f} %", f"{100 * r['fourth_order']:.2f} %",
          "yes" if r["warns"] else "") for r in exact],
    ))  # fmt: skip
    finite = [row | {"error": row["error"] if math.isfinite(row["error"]) else None} for row in rows]
    write_json(
        "validity",
        {"limit": FOURTH_ORDER_LIMIT, "statics": statics, "counts": linear, "linear": finite, "second_order": exact},
        asked.folder,
    )


if __name__ == "__main__":
    main()
