"""Linear models of mechanisms with named inputs and outputs: poles, zeros and frequency responses."""

from paraflex.linear.along import PosesAlong as PosesAlong, poses_along as poses_along
from paraflex.linear.discrete import SampledModel as SampledModel
from paraflex.linear.linearise import linearise as linearise
from paraflex.linear.model import LinearModel as LinearModel
from paraflex.linear.reduced import ReducedModel as ReducedModel
from paraflex.linear.reduction import reduce as reduce
from paraflex.linear.states_needed import states_needed as states_needed
from paraflex.linear.varying import VaryingModel as VaryingModel, linearise_along as linearise_along
