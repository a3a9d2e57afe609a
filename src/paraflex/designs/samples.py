"""Designs of a sweep: grids, lists, random and Sobol samples of several parameters at once."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.limits import DESIGNS, at_most
from paraflex.mechanism.quantities import known

KINDS = GRID, LIST, RANDOM, SOBOL = "grid", "list", "random", "sobol"


@dataclass(frozen=True)
class SweptParameter:
    """Parameter of a sweep.

    Attributes
    ----------
    name : str
        Name of the parameter and of its column in the table.
    fields : tuple of str
        Fields of the mechanism's file, which all get the same value.
    values : tuple of float, optional
        Values of a list or grid.
    low, high : float, optional
        Range, if there are no values.
    number : int, optional
        Number of values of a grid from low to high.
    log : bool
        Whether values are spaced or distributed evenly in their logarithm.
    whole : bool
        Whether values are integers.
    """

    name: str
    fields: tuple[str, ...]
    values: tuple[float, ...] | None = None
    low: float | None = None
    high: float | None = None
    number: int | None = None
    log: bool = False
    whole: bool = False

    @property
    def ends(self) -> tuple[float, float]:
        """Low and high of a parameter with a range."""
        assert self.low is not None
        assert self.high is not None
        return self.low, self.high

    def spread(self, fraction: Array) -> Array:
        """Return the values at fractions of the range, from 0 to 1."""
        low, high = self.ends
        if self.whole:
            return np.minimum(np.floor(low + fraction * (high - low + 1.0)), high)
        if self.log:
            return np.clip(np.exp(_between(math.log(low), math.log(high), fraction)), low, high)
        return _between(low, high, fraction)

    def levels(self) -> Array:
        """Return the values (k,) of a grid or list."""
        if self.values is not None:
            return np.array(self.values, dtype=float)
        assert self.number is not None
        if self.whole:
            return np.unique(np.round(np.linspace(*self.ends, self.number)))
        return self.spread(np.linspace(0.0, 1.0, self.number))


def check_varied(parameter: SweptParameter, kind: str) -> None:
    """Check that a parameter has the fields that a kind of sampling needs.

    Raises
    ------
    InputError
        A field is missing or does not fit; the error names it as in the study file.
    """
    where = f"vary.{parameter.name}"
    if parameter.values is not None:
        if kind in (RANDOM, SOBOL):
            raise InputError(
                f"{kind} samples are taken from a range", field=f"{where}.values", value=list(parameter.values),
                remedy="give low and high",
            )  # fmt: skip
        if (parameter.low, parameter.high, parameter.number) != (None, None, None):
            raise InputError("values and a range exclude each other", field=where, remedy="leave one of them out")
        if not parameter.values:
            raise InputError("has no values", field=f"{where}.values", value=[], remedy="give at least one")
        return
    if kind == LIST:
        raise InputError("is missing", field=f"{where}.values", remedy="give a list of numbers, one per design")
    for side in ("low", "high"):
        if getattr(parameter, side) is None:
            raise InputError("is missing", field=f"{where}.{side}", remedy="give low and high, or values")
    _check_range(parameter, where)
    if kind == GRID and (parameter.number or 0) < 1:
        problem, remedy = "a grid needs the number of values in this range", "give number, or values"
    elif kind != GRID and parameter.number is not None:
        problem, remedy = "only grids have a number of values for each parameter", "give number in [sampling]"
    else:
        return
    raise InputError(problem, field=f"{where}.number", value=parameter.number, remedy=remedy)


def designs(parameters: Sequence[SweptParameter], kind: str, number: int | None, seed: int) -> Array:
    """Return all designs (designs, parameters).

    Parameters
    ----------
    parameters : sequence of SweptParameter
        Parameters, checked by `check_varied`. Without parameters there is one design, the mechanism as it is.
    kind : str
        Kind of sampling: "grid" (all combinations, the last parameter fastest), "list" (the first values of all
        parameters, the second values, ...), "random" or "sobol" (scrambled).
    number : int, optional
        Number of random or Sobol samples.
    seed : int
        Seed of the random generator. Samples of a seed are reproducible, and fewer samples are the first of more.

    Raises
    ------
    InputError
        The sampling is unknown, its number is missing, there are too many designs, or lists differ in length.
    """
    known(kind, KINDS, "sampling.kind", "sampling")
    _check_number(parameters, kind, number, seed)
    if not parameters:
        return np.zeros((1, 0))
    if kind == GRID:
        sizes = [parameter.number or len(parameter.values or ()) for parameter in parameters]
        at_most(math.prod(sizes), DESIGNS, "vary", "too many designs")
        return _grid([parameter.levels() for parameter in parameters])
    if kind == LIST:
        return np.stack([parameter.levels() for parameter in parameters], axis=1)
    assert number is not None
    fractions = _fractions(kind, number, len(parameters), seed)
    return np.stack([p.spread(column) for p, column in zip(parameters, fractions.T, strict=True)], axis=1)


def _grid(levels: Sequence[Array]) -> Array:
    """Return all combinations of levels, the last fastest."""
    total, columns, before = math.prod(level.size for level in levels), [], 1
    for level in levels:
        after = total // (before * level.size)
        columns.append(np.tile(np.repeat(level, after), before))
        before *= level.size
    return np.stack(columns, axis=1)


def _fractions(kind: str, number: int, dimensions: int, seed: int) -> Array:
    generator = np.random.default_rng(seed)
    if kind == RANDOM:
        return generator.random((number, dimensions))
    from scipy.stats import qmc

    sequence = qmc.Sobol(dimensions, scramble=True, seed=generator)  # pyright: ignore[reportCallIssue]
    # SciPy warns about numbers that are not powers of two: take the first of a power of two.
    return sequence.random_base2(max(number - 1, 0).bit_length())[:number]


def _between(low: float, high: float, fraction: Array) -> Array:
    return (1.0 - fraction) * low + fraction * high


def _check_range(parameter: SweptParameter, where: str) -> None:
    low, high = parameter.ends
    if high < low:
        raise InputError(f"below low, {low:g}", field=f"{where}.high", value=high, remedy="exchange the two")
    if parameter.log and not low > 0.0:
        remedy = 'choose scale = "linear"'
        raise InputError("a logarithmic range must be positive", field=f"{where}.low", value=low, remedy=remedy)
    if parameter.whole and (parameter.log or low % 1.0 or high % 1.0):
        raise InputError(
            "whole numbers need a linear range with whole ends", field=f"{where}.whole", value=True,
            remedy="give whole low and high",
        )  # fmt: skip


def _check_number(parameters: Sequence[SweptParameter], kind: str, number: int | None, seed: int) -> None:
    if seed < 0:
        raise InputError("must not be negative", field="sampling.seed", value=seed, remedy="give 0")
    if kind in (RANDOM, SOBOL):
        if not parameters:
            raise InputError("no parameter varies", field="vary", remedy="add a [vary.NAME] table")
        if number is None or number < 1:
            raise InputError(
                "must be positive" if number is not None else "is missing", field="sampling.number", value=number,
                remedy="give the number of designs",
            )  # fmt: skip
        at_most(number, DESIGNS, "sampling.number", "too many designs")
    elif number is not None:
        raise InputError(
            f"a {kind} has as many designs as its values make", field="sampling.number", value=number,
            remedy="leave it out",
        )  # fmt: skip
    if kind == LIST:
        lengths = {p.name: len(p.values or ()) for p in parameters}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{name}: {length}" for name, length in lengths.items())
            raise InputError(f"lists of different lengths ({listed})", field="vary", remedy="give one value per design")
