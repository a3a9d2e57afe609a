"""Checks of a model before it runs: its numbers, its pose, its study; each doubt is a finding with a code."""

from .check import check as check, check_planned as check_planned
from .pose import BALANCED as BALANCED, Examination as Examination, examine as examine
