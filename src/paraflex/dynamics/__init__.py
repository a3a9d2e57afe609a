"""From a mechanism to a system of equations: constant arrays, energies, consistent states."""

from paraflex.dynamics.brake import Braked, brake
from paraflex.dynamics.chord import across_chord
from paraflex.dynamics.coordinates import BodyCoordinates, Marker, end_markers, node_marker
from paraflex.dynamics.drive import Reach, reach
from paraflex.dynamics.equilibrium import static_equilibrium
from paraflex.dynamics.joint_coordinates import (
    JointCoordinate,
    axis_angle,
    joint_coordinate,
    material_angle,
    place_along_beam,
)
from paraflex.dynamics.linearise import Vibration, natural_frequencies
from paraflex.dynamics.numbers import numbers_of, same_layout, with_numbers
from paraflex.dynamics.packing import records
from paraflex.dynamics.quasi_static import JointMotion, balanced_state, joint_motions
from paraflex.dynamics.rank import Dependence, dependence, redundant_rows
from paraflex.dynamics.reduction import MissedTurn, missed_turns
from paraflex.dynamics.signals import InputSignals, constant_signals, moment_signals, pack_signals, piecewise_quintic
from paraflex.dynamics.singularity import SingularityMeasure
from paraflex.dynamics.soundness import Closure, Mobility, Redundancy, closure_of, mobility, undeformed
from paraflex.dynamics.start import start_state
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
    "Braked",
    "Closure",
    "Dependence",
    "InputSignals",
    "JointCoordinate",
    "JointMotion",
    "Marker",
    "MissedTurn",
    "Mobility",
    "Reach",
    "Redundancy",
    "SingularityMeasure",
    "State",
    "System",
    "Vibration",
    "across_chord",
    "axis_angle",
    "balanced_state",
    "brake",
    "build_system",
    "closure_of",
    "consistent_state",
    "constant_signals",
    "dependence",
    "end_markers",
    "joint_coordinate",
    "joint_motions",
    "material_angle",
    "missed_turns",
    "mobility",
    "moment_signals",
    "momentum",
    "natural_frequencies",
    "node_marker",
    "numbers_of",
    "pack_signals",
    "piecewise_quintic",
    "place_along_beam",
    "project_position",
    "project_velocity",
    "reach",
    "records",
    "redundant_rows",
    "reference_pose",
    "same_layout",
    "start_state",
    "static_equilibrium",
    "undeformed",
    "with_numbers",
]
