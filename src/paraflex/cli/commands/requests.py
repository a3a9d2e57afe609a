"""Requests: dataclasses whose fields are options of a command.

The shell sees an option for each field. A field that is itself a request holds options that several commands share;
its fields are listed in its place.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import MISSING, Field, field, fields, is_dataclass
from functools import partial
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer

from paraflex.errors import InputError


def option(names: str, meaning: str, *, default: Any = None, unit: str = "") -> Any:
    """Return a field of a request that is an option with a value.

    Parameters
    ----------
    names : str
        Flag of the option, another one with the same meaning if there is one, and name of the value, as the help shows
        them: "--tol METRES", "--output --out DIR".
    meaning : str
        Help of the option.
    default : any
        Value of an option that is not given; [] for one that may be repeated.
    unit : str
        SI unit of a quantity, which may be given in other units; empty for other values.
    """
    *known, metavar = names.split()
    info = typer.Option(*known, metavar=metavar, help=meaning, parser=_measured(unit) if unit else None)
    return _shown(info, default, known[0])


# Function that returns the field of a request.
FieldMaker = Callable[..., Any]
# Returns a field with the list of all values of an option.
repeatable: FieldMaker = partial(option, default=[])


def switch(flag: str, meaning: str, *, default: bool | None = False) -> Any:
    """Return a field of a request that is an option without a value: "--json", or "--report/--no-report"."""
    return _shown(typer.Option(flag, help=meaning), default, flag.partition("/")[0])


def argument(metavar: str, meaning: str, *, default: Any = MISSING) -> Any:
    """Return a field of a request that is an argument of the command; by default it is required."""
    return _shown(typer.Argument(metavar=metavar, help=meaning), default)


def _shown(info: Any, default: Any, flag: str = "") -> Any:
    value: Any = {"default_factory": list} if default == [] else {"default": default}
    return field(**value, metadata={"shell": info, "flag": flag})


def _measured(unit: str) -> Callable[[Any], float]:
    """Return a parser of option values: a number in `unit`, or one with a unit of the same dimension."""

    def number(text: Any) -> float:
        try:
            return float(text)
        except ValueError:
            from paraflex.files.fields import number_in  # not needed for the help

            try:
                return number_in(text, unit)
            except InputError as error:
                raise typer.BadParameter(f"{error.problem} (got {text!r}); {error.remedy}") from None

    return number


def _whole(text: Any) -> int:
    """Return a whole number, the value of an option."""
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"not a whole number (got {text!r}); write it in digits, such as 361") from None


def _parsed(info: Any, kind: Any) -> Any:
    """Return the description of an option, with a parser for the numbers of its type."""
    parser = {int: _whole, float: _measured("")}.get(next(iter(get_args(kind)), kind))
    if parser is None or info.parser is not None or get_origin(kind) is list:
        return info
    info = copy(info)
    info.parser = parser
    return info


def with_options(request: type, answer: Callable[[Any], int | None]) -> Callable[..., None]:
    """Return a Typer command with a parameter for each option of its request; `answer` returns the exit code."""

    def called(**given: Any) -> None:
        from paraflex.formatting import output_units  # needed when a command is run, not for the help

        chosen = given.get("units")
        with output_units(() if chosen is None else chosen.split(","), "--units"):
            raise typer.Exit(answer(filled(request, given)) or 0)

    parameters = []
    for one, kind in _options(request):
        # None stands for a default made by a factory.
        default = None if one.default_factory is not MISSING else one.default
        parameters.append(inspect.Parameter(
            one.name, inspect.Parameter.KEYWORD_ONLY, annotation=Annotated[kind, _parsed(one.metadata["shell"], kind)],
            default=inspect.Parameter.empty if default is MISSING else default,
        ))  # fmt: skip
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {}
    return called


def flags(request: object) -> dict[str, str]:
    """Return the flag of every option of a request by its field: {"tolerance": "--tol"}."""
    return {one.name: one.metadata["flag"] for one, _ in _options(type(request)) if one.metadata["flag"]}


def flags_of(request: type) -> list[str]:
    """Return the flags of a command by its request."""
    return [one.metadata["flag"] for one, _ in _options(request)]


@contextmanager
def flagged(request: object, *, first: bool = False) -> Iterator[None]:
    """Replace the field in errors within the context by the option's flag, in whatever table the field is.

    The field is the last part of its dotted name or, with `first`, the first part: "loads" of "loads.stage.T.x".
    """
    try:
        yield
    except InputError as error:
        table, _, name = error.field.partition(".")[0], *error.field.rpartition(".")[1:]
        # A force of a member is not the option --force.
        flag = None if table in ("load", "linear_spring") else flags(request).get(table if first else name)
        raise (error if flag is None else error.at(flag)) from None


def _options(request: Any) -> Iterator[tuple[Field[Any], Any]]:
    """Yield the options of a request and their types in order, with those of nested requests in their place."""
    kinds = get_type_hints(request)
    for one in fields(request):
        if is_dataclass(kinds[one.name]):
            yield from _options(kinds[one.name])
        else:
            yield one, kinds[one.name]


def filled(request: Any, given: dict[str, Any]) -> Any:
    """Return the request filled with values from the shell; fields without a value (None) take their defaults."""
    kinds = get_type_hints(request)
    values = {
        one.name: filled(kinds[one.name], given) if is_dataclass(kinds[one.name]) else given[one.name]
        for one in fields(request)
    }
    return request(**{name: value for name, value in values.items() if value is not None})
