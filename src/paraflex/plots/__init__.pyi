# Each figure from the module that its function is in.
from .agreement import (
    compared_deflections as compared_deflections,
    compared_links as compared_links,
    compared_paths as compared_paths,
    model_distances as model_distances,
)
from .charts import (
    convergence as convergence,
    elasticities as elasticities,
    force_travel as force_travel,
    free_travels as free_travels,
    joint_force_travel as joint_force_travel,
    pareto_front as pareto_front,
    response_curves as response_curves,
    sobol_bars as sobol_bars,
    stiffness_travel as stiffness_travel,
    stress_travel as stress_travel,
    targets_reached as targets_reached,
)
from .controlled import controllers as controllers
from .drawing import mechanism_drawing as mechanism_drawing
from .driving import (
    actuation_condition as actuation_condition,
    mode_comparison as mode_comparison,
    mode_conditions as mode_conditions,
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
from .laws import law_comparison as law_comparison
from .linear import (
    bode as bode,
    pole_zero_map as pole_zero_map,
    poles_along_path as poles_along_path,
    singular_values as singular_values,
)
from .maps import response_map as response_map
from .measured import sensors as sensors
from .methods import work_precision as work_precision
from .mode_shapes import mode_shapes as mode_shapes
from .modes import motor_torques as motor_torques, tracking_errors as tracking_errors
from .parallel import parallel_coordinates as parallel_coordinates
from .phase import link_phases as link_phases, phase_diagrams as phase_diagrams
from .reduction import (
    bases_along_path as bases_along_path,
    held_frequency_by_states as held_frequency_by_states,
    reduced_responses as reduced_responses,
    reduction_errors as reduction_errors,
)
from .save import save_figures as save_figures
from .spectra import numerical_damping as numerical_damping
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
