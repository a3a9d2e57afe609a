from .agreement import Refinement as Refinement, Verification as Verification, reference_model as reference_model
from .cases import Case as Case, motion_case as motion_case, tracking_case as tracking_case
from .compare import (
    ComparisonOptions as ComparisonOptions,
    ComparisonStudy as ComparisonStudy,
    compare_methods as compare_methods,
)
from .comparison import Measurement as Measurement, MethodComparison as MethodComparison, Reference as Reference
from .law_comparison import LawComparison as LawComparison
from .laws import LawStudy as LawStudy, compare_laws as compare_laws
from .optimisation.identify import (
    IdentificationResult as IdentificationResult,
    IdentificationStudy as IdentificationStudy,
    identify as identify,
    load_identification as load_identification,
)
from .optimisation.indices import (
    IndicesResult as IndicesResult,
    IndicesStudy as IndicesStudy,
    indices as indices,
    load_indices as load_indices,
)
from .optimisation.objective import Objective as Objective, Target as Target
from .optimisation.optimise import (
    OptimisationResult as OptimisationResult,
    OptimisationStudy as OptimisationStudy,
    load_optimisation as load_optimisation,
    optimise as optimise,
)
from .optimisation.study import DesignStudy as DesignStudy
from .sensitivity import (
    Sensitivities as Sensitivities,
    SensitivityStudy as SensitivityStudy,
    load_sensitivities as load_sensitivities,
    sensitivities as sensitivities,
)
from .sweeps import (
    SweepResult as SweepResult,
    SweepStudy as SweepStudy,
    load_sweep as load_sweep,
    metric_gradients as metric_gradients,
    sweep as sweep,
)
from .tracking import (
    Simulator as Simulator,
    StudyResult as StudyResult,
    TrackingStudy as TrackingStudy,
    run_study as run_study,
)
from .verification import (
    FIDELITIES as FIDELITIES,
    VerificationOptions as VerificationOptions,
    VerificationStudy as VerificationStudy,
    check_model as check_model,
    verify as verify,
)
