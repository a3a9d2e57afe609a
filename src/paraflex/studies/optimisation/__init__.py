"""Designs looked for: what minimises metrics, what reproduces them, and which parameters matter at all."""

from paraflex.studies.optimisation.confidence import Confidence as Confidence
from paraflex.studies.optimisation.identify import (
    IdentificationResult as IdentificationResult,
    IdentificationStudy as IdentificationStudy,
    Reached as Reached,
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
from paraflex.studies.optimisation.result import SearchResult as SearchResult
from paraflex.studies.optimisation.study import DesignStudy as DesignStudy, Search as Search
