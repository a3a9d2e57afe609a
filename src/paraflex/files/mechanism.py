"""The mechanism of a model file from its tables, and its paths from theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, fields
from typing import Any

from paraflex.errors import InputError
from paraflex.files.bodies import read_body
from paraflex.files.expressions import evaluate_parameters
from paraflex.files.laws import quantities, read_components, read_law
from paraflex.files.schema import AssemblyTable, JointTable, ModelTable, PathTable, PrescribedTable, TorqueTable
from paraflex.kinematics import Circle, Line, Path, PointPath, Polygon
from paraflex.mechanism import (
    JOINT_KINDS,
    ActuationMode,
    AppliedTorque,
    Assembly,
    EndEffector,
    Group,
    Joint,
    Load,
    Mechanism,
    Motor,
    PointForce,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    groups_of,
)
from paraflex.mechanism.loads import InTime

# What paths are called in files.
PATHS: dict[str, Callable[..., Path]] = {"polygon": Polygon, "line": Line, "circle": Circle, "points": PointPath}


def read_mechanism(table: ModelTable) -> Mechanism:
    """The mechanism of a model file.

    Raises
    ------
    InputError
        Anything in it that does not fit together.
    """
    effector = table.end_effector
    made: dict[str, Any] = {
        key: getattr(table, key) for key in ("name", "description", "geometry", "ground", "gravity")
    }
    for field, group in groups_of(Mechanism).items():
        if group.kinds:
            make = _load if group.table == "load" else _member
            made[field] = [make(group, name, one, table) for name, one in getattr(table, group.table).items()]
    return Mechanism(
        **made,
        bodies=tuple(read_body(name, body, table) for name, body in table.body.items()),
        joints=tuple(_joint(name, entry) for name, entry in table.joint.items()),
        motors=tuple(Motor(name, joint) for name, joint in table.motor.items()),
        prescribed=_prescribed(table),
        end_effector=None if effector is None else EndEffector(**dict(effector)),
        assemblies=tuple(_assembly(name, one) for name, one in table.assembly.items()),
        modes=tuple(ActuationMode(name, tuple(motors)) for name, motors in table.mode.items()),
    )


def _joint(name: str, entry: list[str] | JointTable) -> Joint:
    points = entry if isinstance(entry, list) else entry.points
    a, b = (PointRef.parse(point, f"joint.{name}") for point in points)
    if isinstance(entry, list):
        return RevoluteJoint(name, a, b)
    # A field of another kind of joint would be read and not obeyed.
    kind = JOINT_KINDS[entry.type]
    given = {key: getattr(entry, key) for key in entry.model_fields_set - {"type", "points"}}
    own = {each.name: each for each in fields(kind)[3:]}
    for key, value in given.items():
        if key not in own:
            raise InputError(
                f"a {entry.type} joint has no {key}", field=f"joint.{name}.{key}", value=value, remedy="leave it out"
            )
    for key, each in own.items():
        if each.default is MISSING and key not in given:
            remedy = f"give {each.metadata.get('description', 'it')}"
            raise InputError("is missing", field=f"joint.{name}.{key}", remedy=remedy)
    return kind(name, a, b, **given)


def _prescribed(table: ModelTable) -> tuple[PrescribedAngle, ...]:
    parameters = evaluate_parameters(table.parameters)
    made = []
    for name, entry in table.prescribed.items():
        _check_quantity(name, entry, table.joint.get(entry.joint))
        try:
            law = read_law(entry, parameters, table.study.duration)
        except InputError as error:
            raise error.within(f"prescribed.{name}") from None
        made.append(PrescribedAngle(name, entry.joint, law))
    return tuple(made)


def _check_quantity(name: str, entry: PrescribedTable, joint: list[str] | JointTable | None) -> None:
    """A joint that turns has an angle, one that slides a displacement."""
    kind = joint.type if isinstance(joint, JointTable) else "revolute"
    wrong, right = ("angle", "displacement") if JOINT_KINDS[kind].slides else ("displacement", "angle")
    if joint is not None and wrong in quantities(entry):
        raise InputError(
            f"a {kind} joint has no {wrong}", field=f"prescribed.{name}.{wrong}", value=entry.joint,
            remedy=f"give its {right}",
        )  # fmt: skip


def _assembly(name: str, entry: AssemblyTable) -> Assembly:
    points: Any = entry.points
    return Assembly(name, entry.angles, points)


def _load(_: Group, name: str, entry: Any, table: ModelTable) -> Load:
    """A load from its table."""
    kind = {"force": PointForce, "torque": AppliedTorque}[entry.type]
    try:
        given = read_components(entry, entry.type, evaluate_parameters(table.parameters), table.study.duration)
    except InputError as error:
        raise error.within(f"load.{name}") from None
    return kind(name, entry.point, *(given if entry.type == "torque" else (given,)))


def read_torques(table: ModelTable) -> dict[str, InTime]:
    """Torques of motors that the study gives.

    Raises
    ------
    InputError
        A law that makes no sense.
    """
    parameters, torques = evaluate_parameters(table.parameters), {}
    for name, given in table.study.torques.items():
        place, whole = f"study.torques.{name}", isinstance(given, TorqueTable)
        entry = given if whole else TorqueTable.model_construct(torque=given)
        try:
            (torques[name],) = read_components(entry, "torque", parameters, table.study.duration)
        except InputError as error:
            # An expression alone stands where the table would.
            raise (error.within(place) if whole else error.at(place)) from None
    return torques


def _member(group: Group, name: str, entry: Any, _: ModelTable) -> Any:
    """A member of a group from its table."""
    said = dict(entry)
    kinds = {getattr(kind, "kind", None): kind for kind in group.kinds}
    kind = kinds[said.pop("type")] if "type" in said else group.kinds[0]
    points = [PointRef.parse(point, f"{group.table}.{name}.points") for point in said.pop("points", ())]
    return kind(name, *points, *said.pop("joints", ()), **said)


def read_path(table: PathTable) -> Path:
    """A path from its table.

    Raises
    ------
    InputError
        Numbers that make no path.
    """
    return PATHS[table.type](**{name: value for name, value in table if name != "type"})
