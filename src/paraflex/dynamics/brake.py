"""Brakes: joints locked from an instant on, at the angle or travel they have at that instant."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from paraflex.arrays import Array
from paraflex.mechanism import PrescribedAngle, TimeProfile
from paraflex.mechanism.profiles import ConstantSpeed
from .following import driven_rows
from .joint_coordinates import joint_value
from .signals import moment_signals
from .sparse import sparse_mass
from .state import State, project_velocity
from .system import System, build_system


@dataclass(frozen=True)
class BrakedSystem:
    """A system whose brakes have engaged.

    Attributes
    ----------
    system : System
        System with the joints locked; its coordinates are those of the free system.
    state : State
        State just after the impact.
    energy : float
        Kinetic energy dissipated by the brakes [J].
    rows : tuple of int
        Row numbers of the locked joints in the system, in the order in which the joints were named.
    """

    system: System
    state: State
    energy: float
    rows: tuple[int, ...]

    def holding(self, multipliers: Array) -> Array:
        """Return the torques of the brakes (k, joints), signed as those of motors [N m, N], from multipliers (k, m)."""
        # Phi_q^T lambda is on the left-hand side of the equations, a motor's torque on the right-hand side.
        return -multipliers[:, list(self.rows)]


def brake(system: System, state: State, joints: Sequence[str]) -> BrakedSystem:
    """Lock joints at a state by a plastic impact.

    The velocities after the impact are the nearest, in the mass metric, that the locked joints allow: v+ = v - M^-1 C^T
    (C M^-1 C^T)^-1 C v, with C the Jacobian of constraints and locked joints. The impact dissipates the kinetic energy
    (v - v+)^T M (v - v+) / 2.

    Parameters
    ----------
    system : System
        System of the free mechanism.
    state : State
        State just before the impact.
    joints : sequence of str
        Joints to lock; their angle or travel, slopes of beams included, is kept.

    Returns
    -------
    BrakedSystem
        Locked system, its state after the impact, and the dissipated energy.

    Raises
    ------
    InconsistentConstraintsError
        A joint is moved by a prescribed motion.
    """
    return held_joints(
        system, state, {joint: ConstantSpeed(joint_value(system, joint, state.q), 0.0) for joint in joints}
    )


def held_joints(system: System, state: State, profiles: Mapping[str, TimeProfile]) -> BrakedSystem:
    """Hold joints on profiles in time from a state on: see `brake` for the change of velocities.

    Parameters
    ----------
    system, state
        See `brake`.
    profiles : mapping of str to TimeProfile
        Angle or travel of each joint over time, which at the state agrees with it.
    """
    mechanism = system.mechanism
    holds = tuple(PrescribedAngle(f"brake of {joint}", joint, profile) for joint, profile in profiles.items())
    locked = build_system(replace(mechanism, prescribed=(*mechanism.prescribed, *holds)), system)
    v = project_velocity(locked, moment_signals(locked.mechanism, state.time), state.time, state.q, state.v)
    lost = state.v - v
    energy = 0.5 * float(lost @ (sparse_mass(system, state.q) @ lost))
    rows = tuple(row for _, row in driven_rows(locked))[len(mechanism.prescribed) :]
    return BrakedSystem(locked, replace(state, v=v), energy, rows)
