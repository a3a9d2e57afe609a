"""Prescribed laws as a file gives them: a constant speed, an expression of t, pieces of them, or a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.files.expressions import (
    ExpressionError,
    check_in_time,
    evaluate,
    evaluate_in_time,
    is_constant,
    names_in,
)
from paraflex.files.schema import PieceTable, PrescribedTable
from paraflex.mechanism import AngleLaw, ConstantSpeed, PiecewiseLaw, PrescribedAngle, TabulatedLaw
from paraflex.mechanism.laws import Values

# Instants at which a law is tried when it is read.
_TRIALS = 257


@dataclass(frozen=True)
class ExpressionLaw:
    """An expression of the time t and of parameters, with its exact derivatives.

    Attributes
    ----------
    text : str
    parameters : mapping of str to float
        Those that the text does not name are left out.
    field : str
        Where it stands, for errors.

    Raises
    ------
    InputError
        It is no expression, or names a parameter that is not given.
    """

    text: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    field: str = field(default="angle", compare=False)
    knots: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        try:
            check_in_time(self.text, self.parameters)
        except ExpressionError as error:
            raise InputError(error.problem, field=self.field, value=self.text, remedy=error.remedy) from None
        spoken_of = names_in(self.text)
        used = {name: value for name, value in self.parameters.items() if name in spoken_of}
        object.__setattr__(self, "parameters", used)

    def evaluate(self, t: NDArray[np.float64]) -> Values:
        """Value, rate and acceleration at times t.

        Raises
        ------
        InputError
            One of them is no finite number at some time.
        """
        try:
            jet = evaluate_in_time(self.text, self.parameters, t)
        except ExpressionError as error:
            raise InputError(error.problem, field=self.field, value=self.text, remedy=error.remedy) from None
        return jet.value, jet.rate, jet.acceleration


def read_law(entry: PrescribedTable, parameters: Mapping[str, float], duration: float | None) -> AngleLaw:
    """The law of a [prescribed.NAME] table; tried where it will be used, as far as the study says.

    Raises
    ------
    InputError
        Not exactly one way of saying it, a speed beside anything but a number, pieces that do not meet, an expression
        without finite derivatives, or a table that is none or does not cover the study.
    """
    given = [name for name in ("angle", "displacement", "pieces", "table") if getattr(entry, name) is not None]
    if len(given) > 1:
        raise InputError(
            "a law is given in two ways", field=given[-1], value=", ".join(given), remedy=f"drop all but {given[0]}"
        )
    law = _law(entry, parameters)
    if entry.speed is not None and not isinstance(law, ConstantSpeed):
        raise InputError(
            "a speed can only be added to an angle or displacement that is a number",
            field="speed",
            value=entry.speed,
            remedy="write it into the law",
        )
    # A duration that makes no sense is refused with the study.
    law.evaluate(np.linspace(0.0, duration, _TRIALS) if duration is not None and duration > 0.0 else np.zeros(1))
    return law


def quantities(entry: PrescribedTable) -> set[str]:
    """Which of "angle" and "displacement" a [prescribed.NAME] table speaks of."""
    said: list[PrescribedTable | PieceTable] = [entry, *(entry.pieces or [])]
    return {name for table in said for name in ("angle", "displacement") if getattr(table, name) is not None}


def law_table(law: AngleLaw, quantity: str) -> dict[str, Any]:
    """What a [prescribed.NAME] table says of a law of an "angle" or a "displacement".

    Raises
    ------
    InputError
        A law that a file has no words for.
    """
    match law:
        case ConstantSpeed(angle=angle, speed=speed, knots=()):
            return {key: value for key, value in ((quantity, angle), ("speed", speed)) if value != 0.0}
        case ExpressionLaw(text=text, knots=()):
            return {quantity: text}
        case TabulatedLaw(times=times, values=values, knots=()):
            return {"table": list(zip(times, values, strict=True))}
        case PiecewiseLaw(pieces=pieces, ends=ends):
            last = {quantity: _piece(pieces[-1])}
            before = zip(ends, pieces, strict=False)
            return {"pieces": [*({"until": end, quantity: _piece(piece)} for end, piece in before), last]}
    raise _no_words(law)


def law_parameters(prescribed: Iterable[PrescribedAngle]) -> dict[str, float]:
    """The parameters that laws speak of, each with one value.

    Raises
    ------
    InputError
        One of two values.
    """
    found: dict[str, float] = {}
    for each in prescribed:
        for law in each.law.pieces if isinstance(each.law, PiecewiseLaw) else (each.law,):
            for name, value in law.parameters.items() if isinstance(law, ExpressionLaw) else ():
                if found.setdefault(name, value) != value:
                    raise InputError(
                        f'a file has one value of the parameter "{name}", and laws have {found[name]!r} and {value!r}',
                        field=f"prescribed.{each.name}.law", remedy="call one of them something else",
                    )  # fmt: skip
    return found


def _piece(law: AngleLaw) -> float | str:
    if isinstance(law, ExpressionLaw):
        return law.text
    if isinstance(law, ConstantSpeed):
        return float(law.angle) if law.speed == 0.0 else f"{float(law.angle)!r} + {float(law.speed)!r} * t"
    raise _no_words(law)


def _no_words(law: AngleLaw) -> InputError:
    return InputError(
        "a model file cannot say this law", field="law", value=type(law).__name__,
        remedy="give a ConstantSpeed, an ExpressionLaw, a PiecewiseLaw of these, or a TabulatedLaw of its values",
    )  # fmt: skip


def _law(entry: PrescribedTable, parameters: Mapping[str, float]) -> AngleLaw:
    if entry.table is not None:
        times, values = zip(*entry.table, strict=True) if entry.table else ((), ())
        return TabulatedLaw(times, values)
    if entry.pieces is not None:
        return _pieces(entry.pieces, parameters)
    field = "angle" if entry.displacement is None else "displacement"
    given = entry.angle if entry.displacement is None else entry.displacement
    return _expression(0.0 if given is None else given, parameters, field, entry.speed or 0.0)


def _pieces(pieces: list[PieceTable], parameters: Mapping[str, float]) -> PiecewiseLaw:
    laws, ends = [], []
    for number, piece in enumerate(pieces):
        field = f"pieces.{number}"
        if (piece.angle is None) == (piece.displacement is None):
            raise InputError(
                "a piece needs one law, an angle or a displacement",
                field=field,
                remedy="give its angle, or its displacement where the joint slides",
            )
        if (piece.until is None) != (number == len(pieces) - 1):
            raise InputError(
                "every piece but the last has an end, and the last has none", field=f"{field}.until", value=piece.until,
                remedy="give the time in s at which the next one takes over; the last goes on",
            )  # fmt: skip
        name = "angle" if piece.displacement is None else "displacement"
        given = piece.angle if piece.displacement is None else piece.displacement
        assert given is not None
        laws.append(_expression(given, parameters, f"{field}.{name}"))
        ends += [] if piece.until is None else [piece.until]
    return PiecewiseLaw(tuple(laws), tuple(ends))


def _expression(given: float | str, parameters: Mapping[str, float], field: str, speed: float = 0.0) -> AngleLaw:
    if not isinstance(given, str):
        return ConstantSpeed(given, speed)
    if is_constant(given):
        return ConstantSpeed(evaluate(given, parameters), speed)
    return ExpressionLaw(given, parameters, field)
