"""Simulations one can step, sampled controllers, and laws for them."""

from paraflex.control.chain import SampledController
from paraflex.control.computed_torque import ComputedTorque
from paraflex.control.controllers import Controller, Plant
from paraflex.control.laws import JointPID, internal_torques, joint_gains
from paraflex.control.loop import ControllerRecord
from paraflex.control.rates import RateFeedback
from paraflex.control.runs import ControlledMotion, ControlledTracking
from paraflex.control.simulation import Saved, Simulation

__all__ = [
    "ComputedTorque",
    "ControlledMotion",
    "ControlledTracking",
    "Controller",
    "ControllerRecord",
    "JointPID",
    "Plant",
    "RateFeedback",
    "SampledController",
    "Saved",
    "Simulation",
    "internal_torques",
    "joint_gains",
]
