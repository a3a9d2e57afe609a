"""Ahead-of-time compilation of the kernels, once after an installation or a change: `python -m paraflex.compilation`.

Numba would compile each kernel at its first call, one after the other; here two processes compile in parallel.
"""

import gc
import hashlib
import logging
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from .dynamics import State, build_system, constant_signals, pack_signals
from .dynamics.state import check_accelerations
from .dynamics.tangents import MotionPoint, Tangency
from .errors import as_enum
from .integrators import IntegrationOptions, make_problem
from .integrators.native import NativeRun, prepare
from .interrupts import starting_processes
from .kernel.constraints import add_reactions
from .kernel.march import march
from .kernel.notice import LOG, announce_compiling
from .kernel.packed import make_scratch
from .kernel.plain import PLAIN, STATE, SUPPLIED
from .kernel.processor import processor
from .mechanism import FlexibleBeam, Geometry, Material, Mechanism, Section, raparm_i
from .paths import Line
from .tracking import plan_tracking

# Script of each child process; its first action makes it end with the parent.
_CHILD = """
import sys
from paraflex.interrupts import end_with_parent
end_with_parent(sys.stdin.fileno())
from paraflex.compilation import compile_parts
compile_parts(sys.argv[1:])
"""


def are_compiled(geometry: Geometry | str = Geometry.SECOND_ORDER) -> bool:
    """Check whether the kernels for beams of this geometry are in the cache on disk."""
    given = as_enum(Geometry, geometry, "geometry")
    return _stamp(given).exists() or _stamp(given, SUPPLIED).exists()


def compile_kernels(
    geometry: Geometry | str = Geometry.SECOND_ORDER, announce: Callable[[str], None] | None = None
) -> None:
    """Compile the kernels for beams of one geometry unless they are in the cache.

    Parameters
    ----------
    geometry : Geometry or str
        Geometry of the beams, second order by default; kernels for linear geometry omit the second-order terms.
    announce : callable, optional
        Function called with a line of text before a long compilation, once per process; by default the line is logged,
        see `kernel.notice`.
    """
    _compile([as_enum(Geometry, geometry, "geometry")], announce)


def compile_all_kernels(announce: Callable[[str], None] | None = None) -> None:
    """Compile the kernels for beams of every geometry, except those in the cache."""
    _compile(list(Geometry), announce)


def compile_kernels_for(mechanism: Mechanism, announce: Callable[[str], None] | None = None) -> None:
    """Compile the kernels that a mechanism needs, for rigid bodies those of linear geometry: see `compile_kernels`."""
    flexible = any(getattr(body, "flexible", False) for body in mechanism.bodies)
    compile_kernels(mechanism.geometry if flexible else Geometry.LINEAR, announce)


def _compile(geometries: list[Geometry], announce: Callable[[str], None] | None) -> None:
    missing = [geometry for geometry in geometries if not are_compiled(geometry)]
    if not missing:
        return
    announce_compiling(announce)
    processes: list[subprocess.Popen[bytes]] = []
    try:
        for share in _shares(missing):
            with starting_processes():
                # The child ends when this end of the pipe is closed.
                line = [sys.executable, "-c", _CHILD, *share]
                processes.append(subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL))
        # A kernel missing from the cache is compiled at its first call.
        codes = [process.wait() for process in processes]
        if not any(codes):
            for geometry in missing:
                _stamp(geometry).touch()
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def _shares(geometries: list[Geometry]) -> list[list[str]]:
    """Divide the compilation into parts GEOMETRY:PART for two processes, which load what the other has compiled."""
    parts = [[f"{geometry.value}:{part}" for part in _PARTS] for geometry in geometries]
    if len(parts) == 1:
        # While the first process is at the plan, the second compiles much of what the time loop calls.
        return [parts[0][:2], parts[0][2:]]
    # The plan part is needed once: plans treat bodies as rigid, whatever the geometry of the beams.
    return [parts[0], parts[1][1:]]


def _stamp(geometry: Geometry, folder: Path | None = None) -> Path:
    """Return the marker of a complete compilation, by default in the cache, named by what may differ in a folder."""
    here = repr((sys.implementation.cache_tag, processor(), STATE, PLAIN))
    name = f"compiled-{geometry.value}-{hashlib.sha256(here.encode()).hexdigest()[:16]}"
    return (folder or Path(march.cache_path)) / name


def _free_beam(geometry: Geometry) -> NativeRun:
    beam = FlexibleBeam("beam", 1.0, Section(1e-4, 1e-9), Material(70e9, 2700.0))
    system = build_system(Mechanism("free beam", ground={}, bodies=(beam,), joints=(), geometry=geometry))
    signals, _ = pack_signals(system.mechanism, constant_signals([], 1.0), 1.0)
    still = State(0.0, np.zeros(system.n), np.zeros(system.n))
    return prepare(make_problem(system, signals, still, np.array([0.0, 1.0])), IntegrationOptions())


def _call_start(geometry: Geometry) -> None:
    beam = _free_beam(geometry)
    beam.start()
    # Kernel that checks a start with prescribed motion.
    system, still = beam.problem.system, beam.state
    check_accelerations(system, beam.problem.signals, 0.0, still.q, still.v)
    # A linear model.
    Tangency(system).at(MotionPoint(0.0, still.q, still.v, np.zeros(system.n), np.zeros(0), np.zeros(0)))
    # Shapes and stresses of a reduced run.
    system.jacobian(still.q)
    one, none = np.zeros((1, system.n)), np.zeros(0)
    add_reactions(system.packed, one, np.zeros((1, 0)), none, one.copy(), none, make_scratch(system.packed))


def _call_plan(_: Geometry) -> None:
    path = Line((0.05, 0.31), (0.05, 0.30), max_acceleration=10.0)
    plan_tracking(raparm_i(), path, samples=2).torques("++++")


def compile_parts(parts: list[str]) -> None:
    """Compile the given parts (GEOMETRY:PART, see `_shares`) in this process, which has no other task."""
    # The parent process has already announced the compilation.
    LOG.setLevel(logging.ERROR)
    # Objects made during compilation live until the end, so collecting garbage only takes time.
    gc.disable()
    for part in parts:
        geometry, what = part.split(":")
        _PARTS[what](Geometry(geometry))


# The time loop takes as long to compile as all other parts together.
_PARTS = {"plan": _call_plan, "time-loop": lambda geometry: _free_beam(geometry).march(0), "start": _call_start}

if __name__ == "__main__":
    compile_all_kernels()
