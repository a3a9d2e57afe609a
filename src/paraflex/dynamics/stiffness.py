"""Forces at rest and their derivatives by the pose: stiffness of springs, weight, loads and constraint forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from paraflex.arrays import Array
from paraflex.dynamics.inputs import inputs_of
from paraflex.dynamics.signals import moment_signals
from paraflex.dynamics.sparse import without_stiffness
from paraflex.dynamics.system import System
from paraflex.dynamics.tangents import MotionPoint, Tangency
from paraflex.kernel.packed import CONSTRAINT, FRICTION, INDEX_1, SPRING, PackedSystem, Signals, Workspace
from paraflex.kernel.stage import equations


class RestingForces:
    """Forces at rest (n,), with the sign of the left-hand side of the equations, and rows of springs (m,).

    All forces but the stiffness of beams, which is a diagonal matrix and would drown them. With velocities `v` and
    accelerations `a` (n,) in place of zeros they are those of a motion.
    """

    def __init__(self, system: System, time: float) -> None:
        self.packed: PackedSystem = without_stiffness(system.packed)
        self.time = time
        self.signals: Signals = moment_signals(system.mechanism, time)
        self.workspace: Workspace = system.workspace()
        self.v: Array = np.zeros(system.n)
        self.a: Array = np.zeros(system.n)
        self.torques: Array = np.zeros(inputs_of(system.mechanism).acting)
        self.springs: NDArray[np.intp] = np.nonzero(system.packed.rows["kind"] == SPRING)[0]

    def __call__(self, q: Array, lam: Array) -> tuple[Array, Array]:
        """Forces and rows at coordinates (n,) with multipliers (m,)."""
        self._evaluate(q, lam)
        return self.workspace.f.copy(), self.workspace.rows[self.springs]

    def compliant(self, q: Array) -> Array:
        """Multipliers (m,) of springs, dampers and friction at coordinates (n,); zero in rows of constraints."""
        rows = self.packed.rows
        # Rows of springs and dampers are compliance times what is missing; those of friction with the scale set here.
        scale = np.where(rows["kind"] == FRICTION, 1.0, rows["compliance"])
        self.workspace.compliance[:] = scale
        self._evaluate(q, np.zeros(rows.size))
        compliant = rows["kind"] != CONSTRAINT
        return np.divide(self.workspace.rows, scale, out=np.zeros(rows.size), where=compliant)

    def _evaluate(self, q: Array, lam: Array) -> None:
        equations(
            self.packed, self.signals, self.time, INDEX_1, q, self.v, self.a, lam, self.torques, self.workspace
        )  # fmt: skip


def pose_stiffness(system: System, time: float, q: Array, lam: Array) -> scipy.sparse.csr_matrix:
    """Derivative (n, n) of the forces at rest by the coordinates, without that of the beams, which is diagonal.

    Multipliers of constraints are kept, the torques of springs at joints follow the pose. The part of loads that turn
    with a body that is not symmetric is left out.

    Parameters
    ----------
    system : System
    time : float
        For prescribed angles [s].
    q : (n,) array
    lam : (m,) array
        Multipliers of constraints and torques of springs at joints at that pose.
    """
    still, acting = np.zeros(system.n), np.zeros(inputs_of(system.mechanism).acting)
    without_beams = replace(system, packed=without_stiffness(system.packed))
    K = Tangency(without_beams).at(MotionPoint(time, q, still, still, lam, acting)).stiffness
    return scipy.sparse.csr_matrix(0.5 * (K + K.T))
