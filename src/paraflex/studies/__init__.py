"""Studies: sets of runs evaluated together and returned as one result; the public functions of the families."""

from paraflex.designs.derivatives.gradient import metric_gradients as metric_gradients
from paraflex.designs.sweep import load_sweep as load_sweep, sweep as sweep
from paraflex.studies.cases import motion_case as motion_case, tracking_case as tracking_case
from paraflex.studies.compare import compare_methods as compare_methods
from paraflex.studies.laws import compare_laws as compare_laws
from paraflex.studies.optimisation.identify import identify as identify, load_identification as load_identification
from paraflex.studies.optimisation.indices import indices as indices, load_indices as load_indices
from paraflex.studies.optimisation.optimise import load_optimisation as load_optimisation, optimise as optimise
from paraflex.studies.sensitivities.study import (
    load_sensitivities as load_sensitivities,
    sensitivities as sensitivities,
)
from paraflex.studies.tracking import run_study as run_study
from paraflex.studies.verification import verify as verify
