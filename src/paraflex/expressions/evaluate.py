"""Parameters of a model file and expressions of them, such as "l1 - la", "30 deg" or "a * sin(w * t)".

No code is executed. A unit stands directly behind a number; any other name is a parameter, a function or the time.
"""

import ast
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError, suggestion
from paraflex.limits import EXPRESSION_LETTERS, PARAMETER_CHAIN
from paraflex.units import UNITS, divisors_in, quantities_in, unknown_unit
from .jets import FUNCTIONS, Jet

CONSTANTS = {"pi": math.pi}
# Problem of a text with a syntax error.
NO_EXPRESSION = "neither a number nor an expression"
# Name of the time in expressions.
TIME_NAME = "t"
_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_UNARY: dict[type, Callable[[Any], Any]] = {ast.USub: operator.neg, ast.UAdd: operator.pos}
# Functions that are not smooth: users may expect them, but motions must have derivatives.
WITH_KINKS = {"abs", "sign", "min", "max", "floor", "ceil", "round", "step", "heaviside", "mod"}


class ExpressionError(ValueError):
    """Error in an expression, with a problem and a remedy."""

    def __init__(self, problem: str, remedy: str) -> None:
        self.problem = problem
        self.remedy = remedy
        super().__init__(problem)


@contextmanager
def expressed_in(field: str, value: object) -> Iterator[None]:
    """Convert an ExpressionError inside the context to an InputError of a field and its value."""
    try:
        yield
    except ExpressionError as error:
        raise InputError(error.problem, field=field, value=value, remedy=error.remedy) from None


def evaluate(text: str, parameters: Mapping[str, float]) -> float:
    """Evaluate an expression of numbers, parameters, pi, + - * / **, brackets and the functions of `jets`.

    Numbers may have units, whose consistency is checked in `dimensions`.

    Parameters
    ----------
    text : str
        Expression.
    parameters : mapping of str to float
        Values of the parameters.

    Raises
    ------
    ExpressionError
        Syntax error, element that is not allowed, unknown parameter, or value that is not finite.
    """
    _refuse_ambiguous(text, parameters)
    return _finite(arithmetic(tree_of(text), lambda name: look_up(name, parameters)))


def evaluate_in_time(text: str, parameters: Mapping[str, float], t: Array) -> Jet:
    """Evaluate an expression of the time t [s], with its first and second derivative.

    Parameters
    ----------
    text : str
        Expression as in `evaluate`, in which t is the time.
    parameters : mapping of str to float
        Values of the parameters.
    t : array
        Times [s].

    Raises
    ------
    ExpressionError
        See `evaluate`; or value or derivative that is not finite, reported with the first time at which this occurs.
    """
    t = np.asarray(t, dtype=float)
    value = _in_time(text, parameters, t)
    jet = value if isinstance(value, Jet) else Jet.constant(_finite(value), t)
    for what, values in (("value", jet.value), ("rate", jet.rate), ("second derivative", jet.acceleration)):
        bad = ~np.isfinite(values)
        if np.any(bad):
            raise ExpressionError(
                f"its {what} is not a finite number at t = {np.ravel(t)[np.argmax(np.ravel(bad))]:.6g} s",
                "it must be smooth while the mechanism runs",
            )
    return jet


def check_in_time(text: str, parameters: Mapping[str, float]) -> None:
    """Check that a text is an expression of time and parameters; it may have no finite value at some times.

    Raises
    ------
    ExpressionError
        See `evaluate`.
    """
    _in_time(text, parameters, np.ones(1))


def is_constant(text: str) -> bool:
    """Check whether an expression does not contain the time."""
    return TIME_NAME not in names_in(text)


def names_in(text: str) -> set[str]:
    """Return the names in an expression: parameters, functions, time, and quantities of a motion."""
    return set(names_within(tree_of(text)))


def names_within(node: ast.AST) -> Iterator[str]:
    """Yield the names in a syntax tree; see `names_in`."""
    name = quantity_in(node)
    if name is not None:
        yield name
        return
    if isinstance(node, ast.Name):
        yield node.id
    for child in ast.iter_child_nodes(node) if not isinstance(getattr(node, "op", None), ast.MatMult) else ():
        yield from names_within(child)


def quantity_in(node: ast.AST) -> str | None:
    """Return the name of a quantity of a motion, say "stage.T.y", None for another node of a syntax tree.

    Names that are no identifiers are quoted: "'stage-1.T.y'".
    """
    match node:
        case ast.Constant(value=str() as name):
            return name if "." in name else None
        case ast.Attribute(value=ast.Name(id=name), attr=last):
            return f"{name}.{last}"
        case ast.Attribute(value=ast.Attribute() as owner, attr=last):
            whole = quantity_in(owner)
            return None if whole is None else f"{whole}.{last}"
    return None


def evaluate_parameters(table: Mapping[str, Any]) -> dict[str, float]:
    """Evaluate the parameters of a file, each of which is a number or an expression of others.

    Raises
    ------
    InputError
        Parameter that is neither, has an invalid name, has no finite value, or depends on itself.
    """
    values: dict[str, float] = {}

    def value_of(name: str, open_names: tuple[str, ...]) -> float:
        if name in values or name in CONSTANTS:
            return values.get(name, CONSTANTS.get(name, 0.0))
        if name not in table:
            raise _unknown(name, table)
        if name in open_names:
            circle = " -> ".join([*open_names[open_names.index(name) :], name])
            raise ExpressionError(f"a cycle of parameters, {circle}", "give one of them a number")
        if len(open_names) >= PARAMETER_CHAIN:
            remedy = f"at most {PARAMETER_CHAIN}; give one of them a number"
            raise ExpressionError("a chain of too many parameters", remedy)
        entry = table[name]
        if isinstance(entry, str):
            _refuse_ambiguous(entry, table)
            values[name] = _finite(arithmetic(tree_of(entry), lambda other: value_of(other, (*open_names, name))))
        else:
            values[name] = _float(entry)
        return values[name]

    for name, entry in table.items():
        field = f"parameters.{name}"
        if not name.isidentifier() or name in CONSTANTS:
            raise InputError("not usable as a name", field=field, value=name, remedy="letters, digits and _; not pi")
        if isinstance(entry, bool) or not isinstance(entry, (int, float, str)):
            raise InputError("neither a number nor an expression", field=field, value=entry, remedy="give one of them")
    for name, entry in table.items():
        field = f"parameters.{name}"
        with expressed_in(field, entry):
            value = value_of(name, ())
        if not math.isfinite(value):
            raise InputError("not a finite number", field=field, value=entry, remedy="give a number")
    return values


def _in_time(text: str, parameters: Mapping[str, float], t: Array) -> Any:
    check_names(text, parameters)

    def value_of(name: str) -> Any:
        return Jet.time(t) if name == TIME_NAME else look_up(name, parameters)

    # NumPy's warnings are suppressed, because values that are not finite are reported later with their time.
    with np.errstate(all="ignore"):
        return arithmetic(tree_of(text), value_of)


def check_names(text: str, parameters: Mapping[str, Any]) -> None:
    """Raise an ExpressionError if a parameter has the name of the time, or is a unit's divisor in an expression."""
    if TIME_NAME in parameters:
        raise ExpressionError(
            f'"{TIME_NAME}" is the time in this expression', f'give the parameter "{TIME_NAME}" another name'
        )
    _refuse_ambiguous(text, parameters)


def _finite(value: Any) -> float:
    if not math.isfinite(value):
        raise ExpressionError("not a finite number", "check the parameters")
    return float(value)


def _float(number: float) -> float:
    try:
        return float(number)
    except OverflowError:
        raise ExpressionError("too large a number", "check its digits") from None


def tree_of(text: str) -> ast.AST:
    """Parse an expression into a syntax tree, in which 80 mm is 0.08 @ "mm".

    Raises
    ------
    ExpressionError
        Syntax error, unknown unit, or expression that is too long.
    """
    if len(text) > EXPRESSION_LETTERS:
        remedy = f"at most {EXPRESSION_LETTERS} letters; name its parts as parameters"
        raise ExpressionError("too long for an expression", remedy)
    try:
        return ast.parse(_without_units(text).strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        unknown = unknown_unit(text)
        if unknown is not None:
            raise ExpressionError(f'unknown unit "{unknown[0]}"', unknown[1]) from None
        remedy = 'write it like "l1 - 0.5 * la", or "80 mm" with the unit behind a number'
        raise ExpressionError(NO_EXPRESSION, remedy) from None
    except OverflowError:
        raise ExpressionError("too large a number", "check its digits") from None


def _without_units(text: str) -> str:
    """Rewrite the quantities of an expression as products of number and unit that Python can parse."""
    if "@" in text:
        raise SyntaxError
    out, end = "", 0
    for found in quantities_in(text):
        if math.isinf(found.value):
            raise OverflowError
        out += f'{text[end : found.start]}({found.value!r} @ "{found.unit}")'
        end = found.end
    return out + text[end:]


def _refuse_ambiguous(text: str, parameters: Mapping[str, Any]) -> None:
    """Raise an ExpressionError if a unit of an expression is divided by what is a unit and a parameter."""
    for found in quantities_in(text) if parameters else ():
        for name in sorted(divisors_in(found.unit) & parameters.keys()):
            written = text[found.start : found.end]
            raise ExpressionError(
                f'"{name}" in "{written}" is a unit and a parameter',
                f"put what is divided by the parameter in brackets, or give the parameter another name than {name}",
            )


def arithmetic(tree: ast.AST, value_of: Callable[[str], Any]) -> Any:
    """Evaluate a syntax tree; `value_of` gives the number, or the jet, of a parameter, a quantity or the time.

    Raises
    ------
    ExpressionError
        Element that is not allowed, or number that does not exist.
    """
    try:
        return _value(tree, value_of)
    except ZeroDivisionError:
        raise ExpressionError("a division by zero", "check the parameters") from None
    except OverflowError:
        raise ExpressionError("too large a number", "check the parameters") from None


def _value(node: ast.AST, value_of: Callable[[str], Any]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return _float(number)
        case ast.Name(id=name):
            return value_of(name)
        case ast.Constant(value=str()) | ast.Attribute() if (name := quantity_in(node)) is not None:
            return value_of(name)
        case ast.BinOp(left=number, op=ast.MatMult()):
            return _value(number, value_of)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            value = _BINARY[type(op)](_value(left, value_of), _value(right, value_of))
            if isinstance(value, complex):  # a negative number to a fractional power
                raise ExpressionError("not a finite number", "check the parameters")
            return value
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
            return _UNARY[type(op)](_value(operand, value_of))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _call(name, [_value(argument, value_of) for argument in arguments])
    raise not_allowed(node)


def _call(name: str, arguments: list[Any]) -> Any:
    allowed_call(name, len(arguments))
    if isinstance(arguments[0], Jet):
        return FUNCTIONS[name](arguments[0])
    with np.errstate(all="ignore"):
        return float(FUNCTIONS[name](Jet.constant(arguments[0], np.zeros(1))).value[0])


def allowed_call(name: str, arguments: int) -> None:
    """Raise an ExpressionError unless a name is that of a smooth function and it has one argument."""
    if name in WITH_KINKS:
        raise ExpressionError(f'the function "{name}" has no derivative everywhere', "write a motion in pieces instead")
    if name not in FUNCTIONS:
        raise ExpressionError(f'unknown function "{name}"', suggestion(name, FUNCTIONS))
    if arguments != 1:
        raise ExpressionError(f"{name} takes one argument, not {arguments}", f"write {name}(...)")


def look_up(name: str, parameters: Mapping[str, float], remedy: str = "") -> float:
    """Return the value of a parameter or constant; raise an ExpressionError, with a remedy, if there is none."""
    if name in parameters:
        return parameters[name]
    if name in CONSTANTS:
        return CONSTANTS[name]
    raise _unknown(name, parameters, remedy)


def _unknown(name: str, parameters: Mapping[str, Any], also: str = "") -> ExpressionError:
    """Return the error for a name that is none of the parameters and constants."""
    if name in FUNCTIONS:
        return ExpressionError(f"{name} is a function", f"write {name}(...)")
    if not name.isidentifier():
        return not_allowed()
    remedy = "; ".join(filter(None, [suggestion(name, parameters) if parameters or not also else "", also]))
    if name in UNITS:
        remedy = f'a unit stands behind a number, units with a space between them: "1 {name}", "5 N m"'
    return ExpressionError(f'unknown parameter "{name}"', remedy)


def not_allowed(node: ast.AST | None = None) -> ExpressionError:
    """Return the error for what may not stand in an expression."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
        return ExpressionError('"^" is a power only in units', 'write ** for powers: "x**2"')
    return ExpressionError(
        "only numbers, parameters, + - * / ** and brackets may stand in an expression, and functions like sin(...)",
        "compute the value elsewhere and write the number",
    )
