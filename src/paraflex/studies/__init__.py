"""Many runs as one result."""

from paraflex.studies.agreement import (
    ModelRuns as ModelRuns,
    Refinement as Refinement,
    Verification as Verification,
    reference_model as reference_model,
)
from paraflex.studies.cases import Case as Case, motion_case as motion_case, tracking_case as tracking_case
from paraflex.studies.compare import (
    ComparisonOptions as ComparisonOptions,
    ComparisonStudy as ComparisonStudy,
    compare_methods as compare_methods,
)
from paraflex.studies.comparison import (
    Measurement as Measurement,
    MethodComparison as MethodComparison,
    Reference as Reference,
)
from paraflex.studies.optimisation import (
    DesignStudy as DesignStudy,
    IdentificationResult as IdentificationResult,
    IdentificationStudy as IdentificationStudy,
    IndicesResult as IndicesResult,
    OptimisationResult as OptimisationResult,
    OptimisationStudy as OptimisationStudy,
    identify as identify,
    indices as indices,
    load_identification as load_identification,
    load_indices as load_indices,
    load_optimisation as load_optimisation,
    optimise as optimise,
)
from paraflex.studies.sensitivities import (
    Sensitivities as Sensitivities,
    SensitivityStudy as SensitivityStudy,
    load_sensitivities as load_sensitivities,
    metric_gradients as metric_gradients,
    sensitivities as sensitivities,
)
from paraflex.studies.sweeps import (
    SweepResult as SweepResult,
    SweepStudy as SweepStudy,
    load_sweep as load_sweep,
    sweep as sweep,
)
from paraflex.studies.tracking import (
    Simulator as Simulator,
    StudyResult as StudyResult,
    TrackingStudy as TrackingStudy,
    run_study as run_study,
)
from paraflex.studies.verification import (
    FIDELITIES as FIDELITIES,
    VerificationOptions as VerificationOptions,
    VerificationStudy as VerificationStudy,
    check_model as check_model,
    verify as verify,
)
