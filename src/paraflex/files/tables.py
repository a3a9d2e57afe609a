"""Conversion of a model to the tables of its file: mechanism, paths, controllers, start, study and statics."""

from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from itertools import count
from numbers import Integral
from typing import Any

from paraflex.control.shaping.shaped import ShapedPath
from paraflex.control.shaping.shapers import Shaper
from paraflex.errors import InputError, within
from paraflex.mechanism import (
    AppliedTorque,
    Assembly,
    AssumedModesBeam,
    Body,
    FlexibleBeam,
    ForceLaw,
    Mechanism,
    ModalBody,
    PointForce,
    PointRef,
    Polynomial,
    PrescribedAngle,
    RigidBody,
    Section,
    ShapeFunction,
    Sine,
    Start,
    TimeProfile,
    grouped,
)
from paraflex.mechanism.bodies import BODY_KINDS
from paraflex.mechanism.quantities import joint_pair
from paraflex.paths import Path, SequencePath, TabulatedPath
from .controllers import controller_table
from .field_values import changed_fields, inexpressible
from .profiles import components_table, profile_parameters, profile_table
from .schema import PATHS
from .study import StudyDefaults

_BODIES = {kind: name for name, kind in BODY_KINDS.items()}
# Properties of beams that a file may give once for all of them, at its top, with their defaults.
_SHARED = {"reference": "pinned", "curvature": "separate"}
# Tables to which bodies refer by name, with the field of a body that holds the names.
_NAMED_TABLES = {"section": "section", "material": "material", "lump": "lumps"}


def model_tables(
    model: Any, *, file: Mapping[str, Any] | None = None, before: Mechanism | None = None, each: bool = False
) -> dict[str, Any]:
    """Build the tables of the file of a model, without entries that equal their defaults.

    Parameters
    ----------
    model : Model
        Model to write.
    file : mapping, optional
        Data of a file whose names of sections, materials and lumps are kept.
    before : Mechanism, optional
        Mechanism described by that file.
    each : bool
        Whether every beam gives its own reference condition and treatment of curvature. By default the file gives them
        once if all beams agree.

    Raises
    ------
    InputError
        Member that cannot be expressed in a file.
    """
    mechanism, study = model.mechanism, model.study
    if mechanism.bases:
        raise InputError(
            "a file cannot hold flexible coordinates that a reduction has chosen", field="bases",
            remedy="save the mechanism before it, and write reduced = N in its [study]",
        )  # fmt: skip
    shared = {} if each else _agreed(mechanism)
    names = {kind: _Names(kind, mechanism, file or {}, before) for kind in _NAMED_TABLES}
    entries = {
        "name": mechanism.name,
        "description": mechanism.description,
        "geometry": "" if mechanism.geometry.value == "second-order" else mechanism.geometry.value,
        **{key: value for key, value in shared.items() if value != _SHARED[key]},
        "parameters": profile_parameters(_profiles(model)),
        "section": {name: _section(one, name, file or {}) for name, one in names["section"].values.items()},
        "material": {name: changed_fields(material) for name, material in names["material"].values.items()},
        "lump": {name: {"mass": mass, "inertia": inertia} for name, (mass, inertia) in names["lump"].values.items()},
        "ground": mechanism.ground,
        "gravity": [] if tuple(mechanism.gravity) == (0.0, 0.0) else mechanism.gravity,
        "body": {body.name: _body(body, names, shared) for body in mechanism.bodies},
        "joint": {
            joint.name: [joint.a, joint.b] if joint.kind == "revolute" else {"type": joint.kind, **_member(joint)}
            for joint in mechanism.joints
        },
        "motor": {motor.name: _member(motor) if motor.follows else motor.joint for motor in mechanism.motors},
        "prescribed": {each.name: _prescribed(each, mechanism) for each in mechanism.prescribed},
        # Springs, dampers, friction and loads.
        **{
            group.table: {one.name: ({"type": one.kind} if len(group.kinds) > 1 else {}) | _member(one) for one in many}
            for group, many in grouped(mechanism)
            if group.kinds
        },
        "end_effector": {} if mechanism.end_effector is None else changed_fields(mechanism.end_effector),
        "assembly": {assembly.name: _assembly(assembly) for assembly in mechanism.assemblies},
        "mode": {mode.name: mode.motors for mode in mechanism.modes},
        "path": {name: _path(path, name, model.paths) for name, path in model.paths.items()},
        "controller": {name: controller_table(one) for name, one in model.controllers.items()},
        "start": {} if model.start is None else _start(model.start),
        "study": changed_fields(study)
        | ({"torques": _torques(study)} if study.torques else {})
        | ({} if study.shaper is None else {"shaper": _shaper(study.shaper)}),
        "statics": changed_fields(model.statics),
    }
    return {key: _plain(value, key) for key, value in entries.items() if value or key == "name"}


def _member(member: Any) -> dict[str, Any]:
    """Return the fields of a member's table, with its points a and b in one field, and likewise two joints."""
    together = {"points": ["a", "b"] if hasattr(member, "a") else [], "joints": joint_pair(member)}
    pairs = {key: [getattr(member, name) for name in names] for key, names in together.items() if names}
    if isinstance(member, PointForce | AppliedTorque):
        with within(f"load.{member.name}"):
            reaction = {} if member.reaction is None else {"reaction": member.reaction}
            return {"point": member.point} | reaction | components_table(member.components, member.kind)
    return pairs | changed_fields(member, "name", *(name for names in together.values() for name in names))


def _profiles(model: Any) -> Iterator[tuple[str, TimeProfile | ForceLaw]]:
    """Yield the time profiles and laws of a model, each with its field in a file."""
    torques = model.study.torques
    yield from ((f"prescribed.{one.name}.profile", one.profile) for one in model.mechanism.prescribed)
    yield from (
        (f"load.{one.name}.{one.kind}", each) for one in model.mechanism.loads for each in (*one.profiles, *one.laws)
    )
    springs = model.mechanism.linear_springs
    yield from ((f"linear_spring.{one.name}.force", law) for one in springs for law in one.laws)
    yield from (
        (f"study.torques.{name}", profile) for name, profile in torques.items() if isinstance(profile, TimeProfile)
    )
    for one in model.controllers.values():
        for sensor, profile in one.reference.items() if isinstance(one.reference, Mapping) else ():
            if isinstance(profile, TimeProfile):
                yield f"controller.{one.name}.reference.{sensor}", profile


def _plain(value: Any, field: str) -> Any:
    """Convert values to those of TOML: texts, numbers, booleans, lists and tables."""
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, bool):
        return value
    if isinstance(value, str | PointRef | ForceLaw):
        return _text(str(value), field)
    if isinstance(value, Mapping):
        return {_text(str(key), field): _plain(each, f"{field}.{key}") for key, each in value.items()}
    if isinstance(value, Integral):
        return int(value)
    if hasattr(value, "__iter__"):
        return [_plain(each, f"{field}.{k}") for k, each in enumerate(value)]
    try:
        return float(value)
    except (TypeError, ValueError):
        raise inexpressible(field, value, "give a number") from None


def _text(text: str, field: str) -> str:
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError("not text in UTF-8", field=field, value=ascii(text), remedy="use other characters") from None
    return text


def _agreed(mechanism: Mechanism) -> dict[str, str]:
    """Return the reference condition and the curvature treatment, each if all beams agree in it."""
    beams = [body for body in mechanism.bodies if isinstance(body, FlexibleBeam)]
    values = {key: {getattr(beam, key).value for beam in beams} for key in _SHARED}
    return {key: found.pop() for key, found in values.items() if len(found) == 1}


class _Names:
    """Names of the sections, materials or lumps of a mechanism, with their values.

    Names in a file are kept where they are used. A name gets a new value if all of its users have changed theirs.

    Attributes
    ----------
    at : mapping
        Names by body and place, which is the number of a span or the name of a point.
    values : mapping
        Values by name.
    """

    def __init__(self, kind: str, mechanism: Mechanism, file: Mapping[str, Any], before: Mechanism | None) -> None:
        places = _places(kind, mechanism)
        had = {} if before is None else _places(kind, before)
        taken = {place: name for place in places if (name := _name_at(file, _NAMED_TABLES[kind], *place)) is not None}
        self.at: dict[tuple[str, Any], str] = {}
        self.values: dict[str, Any] = {}
        for place, name in taken.items():
            if name not in self.values or places[place] == had.get(place):
                self.values[name] = places[place]
        for place, value in places.items():
            name = taken.get(place)
            if name is None or self.values[name] != value:
                name = next((known for known, named in self.values.items() if named == value), None) or next(
                    new for n in count(1) if (new := f"{kind}{n}") not in self.values and new not in file.get(kind, {})
                )
                self.values[name] = value
            self.at[place] = name


def _places(kind: str, mechanism: Mechanism) -> dict[tuple[str, Any], Any]:
    """Return every section, material or lump by body and place."""
    out: dict[tuple[str, Any], Any] = {}
    for body in mechanism.bodies:
        given = getattr(body, _NAMED_TABLES[kind], ())
        if kind == "lump":
            for lump in given:
                if (body.name, lump.point) in out:
                    raise inexpressible(f"body.{body.name}.lumps", lump.point, "combine the lumps at a point")
                out[body.name, lump.point] = (lump.mass, lump.inertia)
        else:
            for k, each in enumerate(given if isinstance(given, tuple) else (given,)):
                shape = getattr(each, "shape", None)
                if shape is not None and Section.of(shape) != each:
                    remedy = "give Section.rectangle(...), round(...) or tube(...), or no shape"
                    raise inexpressible(f"body.{body.name}.section", each, remedy)
                out[body.name, k] = each
    return out


def _name_at(file: Mapping[str, Any], field: str, body: str, place: Any) -> str | None:
    """Return the name that a file uses at a place of a body; None if there is none."""
    found = file.get("body", {}).get(body, {}).get(field, ())
    if isinstance(found, Mapping):
        return found.get(place)
    listed = (found,) if isinstance(found, str) else found
    return listed[place] if isinstance(place, int) and place < len(listed) else None


def _section(section: Section, name: str, file: Mapping[str, Any]) -> dict[str, Any]:
    """Build the table of a section; the shape of a rectangle is given only if the file gives it."""
    shape = section.shape
    if shape is None:
        return changed_fields(section)
    explicit = shape.kind != "rectangle" or "shape" in file.get("section", {}).get(name, {})
    return ({"shape": shape.kind} if explicit else {}) | changed_fields(shape)


def _body(body: Body, names: Mapping[str, _Names], shared: Mapping[str, str]) -> dict[str, Any]:
    out: dict[str, Any] = {"type": _BODIES[type(body)]} | changed_fields(body, "name", *_SHARED)
    if isinstance(body, FlexibleBeam):
        out |= {key: getattr(body, key) for key in _SHARED if key not in shared}
    if isinstance(body, FlexibleBeam | AssumedModesBeam):
        for kind in ("section", "material"):
            listed = [name for (owner, _), name in names[kind].at.items() if owner == body.name]
            out[kind] = listed if isinstance(getattr(body, kind), tuple) else listed[0]
        if body.lumps:
            out["lumps"] = {lump.point: names["lump"].at[body.name, lump.point] for lump in body.lumps}
    if isinstance(body, AssumedModesBeam):
        for direction in ("transverse", "axial"):
            out |= _functions(out.pop(direction, ()), f"body.{body.name}.{direction}", direction)
    if isinstance(body, ModalBody):
        out["points"] = {name: vars(point) for name, point in body.points.items()}
    if not isinstance(body, RigidBody) and body.damping is not None:
        out["damping"] = vars(body.damping)
    return out


def _functions(functions: Sequence[ShapeFunction], field: str, direction: str) -> dict[str, Any]:
    """Convert shape functions to the fields of a file: the number of sines, then the polynomials."""
    sines = [function.half_waves for function in functions if isinstance(function, Sine)]
    polynomials = [function.coefficients for function in functions[len(sines) :] if isinstance(function, Polynomial)]
    if sines != list(range(1, len(sines) + 1)) or len(sines) + len(polynomials) != len(functions):
        raise inexpressible(field, functions, "give the sines from 1 on without gaps, then the polynomials")
    counts = {f"{direction}_sines": len(sines), f"{direction}_polynomials": polynomials}
    return {key: value for key, value in counts.items() if value}


def _prescribed(prescribed: PrescribedAngle, mechanism: Mechanism) -> dict[str, Any]:
    with within(f"prescribed.{prescribed.name}"):
        profile = profile_table(prescribed.profile, "displacement" if mechanism.slides(prescribed.joint) else "angle")
    return {"joint": prescribed.joint} | profile


def _path(path: Path, name: str, paths: Mapping[str, Path]) -> dict[str, Any]:
    if isinstance(path, ShapedPath):
        table = _path(path.path, name, paths)
        if "shaper" in table:
            raise inexpressible(f"path.{name}.shaper", "a shaped path shaped again", "give one shaper all frequencies")
        return table | {"shaper": _shaper(path.shaper)}
    if isinstance(path, SequencePath):
        names = [next((other for other, one in paths.items() if one == part), "") for part in path.paths]
        if not all(names):
            raise inexpressible(
                f"path.{name}.paths", "a path without a name", "put each of its paths among the model's"
            )
        return {"type": "sequence", "paths": names} | changed_fields(path, "paths")
    if isinstance(path, TabulatedPath):
        columns = [*zip(*path.points, strict=True), *([] if path.times is None else [path.times])]
        return {"type": "table", "table": [*zip(*columns, strict=True)]} | changed_fields(path, "points", "times")
    for kind, path_type in PATHS.items():
        if type(path) is path_type:
            return {"type": kind} | changed_fields(path)
    raise inexpressible(
        f"path.{name}",
        type(path).__name__,
        "give a Polygon, Line, Circle, PointPath, TabulatedPath, SequencePath or ShapedPath",
    )


def _shaper(shaper: Shaper) -> dict[str, Any]:
    return {"type": shaper.kind.value} | changed_fields(shaper, "kind")


def _torques(study: StudyDefaults) -> dict[str, Any]:
    """Build the entries of motor torques: a single number or expression if sufficient, else a table."""
    entries = {}
    for name, profile in study.torques.items():
        with within(f"study.torques.{name}"):
            table = components_table((profile,), "torque")
        entries[name] = table.get("torque", table)
    return entries


def _assembly(assembly: Assembly) -> dict[str, Any]:
    if "points" in assembly.angles:
        raise inexpressible(f"assembly.{assembly.name}", "points", 'rename the body "points"')
    return {**assembly.angles} | ({"points": assembly.points} if assembly.points else {})


def _start(start: Start) -> dict[str, Any]:
    velocity = {"angular": start.angular, "point": start.point}
    entries = {
        "deflection": {
            body: {point: changed_fields(each) for point, each in points.items()}
            for body, points in start.deflection.items()
        },
        "velocity": {key: value for key, value in velocity.items() if value},
        "coordinates": {body: changed_fields(each) for body, each in start.coordinates.items()},
        "rates": {body: changed_fields(each) for body, each in start.rates.items()},
    }
    return {key: value for key, value in entries.items() if value}
