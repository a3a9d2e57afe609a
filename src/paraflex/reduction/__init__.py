"""Reduced flexible coordinates for the bodies of a mechanism, chosen along a motion, for runs of the same equations."""

from paraflex.reduction.reduced import reduced_mechanism as reduced_mechanism
from paraflex.reduction.size import Size as Size, size_of as size_of
