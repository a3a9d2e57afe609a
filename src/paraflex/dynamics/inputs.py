"""Which function of time is whose: those of the motors come first, then those of prescribed motions."""

from __future__ import annotations

from typing import NamedTuple

from paraflex.mechanism import Mechanism


class Inputs(NamedTuple):
    """Numbers of a mechanism's signals, as `pack_signals` orders them and kernels ask for them.

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
