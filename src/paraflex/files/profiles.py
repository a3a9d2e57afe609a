"""Reading and writing of time profiles in files: constants, constant speeds, expressions of t, pieces, and tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.files.expressions import (
    check_in_time,
    evaluate,
    evaluate_in_time,
    expressed_in,
    is_constant,
    names_in,
)
from paraflex.files.schema import PieceTable, PrescribedTable
from paraflex.mechanism import ConstantSpeed, PiecewiseProfile, TabulatedProfile, TimeProfile
from paraflex.mechanism.loads import InTime
from paraflex.mechanism.profiles import Interpolation, Values

# Number of times at which a profile is evaluated as a check when it is read.
_TRIALS = 257


@dataclass(frozen=True)
class ExpressionProfile:
    """Profile given by an expression of the time t and of parameters, with exact derivatives.

    Attributes
    ----------
    text : str
        Expression.
    parameters : mapping of str to float
        Values of the parameters; those that do not occur in the text are dropped.
    field : str
        Field of the file, for errors.
    knots : tuple of float
        Times at which derivatives jump [s]; none by default.

    Raises
    ------
    InputError
        Invalid expression, or expression with an unknown parameter.
    """

    text: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    field: str = field(default="angle", compare=False)
    knots: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        with expressed_in(self.field, self.text):
            check_in_time(self.text, self.parameters)
        occurring = names_in(self.text)
        used = {name: value for name, value in self.parameters.items() if name in occurring}
        object.__setattr__(self, "parameters", used)

    def evaluate(self, t: Array) -> Values:
        """Evaluate value, rate and acceleration at times t [s].

        Raises
        ------
        InputError
            Value or derivative that is not finite at some time.
        """
        with expressed_in(self.field, self.text):
            jet = evaluate_in_time(self.text, self.parameters, t)
        return jet.value, jet.rate, jet.acceleration


def read_profile(entry: PrescribedTable, parameters: Mapping[str, float], duration: float | None) -> TimeProfile:
    """Read the profile of a [prescribed.NAME] table, and evaluate it over the duration of the study as a check.

    Parameters
    ----------
    entry : PrescribedTable
        Table of the prescribed motion.
    parameters : mapping of str to float
        Values of the parameters of the file.
    duration : float or None
        Duration of the study [s]; if None, the profile is evaluated at t = 0 only.

    Raises
    ------
    InputError
        Profile given in two ways, speed together with anything but a number, pieces that do not connect, expression
        without finite derivatives, or table that is invalid or does not cover the study.
    """
    given = [name for name in ("angle", "displacement", "pieces", "table") if getattr(entry, name) is not None]
    if len(given) > 1:
        raise InputError(
            "a profile is given in two ways", field=given[-1], value=", ".join(given), remedy=f"drop all but {given[0]}"
        )
    profile = _profile(entry, parameters)
    if entry.speed is not None and not isinstance(profile, ConstantSpeed):
        raise InputError(
            "a speed can only be added to an angle or displacement that is a number",
            field="speed",
            value=entry.speed,
            remedy="write it into the profile",
        )
    _try(profile, duration)
    return profile


def _try(profile: TimeProfile, duration: float | None) -> None:
    """Evaluate a profile over the duration of the study, or at t = 0 if it has none."""
    # An invalid duration is reported when the study is checked.
    profile.evaluate(np.linspace(0.0, duration, _TRIALS) if duration is not None and duration > 0.0 else np.zeros(1))


def quantities(entry: PrescribedTable) -> set[str]:
    """Return which of "angle" and "displacement" occur in a [prescribed.NAME] table."""
    tables: list[PrescribedTable | PieceTable] = [entry, *(entry.pieces or [])]
    return {name for table in tables for name in ("angle", "displacement") if getattr(table, name) is not None}


def profile_table(profile: TimeProfile, quantity: str) -> dict[str, Any]:
    """Build the fields of a [prescribed.NAME] table for the profile of an "angle" or a "displacement".

    Raises
    ------
    InputError
        Profile that cannot be expressed in a file.
    """
    match profile:
        case ConstantSpeed(angle=angle, speed=speed, knots=()):
            return ({} if profile.from_assembly else {quantity: angle}) | ({"speed": speed} if speed else {})
        case ExpressionProfile(text=text, knots=()):
            return {quantity: text}
        case TabulatedProfile(times=times, values=values):
            return {"table": list(zip(times, values, strict=True))}
        case PiecewiseProfile(pieces=pieces, ends=ends):
            last = {quantity: _piece(pieces[-1])}
            before = zip(ends, pieces, strict=False)
            return {"pieces": [*({"until": end, quantity: _piece(piece)} for end, piece in before), last]}
    raise _inexpressible_profile(profile)


def read_components(
    entry: Any, quantity: str, parameters: Mapping[str, float], duration: float | None
) -> tuple[InTime, ...]:
    """Read the two components of a "force", or the one of a "torque", and check profiles as `read_profile` does.

    Parameters
    ----------
    entry : table
        Table with a field of the quantity's name, `pieces` and `table`, exactly one of which is given, and the
        `interpolation` of a table.
    quantity : str
        "force" or "torque".
    parameters : mapping of str to float
        Values of the parameters of the file.
    duration : float or None
        Duration of the study [s].

    Raises
    ------
    InputError
        Invalid profile; see `read_profile`.
    """
    given = [name for name in (quantity, "pieces", "table") if getattr(entry, name) is not None]
    if len(given) != 1:
        problem = f"its {quantity} is given in two ways" if given else "is missing"
        raise InputError(
            problem, field=given[-1] if given else quantity, value=", ".join(given) or None,
            remedy=f"drop all but {given[0]}" if given else f"give it, or pieces or a table of the {quantity}",
        )  # fmt: skip
    if entry.interpolation is not None and entry.table is None:
        raise InputError(
            "is for tables only", field="interpolation", value=entry.interpolation, remedy="drop it, or give a table"
        )
    if entry.table is not None:
        times, *columns = zip(*entry.table, strict=True) if entry.table else ((), ())
        kind = Interpolation(entry.interpolation or Interpolation.SPLINE)
        found = [TabulatedProfile(times, column, kind) for column in columns]
        components = tuple(profile.values[0] if len(set(profile.values)) == 1 else profile for profile in found)
    elif entry.pieces is not None:
        ends = _ends(entry.pieces)
        rows = [
            _functions(getattr(piece, quantity), parameters, f"pieces.{k}.{quantity}")
            for k, piece in enumerate(entry.pieces)
        ]
        components = tuple(_joined(profiles, ends) for profiles in zip(*rows, strict=True))
    else:
        components = _functions(getattr(entry, quantity), parameters, quantity)
    for profile in components:
        if isinstance(profile, TimeProfile):
            _try(profile, duration)
    return components


def _functions(given: Any, parameters: Mapping[str, float], field: str) -> tuple[InTime, ...]:
    """Read the numbers and expressions of one quantity; expressions that do not contain the time become numbers."""
    listed = isinstance(given, list)
    profiles = [
        _expression(each, parameters, f"{field}.{k}" if listed else field)
        for k, each in enumerate(given if listed else [given])
    ]
    return tuple(profile.angle if isinstance(profile, ConstantSpeed) else profile for profile in profiles)


def _joined(profiles: Sequence[InTime], ends: list[float]) -> InTime:
    """Join pieces to one profile, or to a number if all pieces are the same number."""
    first = profiles[0]
    if not isinstance(first, TimeProfile) and all(profile == first for profile in profiles):
        return first
    return PiecewiseProfile(
        tuple(profile if isinstance(profile, TimeProfile) else ConstantSpeed(profile, 0.0) for profile in profiles),
        tuple(ends),
    )


def components_table(components: Sequence[InTime], quantity: str) -> dict[str, Any]:
    """Build the fields of a table for the components of a "force" or a "torque".

    Raises
    ------
    InputError
        Profiles that cannot be expressed in a file, or components with different pieces or times.
    """

    def in_file(values: Sequence[Any]) -> Any:
        return list(values) if quantity == "force" else values[0]

    tables = [profile for profile in components if isinstance(profile, TabulatedProfile)]
    pieces = [profile for profile in components if isinstance(profile, PiecewiseProfile)]
    if tables:
        times, kind = tables[0].times, tables[0].interpolation
        columns = [
            profile.values if isinstance(profile, TabulatedProfile) else (profile,) * len(times)
            for profile in components
            if not isinstance(profile, TimeProfile)
            or (isinstance(profile, TabulatedProfile) and (profile.times, profile.interpolation) == (times, kind))
        ]
        if len(columns) < len(components):
            raise _unlike(components)
        table = {"table": [[*row] for row in zip(times, *columns, strict=True)]}
        return table | ({"interpolation": kind.value} if tables[0].linear else {})
    if not pieces:
        return {quantity: in_file([_piece(profile) for profile in components])}
    ends = pieces[0].ends
    if any(profile.ends != ends for profile in pieces):
        raise _unlike(components)
    rows = [
        in_file(
            [_piece(profile.pieces[k] if isinstance(profile, PiecewiseProfile) else profile) for profile in components]
        )
        for k in range(len(ends) + 1)
    ]
    return {
        "pieces": [*({"until": end, quantity: row} for end, row in zip(ends, rows, strict=False)), {quantity: rows[-1]}]
    }


def profile_parameters(profiles: Iterable[tuple[str, TimeProfile]]) -> dict[str, float]:
    """Collect the parameters of profiles, each given with its field in a file.

    Raises
    ------
    InputError
        Parameter with different values in two profiles.
    """
    found: dict[str, float] = {}
    for place, whole in profiles:
        for profile in whole.pieces if isinstance(whole, PiecewiseProfile) else (whole,):
            for name, value in profile.parameters.items() if isinstance(profile, ExpressionProfile) else ():
                if found.setdefault(name, value) != value:
                    raise InputError(
                        f'a file has one value of the parameter "{name}", but profiles have {found[name]!r}, {value!r}',
                        field=place, remedy="rename one of them",
                    )  # fmt: skip
    return found


def _piece(profile: InTime) -> float | str:
    if not isinstance(profile, TimeProfile):
        return float(profile)
    if isinstance(profile, ExpressionProfile):
        return profile.text
    if isinstance(profile, ConstantSpeed):
        return (
            float(profile.angle) if profile.speed == 0.0 else f"{float(profile.angle)!r} + {float(profile.speed)!r} * t"
        )
    raise _inexpressible_profile(profile)


def _inexpressible_profile(profile: TimeProfile) -> InputError:
    return InputError(
        "a model file cannot express this profile", field="profile", value=type(profile).__name__,
        remedy="give a ConstantSpeed, ExpressionProfile, PiecewiseProfile of these, or TabulatedProfile of its values",
    )  # fmt: skip


def _unlike(components: Sequence[InTime]) -> InputError:
    return InputError(
        "a model file cannot express a force whose components change at different times",
        field="force", value=", ".join(type(profile).__name__ for profile in components),
        remedy="give both pieces with the same ends, or tables of the same times and interpolation",
    )  # fmt: skip


def _profile(entry: PrescribedTable, parameters: Mapping[str, float]) -> TimeProfile:
    if entry.table is not None:
        times, values = zip(*entry.table, strict=True) if entry.table else ((), ())
        return TabulatedProfile(times, values)
    if entry.pieces is not None:
        return _pieces(entry.pieces, parameters)
    field, given = _place(entry)
    if given is None:
        return ConstantSpeed(0.0, entry.speed or 0.0, from_assembly=True)
    return _expression(given, parameters, field, entry.speed or 0.0)


def _place(table: PrescribedTable | PieceTable) -> tuple[str, Any]:
    """Return the field name and the value of the angle or displacement in a table; the value is None without either."""
    return ("angle", table.angle) if table.displacement is None else ("displacement", table.displacement)


def _pieces(pieces: list[PieceTable], parameters: Mapping[str, float]) -> PiecewiseProfile:
    profiles = []
    for number, piece in enumerate(pieces):
        field = f"pieces.{number}"
        if (piece.angle is None) == (piece.displacement is None):
            raise InputError(
                "a piece needs one profile, an angle or a displacement",
                field=field,
                remedy="give its angle, or its displacement where the joint slides",
            )
        name, given = _place(piece)
        assert given is not None
        profiles.append(_expression(given, parameters, f"{field}.{name}"))
    return PiecewiseProfile(tuple(profiles), tuple(_ends(pieces)))


def _ends(pieces: Sequence[Any]) -> list[float]:
    """Return the end times of all pieces but the last [s]."""
    for number, piece in enumerate(pieces):
        if (piece.until is None) != (number == len(pieces) - 1):
            raise InputError(
                "every piece but the last has an end, and the last has none", field=f"pieces.{number}.until",
                value=piece.until, remedy="give the time in s at which the next one takes over; the last goes on",
            )  # fmt: skip
    return [piece.until for piece in pieces[:-1]]


def _expression(given: float | str, parameters: Mapping[str, float], field: str, speed: float = 0.0) -> TimeProfile:
    if not isinstance(given, str):
        return ConstantSpeed(given, speed)
    if is_constant(given):
        with expressed_in(field, given):
            return ConstantSpeed(evaluate(given, parameters), speed)
    return ExpressionProfile(given, parameters, field)
