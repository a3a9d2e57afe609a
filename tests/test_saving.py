"""Models written as files: what is read again is the same, and what a person wrote into a file stays."""

import tomllib
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

import paraflex as pf
from pages import blocks_of
from paraflex.arrays import whole
from paraflex.dynamics import build_system, start_state
from paraflex.errors import InputError, OutputError
from paraflex.fem import Polynomial, Sine
from paraflex.files import ExpressionProfile, StudyDefaults, library_names, library_text, load_data, model_from
from paraflex.files.document import document_text
from paraflex.mechanism import (
    Assembly,
    AssumedModesBeam,
    BodyValues,
    ConstantSpeed,
    Deflection,
    FlexibleBeam,
    LinearSpring,
    LossFactor,
    LumpedMass,
    Material,
    ModalBody,
    ModalDamping,
    ModalPoint,
    PiecewiseProfile,
    PointForce,
    PointRef,
    PrescribedAngle,
    RayleighDamping,
    RevoluteJoint,
    RigidBody,
    Round,
    SampledAngle,
    Section,
    SlidingJoint,
    Start,
    TabulatedProfile,
    TorsionalSpring,
)
from paraflex.motion import simulate_motion

NAMES = [*library_names(), "four_bars:2", "chain:3"]
SAID = ("mechanism", "paths", "study", "start")


def read(path):
    """A file's model, whatever is doubtful in it."""
    data, source = load_data(path)
    return model_from(data, source, Path(path).read_text(encoding="utf-8"))


def library(name):
    data, source = load_data(name)
    return model_from(data, source, library_text(name))


def saved(model, path):
    """What is read of a model that was saved, the same as it was."""
    model.save(path)
    again = read(path)
    for said in SAID:
        assert getattr(again, said) == getattr(model, said)
    return again


def lines(model, path):
    """Lines that saving a model adds to its file, and those it takes out."""
    saved(model, path)
    before, after = model.text.splitlines(), path.read_text(encoding="utf-8").splitlines()
    return [line for line in after if line not in before], [line for line in before if line not in after]


def figures(model):
    """Coordinates of a short run."""
    if model.paths:
        task = model.plan(duration=0.01, samples=3, warning=False)
        return task.simulate(model.modes()[0].name, warning=False).solution.q
    start = None
    if model.start is not None:
        start = start_state(build_system(model.mechanism), model.start, model.mechanism.assembly())
    return simulate_motion(model.mechanism, 0.1, samples=3, start=start).solution.q


@pytest.mark.parametrize("name", NAMES)
def test_what_nobody_changed_is_written_as_it_was(name, tmp_path):
    library(name).save(tmp_path / "same.toml")
    assert (tmp_path / "same.toml").read_text(encoding="utf-8") == library_text(name)


@pytest.mark.parametrize("name", NAMES)
def test_what_python_made_is_read_again_and_runs_alike(name, tmp_path):
    model = library(name)
    made = pf.Model(model.mechanism, model.paths, model.study, start=model.start)
    again = saved(made, tmp_path / "made.toml")
    assert "#" not in again.text
    np.testing.assert_array_equal(figures(again), figures(model))


def test_changed_numbers_stand_in_their_place(tmp_path):
    numbers, source = load_data("4rrr")
    numbers["section"]["bar"]["thickness"] = 0.006
    numbers["path"]["square"]["corners"][1][0] = -0.04
    model = model_from(numbers, source, library_text("4rrr"))
    new, old = lines(model, tmp_path / "thick.toml")
    assert new == [
        "thickness = 0.006  # m, in the plane of motion",
        "corners = [[0.030, 0.030], [-0.04, 0.030], [-0.030, -0.030], [0.030, -0.030]] # m",
    ]
    assert len(old) == 2


def test_a_changed_mechanism_changes_only_what_differs(tmp_path):
    model, file = library("raparm_i"), tmp_path / "changed.toml"
    new, old = lines(replace(model, mechanism=model.mechanism.with_geometry("second-order").rigid(["link1"])), file)
    assert (new, old) == (["flexible = false"], ['geometry = "linear"'])
    assert file.read_text().index("flexible = false") < file.read_text().index("[body.link2]")
    # What the file says of all beams at its top stays there while it holds for all.
    new, old = lines(replace(model, mechanism=model.mechanism.with_beams(reference="free")), file)
    assert (new, old) == (['reference = "free"'], ['reference = "cantilever"'])
    one = replace(model.mechanism.body("link1"), reference="pinned")
    new, old = lines(replace(model, mechanism=model.mechanism.with_bodies([one])), file)
    assert (new, old) == (['reference = "pinned"'], [])


def test_a_section_keeps_its_name_while_all_have_it(tmp_path):
    model, file = library("4rrr"), tmp_path / "thick.toml"
    thick = Section.rectangle(0.030, 0.005)
    bodies = [replace(body, section=thick) for body in model.mechanism.bodies if not isinstance(body, RigidBody)]
    new, _ = lines(replace(model, mechanism=model.mechanism.with_bodies(bodies)), file)
    assert new == ["thickness = 0.005  # m, in the plane of motion"]
    new, old = lines(replace(model, mechanism=model.mechanism.with_bodies(bodies[:1])), file)
    assert new == ["[section.section1]", "width = 0.03", "thickness = 0.005", 'section = "section1"']
    assert old == []


def test_an_expression_stays_as_long_as_its_value(tmp_path):
    model = library("4rrr")
    longer = replace(model.mechanism.body("distal1"), length=0.3, points={"B1": 0.0, "C1": 0.3})
    new, _ = lines(replace(model, mechanism=model.mechanism.with_bodies([longer])), tmp_path / "longer.toml")
    assert new == ["length = 0.3", "points = { B1 = 0.0, C1 = 0.3 }"]


def test_paths_study_and_modes(tmp_path):
    model, file = library("4rrr"), tmp_path / "other.toml"
    paths = {name: path for name, path in model.paths.items() if name != "line"} | {
        "arc": pf.Circle((0.0, 0.01), 0.02, 5.0)
    }
    study = replace(model.study, path="arc", duration=None, tolerance=1e-6)
    mechanism = replace(model.mechanism, modes=model.mechanism.modes[:4])
    study = replace(study, modes=study.modes[:4])
    changed = replace(model, mechanism=mechanism, paths=paths, study=study)
    text = saved(changed, file).text
    assert '# What "paraflex run" does unless told otherwise: the square, then a dwell.\n[study]' in text
    assert '[path.arc]\ntype = "circle"\ncentre = [0.0, 0.01]' in text
    comments = [line for line in model.text.splitlines() if line.startswith("#")]
    assert [line for line in text.splitlines() if line.startswith("#")] == comments
    start = Start(angular={"link": 3.0})
    pendulum = library("pendulum")
    body = pendulum.mechanism.bodies[0].name
    saved(replace(pendulum, start=replace(start, angular={body: 3.0})), file)


def test_members_of_another_order(tmp_path):
    """The order of bodies is that of the coordinates, and of paths the first is the default."""
    model = library("five_bar")
    turned = replace(model.mechanism, bodies=model.mechanism.bodies[::-1], joints=model.mechanism.joints[::-1])
    again = saved(replace(model, mechanism=turned, paths=dict([*model.paths.items()][::-1])), tmp_path / "turned.toml")
    assert list(again.paths) == list(model.paths)[::-1]
    assert again.mechanism.bodies == model.mechanism.bodies[::-1]


def test_tables_in_several_places(tmp_path):
    """TOML allows [body.a], [joint], [body.b]; values change in place, other tables are written anew."""
    text = library_text("five_bar")
    head, rest = text.split("[lump.", 1)
    text = head + "[lump." + rest + "\n[section.other]\nwidth = 0.02 # m\nthickness = 0.01\n"
    data = tomllib.loads(text)
    data["section"]["other"]["width"] = 0.03
    assert document_text(data, text) == text.replace("width = 0.02 # m", "width = 0.03 # m")
    data["section"]["third"] = {"width": 0.01, "thickness": 0.01}
    del data["section"]["other"]
    written = document_text(data, text)
    assert tomllib.loads(written) == data
    assert "# Copy this file and edit it" in written


def test_a_table_of_a_motion_keeps_its_file_where_that_lies_beside(tmp_path):
    (tmp_path / "motion.csv").write_text("t,angle\n0,0\n0.1,0.02\n0.2,0.1\n")
    text = library_text("pendulum")
    data = tomllib.loads(text)
    joint = next(iter(data["joint"]))
    file = tmp_path / "driven.toml"
    file.write_text(
        f'{text.split("[study]")[0]}\n[prescribed.drive]\njoint = "{joint}"\ntable = "motion.csv" # measured\n'
    )
    model = read(file)
    assert 'table = "motion.csv" # measured' in saved(model, tmp_path / "again.toml").text
    (tmp_path / "elsewhere").mkdir()
    assert (
        "table = [[0.0, 0.0], [0.1, 0.02], [0.2, 0.1]] # measured"
        in saved(model, tmp_path / "elsewhere" / "a.toml").text
    )


def everything():
    """A mechanism with a member of each kind that no file of the library has."""
    steel, bar = Material(2e11, 7800.0), Section.rectangle(0.01, 0.02)
    beam = FlexibleBeam(
        "beam", 1.0, (bar, Section(1e-4, 2e-9)), (steel, Material(7e10, np.float64(2700))),
        {"A": 0.0, "M": 0.4, "B": 1.0}, (2, 1),
        (LumpedMass("B", 1), LumpedMass("M", 0.1, 1e-4)), "free", "shared", 3, ModalDamping((0.01, 0.02)),
    )  # fmt: skip
    ritz = AssumedModesBeam(
        "ritz", 0.5, bar, steel, (Sine(1), Sine(2), Polynomial((0.0, 1.0, -1.0))), (Polynomial((0.0, 1.0)),),
        {"P": 0.0, "Q": 0.5}, (LumpedMass("Q", 0.2),), damping=LossFactor(0.01, 30.0),
    )  # fmt: skip
    modal = ModalBody(
        "modal", 1.0, (0.1, 0.0), 0.2, ((1.0,),), ((50.0,),), ((0.1,), (0.0,)), (0.0,), (0.3,), ((0.0,),),
        points={
            "E": ModalPoint((0.0, 0.0), ((0.0,), (0.0,)), (0.0,)),
            "D": ModalPoint((0.2, 0.0), ((0.0,), (1.0,)), (2.0,)),
        },
        damping=RayleighDamping(0.0, 1e-5),
    )  # fmt: skip
    bead = RigidBody("bead", 1, 1e-3, points={"C": (0, 0)})
    bead_at = PointRef("bead", "C")
    ground = {"O": (0.0, 0.0), "P": (2.0, 0.0), "E": (3.0, 0.0), "wall": (0.0, 5.0)}
    joints = (
        RevoluteJoint("A", PointRef("ground", "O"), PointRef("beam", "A")),
        SlidingJoint("wire", PointRef("beam", "A"), PointRef("bead", "C"), "warn"),
        RevoluteJoint("P", PointRef("ground", "P"), PointRef("ritz", "P")),
        RevoluteJoint("E", PointRef("ground", "E"), PointRef("modal", "E")),
    )
    expression = ExpressionProfile("a * sin(w * t)", {"a": 0.1, "w": 2.0, "of others": 3.0})
    pieces = PiecewiseProfile((ConstantSpeed(0.0, 0.0), ExpressionProfile("b * (t - 1)**3", {"b": 0.5})), (1.0,))
    return pf.Mechanism(
        'every "kind"', ground, (beam, ritz, modal, bead), joints,
        prescribed=(
            PrescribedAngle("turn", "P", expression), PrescribedAngle("slide", "wire", pieces),
            PrescribedAngle("swing", "E", TabulatedProfile((0.0, 0.1, 0.3), (0.0, 0.01, 0.05))),
        ),
        springs=(TorsionalSpring("s", "A", 2.0, 0.1),),
        linear_springs=(LinearSpring("l", PointRef("ground", "wall"), PointRef("bead", "C"), 10.0, 4.0, 0.1),),
        loads=(PointForce("f", PointRef("modal", "D"), (0.0, -1.0)),),
        assemblies=(Assembly("s", dict.fromkeys(("beam", "ritz", "modal", "bead"), 0.0), {bead_at: (0.5, 0.0)}),),
        description="größer",
    )  # fmt: skip


def test_every_kind_of_member(tmp_path):
    start = Start(
        {"beam": {"B": Deflection(transverse=0.01)}}, coordinates={"modal": BodyValues(0.0, 0.0, 0.1, (0.01,))},
        angular={"ritz": 1.0}, point={PointRef("bead", "C"): (0.0, 0.1)},
    )  # fmt: skip
    study = StudyDefaults(duration=0.2, samples=21, method="esdirk5", error="whole")
    again = saved(pf.Model(everything(), study=study, start=start), tmp_path / "every.toml")
    # And once more, from the file that was made.
    heavier = replace(again.mechanism.body("bead"), mass=2.0)
    changed = replace(again, mechanism=again.mechanism.with_bodies([heavier]))
    assert saved(changed, tmp_path / "heavier.toml").text == again.text.replace(
        'rigid"\nmass = 1\n', 'rigid"\nmass = 2.0\n'
    )


def test_a_piece_of_constant_speed_is_an_expression(tmp_path):
    profile = PiecewiseProfile((ConstantSpeed(0.5, 2.0), ExpressionProfile("0.5 + 2 * t")), (1.0,))
    pendulum = library("pendulum").mechanism
    joint = pendulum.joints[0].name
    driven = replace(pendulum, prescribed=(PrescribedAngle("drive", joint, profile),), loads=(), motors=(), modes=())
    pf.Model(driven).save(tmp_path / "pieces.toml")
    (again,) = read(tmp_path / "pieces.toml").mechanism.prescribed
    t = np.linspace(0.0, 2.0, 9)
    for one, other in zip(again.profile.evaluate(t), profile.evaluate(t), strict=True):
        np.testing.assert_array_equal(one, other)


def flat(t):
    return 0.0 * t


PROFILE = SampledAngle(flat, flat, flat)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"prescribed": (PrescribedAngle("turn", "P", PROFILE),)},
            r"^prescribed.turn.profile: a model file cannot express this profile \(got 'SampledAngle'\); give a",
        ),
        (
            {
                "prescribed": (
                    PrescribedAngle("turn", "P", PiecewiseProfile((PROFILE, ConstantSpeed(0.0, 0.0)), (1.0,))),
                )
            },
            "^prescribed.turn.profile: a model file cannot express this profile",
        ),
        (
            {
                "prescribed": (
                    PrescribedAngle("turn", "P", ExpressionProfile("a * t", {"a": 1.0})),
                    PrescribedAngle("swing", "E", ExpressionProfile("a * t", {"a": 2.0})),
                )
            },
            r'^prescribed.swing.profile: a file has one value of the parameter "a", but profiles have 1.0, 2.0',
        ),
        ({"name": "\ud800"}, "^name: not text in UTF-8"),
    ],
)
def test_what_a_file_cannot_say_is_refused(change, message, tmp_path):
    with pytest.raises(InputError, match=message):
        pf.Model(replace(everything(), **change)).save(tmp_path / "not.toml")
    assert not list(tmp_path.iterdir())


def test_bodies_that_a_file_cannot_say(tmp_path):
    ritz = everything().body("ritz")
    for body, message in [
        (
            replace(ritz, transverse=(Sine(2),)),
            r"^body.ritz.transverse: a model file cannot express this .*give the sines from 1",
        ),
        (replace(ritz, lumps=(*ritz.lumps, LumpedMass("Q", 1.0))), r"^body.ritz.lumps: .*combine the lumps"),
        (replace(ritz, section=Section(1.0, 1.0, Round(2.0))), r"^body.ritz.section: .*give Section.rectangle"),
    ]:
        with pytest.raises(InputError, match=message):
            pf.Model(everything().with_bodies([body])).save(tmp_path / "not.toml")
    assert not list(tmp_path.iterdir())


class Still:
    """A path of one's own."""

    duration, knots = 1.0, ()

    def evaluate(self, t):
        raise NotImplementedError


def test_paths_and_studies_that_a_file_cannot_say(tmp_path):
    robot = pf.library.raparm_i()
    with pytest.raises(
        InputError, match=r"^path.still: a model file cannot express this \(got 'Still'\); give a Polygon"
    ):
        pf.Model(robot, {"still": Still()}).save(tmp_path / "not.toml")
    with pytest.raises(InputError, match=r"^study.path: unknown path \(got 'square'\)"):
        pf.Model(robot, study=StudyDefaults(path="square")).save(tmp_path / "not.toml")
    with pytest.raises(InputError, match=r"^mechanism: not .*give a Mechanism"):
        pf.Model("4rrr")
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"cannot be written .*choose another file"):
        library("4rrr").save(tmp_path / "file" / "model.toml")


@pytest.mark.parametrize(("name", "count"), [("model-file.md", 2), ("model-file-tables.md", 2)])
def test_what_the_pages_on_model_files_show_runs(name, count, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = [block for block in blocks_of(Path(__file__).parents[1] / "docs" / name) if block.language == "python"]
    assert len(blocks) == count
    shown = {}
    for block in blocks:
        exec(block.text, shown)
    if name == "model-file-tables.md":
        assert set(shown["results"]) == {"square", "line"}
        return
    assert read("linear.toml").study.path == "line"
    assert len(read("chain.toml").mechanism.bodies) == 5


def test_an_expression_profile_names_what_is_wrong():
    with pytest.raises(InputError, match=r'^angle: unknown parameter "w" .*choose from v'):
        ExpressionProfile("sin(w * t)", {"v": 1.0})
    assert ExpressionProfile("v * t + pi", {"v": 1.0, "unused": 2.0}).evaluate(np.ones(1))[0] == 1.0 + pi


@pytest.mark.parametrize("name", NAMES)
def test_a_mechanism_saves_itself_and_is_read_as_an_equal_one(name, tmp_path):
    mechanism = library(name).mechanism
    mechanism.save(tmp_path / "model.toml")
    again = read(tmp_path / "model.toml").mechanism
    assert again == mechanism
    assert whole(again) == whole(mechanism)
