"""Mechanisms that come with the package: their names and files, and those that a function builds from numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from paraflex.files import load, plan
from paraflex.files.library import library_names as names, library_text as text
from paraflex.mechanism.raparm import raparm_i
from paraflex.mechanism.rows import chain_of_segments, four_bars_in_a_row

if TYPE_CHECKING:
    from paraflex.control.environment import Environment

__all__ = ["chain_of_segments", "environment", "four_bars_in_a_row", "names", "raparm_i", "text"]


def environment(name: str = "raparm_i", **settings: Any) -> Environment:
    """The environment of a mechanism of the library along the path of its study: see `pf.Environment`.

    Parameters
    ----------
    name : str
        Of the mechanism.
    **settings
        Of the environment.

    Raises
    ------
    InputError
        An unknown name, a mechanism without a path, settings that `pf.Environment` refuses.
    """
    from paraflex.control.environment import Environment

    return Environment(plan(load(name)), **settings)
