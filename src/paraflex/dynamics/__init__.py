"""From a mechanism to a system of equations: constant arrays, energies, consistent states."""

from paraflex.dynamics.coordinates import BodyCoordinates, Marker, node_marker
from paraflex.dynamics.equilibrium import static_equilibrium
from paraflex.dynamics.signals import InputSignals, constant_signals, moment_signals, pack_signals, piecewise_quintic
from paraflex.dynamics.start import start_state
from paraflex.dynamics.state import (
    State,
    consistent_state,
    momentum,
    project_position,
    project_velocity,
    redundant_rows,
    reference_pose,
)
from paraflex.dynamics.system import System, build_system

__all__ = [
    "BodyCoordinates",
    "InputSignals",
    "Marker",
    "State",
    "System",
    "build_system",
    "consistent_state",
    "constant_signals",
    "moment_signals",
    "momentum",
    "node_marker",
    "pack_signals",
    "piecewise_quintic",
    "project_position",
    "project_velocity",
    "redundant_rows",
    "reference_pose",
    "start_state",
    "static_equilibrium",
]
