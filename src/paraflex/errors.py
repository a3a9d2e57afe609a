"""Typed errors with the problem, its place and the remedy.

Two families. An `InputError` is the user's to mend: it names the field, the value and the remedy, and the
command line turns it into one line and exit code 2. A `NumericalError` names time, step, cause and remedy, and
carries what was computed until then.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import SequenceMatcher, get_close_matches
from enum import Enum
from typing import Any, TypeVar

E = TypeVar("E", bound=Enum)

# Names in a message: more than a mechanism's members, or the metrics, are not read.
_LISTED = 60
_PACKAGE = os.path.dirname(__file__) + os.sep


def printable(text: str) -> str:
    """A text for a terminal: what would move the cursor, colour or turn round what follows stands as its escape."""
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() or one == "\n" else one.encode("unicode_escape").decode() for one in text)


class ParaflexError(Exception):
    """Base class of every error that paraflex raises."""


class InputError(ParaflexError, ValueError):
    """A model, path or option that cannot be used as given.

    Parameters
    ----------
    problem : str
        What is wrong, in a few words.
    field : str
        The field, option or argument at fault, as the user wrote it ("body.link1.length").
    value : object, optional
        The offending value; left out of the message where there is none.
    remedy : str
        What to write instead.
    source : str
        The file the field stands in; empty for Python arguments and command-line options.
    """

    def __init__(self, problem: str, *, field: str, value: object = None, remedy: str = "", source: str = "") -> None:
        self.problem = problem
        self.field = field
        self.value = value
        self.remedy = remedy
        self.source = source
        super().__init__(self._text())

    def _text(self) -> str:
        where = f"{self.source}: {self.field}" if self.source else self.field
        value = "" if self.value is None else f" (got {_short(self.value)})"
        remedy = f"; {self.remedy}" if self.remedy else ""
        return printable(f"{where}: {self.problem}{value}{remedy}").replace("\n", "\\n")

    def in_file(self, source: str) -> InputError:
        """The same error with the name of its file."""
        return type(self)(self.problem, field=self.field, value=self.value, remedy=self.remedy, source=source)

    def at(self, field: str) -> InputError:
        """The same error with another option or field."""
        return type(self)(self.problem, field=field, value=self.value, remedy=self.remedy)

    def advising(self, remedy: str) -> InputError:
        """The same error with another remedy."""
        return type(self)(self.problem, field=self.field, value=self.value, remedy=remedy, source=self.source)

    def within(self, table: str) -> InputError:
        """The same error with its field inside a table."""
        field = f"{table}.{self.field}"
        return type(self)(self.problem, field=field, value=self.value, remedy=self.remedy, source=self.source)


@contextmanager
def within(table: str) -> Iterator[None]:
    """Context whose input errors name their fields inside a table."""
    try:
        yield
    except InputError as error:
        raise error.within(table) from None


@contextmanager
def renamed(field: str, *, only: str = "") -> Iterator[None]:
    """Context whose input errors name another field: all of them, or those of one field only."""
    try:
        yield
    except InputError as error:
        raise (error.at(field) if only in ("", error.field) else error) from None


class OutputError(InputError):
    """A place where results cannot be written."""


def as_enum(kind: type[E], value: E | str, field: str) -> E:
    """A member of an enumeration from itself or from its value.

    Raises
    ------
    InputError
        Anything else, under the field's name.
    """
    try:
        return kind(value)
    except ValueError:
        what = re.sub("(?<=[a-z])(?=[A-Z])", " ", kind.__name__).lower()
        remedy = suggestion(value, [member.value for member in kind])
        raise InputError(f"unknown {what}", field=field, value=value, remedy=remedy) from None


def warn_user(warning: ParaflexWarning) -> None:
    """Issue a warning at the line outside of this package that caused it.

    How many calls are between depends on decorators and short cuts, so that no constant `stacklevel` would do.
    """
    frame, level = sys._getframe(), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        frame, level = frame.f_back, level + 1
    warnings.warn(warning, stacklevel=level)


def suggestion(name: object, known: Iterable[str]) -> str:
    """A remedy for an unknown name: the nearest known one, or all of them if several are as near.

    Where no name is near, one of whose words is near stands for it: "center" for "centre_of_mass".
    """
    known = list(known)
    near = get_close_matches(str(name), known, n=2)
    near = near or [each for each in known if get_close_matches(str(name), each.split("_"), n=1)]
    alike = [SequenceMatcher(None, str(name), each).ratio() for each in near]
    if near and len(set(alike)) == len(alike):
        return f'did you mean "{near[0]}"?'
    return f"choose from {listed(known)}" if known else "there is none to choose from"


def listed(names: Sequence[str]) -> str:
    """Names in a message, the first of them where they are many."""
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more


def _short(value: object, limit: int = 80) -> str:
    """A value in one line; for a longer one its kind."""
    text = repr(value).replace("\n", " ")
    if len(text) <= limit:
        return text
    kind = type(value)
    if kind.__module__ == "builtins" or issubclass(kind, str):
        return text[: limit - 3] + "..."
    return f"{'an' if kind.__name__[0] in 'AEIOU' else 'a'} {kind.__name__}"


@dataclass(frozen=True)
class Moment:
    """Time and place at which a computation stopped.

    Attributes
    ----------
    time : float
        [s]
    step : int
        Accepted steps (or path samples) until then.
    position : tuple of float, optional
        Of the end-effector in the ground frame [m], where it is known.
    """

    time: float
    step: int
    position: tuple[float, ...] | None = None

    def __str__(self) -> str:
        text = f"t = {self.time:.6g} s (step {self.step})"
        if self.position is not None:
            text += ", end-effector at (" + ", ".join(f"{x:.4g}" for x in self.position) + ") m"
        return text


class NumericalError(ParaflexError, ArithmeticError):
    """A computation that failed.

    Attributes
    ----------
    cause : str
        Why, in words.
    moment : Moment or None
        When and where.
    partial : object or None
        What was computed until then, of the type the function returns.
    remedy : str
        What to do about it; empty where nothing general can be said.
    """

    def __init__(self, cause: str, moment: Moment | None = None, partial: Any = None, remedy: str = "") -> None:
        self.cause = cause
        self.moment = moment
        self.partial = partial
        self.remedy = remedy
        super().__init__(cause)

    @property
    def problem(self) -> str:
        """Cause and moment, without the remedy."""
        return self.cause if self.moment is None else f"{self.cause} at {self.moment}"

    def __str__(self) -> str:
        return printable(f"{self.problem}; {self.remedy}" if self.remedy else self.problem)


class ProportionError(NumericalError):
    """Numbers so far apart that equations of them cannot be solved in floating point."""


class AssemblyError(NumericalError):
    """The mechanism's loops cannot be closed at a pose."""


class UnreachablePathError(AssemblyError):
    """The end-effector cannot follow the path: out of reach, or past a Type I singularity.

    Attributes
    ----------
    shortfall : float
        Distance of the furthest point of the path from those that can be reached [m]; zero where all can.
    shortfall_angle : float
        The same of the end-effector's angle, where it is prescribed [rad].
    """

    def __init__(
        self,
        cause: str,
        moment: Moment | None = None,
        partial: Any = None,
        remedy: str = "",
        *,
        detail: str = "",
        shortfall: float = 0.0,
        shortfall_angle: float = 0.0,
    ) -> None:
        super().__init__(cause, moment, partial, remedy)
        self.detail = detail
        self.shortfall = shortfall
        self.shortfall_angle = shortfall_angle

    @property
    def problem(self) -> str:
        """Cause, moment, and distance of the path from the workspace."""
        return f"{super().problem}: {self.detail}" if self.detail else super().problem


class InconsistentConstraintsError(NumericalError):
    """Constraints that contradict one another in velocity or acceleration, though the loops are closed."""


class EquilibriumError(NumericalError):
    """No static equilibrium is found: something is loose, or joints allow no more of what is given."""


class LimitPointError(EquilibriumError):
    """Loads or travel beyond the last limit point of a branch of equilibria."""


class ActuationError(NumericalError):
    """A set of motors that cannot drive the mechanism."""


class SingularActuationError(ActuationError):
    """The path meets a Type II singularity of the chosen motors."""


class IntegrationError(NumericalError):
    """Forward simulation stopped before its end: singular constraints, no convergence, or too many steps."""


class SingularPositionError(IntegrationError):
    """A run reached a singular position, where constraints depend on one another, and did not pass it."""


class SliderOffBeamError(IntegrationError):
    """A sliding point reached the end of its beam, and the joint has `at_end` "error"."""


class ConstraintDriftError(IntegrationError):
    """Constraints are violated by more than errors of integration explain."""


class ControllerError(NumericalError):
    """A controller raised an error, or returned what cannot be torques: the run has ended there."""


class ParaflexWarning(UserWarning):
    """Base class of all warnings of paraflex: `warnings.simplefilter("error", ParaflexWarning)` raises them.

    Attributes
    ----------
    finding : Finding or None
        What it is about, with code, place and remedy: see `paraflex.findings`.
    """

    finding: Any = None


class ModelWarning(ParaflexWarning):
    """Something in a model or a study is doubtful, but may be intended: see `findings`."""


class ResultWarning(ParaflexWarning):
    """A result is implausible for the mass, size and speed of the mechanism: see `findings`."""


class StiffnessWarning(ParaflexWarning):
    """Stability requires very many steps of an explicit method."""


class ValidityWarning(ParaflexWarning):
    """The model is not valid for a run: see `validity`."""
