"""Bodies of given shapes from their tables."""

from __future__ import annotations

from paraflex.errors import InputError
from paraflex.files.schema import AssumedModesTable, DampingTable, ModalTable
from paraflex.mechanism import (
    AssumedModesBeam,
    Damping,
    LumpedMass,
    Material,
    ModalBody,
    ModalDamping,
    ModalPoint,
    Polynomial,
    RayleighDamping,
    Section,
    ShapeFunction,
    Sine,
)


def assumed_modes_beam(
    name: str, table: AssumedModesTable, section: Section, material: Material, lumps: tuple[LumpedMass, ...]
) -> AssumedModesBeam:
    """A bar of assumed modes: its sines first, then its polynomials.

    Raises
    ------
    InputError
        A negative number of sines.
    """
    return AssumedModesBeam(
        name=name,
        length=table.length,
        section=section,
        material=material,
        transverse=_functions(table.transverse_sines, table.transverse_polynomials, f"body.{name}.transverse_sines"),
        axial=_functions(table.axial_sines, table.axial_polynomials, f"body.{name}.axial_sines"),
        points=table.points,
        lumps=lumps,
        modes=table.modes,
        damping=damping(table.damping, name),
        flexible=table.flexible,
    )


def modal_body(name: str, table: ModalTable) -> ModalBody:
    """A body by its own matrices."""
    return ModalBody(
        name=name,
        mass=table.mass,
        first_moment=table.first_moment,
        inertia=table.inertia,
        mass_matrix=table.mass_matrix,
        stiffness=table.stiffness,
        S2=table.S2,
        I1=table.I1,
        G1=table.G1,
        G2=table.G2,
        I2=table.I2,
        points={key: ModalPoint(point.position, point.shape, point.slope) for key, point in table.points.items()},
        modes=table.modes,
        damping=damping(table.damping, name),
        flexible=table.flexible,
    )


def damping(table: DampingTable | None, name: str) -> Damping | None:
    """Structural damping of a body of that name.

    Raises
    ------
    InputError
        Both kinds at once.
    """
    if table is None:
        return None
    if "ratios" not in table.model_fields_set:
        return RayleighDamping(table.mass, table.stiffness)
    if table.model_fields_set != {"ratios"}:
        raise InputError(
            "ratios and Rayleigh's coefficients exclude each other",
            field=f"body.{name}.damping",
            value=sorted(table.model_fields_set),
            remedy="give ratios alone, or mass and stiffness",
        )
    return ModalDamping(tuple(table.ratios))


def _functions(sines: int, polynomials: list[list[float]], field: str) -> tuple[ShapeFunction, ...]:
    if sines < 0:
        raise InputError("must not be negative", field=field, value=sines, remedy="say 2")
    return (*(Sine(n) for n in range(1, sines + 1)), *(Polynomial(tuple(row)) for row in polynomials))
