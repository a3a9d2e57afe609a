"""pytest plugin: how much of its tolerance every assertion uses, one JSON line for each test.

    MARGINS=margins.jsonl PYTHONPATH=tests pytest -p margins tests/test_statics.py

A line is `{"test": id, "used": {place: number}, "sides": {place: [[less, more], ...]}}`, place being the file and line
of the assertion. `used` is the largest error over tolerance there of `pytest.approx`, `numpy.testing.assert_allclose`
and `numpy.allclose`. `sides` are the two sides of `<`, `<=`, `>` or `>=` in an `assert` statement, each time it was
reached, of arrays those that are nearest. Comparisons that do not hold are not recorded. See `any_processor.py`.
"""

from __future__ import annotations

import ast
import builtins
import cmath
import json
import operator
import os
import sys
from collections import defaultdict
from numbers import Complex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _pytest.approx import ApproxScalar
from _pytest.assertion import rewrite

TESTS = Path(__file__).parent
ORDER = {ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge}
_NAME = "__compare_and_record__"


class Records:
    """Recorded comparisons of the test that runs."""

    def __init__(self) -> None:
        self.used: dict[str, float] = {}
        self.sides: dict[str, list[tuple[float, float]]] = defaultdict(list)

    def equal(self, place: str | None, actual: Any, expected: Any, tolerance: Any) -> None:
        """Record an equality within a tolerance; numbers that are not finite are equal."""
        with np.errstate(all="ignore"):
            error = np.abs(np.asarray(actual) - np.asarray(expected))
            part = np.ravel(np.where(error == 0.0, 0.0, error / np.asarray(tolerance)))
        part = part[np.isfinite(part)]
        if place and part.size:
            self.used[place] = max(self.used.get(place, 0.0), float(np.max(part)))

    def ordered(self, place: str, a: Any, b: Any) -> None:
        """Record the sides of an inequality, if they are numbers."""
        try:
            sides = np.sort(
                [np.ravel(side) for side in np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float))], 0
            )
        except (TypeError, ValueError):
            return
        if sides.size and np.all(np.isfinite(sides)):
            less, more = sides[:, np.argmin(sides[1] - sides[0])]
            self.sides[place].append((float(less), float(more)))

    def write(self, test: str, file: str) -> None:
        """Append the records of a test that has ended to a file, and begin anew."""
        if self.used or self.sides:
            line = json.dumps({"test": test, "used": self.used, "sides": self.sides})
            # In one piece: workers write to the same file.
            with open(file, "a", encoding="utf-8") as opened:
                opened.write(line + "\n")
        self.__init__()


RECORDS = Records()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Any:
    """Write what a test and its fixtures compared."""
    result = yield
    RECORDS.write(item.nodeid, os.environ.get("MARGINS", "margins.jsonl"))
    return result


def pytest_configure() -> None:
    """Assertions of helpers are recorded as well."""
    pytest.register_assert_rewrite(*(file.stem for file in TESTS.glob("*.py") if file != Path(__file__)))


# --- Equalities -------------------------------------------------------------------------------------------------------


def _place(depth: int, *, direct: bool) -> str | None:
    """File and line of the caller, or else of the nearest one in a test."""
    frame = sys._getframe(depth)
    while frame is not None:
        file = Path(frame.f_code.co_filename)
        if file.parent == TESTS and file != Path(__file__):
            return f"{file.name}:{frame.f_lineno}"
        frame = None if direct else frame.f_back
    return None


def _is_finite(value: Any) -> bool:
    return isinstance(value, Complex) and cmath.isfinite(complex(value))


def _recording_approx(equal: Any) -> Any:
    def recorded(self: ApproxScalar, actual: Any) -> bool:
        holds = equal(self, actual)
        if holds and all(_is_finite(each) for each in (actual, self.expected)):
            RECORDS.equal(_place(2, direct=False), actual, self.expected, self.tolerance)
        return holds

    return recorded


def _recording_allclose(compare: Any, rtol: float, atol: float) -> Any:
    def recorded(actual: Any, desired: Any, rtol: float = rtol, atol: float = atol, **options: Any) -> Any:
        result = compare(actual, desired, rtol, atol, **options)
        if result in (None, True):
            RECORDS.equal(_place(2, direct=True), actual, desired, atol + rtol * np.abs(np.asarray(desired)))
        return result

    return recorded


ApproxScalar.__eq__ = _recording_approx(ApproxScalar.__eq__)
np.testing.assert_allclose = _recording_allclose(np.testing.assert_allclose, 1e-7, 0.0)
np.allclose = _recording_allclose(np.allclose, 1e-5, 1e-8)


# --- Inequalities -----------------------------------------------------------------------------------------------------


class _Orders(ast.NodeTransformer):
    """Inequalities of assertions become calls that record them."""

    def __init__(self, file: str) -> None:
        self.file, self.within = file, False

    def visit_Assert(self, node: ast.Assert) -> ast.Assert:
        self.within = True
        node.test = self.visit(node.test)
        self.within = False
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        self.generic_visit(node)
        if not self.within or any(type(each) not in ORDER for each in node.ops):
            return node
        place = f"{self.file}:{node.lineno}"
        given: list[ast.expr] = [ast.Constant(value) for value in (place, *(type(each).__name__ for each in node.ops))]
        call = ast.Call(ast.Name(_NAME, ast.Load()), [ast.Tuple(given, ast.Load()), node.left, *node.comparators], [])
        return ast.fix_missing_locations(ast.copy_location(call, node))


def _compare(given: tuple[str, ...], *sides: Any) -> Any:
    place, *operators = given
    result: Any = True
    for name, a, b in zip(operators, sides[:-1], sides[1:], strict=True):
        result = ORDER[getattr(ast, name)](a, b)
        if not np.all(result):
            return result
        RECORDS.ordered(place, a, b)
    return result


def _recording_asserts(rewrite_asserts: Any) -> Any:
    def recorded(tree: ast.Module, source: bytes, file: str, config: Any) -> None:
        if Path(file).parent == TESTS:
            _Orders(Path(file).name).visit(tree)
        rewrite_asserts(tree, source, file, config)

    return recorded


setattr(builtins, _NAME, _compare)
rewrite.rewrite_asserts = _recording_asserts(rewrite.rewrite_asserts)
# What pytest keeps of tests that it has rewritten without this plugin is not what is needed here.
rewrite.PYC_TAIL = "-margins" + rewrite.PYC_TAIL
