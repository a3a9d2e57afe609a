"""Requests: dataclasses whose fields are options of a command, each with its `typer.Option` or `typer.Argument`.

The shell sees an option for each field. A field that is itself a request holds options that several commands share;
its fields are listed in its place.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, get_type_hints

import typer

from paraflex.errors import InputError


def with_options(request: type, answer: Callable[[Any], int | None]) -> Callable[..., None]:
    """Return a Typer command with a parameter for each option of its request; `answer` returns the exit code."""

    def called(**given: Any) -> None:
        raise typer.Exit(answer(filled(request, given)) or 0)

    called.__signature__ = inspect.Signature([*_parameters(request)])  # type: ignore[attr-defined]
    called.__annotations__ = {}
    return called


def flags(request: object) -> dict[str, str]:
    """Return the flag of every option of a request by its field: {"tolerance": "--tol"}."""
    return {
        one.name: _flag(one)
        for one in _parameters(type(request))
        if isinstance(one.annotation.__metadata__[0], typer.models.OptionInfo)
    }


@contextmanager
def flagged(request: object, *, first: bool = False) -> Iterator[None]:
    """Replace the field in errors within the context by the option's flag, in whatever table the field is.

    The field is the last part of its dotted name or, with `first`, the first part: "loads" of "loads.stage.T.x".
    """
    try:
        yield
    except InputError as error:
        flag = flags(request).get(error.field.partition(".")[0] if first else error.field.rpartition(".")[2])
        raise (error if flag is None else error.at(flag)) from None


def conflict(problem: str, flag: str, value: object) -> InputError:
    """Return the error of an option that does not go with another."""
    return InputError(problem, field=flag, value=value, remedy="leave one of them out")


def _parameters(request: Any) -> Iterator[inspect.Parameter]:
    """Yield the parameters of a request in order, with the fields of nested requests in their place."""
    kinds = get_type_hints(request, include_extras=True)
    for one in fields(request):
        if is_dataclass(kinds[one.name]):
            yield from _parameters(kinds[one.name])
            continue
        default = one.default
        if default is MISSING:
            # None stands for a default made by a factory.
            default = inspect.Parameter.empty if one.default_factory is MISSING else None
        yield inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kinds[one.name])


def filled(request: Any, given: dict[str, Any]) -> Any:
    """Return the request filled with values from the shell; fields without a value (None) take their defaults."""
    kinds = get_type_hints(request)
    values = {
        one.name: filled(kinds[one.name], given) if is_dataclass(kinds[one.name]) else given[one.name]
        for one in fields(request)
    }
    return request(**{name: value for name, value in values.items() if value is not None})


def _flag(one: inspect.Parameter) -> str:
    info = one.annotation.__metadata__[0]
    # Typer stores the first name of an option as its default.
    named = [str(name) for name in (info.default, *(info.param_decls or ())) if str(name).startswith("--")]
    return named[0].partition("/")[0] if named else f"--{one.name.replace('_', '-')}"
