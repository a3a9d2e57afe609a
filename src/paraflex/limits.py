"""The largest of everything that comes from outside, each with the reason why more makes no sense.

What is beyond is refused in one line, before time or memory is spent on it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from paraflex.errors import InputError, ProportionError

# A mechanism written by hand is some kilobytes, one of measured rows some hundred; far more is a wrong file, which only
# takes long to parse [bytes].
FILE_BYTES = 5_000_000
# A quantity in SI units: no machine has one beyond the first, and of those that must be positive the second moment of
# area of a nanotube, 1e-38 m^4, is about the smallest. Products of a few of them are still numbers.
LARGEST, SMALLEST = 1e20, 1e-40
# A whole number, of elements or a seed: beyond it a float does not hold all of them.
WHOLE = 2**53
# A name is typed, printed in tables and made part of names of files, of which most systems take 255 letters.
NAME_LETTERS = 100
# A text other than a name is a sentence or two.
TEXT_LETTERS = 2000
# Parts of a dotted key: the deepest that a file has a meaning for has four.
KEY_PARTS = 32
# Longer expressions are no lengths of links; parsing them would only take time.
EXPRESSION_LETTERS = 200
# Parameters that are given by one another in a row: a chain of more is made by a program, which can put in numbers.
PARAMETER_CHAIN = 100
# Elements of a beam: results converge with ten, and its modes come from a dense matrix of four rows an element.
ELEMENTS = 64
# Finite segments of a beam, each a body: more would only take time.
SEGMENTS = 1000
# The shortest run [s]: in a picosecond nothing of a mechanism has moved, and its fifth power is still a number.
SHORTEST = 1e-12
# Shape functions of a bar: the tenth sine is far above what a motion excites.
SHAPE_FUNCTIONS = 100
# States of a sampled plant, torques under way among them: of so many a matrix takes 200 MB, its eigenvalues minutes.
PLANT_STATES = 5_000
# Samples of a run: an hour at 250 Hz; of fifty coordinates they take a gigabyte.
SAMPLES = 1_000_000
# Instants at which loops are closed along a path, each a millisecond after the one before: of thirty coordinates they
# take a gigabyte and a minute.
INSTANTS = 2_000_000
# Points of a path: a curve of a metre with a point each tenth of a millimetre.
PATH_POINTS = 10_000
# Impulses of an input shaper: each is a copy of the motion with its knots, at which steps end; ZVDD of four modes.
SHAPER_IMPULSES = 256
# Designs of a study: at ten runs a second they take twelve days, and more than their table would fill the memory.
DESIGNS = 10_000_000
# What to do about numbers that cannot be computed with.
OUT_OF_PROPORTION = "look at lengths, masses and stiffnesses: they are in SI units"


def at_most(value: float, limit: float, field: str, problem: str = "too many") -> None:
    """Raise an `InputError` where a number is beyond a limit."""
    if value > limit:
        raise InputError(problem, field=field, value=value, remedy=f"at most {limit:,}".replace(",", " "))


def of_size(value: float, field: str) -> None:
    """Raise an `InputError` unless a number is finite and one that a quantity in SI units can be."""
    if value != value or abs(value) == math.inf:
        raise InputError("not a finite number", field=field, value=value, remedy="give a number")
    if abs(value) > LARGEST:
        raise InputError("beyond all proportion", field=field, value=value, remedy=f"at most {LARGEST:g}, in SI units")


def possible(value: float, field: str, unit: str) -> None:
    """Raise an `InputError` unless the magnitude of a number that is not zero is one that a quantity can have."""
    if not SMALLEST <= abs(value) <= LARGEST:
        remedy = f"give it in {unit}, from {SMALLEST:g} to {LARGEST:g}"
        raise InputError("beyond all proportion", field=field, value=value, remedy=remedy)


@contextmanager
def solvable(what: str) -> Iterator[None]:
    """Name what cannot be computed because a matrix is singular to rounding, or a number beyond what floats hold.

    Also a decorator of functions.

    Raises
    ------
    ProportionError
    """
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            yield
    except (np.linalg.LinAlgError, FloatingPointError, OverflowError, ZeroDivisionError):
        raise ProportionError(
            f"{what} cannot be computed: some numbers of the model are out of all proportion to others",
            remedy=OUT_OF_PROPORTION,
        ) from None
