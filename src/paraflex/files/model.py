"""Model: the mechanism of a file, with its named paths and the defaults of its study."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any

from paraflex.arguments import CheckedFields, checked_arguments, named_in_errors
from paraflex.control.laws.described import NONE, ControllerDescription, check_together
from paraflex.control.shaping.shaped import shape_torques
from paraflex.equilibria.conditions import StaticsDefaults, conditions
from paraflex.errors import InputError, renamed, suggestion, within
from paraflex.findings import warn_of
from paraflex.formatting import checked_units
from paraflex.late import save_file
from paraflex.mechanism import ActuationMode, Mechanism, Start, parse_mode, standing
from paraflex.mechanism.quantities import known
from paraflex.paths import Path
from paraflex.tracking import Ending, TrackingTask, plan_tracking
from paraflex.validity import implausible_numbers
from paraflex.writing import write_text
from .controllers import read_controllers
from .field_values import inexpressible
from .generators import generated_text, generator_names, is_generated
from .library import library_file, library_names
from .mechanism import read_mechanism, read_path, read_paths, read_shaper, read_torques
from .merge import merged, same
from .overlay import plain, with_values
from .read import exists, naming, parse_toml, read_text, read_toml, validate
from .rows import with_names, with_rows
from .schema import ModelTable, PathFile
from .start import read_start
from .study import StudyDefaults, check_study
from .tables import model_tables


@named_in_errors("a model", "the model that paraflex.load reads")
@dataclass(frozen=True)
class Model(CheckedFields):
    """Model: content of a model file, read from one or built in Python.

    Attributes
    ----------
    mechanism : Mechanism
        Mechanism of the model.
    paths : mapping of str to Path
        Paths by name.
    study : StudyDefaults
        Default settings of runs.
    source : str
        File from which the model was read, or its library name; empty for a model built in Python.
    parameters : mapping
        Content of the file as read, for provenance.
    start : Start or None
        Deflection and velocity at the start of a run without a path; None for an undeformed start at rest.
    text : str
        Text of the file, whose comments `save` preserves.
    settings : mapping
        Values by field with which `load` has replaced those of the file.
    statics : StaticsDefaults
        Default settings of `paraflex.statics`.
    controllers : mapping of str to ControllerDescription
        Controllers available to runs, by name; see `acting`.
    """

    mechanism: Mechanism
    paths: Mapping[str, Path] = field(default_factory=dict)
    study: StudyDefaults = field(default_factory=StudyDefaults)
    source: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)
    start: Start | None = None
    text: str = field(default="", repr=False, compare=False)
    settings: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)
    statics: StaticsDefaults = field(default_factory=StaticsDefaults)
    controllers: Mapping[str, ControllerDescription] = field(default_factory=dict)

    def _repr_html_(self) -> str:
        """Return the HTML representation shown in notebooks."""
        from paraflex.display import facts, page

        study = self.study
        rows = [
            ("paths", list(self.paths)),
            ("study: path", study.path or list(study.paths)),
            ("study: modes", list(study.modes)),
            ("study: duration [s]", study.duration),
        ]
        return page(f"Model {self.source or self.mechanism.name}", facts(rows), self.mechanism._repr_html_())

    @checked_arguments()
    def path(self, name: str | None = None) -> Path:
        """Return a path by name; by default that of the study, or else the first path.

        Raises
        ------
        InputError
            Unknown path, or model without paths.
        """
        return self.paths[self.path_name(name)]

    @checked_arguments()
    def path_name(self, name: str | None = None) -> str:
        """Return the name of a path: the given name, that of the study, or that of the first path; see `path`."""
        chosen = name or self.study.first_path or next(iter(self.paths), None)
        if chosen is None:
            raise InputError(
                "the model has no path, which plans and studies need",
                field="path",
                remedy="add a [path.NAME] table; a mechanism that prescribed motions or loads drive is varied by "
                "--set FIELD=VALUE of paraflex run, or pf.load(model, set={...}) and pf.simulate_motion in a loop",
                source=self.source,
            )
        if chosen not in self.paths:
            remedy = suggestion(chosen, list(self.paths))
            raise InputError("unknown path", field="path", value=chosen, remedy=remedy, source=self.source)
        return chosen

    @checked_arguments()
    def modes(self, names: Sequence[str] = ()) -> tuple[ActuationMode, ...]:
        """Return actuation modes by name; by default those of the study, else all of the mechanism (possibly none).

        Raises
        ------
        InputError
            Unknown mode.
        """
        chosen = names or self.study.modes or [mode.name for mode in self.mechanism.modes]
        return tuple(dict.fromkeys(parse_mode(self.mechanism, name) for name in chosen))

    @checked_arguments()
    def acting(self, names: Sequence[str] = ()) -> tuple[ControllerDescription, ...]:
        """Return controllers by name, by default those of the study; the single name "none" returns no controllers.

        Raises
        ------
        InputError
            Unknown controller, "none" together with other names, sample periods that are not multiples of the shortest
            one, or two laws that each give the whole torque.
        """
        chosen = list(dict.fromkeys(names or self.study.controllers))
        if chosen == [NONE]:
            return ()
        if NONE in chosen:
            raise InputError(
                "cannot be combined with others",
                field="controllers",
                value=NONE,
                remedy="give it alone, or leave it out",
            )
        for name in chosen:
            known(name, self.controllers, "controllers", "controller")
        found = tuple(self.controllers[name] for name in chosen)
        check_together(found)
        return found

    @checked_arguments()
    def duration(self, path: Path | str, chosen: float | None = None) -> float:
        """Return the duration of a run along a path, including the dwell [s].

        Parameters
        ----------
        path : Path or str
            Path, or its name.
        chosen : float, optional
            Duration [s], returned unchanged if given. By default the duration is that of the study for the study's
            path, or the first of its paths. For another path it is scaled so that the relative dwell is the same.
        """
        if chosen is not None:
            return chosen
        followed, own = self.path(path) if isinstance(path, str) else path, self.paths.get(self.study.first_path or "")
        if self.study.duration is None or own is None:
            return self.driven_for(followed)
        if followed is own:
            return self.study.duration
        return self.driven_for(followed) * self.study.duration / self.driven_for(own)

    @checked_arguments()
    def driven_for(self, path: Path) -> float:
        """Return the time during which the motors drive [s]: the duration of a path plus that of the study's shaper."""
        return path.duration + (0.0 if self.study.shaper is None else self.study.shaper.duration)

    @checked_arguments()
    def plan(
        self,
        path: Path | str | None = None,
        *,
        mechanism: Mechanism | None = None,
        duration: float | None = None,
        samples: int | None = None,
        assembly: str | None = None,
        orientation: float | None = None,
        after: Ending | str | None = None,
        warning: bool = True,
    ) -> TrackingTask:
        """Plan a run along a path; arguments that are not given are taken from the model's [study].

        If the study has a shaper, the torques are shaped; see `shape_torques`.

        Parameters
        ----------
        path : Path or str, optional
            Path, or the name of one of the model's paths.
        mechanism : Mechanism, optional
            Variant of the model's mechanism, such as a rigid one or one with another geometry.
        duration, samples, assembly, orientation, after, warning
            See `tracking.plan_tracking`.

        Raises
        ------
        InputError, AssemblyError, UnreachablePathError
            See `tracking.plan_tracking`; InputError also if the model has a [start].
        """
        self.check_start()
        followed = path if isinstance(path, Path) else self.path(path)
        study = self.study.filled(samples=samples, assembly=assembly, orientation=orientation, after=after)
        task = plan_tracking(
            self.mechanism if mechanism is None else mechanism,
            followed,
            duration=self.duration(followed, duration),
            samples=study.samples,
            assembly=study.assembly,
            orientation=study.orientation,
            after=study.after,
            warning=warning,
        )
        return task if study.shaper is None else shape_torques(task, study.shaper)

    def check_start(self) -> None:
        """Check that the model has no [start], which a run along a path does not allow.

        Raises
        ------
        InputError
            Model with a [start].
        """
        if self.start is not None:
            raise InputError(
                "a path says where and how the mechanism starts", field="start", source=self.source,
                remedy="drop the [start] table, or run without a path",
            )  # fmt: skip

    @checked_arguments()
    def save(self, path: str | FilePath) -> None:
        """Write a model file from which `load` reads the same mechanism, paths, study and start.

        A model read from a file is written as that file with the differences in place: comments, order and expressions
        are preserved, and new entries are added. The file is written completely or not at all.

        Parameters
        ----------
        path : str or Path
            File to write; an existing file is replaced.

        Raises
        ------
        InputError
            Member that cannot be expressed in a file, such as a profile given by Python functions.
        OutputError
            File that cannot be written.
        """
        from .document import document_text

        path = FilePath(path)
        data = with_names(_data(self), self.text, path.parent)
        write_text(path, document_text(data, self.text), remedy="choose another file")


@save_file.register(Mechanism)
def _save_mechanism(mechanism: Mechanism, path: str | FilePath) -> None:
    Model(mechanism).save(path)


@checked_arguments(model="give a model, the name or the file of one, or a mechanism")
def plan(
    model: Model | Mechanism | str,
    path: Path | str | None = None,
    *,
    duration: float | None = None,
    samples: int | None = None,
    assembly: str | None = None,
    orientation: float | None = None,
    after: Ending | str | None = None,
    warning: bool = True,
) -> TrackingTask:
    """Plan a run of the end-effector along a path: joint motion and required motor torques.

    Parameters
    ----------
    model : Model, Mechanism or str
        Model, or its name or file, whose [study] supplies arguments that are not given; or a mechanism.
    path, duration, samples, assembly, orientation, after, warning
        See `Model.plan` and `tracking.plan_tracking`.

    Raises
    ------
    InputError, AssemblyError, UnreachablePathError
        See `Model.plan` and `tracking.plan_tracking`.
    """
    settings = {
        "duration": duration, "samples": samples, "assembly": assembly, "orientation": orientation, "after": after,
        "warning": warning,
    }  # fmt: skip
    if isinstance(model, Mechanism):
        given = {name: value for name, value in settings.items() if value is not None}
        return plan_tracking(model, path, **given)  # type: ignore[arg-type]  # refused where it is no path
    return (load(model) if isinstance(model, str) else model).plan(path, **settings)


@checked_arguments(name_or_file="give a name of library_names(), or a file")
def load(name_or_file: str | FilePath, *, set: Mapping[str, Any] | None = None) -> Model:
    """Read a model from the library or from a TOML file; each implausible number issues a `ModelWarning`.

    Parameters
    ----------
    name_or_file : str or Path
        Name of `library_names()`, name of a generated mechanism ("four_bars:3"), or file.
    set : mapping of str to Any, optional
        Values by field that replace those of the file: `{"body.link1.length": 0.3, "section.bar.width": "80 mm"}`. The
        table may be omitted if the name is unique: "link1.length".

    Returns
    -------
    Model
        Model that was read.

    Raises
    ------
    InputError
        Unknown name, unreadable file, or invalid entry. The error names file, field, value and remedy.
    """
    model = read_model(name_or_file, set or {})
    warn_of(implausible_numbers(model.mechanism, model.study.duration))
    return model


def read_model(name_or_file: str | FilePath | Model | Mechanism, settings: Mapping[str, Any] | None = None) -> Model:
    """Read a model as `load` does, without its warnings; one built in Python as if it had been saved."""
    text, source, folder = _read(name_or_file)
    values = {name: plain(value) for name, value in (settings or {}).items()}
    return replace(model_from(_parsed(text, source, folder, values), source, text), settings=values)


@checked_arguments(name_or_file="give a name of library_names(), or a file")
def load_data(name_or_file: str | FilePath) -> tuple[dict[str, Any], str]:
    """Return the data of a model file, parsed but not validated, and the name of its source; see `load`.

    Raises
    ------
    InputError
        Unknown name, unreadable file, or unreadable file to which the model refers.
    """
    text, source, folder = _read(name_or_file)
    return _parsed(text, source, folder, {}), source


@checked_arguments()
def model_from(data: dict[str, Any], source: str, text: str = "") -> Model:
    """Build a model from parsed data; errors are those of `load`.

    Parameters
    ----------
    data : dict
        Data as returned by `load_data`; not modified.
    source : str
        Name of the source, for errors.
    text : str
        Text of the file, whose comments `Model.save` preserves.
    """
    with naming(source):
        return _model(validate(ModelTable, data, source), data, source, text)


def model_of_text(text: str, source: str, folder: FilePath) -> Model:
    """Build a model from the text of a file that need not exist; file names in it refer to a folder.

    Raises
    ------
    InputError
        See `load`.
    """
    return model_from(_parsed(text, source, folder, {}), source, text)


def text_of_model(model: Model | Mechanism) -> str:
    """Return the text of the file from which `load` reads the same model; see `Model.save`."""
    return _read(model)[0]


def _parsed(text: str, source: str, folder: FilePath, settings: Mapping[str, Any]) -> dict[str, Any]:
    with naming(source):
        return with_rows(with_values(parse_toml(text), settings), folder, list(settings.values()))


def _read(name_or_file: str | FilePath | Model | Mechanism) -> tuple[str, str, FilePath]:
    """Read a model's text; return it with the name of its source and the folder to which file names in it refer."""
    if isinstance(name_or_file, Model | Mechanism):
        from .document import document_text

        model = Model(name_or_file) if isinstance(name_or_file, Mechanism) else name_or_file
        return document_text(_data(model), model.text), model.source or model.mechanism.name, FilePath()
    text = str(name_or_file)
    if is_generated(text):
        return generated_text(text), text, FilePath()
    if text in library_names():
        path, source = FilePath(str(library_file(text))), f"{text}.toml"
    else:
        path, source = FilePath(name_or_file), text
        if path.suffix != ".toml" and not exists(path):
            raise InputError(
                "neither a library mechanism nor a file",
                field="mechanism",
                value=text,
                remedy=suggestion(text, [*library_names(), *generator_names()]),
            )
    with naming(source):
        return read_text(path), source, path.parent


@checked_arguments()
def load_path(file: str | FilePath) -> Path:
    """Read a path from a TOML file with one [path] table.

    Raises
    ------
    InputError
        Unreadable file or invalid entry; see `load`.
    """
    source = str(file)
    with naming(source):
        data = with_rows(read_toml(FilePath(file)), FilePath(file).parent)
        table = validate(PathFile, data, source)
        with within("path"):
            return read_path(table.path)


def _model(table: ModelTable, data: dict[str, Any], source: str, text: str) -> Model:
    checked_units(table.units.items())
    mechanism = read_mechanism(table)
    paths = read_paths(table.path)
    torques = read_torques(table)
    with within("study"):
        shaper = None if table.study.shaper is None else read_shaper(table.study.shaper)
    study = StudyDefaults(**_with_tuples(table.study) | {"torques": torques, "shaper": shaper})
    check_study(mechanism, paths, study)
    turns = mechanism.end_effector is not None and "angle" in mechanism.end_effector.coordinates
    if "orientation" in table.study.model_fields_set and not turns:
        raise InputError(
            "the angle is not a task coordinate", field="study.orientation", value=table.study.orientation,
            remedy='name "angle" among the coordinates of [end_effector], or leave it out',
        )  # fmt: skip
    start = None if table.start is None else read_start(table.start, mechanism)
    model = Model(
        mechanism=standing(mechanism, study.assembly, start), paths=paths, study=study, source=source, parameters=data,
        start=start, text=text,
        statics=_statics(table, mechanism), controllers=read_controllers(table, mechanism),
    )  # fmt: skip
    with renamed("study.controllers", only="controllers"):
        model.acting()
    return model


def _with_tuples(table: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Return the fields of a table with tuples in place of lists."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in table}


def _statics(table: ModelTable, mechanism: Mechanism) -> StaticsDefaults:
    found = StaticsDefaults(**_with_tuples(table.statics))
    with within("statics"):
        conditions(mechanism, found)
    return found


def _data(model: Model) -> dict[str, Any]:
    """Return the data of a file that describes a model, based on the data from which the model was read, if any."""
    data = dict(model.parameters)
    if not data:
        return _checked(model, model_tables(model))
    if "payload" in data and _carrier(model_from(data, model.source)) != _carrier(model):
        # The numbers of the body are written, and they include the payload already.
        data.pop("payload")
    for each in (False, True, True):
        found = model_from(data, model.source)
        now, target = (model_tables(one, file=data, before=found.mechanism, each=each) for one in (found, model))
        if same(now, target):
            return data
        data = merged(data, now, target)
    return _checked(model, data)


def _carrier(model: Model) -> tuple[Any, ...]:
    """Return the end-effector, and the body that carries it."""
    effector = model.mechanism.end_effector
    return effector, [body for body in model.mechanism.bodies if effector and body.name == effector.point.body]


def _checked(model: Model, data: dict[str, Any]) -> dict[str, Any]:
    """Return data after a check that they describe the model.

    Raises
    ------
    InputError
        Data that describe another model.
    """
    expected, found = (model_tables(one) for one in (model, model_from(data, model.source)))
    for key, value in expected.items():
        if not same(value, found.get(key)):
            raise inexpressible(key, value, "build it from parts that a file can hold")
    return data
