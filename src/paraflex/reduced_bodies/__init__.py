"""Few flexible coordinates for all bodies together, chosen along a motion, for runs of the same equations."""

from .mechanism import (
    AUTO as AUTO,
    Reduction as Reduction,
    Size as Size,
    planned_reduction as planned_reduction,
    reduced_mechanism as reduced_mechanism,
    reduced_task as reduced_task,
    size_of as size_of,
)
