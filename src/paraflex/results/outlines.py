"""Stations of bodies for drawings, their motion, and their positions on undeformed bodies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from paraflex.arrays import Array, Complex, Indices, Numbers
from paraflex.dynamics import BodyCoordinates, System, across_chord
from paraflex.fem import slope_square_integrals
from paraflex.mechanism import AssumedModesBeam, Body, FlexibleBeam, Mechanism, ModalBody, RigidBody

# Number of pieces of a drawn beam, and the fewest between two of its points.
_BEAM_PIECES, _FEWEST_PIECES = 16, 4
# Points closer than this fraction of a body's size are drawn as one.
_SAME = 1e-9
# Fewest stations that define a deflection: two are always on their chord.
_LEAST_ON_LINE = 3
# Pieces shorter than this fraction of a body's size have no defined direction.
_SHORT_PIECE = 1e-6


@dataclass(frozen=True)
class Outline:
    """Stations of a body, in order along the body.

    Attributes
    ----------
    body : str
        Name of the body.
    places : (s, 2) array
        Positions of the stations in the undeformed body, in the body frame [m].
    points : mapping of str to int
        Index of the station of each named point.
    """

    body: str
    places: Array
    points: Mapping[str, int]

    @property
    def size(self) -> float:
        """Largest distance of a station from the first [m]."""
        return float(np.max(np.linalg.norm(self.places - self.places[0], axis=1)))


def outline(body: Body) -> Outline:
    """Return the stations of a body, which depend on its length and points but not on its mesh or segments.

    A beam or bar has about 16 pieces along its centre line, with the named points among the stations. The stations of a
    rigid body are its points: in order if they are on a line, else around their convex hull, closed, followed by the
    points inside. With fewer than two distinct points the centre of mass is added. The stations of a modal body are its
    points.
    """
    if isinstance(body, FlexibleBeam | AssumedModesBeam):
        x = _along(body.length, body.points)
        return Outline(
            body.name,
            np.column_stack([x, np.zeros_like(x)]),
            {name: int(np.argmin(np.abs(x - place))) for name, place in body.points.items()},
        )
    if isinstance(body, ModalBody):
        places = [point.position for point in body.points.values()] or [(0.0, 0.0)]
        return Outline(body.name, np.array(places, dtype=float), {name: i for i, name in enumerate(body.points)})
    named = np.array([*body.points.values()], dtype=float).reshape(-1, 2)
    distinct = _distinct(named)
    if len(distinct) < 2:
        distinct = _distinct(np.vstack([named, body.centre_of_mass]))
    order = figure_order(distinct)
    places = distinct[order]
    return Outline(
        body.name,
        places,
        {name: int(np.argmin(np.linalg.norm(places - place, axis=1))) for name, place in body.points.items()},
    )


def outlines(mechanism: Mechanism) -> list[Outline]:
    """Return the stations of all bodies of a mechanism, in its order."""
    return [outline(body) for body in mechanism.bodies]


def chord_deflections(mechanism: Mechanism, shape: Array) -> Array:
    """Return the largest deflection of each body from its chord (k, bodies) [m], from shapes (k, stations, 2).

    The maximum is over the stations: see `across_chord`. It is NaN for a flexible body with fewer than three stations,
    such as a modal body with two points.
    """
    found, first = [], 0
    for body, one in zip(mechanism.bodies, outlines(mechanism), strict=True):
        last = first + len(one.places)
        if isinstance(body, RigidBody) or not body.flexible:
            found.append(np.zeros(len(shape)))
        elif len(one.places) < _LEAST_ON_LINE:
            found.append(np.full(len(shape), np.nan))
        else:
            found.append(np.max(np.abs(across_chord(shape[:, first:last], one.places)), axis=1))
        first = last
    return np.stack(found, axis=1)


def deflections(system: System, q: Array, name: str = "") -> Array:
    """Return the signed deflections of the stations of all flexible bodies, or of one, from their chords (k, s) [m].

    They are real or complex like q; see `across_chord` for signs, `chord_deflections` for NaN.
    """
    parts = [np.zeros((len(q), 0))]
    for body, one in zip(system.described.bodies, outlines(system.described), strict=True):
        if name in ("", body.name) and system.body(body.name).nf:
            whole = system.parts(one.body) == (one.body,)
            bent = across_chord((_in_frame if whole else outline_motion)(system, one, q), one.places)
            parts.append(bent if len(one.places) >= _LEAST_ON_LINE else np.full_like(bent, np.nan))
    return np.concatenate(parts, axis=1)


def outline_motion(system: System, drawn: Outline, q: Array) -> Array:
    """Return the positions (k, s, 2) [m] of the stations of a body for coordinates q (k, n), from its shape functions.

    Second-order geometry includes the shortening of the model: s(x) = x + N u - 1/2 e_x int_0^x (N2' u)^2 dx.
    """
    parts = system.parts(drawn.body)
    if parts != (drawn.body,):
        return _of_parts(system, parts, drawn, q)
    body = system.body(drawn.body)
    return turned(q[:, body.position], q[:, body.angle], _in_frame(system, drawn, q))


def _in_frame(system: System, drawn: Outline, q: Array) -> Array:
    """Return the positions of `outline_motion` in the frame of a body, which is not divided into parts."""
    body = system.body(drawn.body)
    # Equal beams share integrals and with them what the same stations need.
    key = id(body.integrals), drawn.places.tobytes()
    u, rows = q[:, body.flexible], system.once(("rows", *key), lambda: _rows(system, body, drawn))
    local = drawn.places + (u @ rows.reshape(2 * len(rows), body.nf).T).reshape(len(u), *rows.shape[:2])
    if body.points is not None and body.mesh is not None:
        mesh, x = body.mesh, drawn.places[:, 0]
        squares = system.once(("squares", *key), lambda: slope_square_integrals(mesh, body.integrals.D, x))
        local[:, :, 0] -= 0.5 * squares(u)
    return local


def _of_parts(system: System, names: Sequence[str], drawn: Outline, q: Array) -> Array:
    """Return the positions (k, s, 2) of the stations of a beam divided into parts, each on its part."""
    x, starts = drawn.places[:, 0], [system.carrier(name)[1] for name in names]
    owners = np.searchsorted(starts, x + _SAME * drawn.size, side="right") - 1
    out = np.empty((q.shape[0], x.size, 2), dtype=q.dtype)
    for i, (name, start) in enumerate(zip(names, starts, strict=True)):
        out[:, owners == i] = outline_motion(system, Outline(name, drawn.places[owners == i] - [start, 0.0], {}), q)
    return out


@dataclass(frozen=True)
class Hold:
    """Point of a body at a joint: positions in the undeformed body and in the ground frame, (k,) as x + i y [m]."""

    rest: Complex
    place: Complex


def stiff_shape(drawn: Outline, holds: Sequence[Hold], turn: Array) -> Array:
    """Return the stations (k, s, 2) of the undeformed body placed between the points that hold it [m].

    Between two holds, the undeformed body is rotated and scaled to match both; beyond them it is only rotated. Three or
    more holds in line give a natural cubic spline, without a kink at a joint in mid-span; drawings use the spline if
    the rigid mechanism does not close. A body with holds that are not in line is fitted to them by a similarity, and
    the residuals are distributed by distance. A body with a single hold has the angle of the material there.

    Parameters
    ----------
    drawn : Outline
        Stations of the body.
    holds : sequence of Hold
        One or more holds; a body without joints is held by its frame.
    turn : (k,) array
        Angle of the material at the first hold [rad].
    """
    z = drawn.places[:, 0] + 1j * drawn.places[:, 1]
    rest = np.stack([hold.rest for hold in holds], axis=1)
    place = np.stack([hold.place for hold in holds], axis=1)
    if len(holds) == 1:
        out = place + np.exp(1j * turn)[:, None] * (z - rest)
    else:
        axis, short = _axis(np.append(z, rest[0]), drawn.size), _SHORT_PIECE * drawn.size
        if len(holds) == 2:
            out = _between(z, rest, place, turn, 1.0 if axis is None else axis, short)
        else:
            out = _fitted(z, rest, place) if axis is None else _spline(z, rest, place, axis, short)
    return np.stack([out.real, out.imag], axis=-1)


def _between(z: Complex, rest: Complex, place: Complex, turn: Array, axis: complex, short: float) -> Complex:
    """Map places by the similarity defined by two holds; beyond them a free end keeps its length."""
    rest, place = _in_order(rest, place, axis)
    gap, step = np.diff(rest, axis=1)[:, 0], np.diff(place, axis=1)[:, 0]
    long = np.abs(gap) > short
    ratio = np.where(long, step / np.where(long, gap, 1.0), np.exp(1j * turn))[:, None]
    along, knots = (z * np.conj(axis)).real[None], (rest * np.conj(axis)).real
    after, before = along > knots[:, 1:], along < knots[:, :1]
    scale = np.where(after | before, ratio / np.abs(ratio), ratio)
    return np.where(after, place[:, 1:] + scale * (z - rest[:, 1:]), place[:, :1] + scale * (z - rest[:, :1]))


def _spline(z: Complex, rest: Complex, place: Complex, axis: complex, short: float) -> Complex:
    """Map places by the natural cubic spline through holds in line, with straight ends of unchanged length beyond them.

    The second derivatives M at the knots follow from the chord slopes s and intervals h: h_i M_i + 2 (h_i + h_i+1)
    M_i+1 + h_i+1 M_i+2 = 6 (s_i+1 - s_i).
    """
    rest, place = _in_order(rest, place, axis)
    x, knots = (z * np.conj(axis)).real, (rest * np.conj(axis)).real
    h = np.maximum(np.diff(knots, axis=1), short)
    slopes = np.diff(place, axis=1) / h
    inner = knots.shape[1] - 2
    rows = np.zeros((len(knots), inner, inner))
    for i in range(inner):
        rows[:, i, i] = 2.0 * (h[:, i] + h[:, i + 1])
        if i + 1 < inner:
            rows[:, i, i + 1] = rows[:, i + 1, i] = h[:, i + 1]
    bends = np.zeros_like(place)
    bends[:, 1:-1] = np.linalg.solve(rows, 6.0 * np.diff(slopes, axis=1)[..., None])[..., 0]
    piece = np.clip(np.sum(x[None, :, None] >= knots[:, None, :], axis=2) - 1, 0, inner)

    def of(values: Numbers, shift: int = 0) -> Numbers:
        return np.take_along_axis(values, piece + shift, axis=1)

    width, u, w = of(h), x - of(knots), of(knots, 1) - x
    out = (of(bends) * w**3 + of(bends, 1) * u**3) / (6.0 * width)
    out += (of(place) / width - of(bends) * width / 6.0) * w + (of(place, 1) / width - of(bends, 1) * width / 6.0) * u
    for end, slope in (
        (0, slopes[:, 0] - h[:, 0] * bends[:, 1] / 6.0),
        (-1, slopes[:, -1] + h[:, -1] * bends[:, -2] / 6.0),
    ):
        beyond = (x < knots[:, :1]) if end == 0 else (x > knots[:, -1:])
        straight = place[:, [end]] + (slope / np.abs(slope))[:, None] * (x - knots[:, [end]])
        out = np.where(beyond, straight, out)
    return out


def _in_order(rest: Complex, place: Complex, axis: complex) -> tuple[Complex, Complex]:
    """Sort holds along an axis."""
    order = np.argsort((rest * np.conj(axis)).real, axis=1)
    return np.take_along_axis(rest, order, axis=1), np.take_along_axis(place, order, axis=1)


def _fitted(z: Complex, rest: Complex, place: Complex) -> Complex:
    """Map places by the least-squares similarity of all holds, plus residuals weighted by inverse squared distance."""
    middle, centre = rest.mean(axis=1, keepdims=True), place.mean(axis=1, keepdims=True)
    arm = rest - middle
    ratio = np.sum(np.conj(arm) * (place - centre), axis=1, keepdims=True) / np.sum(
        np.abs(arm) ** 2, axis=1, keepdims=True
    )
    missed = place - centre - ratio * arm
    distance = np.abs(z[:, None] - rest[:, None, :]) ** 2
    nearest = np.min(distance, axis=2, keepdims=True)
    weights = np.where(nearest > 0.0, nearest / np.where(distance > 0.0, distance, 1.0), distance == 0.0)
    weights = weights / weights.sum(axis=2, keepdims=True)
    return centre + ratio * (z - middle) + np.einsum("ksh,kh->ks", weights, missed)


def in_line(drawn: Outline) -> bool:
    """Check whether the stations of a body are on a line."""
    return _axis(drawn.places[:, 0] + 1j * drawn.places[:, 1], drawn.size) is not None


def _axis(z: Complex, size: float) -> complex | None:
    """Return the direction of the line through places, None if they are not on a line."""
    far = z[np.argmax(np.abs(z - z[0]))] - z[0]
    if abs(far) == 0.0:
        return 1.0
    direction = far / abs(far)
    across = ((z - z[0]) * np.conj(direction)).imag
    return complex(direction) if np.max(np.abs(across)) <= _SAME * max(size, abs(far)) else None


def turned(position: Array, angle: Array, local: Array) -> Array:
    """Transform places `local` (k, s, 2) from frames at positions (k, 2) with angles (k,) to the ground frame."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = local[..., 0], local[..., 1]
    return position[:, None] + np.stack([c * x - s * y, s * x + c * y], axis=-1)


def _rows(system: System, body: BodyCoordinates, drawn: Outline) -> Array:
    """Return the displacements of the stations per unit flexible coordinate (s, 2, nf)."""
    described = system.mechanism.body(drawn.body)
    if isinstance(described, FlexibleBeam) and body.mesh is not None:
        return body.mesh.shapes_at(drawn.places[:, 0])[0] @ body.integrals.D
    if isinstance(described, AssumedModesBeam):
        return np.stack([described.shapes.shape_at(x)[0] for x in drawn.places[:, 0]]) @ body.integrals.D
    if isinstance(described, RigidBody) or not body.shape.points:
        return np.zeros((len(drawn.places), 2, body.nf))
    return np.stack([point.N for point in body.shape.points.values()]) @ body.integrals.D


def _along(length: float, points: Mapping[str, float]) -> Array:
    """Return the abscissae of the stations along a bar, including its ends and points."""
    # Places may have a complex step: decisions use their real parts.
    knots = [0.0]
    for x in sorted([*points.values(), length], key=np.real):
        if np.real(x - knots[-1]) > _SAME * np.real(length):
            knots.append(min(x, length, key=np.real))
    knots[-1] = length
    pieces = [max(_FEWEST_PIECES, round(float(np.real(_BEAM_PIECES * (b - a) / length)))) for a, b in pairwise(knots)]
    spans = [np.linspace(a, b, number + 1)[1:] for (a, b), number in zip(pairwise(knots), pieces, strict=True)]
    return np.concatenate([[0.0], *spans])


def _distinct(places: Array) -> Array:
    kept: list[Array] = []
    size = float(np.max(np.ptp(places, axis=0), initial=0.0))
    for place in places:
        if all(np.linalg.norm(place - other) > _SAME * size for other in kept):
            kept.append(place)
    return np.array(kept).reshape(-1, 2)


def figure_order(places: Array) -> Indices:
    """Return the order of places for drawing: along their line, or around their closed hull, then those inside."""
    z = places[:, 0] + 1j * places[:, 1]
    if len(z) < 3:
        return np.arange(len(z))
    axis = _axis(z, 0.0)
    if axis is not None:
        return np.argsort((z * np.conj(axis)).real)
    hull = _hull(places)
    inside = [i for i in range(len(z)) if i not in hull]
    return np.array([*hull, hull[0], *inside])


def _hull(places: Array) -> list[int]:
    """Return the indices of places on the convex hull, corners and sides, anticlockwise."""
    order = np.lexsort((places[:, 1], places[:, 0])).tolist()
    size = float(np.max(np.ptp(places, axis=0)))

    def side(listed: list[int]) -> list[int]:
        kept: list[int] = []
        for i in listed:
            while len(kept) > 1 and _turn(places, kept[-2], kept[-1], i) < -_SAME * size**2:
                kept.pop()
            kept.append(i)
        return kept[:-1]

    return list(dict.fromkeys([*side(order), *side(order[::-1])]))


def _turn(places: Array, a: int, b: int, c: int) -> float:
    """Return twice the area of a triangle, positive if anticlockwise."""
    (ux, uy), (vx, vy) = places[b] - places[a], places[c] - places[a]
    return float(ux * vy - uy * vx)
