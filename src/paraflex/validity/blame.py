"""Which number of a model is most likely to blame for a run that fails: a slip of units, say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from paraflex.errors import IntegrationError, SliderOffBeamError
from paraflex.findings import Finding
from paraflex.integrators import Solution
from paraflex.mechanism import Mechanism
from paraflex.validity.numbers import doubtful_numbers

# Findings about numbers that make motions impossible; others are doubtful, and no reason for a run to fail.
_CODES = ("modulus", "density", "material", "mass", "beam-thin", "beam-thick", "section-turned", "size", "angle")


def to_blame(mechanism: Mechanism, text: str = "") -> str:
    """The doubtful number that an error is most likely because of; empty for none.

    Parameters
    ----------
    mechanism : Mechanism
        As the user described it.
    text : str
        Of the error: numbers of a body that it names come first.
    """
    found = [one for one in doubtful_numbers(mechanism) if one.code in _CODES]
    return most_likely(found, [body.name for body in mechanism.bodies if f" {body.name} " in f" {text} "])


def most_likely(found: Sequence[Finding], bodies: Sequence[str] = ()) -> str:
    """The first of the numbers found to be doubtful, those of the named bodies before others; empty for none."""
    of_bodies = [one for one in found if any(f"{one.place}.".startswith(f"body.{name}.") for name in bodies)]
    for one in [*of_bodies, *found]:
        return f"most likely because of {one.place}: {one.text}"
    return ""


def with_blame(error: IntegrationError, mechanism: Mechanism) -> IntegrationError:
    """The error of a failed run, its remedy the number most likely to blame, where a number is doubtful."""
    blamed = "" if isinstance(error, SliderOffBeamError) else to_blame(mechanism, error.cause)
    if blamed:
        error.remedy = blamed
        if isinstance(error.partial, Solution):
            error.partial = replace(error.partial, message=str(error))
    return error
