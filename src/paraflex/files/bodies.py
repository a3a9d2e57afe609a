"""Construction of bodies from their tables in a model file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.files.field_values import check_fields
from paraflex.files.schema import (
    AssumedModesTable,
    BeamTable,
    DampingTable,
    ModalTable,
    ModelTable,
    RigidTable,
    SectionTable,
)
from paraflex.limits import SHAPE_FUNCTIONS, at_most
from paraflex.mechanism import (
    AssumedModesBeam,
    Body,
    ComponentModes,
    Curvature,
    Damping,
    FlexibleBeam,
    LossFactor,
    LumpedMass,
    Material,
    ModalBody,
    ModalDamping,
    ModalPoint,
    Polynomial,
    RayleighDamping,
    RigidBody,
    Section,
    ShapeFunction,
    Sine,
)
from paraflex.mechanism.quantities import known
from paraflex.mechanism.sections import SHAPES


def read_body(name: str, body: BeamTable | RigidTable | AssumedModesTable | ModalTable, table: ModelTable) -> Body:
    """Build a body from its table.

    Parameters
    ----------
    name : str
        Name of the body.
    body : BeamTable, RigidTable, AssumedModesTable or ModalTable
        Table of the body.
    table : ModelTable
        Whole model file, with sections, materials and lumps.

    Raises
    ------
    InputError
        Section, material or lump missing from the file, or invalid numbers.
    """
    if isinstance(body, RigidTable):
        return RigidBody(name, **_given(body))
    if isinstance(body, ModalTable):
        points = {key: ModalPoint(**dict(point)) for key, point in body.points.items()}
        return ModalBody(name, **_given(body) | {"points": points, "damping": _damping(body.damping, name)})
    lumps = []
    for point, lump_name in body.lumps.items():
        lump = _named(table.lump, lump_name, f"body.{name}.lumps.{point}", "lump")
        lumps.append(LumpedMass(point, **dict(lump)))
    if isinstance(body, AssumedModesTable):
        section, material = _section(name, body.section, table), _material(name, body.material, table)
        return _assumed_modes_beam(name, body, section, material, tuple(lumps))
    return FlexibleBeam(
        name=name,
        length=body.length,
        section=_section(name, body.section, table)
        if isinstance(body.section, str)
        else tuple(_section(name, each, table) for each in body.section),
        material=_material(name, body.material, table)
        if isinstance(body.material, str)
        else tuple(_material(name, each, table) for each in body.material),
        points=body.points,
        elements=tuple(body.elements) if isinstance(body.elements, list) else body.elements,
        lumps=tuple(lumps),
        reference=ReferenceCondition(body.reference or table.reference),
        curvature=Curvature(body.curvature or table.curvature),
        modes=body.modes,
        damping=_damping(body.damping, name),
        flexible=body.flexible,
        frames=body.frames,
        reduction=ComponentModes(body.reduction),
    )


def _section(body: str, name: str, table: ModelTable) -> Section:
    return read_section(name, _named(table.section, name, f"body.{body}.section", "section"))


def read_section(name: str, table: SectionTable) -> Section:
    """Build a cross-section from its table.

    Raises
    ------
    InputError
        Field that a section of this shape does not have, missing required field, or invalid numbers.
    """
    given = {key: value for key, value in table if value is not None}
    kind = given.pop("shape", None)
    if kind is None and "diameter" in given:
        raise InputError("is missing", field=f"section.{name}.shape", remedy='write "round" or "tube"')
    if kind is None and not given.keys() & {"area", "second_moment"}:
        kind = "rectangle"
    section_type: Any = Section if kind is None else SHAPES[kind]
    own = {each.name: each for each in fields(section_type) if each.name != "shape"}
    what, described = "section by its area" if kind is None else f"{kind} section", SectionTable.model_fields
    check_fields(given, own, what, f"section.{name}", lambda each: f"{described[each.name].description}")
    try:
        return Section(**given) if kind is None else Section.of(section_type(**given))
    except InputError as error:
        raise error.at(f"section.{name}.{error.field.rpartition('.')[2]}") from None


def _material(body: str, name: str, table: ModelTable) -> Material:
    material = _named(table.material, name, f"body.{body}.material", "material")
    return Material(**dict(material))


def _named(tables: Mapping[str, Any], name: str, where: str, kind: str) -> Any:
    known(name, tables, where, kind)
    return tables[name]


def _assumed_modes_beam(
    name: str, table: AssumedModesTable, section: Section, material: Material, lumps: tuple[LumpedMass, ...]
) -> AssumedModesBeam:
    """Build a beam with assumed modes; the sine functions come first, then the polynomials.

    Raises
    ------
    InputError
        Negative number of sines, or more than the limit.
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
        damping=_damping(table.damping, name),
        flexible=table.flexible,
    )


def _given(table: RigidTable | ModalTable) -> dict[str, Any]:
    """Return the fields of a table without its type."""
    return {key: value for key, value in table if key != "type"}


def _damping(table: DampingTable | None, name: str) -> Damping | None:
    """Build the structural damping of a body, whose name appears in errors.

    Raises
    ------
    InputError
        Two kinds of damping at once, or a loss factor without its frequency.
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
        "a loss factor needs the frequency at which it holds"
        if given < {"loss_factor", "frequency"}
        else "ratios, a loss factor and Rayleigh's coefficients exclude one another",
        field=f"body.{name}.damping",
        value=sorted(given),
        remedy="give ratios alone, or loss_factor and frequency, or mass and stiffness",
    )


def _functions(sines: int, polynomials: list[list[float]], field: str) -> tuple[ShapeFunction, ...]:
    if sines < 0:
        raise InputError("must not be negative", field=field, value=sines, remedy="give 2")
    at_most(sines, SHAPE_FUNCTIONS, field)
    return (*(Sine(n) for n in range(1, sines + 1)), *(Polynomial(tuple(row)) for row in polynomials))
