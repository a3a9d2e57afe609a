"""Mechanisms that come with the package: names and files, and functions that build mechanisms from parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .files import load, plan
from .files.library import library_names as names, library_text as text
from .mechanism.raparm import raparm_i
from .mechanism.rows import chain_of_segments, four_bars_in_a_row

if TYPE_CHECKING:
    from .control.environment import Environment
    from .control.vector_environment import VectorEnvironment

__all__ = ["chain_of_segments", "environment", "environments", "four_bars_in_a_row", "names", "raparm_i", "text"]


def environment(name: str = "raparm_i", **settings: Any) -> Environment:
    """Return the environment of a library mechanism along the path of its study: see `pf.Environment`.

    Parameters
    ----------
    name : str
        Name of the mechanism.
    **settings
        Keyword arguments of `pf.Environment`.

    Raises
    ------
    InputError
        The name is unknown, the mechanism has no path, or `pf.Environment` refuses the settings.
    """
    from .control.environment import Environment

    return Environment(plan(load(name)), **settings)


def environments(name: str = "raparm_i", num_envs: int = 1, **settings: Any) -> VectorEnvironment:
    """Return `num_envs` environments of a library mechanism as one: see `environment` and `pf.VectorEnvironment`."""
    from .control.vector_environment import VectorEnvironment

    return VectorEnvironment(plan(load(name)), num_envs, **settings)
