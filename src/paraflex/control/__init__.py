"""Simulations one can step, sampled controllers, and laws for them."""

from paraflex.control.chain import SampledController
from paraflex.control.controllers import Controller, Plant
from paraflex.control.described import ControllerDescription, PIDDescription, StateSpaceDescription
from paraflex.control.loop import ControllerRecord
from paraflex.control.runs import ControlledMotion, ControlledTracking
from paraflex.control.simulation import Saved, Simulation

__all__ = [
    "ControlledMotion",
    "ControlledTracking",
    "Controller",
    "ControllerDescription",
    "ControllerRecord",
    "PIDDescription",
    "Plant",
    "SampledController",
    "Saved",
    "Simulation",
    "StateSpaceDescription",
]
