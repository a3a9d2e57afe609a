"""Motion of a rigid mechanism that its drives determine: kinematics, inverse dynamics, and properties of the motion."""

from .flywheel import Flywheel as Flywheel, flywheel as flywheel
from .motion import DrivenMotion as DrivenMotion, kinematics as kinematics, torques as torques
