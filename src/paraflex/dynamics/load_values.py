"""Values of loads along a motion, by laws over the motion included."""

import numpy as np

from paraflex.arrays import Array
from paraflex.kernel.loads import loads_along
from paraflex.kernel.packed import make_scratch
from .signals import acting_loads
from .system import System


def load_values(system: System, t: Array, q: Array, v: Array) -> Array:
    """Return force [N] and torque [N m] (k, loads, 3) of every load at times (k,) of a motion (k, n)."""
    found = np.zeros((len(t), len(system.mechanism.loads), 3))
    acting, registers = acting_loads(system.mechanism, t), make_scratch(system.packed).registers
    loads_along(system.packed, np.ascontiguousarray(q), np.ascontiguousarray(v), acting, registers, found)
    return found


def largest_loads(system: System, t: Array, q: Array, v: Array) -> list[float]:
    """Return the largest magnitude of every load of a motion [N, N m], between samples too where it is one of time."""
    loads = system.mechanism.loads
    if not any(load.laws for load in loads):
        return [load.largest(t) for load in loads]
    sizes = np.linalg.norm(load_values(system, t, q, v), axis=2)
    return [
        float(np.nanmax(sizes[:, k], initial=0.0)) if load.laws else load.largest(t) for k, load in enumerate(loads)
    ]
