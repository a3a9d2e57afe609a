"""Forces at rest and their derivatives by the pose: stiffness of springs, weight, loads and constraint forces."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy

from paraflex.arrays import Array, Indices
from paraflex.findings import Finding
from paraflex.kernel.packed import CONSTRAINT, FRICTION, INDEX_1, SPRING, PackedSystem, Signals, Workspace
from paraflex.kernel.stage import equations
from .inputs import inputs_of
from .signals import acting_loads, moment_signals
from .sparse import without_stiffness
from .system import System
from .tangents import MotionPoint, Tangency

# Unsymmetric part of a stiffness, relative to the largest entry, that is no rounding.
_UNSYMMETRIC = 1e-6


class RestingForces:
    """Forces at rest (n,), signed as on the left-hand side of the equations, and rows of springs (m,).

    The stiffness of beams is not included by default: it is a diagonal matrix and would dominate all other forces. With
    velocities `v` and accelerations `a` (n,) other than zero the forces are those of a motion.
    """

    def __init__(self, system: System, time: float, *, beams: bool = False) -> None:
        self.packed: PackedSystem = system.packed if beams else without_stiffness(system.packed)
        self.time = time
        self.signals: Signals = moment_signals(system.mechanism, time)
        self.workspace: Workspace = system.workspace()
        self.v: Array = np.zeros(system.n)
        self.a: Array = np.zeros(system.n)
        self.torques: Array = np.zeros(inputs_of(system.mechanism).acting)
        self.springs: Indices = np.nonzero(system.packed.rows["kind"] == SPRING)[0]

    def __call__(self, q: Array, lam: Array) -> tuple[Array, Array]:
        """Return forces and rows at coordinates (n,) with multipliers (m,)."""
        equations(
            self.packed, self.signals, self.time, INDEX_1, q, self.v, self.a, lam, self.torques, self.workspace
        )  # fmt: skip
        return self.workspace.f.copy(), self.workspace.rows[self.springs]

    def compliant(self, q: Array) -> Array:
        """Return multipliers (m,) of springs, dampers and friction at coordinates (n,); zero in rows of constraints."""
        rows = self.packed.rows
        # Rows of springs and dampers are compliance times the missing multiplier; those of friction use the scale set
        # here.
        scale = np.where(rows["kind"] == FRICTION, 1.0, rows["compliance"])
        self.workspace.compliance[:] = scale
        self(q, np.zeros(rows.size))
        return np.divide(self.workspace.rows, scale, out=np.zeros(rows.size), where=rows["kind"] != CONSTRAINT)


def laws_without_energy(system: System, time: float, q: Array) -> Iterator[Finding]:
    """Yield a finding if laws of loads make the stiffness at rest unsymmetric in a pose (n,)."""
    if not system.packed.laws.size:
        return
    without_beams = replace(system, packed=without_stiffness(system.packed))
    still, acting = np.zeros(system.n), acting_loads(system.mechanism, np.array([time]))[0]
    K = Tangency(without_beams).stiffness(MotionPoint(time, q, still, still, np.zeros(system.m), acting))
    units = scipy.sparse.diags(system.units)
    scaled = scipy.sparse.csr_matrix(units @ K @ units)
    if abs(scaled - scaled.T).max() > _UNSYMMETRIC * abs(scaled).max():
        named = [load.name for load in system.mechanism.loads if load.laws]
        named += [one.name for one in system.mechanism.linear_springs if one.laws]
        yield Finding(
            "laws-without-energy", "load", f"{', '.join(named)}: natural frequencies and stability at rest leave out "
            "the unsymmetric part of their stiffness", "take the poles of `paraflex linearise`, which have all of it",
        )  # fmt: skip


def pose_stiffness(system: System, time: float, q: Array, lam: Array) -> scipy.sparse.csr_matrix:
    """Return the derivative (n, n) of the forces at rest by the coordinates, without the diagonal one of beams.

    Multipliers of constraints are constant; the torques of springs at joints follow the pose. The unsymmetric part, of
    loads that rotate with a body, is left out.

    Parameters
    ----------
    system : System
        System of the mechanism.
    time : float
        Time of prescribed angles [s].
    q : (n,) array
        Coordinates of the pose.
    lam : (m,) array
        Multipliers of constraints and torques of springs at joints at that pose.
    """
    still, acting = np.zeros(system.n), np.zeros(inputs_of(system.mechanism).acting)
    tangency = system.once(
        "tangency without beams", lambda: Tangency(replace(system, packed=without_stiffness(system.packed)))
    )
    point = MotionPoint(time, q, still, still, lam, acting)
    # Torques of springs, dampers and friction at joints take more columns.
    K = tangency.stiffness(point) if np.all(system.constrained) else tangency.at(point).stiffness
    return scipy.sparse.csr_matrix(0.5 * (K + K.T))
