"""Designs looked for: what minimises metrics, what reproduces them, and which parameters matter at all."""

from paraflex.studies.optimisation.confidence import Confidence
from paraflex.studies.optimisation.identify import (
    IdentificationResult,
    IdentificationStudy,
    Reached,
    identify,
    load_identification,
)
from paraflex.studies.optimisation.indices import (
    IndicesResult,
    IndicesStudy,
    load_indices,
    sobol_indices,
)
from paraflex.studies.optimisation.objective import Objective, Target
from paraflex.studies.optimisation.optimise import (
    OptimisationResult,
    OptimisationStudy,
    load_optimisation,
    optimise,
)
from paraflex.studies.optimisation.result import SearchResult
from paraflex.studies.optimisation.study import DesignStudy, Search

__all__ = [
    "Confidence",
    "DesignStudy",
    "IdentificationResult",
    "IdentificationStudy",
    "IndicesResult",
    "IndicesStudy",
    "Objective",
    "OptimisationResult",
    "OptimisationStudy",
    "Reached",
    "Search",
    "SearchResult",
    "Target",
    "identify",
    "load_identification",
    "load_indices",
    "load_optimisation",
    "optimise",
    "sobol_indices",
]
