# Each figure from the module that its function is in.
from .charts import (
    actuation_condition as actuation_condition,
    bases_along_path as bases_along_path,
    beam_stresses as beam_stresses,
    bode as bode,
    compared_deflections as compared_deflections,
    compared_energies as compared_energies,
    compared_links as compared_links,
    compared_paths as compared_paths,
    controllers as controllers,
    coordinates as coordinates,
    drive_efforts as drive_efforts,
    end_effector_motion as end_effector_motion,
    end_effector_path as end_effector_path,
    energies as energies,
    force_travel as force_travel,
    frame_loads as frame_loads,
    free_travels as free_travels,
    held_frequency_by_states as held_frequency_by_states,
    joint_force_travel as joint_force_travel,
    model_distances as model_distances,
    pole_zero_map as pole_zero_map,
    poles_along_path as poles_along_path,
    reduced_responses as reduced_responses,
    reduction_errors as reduction_errors,
    singular_values as singular_values,
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
    mode_conditions as mode_conditions,
    motion_overview as motion_overview,
    motor_torques as motor_torques,
    phase_diagrams as phase_diagrams,
    point_motions as point_motions,
    point_paths as point_paths,
    sensors as sensors,
    stiffness_travel as stiffness_travel,
    stress_envelope as stress_envelope,
    stress_travel as stress_travel,
    tip_deflections as tip_deflections,
    tracking_distance as tracking_distance,
    tracking_errors as tracking_errors,
)
from .equilibria import buckling_shapes as buckling_shapes, deformed_shapes as deformed_shapes
from .laws import law_comparison as law_comparison
from .maps import response_map as response_map
from .methods import work_precision as work_precision
from .mode_shapes import mode_shapes as mode_shapes
from .optimisation import convergence as convergence, sobol_bars as sobol_bars, targets_reached as targets_reached
from .parallel import parallel_coordinates as parallel_coordinates
from .responses import pareto_front as pareto_front, response_curves as response_curves
from .save import save_figures as save_figures
from .spectra import numerical_damping as numerical_damping
from .workspace import desired_path as desired_path
