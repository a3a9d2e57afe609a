"""Order of the signals: motors first, then loads in time, then prescribed motions."""

from typing import NamedTuple

from paraflex.mechanism import Mechanism


class Inputs(NamedTuple):
    """Numbers of a mechanism's signals, by which kernels find them, in the order of `pack_signals`.

    Attributes
    ----------
    motors, loads, prescribed : range
        Signal numbers in the mechanism's own order; for loads, of the components that are profiles in time or laws with
        the time, whose signal is the time itself.
    """

    motors: range
    loads: range
    prescribed: range

    @property
    def acting(self) -> int:
        """Number of forces and torques given in time: motors and load components."""
        return self.prescribed.start


def inputs_of(mechanism: Mechanism) -> Inputs:
    """Return the numbers of a mechanism's signals."""
    motors = len(mechanism.motors)
    acting = motors + sum(len(load.profiles) for load in mechanism.loads)
    return Inputs(range(motors), range(motors, acting), range(acting, acting + len(mechanism.prescribed)))
