"""Parameters of a model file and simple expressions of them, such as "l1 - la": arithmetic, no code is run."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

from paraflex.errors import InputError, suggestion

# Longer ones are no lengths of links; parsing them would only take time.
_LONGEST = 200
_CONSTANTS = {"pi": math.pi}
_BINARY: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_UNARY: dict[type, Callable[[float], float]] = {ast.USub: operator.neg, ast.UAdd: operator.pos}


class ExpressionError(ValueError):
    """What is wrong with an expression, and what to do about it."""

    def __init__(self, problem: str, remedy: str) -> None:
        self.problem, self.remedy = problem, remedy
        super().__init__(problem)


def evaluate(text: str, parameters: Mapping[str, float]) -> float:
    """Value of an expression of numbers, parameters, pi, + - * / ** and brackets.

    Raises
    ------
    ExpressionError
        It does not parse, has anything else in it, names an unknown parameter, or has no finite value.
    """
    return _evaluate(text, lambda name: _look_up(name, parameters))


def evaluate_parameters(table: Mapping[str, Any]) -> dict[str, float]:
    """Values of the parameters of a file; each is a number or an expression of others.

    Raises
    ------
    InputError
        One that is neither, is not named like a variable, or depends on itself.
    """
    values: dict[str, float] = {}

    def value_of(name: str, open_names: tuple[str, ...]) -> float:
        if name in values or name in _CONSTANTS:
            return values.get(name, _CONSTANTS.get(name, 0.0))
        if name not in table:
            raise ExpressionError(f'unknown parameter "{name}"', suggestion(name, table))
        if name in open_names:
            circle = " -> ".join([*open_names[open_names.index(name) :], name])
            raise ExpressionError(f"a circle of parameters, {circle}", "give one of them a number")
        entry = table[name]
        if isinstance(entry, str):
            values[name] = _evaluate(entry, lambda other: value_of(other, (*open_names, name)))
        else:
            values[name] = float(entry)
        return values[name]

    for name, entry in table.items():
        field = f"parameters.{name}"
        if not name.isidentifier() or name in _CONSTANTS:
            raise InputError("not usable as a name", field=field, value=name, remedy="letters, digits and _; not pi")
        if isinstance(entry, bool) or not isinstance(entry, (int, float, str)):
            raise InputError("neither a number nor an expression", field=field, value=entry, remedy="give one of them")
        try:
            value = value_of(name, ())
        except ExpressionError as error:
            raise InputError(error.problem, field=field, value=entry, remedy=error.remedy) from None
        if not math.isfinite(value):
            raise InputError("not a finite number", field=field, value=entry, remedy="give a number")
    return values


def _evaluate(text: str, value_of: Callable[[str], float]) -> float:
    if len(text) > _LONGEST:
        raise ExpressionError("too long for an expression", f"at most {_LONGEST} letters; name its parts as parameters")
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError("neither a number nor an expression", 'write it like "l1 - 0.5 * la"') from None
    try:
        value = _value(tree.body, value_of)
    except ZeroDivisionError:
        raise ExpressionError("a division by zero", "check the parameters") from None
    except OverflowError:
        raise ExpressionError("too large a number", "check the parameters") from None
    if isinstance(value, complex) or not math.isfinite(value):
        raise ExpressionError("not a finite number", "check the parameters")
    return value


def _value(node: ast.AST, value_of: Callable[[str], float]) -> float:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return float(number)
        case ast.Name(id=name):
            return value_of(name)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return _BINARY[type(op)](_value(left, value_of), _value(right, value_of))
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
            return _UNARY[type(op)](_value(operand, value_of))
    raise ExpressionError(
        "only numbers, parameters, + - * / ** and brackets may stand in an expression", "work out the rest elsewhere"
    )


def _look_up(name: str, parameters: Mapping[str, float]) -> float:
    if name in parameters:
        return parameters[name]
    if name in _CONSTANTS:
        return _CONSTANTS[name]
    raise ExpressionError(f'unknown parameter "{name}"', suggestion(name, parameters))
