"""Whatever is wrong with a model file is said in one line that names file, field, value and remedy."""

import re

import pytest

from paraflex.errors import InputError
from paraflex.files import load
from paraflex.tracking import plan_tracking
from shell import paraflex

# A five-bar with everything in it that a file may say.
MODEL = """
name = "everything"
gravity = [0.0, -9.81]
[parameters]
base = 0.1
reach = "2.5 * base"
[section.bar]
width = 0.03
thickness = 0.005
[section.tube]
area = 1e-4
second_moment = 1e-9
[material.steel]
youngs_modulus = 210e9
density = 7850.0
[lump.pin]
mass = 0.1
inertia = 1e-5
[ground]
A1 = ["-base", 0.0]
A2 = ["base", 0.0]
Q = [0.0, 0.5]
[body.left]
type = "beam"
length = "reach"
section = "bar"
material = "steel"
points = { A = 0.0, B = "reach" }
elements = 2
lumps = { B = "pin" }
[body.left_arm]
type = "beam"
length = "reach"
section = "tube"
material = "steel"
points = { B = 0.0, C = "reach" }
[body.right]
type = "rigid"
mass = 0.4
inertia = 0.002
centre_of_mass = ["reach / 2", 0.0]
points = { A = [0.0, 0.0], B = ["reach", 0.0] }
[body.right_arm]
type = "rigid"
mass = 0.4
inertia = 0.002
centre_of_mass = ["reach / 2", 0.0]
points = { B = [0.0, 0.0], C = ["reach", 0.0] }
[joint]
A1 = ["ground.A1", "left.A"]
B1 = ["left.B", "left_arm.B"]
C = ["left_arm.C", "right_arm.C"]
B2 = ["right.B", "right_arm.B"]
A2 = ["ground.A2", "right.A"]
[motor]
m1 = "A1"
m2 = "A2"
[spring.coil]
joint = "B1"
stiffness = 2.0
rest = 0.1
[damper.oil]
joint = "B2"
coefficient = 0.1
[linear_spring.coil]
points = ["ground.Q", "right.B"]
stiffness = 10.0
length = 0.2
damping = 0.1
[load.push]
type = "force"
point = "left_arm.C"
force = [1.0, 0.0]
[load.twist]
type = "torque"
point = "right.A"
torque = 0.2
[end_effector]
point = "left_arm.C"
[assembly.outward]
left = 2.16
left_arm = 0.25
right = 0.98
right_arm = 2.89
[mode]
both = ["m1", "m2"]
[path.line]
type = "line"
start = [0.0, 0.3]
end = [0.03, 0.32]
max_acceleration = 5.0
[path.curve]
type = "points"
points = [[0.0, 0.3], [0.02, 0.31], [0.03, 0.3]]
motion_time = 0.3
[study]
path = "line"
modes = ["both"]
samples = 51
"""

# What is replaced, by what, what the message says after the file's name, and what its end has of the remedy.
FIELDS = [
    # Names
    ("gravity = [", "gravty = [", "gravty: unknown field (got [0.0, -9.81])", 'did you mean "gravity"?'),
    ("elements = 2", "element = 2", "body.left.element: unknown field (got 2)", 'did you mean "elements"?'),
    ("mass = 0.4", "weight = 0.4", "body.right.weight: unknown field (got 0.4)", "centre_of_mass, inertia, mass"),
    ("mass = 0.4\n", "", "body.right.mass: must be positive (got 0.0)", "in kg"),
    ("mass = 0.4", "center = [0, 0]\nmass = 0.4", "body.right.center: unknown field", 'did you mean "centre_of_mass"?'),
    ("[spring.coil]", "[sprng.coil]", "sprng: unknown field", 'did you mean "spring"?'),
    ("stiffness = 2.0", "stifness = 2.0", "spring.coil.stifness: unknown field", 'did you mean "stiffness"?'),
    ("second_moment = 1e-9", "second_momnt = 1e-9", "section.tube.second_momnt: unknown field", "second_moment"),
    ("samples = 51", "sampels = 51", "study.sampels: unknown field (got 51)", 'did you mean "samples"?'),
    ('name = "everything"', "", "name: is missing", "give a name for the mechanism"),
    # Types
    ('name = "everything"', "name = 3", "name: should be a valid string (got 3)", "give a name"),
    ("gravity = [0.0, -9.81]", "gravity = 9.81", "gravity: should be a valid list (got 9.81)", "give [x, y]"),
    ("gravity = [0.0, -9.81]", "gravity = [0.0, 0.0, -9.81]", "gravity: list should have at most 2 items", "[x, y]"),
    ("elements = 2", 'elements = "2"', "body.left.elements: should be a valid integer (got '2')", "elements per span"),
    ('A1 = ["ground.A1", "left.A"]', 'A1 = "left.A"', "joint.A1: should be a valid list (got 'left.A')", "body.point"),
    ('section = "bar"', "section = 1", "body.left.section: should be a valid string (got 1)", "[section.NAME]"),
    ('type = "rigid"', 'type = "solid"', "body.right.type: unknown type (got 'solid')", '"rigid"'),
    ('m1 = "A1"', 'm1 = ["A1"]', "motor.m1: should be a valid string (got ['A1'])", "the joint of each motor"),
    ("[parameters]\n", "[[parameters]]\n", "parameters: should be a table", "numbers by name"),
    # Numbers
    ("mass = 0.4", "mass = nan", "body.right.mass: should be a finite number (got nan)", "in kg"),
    ("inertia = 0.002", "inertia = inf", "body.right.inertia: should be a finite number (got inf)", "in kg m^2"),
    ("A2 = [\"base\", 0.0]", "A2 = [-inf, 0.0]", "ground.A2.0: should be a finite number (got -inf)", "in m"),
    ("mass = 0.4", "mass = 0.0", "body.right.mass: must be positive (got 0.0)", "in kg"),
    ("mass = 0.4", "mass = -0.4", "body.right.mass: must be positive (got -0.4)", "in kg"),
    ("inertia = 0.002", "inertia = 0", "body.right.inertia: must be positive (got 0.0)", "in kg m^2"),
    ('length = "reach"', "length = 0.0", "body.left.length: must be positive (got 0.0)", "in m"),
    ('length = "reach"', "length = -1.0", "body.left.length: must be positive (got -1.0)", "in m"),
    ("area = 1e-4", "area = -1e-4", "body.left_arm.section.area: must be positive (got -0.0001)", "in m^2"),
    ("youngs_modulus = 210e9", "youngs_modulus = 0", "material.steel.youngs_modulus: must be positive", "in Pa"),
    ("mass = 0.1\n", "mass = -0.1\n", "body.left.lumps.B.mass: must not be negative (got -0.1)", "in kg"),
    ("stiffness = 2.0", "stiffness = -2.0", "spring.coil.stiffness: must not be negative (got -2.0)", "in N m/rad"),
    ("coefficient = 0.1", "coefficient = 0", "damper.oil.coefficient: must be positive (got 0.0)", "in N m s/rad"),
    ("damping = 0.1", "damping = -0.1", "linear_spring.coil.damping: must not be negative (got -0.1)", "in N s/m"),
    ("torque = 0.2", "torque = nan", "load.twist.torque: not a finite number (got nan)", "in N m"),
    ("mass = 0.4", "mass = " + "9" * 400, "body.right.mass: should be a valid number (got 999", "in kg"),
    ("base = 0.1", "base = " + "9" * 400, "parameters.base: too large a number", "digits"),
    ("samples = 51", "samples = 1", "study.samples: too few samples (got 1)", "at least 2"),
    ("motion_time = 0.3", "motion_time = 0", "path.curve.motion_time: must be positive (got 0.0)", "in seconds"),
    # Points of bodies
    ('B = "reach" }\nelements', "B = 0.3 }\nelements", "body.left.points.B: the point lies beyond", "0.25 m"),
    ('B = "reach" }\nelements', "B = -0.1 }\nelements", "body.left.points.B: the point lies beyond", "between 0 and"),
    ('lumps = { B = "pin" }', 'lumps = { Z = "pin" }', "body.left.lumps: a lumped mass at an unknown point (got 'Z')",
     "A, B"),
    # Expressions
    ('reach = "2.5 * base"', 'reach = "2.5 * bose"', 'parameters.reach: unknown parameter "bose"', '"base"?'),
    ('reach = "2.5 * base"', 'reach = "2.5 *"', "parameters.reach: neither a number nor an expression", "like"),
    ('reach = "2.5 * base"', 'reach = "reach"', "parameters.reach: a cycle of parameters, reach -> reach", "a number"),
    ("base = 0.1", 'base = "reach / 2.5"', "parameters.base: a cycle of parameters, base -> reach -> base", "number"),
    ('reach = "2.5 * base"', 'reach = "9**9**9"', "parameters.reach: too large a number (got '9**9**9')", "check"),
    ('reach = "2.5 * base"', 'reach = "base.real"', "parameters.reach: only numbers, parameters,", "elsewhere"),
    ('reach = "2.5 * base"', 'reach = "(lambda: 1)()"', "parameters.reach: only numbers, parameters,", "elsewhere"),
    ('reach = "2.5 * base"', 'reach = "[x for x in (1,)]"', "parameters.reach: only numbers, parameters,", "elsewhere"),
    ('length = "reach"', "length = \"__import__('os')\"", "body.left.length: only numbers, parameters", "length in m"),
    ('length = "reach"', 'length = "exec(1)"', 'body.left.length: unknown function "exec"', "the length in m; "),
    ('length = "reach"', 'length = "reach / (base - 0.1)"', "body.left.length: a division by zero", "check the param"),
    ('length = "reach"', 'length = ""', "body.left.length: neither a number nor an expression (got '')", "in m"),
    # Names of others
    ('m1 = "A1"', 'm1 = "A3"', "motor.m1.joint: unknown joint (got 'A3')", "A1"),
    ('joint = "B1"', 'joint = "B9"', "spring.coil.joint: unknown joint (got 'B9')", "B"),
    ('both = ["m1", "m2"]', 'both = ["m1", "m3"]', "mode.both: unknown motor (got 'm3')", "m"),
    ('modes = ["both"]', 'modes = ["all"]', "study.modes: not an actuation mode (got 'all')", "2 motors (m1, m2)"),
    ('modes = ["both"]', 'modes = ["+++"]', "study.modes: not an actuation mode (got '+++')", "2 motors"),
    ('modes = ["both"]', 'modes = ["m1,m1"]', "study.modes: a motor is named twice (got 'm1,m1')", "once"),
    ("ground.Q", "ground.P", "linear_spring.coil.points: unknown point (got 'ground.P')", "Q"),
    ('point = "right.A"', 'point = "ground.Q"', "load.twist.point", "body"),
    ('"left_arm.C"\n[assembly', '"ground.Q"\n[assembly', "end_effector.point: the end-effector is a", "body's"),
    ('["left.B", "left_arm.B"]', '["left.B", "left.A"]', "joint.B1: a joint needs two different bodies", "other"),
    ('["left.B", "left_arm.B"]', '["left.B", "left_arm"]', "joint.B1: not a point (got 'left_arm')", "body.point"),
    ("[body.right_arm]", "[body.right]", "body.right: the table [body.right] appears twice", "leave one"),
    ('B1 = ["left.B"', 'A1 = ["left.B"', "file: not valid TOML: cannot overwrite a value", "only once"),
    ('B1 = ["left.B"', "B1 = [left.B", "file: not valid TOML: invalid value", "put names and expressions in quotes"),
    ("right_arm = 2.89", "right_arm = 2 * pi", "file: not valid TOML: ", "put names and expressions in quotes"),
    ("right_arm = 2.89", "right_arm = 2,89", "file: not valid TOML: ", "write decimals with a point"),
    (
        '["left.B", "left_arm.B"]', '["left.B", "left_arm.B"',
        "file: not valid TOML: unclosed array (at line 52, column 1), opened in line 51", "close it there",
    ),
    ("[study]", "[study]\ngravity = [0, 1]", "study.gravity: unknown field", "at the top of the file, above the first"),
    ("[parameters]", "[parameters]\ngravity = [0, 1]", "parameters.gravity: neither", "at the top of the file, above"),
    ("[body.right_arm]", '[body."right.arm"]', "body: not usable as a name (got 'right.arm')", "avoid dots"),
    ("[body.right_arm]", "[body.ground]", "body: not usable as a name (got 'ground')", "avoid dots"),
    ("right_arm = 2.89", "right_harm = 2.89", "assembly.outward: unknown body (got 'right_harm')", '"right_arm"?'),
    ("right_arm = 2.89\n", "", "assembly.outward: no angle for a body (got 'right_arm')", "rad"),
    # What does not hang together
    (
        "[assembly.outward]",
        '[body.stray]\ntype = "rigid"\nmass = 1\ninertia = 1\n[assembly.outward]\nstray = 0.0',
        "joint: the mechanism is not connected (got 'stray')",
        "join it to ground",
    ),
    ("[study]", "[start]\nspeed = 3\n[study]", "start.speed: unknown field (got 3)", "choose from coordinates"),
    ("[study]", '[start.deflection]\nleft = { Z = [0, 1e-3] }\n[study]', "start.deflection.left: unknown point", "A"),
    ("[study]", "[start.deflection]\nleft = { B = [0, nan] }\n[study]", "start.deflection.left.B.1: should", "axial"),
    ("[study]", "[start.deflection]\nleft = { B = { slop = 1 } }\n[study]", "start.deflection.left.B.slop", '"slope"?'),
    ("[study]", "[start.deflection]\nleft = { B = 3 }\n[study]", "start.deflection.left.B: should be", "axial"),
    ("[study]", "[start.rates]\nright = { x = 1 }\n[study]", "start.rates.right.y: is missing", "in m/s"),
    ("[study]", "[study]\norientation = 0.1", "study.orientation: the angle is not a task coordinate (got", '"angle"'),
    # Paths
    ("end = [0.03, 0.32]", "end = [0.0, 0.3]", "path.line.corners: two neighbouring corners coincide", "drop one"),
    ("max_acceleration = 5.0", "max_acceleration = -5.0", "path.line.max_acceleration: must be positive", "m/s^2"),
    ('type = "line"', 'type = "arc"', "path.line.type: unknown type (got 'arc')", '"circle"'),
    ("[0.02, 0.31]", "[0.02, inf]", "path.curve.points.1.1: should be a finite number (got inf)", "[x, y]"),
    ("[0.02, 0.31]", "[0.0, 0.3]", "path.curve.points: two neighbouring points coincide", "drop one of them"),
    ('path = "line"', 'path = "lime"', "study.path: unknown path (got 'lime')", 'did you mean "line"?'),
]  # fmt: skip


def broken(folder, old, new):
    assert old in MODEL
    file = folder / "broken.toml"
    file.write_text(MODEL.replace(old, new, 1), encoding="utf-8")
    return file


def test_the_model_itself_is_sound(tmp_path):
    file = tmp_path / "sound.toml"
    file.write_text(MODEL, encoding="utf-8")
    plan_tracking(load(file).mechanism, load(file).path())


@pytest.mark.parametrize(
    ("old", "new", "says", "remedy"), FIELDS, ids=[f"{k} {new.strip()[:30]}" for k, (_, new, *_) in enumerate(FIELDS)]
)
def test_fields_are_named_with_value_and_remedy(tmp_path, old, new, says, remedy):
    file = broken(tmp_path, old, new)
    with pytest.raises(InputError) as caught:
        load(file)
    message, error = str(caught.value), caught.value
    assert message.startswith(f"{file}: {says}")
    assert remedy in error.remedy
    assert error.source == str(file)
    assert "\n" not in message
    assert len(message) < len(str(file)) + 400
    # No words of the libraries underneath.
    assert not re.search(r"pydantic|Traceback|__init__|type=|NoneType|dict\[|function-", message)


# Content, and what the message says.
FILES = {
    "empty": (b"", "name: is missing; give a name for the mechanism"),
    "blank": (b"\n# nothing\n\n", "name: is missing"),
    "binary": (b"\x7fELF\x02\x01\x01\x00\xff\xfe", "file: not a text file in UTF-8; name a TOML file"),
    "other encoding": ('name = "Mühle"\n'.encode("latin-1"), "file: not a text file in UTF-8"),
    "null bytes": (b'name = "a"\x00\n', "file: not valid TOML"),
    "huge": (b"# " + b"x" * 6_000_000, "file: too large a file; name a TOML file, of at most 5 MB"),
    "prose": (b"This is a letter.\n", "file: not valid TOML"),
    "JSON": (b'{"name": "a"}', "file: not valid TOML"),
    "unclosed": (b'name = "a\n', "file: not valid TOML"),
    "deep": (b"name = " + b"[" * 100_000, "file: not valid TOML"),
    "long number": (b"name = " + b"9" * 10_000, "file: not valid TOML"),
    "no bodies": (b'name = "a"\n[body]\n', "body: a mechanism needs at least one body; add a beam or a rigid body"),
    "bodies missing": (b'name = "a"\n', "body: is missing; give at least one [body.NAME] table"),
    "body no table": (b'name = "a"\n[body]\nb = 3\n', "body.b: should be a table (got 3)"),
    "start no table": (
        b'name = "a"\nstart = 3\n[body.b]\ntype = "rigid"\nmass = 1\ninertia = 1\n',
        "start: should be a table (got 3)",
    ),
    "law no table": (
        b'name = "a"\nprescribed = 3\n[body.b]\ntype = "rigid"\nmass = 1\ninertia = 1\n',
        "prescribed: should be a table",
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_files_that_are_no_models(tmp_path, name):
    content, says = FILES[name]
    file = tmp_path / "odd.toml"
    file.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load(file)
    assert str(caught.value).startswith(f"{file}: {says}")
    assert caught.value.remedy
    assert len(str(caught.value)) < 400


def test_a_folder_and_a_missing_file(tmp_path):
    (tmp_path / "model.toml").mkdir()
    with pytest.raises(
        InputError, match=r"model\.toml: file: cannot be read \(is a directory\); name a TOML file, not a folder"
    ):
        load(tmp_path / "model.toml")
    with pytest.raises(InputError, match=r"none\.toml: file: cannot be read \(no such file or directory\)"):
        load(tmp_path / "none.toml")
    with pytest.raises(InputError, match=r"neither a library mechanism nor a file \(got 'fourbar'\); did you mean"):
        load("fourbar")


CASES = [
    ("gravity = [", "gravty = [", 'broken.toml: gravty: unknown field (got [0.0, -9.81]); did you mean "gravity"?'),
    ('reach = "2.5 * base"', "reach = \"__import__('os').system('id')\"", "broken.toml: parameters.reach: only"),
    ("mass = 0.4", "mass = nan", "broken.toml: body.right.mass: should be a finite number (got nan); give the mass"),
    ("[study]", "[study", "broken.toml: file: not valid TOML: expected ']'"),
    ('A1 = ["-base", 0.0]', "A1 = [\"-base\", 0.0]\n[start]\nvelocity = 3", "broken.toml: start.velocity: should be"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "says"), CASES, ids=[new[:20] for _, new, _ in CASES])
def test_the_command_line_says_so_in_one_line(tmp_path, old, new, says):
    done = paraflex("info", str(broken(tmp_path, old, new)))
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("error: ")
    assert says in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_link_too_short_to_assemble_tells_the_gap_and_where(tmp_path):
    """Two arms of 0.02 m cannot meet: the joint between them stays open."""
    short = broken(tmp_path, 'length = "reach"\nsection = "tube"', 'length = 0.02\nsection = "tube"')
    text = short.read_text().replace('C = "reach" }', "C = 0.02 }").replace('C = ["reach", 0.0]', "C = [0.02, 0.0]")
    # Both cranks are held upright, so that nothing else can give.
    for motor, joint in (("m1", "A1"), ("m2", "A2")):
        text += f'[prescribed.{motor}]\njoint = "{joint}"\nangle = "pi / 2"\n'
    short.write_text(re.sub(r"(?s)\[path\.line\].*?\[study\].*?samples = 51", "[study]\nduration = 1.0", text))
    done = paraflex("run", "-m", str(short), "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert re.search(r"broken\.toml: assembly: the loops do not close: a gap of 0\.\d+ m remains in \w+ ", done.stderr)
    assert "; most likely because of body.left_arm.section: " in done.stderr
    # The motors at these joints come to nothing, and the arm is as short as it is thick.
    *warned, error = done.stderr.splitlines()
    assert error.startswith("error: ")
    assert [line.split()[1] for line in warned] == ["motor.m1:", "motor.m2:", "body.left_arm.section:"]


@pytest.mark.parametrize(
    ("coordinates", "free"),
    [('["x"]', "2 degrees of freedom, its task 1"), ('["x", "y", "angle"]', "2 degrees of freedom, its task 3")],
)
def test_tasks_that_do_not_match_the_degrees_of_freedom(tmp_path, coordinates, free):
    file = broken(tmp_path, '"left_arm.C"\n[assembly', f'"left_arm.C"\ncoordinates = {coordinates}\n[assembly')
    done = paraflex("run", "-m", str(file), "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert f"broken.toml: end_effector.coordinates: the mechanism has {free}" in done.stderr
    assert "name as many task coordinates as there are degrees of freedom" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_pose_that_is_held_too_often_is_refused(tmp_path):
    """Three prescribed angles for two degrees of freedom, and they contradict one another."""
    file = broken(tmp_path, "[assembly.outward]", "[assembly.outward]")
    text = re.sub(r"(?s)\[path\.line\].*?\[study\].*?samples = 51", "[study]\nduration = 1.0", file.read_text())
    for joint, angle in (("A1", 2.16), ("A2", 0.98), ("C", 0.3)):
        text += f'[prescribed.hold{joint}]\njoint = "{joint}"\nangle = {angle}\n'
    file.write_text(text)
    done = paraflex("run", "-m", str(file), "--rigid", "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    *warned, error = done.stderr.splitlines()
    assert "broken.toml: assembly: the loops do not close: a gap of " in error
    assert all(line.startswith("warning: motor.") for line in warned)
