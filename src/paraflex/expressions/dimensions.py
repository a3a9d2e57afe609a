"""Dimensional analysis of expressions, as far as their units determine dimensions."""

import ast
import math
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

from paraflex.units import ANGLE, PLAIN, Dimension, dimension_text, quantities_in, unit_named
from .evaluate import CONSTANTS, ExpressionError, expressed_in, names_in, quantity_in, tree_of

# Work and power, as products of torques.
_OF_TORQUES = {(*unit_named(unit).dimension[:3], 1, 0): unit_named(unit).dimension for unit in ("J", "W")}
# Function from a name to its dimension; None where it is unknown, as for the time or a parameter without a unit.
_Of = Callable[[str], Dimension | None]


# Units of quantities of a motion by the last part of their names.
UNITS_OF_QUANTITIES = {"angle": "rad", "travel": "m", "x": "m", "y": "m", "vx": "m/s", "vy": "m/s", "length": "m"}


def dimension_of(text: str, parameters: Mapping[str, Dimension | None]) -> Dimension | None:
    """Return the dimension of a valid expression: `PLAIN` for pure numbers, None if it is unknown.

    Parameters
    ----------
    text : str
        Expression, which has a value.
    parameters : mapping
        Dimensions of the parameters of the file; see `dimensions_of_parameters`.

    Raises
    ------
    ExpressionError
        Sum of quantities of different dimensions, or function of a quantity that is not an angle.
    """
    names = names_in(text)
    if any("." in name for name in names) and not quantities_in(text) and not any(map(parameters.get, names)):
        return None  # all its numbers are in SI units
    return dimension_in(tree_of(text), lambda name: _named(name, parameters))


def dimension_in(tree: ast.AST, of: _Of) -> Dimension | None:
    """Return the dimension of a syntax tree from those of its names, as `dimension_of` does."""
    return _dimension(tree, lambda name: PLAIN if name in CONSTANTS else of(name))


def _named(name: str, parameters: Mapping[str, Dimension | None]) -> Dimension | None:
    unit = UNITS_OF_QUANTITIES.get(name.rpartition(".")[2]) if "." in name else None
    return parameters.get(name) if unit is None else unit_named(unit).dimension


def dimensions_of_parameters(table: Mapping[str, Any]) -> dict[str, Dimension | None]:
    """Return the dimension of each parameter of a file whose parameters `evaluate_parameters` accepts.

    Raises
    ------
    InputError
        Inconsistent dimensions; see `dimension_of`.
    """
    found: dict[str, Dimension | None] = {}

    def of(name: str) -> Dimension | None:
        if name in CONSTANTS:
            return PLAIN
        if name not in found:
            entry = table.get(name)
            given = _dimension(tree_of(entry), of) if isinstance(entry, str) else None
            found[name] = None if given == PLAIN else given
        return found[name]

    for name, entry in table.items():
        with expressed_in(f"parameters.{name}", entry):
            of(name)
    return found


def _dimension(node: ast.AST, of: _Of) -> Dimension | None:
    match node:
        case ast.Name(id=name):
            return of(name)
        case ast.Constant(value=str()) | ast.Attribute() if (name := quantity_in(node)) is not None:
            return of(name)
        case ast.BinOp(op=ast.MatMult(), right=ast.Constant(value=str() as unit)):
            return unit_named(unit).dimension
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            return _of_sum(_dimension(left, of), _dimension(right, of))
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return _product(_dimension(left, of), _dimension(right, of), 1)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return _product(_dimension(left, of), _dimension(right, of), -1)
        case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
            return _power(_dimension(base, of), exponent)
        case ast.UnaryOp(operand=operand):
            return _dimension(operand, of)
        case ast.Call(func=ast.Name(id="abs" | "min" | "max"), args=arguments) if arguments:
            return reduce(_of_sum, [_dimension(argument, of) for argument in arguments])
        case ast.Call(func=ast.Name(id=name), args=[argument]):
            return _of_function(name, _dimension(argument, of))
    return PLAIN


def _of_sum(one: Dimension | None, other: Dimension | None) -> Dimension | None:
    """Return the dimension of a sum; a number without a unit is in the SI unit of the other summand."""
    if one in (None, PLAIN) or other in (None, PLAIN):
        return next(
            (each for each in (one, other) if each not in (None, PLAIN)), None if None in (one, other) else PLAIN
        )
    if one != other:
        raise ExpressionError(
            f"a sum of quantities in {dimension_text(one)} and in {dimension_text(other)}", "check their units"
        )
    return one


def _product(one: Dimension | None, other: Dimension | None, sign: int) -> Dimension | None:
    if one is None or other is None:
        return None
    found = tuple(a + sign * b for a, b in zip(one, other, strict=True))
    # The product of a torque and an angle is a work, and that of a torque and a rate is a power.
    return _OF_TORQUES.get(found, found) if sign > 0 else found  # type: ignore[return-value]


def _power(base: Dimension | None, exponent: ast.AST) -> Dimension | None:
    if base is None or base == PLAIN:
        return base
    match exponent:
        case ast.Constant(value=int() | float() as power) if all(math.fmod(power * each, 1.0) == 0.0 for each in base):
            return tuple(int(power * each) for each in base)  # type: ignore[return-value]
        case ast.UnaryOp(op=ast.USub(), operand=positive):
            return _product(PLAIN, _power(base, positive), -1)
    return None


def _of_function(name: str, given: Dimension | None) -> Dimension | None:
    if given in (None, PLAIN, ANGLE):
        return PLAIN
    if name == "sqrt":
        return tuple(each // 2 for each in given) if not any(each % 2 for each in given) else None  # type: ignore[return-value]
    raise ExpressionError(
        f"{name} of a quantity in {dimension_text(given)}",
        f"write * between a number and a name; {name} takes a number or an angle",
    )
