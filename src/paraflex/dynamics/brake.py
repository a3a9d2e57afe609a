"""Brakes: joints locked from an instant on, at the angle or travel of that instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from paraflex.arrays import Array
from paraflex.dynamics.joint_coordinates import joint_coordinate
from paraflex.dynamics.signals import moment_signals
from paraflex.dynamics.sparse import sparse_mass
from paraflex.dynamics.state import State, project_velocity
from paraflex.dynamics.system import System, build_system
from paraflex.mechanism import PrescribedAngle
from paraflex.mechanism.laws import HeldAngle


@dataclass(frozen=True)
class Braked:
    """A system whose brakes have engaged.

    Attributes
    ----------
    system : System
        With the joints locked; its coordinates are those of the free system.
    state : State
        Just after.
    energy : float
        Kinetic energy that the brakes took [J].
    rows : tuple of int
        Of the locked joints among the system's rows, in the order they were named.
    """

    system: System
    state: State
    energy: float
    rows: tuple[int, ...]

    def holding(self, multipliers: Array) -> Array:
        """Torques of the brakes (k, joints), signed as those of motors [N m, N], from multipliers (k, m)."""
        # Phi_q^T lambda stands on the left of the equations, a motor's torque on the right.
        return -multipliers[:, list(self.rows)]


def brake(system: System, state: State, joints: Sequence[str]) -> Braked:
    """Lock joints at a state by a plastic impact.

    Velocities become the nearest, in the metric of mass, that locked joints allow: an inelastic engagement,
    v+ = v - M^-1 C^T (C M^-1 C^T)^-1 C v, with C the derivatives of constraints and locked joints. It takes the kinetic
    energy of what is lost, (v - v+)^T M (v - v+) / 2.

    Parameters
    ----------
    system : System
    state : State
    joints : sequence of str
        Angle or travel, slopes of beams included, stays as it is.

    Raises
    ------
    InconsistentConstraintsError
        A joint that a prescribed law moves.
    """
    mechanism = system.mechanism
    names = [f"brake of {joint}" for joint in joints]
    values = [float(joint_coordinate(system, joint, state.q[None]).value[0]) for joint in joints]
    locks = tuple(
        PrescribedAngle(name, joint, HeldAngle(value)) for name, joint, value in zip(names, joints, values, strict=True)
    )
    locked = build_system(replace(mechanism, prescribed=(*mechanism.prescribed, *locks)), system)
    v = project_velocity(locked, moment_signals(locked.mechanism, state.time), state.time, state.q, state.v)
    lost = state.v - v
    energy = 0.5 * float(lost @ (sparse_mass(system, state.q) @ lost))
    found = {row.rpartition(" ")[0]: i for i, row in enumerate(locked.rows)}
    rows = tuple(found[name] for name in names)
    return Braked(locked, replace(state, v=v), energy, rows)
