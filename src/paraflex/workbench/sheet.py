"""Sheet: the text of a model file that may still be incomplete, with its numbers and the poses that it describes."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import atan2, hypot, pi
from pathlib import Path
from typing import Any

from paraflex.dynamics import closure_of, reference_pose, standing_system
from paraflex.errors import InputError, NumericalError, suggestion
from paraflex.expressions.evaluate import evaluate as evaluate_text, evaluate_parameters, expressed_in
from paraflex.files.fields import leaves, value_at
from paraflex.files.model import Model, model_from
from paraflex.files.rows import with_rows
from paraflex.mechanism import Assembly, Joint, Mechanism, PointRef
from paraflex.mechanism.joints import GROUND
from paraflex.mechanism.masses import with_any_masses
from paraflex.mechanism.poses import Pose, approximate_poses, local_points, placed_poses
from .edits import with_item, with_table, with_value, without, written
from .spans import data_of

XY = tuple[float, float]
Action = Mapping[str, Any]


class Frame(Pose):
    """Pose of a body whose position is known."""

    @property
    def origin(self) -> XY:
        """Position of the frame's origin [m]."""
        assert self.position is not None
        return self.position


# Longest text that may name a file.
_NAME_LETTERS = 255
# Stands in for the bodies of a sheet without any, so that the rest of the file is read and checked.
_NO_BODY = {"body": {"none": {"type": "rigid", "points": {"none": [0.0, 0.0]}}}}


@dataclass(frozen=True)
class Sheet:
    """Text of a model file and the folder to which file names in it refer."""

    text: str
    folder: Path = Path()

    @cached_property
    def data(self) -> dict[str, Any]:
        """Parsed data of the text."""
        return data_of(self.text)

    @cached_property
    def model(self) -> Model:
        """Model of the text.

        Raises
        ------
        InputError
            See `paraflex.load`; a sheet without bodies, which cannot be loaded, is read as if it had one.
        """
        return _model(self.text, self.folder, _written_at(self.data, self.folder))

    @cached_property
    def problem(self) -> InputError | None:
        """Error with which the text cannot be read as a model."""
        try:
            _ = self.model
        except InputError as error:
            return error
        return None

    @property
    def mechanism(self) -> Mechanism | None:
        """Mechanism of the text; None while it cannot be read."""
        return None if self.problem else self.model.mechanism

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters of the file."""
        return evaluate_parameters(self.data.get("parameters", {}))

    def names(self, table: str) -> list[str]:
        """Return the names of the members of a table."""
        found = self.data.get(table, {})
        return list(found) if isinstance(found, dict) else []

    def number(self, place: Sequence[Any]) -> float:
        """Return the value of the number or expression at a place."""
        value, field = value_at(self.data, place), ".".join(map(str, place))
        if isinstance(value, str):
            with expressed_in(field, value):
                return evaluate_text(value, self.parameters)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError("not a number", field=field, value=value, remedy="set it in the text")
        return float(value)

    @property
    def shown(self) -> str:
        """Assembly that is drawn by default: that of the study, or the first."""
        chosen = value_at(self.data, ("study", "assembly"))
        return chosen if chosen in self.names("assembly") else next(iter(self.names("assembly")), "")

    @cached_property
    def _known_frames(self) -> dict[str, dict[str, Pose]]:
        return {}

    def frames(self, assembly: str) -> dict[str, Pose]:
        """Return the poses of the body frames in an assembly, loops closed where they can be."""
        if assembly not in self._known_frames:
            found = [one for one in self.mechanism.assemblies if one.name == assembly] if self.mechanism else []
            self._known_frames[assembly] = _frames(self.model.mechanism, found[0]) if found else {}
        return self._known_frames[assembly]

    @cached_property
    def locals(self) -> dict[str, Mapping[str, XY]]:
        """Points of each body in its frame [m]."""
        return {body.name: local_points(body) for body in self.mechanism.bodies} if self.mechanism else {}

    def place(self, ref: str, assembly: str) -> XY:
        """Return the position of a point in an assembly [m]."""
        body, _, point = ref.partition(".")
        if body == GROUND and point in self.names("ground"):
            return self.number(("ground", point, 0)), self.number(("ground", point, 1))
        if point not in self.locals.get(body, {}):
            raise self.unknown_point(ref)
        return self.frame(body, assembly).place_of(self.locals[body][point])

    def frame(self, body: str, assembly: str) -> "Frame":
        """Return the pose of a body in an assembly; an error if it is not known."""
        found = self.frames(assembly).get(body)
        if found is None or found.position is None:
            raise self.problem or InputError(
                "its place is not known", field=f"body.{body}", remedy="give its angle in an assembly"
            )
        return Frame(found.angle, found.position)

    def unknown_point(self, ref: str) -> InputError:
        """Return the error for a point that does not exist, or has no known place."""
        if self.problem:
            return self.problem
        return InputError("no point of a known place", field="point", value=ref, remedy=suggestion(ref, self.refs))

    @property
    def refs(self) -> list[str]:
        """All points of the ground and of bodies."""
        bodies = [f"{body}.{point}" for body, points in self.locals.items() for point in points]
        return [f"{GROUND}.{name}" for name in self.names("ground")] + bodies

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Joints of the mechanism."""
        return self.mechanism.joints if self.mechanism else ()

    def angle(self, body: str, assembly: str) -> float:
        """Return the angle of a body in an assembly [rad]; zero for the ground."""
        frame = self.frames(assembly).get(body)
        return 0.0 if frame is None else frame.angle

    def with_text(self, text: str) -> "Sheet":
        """Return the sheet of another text."""
        return replace(self, text=text)

    def put(self, place: Sequence[Any], value: Any) -> "Sheet":
        """Write a value at a place."""
        return self.with_text(with_value(self.text, place, written(value)))

    def append(self, place: Sequence[Any], value: Any) -> "Sheet":
        """Append an item to the list at a place."""
        return self.with_text(with_item(self.text, place, written(value)))

    def table(self, place: Sequence[str], table: Mapping[str, Any], *, exact: bool = False) -> "Sheet":
        """Add a table; its numbers are rounded to the digits of a drawing unless they are exact."""
        return self.with_text(with_table(self.text, place, table, exact=exact))

    def without(self, place: Sequence[Any]) -> "Sheet":
        """Remove the value or table at a place."""
        return self.with_text(without(self.text, place))

    def fresh(self, stem: str, table: str, taken: Iterable[str] = ()) -> str:
        """Return the first name of a stem and a number that a table does not have yet."""
        known = {*self.names(table), *taken}
        return next(name for number in range(1, len(known) + 2) if (name := f"{stem}{number}") not in known)

    def fresh_point(self, taken: Iterable[str] = ()) -> str:
        """Return the first letter that no point, joint or parameter has as its name; later ones have a number."""
        known = {ref.partition(".")[2] for ref in self.refs} | {*taken, *self.names("joint"), *self.names("parameters")}
        return next(name for name in _letters() if name not in known)

    def free_name(self, action: Mapping[str, Any], table: str, stem: str) -> str:
        """Return the name that an action asks for, if the table does not have it yet, or a fresh one."""
        name = action.get("name")
        if name is None:
            return self.fresh(stem, table) if stem not in ("drive",) or stem in self.names(table) else stem
        check_name(name, self.names(table), f"{table}.{name}")
        return name

    def unplaced(self) -> dict[str, set[str]]:
        """Return the bodies of each assembly whose places neither joints nor points determine."""
        found = self.mechanism
        return {one.name: _unplaced(found, one) for one in found.assemblies} if found else {}


# Sheet after an action, and what is selected on it then: "body.link1" or the like.
Done = tuple[Sheet, str]


@contextmanager
def refusals(sheet: Sheet, field: str) -> Iterator[None]:
    """Provide a context whose errors are all `InputError`: of what is asked for, or of the text if it is no model."""
    try:
        yield
    except InputError:
        raise
    except NumericalError as error:
        raise InputError(error.problem, field=field, remedy=error.remedy) from None
    except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:
        problem = f"cannot be done as given ({type(error).__name__}: {error})"
        raise sheet.problem or InputError(problem, field=field, remedy="check the names and numbers given") from error


@lru_cache(maxsize=4)
def _model(text: str, folder: Path, _: tuple[str, ...]) -> Model:
    """Return the model of a text and of files named in it as they were written last: an action reads two texts."""
    data = with_rows(data_of(text), folder)
    empty = not data.get("body")
    return model_from(
        {key: each for key, each in data.items() if key != "assembly"} | _NO_BODY if empty else data, "", text
    )


def _written_at(data: Any, folder: Path) -> tuple[str, ...]:
    """Return when the files were written that texts in data may name."""
    found = []
    for _, value in leaves(data):
        if isinstance(value, str) and "." in value and len(value) < _NAME_LETTERS:
            with suppress(OSError, ValueError):
                state = (folder / value).stat()
                found.append(f"{value} {state.st_mtime_ns} {state.st_size}")
    return tuple(found)


def check_name(name: Any, names: Iterable[str], field: str) -> None:
    """Check that a new name is a text that can stand in a reference and that is not taken."""
    if not isinstance(name, str) or not name or "." in name or not name.isprintable():
        raise InputError("not usable as a name", field=field, value=name, remedy="give letters, digits, _ and -")
    if name in names or name == GROUND:
        raise InputError("the name is taken", field=field, value=name, remedy="choose another")


def placed(before: Sheet, after: Sheet, frames: Mapping[str, Mapping[str, Pose]] | None = None) -> Sheet:
    """Add places of points to the assemblies for bodies that an edit has left without a determined place.

    Parameters
    ----------
    before, after : Sheet
        Sheet as it was, and as edited.
    frames : mapping, optional
        Poses of new bodies by assembly and name.
    """
    known = before.unplaced()
    for assembly, bodies in after.unplaced().items():
        for body in [name for name in after.locals if name in bodies - known.get(assembly, set())]:
            pose = (frames or {}).get(assembly, {}).get(body) or before.frames(assembly).get(body)
            point, local = next(iter(after.locals[body].items()), ("", (0.0, 0.0)))
            # A body that is placed may determine the place of the next one.
            if point and pose is not None and pose.position is not None and body in after.unplaced()[assembly]:
                after = after.put(("assembly", assembly, "points", f"{body}.{point}"), tidy(pose.place_of(local)))
    return after


def without_spare_places(sheet: Sheet, bodies: Iterable[str]) -> Sheet:
    """Remove places of points of bodies from the assemblies where joints determine them now."""
    for assembly in sheet.names("assembly"):
        for ref in list(value_at(sheet.data, ("assembly", assembly, "points")) or {}):
            if ref.partition(".")[0] in bodies:
                less = sheet.without(("assembly", assembly, "points", ref))
                if not less.problem and less.unplaced()[assembly] <= sheet.unplaced()[assembly]:
                    sheet = less
    return sheet


def near(angle: float, other: float) -> float:
    """Return an angle plus the whole turns that bring it nearest to another [rad]."""
    return angle + 2.0 * pi * round((other - angle) / (2.0 * pi))


def tidy(place: XY) -> list[float]:
    """Return a place without the rounding errors of coordinates that are zero."""
    return [x if abs(x) > 1e-6 else 0.0 for x in place]


def direction(start: XY, end: XY) -> float:
    """Return the angle of the line between two points [rad].

    Raises
    ------
    InputError
        The points coincide.
    """
    if hypot(end[0] - start[0], end[1] - start[1]) < 1e-9:
        raise InputError("two points in one place", field="points", value=list(start), remedy="choose places apart")
    return atan2(end[1] - start[1], end[0] - start[0])


def _frames(mechanism: Mechanism, assembly: Assembly) -> dict[str, Pose]:
    """Return the poses of all bodies: loops closed, or as given if that fails; empty if they are not determined."""
    try:
        system = standing_system(with_any_masses(mechanism).rigid(), assembly.name)
        closed = closure_of(system, assembly)
        q = reference_pose(system, assembly) if closed.state is None else closed.state.q
        at = {body.name: system.body(body.name) for body in mechanism.bodies}
        return {name: Pose(float(q[one.angle]), (float(q[one.position][0]), float(q[one.position][1])))
                for name, one in at.items()}  # fmt: skip
    except (InputError, NumericalError):
        try:
            return placed_poses(mechanism, assembly)
        except InputError:
            return {}


def _unplaced(mechanism: Mechanism, assembly: Assembly) -> set[str]:
    points = dict(assembly.points) | {PointRef(GROUND, name): place for name, place in mechanism.ground.items()}
    if not points:
        return {body.name for body in mechanism.bodies}
    poses = approximate_poses(mechanism, replace(assembly, points=points))
    return {name for name, pose in poses.items() if pose.position is None}


def _letters() -> Iterator[str]:
    letters = [chr(code) for code in range(ord("A"), ord("Z") + 1)]
    yield from letters
    number = 1
    while True:
        yield from (f"{letter}{number}" for letter in letters)
        number += 1
