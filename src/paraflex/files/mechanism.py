"""The mechanism of a model file from its tables, and its paths from theirs."""

from __future__ import annotations

from dataclasses import fields

from paraflex.errors import InputError
from paraflex.files.bodies import read_body
from paraflex.files.expressions import evaluate_parameters
from paraflex.files.laws import quantities, read_law
from paraflex.files.schema import (
    AssemblyTable,
    ForceTable,
    GearTable,
    JointTable,
    LinearSpringTable,
    ModelTable,
    PathTable,
    PrescribedTable,
    TorqueTable,
)
from paraflex.kinematics import Circle, Line, Path, PointPath, Polygon
from paraflex.mechanism import (
    ActuationMode,
    AppliedTorque,
    Assembly,
    AxisJoint,
    EndEffector,
    Gear,
    Geometry,
    Joint,
    JointFriction,
    LinearSpring,
    Load,
    Mechanism,
    Motor,
    PointForce,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    SlidingJoint,
    SlotJoint,
    TorsionalDamper,
    TorsionalSpring,
    WeldJoint,
)

# What joints and paths are called in files.
JOINTS = {
    "revolute": RevoluteJoint,
    "prismatic": PrismaticJoint,
    "slot": SlotJoint,
    "sliding": SlidingJoint,
    "weld": WeldJoint,
}
PATHS = {"polygon": Polygon, "line": Line, "circle": Circle, "points": PointPath}


def read_mechanism(table: ModelTable) -> Mechanism:
    """The mechanism of a model file.

    Raises
    ------
    InputError
        Anything in it that does not fit together.
    """
    effector = table.end_effector
    return Mechanism(
        name=table.name,
        description=table.description,
        geometry=Geometry(table.geometry),
        ground={name: (point[0], point[1]) for name, point in table.ground.items()},
        bodies=tuple(read_body(name, body, table) for name, body in table.body.items()),
        joints=tuple(_joint(name, entry) for name, entry in table.joint.items()),
        motors=tuple(Motor(name, joint) for name, joint in table.motor.items()),
        prescribed=_prescribed(table),
        springs=tuple(TorsionalSpring(name, **dict(entry)) for name, entry in table.spring.items()),
        dampers=tuple(TorsionalDamper(name, **dict(entry)) for name, entry in table.damper.items()),
        frictions=tuple(JointFriction(name, **dict(entry)) for name, entry in table.friction.items()),
        linear_springs=tuple(_linear_spring(name, entry) for name, entry in table.linear_spring.items()),
        gears=tuple(_gear(name, entry) for name, entry in table.gear.items()),
        loads=tuple(_load(name, load) for name, load in table.load.items()),
        gravity=(table.gravity[0], table.gravity[1]),
        end_effector=None
        if effector is None
        else EndEffector(PointRef.parse(effector.point, "end_effector.point"), tuple(effector.coordinates)),
        assemblies=tuple(_assembly(name, entry) for name, entry in table.assembly.items()),
        modes=tuple(ActuationMode(name, tuple(motors)) for name, motors in table.mode.items()),
    )


def _joint(name: str, entry: list[str] | JointTable) -> Joint:
    points = entry if isinstance(entry, list) else entry.points
    a, b = (PointRef.parse(point, f"joint.{name}") for point in points)
    if isinstance(entry, list):
        return RevoluteJoint(name, a, b)
    # A field of another kind of joint would be read and not obeyed.
    kind = JOINTS[entry.type]
    given = {key: getattr(entry, key) for key in ("direction", "angle", "at_end") if key in entry.model_fields_set}
    for key, value in given.items():
        if key not in {field.name for field in fields(kind)}:
            raise InputError(
                f"a {entry.type} joint has no {key}", field=f"joint.{name}.{key}", value=value, remedy="leave it out"
            )
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
    slides = isinstance(joint, JointTable) and issubclass(JOINTS[joint.type], AxisJoint)
    wrong, right = ("angle", "displacement") if slides else ("displacement", "angle")
    if joint is not None and wrong in quantities(entry):
        kind = joint.type if isinstance(joint, JointTable) else "revolute"
        raise InputError(
            f"a {kind} joint has no {wrong}", field=f"prescribed.{name}.{wrong}", value=entry.joint,
            remedy=f"give its {right}",
        )  # fmt: skip


def _assembly(name: str, entry: AssemblyTable) -> Assembly:
    field = f"assembly.{name}.points"
    points = {PointRef.parse(text, field): (place[0], place[1]) for text, place in entry.points.items()}
    return Assembly(name, entry.angles, points)


def _linear_spring(name: str, entry: LinearSpringTable) -> LinearSpring:
    a, b = (PointRef.parse(point, f"linear_spring.{name}.points") for point in entry.points)
    return LinearSpring(name, a, b, entry.stiffness, entry.length, entry.damping)


def _gear(name: str, entry: GearTable) -> Gear:
    first, second = entry.joints
    return Gear(name, first, second, entry.ratio, entry.phase)


def _load(name: str, load: ForceTable | TorqueTable) -> Load:
    point = PointRef.parse(load.point, f"load.{name}.point")
    if isinstance(load, TorqueTable):
        return AppliedTorque(name, point, load.torque)
    return PointForce(name, point, (load.force[0], load.force[1]))


def read_path(table: PathTable) -> Path:
    """A path from its table.

    Raises
    ------
    InputError
        Numbers that make no path.
    """
    return PATHS[table.type](**{name: value for name, value in table if name != "type"})
