"""The one line that announces that kernels are being compiled, which a first run waits for.

It goes through Python's logging, under the name "paraflex": to standard error where nobody has set logging up, and
nowhere after `logging.getLogger("paraflex").setLevel("ERROR")`.
"""

from __future__ import annotations

import logging
import multiprocessing
from collections.abc import Callable

NOTICE = "paraflex: compiling kernels, once after an installation or an update; this may take half a minute"
LOG = logging.getLogger("paraflex")

_announced = False


def announce_compiling(say: Callable[[str], None] | None = None) -> None:
    """Announce once per process that kernels are compiled; worker processes leave it to their parent.

    Parameters
    ----------
    say : callable, optional
        Called with the line; it is logged by default, as a warning: what is less urgent Python shows nobody.
    """
    global _announced
    if _announced or multiprocessing.parent_process() is not None:
        return
    _announced = True
    (say or LOG.warning)(NOTICE)
