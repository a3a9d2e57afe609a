"""Few flexible coordinates for all bodies together, chosen along a motion, for runs of the same equations."""

from .mechanism import Size as Size, reduced_mechanism as reduced_mechanism, size_of as size_of
