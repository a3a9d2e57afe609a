"""Required effort of a rigid motion, and its distribution over the active motors."""

from .allocation import (
    Effort as Effort,
    actuation_condition as actuation_condition,
    allocate as allocate,
    required_effort as required_effort,
)
from .electrical import Electrical as Electrical, electrical as electrical, electrical_findings as electrical_findings
from .feed_forward import FeedForward as FeedForward, TorquePlan as TorquePlan, plan_torques as plan_torques
from .planned import planned_profiles as planned_profiles
