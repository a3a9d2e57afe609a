from .chain import SampledController as SampledController
from .controllers import Controller as Controller, Plant as Plant
from .described import ControllerDescription as ControllerDescription
from .described_laws import (
    ComputedTorqueDescription as ComputedTorqueDescription,
    LQGDescription as LQGDescription,
    PIDDescription as PIDDescription,
    RateFeedbackDescription as RateFeedbackDescription,
    StateSpaceDescription as StateSpaceDescription,
)
from .designed import DesignedLQG as DesignedLQG
from .loop import ControllerRecord as ControllerRecord
from .runs import ControlledMotion as ControlledMotion, ControlledTracking as ControlledTracking
from .simulate import (
    simulate_controlled as simulate_controlled,
    simulate_controlled_motion as simulate_controlled_motion,
)
from .simulation import Saved as Saved, Simulation as Simulation
