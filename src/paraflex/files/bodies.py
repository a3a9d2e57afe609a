"""Construction of bodies from their tables in a model file."""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any, get_args

from paraflex.errors import InputError
from paraflex.limits import SHAPE_FUNCTIONS, at_most
from paraflex.mechanism import Body, Damping, LumpedMass, Material, ModalPoint, Polynomial, Section, Sine
from paraflex.mechanism.bodies import BODY_KINDS
from paraflex.mechanism.quantities import known
from paraflex.mechanism.sections import SHAPES
from .field_values import check_fields
from .schema import DampingTable, ModelTable, SectionTable


def read_body(name: str, body: Any, table: ModelTable) -> Body:
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
        Section, material or lump missing from the file, invalid numbers, or an inadmissible number of sines.
    """
    values, place = dict(body), f"body.{name}"
    kind: Any = BODY_KINDS[values.pop("type")]
    if "lumps" in values:
        values["lumps"] = [
            LumpedMass(point, **dict(_named(table.lump, lump, f"{place}.lumps.{point}", "lump")))
            for point, lump in body.lumps.items()
        ]
    for field, tables, read in (("section", table.section, read_section), ("material", table.material, _material)):
        if field in values:
            names = values[field]
            found = tuple(
                read(each, _named(tables, each, f"{place}.{field}", field))
                for each in ([names] if isinstance(names, str) else names)
            )
            values[field] = found[0] if isinstance(names, str) else found
    for direction in ("transverse", "axial") if "axial_sines" in values else ():
        sines, polynomials = values.pop(f"{direction}_sines"), values.pop(f"{direction}_polynomials")
        if sines < 0:
            raise InputError("must not be negative", field=f"{place}.{direction}_sines", value=sines, remedy="give 2")
        at_most(sines, SHAPE_FUNCTIONS, f"{place}.{direction}_sines")
        values[direction] = (*(Sine(n + 1) for n in range(sines)), *(Polynomial(tuple(row)) for row in polynomials))
    if body.type == "modal":
        values["points"] = {key: ModalPoint(**dict(point)) for key, point in body.points.items()}
    if body.type == "beam":
        values |= {key: values[key] or getattr(table, key) for key in ("reference", "curvature")}
    if "damping" in values:
        values["damping"] = _damping(body.damping, name)
    return kind(name, **values)


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
    what = "section by its area" if kind is None else f"{kind} section"
    check_fields(section_type, given, what, f"section.{name}", "shape")
    try:
        return Section(**given) if kind is None else Section.of(section_type(**given))
    except InputError as error:
        raise error.at(f"section.{name}.{error.field.rpartition('.')[2]}") from None


def _material(_: str, table: Any) -> Material:
    return Material(**dict(table))


def _named(tables: Mapping[str, Any], name: str, where: str, kind: str) -> Any:
    known(name, tables, where, kind)
    return tables[name]


def _damping(table: DampingTable | None, name: str) -> Damping | None:
    """Build the structural damping of a body, whose name appears in errors.

    Raises
    ------
    InputError
        Two kinds of damping at once, or a loss factor without its frequency.
    """
    if table is None:
        return None
    given = {key: getattr(table, key) for key in table.model_fields_set}
    for kind in get_args(Damping):
        own = {each.name: each.default for each in fields(kind)}
        if given.keys() <= own.keys() and all(name in given for name, default in own.items() if default is MISSING):
            return kind(**given)
    raise InputError(
        "a loss factor needs the frequency at which it holds"
        if given.keys() < {"loss_factor", "frequency"}
        else "ratios, a loss factor and Rayleigh's coefficients exclude one another",
        field=f"body.{name}.damping",
        value=sorted(given),
        remedy="give ratios alone, or loss_factor and frequency, or mass and stiffness",
    )
