"""A model: the mechanism of a file with its named paths and the study it proposes."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path as FilePath
from typing import Any

from paraflex.arguments import checked_arguments, given_as
from paraflex.errors import InputError, suggestion
from paraflex.fem import ReferenceCondition
from paraflex.files.bodies import assumed_modes_beam, damping, modal_body
from paraflex.files.expressions import evaluate_parameters
from paraflex.files.generators import generated_text, generator_names, is_generated
from paraflex.files.laws import quantities, read_law
from paraflex.files.library import library_file, library_names
from paraflex.files.read import naming, read_toml, validate
from paraflex.files.rows import with_rows
from paraflex.files.schema import (
    AssemblyTable,
    AssumedModesTable,
    BeamTable,
    CircleTable,
    ForceTable,
    GeneralSectionTable,
    JointTable,
    LinearSpringTable,
    LineTable,
    ModalTable,
    ModelTable,
    PathFile,
    PointsTable,
    PolygonTable,
    PrescribedTable,
    RigidTable,
    TorqueTable,
)
from paraflex.files.start import read_start
from paraflex.files.study import StudyDefaults, check_study
from paraflex.findings import warn_of
from paraflex.kinematics import Circle, Line, Path, PointPath, Polygon
from paraflex.mechanism import (
    ActuationMode,
    AppliedTorque,
    Assembly,
    AxisJoint,
    Body,
    Curvature,
    EndEffector,
    FlexibleBeam,
    Geometry,
    Joint,
    JointFriction,
    LinearSpring,
    Load,
    LumpedMass,
    Material,
    Mechanism,
    Motor,
    PointForce,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    Section,
    SlidingJoint,
    SlotJoint,
    Start,
    TorsionalDamper,
    TorsionalSpring,
    WeldJoint,
    parse_mode,
)
from paraflex.simulate import Ending, TrackingTask, plan_tracking
from paraflex.validity import doubtful_numbers


@given_as("a model", "the model that paraflex.load reads")
@dataclass(frozen=True)
class Model:
    """What a model file says.

    Attributes
    ----------
    mechanism : Mechanism
    paths : mapping of str to Path
    study : StudyDefaults
    source : str
        The file it came from, or the library name.
    parameters : mapping
        The file's content as read, for provenance.
    start : Start or None
        Deflection and velocity at the start of a run without a path; None for a start undeformed and at rest.
    """

    mechanism: Mechanism
    paths: Mapping[str, Path]
    study: StudyDefaults
    source: str
    parameters: Mapping[str, Any] = field(repr=False, compare=False)
    start: Start | None = None

    def _repr_html_(self) -> str:
        """In notebooks."""
        from paraflex.display import facts, page

        study = self.study
        told = [
            ("paths", list(self.paths)),
            ("study: path", study.path),
            ("study: modes", list(study.modes)),
            ("study: duration [s]", study.duration),
        ]
        return page(f"Model {self.source}", facts(told), self.mechanism._repr_html_())

    @checked_arguments()
    def path(self, name: str | None = None) -> Path:
        """A path by name, or the study's.

        Raises
        ------
        InputError
            There is none of that name.
        """
        return self.paths[self.path_name(name)]

    @checked_arguments()
    def path_name(self, name: str | None = None) -> str:
        """The name of a path: that given, the study's, or that of the first path; see `path`."""
        wanted = name or self.study.path or next(iter(self.paths), None)
        if wanted is None:
            raise InputError(
                "the model has no path", field="path", remedy="add a [path.NAME] table", source=self.source
            )
        if wanted not in self.paths:
            remedy = suggestion(wanted, list(self.paths))
            raise InputError("unknown path", field="path", value=wanted, remedy=remedy, source=self.source)
        return wanted

    @checked_arguments()
    def modes(self, names: Sequence[str] = ()) -> tuple[ActuationMode, ...]:
        """Actuation modes by name, else those of the study, else all of the mechanism; none where it has none.

        Raises
        ------
        InputError
            An unknown mode.
        """
        wanted = names or self.study.modes or [mode.name for mode in self.mechanism.modes]
        return tuple(dict.fromkeys(parse_mode(self.mechanism, name) for name in wanted))

    @checked_arguments()
    def duration(self, path: Path | str, chosen: float | None = None) -> float:
        """How long a run along a path takes, dwell included [s].

        As chosen; else the study's duration along its own path. Another path has another length, and the study's share
        of dwell.
        """
        if chosen is not None:
            return chosen
        followed, own = self.path(path) if isinstance(path, str) else path, self.paths.get(self.study.path or "")
        if self.study.duration is None or own is None:
            return followed.duration
        return self.study.duration if followed is own else followed.duration * self.study.duration / own.duration

    @checked_arguments()
    def plan(
        self,
        path: Path | str | None = None,
        *,
        mechanism: Mechanism | None = None,
        duration: float | None = None,
        samples: int | None = None,
        assembly: str | None = None,
        after: Ending | str | None = None,
        warning: bool = True,
    ) -> TrackingTask:
        """Plan a run along a path; what is not given is as the model's [study] has it.

        Parameters
        ----------
        path : Path or str, optional
            A path, or the name of one of the model's.
        mechanism : Mechanism, optional
            Another form of the model's own: rigid, or of another geometry.
        duration, samples, assembly, after, warning
            See `simulate.plan_tracking`.

        Raises
        ------
        InputError, AssemblyError, UnreachablePathError
            See there; or the model has a [start].
        """
        self.check_start()
        followed = path if isinstance(path, Path) else self.path(path)
        study = self.study.filled(samples=samples, assembly=assembly, after=after)
        return plan_tracking(
            self.mechanism if mechanism is None else mechanism,
            followed,
            duration=self.duration(followed, duration),
            samples=study.samples,
            assembly=study.assembly,
            orientation=study.orientation,
            after=study.after,
            warning=warning,
        )

    def check_start(self) -> None:
        """Check that a run along a path may start where the path says.

        Raises
        ------
        InputError
            The model has a [start] of its own.
        """
        if self.start is not None:
            raise InputError(
                "a path says where and how the mechanism starts", field="start", source=self.source,
                remedy="drop the [start] table, or run without a path",
            )  # fmt: skip


@checked_arguments(name_or_file="give a name of library_names(), or a file")
def load(name_or_file: str | FilePath) -> Model:
    """Read a model from the library or from a TOML file; numbers that are not plausible issue a `ModelWarning` each.

    Parameters
    ----------
    name_or_file : str or Path
        A name of `library_names()`, one with a number ("four_bars:3"), or a file.

    Returns
    -------
    Model

    Raises
    ------
    InputError
        Unknown name, unreadable file, or anything in it that does not fit: it names file, field, value and remedy.
    """
    model = model_from(*load_data(name_or_file))
    warn_of(doubtful_numbers(model.mechanism, model.study.duration))
    return model


@checked_arguments(name_or_file="give a name of library_names(), or a file")
def load_data(name_or_file: str | FilePath) -> tuple[dict[str, Any], str]:
    """What a model file says, parsed and not yet checked, and the name of its source; see `load` for the argument.

    Raises
    ------
    InputError
        Unknown name, unreadable file, or a file it names that cannot be read.
    """
    data, source, folder = _read(name_or_file)
    with naming(source):
        return with_rows(data, folder), source


@checked_arguments()
def model_from(data: dict[str, Any], source: str) -> Model:
    """The model that parsed data describe; see `load` for what is raised.

    Parameters
    ----------
    data : dict
        See `load_data`; left as it is.
    source : str
        Named in errors.
    """
    with naming(source):
        return _model(validate(ModelTable, data, source), data, source)


def _read(name_or_file: str | FilePath) -> tuple[dict[str, Any], str, FilePath]:
    """A model's data, the name of their source, and the folder that names of other files in them count from."""
    text = str(name_or_file)
    if is_generated(text):
        return tomllib.loads(generated_text(text)), text, FilePath()
    if text in library_names():
        path, source = FilePath(str(library_file(text))), f"{text}.toml"
    else:
        path, source = FilePath(name_or_file), text
        if not path.exists() and path.suffix != ".toml":
            raise InputError(
                "neither a library mechanism nor a file",
                field="mechanism",
                value=text,
                remedy=suggestion(text, [*library_names(), *generator_names()]),
            )
    return read_toml(path, source), source, path.parent


@checked_arguments()
def load_path(file: str | FilePath) -> Path:
    """Read a path from a TOML file with one [path] table.

    Raises
    ------
    InputError
        See `load`.
    """
    source = str(file)
    table = validate(PathFile, read_toml(FilePath(file), source), source)
    try:
        return _path(table.path)
    except InputError as error:
        raise error.within("path").in_file(source) from None


def _model(table: ModelTable, data: dict[str, Any], source: str) -> Model:
    mechanism = _mechanism(table)
    paths = {}
    for name, entry in table.path.items():
        try:
            paths[name] = _path(entry)
        except InputError as error:
            raise error.within(f"path.{name}") from error
    study = StudyDefaults(
        path=table.study.path,
        modes=tuple(table.study.modes),
        duration=table.study.duration,
        samples=table.study.samples,
        assembly=table.study.assembly,
        torques=table.study.torques,
        orientation=table.study.orientation or 0.0,
        method=table.study.method,
        tolerance=table.study.tolerance,
        step=table.study.step,
        after=table.study.after,
        error=table.study.error,
    )
    check_study(mechanism, paths, study)
    turns = mechanism.end_effector is not None and "angle" in mechanism.end_effector.coordinates
    if table.study.orientation is not None and not turns:
        raise InputError(
            "the angle is no task coordinate", field="study.orientation", value=table.study.orientation,
            remedy='name "angle" among the coordinates of [end_effector], or leave it out',
        )  # fmt: skip
    start = None if table.start is None else read_start(table.start, mechanism)
    return Model(mechanism=mechanism, paths=paths, study=study, source=source, parameters=data, start=start)


def _mechanism(table: ModelTable) -> Mechanism:
    effector = table.end_effector
    return Mechanism(
        name=table.name,
        description=table.description,
        geometry=Geometry(table.geometry),
        ground={name: (point[0], point[1]) for name, point in table.ground.items()},
        bodies=tuple(_body(name, body, table) for name, body in table.body.items()),
        joints=tuple(_joint(name, entry) for name, entry in table.joint.items()),
        motors=tuple(Motor(name, joint) for name, joint in table.motor.items()),
        prescribed=_prescribed(table),
        springs=tuple(
            TorsionalSpring(name, entry.joint, entry.stiffness, entry.rest) for name, entry in table.spring.items()
        ),
        dampers=tuple(TorsionalDamper(name, entry.joint, entry.coefficient) for name, entry in table.damper.items()),
        frictions=tuple(
            JointFriction(name, entry.joint, entry.limit, entry.speed) for name, entry in table.friction.items()
        ),
        linear_springs=tuple(_linear_spring(name, entry) for name, entry in table.linear_spring.items()),
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
    kind = _JOINTS[entry.type]
    given = {key: getattr(entry, key) for key in ("direction", "angle", "at_end") if key in entry.model_fields_set}
    for key, value in given.items():
        if key not in {field.name for field in fields(kind)}:
            raise InputError(
                f"a {entry.type} joint has no {key}", field=f"joint.{name}.{key}", value=value, remedy="leave it out"
            )
    return kind(name, a, b, **given)


_JOINTS = {
    "revolute": RevoluteJoint,
    "prismatic": PrismaticJoint,
    "slot": SlotJoint,
    "sliding": SlidingJoint,
    "weld": WeldJoint,
}


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
    slides = isinstance(joint, JointTable) and issubclass(_JOINTS[joint.type], AxisJoint)
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


def _load(name: str, load: ForceTable | TorqueTable) -> Load:
    point = PointRef.parse(load.point, f"load.{name}.point")
    if isinstance(load, TorqueTable):
        return AppliedTorque(name, point, load.torque)
    return PointForce(name, point, (load.force[0], load.force[1]))


def _body(name: str, body: BeamTable | RigidTable | AssumedModesTable | ModalTable, table: ModelTable) -> Body:
    if isinstance(body, RigidTable):
        return RigidBody(
            name=name,
            mass=body.mass,
            inertia=body.inertia,
            centre_of_mass=(body.centre_of_mass[0], body.centre_of_mass[1]),
            points={key: (point[0], point[1]) for key, point in body.points.items()},
        )
    if isinstance(body, ModalTable):
        return modal_body(name, body)
    lumps = []
    for point, lump_name in body.lumps.items():
        lump = _named(table.lump, lump_name, f"body.{name}.lumps.{point}", "lump")
        lumps.append(LumpedMass(point, lump.mass, lump.inertia))
    if isinstance(body, AssumedModesTable):
        section, material = _section(name, body.section, table), _material(name, body.material, table)
        return assumed_modes_beam(name, body, section, material, tuple(lumps))
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
        damping=damping(body.damping, name),
        flexible=body.flexible,
    )


def _section(body: str, name: str, table: ModelTable) -> Section:
    section = _named(table.section, name, f"body.{body}.section", "section")
    if isinstance(section, GeneralSectionTable):
        return Section(section.area, section.second_moment)
    _check_sides(section.width, section.thickness, f"section.{name}")
    return Section.rectangle(section.width, section.thickness)


def _material(body: str, name: str, table: ModelTable) -> Material:
    material = _named(table.material, name, f"body.{body}.material", "material")
    return Material(material.youngs_modulus, material.density)


def _check_sides(width: float, thickness: float, name: str) -> None:
    for side, value in (("width", width), ("thickness", thickness)):
        if not value > 0.0:
            raise InputError("must be positive", field=f"{name}.{side}", value=value, remedy="give it in m")


def _named(tables: Mapping[str, Any], name: str, where: str, kind: str) -> Any:
    if name not in tables:
        raise InputError(f"unknown {kind}", field=where, value=name, remedy=suggestion(name, list(tables)))
    return tables[name]


def _path(table: PolygonTable | LineTable | CircleTable | PointsTable) -> Path:
    if isinstance(table, PolygonTable):
        return Polygon(tuple((x, y) for x, y in table.corners), table.max_acceleration, table.closed)
    if isinstance(table, LineTable):
        return Line(table.start, table.end, table.max_acceleration)
    if isinstance(table, CircleTable):
        centre = (table.centre[0], table.centre[1])
        return Circle(centre, table.radius, table.max_acceleration, table.start_angle, table.sweep)
    return PointPath(tuple(map(tuple, table.points)), table.motion_time)
