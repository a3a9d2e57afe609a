"""Many runs as one result."""

from paraflex.studies.agreement import agreement
from paraflex.studies.cases import Case, motion_case, tracking_case
from paraflex.studies.compare import ComparisonOptions, compare_methods
from paraflex.studies.comparison import Measurement, MethodComparison, Reference
from paraflex.studies.optimisation import (
    DesignStudy,
    IdentificationResult,
    IndicesResult,
    OptimisationResult,
    identify,
    load_identification,
    load_indices,
    load_optimisation,
    optimise,
    sobol_indices,
)
from paraflex.studies.sensitivities import (
    Sensitivities,
    SensitivityStudy,
    load_sensitivities,
    metric_gradients,
    sensitivities,
)
from paraflex.studies.sweeps import SweepProgress, SweepResult, SweepStudy, load_sweep, sweep
from paraflex.studies.tracking import Simulator, StudyResult, run_study
from paraflex.studies.verification import (
    FIDELITIES,
    ModelRuns,
    Refinement,
    Verification,
    VerificationOptions,
    check_model,
    reference_model,
    verify,
)

__all__ = [
    "FIDELITIES",
    "Case",
    "ComparisonOptions",
    "DesignStudy",
    "IdentificationResult",
    "IndicesResult",
    "Measurement",
    "MethodComparison",
    "ModelRuns",
    "OptimisationResult",
    "Reference",
    "Refinement",
    "Sensitivities",
    "SensitivityStudy",
    "Simulator",
    "StudyResult",
    "SweepProgress",
    "SweepResult",
    "SweepStudy",
    "Verification",
    "VerificationOptions",
    "agreement",
    "check_model",
    "compare_methods",
    "identify",
    "load_identification",
    "load_indices",
    "load_optimisation",
    "load_sensitivities",
    "load_sweep",
    "metric_gradients",
    "motion_case",
    "optimise",
    "reference_model",
    "run_study",
    "sensitivities",
    "sobol_indices",
    "sweep",
    "tracking_case",
    "verify",
]
