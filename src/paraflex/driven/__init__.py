"""Motion of a rigid mechanism that its drives determine: kinematics, inverse dynamics, and properties of the motion."""

from .assemblies import assemblies_of as assemblies_of
from .exact import Drive as Drive, ExactMotion as ExactMotion
from .features import (
    KinematicFeatures as KinematicFeatures,
    Trail as Trail,
    Transmission as Transmission,
    features_of as features_of,
)
from .flywheel import Flywheel as Flywheel, flywheel as flywheel
from .motion import DrivenMotion as DrivenMotion, kinematics as kinematics, torques as torques
