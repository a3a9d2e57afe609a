"""Expressions as a list of operations, each on results of earlier ones, which kernels evaluate with a derivative."""

import ast
from collections.abc import Mapping
from typing import NamedTuple

from .evaluate import (
    TIME_NAME,
    WITH_KINKS,
    ExpressionError,
    allowed_call,
    check_names,
    look_up,
    not_allowed,
    quantity_in,
    tree_of,
)
from .jets import FUNCTIONS

# Operations without operands: a number, the value of a quantity or of the time.
NUMBER, QUANTITY, TIME = "number", "quantity", "time"
_BINARY: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
# Functions of two numbers and of one with a kink, which forces may have.
_OF_TWO, _OF_ONE = ("min", "max"), ("abs",)
OPERATIONS = (NUMBER, QUANTITY, TIME, *_BINARY.values(), "negative", *_OF_TWO, *_OF_ONE, *FUNCTIONS)


class Operation(NamedTuple):
    """One operation: its name, the numbers of the operations that give its operands, its number or quantity."""

    name: str
    a: int = -1
    b: int = -1
    number: float = 0.0
    quantity: str = ""


def operations_of(text: str, parameters: Mapping[str, float]) -> tuple[Operation, ...]:
    """Return the operations of an expression of parameters, the time and quantities of a motion; the last is its value.

    Besides the functions of `jets` it may contain abs(x), min(x, y) and max(x, y).

    Raises
    ------
    ExpressionError
        Syntax error, unknown parameter or function, or parameter with the name of the time.
    """
    check_names(text, parameters)
    found: list[Operation] = []

    def add(operation: Operation) -> int:
        found.append(operation)
        return len(found) - 1

    def visit(node: ast.AST) -> int:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return add(Operation(NUMBER, number=float(number)))
            case ast.Name(id=name):
                if name == TIME_NAME:
                    return add(Operation(TIME))
                remedy = f"of a joint write {name}.angle or {name}.travel"
                return add(Operation(NUMBER, number=look_up(name, parameters, remedy)))
            case ast.BinOp(left=number, op=ast.MatMult()):
                return visit(number)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                return add(Operation(_BINARY[type(op)], visit(left), visit(right)))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return add(Operation("negative", visit(operand)))
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return visit(operand)
            case ast.Call(func=ast.Name(id=name), args=[one, other], keywords=[]) if name in _OF_TWO:
                return add(Operation(name, visit(one), visit(other)))
            case ast.Call(func=ast.Name(id=name), args=[one], keywords=[]) if name in _OF_ONE:
                return add(Operation(name, visit(one)))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                if name in _OF_TWO:
                    raise ExpressionError(f"{name} takes two arguments, not {len(arguments)}", f"write {name}(x, y)")
                if name in WITH_KINKS:
                    raise ExpressionError(
                        f'a force must not jump as "{name}" does', "write tanh(x / width), or a table"
                    )
                allowed_call(name, len(arguments))
                return add(Operation(name, visit(arguments[0])))
        if (quantity := quantity_in(node)) is not None:
            return add(Operation(QUANTITY, quantity=quantity))
        raise not_allowed(node)

    visit(tree_of(text))
    return tuple(found)
