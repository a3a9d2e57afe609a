"""Catalogue of all figures by kind of results: those with charts, and drawings by Matplotlib.

A figure with charts is a function of `paraflex.figures`. A drawing is a function in this folder and an entry here; its
kinds of results name it.
"""

from collections.abc import Mapping

from paraflex.figures.catalogue import figures_of_kind
from paraflex.figures.entry import Figure
from paraflex.folders.kinds import RESULT_KINDS, ResultKind

_DRAWINGS: Mapping[str, Figure] = {
    one.name: one
    for one in (
        Figure("desired_path", "desired path and the mechanism at its start", paper=11, written_as="desired_path"),
        Figure(
            "mechanism_drawing",
            "the mechanism with its deflected links half way through the run",
            takes="mode",
            variables=("shape",),
            points="point",
        ),
        Figure("mode_shapes", "lowest mode shapes, with motors free and held", takes="mode", written_as="mode_shapes"),
        Figure(
            "deformed_shapes",
            "deformed mechanism in all steps",
            written_as="deformed_shapes",
            variables=("given_travel",),
        ),
        Figure(
            "buckling_shapes",
            "buckling shapes of the last stable step",
            written_as="buckling_shapes",
            variables=("buckling_shape",),
        ),
        Figure("response_map", "contours of metrics over two parameters", takes="designs"),
        Figure("parallel_coordinates", "parameters and metrics of every design on parallel axes", takes="designs"),
    )
}


def _figures(kind: ResultKind) -> tuple[Figure, ...]:
    """Return the figures of a kind of results: those with charts, then drawings."""
    return (*figures_of_kind(kind.name).values(), *(_DRAWINGS[name] for name in kind.drawings))


# Figures of each kind of results that has any.
CATALOGUE: Mapping[str, tuple[Figure, ...]] = {
    name: _figures(kind) for name, kind in RESULT_KINDS.items() if kind.figures or kind.drawings
}


def figure_names() -> set[str]:
    """Return the names of all figures."""
    return {figure.name for figures in CATALOGUE.values() for figure in figures}
