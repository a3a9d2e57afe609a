"""Many runs as one result."""

from paraflex.studies.agreement import ModelRuns, Refinement, Verification, reference_model
from paraflex.studies.cases import Case, motion_case, tracking_case
from paraflex.studies.compare import ComparisonOptions, ComparisonStudy, compare_methods
from paraflex.studies.comparison import Measurement, MethodComparison, Reference
from paraflex.studies.optimisation import (
    DesignStudy,
    IdentificationResult,
    IdentificationStudy,
    IndicesResult,
    OptimisationResult,
    OptimisationStudy,
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
from paraflex.studies.sweeps import SweepResult, SweepStudy, load_sweep, sweep
from paraflex.studies.tracking import Simulator, StudyResult, TrackingStudy, run_study
from paraflex.studies.verification import (
    FIDELITIES,
    VerificationOptions,
    VerificationStudy,
    check_model,
    verify,
)

__all__ = [
    "FIDELITIES",
    "Case",
    "ComparisonOptions",
    "ComparisonStudy",
    "DesignStudy",
    "IdentificationResult",
    "IdentificationStudy",
    "IndicesResult",
    "Measurement",
    "MethodComparison",
    "ModelRuns",
    "OptimisationResult",
    "OptimisationStudy",
    "Reference",
    "Refinement",
    "Sensitivities",
    "SensitivityStudy",
    "Simulator",
    "StudyResult",
    "SweepResult",
    "SweepStudy",
    "TrackingStudy",
    "Verification",
    "VerificationOptions",
    "VerificationStudy",
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
