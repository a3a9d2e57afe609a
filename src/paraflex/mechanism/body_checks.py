"""Checks of a body: plausible numbers, points on the body, shapes that can be integrated."""

from collections.abc import Iterator
from typing import TypeVar

from paraflex.errors import InputError, within
from paraflex.fem import Polynomial, mesh_beam
from paraflex.limits import ELEMENTS
from .bodies import AssumedModesBeam, Body, ComponentModes, FlexibleBeam, RigidBody
from .damping import stiffness_damping
from .modal import ModalBody
from .quantities import check_numbers, finite, known, positive

T = TypeVar("T")
_ROD = ' (a rod without mass between two pins is a joint of type = "distance")'


def check_body(body: Body) -> None:
    """Check masses, lengths, stiffnesses, damping, modes and frames, and that lumps are at points that exist.

    Raises
    ------
    InputError
        The first check that fails.
    """
    field = f"body.{body.name}"
    check_numbers(body, field)
    if isinstance(body, RigidBody):
        # Both or none: kinematics does without.
        if body.mass or body.inertia:
            positive(body.mass, f"{field}.mass", f"kg{_ROD}")
            positive(body.inertia, f"{field}.inertia", f"kg m^2{_ROD}")
        for name, position in body.points.items():
            finite(position, f"{field}.points.{name}")
        return
    if isinstance(body, ModalBody):
        with within(field):
            _ = body.integrals
            for name in body.points:
                body.point(name)
        n = body.n_flexible
    elif isinstance(body, AssumedModesBeam):
        _check_bar(body, field)
        _check_shapes(body, field)
        n = body.n_flexible
    else:
        _check_bar(body, field)
        with within(field):
            n = body.mesh.n_flexible
        _check_frames(body, field)
    if body.damping is not None:
        check_numbers(body.damping, f"{field}.damping")
    static = isinstance(body, FlexibleBeam) and body.reduction is ComponentModes.CRAIG_BAMPTON
    if static and body.modes is None:
        raise InputError(
            "has no meaning without modes", field=f"{field}.reduction", value=ComponentModes.CRAIG_BAMPTON.value,
            remedy="give the number of vibrations kept beside the static shapes: modes = 2",
        )  # fmt: skip
    if body.modes is not None and not (0 if static else 1) <= body.modes <= n:
        raise InputError(
            "no such number of modes",
            field=f"{field}.modes",
            value=body.modes,
            remedy=f"from {0 if static else 1} to {n}, or leave it out for all",
        )


def _check_frames(beam: FlexibleBeam, field: str) -> None:
    if not 1 <= beam.frames <= ELEMENTS:
        raise InputError(
            "no such number of frames", field=f"{field}.frames", value=beam.frames, remedy=f"from 1 to {ELEMENTS}"
        )
    if beam.frames == 1:
        return
    if beam.modes is not None:
        raise InputError(
            "modes of the whole beam have no meaning in several frames", field=f"{field}.modes", value=beam.modes,
            remedy="leave modes out, or frames",
        )  # fmt: skip
    stiffness_damping(beam.damping, "a beam in several frames", f"{field}.damping")


def _check_bar(body: FlexibleBeam | AssumedModesBeam, field: str) -> None:
    for where, section in _each(body.section, f"{field}.section"):
        check_numbers(section, where)
    for where, material in _each(body.material, f"{field}.material"):
        check_numbers(material, where)
    finite(body.points.values(), f"{field}.points")
    with within(field):
        mesh_beam(body.length, body.points, body.counts if isinstance(body, FlexibleBeam) else 1)
    for lump in body.lumps:
        known(lump.point, body.points, f"{field}.lumps", "point", "a lumped mass at an unknown point")
        check_numbers(lump, f"{field}.lumps.{lump.point}")


def _each(value: T | tuple[T, ...], field: str) -> Iterator[tuple[str, T]]:
    """Yield the sections or materials of a beam, one or one per span, each with the name of its field."""
    if isinstance(value, tuple):
        yield from ((f"{field}.{k}", each) for k, each in enumerate(value))
    else:
        yield field, value


def _check_shapes(body: AssumedModesBeam, field: str) -> None:
    for kind in ("transverse", "axial"):
        for function in getattr(body, kind):
            if isinstance(function, Polynomial):
                if not function.coefficients:
                    raise InputError("has no coefficients", field=f"{field}.{kind}", remedy="give at least one")
                finite(function.coefficients, f"{field}.{kind}")
    with within(field):
        _ = body.integrals
