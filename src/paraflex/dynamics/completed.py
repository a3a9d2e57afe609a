"""Deflections of reduced bodies in all flexible coordinates, for stresses: mode acceleration.

Few shapes give the positions of a motion, but not its curvatures. The forces on a body, f = M a + h + Phi_q^T lambda
less weight, loads and torques, follow from the motion alone. With them the deflection of every flexible coordinate is
u - f / omega^2, with f in balance with K u: the static deflection under all forces of the motion, inertia included
(Craig, 1981, Structural Dynamics, 15.3).

Torques and loads in time are not part of a motion. They follow from the equations of the reduced bodies, which they
satisfy.
"""

from dataclasses import replace

import numpy as np

from paraflex.arrays import Array
from paraflex.kernel.bodies import motion_forces
from paraflex.kernel.constraints import add_reactions
from paraflex.kernel.packed import make_scratch
from .inputs import inputs_of
from .joint_coordinates import joint_coordinate
from .state import carried
from .system import System, build_system

# Forces that are missing in the equations of the reduced bodies, relative to the largest on a body, above which a
# motion is not completed: other forces act.
_BALANCED = 1e-3


class Completion:
    """Motions of a system with reduced bodies in the coordinates of all their shapes.

    Attributes
    ----------
    whole : System
        System with all flexible coordinates.
    """

    def __init__(self, system: System) -> None:
        self._few = system
        self.whole: System = build_system(replace(system.mechanism, bases={}))

    def __call__(self, q: Array, v: Array, a: Array, multipliers: Array) -> tuple[Array, Array, Array]:
        """Return coordinates (k, all) and derivatives of a motion (k, n) with multipliers (k, m).

        They are NaN at instants at which other forces than those of motors and loads act.
        """
        q_all, v_all, a_all = (carried(self.whole, self._few, part) for part in (q, v, a))
        bodies, forces, ways = self._forces(q_all, v_all, a_all, multipliers)
        # By virtual work these are the forces on the coordinates kept.
        kept = carried(self.whole, self._few, np.eye(self._few.n)).T
        acting = -(forces @ kept)[:, None] @ np.linalg.pinv(ways @ kept)
        forces += (acting @ ways)[:, 0]
        balanced = np.max(np.abs(forces @ kept), axis=1) <= _BALANCED * np.max(np.abs(bodies @ kept))
        for body in self.whole.bodies:
            if body.name in self._few.mechanism.bases:
                q_all[:, body.flexible] -= forces[:, body.flexible] / body.modes.omega**2
        q_all[~balanced] = np.nan
        return q_all, v_all, a_all

    def errors(self, few: Array) -> Array:
        """Return bounds of errors of all coordinates (n,), NaN for bodies without any, from those of the ones kept."""
        found = np.abs(carried(self.whole, self._few, np.eye(self._few.n)).T) @ few
        for body, kept in zip(self.whole.bodies, self._few.bodies, strict=True):
            if not kept.nf:
                found[body.flexible] = np.nan
        return found

    def _forces(self, q: Array, v: Array, a: Array, multipliers: Array) -> tuple[Array, Array, Array]:
        """Return the forces (k, n) of the bodies' motion and of that with joints, and those of unit inputs."""
        packed, mechanism = self.whole.packed, self.whole.mechanism
        inputs, scratch = inputs_of(mechanism), make_scratch(packed)

        def under(acting: Array) -> Array:
            motion_forces(packed, q, v, a, acting, found := np.zeros_like(q), scratch)
            return found

        still, idle, rows = np.zeros((len(q), inputs.acting)), np.zeros(inputs.acting), np.zeros(self.whole.m)
        bodies = under(still)
        add_reactions(packed, q, multipliers, idle, forces := bodies.copy(), rows, scratch)
        ways = np.zeros((len(q), inputs.acting, self.whole.n))
        for k, motor in zip(inputs.motors, mechanism.motors, strict=True):
            ways[:, k] = -joint_coordinate(self.whole, motor.joint, q).rows
        for k in inputs.loads:
            unit = still.copy()
            unit[:, k] = 1.0
            ways[:, k] = under(unit) - bodies
        return bodies, forces, ways
