"""Studies: many runs, one result."""

from paraflex.studies.tracking import StudyResult, run_study

__all__ = ["StudyResult", "run_study"]
