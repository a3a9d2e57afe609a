"""Linear models of mechanisms with named inputs and outputs: poles, zeros and frequency responses."""

from .along import PosesAlong as PosesAlong, poses_along as poses_along
from .discrete import SampledModel as SampledModel
from .linearise import linearise as linearise
from .model import LinearModel as LinearModel
from .reduced import ReducedModel as ReducedModel
from .reduction import reduce as reduce
from .states_needed import states_needed as states_needed
from .varying import VaryingModel as VaryingModel, linearise_along as linearise_along
