"""Order of the functions of time: motors first, then loads in time, then prescribed motions."""

from __future__ import annotations

from typing import NamedTuple

from paraflex.mechanism import Mechanism


class Inputs(NamedTuple):
    """Numbers of a mechanism's signals, in the order of `pack_signals`, by which kernels find them.

    Attributes
    ----------
    motors, loads, prescribed : range
        In the order of the mechanism's own; of loads those components that are laws in time.
    """

    motors: range
    loads: range
    prescribed: range

    @property
    def acting(self) -> int:
        """Number of forces and torques given in time: those of motors, and components of loads."""
        return self.prescribed.start


def inputs_of(mechanism: Mechanism) -> Inputs:
    """The numbers of a mechanism's signals."""
    motors = len(mechanism.motors)
    acting = motors + sum(len(load.laws) for load in mechanism.loads)
    return Inputs(range(motors), range(motors, acting), range(acting, acting + len(mechanism.prescribed)))
