"""Linear models of mechanisms with named inputs and sensors: poles, zeros, frequency responses."""

from paraflex.linear.linearise import linearise as linearise
from paraflex.linear.model import LinearModel as LinearModel
