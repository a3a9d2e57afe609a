"""Indicators of a model's validity, each with its limit.

Limits were measured by `benchmarks/validity.py`; its tables are in `docs/validity.md`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from paraflex.arrays import Array
from paraflex.integrators import Solution
from paraflex.mechanism import Geometry
from .bending import Bending

Number = TypeVar("Number", float, Array)

# Linear geometry, limits for 5 % of the deviation or deflection. Of 174 tracking runs of the library 133 have a larger
# error, and all of these have a shortening share above this limit; so have 15 of the other 41.
SHORTENING_LIMIT = 0.1
# A steady force P multiplies the deflection of a beam by 1 / (1 - P / P_cr): 5 % at 0.05. The errors of the library's
# runs without a path are up to 1.05 of their largest axial force over P_cr.
AXIAL_LIMIT = 0.05
# If torques drive a mechanism along a path, its deviation has other causes, which shortening indicates. Of the runs
# within 5 % none has an axial force above 0.195.
DRIVEN_AXIAL_LIMIT = 0.2
# A cantilever under a load at its tip, against the elastica: 4 % of the deflection at 0.10 rad, 6 % at 0.15 rad.
SLOPE_LIMIT = 0.12
# Second order, for 1 % of the deflection: `fourth_order` against the elastica, for beams clamped at one end under a
# load or moment at the tip, and hinged at both ends under a load in the middle, with up to 0.95 of the buckling load.
FOURTH_ORDER_LIMIT = 0.01
# Coefficients of squared slopes: of the curvature, and of the stiffening of a beam close to buckling, for the frame on
# the chord (1/8, as of the elastica) and on the tangent at the first end.
_CURVATURE, _CHORD, _TANGENT = 1.0 / 3.0, 1.0 / 8.0, 0.3
# Buckling load of a beam clamped at one end, relative to that of one hinged at both ends.
_CLAMPED = 0.25
# Name of the only indicator of second order.
_SECOND_ORDER = "fourth order"
# Largest mean axial force relative to the buckling load that is taken into account; larger ones count as this.
_ALMOST = 0.99


@dataclass(frozen=True)
class Indicator:
    """An indicator of a model's validity.

    Attributes
    ----------
    name : str
        Name: "shortening", "axial force", "slope" or "fourth order".
    value, limit : float
        Value, and limit above which the model is not reliable.
    body : str
        Body with the largest value.
    time : float
        Time of the largest value [s].
    text : str
        Description with the limit.
    remedy : str
        Remedy for a value above the limit.
    """

    name: str
    value: float
    limit: float
    body: str
    time: float
    text: str
    remedy: str

    @property
    def geometry(self) -> str:
        """Geometry of the body; bars of assumed modes and modal bodies are linear in second-order mechanisms, too."""
        return Geometry.SECOND_ORDER.value if self.name == _SECOND_ORDER else Geometry.LINEAR.value

    @property
    def ratio(self) -> float:
        """Value over limit."""
        return self.value / self.limit


class Following(NamedTuple):
    """Additional data of a run along a path.

    Attributes
    ----------
    deviation : float
        Root mean square distance of the end-effector from the path over the run [m].
    condition : float
        Largest condition number of the actuation matrix.
    """

    deviation: float
    condition: float


def of_linear(bodies: Sequence[Bending], run: Solution, following: Following | None) -> list[Indicator]:
    """Return the indicators of bodies with linear geometry."""
    if not bodies:
        return []
    out = [_slope(bodies, run)]
    # Modal bodies have no axial force or shortening.
    beams = [body for body in bodies if not np.isnan(body.axial).any()]
    if beams:
        out.append(_axial_force(beams, run, AXIAL_LIMIT if following is None else DRIVEN_AXIAL_LIMIT))
    if beams and following is not None and following.deviation > 0.0:
        out.append(_shortening(beams, run, following))
    return out


def _axial_force(bodies: Sequence[Bending], run: Solution, limit: float) -> Indicator:
    body, k = _largest(bodies, [np.abs(body.axial) for body in bodies])
    value = float(abs(body.axial[k]))
    text = f"{body.name}'s axial force reaches {value:.2g} of its buckling load at {run.instant(k)}"
    return _indicator("axial force", value, limit, body, run.t[k], text)


def _slope(bodies: Sequence[Bending], run: Solution) -> Indicator:
    body, k = _largest(bodies, [body.slope for body in bodies])
    value = float(body.slope[k])
    text = f"{body.name} bends to a slope of {value:.2g} rad at {run.instant(k)}"
    return _indicator("slope", value, SLOPE_LIMIT, body, run.t[k], text)


def _shortening(bodies: Sequence[Bending], run: Solution, following: Following) -> Indicator:
    body, k = _largest(bodies, [body.shortening for body in bodies])
    shortening = float(body.shortening[k])
    value = shortening * following.condition / following.deviation
    text = (
        f"bending shortens {body.name} by {1e3 * shortening:.2g} mm at {run.instant(k)}, which is left out; with the "
        f"actuation's condition number of {following.condition:.2g} that is {value:.2g} of the tracking error"
    )
    return _indicator("shortening", value, SHORTENING_LIMIT, body, run.t[k], text)


def of_second_order(bodies: Sequence[Bending], run: Solution) -> list[Indicator]:
    """Return the indicators of beams with second-order geometry."""
    if not bodies:
        return []
    terms = [fourth_order(body.slope, _steady(body), tangent=body.tangent) for body in bodies]
    body, k = _largest(bodies, terms)
    value = float(fourth_order(body.slope[k], _steady(body), tangent=body.tangent))
    text = (
        f"{body.name} bends to a slope of {body.slope[k]:.2g} rad at {run.instant(k)}; terms of fourth order, which "
        f"are left out, are about {100.0 * value:.2g} % of its deflection"
    )
    return [_indicator(_SECOND_ORDER, value, FOURTH_ORDER_LIMIT, body, run.t[k], text, percent=True)]


def fourth_order(slope: Number, compression: float, *, tangent: bool) -> Number:
    """Return the neglected terms of second order as a fraction of the deflection: slope^2 (1/3 + c / (1 - P/P_cr)).

    Parameters
    ----------
    slope : float or (k,) array
        Largest slope along the beam, in its frame [rad].
    compression : float
        Steady compression relative to the buckling load of the beam hinged at both ends.
    tangent : bool
        Whether the frame is on the tangent at the first end (cantilever): c is then 0.3, otherwise 1/8.
    """
    towards = 1.0 - min(max(compression, 0.0), _ALMOST)
    return slope**2 * (_CURVATURE + (_TANGENT if tangent else _CHORD) / towards)


def _steady(body: Bending) -> float:
    """Return the mean compression relative to the buckling load of the body hinged at both ends."""
    return -float(np.mean(body.axial)) * (_CLAMPED if body.tangent else 1.0)


def _largest(bodies: Sequence[Bending], values: Sequence[Array]) -> tuple[Bending, int]:
    """Return the body whose values (k,) are largest, and the sample at which they are."""
    one = int(np.argmax([np.max(each) for each in values]))
    return bodies[one], int(np.argmax(values[one]))


def _indicator(
    name: str, value: float, limit: float, body: Bending, time: float, text: str, *, percent: bool = False
) -> Indicator:
    bound = f"{100.0 * limit:g} %" if percent else f"{limit:g}"
    return Indicator(name, value, limit, body.name, float(time), f"{text} (limit {bound})", _remedy(body))


def _remedy(body: Bending) -> str:
    if body.given:
        return f'describe {body.name} as type = "beam" and use second-order geometry'
    if body.linear:
        return "use second-order geometry (--geometry second-order)"
    if body.tangent:
        return 'use reference = "pinned"'
    return f"give {body.name} more frames (frames = {2 * body.frames}), or compare with exact beams (paraflex verify)"
