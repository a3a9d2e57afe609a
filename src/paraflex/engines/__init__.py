"""Adapters that simulate the same mechanism, torques and initial state in external engines, for comparison."""

from .common import ENGINES as ENGINES, check_dwell as check_dwell, check_engine as check_engine
