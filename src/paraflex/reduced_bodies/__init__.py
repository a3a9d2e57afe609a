"""Few flexible coordinates for all bodies together, chosen along a motion, for runs of the same equations."""

from paraflex.reduced_bodies.mechanism import reduced_mechanism as reduced_mechanism
from paraflex.reduced_bodies.size import Size as Size, size_of as size_of
