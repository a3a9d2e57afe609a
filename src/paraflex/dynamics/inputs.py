"""Order of the functions of time: motors first, then prescribed motions."""

from __future__ import annotations

from typing import NamedTuple

from paraflex.mechanism import Mechanism


class Inputs(NamedTuple):
    """Numbers of a mechanism's signals, in the order of `pack_signals`, by which kernels find them.

    Attributes
    ----------
    motors, prescribed : range
        In the order of the mechanism's own.
    """

    motors: range
    prescribed: range


def inputs_of(mechanism: Mechanism) -> Inputs:
    """The numbers of a mechanism's signals."""
    motors = len(mechanism.motors)
    return Inputs(range(motors), range(motors, motors + len(mechanism.prescribed)))
