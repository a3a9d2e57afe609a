"""Exception and warning classes, which carry the problem, its place and the remedy.

There are two families of errors. An `InputError` can be corrected by the user: it names the field, the value and the
remedy, and the command line prints it as one line and exits with code 2. A `NumericalError` names time, step, cause and
remedy, and carries the results computed until the failure.
"""

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

# Largest number of names listed in a message; the members of a mechanism and the metrics are fewer.
_LISTED = 60
_PACKAGE = os.path.dirname(__file__) + os.sep


def printable(text: str) -> str:
    """Return a text for a terminal: characters that move the cursor, set colours or reverse the writing are escaped."""
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() or one == "\n" else one.encode("unicode_escape").decode() for one in text)


class ParaflexError(Exception):
    """Base class of all errors raised by paraflex."""


class InputError(ParaflexError, ValueError):
    """A model, path or option that cannot be used as given.

    Parameters
    ----------
    problem : str
        Description of the error, in a few words.
    field : str
        Offending field, option or argument, as the user wrote it ("body.link1.length").
    value : object, optional
        Offending value; left out of the message if None.
    remedy : str
        Value or text to write instead; empty by default.
    source : str
        File that contains the field; empty for Python arguments and command-line options.
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

    def in_file(self, source: str) -> "InputError":
        """Return the same error with the name of its file."""
        return type(self)(self.problem, field=self.field, value=self.value, remedy=self.remedy, source=source)

    def at(self, field: str) -> "InputError":
        """Return the same error under another option or field, without a file."""
        return type(self)(self.problem, field=field, value=self.value, remedy=self.remedy)

    def advising(self, remedy: str) -> "InputError":
        """Return the same error with another remedy."""
        return type(self)(self.problem, field=self.field, value=self.value, remedy=remedy, source=self.source)

    def within(self, table: str) -> "InputError":
        """Return the same error with its field inside a table."""
        field = f"{table}.{self.field}"
        return type(self)(self.problem, field=field, value=self.value, remedy=self.remedy, source=self.source)


@contextmanager
def within(table: str) -> Iterator[None]:
    """Provide a context whose input errors name their fields inside a table."""
    try:
        yield
    except InputError as error:
        raise error.within(table) from None


@contextmanager
def renamed(field: str, *, only: str = "") -> Iterator[None]:
    """Provide a context that renames the field of input errors: of all, or of those of the field `only`."""
    try:
        yield
    except InputError as error:
        raise (error.at(field) if only in ("", error.field) else error) from None


@contextmanager
def optional_package(problem: str, *, field: str, value: object = None, remedy: str) -> Iterator[None]:
    """Provide a context for the import of a package that may be missing, which is then an `InputError`."""
    try:
        yield
    except ImportError:
        raise InputError(problem, field=field, value=value, remedy=remedy) from None


class OutputError(InputError):
    """A file or folder to which results cannot be written."""


def as_enum(kind: type[E], value: E | str, field: str) -> E:
    """Convert a member of an enumeration, or the value of one, to the member.

    Raises
    ------
    InputError
        The value is neither; the error names the field.
    """
    try:
        return kind(value)
    except ValueError:
        what = re.sub("(?<=[a-z])(?=[A-Z])", " ", kind.__name__).lower()
        remedy = suggestion(value, [member.value for member in kind])
        raise InputError(f"unknown {what}", field=field, value=value, remedy=remedy) from None


def warn_user(warning: "ParaflexWarning") -> None:
    """Issue a warning that points to the calling line outside of this package.

    The number of calls in between depends on decorators and code paths, so a constant `stacklevel` cannot be used.
    """
    frame, level = sys._getframe(), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        frame, level = frame.f_back, level + 1
    warnings.warn(warning, stacklevel=level)


def suggestion(name: object, known: Iterable[str]) -> str:
    """Return a remedy for an unknown name: the closest known name, or all known names if there is no single closest.

    If no name is close as a whole, names that contain a close word are candidates: "centre_of_mass" for "center".
    """
    known = list(known)
    if len(same := [each for each in known if each.casefold() == str(name).casefold()]) == 1:
        return f'did you mean "{same[0]}"?'
    near = get_close_matches(str(name), known, n=2)
    near = near or [each for each in known if get_close_matches(str(name), each.split("_"), n=1)]
    alike = [SequenceMatcher(None, str(name), each).ratio() for each in near]
    if near and len(set(alike)) == len(alike):
        return f'did you mean "{near[0]}"?'
    return f"choose from {listed(known)}" if known else "there is none to choose from"


def listed(names: Sequence[object], most: int = _LISTED) -> str:
    """Join names for a message; beyond `most`, only the first ones and the number of others."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(str, names[:most])) + more


def _short(value: object, limit: int = 80) -> str:
    """Return a value in one line; longer text of built-in types is cut off, other objects are given by their class."""
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
        Time [s].
    step : int, optional
        Number of accepted steps (or path samples) until then; None where there are none.
    position : tuple of float, optional
        Position of the end-effector in the ground frame [m]; None if unknown.
    """

    time: float
    step: int | None = None
    position: tuple[float, ...] | None = None

    def __str__(self) -> str:
        text = f"t = {self.time:.6g} s" + (f" (step {self.step})" if self.step is not None else "")
        if self.position is not None:
            text += ", end-effector at (" + ", ".join(f"{x:.4g}" for x in self.position) + ") m"
        return text


class NumericalError(ParaflexError, ArithmeticError):
    """A computation that failed.

    Attributes
    ----------
    cause : str
        Reason of the failure.
    moment : Moment or None
        Time and place of the failure.
    partial : object or None
        Results computed until the failure, of the type that the function returns.
    remedy : str
        Advice to the user; empty if there is no general one.
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
    """Numbers of a model that differ by so many orders of magnitude that its equations cannot be solved in floats."""


class AssemblyError(NumericalError):
    """Failure to close the loops of a mechanism at a pose."""


class UnreachablePathError(AssemblyError):
    """A path that the end-effector cannot follow: out of reach, or past a Type I singularity.

    Attributes
    ----------
    detail : str
        Text appended to `problem`; empty by default.
    shortfall : float
        Largest distance of a path point from the reachable points [m]; zero if all can be reached.
    shortfall_angle : float
        Largest such difference of the end-effector's angle, if the path prescribes it [rad].
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
        """Cause and moment, followed by `detail`: the distance of the path from the workspace."""
        return f"{super().problem}: {self.detail}" if self.detail else super().problem


class InconsistentConstraintsError(NumericalError):
    """Constraints that are inconsistent in velocity or acceleration although the loops are closed."""


class EquilibriumError(NumericalError):
    """No static equilibrium was found: the mechanism can move freely, or the joints do not allow what is prescribed."""


class LimitPointError(EquilibriumError):
    """Loads or prescribed travel beyond the last limit point of a branch of equilibria."""


class ActuationError(NumericalError):
    """A set of motors that cannot drive the mechanism."""


class SingularActuationError(ActuationError):
    """A path that meets a Type II singularity of the chosen motors."""


class IntegrationError(NumericalError):
    """A forward simulation that stopped early: singular constraints, no convergence, or too many steps."""


class SingularPositionError(IntegrationError):
    """A run that reached a singular position, where constraints become dependent, and did not pass it."""


class SliderOffBeamError(IntegrationError):
    """A sliding point that reached the end of its beam, where the joint has `at_end` "error"."""


class ConstraintDriftError(IntegrationError):
    """Constraint violations larger than integration errors can explain."""


class ControllerError(NumericalError):
    """A controller that raised an error or returned invalid torques, which ended the run."""


class ParaflexWarning(UserWarning):
    """Base class of all warnings of paraflex: `warnings.simplefilter("error", ParaflexWarning)` raises them.

    Attributes
    ----------
    finding : Finding or None
        Finding that the warning reports, with code, place and remedy: see `paraflex.findings`.
    """

    finding: Any = None


class ModelWarning(ParaflexWarning):
    """A doubtful property of a model or a study, which may be intended: see `findings`."""


class ResultWarning(ParaflexWarning):
    """A result that is implausible for the mass, size and speed of the mechanism: see `findings`."""


class StiffnessWarning(ParaflexWarning):
    """An explicit method that needs very many steps, for stability alone."""


class ValidityWarning(ParaflexWarning):
    """A run outside the range of validity of its model: see `validity`."""
