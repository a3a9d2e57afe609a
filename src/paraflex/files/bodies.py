"""Bodies of given shapes from their tables."""

from __future__ import annotations

from paraflex.errors import InputError
from paraflex.files.schema import AssumedModesTable, DampingTable, ModalTable
from paraflex.mechanism import (
    AssumedModesBeam,
    Damping,
    LossFactor,
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
        Two kinds at once, or a loss factor without its frequency.
    """
    if table is None:
        return None
    given = table.model_fields_set
    if given <= {"mass", "stiffness"}:
        return RayleighDamping(table.mass, table.stiffness)
    if given == {"ratios"}:
        return ModalDamping(tuple(table.ratios))
    if given == {"loss_factor", "frequency"}:
        return LossFactor(table.loss_factor, table.frequency)
    raise InputError(
        "a loss factor goes with the frequency that it is meant for"
        if given < {"loss_factor", "frequency"}
        else "ratios, a loss factor and Rayleigh's coefficients exclude one another",
        field=f"body.{name}.damping",
        value=sorted(given),
        remedy="give ratios alone, or loss_factor and frequency, or mass and stiffness",
    )


def _functions(sines: int, polynomials: list[list[float]], field: str) -> tuple[ShapeFunction, ...]:
    if sines < 0:
        raise InputError("must not be negative", field=field, value=sines, remedy="say 2")
    return (*(Sine(n) for n in range(1, sines + 1)), *(Polynomial(tuple(row)) for row in polynomials))
