"""What does a linear model cost? RAParM-I, against differences of its accelerations; chains of up to 1,000 links.

    python benchmarks/linear_models.py [--write] [n ...]

RAParM-I: A, B, C and D of `pf.linearise`, in every mode, kernels warm. The peer is a loop of central differences: two
evaluations of this package's own accelerations for each coordinate, velocity and motor, in the same run; it gives
neither minimal coordinates nor outputs. Chains of n rigid links on springs, rows of n four-bars, chains of n flexible
links: times of the model, of the response at one frequency and of the ten slowest poles, and the exponent with which
each grows from 300 on.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from common import command_line, growth, least_time, table, write_json

import paraflex as pf
from paraflex.dynamics import State, System, constant_signals, inputs_of, pack_signals
from paraflex.kernel.ode import accelerations
from paraflex.kernel.packed import INDEX_1
from paraflex.mechanism import (
    Assembly,
    EndEffector,
    FlexibleBeam,
    Material,
    Mechanism,
    Motor,
    PointRef,
    RevoluteJoint,
    Section,
    chain_of_segments,
    four_bars_in_a_row,
)

NUMBERS = (10, 100, 300, 500, 1000)
REPEATS, CHAIN_REPEATS = 20, 2
# Step of the differences, and the tolerance of dependent rows in solving for accelerations.
STEP, DEPENDENT = 1e-6, 1e-7
POLES, FREQUENCY = 10, 3.0
# Exponents are those of sizes from here on: smaller ones have dense responses.
GROWING = 300


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("n", type=int, nargs="*", default=list(NUMBERS))
    given = parser.parse_args()
    rows = raparm()
    print(table(list(rows[0]), [[str(value) for value in row.values()] for row in rows]))
    found: dict[str, Any] = {"raparm": rows}
    for name, make in (("chains", chain), ("loops", loops), ("flexible", flexible_chain)):
        rows = [scaled(make, n) for n in given.n]
        found[name] = {"rows": rows, "exponents": exponents(rows)}
        print(f"\n{name}")
        print(table(list(rows[0]), [[f"{value:.4g}" for value in row.values()] for row in rows]))
        print({key: round(value, 2) for key, value in found[name]["exponents"].items()})
    write_json("linear_models", found, given.folder)


# --- One linearisation ------------------------------------------------------------------------------------------------


def raparm() -> list[dict[str, Any]]:
    """Milliseconds in every mode, and the ratio to the loop of differences."""
    mechanism = pf.library.raparm_i()
    rows = []
    for mode in mechanism.modes:
        model = pf.linearise(mechanism, mode=mode)
        start = at_rest(model)
        own = least_time(lambda mode=mode, start=start: matrices(mechanism, mode, start), REPEATS)
        loop = least_time(lambda model=model: differences(model), REPEATS)
        rows.append({
            "mode": mode.name, "ms": round(1e3 * own, 1), "differences_ms": round(1e3 * loop, 1),
            "ratio": round(own / loop, 2),
        })  # fmt: skip
    return rows


def matrices(mechanism: Mechanism, mode: Any, start: State) -> tuple[Any, ...]:
    model = pf.linearise(mechanism, mode=mode, start=start)
    return model.A, model.B, model.C, model.D


def differences(model: pf.LinearModel) -> np.ndarray:
    """Derivatives (n, 2 n + motors) of all accelerations at the model's pose by central differences."""
    system, point = model.minimal.system, model.minimal.point
    motors = len(system.mechanism.motors)
    at = np.concatenate([point.q, point.v, point.torques[:motors]])
    out = np.empty((system.n, at.size))
    for k in range(at.size):
        moved = np.zeros(at.size)
        moved[k] = STEP
        out[:, k] = (acceleration(system, at + moved) - acceleration(system, at - moved)) / (2.0 * STEP)
    return out


def acceleration(system: System, at: np.ndarray) -> np.ndarray:
    q, v, torques = np.split(at, [system.n, 2 * system.n])
    signals, _ = pack_signals(system.mechanism, constant_signals(torques.tolist(), 1.0), 1.0)
    a, lam, acting = np.zeros(system.n), np.zeros(system.m), np.zeros(inputs_of(system.mechanism).acting)
    accelerations(system.packed, signals, 0.0, INDEX_1, q, v, a, lam, acting, system.workspace(), DEPENDENT)
    return a


def at_rest(model: pf.LinearModel) -> State:
    """The pose that a model is about."""
    return State(0.0, model.minimal.point.q, np.zeros(model.minimal.system.n))


# --- Many bodies ------------------------------------------------------------------------------------------------------


def scaled(make: Callable[[int], Mechanism], n: int) -> dict[str, float]:
    """Seconds of a model, a response at one frequency and the slowest poles."""
    mechanism = make(n)
    model = pf.linearise(mechanism)
    start = at_rest(model)
    return {
        "n": n, "states": len(model.states),
        "model": least_time(lambda: pf.linearise(mechanism, start=start), CHAIN_REPEATS),
        "response": first_time(lambda one: one.frequency_response([FREQUENCY]), mechanism, start),
        "poles": first_time(lambda one: one.poles(POLES), mechanism, start),
    }  # fmt: skip


def first_time(call: Callable[[pf.LinearModel], Any], mechanism: Mechanism, start: State) -> float:
    """Least seconds of calls of models that are new each time: they keep their dense matrices."""
    times = []
    for _ in range(CHAIN_REPEATS):
        model = pf.linearise(mechanism, start=start)
        began = time.perf_counter()
        call(model)
        times.append(time.perf_counter() - began)
    return min(times)


def exponents(rows: Sequence[dict[str, float]]) -> dict[str, float]:
    large = [row for row in rows if row["n"] >= GROWING]
    if len(large) < 2:
        return {}
    sizes = [row["n"] for row in large]
    return {key: growth(sizes, [row[key] for row in large])[1] for key in ("model", "response", "poles")}


def chain(n: int) -> Mechanism:
    plain = chain_of_segments(n, angle=-0.5 * np.pi, bending_stiffness=1e-6)
    return replace(plain, motors=(Motor("tau", "J1"),),
                   end_effector=EndEffector(PointRef(f"segment{n}", "Q"), ("x", "y")))  # fmt: skip


def loops(n: int) -> Mechanism:
    return replace(four_bars_in_a_row(n), motors=(Motor("tau", "A0"),))


def flexible_chain(n: int) -> Mechanism:
    """Links of 10 / n m of two elements that hang on pins, a motor at the first."""
    length, names = 10.0 / n, [f"link{i}" for i in range(n)]
    section, material = Section.rectangle(0.02, 0.01), Material(70e9, 2700.0)
    bodies = [FlexibleBeam(name, length, section, material, points={"P": 0.0, "Q": length}, elements=2)
              for name in names]  # fmt: skip
    ends = [PointRef("ground", "O"), *(PointRef(name, "Q") for name in names)]
    return Mechanism(
        f"chain of {n} flexible links", ground={"O": (0.0, 0.0)}, bodies=tuple(bodies),
        joints=tuple(RevoluteJoint(f"J{i}", ends[i], PointRef(name, "P")) for i, name in enumerate(names)),
        motors=(Motor("tau", "J0"),), gravity=(0.0, -9.81),
        end_effector=EndEffector(ends[-1], ("x", "y")),
        assemblies=(Assembly("down", dict.fromkeys(names, -0.5 * np.pi)),),
    )  # fmt: skip


if __name__ == "__main__":
    main()
