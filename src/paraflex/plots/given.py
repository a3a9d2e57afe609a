"""Arguments of plotting functions: results of the right kind, or the folder or file that holds them."""

import os
from collections.abc import Callable, Mapping
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

import xarray as xr
from matplotlib.figure import Figure

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError
from paraflex.results.kinds import kind_of, wrong_kind
from .catalogue import CATALOGUE
from .style import journal_style

D = TypeVar("D")
P = ParamSpec("P")

_NUMBERS = "give what the study's result has as plain numbers, or the folder it was written to"


def drawn(function: Callable[Concatenate[D, P], Figure]) -> Callable[Concatenate[D | str | Path, P], Figure]:
    """Decorate a plotting function: it draws in the common style and accepts results or their folder or file."""
    take: Callable[..., Figure] = checked_arguments(
        figures=_NUMBERS,
        table="give the folder of a study of many runs",
    )(function)

    first = next(iter(signature(function).parameters))

    @wraps(function)
    def draw_results(*args: Any, **kwargs: Any) -> Figure:
        data: Any = args[0] if args else kwargs.pop(first, None)
        if isinstance(data, str | os.PathLike | xr.Dataset):
            listed = ((kind, one) for kind, figures in CATALOGUE.items() for one in figures)
            data = _of_a_kind(data, {kind: one.takes for kind, one in listed if one.name == function.__name__})
        try:
            with journal_style():
                return take(data, *args[1:], **kwargs)
        except KeyError as error:
            if isinstance(data, Mapping) and not isinstance(data, xr.Dataset) and error.args[0] not in data:
                raise InputError(f'lacks "{error.args[0]}"', field=first, remedy=_NUMBERS) from error
            raise

    draw_results.__doc__ = f"{function.__doc__}\n\nWhat all figures take and refuse: see `paraflex.plots`."
    return draw_results


def _of_a_kind(data: Any, kinds: Mapping[str, str]) -> Any:
    """Return results, read from a folder or file if need be, and check that their kind is one of `kinds`.

    `kinds` maps each kind to the part of the results that the figure takes.
    """
    if isinstance(data, xr.Dataset):
        if kind_of(data) not in kinds:
            raise wrong_kind(kind_of(data), kinds)
        return data
    from .sources import open_source

    source = open_source(data)
    if source.kind not in kinds:
        raise wrong_kind(source.kind, kinds, str(data))
    return source.designs if kinds[source.kind] == "designs" else source.data
