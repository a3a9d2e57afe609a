"""Equations of motion of a mechanism: its system of constant arrays, consistent states, equilibria, linearisation."""

from .brake import BrakedSystem as BrakedSystem, brake as brake, held_joints as held_joints
from .coordinates import BodyCoordinates as BodyCoordinates, Marker as Marker, end_markers as end_markers
from .drive import DrivenFreedoms as DrivenFreedoms, driven_freedoms as driven_freedoms
from .inputs import Inputs as Inputs, inputs_of as inputs_of
from .joint_coordinates import (
    axis_angle as axis_angle,
    joint_coordinate as joint_coordinate,
    material_angle as material_angle,
    place_along_beam as place_along_beam,
)
from .linearise import Vibration as Vibration, natural_frequencies as natural_frequencies
from .modal_truncation import missing_rotations as missing_rotations
from .numbers import numbers_of as numbers_of, same_layout as same_layout, with_numbers as with_numbers
from .packing import records as records
from .points import across_chord as across_chord
from .quasi_static import (
    JointMotion as JointMotion,
    balanced_state as balanced_state,
    joint_motions as joint_motions,
    static_equilibrium as static_equilibrium,
)
from .rank import dependence as dependence, redundant_rows as redundant_rows
from .sensors import SensorRows as SensorRows, sensor_readings as sensor_readings, sensor_rows as sensor_rows
from .signals import (
    InputSignals as InputSignals,
    acting_loads as acting_loads,
    constant_signals as constant_signals,
    moment_signals as moment_signals,
    pack_signals as pack_signals,
    piecewise_quintic as piecewise_quintic,
    profile_signal as profile_signal,
    steep_times as steep_times,
    still_signals as still_signals,
)
from .singularity import SingularityMeasure as SingularityMeasure
from .soundness import Closure as Closure, Mobility as Mobility, closure_of as closure_of, mobility as mobility
from .start import pose_at_rest as pose_at_rest, standing_system as standing_system, start_state as start_state
from .state import (
    State as State,
    assembled_position as assembled_position,
    consistent_state as consistent_state,
    momentum as momentum,
    project_position as project_position,
    project_velocity as project_velocity,
    reference_pose as reference_pose,
    undeformed as undeformed,
    undeformed_motion as undeformed_motion,
)
from .system import System as System, build_system as build_system
