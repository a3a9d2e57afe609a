"""Is a model to be trusted? Its numbers, its pose, the study it will run: each doubt a finding with a code."""

from paraflex.checks.check import check, check_planned
from paraflex.checks.pose import BALANCED, Examination, examine

__all__ = ["BALANCED", "Examination", "check", "check_planned", "examine"]
