"""Compile the kernels beforehand, once after an installation or a change: `python -m paraflex.compilation`.

Numba does so by itself when a kernel is first called, one after the other. But it links what it compiles with what this
process has compiled before, and what it loads from the cache with its own copies: the sums of the very first run would
round differently from those of all later ones. So other processes compile, two at a time, and this one only loads.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from paraflex.dynamics import State, build_system, constant_signals, pack_signals
from paraflex.integrators import IntegrationOptions
from paraflex.integrators.esdirk import Run, prepare
from paraflex.kernel.closure import close_path
from paraflex.kernel.march import march
from paraflex.kinematics import Line
from paraflex.mechanism import Mechanism, RigidBody, raparm_i
from paraflex.simulate import plan_tracking

NOTICE = "Compiling the kernels: once after an installation, about half a minute."


def are_compiled() -> bool:
    """Whether the kernels stand in the cache on disk and are newer than their source."""
    newest = max(source.stat().st_mtime for source in Path(march.py_func.__code__.co_filename).parent.glob("*.py"))
    entries = [*_cached(march, "march"), *_cached(close_path, "close_path")]
    return len(entries) >= 2 and all(entry.stat().st_mtime > newest for entry in entries)


def compile_kernels(announce: Callable[[str], None] = print) -> None:
    """Compile the kernels unless that has been done.

    Parameters
    ----------
    announce : callable
        Told that it takes a while, where it does.
    """
    if are_compiled():
        return
    announce(NOTICE)
    # Numba looks at the file of a cached kernel, not at those of the kernels it calls: one edited, all go.
    for entry in _cached(march, ""):
        entry.unlink(missing_ok=True)
    command = [sys.executable, "-m", "paraflex.compilation"]
    processes = [subprocess.Popen([*command, part], stdout=subprocess.DEVNULL) for part in _PARTS]
    try:
        # What a process fails to leave in the cache is compiled when it is first called.
        for process in processes:
            process.wait()
    finally:
        for process in processes:
            process.terminate()


def _cached(function, name: str) -> list[Path]:
    return [*Path(function.stats.cache_path).glob(f"*{name}-*.nb?")]


def _free_body() -> Run:
    mechanism = Mechanism("free body", ground={}, bodies=(RigidBody("body", mass=1.0, inertia=1.0),), joints=())
    signals, _ = pack_signals(mechanism, constant_signals([], 1.0), 1.0)
    still = State(0.0, np.zeros(3), np.zeros(3))
    return prepare(build_system(mechanism), signals, still, np.array([0.0, 1.0]), None, IntegrationOptions())


def _call_time_loop() -> None:
    _free_body().march(0)


def _call_the_rest() -> None:
    _free_body().start()
    path = Line((0.05, 0.31), (0.05, 0.30), max_acceleration=10.0)
    plan_tracking(raparm_i(), path, samples=2).torques("++++")


# The time loop takes as long as everything else together.
_PARTS = {"time-loop": _call_time_loop, "rest": _call_the_rest}

if __name__ == "__main__":
    if sys.argv[1:]:
        _PARTS[sys.argv[1]]()
    else:
        compile_kernels()
