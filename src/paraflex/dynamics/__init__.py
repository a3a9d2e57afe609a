"""From a mechanism to a system of equations: constant arrays, energies, consistent states."""

from paraflex.dynamics.coordinates import BodyCoordinates, Marker, node_marker
from paraflex.dynamics.drive import Reach, reach
from paraflex.dynamics.equilibrium import static_equilibrium
from paraflex.dynamics.linearise import Vibration, natural_frequencies
from paraflex.dynamics.rank import Dependence, dependence, redundant_rows
from paraflex.dynamics.signals import InputSignals, constant_signals, pack_signals, piecewise_quintic
from paraflex.dynamics.soundness import Mobility, Redundancy, Start, mobility, start_of, undeformed
from paraflex.dynamics.state import (
    State,
    consistent_state,
    momentum,
    project_position,
    project_velocity,
    reference_pose,
)
from paraflex.dynamics.system import System, build_system

__all__ = [
    "BodyCoordinates",
    "Dependence",
    "InputSignals",
    "Marker",
    "Mobility",
    "Reach",
    "Redundancy",
    "Start",
    "State",
    "System",
    "Vibration",
    "build_system",
    "consistent_state",
    "constant_signals",
    "dependence",
    "mobility",
    "momentum",
    "natural_frequencies",
    "node_marker",
    "pack_signals",
    "piecewise_quintic",
    "project_position",
    "project_velocity",
    "reach",
    "redundant_rows",
    "reference_pose",
    "start_of",
    "static_equilibrium",
    "undeformed",
]
