"""Reading and writing of time profiles in files: constants, constant speeds, expressions of t, pieces, and tables."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError, renamed
from paraflex.expressions.evaluate import check_in_time, evaluate, evaluate_in_time, expressed_in, is_constant, names_in
from paraflex.mechanism import ConstantSpeed, ForceLaw, PiecewiseProfile, SpeedProfile, TabulatedProfile, TimeProfile
from paraflex.mechanism.loads import InMotion
from paraflex.mechanism.profiles import Interpolation, Values, check_ascending
from .fields import unit_over
from .schema import PieceTable, PrescribedTable

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
    if entry.ramps is not None or isinstance(entry.speed, str) or _pieces_of_speed(entry):
        profile: TimeProfile = _speed_profile(entry, parameters)
        with renamed("ramps" if entry.ramps is not None else "speed", only="table"):
            _try(profile, duration)
        return profile
    given = [*_quantities(entry), *(name for name in ("pieces", "table") if getattr(entry, name) is not None)]
    if len(given) > 1:
        raise InputError(
            "a profile is given in two ways", field=given[-1], value=", ".join(given), remedy=f"drop all but {given[0]}"
        )
    profile = _profiles(entry, parameters)[0] if given else ConstantSpeed(0.0, 0.0, from_assembly=True)
    if entry.speed is not None:
        if not isinstance(profile, ConstantSpeed):
            raise InputError(
                "a speed can only be added to an angle or displacement that is a number",
                field="speed",
                value=entry.speed,
                remedy="write it into the profile",
            )
        profile = replace(profile, speed=entry.speed)
    _try(profile, duration)
    return profile


def _speed_profile(entry: PrescribedTable, parameters: Mapping[str, float]) -> TimeProfile:
    """Read the profile of a motion whose speed is an expression of the time, or is given by ramps or pieces."""
    given = [name for name in ("speed", "ramps", "pieces", "table") if getattr(entry, name) is not None]
    if len(given) > 1:
        speeds = ("ramps", *(["pieces"] if _pieces_of_speed(entry) else []))
        raise InputError(
            "a speed is given in two ways" if given[1] in speeds else "speeds and values are given", field=given[-1],
            value=", ".join(given), remedy=f"drop all but {given[0]}",
        )  # fmt: skip
    start = _expressions(entry, parameters)[0] if _quantities(entry) else ConstantSpeed(0.0, 0.0, from_assembly=True)
    if not isinstance(start, ConstantSpeed):
        raise InputError(
            "a speed can only be added to an angle or displacement that is a number", field=given[0],
            value=entry.speed, remedy="write it into the profile",
        )  # fmt: skip
    if entry.ramps is not None:
        with renamed("ramps", only="table"):
            times, speeds = zip(*entry.ramps, strict=True) if entry.ramps else ((), ())
            speed: TimeProfile = TabulatedProfile(times, speeds, Interpolation.LINEAR)
    elif entry.pieces is not None:
        for number, piece in enumerate(entry.pieces):
            if piece.speed is None:
                raise InputError(
                    "speeds and values are given", field=f"pieces.{number}", remedy="give the speed in all pieces"
                )
        speed = _profiles(entry, parameters)[0]
    else:
        speed = _expression(str(entry.speed), parameters, "speed")
    if isinstance(speed, ConstantSpeed):
        return replace(start, speed=speed.angle)
    return SpeedProfile(start.angle, speed, start.from_assembly)


def _pieces_of_speed(entry: PrescribedTable) -> bool:
    """Check whether the speed is given in a piece of a motion."""
    return any(piece.speed is not None for piece in entry.pieces or ())


def _try(profile: TimeProfile, duration: float | None) -> None:
    """Evaluate a profile over the duration of the study, or at t = 0 if it has none."""
    # An invalid duration is reported when the study is checked.
    profile.evaluate(np.linspace(0.0, duration, _TRIALS) if duration is not None and duration > 0.0 else np.zeros(1))


def quantities(entry: PrescribedTable) -> set[str]:
    """Return which of "angle" and "displacement" occur in a [prescribed.NAME] table."""
    return {name for table in (entry, *(entry.pieces or [])) for name in _quantities(table)}


def _quantities(table: Any) -> list[str]:
    """Return the quantities whose number or expression is given in a table or a piece of one."""
    own = ("speed",) if isinstance(table, PieceTable) else ()
    return [
        name for name in ("angle", "displacement", "force", "torque", *own) if getattr(table, name, None) is not None
    ]


def profile_table(profile: TimeProfile, quantity: str) -> dict[str, Any]:
    """Build the fields of a [prescribed.NAME] table for the profile of an "angle" or a "displacement".

    Raises
    ------
    InputError
        Profile that cannot be expressed in a file.
    """
    if isinstance(profile, ConstantSpeed) and not profile.knots:
        speed = {"speed": profile.speed} if profile.speed else {}
        return speed if profile.from_assembly else {quantity: profile.angle} | speed
    if isinstance(profile, SpeedProfile):
        speed = components_table((profile.speed,), "speed")
        if "table" in speed:
            if speed.get("interpolation") != "linear":
                raise _inexpressible_profile(profile)
            speed = {"ramps": speed["table"]}
        return speed if profile.from_assembly else {quantity: profile.angle} | speed
    if isinstance(profile, ConstantSpeed | ExpressionProfile) and profile.knots:
        raise _inexpressible_profile(profile)
    return components_table((profile,), quantity)


def read_components(
    entry: Any, quantity: str, parameters: Mapping[str, float], duration: float | None
) -> tuple[InMotion, ...]:
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
    over = getattr(entry, "over", None)
    if over is not None and entry.table is None:
        raise InputError(
            "is for tables only", field="over", value=over, remedy=f"write the {quantity} as an expression"
        )
    if over is not None:
        check_ascending([row[0] for row in entry.table], f"values of {over}", unit_over(over) or "")
    components = tuple(map(_number_if_constant, _profiles(entry, parameters)))
    if over is not None:
        # A column of one number is no law.
        return tuple(
            ForceLaw(over, parameters, table=each, field="over") if isinstance(each, TabulatedProfile) else each
            for each in components
        )
    for profile in components:
        if isinstance(profile, TimeProfile):
            _try(profile, duration)
    return components


def _profiles(entry: Any, parameters: Mapping[str, float]) -> list[Any]:
    """Read the profile or law of each component of a quantity, from rows, pieces, or numbers and expressions."""
    if entry.table is not None:
        times, *columns = zip(*entry.table, strict=True) if entry.table else ((), ())
        kind = getattr(entry, "interpolation", None) or Interpolation.SPLINE
        return [TabulatedProfile(times, column, kind) for column in columns]
    if entry.pieces is not None:
        ends = _ends(entry.pieces)
        rows = [_expressions(piece, parameters, f"pieces.{k}") for k, piece in enumerate(entry.pieces)]
        return [PiecewiseProfile(pieces, ends) for pieces in zip(*rows, strict=True)]
    return _expressions(entry, parameters)


def _expressions(table: Any, parameters: Mapping[str, float], place: str = "") -> list[Any]:
    """Read the numbers and expressions of the one quantity of a table or piece; `place` is that of a piece."""
    given = _quantities(table)
    if len(given) != 1:
        raise InputError(
            "a piece needs one profile, an angle, a displacement or a speed",
            field=place,
            remedy="give its angle, or its displacement where the joint slides, or its speed",
        )
    field, value = f"{place}.{given[0]}".strip("."), getattr(table, given[0])
    if isinstance(value, list):
        return [_expression(each, parameters, f"{field}.{k}") for k, each in enumerate(value)]
    return [_expression(value, parameters, field)]


def _expression(given: float | str, parameters: Mapping[str, float], field: str) -> Any:
    """Read a number or an expression, a law if it has quantities of the motion, a constant if it has no time."""
    if isinstance(given, str) and any("." in name for name in names_in(given)):
        return ForceLaw(given, parameters, field=field)
    if isinstance(given, str) and not is_constant(given):
        return ExpressionProfile(given, parameters, field)
    with expressed_in(field, given):
        return ConstantSpeed(evaluate(given, parameters) if isinstance(given, str) else given, 0.0)


def _number_if_constant(profile: Any) -> InMotion:
    """Return a number for a constant profile, and for pieces or rows of one and the same number."""
    pieces = profile.pieces if isinstance(profile, PiecewiseProfile) else (profile,)
    if isinstance(profile, TabulatedProfile):
        values = profile.values
    elif all(isinstance(piece, ConstantSpeed) for piece in pieces):
        values = [piece.angle for piece in pieces if isinstance(piece, ConstantSpeed)]
    else:
        return profile
    return values[0] if len(set(values)) == 1 else profile


def components_table(components: Sequence[InMotion], quantity: str) -> dict[str, Any]:
    """Build the fields of a table for the components of a "force" or a "torque".

    Raises
    ------
    InputError
        Profiles that cannot be expressed in a file, or components with different pieces or times.
    """

    def in_file(values: Sequence[Any]) -> Any:
        return list(values) if quantity == "force" else values[0]

    over = {each.text for each in components if isinstance(each, ForceLaw) and each.table is not None}
    if over:
        given = [each.table if isinstance(each, ForceLaw) else each for each in components]
        columns = [each for each in given if isinstance(each, TabulatedProfile | int | float)]
        in_time = any(isinstance(each, TabulatedProfile) for each in components)
        if len(over) > 1 or in_time or len(columns) < len(components):
            raise _unlike(components)
        return {"over": over.pop()} | components_table(columns, quantity)
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


def profile_parameters(profiles: Iterable[tuple[str, TimeProfile | ForceLaw]]) -> dict[str, float]:
    """Collect the parameters of profiles, each given with its field in a file.

    Raises
    ------
    InputError
        Parameter with different values in two profiles.
    """
    found: dict[str, float] = {}
    for place, whole in profiles:
        whole = whole.speed if isinstance(whole, SpeedProfile) else whole
        for profile in whole.pieces if isinstance(whole, PiecewiseProfile) else (whole,):
            for name, value in profile.parameters.items() if isinstance(profile, ExpressionProfile | ForceLaw) else ():
                if found.setdefault(name, value) != value:
                    raise InputError(
                        f'a file has one value of the parameter "{name}", but profiles have {found[name]!r}, {value!r}',
                        field=place, remedy="rename one of them",
                    )  # fmt: skip
    return found


def _piece(profile: InMotion) -> float | str:
    if isinstance(profile, ForceLaw) and profile.table is None:
        return profile.text
    if isinstance(profile, int | float):
        return float(profile)
    if isinstance(profile, ExpressionProfile):
        return profile.text
    if isinstance(profile, ConstantSpeed):
        return (
            float(profile.angle) if profile.speed == 0.0 else f"{float(profile.angle)!r} + {float(profile.speed)!r} * t"
        )
    raise _inexpressible_profile(profile)


def _inexpressible_profile(profile: TimeProfile | ForceLaw) -> InputError:
    return InputError(
        "a model file cannot express this profile", field="profile", value=type(profile).__name__,
        remedy="give a ConstantSpeed, ExpressionProfile, PiecewiseProfile of these, or TabulatedProfile of its values",
    )  # fmt: skip


def _unlike(components: Sequence[InMotion]) -> InputError:
    return InputError(
        "a model file cannot express a force whose components change at different times",
        field="force", value=", ".join(type(profile).__name__ for profile in components),
        remedy="give both pieces with the same ends, or tables of the same times and interpolation",
    )  # fmt: skip


def _ends(pieces: Sequence[Any]) -> tuple[float, ...]:
    """Return the end times of all pieces but the last [s]."""
    for number, piece in enumerate(pieces):
        if (piece.until is None) != (number == len(pieces) - 1):
            raise InputError(
                "every piece but the last has an end, and the last has none", field=f"pieces.{number}.until",
                value=piece.until, remedy="give the time in s at which the next one takes over; the last goes on",
            )  # fmt: skip
    return tuple(piece.until for piece in pieces[:-1])
