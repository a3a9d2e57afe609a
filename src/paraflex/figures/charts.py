"""Chart: curves over a common axis, as Matplotlib and the page of a report draw them.

Numbers of a description are in SI units; what draws it converts them by `shown_units`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from paraflex.arrays import Array, ArrayLike, Brief
from paraflex.formatting import common_unit, display_unit, labelled
from paraflex.units import DisplayUnit

Mark = Literal["", "ring", "cross", "square", "dot", "triangle", "diamond", "bar"]

# Numbers of colours and of dashes; the latter include the solid line.
N_COLOURS, N_DASHES = 8, 5
DASHED, DOTTED = 1, 2
# Dashes of successive curves; dotted lines, which are hard to see, come last.
_DASH_ORDER = (0, 1, 3, 4, 2)
# Ratio of the largest to the smallest positive value above which an axis that may be logarithmic is.
_DECADE = 10.0
# Number of powers of ten on a symmetrical logarithmic axis above which some are left out.
_MOST_POWERS = 4


class Look(NamedTuple):
    """Look of a curve: index of one of eight colours, or None for the colour of text, and dashes.

    Dashes are 0 solid, 1 dashed, 2 dotted, 3 dash-dotted, 4 long dashes.
    """

    colour: int | None = None
    dash: int = 0


PLAIN_LOOK = Look()


def look(k: int) -> Look:
    """Return colour and dash of the k-th curve; up to 40 curves differ, and up to eight of them in colour."""
    return Look(k % N_COLOURS, _DASH_ORDER[(k % N_COLOURS + k // N_COLOURS) % N_DASHES])


@dataclass(frozen=True)
class Axis:
    """Axis of a chart.

    Attributes
    ----------
    name : str
        Name of the quantity: "torque".
    unit : str
        SI unit of the values; "1" for dimensionless ones.
    symbol : str
        Symbol of the quantity, "τ"; empty if it has none.
    log : bool
        Whether the axis is logarithmic if its values span more than a decade.
    linear_below : float
        Magnitude below which a symmetrical logarithmic axis, which needs limits, is linear; 0 (default) for others.
    zero : bool
        Whether a line marks zero.
    extent : float
        Magnitude of the quantity: values that vary by less than a millionth of it are drawn as constant.
    low, high : float or None
        Limits of the axis; by default those of the values.
    ticks : sequence of float
        Numbers on the axis; by default round ones.
    names : sequence of str
        Names at 0, 1, 2, ... in place of numbers, on a vertical axis from the top down.
    shown : DisplayUnit or None
        Unit for display; by default one in which the values have few digits.
    """

    name: str
    unit: str = "1"
    symbol: str = ""
    log: bool = False
    linear_below: float = 0.0
    zero: bool = False
    extent: float = 0.0
    low: float | None = None
    high: float | None = None
    ticks: Sequence[float] = ()
    names: Sequence[str] = ()
    shown: DisplayUnit | None = None

    def unit_for(self, values: ArrayLike) -> DisplayUnit:
        """Return the unit in which values are shown."""
        return self.shown or (common_unit if is_logarithmic(self, values) else display_unit)(self.unit, values)

    def label(self, unit: DisplayUnit, *, short: bool = False) -> str:
        """Return the label of the axis in a unit, "torque τ [N m]"; if short, with the symbol or the last word only."""
        words = (self.name, self.symbol) if not short else (self.symbol or self.name.rpartition(" ")[2],)
        return labelled(" ".join(filter(None, words)), unit.name)


TIME = Axis("time", "s", "t")


@dataclass(frozen=True)
class Curve(Brief):
    """Curve of a chart.

    Attributes
    ----------
    name : str
        Name of the curve; empty if it has no entry in the legend.
    y : (k,) array
        Ordinates in the SI unit of the axis; NaN where there is no value.
    x : (k,) array, optional
        Abscissae in the SI unit of the axis; the time of the runs by default.
    look : Look
        Colour and dashes.
    run : int, optional
        Run of the curve.
    shown : tuple of int, optional
        Selected runs with which the curve is shown; any by default.
    choice : int, optional
        Choice of the chart that shows the curve; every choice by default.
    desired : bool
        Whether the curve is one that others of the chart should follow.
    stopped : bool
        Whether the run ended early, at the last finite value.
    quiet : bool
        Whether the curve is omitted from the label at the pointer.
    mark : str
        Marks at its points, "ring", "cross", "square", "dot", "triangle" or "diamond", or horizontal bars, "bar"; empty
        (default) for none.
    size : float
        Size of the marks relative to the usual one.
    faint : bool
        Whether the marks are small and pale, as those of many points.
    thickness : float
        Height of horizontal bars, as a share of the distance of two names.
    line : bool
        Whether a line joins the points; by default only if they have no marks.
    texts : sequence of str
        Text of each mark in the label at the pointer.
    """

    name: str
    y: ArrayLike
    x: ArrayLike | None = None
    look: Look = PLAIN_LOOK
    run: int | None = None
    shown: tuple[int, ...] | None = None
    choice: int | None = None
    desired: bool = False
    stopped: bool = False
    quiet: bool = False
    mark: Mark = ""
    size: float = 1.0
    faint: bool = False
    thickness: float = 0.6
    line: bool = False
    texts: Sequence[str] = ()

    def __post_init__(self) -> None:
        if self.x is not None and np.shape(self.x) != np.shape(self.y):
            raise ValueError(f'curve "{self.name}" has {np.shape(self.x)} abscissae and {np.shape(self.y)} ordinates')

    def is_shown(self, run: int | None, choice: int | None) -> bool:
        """Check whether the curve is shown for a selected run and a choice; None for all of them."""
        return (self.shown is None or run is None or run in self.shown) and (
            self.choice is None or choice is None or choice == self.choice
        )


class Span(NamedTuple):
    """Shaded range of the abscissa, with its name in the legend; empty without one."""

    low: float
    high: float
    name: str = ""


class ShownUnits(NamedTuple):
    """Units in which a chart is drawn: of its abscissa, and of its ordinate for each choice (one without choices)."""

    x: DisplayUnit
    y: tuple[DisplayUnit, ...]

    def of(self, choice: int | None) -> DisplayUnit:
        """Return the unit of the ordinate of a choice; of the first one if it is None."""
        return self.y[choice or 0]


@dataclass(frozen=True)
class Chart(Brief):
    """Chart: curves with two axes.

    Attributes
    ----------
    identity : str
        Identifier, unique among the charts of a page.
    title : str
        Title.
    y : Axis or sequence of Axis
        Vertical axis; one for each choice if their quantities differ.
    curves : sequence of Curve
        Curves.
    x : Axis
        Horizontal axis; the time by default.
    choices : sequence of str
        Names of the members that a page shows one at a time, such as links or motors.
    choosing : str
        Noun for a choice.
    overview : bool
        Whether the first choice shows all members together.
    equal : bool
        Whether both axes have the same scale and unit.
    spans : sequence of Span
        Shaded ranges of the abscissa.
    levels : sequence of float
        Ordinates at which a line is drawn, such as limits.
    note : str
        Sentence below the chart.
    on_page : bool
        Whether the page of a report shows the chart; otherwise it is only printed.
    of_runs : sequence of str
        Words on each run, such as its error, for the title of its panel in print.
    """

    identity: str
    title: str
    y: Axis | Sequence[Axis]
    curves: Sequence[Curve] = ()
    x: Axis = TIME
    choices: Sequence[str] = ()
    choosing: str = "shown"
    overview: bool = False
    equal: bool = False
    spans: Sequence[Span] = ()
    levels: Sequence[float] = ()
    note: str = ""
    on_page: bool = True
    of_runs: Sequence[str] = ()

    @property
    def has_values(self) -> bool:
        """Whether any curve has a point."""
        points = (joined([one.y]) + (0.0 if one.x is None else joined([one.x])) for one in self.curves)
        return any(bool(np.isfinite(each).any()) for each in points)

    @property
    def over_time(self) -> bool:
        """Whether the abscissa is the time of the runs."""
        return self.x is TIME

    @property
    def axes(self) -> Sequence[Axis]:
        """Vertical axes: one, or one for each choice."""
        return (self.y,) if isinstance(self.y, Axis) else self.y

    def axis(self, choice: int | None) -> Axis:
        """Return the vertical axis of a choice."""
        return self.axes[(choice or 0) if len(self.axes) > 1 else 0]

    def shown(self, run: int | None, choice: int | None) -> list[Curve]:
        """Return the curves that are shown for a selected run and a choice; None for all of them."""
        return [curve for curve in self.curves if curve.is_shown(run, choice)]

    def shown_units(self) -> ShownUnits:
        """Return the units in which the chart is drawn."""
        own = len(self.axes) > 1
        y = [
            axis.unit_for(joined(curve.y for curve in self.curves if curve.is_shown(None, k if own else None)))
            for k, axis in enumerate(self.axes)
        ]
        xs = joined(curve.x for curve in self.curves if curve.x is not None)
        x = self.x.unit_for(xs)
        if self.equal:
            x = y[0] = min(x, y[0], key=lambda unit: unit.factor)
        return ShownUnits(x, tuple(y if own else y * max(len(self.choices), 1)))


@dataclass(frozen=True)
class Panel(Brief):
    """Charts under one heading."""

    title: str
    charts: Sequence[Any]


def joined(values: Iterable[ArrayLike]) -> Array:
    """Return all values of several arrays as one."""
    return np.concatenate([np.zeros(0), *(np.asarray(one, dtype=float).ravel() for one in values)])


def is_wide(values: ArrayLike, ratio: float = _DECADE) -> bool:
    """Check whether the positive values differ by more than a ratio, by default a decade."""
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known) & (known > 0.0)]
    return bool(known.size and known.max() > ratio * known.min())


def is_logarithmic(axis: Axis, values: ArrayLike) -> bool:
    """Check whether an axis with these values is logarithmic: it may be, and the values span more than a decade."""
    return axis.log and is_wide(values)


def symmetrical_numbers(axis: Axis) -> Array:
    """Return the numbers of a symmetrical logarithmic axis with limits: zero and powers of ten, fewer if many fit.

    The first power of ten is left out because it would touch zero.
    """
    count = int(np.log10(max(-(axis.low or 0.0), axis.high or 0.0) / axis.linear_below)) + 1
    powers = axis.linear_below * 10.0 ** np.arange(1, count, -(-count // _MOST_POWERS))
    return np.concatenate([-powers[::-1], [0.0], powers])


def stairs(times: Array, values: Array) -> tuple[Array, Array]:
    """Return the corners of the step curve of values that are held until the next one."""
    return np.repeat(times, 2)[1:], np.repeat(values, 2)[:-1]
