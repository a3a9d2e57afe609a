"""Studies: sets of runs evaluated together and returned as one result."""

from paraflex.designs.derivatives.gradient import metric_gradients as metric_gradients
from paraflex.designs.sweep import (
    SweepResult as SweepResult,
    SweepStudy as SweepStudy,
    load_sweep as load_sweep,
    sweep as sweep,
)
from paraflex.studies.agreement import (
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
from paraflex.studies.law_comparison import LawComparison as LawComparison
from paraflex.studies.laws import LawStudy as LawStudy, compare_laws as compare_laws
from paraflex.studies.optimisation.identify import (
    IdentificationResult as IdentificationResult,
    IdentificationStudy as IdentificationStudy,
    identify as identify,
    load_identification as load_identification,
)
from paraflex.studies.optimisation.indices import (
    IndicesResult as IndicesResult,
    IndicesStudy as IndicesStudy,
    indices as indices,
    load_indices as load_indices,
)
from paraflex.studies.optimisation.objective import Objective as Objective, Target as Target
from paraflex.studies.optimisation.optimise import (
    OptimisationResult as OptimisationResult,
    OptimisationStudy as OptimisationStudy,
    load_optimisation as load_optimisation,
    optimise as optimise,
)
from paraflex.studies.optimisation.study import DesignStudy as DesignStudy
from paraflex.studies.sensitivities.study import (
    Sensitivities as Sensitivities,
    SensitivityStudy as SensitivityStudy,
    load_sensitivities as load_sensitivities,
    sensitivities as sensitivities,
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
