# Each figure from the module that its function is in.
from .charts import (
    compared_deflections as compared_deflections,
    compared_energies as compared_energies,
    compared_links as compared_links,
    compared_paths as compared_paths,
    compared_torques as compared_torques,
    force_travel as force_travel,
    free_travels as free_travels,
    joint_force_travel as joint_force_travel,
    law_comparison as law_comparison,
    link_differences as link_differences,
    mode_conditions as mode_conditions,
    model_distances as model_distances,
    numerical_damping as numerical_damping,
    stiffness_travel as stiffness_travel,
    stress_travel as stress_travel,
    work_precision as work_precision,
)
from .controlled import controllers as controllers
from .derivatives import elasticities as elasticities
from .drawing import mechanism_drawing as mechanism_drawing
from .driving import (
    actuation_condition as actuation_condition,
    mode_comparison as mode_comparison,
    tracking_distance as tracking_distance,
)
from .energy import energies as energies
from .equilibria import buckling_shapes as buckling_shapes, deformed_shapes as deformed_shapes
from .free_motion import (
    coordinates as coordinates,
    motion_overview as motion_overview,
    point_motions as point_motions,
    point_paths as point_paths,
)
from .linear import (
    bode as bode,
    pole_zero_map as pole_zero_map,
    poles_along_path as poles_along_path,
    singular_values as singular_values,
)
from .maps import response_map as response_map
from .measured import sensors as sensors
from .mode_shapes import mode_shapes as mode_shapes
from .modes import motor_torques as motor_torques, tracking_errors as tracking_errors
from .optimisation import convergence as convergence, sobol_bars as sobol_bars, targets_reached as targets_reached
from .parallel import parallel_coordinates as parallel_coordinates
from .phase import link_phases as link_phases, phase_diagrams as phase_diagrams
from .reduction import (
    bases_along_path as bases_along_path,
    held_frequency_by_states as held_frequency_by_states,
    reduced_responses as reduced_responses,
    reduction_errors as reduction_errors,
)
from .responses import pareto_front as pareto_front, response_curves as response_curves
from .save import save_figures as save_figures
from .stress import (
    beam_stresses as beam_stresses,
    drive_efforts as drive_efforts,
    frame_loads as frame_loads,
    joint_motions as joint_motions,
    stress_envelope as stress_envelope,
)
from .time_series import (
    end_effector_motion as end_effector_motion,
    joint_forces as joint_forces,
    link_deflections as link_deflections,
    link_motions as link_motions,
    tip_deflections as tip_deflections,
)
from .workspace import desired_path as desired_path, end_effector_path as end_effector_path
