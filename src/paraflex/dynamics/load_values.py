"""Values of loads along a motion, by laws over the motion included."""

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.kernel.loads import lines_along, loads_along
from paraflex.kernel.packed import make_scratch
from paraflex.mechanism import ForceLaw
from .signals import acting_loads
from .system import System

# Times after a run has broken down at which its laws are looked at, as fractions of its duration.
_LATER = np.logspace(-12.0, -3.0, 10)


def load_values(system: System, t: Array, q: Array, v: Array) -> Array:
    """Return force [N] and torque [N m] (k, loads, 3) of every load at times (k,) of a motion (k, n)."""
    found = np.zeros((len(t), len(system.mechanism.loads), 3))
    acting, registers = acting_loads(system.mechanism, t), make_scratch(system.packed).registers
    loads_along(system.packed, np.ascontiguousarray(q), np.ascontiguousarray(v), acting, registers, found)
    return found


def line_laws(system: System, q: Array, v: Array) -> Array:
    """Return the forces (k, springs) of the characteristics of springs between points [N], zero without one."""
    found = np.zeros((len(q), len(system.mechanism.linear_springs)))
    registers = make_scratch(system.packed).registers
    lines_along(system.packed, np.ascontiguousarray(q), np.ascontiguousarray(v), registers, found)
    return found


def check_laws(system: System, t: Array, q: Array, v: Array) -> None:
    """Check that the laws of all loads are finite at times (k,) of a motion (k, n).

    Raises
    ------
    InputError
        One of them is not.
    """
    if not system.packed.laws.size:
        return
    found = [*load_values(system, t, q, v).swapaxes(0, 1), *line_laws(system, q, v).T[:, :, None]]
    loads = system.mechanism.loads
    named = [(_of_spring(load.laws) or f"load.{load.name}.{load.kind}", load.laws) for load in loads]
    named += [(f"linear_spring.{one.name}.force", one.laws) for one in system.mechanism.linear_springs]
    for (field, laws), values in zip(named, found, strict=True):
        if not (finite := np.isfinite(values).all(axis=1)).all():
            problem = f"not a finite number at t = {t[~finite][0]:g} s"
            remedy = "begin in another pose, or write a finite law"
            raise InputError(problem, field=field, value=", ".join(map(str, laws)), remedy=remedy)


def _of_spring(laws: tuple[ForceLaw, ...]) -> str:
    """Return the field of the spring whose law a load holds; empty if it holds none."""
    return next((law.field for law in laws if law.field.startswith("spring.")), "")


def law_lost(system: System, time: float, q: Array, v: Array, duration: float) -> str:
    """Return the field of a law that is not finite soon after a state (n,) in a run of a duration [s], or ""."""
    later = duration * _LATER
    try:
        check_laws(system, time + later, q + later[:, None] * v, np.repeat(v[None], later.size, axis=0))
    except InputError as error:
        return error.field
    return ""


def largest_loads(system: System, t: Array, q: Array, v: Array) -> list[float]:
    """Return the largest magnitude of every load of a motion [N, N m], between samples too where it is one of time."""
    loads = system.mechanism.loads
    if not any(load.laws for load in loads):
        return [load.largest(t) for load in loads]
    sizes = np.linalg.norm(load_values(system, t, q, v), axis=2)
    return [
        float(np.nanmax(sizes[:, k], initial=0.0)) if load.laws else load.largest(t) for k, load in enumerate(loads)
    ]
