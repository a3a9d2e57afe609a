"""Mesh of a straight beam: every named point is a node, and each span between nodes is divided into elements."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from paraflex.arrays import Array, Indices
from paraflex.errors import InputError
from paraflex.limits import ELEMENTS, at_most
from .element import (
    AXIAL,
    COORDINATES_PER_NODE,
    CURVATURE,
    SLOPE,
    TRANSVERSE,
    axial_shape,
    transverse_powers,
    transverse_shape,
)

# Two points closer than this fraction of the beam are one node: a shorter element is an input error.
COINCIDENT_POINTS = 1e-9
# Shapes at more points are not kept.
_MANY_POINTS = 300


@dataclass(frozen=True)
class BeamMesh:
    """Mesh of a beam along the x axis of its body frame, with the first node at the origin.

    Attributes
    ----------
    nodes : (n + 1,) array
        Positions of the nodes [m], strictly increasing from 0 to the length.
    spans : (n,) array of int
        Index of the span of each element; spans lie between neighbouring named points and the ends.
    points : mapping
        Node index of each named point.
    separate : tuple of int
        Nodes at which the curvature may jump, as at a lumped moment of inertia. Such a node between two elements has
        one curvature coordinate on either side; the curvature of such a last node is free.
    """

    nodes: Array
    spans: Indices
    points: Mapping[str, int]
    separate: tuple[int, ...] = ()

    @property
    def n_elements(self) -> int:
        """Number of elements."""
        return self.nodes.size - 1

    @property
    def n_spans(self) -> int:
        """Number of spans between neighbouring named points and the ends."""
        return int(self.spans[-1]) + 1

    @property
    def knots(self) -> Array:
        """Positions of the ends of the spans (n_spans + 1,) [m]."""
        return self.nodes[np.searchsorted(self.spans, np.arange(self.n_spans + 1))]

    @property
    def n_nodal(self) -> int:
        """Number of nodal coordinates before any reference condition.

        Each node has four, and each node between elements with separate curvatures one more.
        """
        return COORDINATES_PER_NODE * self.nodes.size + len(self._split)

    @property
    def n_flexible(self) -> int:
        """Number of flexible coordinates under a reference condition: 4 per element and one per separate curvature."""
        return self.n_nodal - (3 if self.n_elements in self.separate else 4)

    @property
    def _split(self) -> list[int]:
        return [node for node in self.separate if 0 < node < self.n_elements]

    @property
    def length(self) -> float:
        """Length of the beam [m]."""
        return float(self.nodes[-1])

    def column(self, node: int, coordinate: int) -> int:
        """Return the index of a nodal coordinate; negative nodes count from the end."""
        return COORDINATES_PER_NODE * (node % self.nodes.size) + coordinate

    def scatter(self, element: int, rows: Array) -> Array:
        """Expand rows per element coordinate (n, 8) to nodal coordinates (n, n_nodal): Boolean matrix B of Eq. 8."""
        wide = np.zeros((rows.shape[0], self.n_nodal), dtype=rows.dtype)
        start = COORDINATES_PER_NODE * element
        columns = np.arange(start, start + 2 * COORDINATES_PER_NODE)
        if element in self._split:
            # The node's regular curvature belongs to the preceding element, the additional one to this element.
            columns[CURVATURE] = COORDINATES_PER_NODE * self.nodes.size + self._split.index(element)
        wide[:, columns] = rows
        return wide

    def axial_rows(self, element: int, x: Array, derivative: int = 0) -> Array:
        """Return the axial displacement per nodal coordinate, or a derivative, at x (k,) from the first node."""
        return self.scatter(element, axial_shape(x, self.nodes[element + 1] - self.nodes[element], derivative))

    def transverse_rows(self, element: int, x: Array, derivative: int = 0) -> Array:
        """Return the transverse displacement per nodal coordinate, or a derivative: see `axial_rows`."""
        return self.scatter(element, transverse_shape(x, self.nodes[element + 1] - self.nodes[element], derivative))

    def axial_at(self, fractions: Sequence[float], derivative: int = 0) -> Array:
        """Return the axial displacement per nodal coordinate, or a derivative, at fractions of every element.

        Parameters
        ----------
        fractions : sequence of float
            Positions as fractions of the length of each element.
        derivative : int
            Order of the derivative: see `element.axial_shape`.

        Returns
        -------
        (elements, places, n_nodal) array
            Rows, shared by equal meshes and read-only.
        """
        return _rows_at(*self._key, tuple(fractions), derivative, True)

    def transverse_at(self, fractions: Sequence[float], derivative: int = 0) -> Array:
        """Return the transverse displacement per nodal coordinate, or a derivative: see `axial_at`."""
        return _rows_at(*self._key, tuple(fractions), derivative, False)

    def transverse_powers(self) -> Array:
        """Return the transverse displacement per nodal coordinate: (elements, 6, n_nodal).

        Entries are coefficients of ascending powers of the distance from the element's first node; the array is shared
        by equal meshes and read-only.
        """
        return _powers(*self._key)

    def rows_of(self, coordinate: int) -> Indices:
        """Return the indices of one of the four coordinates at every node."""
        return np.arange(coordinate, COORDINATES_PER_NODE * self.nodes.size, COORDINATES_PER_NODE)

    def with_separate_curvature(self, nodes: Iterable[int]) -> "BeamMesh":
        """Return the mesh with separate curvatures at the given nodes; that of the last node, if given, is free."""
        return replace(self, separate=tuple(sorted(set(nodes))))

    def shape_at(self, x: float) -> tuple[Array, Array]:
        """Return the shape matrix N (2, n_nodal) and the slope row N2' (n_nodal,) of the point at x [m]."""
        N, slope = self.shapes_at(np.array([x]))
        return N[0], slope[0]

    def shapes_at(self, x: Array) -> tuple[Array, Array]:
        """Return shape matrices (k, 2, n_nodal) and slope rows (k, n_nodal) of the points at x (k,) [m].

        Arrays of not too many points are shared by equal meshes and read-only.
        """
        return self._shapes(x) if x.size > _MANY_POINTS else _shapes_at(*self._key, tuple(x.tolist()))

    @property
    def _key(self) -> tuple[tuple[float, ...], tuple[int, ...]]:
        return tuple(self.nodes.tolist()), self.separate

    def _shapes(self, x: Array) -> tuple[Array, Array]:
        elements = np.clip(np.searchsorted(self.nodes, x, side="right") - 1, 0, self.n_elements - 1)
        kind = np.result_type(x, self.nodes)
        N, slope = np.zeros((x.size, 2, self.n_nodal), kind), np.zeros((x.size, self.n_nodal), kind)
        for element in range(self.n_elements):
            own = elements == element
            if not own.any():
                continue
            local = x[own] - self.nodes[element]
            N[own, 0], N[own, 1] = self.axial_rows(element, local), self.transverse_rows(element, local)
            slope[own] = self.transverse_rows(element, local, derivative=1)
        return N, slope

    def shape_at_node(self, node: int) -> tuple[Array, Array]:
        """Return `shape_at` of a node: unit rows, because displacements and slope are nodal coordinates."""
        rows = np.zeros((3, self.n_nodal))
        rows[[0, 1, 2], [self.column(node, AXIAL), self.column(node, TRANSVERSE), self.slope_column(node)]] = 1.0
        return rows[:2], rows[2]

    def slope_column(self, node: int) -> int:
        """Return the index of a node's slope."""
        return self.column(node, SLOPE)


@lru_cache(maxsize=256)
def _rows_at(
    nodes: tuple[float, ...], separate: tuple[int, ...], fractions: tuple[float, ...], derivative: int, axial: bool
) -> Array:
    mesh = _mesh_at(nodes, separate)
    lengths = np.diff(mesh.nodes)[:, None]
    shape = (axial_shape if axial else transverse_shape)(lengths * np.array(fractions), lengths, derivative)
    return _shared(np.array([mesh.scatter(e, each) for e, each in enumerate(shape)]))


@lru_cache(maxsize=256)
def _shapes_at(nodes: tuple[float, ...], separate: tuple[int, ...], x: tuple[float, ...]) -> tuple[Array, Array]:
    N, slope = _mesh_at(nodes, separate)._shapes(np.array(x))
    return _shared(N), _shared(slope)


@lru_cache(maxsize=256)
def _powers(nodes: tuple[float, ...], separate: tuple[int, ...]) -> Array:
    mesh = _mesh_at(nodes, separate)
    return _shared(np.array([mesh.scatter(e, transverse_powers(h)) for e, h in enumerate(np.diff(mesh.nodes))]))


def _mesh_at(nodes: tuple[float, ...], separate: tuple[int, ...]) -> BeamMesh:
    return BeamMesh(np.array(nodes), np.arange(len(nodes) - 1), {}, separate)


def _shared(array: Array) -> Array:
    array.setflags(write=False)
    return array


def mesh_beam(length: float, points: Mapping[str, float], elements: int | Sequence[int] = 1) -> BeamMesh:
    """Mesh a beam so that each named point is a node.

    Parameters
    ----------
    length : float
        Length of the beam [m].
    points : mapping
        Position of each named point along the beam [m]; the two ends are always nodes.
    elements : int or sequence of int
        Number of elements per span: one for all spans, by default 1, or one per span from the first end on.

    Returns
    -------
    BeamMesh
        Mesh of the beam, without separate curvatures; shared by equal beams.

    Raises
    ------
    InputError
        The length is not positive, a point lies off the beam, the number of element counts is wrong, a span has
        less than one element, or the beam has too many.
    """
    counts = elements if isinstance(elements, int) else tuple(elements)
    return _mesh(length, tuple(points.items()), counts)


@lru_cache(maxsize=256, typed=True)
def _mesh(length: float, named: tuple[tuple[str, float], ...], elements: int | tuple[int, ...]) -> BeamMesh:
    points = dict(named)
    if not (np.isfinite(length) and length > 0.0):
        raise InputError("a beam needs a positive length", field="length", value=length, remedy="give it in metres")
    gap = COINCIDENT_POINTS * length
    for name, x in points.items():
        if not -gap <= x <= length + gap:
            raise InputError(
                "the point lies beyond the beam's end",
                field=f"points.{name}",
                value=x,
                remedy=f"choose it between 0 and the length {length:g} m",
            )
    knots = [0.0]
    for x in sorted([*points.values(), length]):
        if x - knots[-1] > gap:
            knots.append(min(x, length))
    knots[-1] = length
    counts = _per_span(elements, len(knots) - 1)
    pieces = [np.linspace(a, b, n + 1)[1:] for a, b, n in zip(knots, knots[1:], counts, strict=False)]
    nodes = np.concatenate([[0.0], *pieces])
    return BeamMesh(
        nodes=_shared(nodes),
        spans=np.repeat(np.arange(len(counts)), counts),
        points={name: int(np.argmin(np.abs(nodes - x))) for name, x in points.items()},
    )


def _per_span(elements: int | Sequence[int], n_spans: int) -> list[int]:
    counts = [elements] * n_spans if isinstance(elements, int) else list(elements)
    if len(counts) != n_spans:
        raise InputError(
            f"the beam has {n_spans} span(s) between its points and ends",
            field="elements",
            value=counts,
            remedy="give one number for all spans or one number per span",
        )
    for count in counts:
        if count < 1:
            raise InputError("a span needs at least one element", field="elements", value=count, remedy="use 1 or more")
    at_most(sum(counts), ELEMENTS, "elements", "too many elements of a beam")
    return counts
