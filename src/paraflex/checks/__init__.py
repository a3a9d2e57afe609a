"""Is a model to be trusted? Its numbers, its pose, the study it will run: each doubt a finding with a code."""

from paraflex.checks.check import check as check, check_planned as check_planned
from paraflex.checks.pose import BALANCED as BALANCED, Examination as Examination, examine as examine
