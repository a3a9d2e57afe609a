"""Search for the value of a model that most likely made a run fail, for example in a wrong unit."""

from collections.abc import Sequence
from dataclasses import replace

from paraflex.errors import IntegrationError, SliderOffBeamError
from paraflex.findings import Finding
from paraflex.integrators import Solution
from paraflex.mechanism import Mechanism
from .numbers import implausible_numbers

# Codes of findings about numbers that make motions impossible; other doubtful numbers do not make a run fail.
_CODES = ("modulus", "density", "material", "mass", "beam-thin", "beam-thick", "section-turned", "size", "angle")


def likely_cause(mechanism: Mechanism, text: str = "") -> str:
    """Return the doubtful number that most likely caused an error; empty for none.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism as described by the user.
    text : str
        Text of the error: numbers of the bodies it names come first.
    """
    found = [one for one in implausible_numbers(mechanism) if one.code in _CODES]
    return cause_among(found, [body.name for body in mechanism.bodies if f" {body.name} " in f" {text} "])


def cause_among(found: Sequence[Finding], bodies: Sequence[str] = ()) -> str:
    """Return the first of the doubtful numbers, those of the named bodies before others; empty for none."""
    of_bodies = [one for one in found if any(f"{one.place}.".startswith(f"body.{name}.") for name in bodies)]
    for one in [*of_bodies, *found]:
        return f"most likely because of {one.place}: {one.text}"
    return ""


def with_likely_cause(error: IntegrationError, mechanism: Mechanism) -> IntegrationError:
    """Return the error of a failed run, with the most likely doubtful number, if any, as its remedy."""
    blamed = "" if isinstance(error, SliderOffBeamError) else likely_cause(mechanism, error.cause)
    if blamed:
        error.remedy = blamed
        if isinstance(error.partial, Solution):
            error.partial = replace(error.partial, message=str(error))
    return error
