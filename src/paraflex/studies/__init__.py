"""Many runs as one result."""

from paraflex.studies.agreement import agreement
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
    "ModelRuns",
    "Refinement",
    "Simulator",
    "StudyResult",
    "Verification",
    "VerificationOptions",
    "agreement",
    "check_model",
    "reference_model",
    "run_study",
    "verify",
]
