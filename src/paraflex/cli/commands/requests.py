"""Requests: dataclasses whose fields are what a shell may give, each with its `typer.Option` or `typer.Argument`.

A command is a function of one request or several. The shell sees an option for each of their fields; a field that is
itself a request, of options that several commands share, stands for its own fields.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import MISSING, fields, is_dataclass
from functools import wraps
from typing import Any, get_type_hints

import typer


def with_options(command: Callable[..., int | None]) -> Callable[..., None]:
    """The command as Typer takes it, with a parameter for each option; what it returns is the exit code."""

    @wraps(command)
    def called(**given: Any) -> None:
        raise typer.Exit(_filled(command, given) or 0)

    called.__signature__ = inspect.Signature([*_parameters(command)])  # type: ignore[attr-defined]
    called.__annotations__ = {}
    return called


def flags(request: object) -> dict[str, str]:
    """The flag of every option of a request, by its field: {"tolerance": "--tol"}."""
    return {one.name: _flag(one) for one in _parameters(type(request)) if _is_option(one)}


def _parameters(owner: Any) -> Iterator[inspect.Parameter]:
    """What a function or a request is given, in order, the fields of requests in the place of these."""
    for name, (kind, default) in _given(owner).items():
        if is_dataclass(kind):
            yield from _parameters(kind)
        else:
            yield inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)


def _given(owner: Any) -> dict[str, tuple[Any, Any]]:
    """Kind and default by name; None for a default that is made anew each time."""
    kinds = get_type_hints(owner, include_extras=True)
    if is_dataclass(owner):
        none = inspect.Parameter.empty
        defaults = {
            one.name: one.default if one.default is not MISSING else none if one.default_factory is MISSING else None
            for one in fields(owner)
        }
    else:
        defaults = {name: one.default for name, one in inspect.signature(owner).parameters.items()}
    return {name: (kinds[name], default) for name, default in defaults.items()}


def _filled(owner: Any, given: dict[str, Any]) -> Any:
    """The function or request called with what a shell has given; what it has not is left to the defaults."""
    values = {
        name: _filled(kind, given) if is_dataclass(kind) else given[name] for name, (kind, _) in _given(owner).items()
    }
    return owner(**{name: value for name, value in values.items() if value is not None})


def _is_option(one: inspect.Parameter) -> bool:
    return isinstance(one.annotation.__metadata__[0], typer.models.OptionInfo)


def _flag(one: inspect.Parameter) -> str:
    info = one.annotation.__metadata__[0]
    # Typer keeps the first name as the default.
    named = [str(name) for name in (info.default, *(info.param_decls or ())) if str(name).startswith("--")]
    return named[0].partition("/")[0] if named else f"--{one.name.replace('_', '-')}"
