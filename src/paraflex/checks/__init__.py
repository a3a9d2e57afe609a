"""Is a model to be trusted? Its numbers, its pose, the study it will run: each doubt a finding with a code."""

from paraflex.checks.check import check
from paraflex.checks.pose import BALANCED, Examination, examine

__all__ = ["BALANCED", "Examination", "check", "examine"]
