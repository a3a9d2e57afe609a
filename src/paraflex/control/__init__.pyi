from .laws.controllers import Controller as Controller, Plant as Plant
from .laws.described import ControllerDescription as ControllerDescription
from .laws.described_laws import (
    ComputedTorqueDescription as ComputedTorqueDescription,
    LQGDescription as LQGDescription,
    PIDDescription as PIDDescription,
    RateFeedbackDescription as RateFeedbackDescription,
    StateSpaceDescription as StateSpaceDescription,
)
from .laws.designed import DesignedLQG as DesignedLQG
from .loop.chain import SampledController as SampledController
from .loop.run_loop import ControllerRecord as ControllerRecord
from .loop.runs import ControlledMotion as ControlledMotion, ControlledTracking as ControlledTracking
from .loop.simulate import (
    simulate_controlled as simulate_controlled,
    simulate_controlled_motion as simulate_controlled_motion,
)
from .loop.simulation import Saved as Saved, Simulation as Simulation
