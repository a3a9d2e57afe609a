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
from paraflex.kernel.packed import INDEX_1, make_scratch
from paraflex.kernel.stage import equations
from .inputs import inputs_of
from .joint_coordinates import joint_coordinate
from .signals import moment_signals
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
        forces, ways = _forces(self._few, q, v, a, multipliers)
        others, other_ways = _forces(self.whole, q_all, v_all, a_all, multipliers)
        acting = -np.einsum("kan,kn->ka", np.linalg.pinv(ways.swapaxes(1, 2)), forces)
        left = forces + np.einsum("kan,ka->kn", ways, acting)
        bodies = np.zeros_like(q)
        motion_forces(
            packed := self._few.packed, q, v, a, np.zeros((len(q), ways.shape[1])), bodies, make_scratch(packed)
        )
        balanced = np.max(np.abs(left), axis=1) <= _BALANCED * np.max(np.abs(bodies))
        left = others + np.einsum("kan,ka->kn", other_ways, acting)
        for body in self.whole.bodies:
            if body.name in self._few.mechanism.bases:
                q_all[:, body.flexible] -= left[:, body.flexible] / body.modes.omega**2
        q_all[~balanced] = np.nan
        return q_all, v_all, a_all


def _forces(system: System, q: Array, v: Array, a: Array, multipliers: Array) -> tuple[Array, Array]:
    """Return the forces (k, n) of a motion without motors, and those (k, acting, n) that unit inputs add to them."""
    inputs, signals, workspace = inputs_of(system.mechanism), moment_signals(system.mechanism, 0.0), system.workspace()
    torques, found = np.zeros(inputs.acting), np.zeros_like(q)
    for k in range(len(q)):
        equations(system.packed, signals, 0.0, INDEX_1, q[k], v[k], a[k], multipliers[k], torques, workspace)
        found[k] = workspace.f
    ways = np.zeros((len(q), inputs.acting, system.n))
    for k, motor in zip(inputs.motors, system.mechanism.motors, strict=True):
        ways[:, k] = -joint_coordinate(system, motor.joint, q).rows
    for k in inputs.loads:
        pair = np.zeros((2, *q.shape))
        for of_one, value in zip(pair, (0.0, 1.0), strict=True):
            acting = np.zeros((len(q), inputs.acting))
            acting[:, k] = value
            motion_forces(system.packed, q, v, a, acting, of_one, make_scratch(system.packed))
        ways[:, k] = pair[1] - pair[0]
    return found, ways
