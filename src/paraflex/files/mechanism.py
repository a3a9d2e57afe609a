"""Construction of mechanisms, their bodies and paths from the tables of a model file."""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any, cast, get_args

from paraflex.control.shaping.shaped import ShapedPath
from paraflex.control.shaping.shapers import Shaper, ShaperKind
from paraflex.errors import InputError, within
from paraflex.expressions.evaluate import evaluate_parameters
from paraflex.limits import SHAPE_FUNCTIONS, at_most
from paraflex.mechanism import (
    JOINT_KINDS,
    ActuationMode,
    Assembly,
    Body,
    Damping,
    EndEffector,
    ForceLaw,
    Group,
    Joint,
    LumpedMass,
    Material,
    Mechanism,
    ModalPoint,
    Motor,
    Payload,
    PointRef,
    Polynomial,
    PrescribedAngle,
    RevoluteJoint,
    Section,
    Sine,
    groups_of,
)
from paraflex.mechanism.bodies import BODY_KINDS
from paraflex.mechanism.loads import InTime
from paraflex.mechanism.quantities import check_numbers, known
from paraflex.mechanism.sections import SHAPES
from paraflex.paths import Path
from .field_values import check_fields
from .profiles import quantities, read_components, read_profile
from .schema import (
    PATHS,
    DampingTable,
    JointTable,
    ModelTable,
    PathTable,
    PrescribedTable,
    SectionTable,
    SequenceTable,
    ShaperTable,
    TabulatedPathTable,
    TorqueTable,
)


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


def _material(name: str, table: Any) -> Material:
    material = Material(**dict(table))
    check_numbers(material, f"material.{name}")
    return material


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


def read_mechanism(table: ModelTable) -> Mechanism:
    """Build the mechanism of a model file.

    Raises
    ------
    InputError
        Inconsistent or invalid entry.
    """
    for name, section in table.section.items():
        read_section(name, section)
    effector = table.end_effector
    members: dict[str, Any] = {
        key: getattr(table, key) for key in ("name", "description", "geometry", "ground", "gravity")
    }
    for field, group in groups_of(Mechanism).items():
        if group.kinds:
            members[field] = [_member(group, name, one, table) for name, one in getattr(table, group.table).items()]
    mechanism = Mechanism(
        **members,
        bodies=tuple(read_body(name, body, table) for name, body in table.body.items()),
        joints=tuple(_joint(name, entry) for name, entry in table.joint.items()),
        motors=tuple(
            Motor(name, one) if isinstance(one, str) else Motor(name, **dict(one)) for name, one in table.motor.items()
        ),
        prescribed=_prescribed(table),
        end_effector=None if effector is None else EndEffector(**dict(effector)),
        assemblies=tuple(Assembly(name, one.angles, cast(Any, one.points)) for name, one in table.assembly.items()),
        modes=tuple(ActuationMode(name, tuple(motors)) for name, motors in table.mode.items()),
    )
    return mechanism if table.payload is None else mechanism.with_payload(Payload(**dict(table.payload)))


def _joint(name: str, entry: list[str] | JointTable) -> Joint:
    points = entry if isinstance(entry, list) else entry.points
    a, b = (PointRef.parse(point, f"joint.{name}") for point in points)
    if isinstance(entry, list):
        return RevoluteJoint(name, a, b)
    # Fields of another kind of joint are rejected, because they would have no effect.
    kind = JOINT_KINDS[entry.type]
    given = {key: getattr(entry, key) for key in entry.model_fields_set - {"type", "points"}}
    check_fields(kind, given, f"{entry.type} joint", f"joint.{name}", "name", "a", "b")
    return kind(name, a, b, **given)


def _prescribed(table: ModelTable) -> tuple[PrescribedAngle, ...]:
    parameters = evaluate_parameters(table.parameters)
    found = []
    for name, entry in table.prescribed.items():
        _check_quantity(name, entry, table.joint.get(entry.joint))
        with within(f"prescribed.{name}"):
            profile = read_profile(entry, parameters, table.study.duration)
        found.append(PrescribedAngle(name, entry.joint, profile))
    return tuple(found)


def _check_quantity(name: str, entry: PrescribedTable, joint: list[str] | JointTable | None) -> None:
    """Check that a revolute joint has an angle and a sliding joint a displacement."""
    kind = joint.type if isinstance(joint, JointTable) else "revolute"
    wrong, right = ("angle", "displacement") if JOINT_KINDS[kind].slides else ("displacement", "angle")
    if joint is not None and wrong in quantities(entry):
        raise InputError(
            f"a {kind} joint has no {wrong}", field=f"prescribed.{name}.{wrong}", value=entry.joint,
            remedy=f"give its {right}",
        )  # fmt: skip


def read_torques(table: ModelTable) -> dict[str, InTime]:
    """Read the motor torques given in the study.

    Raises
    ------
    InputError
        Invalid profile.
    """
    parameters, torques = evaluate_parameters(table.parameters), {}
    for name, given in table.study.torques.items():
        place, whole = f"study.torques.{name}", isinstance(given, TorqueTable)
        entry = given if whole else TorqueTable.model_construct(torque=given)
        try:
            (torques[name],) = read_components(entry, "torque", parameters, table.study.duration)
        except InputError as error:
            # A single number or expression stands in the place of the table.
            raise (error.within(place) if whole else error.at(place)) from None
    return torques


def _member(group: Group, name: str, entry: Any, table: ModelTable) -> Any:
    """Build a member of a group from its table."""
    values = dict(entry)
    kinds = {getattr(kind, "kind", None): kind for kind in group.kinds}
    kind = kinds[values.pop("type")] if "type" in values else group.kinds[0]
    if group.table == "load":
        with within(f"load.{name}"):
            given = read_components(entry, entry.type, evaluate_parameters(table.parameters), table.study.duration)
        return kind(name, entry.point, given[0] if entry.type == "torque" else given, reaction=entry.reaction)
    for field in ("force", "torque"):
        if values.get(field) is not None:
            with within(f"{group.table}.{name}"):
                values[field] = ForceLaw(str(values[field]), evaluate_parameters(table.parameters), field=field)
    points = [PointRef.parse(point, f"{group.table}.{name}.points") for point in values.pop("points", ())]
    return kind(name, *points, *values.pop("joints", ()), **values)


def read_paths(tables: Mapping[str, PathTable]) -> dict[str, Path]:
    """Build paths from their tables, by name.

    Raises
    ------
    InputError
        Invalid path (see `read_path`), or sequence that names no path or a sequence that follows it in the file.
    """
    found: dict[str, Path] = {}
    # Sequences refer to other paths and are therefore read last.
    for name in sorted(tables, key=lambda name: tables[name].type == "sequence"):
        with within(f"path.{name}"):
            found[name] = read_path(tables[name], found)
    return {name: found[name] for name in tables}


def read_path(table: PathTable, others: Mapping[str, Path] | None = None) -> Path:
    """Build a path from its table; `others` are the paths to which a sequence may refer.

    Raises
    ------
    InputError
        Invalid numbers, or unknown names.
    """
    values = {name: value for name, value in table if name not in ("type", "shaper")}
    if isinstance(table, SequenceTable):
        for name in table.paths:
            known(name, others or {}, "paths", "path")
        values["paths"] = tuple((others or {})[name] for name in table.paths)
    if isinstance(table, TabulatedPathTable):
        rows = values.pop("table")
        if len({len(row) for row in rows}) > 1:
            raise InputError(
                "some points have a time and some do not", field="table", remedy="give all as [x, y], or as [x, y, t]"
            )
        values["points"] = [row[:2] for row in rows]
        values["times"] = [row[2] for row in rows] if rows and len(rows[0]) > 2 else None
    try:
        path = PATHS[table.type](**values)
    except InputError as error:
        at_table = isinstance(table, TabulatedPathTable) and error.field in ("points", "times")
        raise (error.at("table") if at_table else error) from None
    return path if table.shaper is None else ShapedPath(path, read_shaper(table.shaper))


def read_shaper(table: ShaperTable) -> Shaper:
    """Build an input shaper from its table.

    Raises
    ------
    InputError
        Invalid numbers.
    """
    values = {name: value for name, value in table if name != "type" and value is not None}
    with within("shaper"):
        return Shaper(ShaperKind(table.type), **values)
