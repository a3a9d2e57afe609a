"""Reduced flexible coordinates for the bodies of a mechanism, chosen along a motion, for runs of the same equations."""

from paraflex.reduction.reduced import Size as Size, reduced_mechanism as reduced_mechanism, size_of as size_of
