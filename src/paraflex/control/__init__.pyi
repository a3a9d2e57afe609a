from .laws.controllers import Controller as Controller, Plant as Plant
from .laws.described import ControllerDescription as ControllerDescription
from .laws.kinds.lqg import DesignedLQG as DesignedLQG
from .laws.kinds.state_space import StateSpaceLaw as StateSpaceLaw
from .laws.law import Law as Law, StartedLaw as StartedLaw, given as given
from .laws.linear_law import LinearLaw as LinearLaw
from .loop.chain import SampledController as SampledController
from .loop.run_loop import ControllerRecord as ControllerRecord
from .loop.runs import ControlledMotion as ControlledMotion, ControlledTracking as ControlledTracking
from .loop.simulate import (
    simulate_controlled as simulate_controlled,
    simulate_controlled_motion as simulate_controlled_motion,
)
from .loop.simulation import Saved as Saved, Simulation as Simulation
