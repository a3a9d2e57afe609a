"""Required effort of a rigid motion, and its distribution over the active motors."""

from paraflex.actuation.allocation import (
    Effort,
    actuation_condition,
    allocate,
    required_effort,
)
from paraflex.actuation.feed_forward import FeedForward, TorquePlan, plan_torques

__all__ = [
    "Effort",
    "FeedForward",
    "TorquePlan",
    "actuation_condition",
    "allocate",
    "plan_torques",
    "required_effort",
]
