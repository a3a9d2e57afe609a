"""Expressions of metrics, such as "max(abs(stage.T.y))" or "rms(A1.torque[0.2:0.5]) / 3 N m".

A reduction takes a quantity over the samples of a run to one number. All functions act on jets, whose rates carry the
derivative of a run with a complex step; the values alone decide where a maximum is and which sign a magnitude has.
"""

import ast
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Indices
from paraflex.errors import suggestion
from paraflex.expressions.dimensions import dimension_in
from paraflex.expressions.evaluate import CONSTANTS, NO_EXPRESSION, ExpressionError, arithmetic, names_within, tree_of
from paraflex.expressions.jets import FUNCTIONS, Jet, sqrt
from paraflex.limits import EXPRESSION_LETTERS
from paraflex.units import ANGLE, PLAIN, Dimension, dimension_text, unit_named
from .formulas import SAME_TIME

_TIME = unit_named("s").dimension
_MAGNITUDE = "abs"


def _each(jet: Jet, f: Callable[..., object]) -> Jet:
    """Return a jet of a linear function of the arrays of a jet."""
    return Jet(*map(np.asarray, map(f, (jet.value, jet.rate, jet.acceleration))))


def _at(jet: Jet, index: int | slice) -> Jet:
    return _each(jet, lambda values: values[index])


def _extreme(jet: Jet, sign: float) -> Jet:
    """Return the largest value, or the least for a negative sign; samples without a value do not count."""
    values = np.where(np.isnan(jet.value), -np.inf, sign * jet.value)
    return _at(jet, int(np.argmax(values)))


def _integral(jet: Jet, t: Jet) -> Jet:
    steps = _each(t, np.diff)
    return _each((_at(jet, slice(1, None)) + _at(jet, slice(-1))) * steps * 0.5, np.sum)


# Reductions by name, functions of a quantity and the times at its samples.
REDUCTIONS: Mapping[str, Callable[[Jet, Jet], Jet]] = {
    "max": lambda jet, _: _extreme(jet, 1.0),
    "min": lambda jet, _: _extreme(jet, -1.0),
    "mean": lambda jet, _: _each(jet, np.mean),
    "rms": lambda jet, _: sqrt(_each(jet * jet, np.mean)),
    "first": lambda jet, _: _at(jet, 0),
    "last": lambda jet, _: _at(jet, -1),
    "range": lambda jet, _: _extreme(jet, 1.0) - _extreme(jet, -1.0),
    "integral": _integral,
}


class _Window(NamedTuple):
    """Window of time of a reduction [s]; infinite where it has no end."""

    start: float = -np.inf
    end: float = np.inf

    def within(self, other: "_Window") -> "_Window":
        found = _Window(max(self.start, other.start), min(self.end, other.end))
        if found.start > found.end:
            raise ExpressionError("a window that ends before it begins", "write it like [0.2:0.5], in s")
        return found

    def __str__(self) -> str:
        return f"[{':'.join(f'{one:g}' if np.isfinite(one) else '' for one in self)}]"

    def check(self, last: float) -> None:
        """Check that the window lies within a run that ends at a time [s]."""
        if any(one > last * (1.0 + SAME_TIME) for one in self if np.isfinite(one)):
            problem = f"the window {self} is not within the run, from 0 s to {last:g} s"
            raise ExpressionError(problem, "choose another, or leave out an end")

    def samples(self, t: Jet) -> Indices:
        """Return the indices of the samples in the window."""
        times, last = t.value, float(np.max(t.value, initial=0.0))
        self.check(last)
        found = np.flatnonzero((times >= self.start - SAME_TIME * last) & (times <= self.end + SAME_TIME * last))
        if not found.size:
            raise ExpressionError(f"no sample lies in the window {self}", "choose a longer one, or take more samples")
        return found


class _Call(NamedTuple):
    """Reduction, or magnitude of a quantity: its function, its argument, and the window of a reduction."""

    name: str
    argument: ast.AST
    window: _Window | None
    series: bool

    @property
    def in_time(self) -> bool:
        """Whether the value depends on the times of the samples."""
        return self.name == "integral" or self.window not in (None, _Window())


class _Parser(ast.NodeTransformer):
    """Replaces reductions, magnitudes and windows in a syntax tree by names in `calls`."""

    def __init__(self) -> None:
        self.calls: dict[str, _Call] = {}
        # Windows of the reductions around the node.
        self._windows = [_Window()]

    def visit_Call(self, node: ast.Call) -> ast.AST:
        name = node.func.id if isinstance(node.func, ast.Name) and not node.keywords else ""
        if name and name not in (*REDUCTIONS, _MAGNITUDE, *FUNCTIONS):
            remedy = suggestion(name, [*REDUCTIONS, _MAGNITUDE, *FUNCTIONS])
            raise ExpressionError(f'unknown function "{name}"', remedy)
        if not name or name in FUNCTIONS:
            node.args = [self.visit(argument) for argument in node.args]
            return node
        if len(node.args) != 1:
            raise ExpressionError(f"{name} takes one quantity, not {len(node.args)}", f"write {name}(body.point.y)")
        if name in REDUCTIONS:
            self._windows.append(_Window())
        argument = self.visit(node.args[0])
        window, series = self._windows.pop() if name in REDUCTIONS else None, self.is_series(argument)
        if window is not None and not series:
            raise ExpressionError(f"{name} of a number, not of a quantity of the run", f"write {name}(body.point.y)")
        self.calls[f".{len(self.calls)}"] = _Call(name, argument, window, series and window is None)
        return ast.Constant(f".{len(self.calls) - 1}")

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        inner, part = self.visit(node.value), node.slice
        if not isinstance(part, ast.Slice) or part.step is not None or not self.is_series(inner):
            raise ExpressionError("not a window of time of a quantity", "write it like A1.torque[0.2:0.5], in s")
        start = -np.inf if part.lower is None else _time(part.lower)
        end = np.inf if part.upper is None else _time(part.upper)
        self._windows[-1] = self._windows[-1].within(_Window(start, end))
        return inner

    def is_series(self, tree: ast.AST) -> bool:
        """Check whether an expression has a value for each sample."""
        return any(self.calls[name].series if name in self.calls else True for name in _quantities(tree))


def _quantities(tree: ast.AST) -> Iterator[str]:
    return (name for name in names_within(tree) if name not in (*CONSTANTS, *FUNCTIONS))


def _time(tree: ast.AST) -> float:
    """Return the time [s] at an end of a window."""

    def unknown(name: str) -> float:
        if name in CONSTANTS:
            return CONSTANTS[name]
        raise ExpressionError(f'"{name}" in a window of time', "give numbers in s")

    value, dimension = arithmetic(tree, unknown), dimension_in(tree, lambda _: None)
    if dimension not in (PLAIN, _TIME):
        unit = "no known unit" if dimension is None else dimension_text(dimension)
        raise ExpressionError(f"a window in {unit}, not in s", "write it like [0.2:0.5] or [200 ms:500 ms]")
    if not 0.0 <= value < np.inf:
        raise ExpressionError("a window outside the run", "runs begin at 0 s; leave out an end that is not limited")
    return float(value)


@dataclass(frozen=True)
class MetricExpression:
    """Expression of a metric, checked as far as possible without a mechanism.

    Attributes
    ----------
    tree : ast.AST
        Syntax tree, in which reductions and magnitudes are names.
    calls : mapping
        Reductions and magnitudes by these names.
    """

    tree: ast.AST
    calls: Mapping[str, _Call]

    @property
    def in_time(self) -> bool:
        """Whether the metric depends on the times of the samples."""
        return any(call.in_time for call in self.calls.values())

    def check_windows(self, last: float) -> None:
        """Check that all windows lie within a run that ends at a time [s]."""
        for call in self.calls.values():
            if call.window is not None:
                call.window.check(last)

    @property
    def quantities(self) -> list[str]:
        """Names of the quantities, each once."""
        trees = [self.tree, *(call.argument for call in self.calls.values())]
        return list(dict.fromkeys(name for tree in trees for name in _quantities(tree) if name not in self.calls))

    def unit(self, unit_of: Callable[[str], str]) -> str:
        """Return the SI unit of the metric from those of its quantities.

        Raises
        ------
        ExpressionError
            Sum of different dimensions, or a dimension that is not known.
        """
        units = {name: unit_of(name) for name in self.quantities}
        found = self._dimension(self.tree, units)
        if found is None:
            raise ExpressionError("its unit is not known", "take roots of squares, and powers that are whole numbers")
        named = [unit for unit in (*units.values(), "W") if unit_named(unit).dimension == found]
        return named[0] if named else dimension_text(found)

    def value(self, series: Callable[[str], Jet], t: Callable[[], Jet]) -> Jet:
        """Return the metric as a jet from its quantities over the samples at times t [s]."""
        with np.errstate(all="ignore"):
            return arithmetic(self.tree, partial(self._value, series, t))

    def _value(self, series: Callable[[str], Jet], t: Callable[[], Jet], name: str) -> Jet | float:
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name not in self.calls:
            return series(name)
        call = self.calls[name]
        found = arithmetic(call.argument, partial(self._value, series, t))
        if call.window is None:
            if not isinstance(found, Jet):
                return abs(found)
            sign = np.sign(found.value)
            return _each(found, lambda values: sign * values)
        if not call.in_time:
            return REDUCTIONS[call.name](found, found)
        times, inside = t(), call.window.samples(t())
        return REDUCTIONS[call.name](*(_each(each, lambda values: values[inside]) for each in (found, times)))

    def _dimension(self, tree: ast.AST, units: Mapping[str, str]) -> Dimension | None:
        def of(name: str) -> Dimension | None:
            if name not in self.calls:
                return unit_named(units[name]).dimension
            found = self._dimension(self.calls[name].argument, units)
            if found is None or self.calls[name].name != "integral":
                return found
            return tuple(one + more for one, more in zip(found, _TIME, strict=True))  # type: ignore[return-value]

        for node in ast.walk(tree):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
                one, other = (dimension_in(side, of) for side in (node.left, node.right))
                summand = other if one == PLAIN else one
                if PLAIN in (one, other) and summand not in (PLAIN, ANGLE, None):
                    unit = dimension_text(summand)
                    raise ExpressionError(f"a sum of a quantity in {unit} and a number without a unit",
                                          f'write a unit behind the number, as in "0.1 {unit}"')  # fmt: skip
        return dimension_in(tree, of)


def dotted_names(text: str) -> list[str]:
    """Return the dotted names in the text of an expression that cannot be parsed, except for those in quotes."""
    return re.findall(r"(?<![\w.'\"])[^\W\d]\w*(?:\.[^\W\d]\w*)+(?![\w.'\"])", text)


@lru_cache(maxsize=512)
def parsed(text: str) -> MetricExpression:
    """Parse the expression of a metric.

    Raises
    ------
    ExpressionError
        Syntax error, function that does not exist, reduction of a number, or quantity without a reduction.
    """
    parser = _Parser()
    try:
        tree = parser.visit(tree_of(text))
    except ExpressionError as error:
        if len(text) > EXPRESSION_LETTERS:
            raise ExpressionError(error.problem, f"at most {EXPRESSION_LETTERS} letters") from None
        if error.problem != NO_EXPRESSION:
            raise
        remedy = "write it like max(abs(body.point.y)), with quotes about 'names-with.other.signs'"
        raise ExpressionError("no such expression of a metric", remedy) from None
    # Evaluated once, so that elements that are not allowed are refused before any run.
    ones, whole = Jet.constant(1.0, np.ones(2)), {name: call._replace(window=call.window and _Window())
                                                  for name, call in parser.calls.items()}  # fmt: skip
    MetricExpression(tree, whole).value(lambda _: ones, lambda: ones)
    if not any(call.window for call in parser.calls.values()) or parser.is_series(tree):
        name = next(iter(dotted_names(text)), "body.point.y")
        raise ExpressionError("not one number of a run", f"write max(abs({name})), or with another of "
                              f"{', '.join(REDUCTIONS)}")  # fmt: skip
    return MetricExpression(tree, parser.calls)
