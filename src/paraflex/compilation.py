"""Compile the kernels beforehand, once after an installation or a change: `python -m paraflex.compilation`.

Numba does so by itself when a kernel is first called, one after the other; here two processes do it at once.
"""

from __future__ import annotations

import gc
import hashlib
import logging
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from llvmlite import binding
from numba.core import config

from paraflex.dynamics import State, build_system, constant_signals, pack_signals
from paraflex.dynamics.state import check_accelerations
from paraflex.dynamics.tangents import MotionPoint, Tangency
from paraflex.errors import as_enum
from paraflex.integrators import IntegrationOptions, make_problem
from paraflex.integrators.native import NativeRun, prepare
from paraflex.interrupts import starting_processes
from paraflex.kernel.march import march
from paraflex.kernel.notice import LOG, announce_compiling
from paraflex.kernel.plain import PLAIN, STATE
from paraflex.kinematics import Line
from paraflex.mechanism import FlexibleBeam, Geometry, Material, Mechanism, Section, raparm_i
from paraflex.tracking import plan_tracking

# What each of the processes does; first of all it sees to it that it does not outlive this one.
_CHILD = """
import sys
from paraflex.interrupts import end_with_parent
end_with_parent(sys.stdin.fileno())
from paraflex.compilation import compile_parts
compile_parts(sys.argv[1:])
"""


def are_compiled(geometry: Geometry | str = Geometry.SECOND_ORDER) -> bool:
    """Whether the kernels for beams of this geometry are in the cache on disk."""
    return _stamp(as_enum(Geometry, geometry, "geometry")).exists()


def compile_kernels(
    geometry: Geometry | str = Geometry.SECOND_ORDER, announce: Callable[[str], None] | None = None
) -> None:
    """Compile the kernels for beams of a geometry unless they are compiled.

    Parameters
    ----------
    geometry : Geometry or str
        Kernels for linear geometry are compiled without all that second-order geometry needs.
    announce : callable, optional
        Called with a line where it takes a while, once a process; by default that is logged: see `kernel.notice`.
    """
    _compile([as_enum(Geometry, geometry, "geometry")], announce)


def compile_all_kernels(announce: Callable[[str], None] | None = None) -> None:
    """Compile the kernels for beams of every geometry that are not compiled."""
    _compile(list(Geometry), announce)


def compile_kernels_for(mechanism: Mechanism, announce: Callable[[str], None] | None = None) -> None:
    """Compile the kernels that a mechanism needs: see `compile_kernels`. Rigid bodies have no geometry of beams."""
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
                # They end where the other end of the pipe is closed.
                line = [sys.executable, "-c", _CHILD, *share]
                processes.append(subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL))
        # What a process fails to leave in the cache is compiled when it is first called.
        codes = [process.wait() for process in processes]
        if not any(codes):
            for geometry in missing:
                _stamp(geometry).touch()
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def _shares(geometries: list[Geometry]) -> list[list[str]]:
    """Parts of the compilation for two processes, as GEOMETRY:PART; common functions are compiled in both."""
    parts = [[f"{geometry.value}:{part}" for part in _PARTS] for geometry in geometries]
    if len(parts) == 1:
        return [parts[0][:1], parts[0][1:]]
    # Of whatever geometry beams are, plans are of rigid bodies.
    return [parts[0], parts[1][:-1]]


def _stamp(geometry: Geometry) -> Path:
    """A file beside the machine code that names Python and processor, as the folder may be shared."""
    processor = (binding.get_process_triple(), binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten())
    here = repr((sys.version, processor, vars(config)["CPU_NAME"], vars(config)["CPU_FEATURES"], STATE, PLAIN))
    return Path(march.cache_path) / f"compiled-{geometry.value}-{hashlib.sha256(here.encode()).hexdigest()[:16]}"


def _free_beam(geometry: Geometry) -> NativeRun:
    beam = FlexibleBeam("beam", 1.0, Section(1e-4, 1e-9), Material(70e9, 2700.0))
    system = build_system(Mechanism("free beam", ground={}, bodies=(beam,), joints=(), geometry=geometry))
    signals, _ = pack_signals(system.mechanism, constant_signals([], 1.0), 1.0)
    still = State(0.0, np.zeros(system.n), np.zeros(system.n))
    return prepare(make_problem(system, signals, still, np.array([0.0, 1.0])), IntegrationOptions())


def _call_start(geometry: Geometry) -> None:
    beam = _free_beam(geometry)
    beam.start()
    # What a start with prescribed motion is checked with.
    system, still = beam.problem.system, beam.state
    check_accelerations(system, beam.problem.signals, 0.0, still.q, still.v)
    # A linear model.
    Tangency(system).at(MotionPoint(0.0, still.q, still.v, np.zeros(system.n), np.zeros(0), np.zeros(0)))


def _call_plan(_: Geometry) -> None:
    path = Line((0.05, 0.31), (0.05, 0.30), max_acceleration=10.0)
    plan_tracking(raparm_i(), path, samples=2).torques("++++")


def compile_parts(parts: list[str]) -> None:
    """Compile kernels in this process, which does nothing else: parts as `_shares` names them."""
    # Who started this process has said so.
    LOG.setLevel(logging.ERROR)
    # Nothing that compiling makes is garbage before the end.
    gc.disable()
    for part in parts:
        geometry, what = part.split(":")
        _PARTS[what](Geometry(geometry))


# The time loop takes as long as everything else together.
_PARTS = {"time-loop": lambda geometry: _free_beam(geometry).march(0), "start": _call_start, "plan": _call_plan}

if __name__ == "__main__":
    compile_all_kernels()
