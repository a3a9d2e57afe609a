"""Few flexible coordinates for all bodies together, chosen along a motion, for runs of the same equations."""

from paraflex.reduced_bodies.mechanism import Size as Size, reduced_mechanism as reduced_mechanism, size_of as size_of
