"""Designs looked for: what minimises metrics, what reproduces them, and which parameters matter at all."""

from paraflex.studies.optimisation.confidence import Confidence
from paraflex.studies.optimisation.identify import IdentificationResult, Reached, identify
from paraflex.studies.optimisation.indices import (
    IndicesResult,
    IndicesStudy,
    SobolIndices,
    load_indices,
    sobol_indices,
)
from paraflex.studies.optimisation.objective import Objective, Target
from paraflex.studies.optimisation.optimise import OptimisationResult, optimise
from paraflex.studies.optimisation.result import SearchResult
from paraflex.studies.optimisation.session import Progress
from paraflex.studies.optimisation.study import DesignStudy, Search, load_identification, load_optimisation

__all__ = [
    "Confidence",
    "DesignStudy",
    "IdentificationResult",
    "IndicesResult",
    "IndicesStudy",
    "Objective",
    "OptimisationResult",
    "Progress",
    "Reached",
    "Search",
    "SearchResult",
    "SobolIndices",
    "Target",
    "identify",
    "load_identification",
    "load_indices",
    "load_optimisation",
    "optimise",
    "sobol_indices",
]
