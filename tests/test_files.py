"""Model files: the shipped one is the builder's mechanism; whatever is wrong with one is said in one line."""

import pytest

from paraflex.errors import InputError
from paraflex.files import library_file, library_names, load, load_path
from paraflex.mechanism import raparm_i
from paraflex.paths import Circle, PointPath, Polygon

SOURCE = library_file("raparm_i").read_text(encoding="utf-8")


def test_shipped_file_is_the_builders_mechanism():
    model = load("raparm_i")
    assert model.mechanism == raparm_i()
    assert "raparm_i" in library_names()
    assert isinstance(model.path(), Polygon)
    assert isinstance(model.paths["circle"], Circle)
    assert model.study.modes == ("+-+-", "-+-+", "+--+", "+++-", "++-+", "++++")


def test_edited_copy_is_read(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(SOURCE.replace("thickness = 0.005", "thickness = 0.006"), encoding="utf-8")
    model = load(file)
    assert model.mechanism != raparm_i()
    assert model.mechanism.body("link1").section.second_moment == pytest.approx(0.03 * 0.006**3 / 12, rel=1e-15)
    assert model.source == str(file)


# What is replaced, by what, and what the message must name: the field, and the remedy or value.
BROKEN = [
    (
        'geometry = "linear"\n',
        'geometry = "second-oder"\n',
        "geometry: should be 'linear' or 'second-order'",
        'did you mean "second-order"?',
    ),
    ("length = 0.250 # m", "lenght = 0.250", "body.link1.lenght: unknown field", 'did you mean "length"?'),
    ("length = 0.250 # m\n", "", "body.link1.length: is missing", "give the length in m"),
    ("length = 0.250 # m", "length = -0.25", "body.link1.length: must be positive (got -0.25)", "in m"),
    ("length = 0.250 # m", "length = 0", "body.link1.length: must be positive", "in m"),
    (
        "length = 0.250 # m",
        'length = "250 metres"',
        "body.link1.length: unknown unit \"metres\" (got '250 metres')",
        "in m",
    ),
    ("length = 0.250 # m", "length = true", "body.link1.length", "give the length in m"),
    ("length = 0.250 # m", "length = inf", "body.link1.length: should be a finite number", "in m"),
    ("length = 0.250 # m", "length =", "not valid TOML", "line 43"),
    (
        'type = "beam"',
        'type = "bean"',
        "body.link1.type: unknown type (got 'bean')",
        'did you mean "beam"? it may be "beam", "rigid"',
    ),
    ('section = "bar"', 'section = "baar"', "body.link1.section: unknown section", 'did you mean "bar"?'),
    ('material = "aluminium"', 'material = "steel"', "body.link1.material: unknown material", "aluminium"),
    ('B1 = "joint" }', 'B9 = "joint" }', "body.link1.lumps: a lumped mass at an unknown point (got 'B9')", "A1, B1"),
    ('B1 = "joint" }', 'B1 = "joit" }', "body.link1.lumps.B1: unknown lump", 'did you mean "joint"?'),
    ("B1 = 0.250 }", "B1 = 0.3 }", "body.link1.points.B1: the point lies beyond the beam's end", "between 0 and"),
    ("elements = 3", "elements = 0", "body.link1.elements: a span needs at least one element", "1 or more"),
    ("elements = 3", "elements = 2.5", "body.link1.elements: should be a valid integer (got 2.5)", "span"),
    ("elements = [1, 2]", "elements = [1, 2, 3]", "body.link4.elements: the beam has 2 span(s)", "one number per span"),
    ("elements = 3", "elements = 3\nmodes = 0", "body.link1.modes: no such number of modes (got 0)", "from 1 to 12"),
    ("elements = 3", "elements = 3\nmodes = 13", "body.link1.modes: no such number of modes (got 13)", "from 1 to 12"),
    ("youngs_modulus = 70e9  # Pa\n", "", "material.aluminium.youngs_modulus: is missing", "Young's modulus in Pa"),
    ("density = 2700.0 ", "density = -2700.0 ", "material.aluminium.density: must be positive", "kg/m^3"),
    ("thickness = 0.005 ", "thickness = nan ", "section.bar.thickness: should be a finite number", "in m"),
    ("thickness = 0.005 ", "thickness = 0.0 ", "section.bar.thickness: must be positive (got 0.0)", "in m"),
    ("mass = 0.130 ", "mass = -0.130 ", "body.link1.lumps.A1.mass: must not be negative", "kg"),
    ("A1 = [-0.100, 0.0]", "A1 = [-0.100]", "ground.A1: list should have at least 2 items", "[x, y]"),
    ('["ground.A1", "link1.A1"]', '["ground.A1", "link1.A7"]', "joint.A1: unknown point (got 'link1.A7')", "A1"),
    ('["ground.A1", "link1.A1"]', '["ground.A1", "link9.A1"]', "joint.A1: unknown body (got 'link9')", "link"),
    ('["ground.A1", "link1.A1"]', '["ground.A1", "A1"]', "joint.A1: not a point (got 'A1')", "body.point"),
    ('["ground.A1", "link1.A1"]', '["link1.B1", "link1.A1"]', "joint.A1: a joint needs two different bodies", "other"),
    ("[body.link2]", "[body.link1]", "the table [body.link1] appears twice", "line"),
    ('tau1 = "A1"', 'tau1 = "A3"', "motor.tau1.joint: unknown joint (got 'A3')", "A1"),
    ('"+-+-" = ["tau1", "tau5"]', '"+-+-" = ["tau1", "tau7"]', "mode.+-+-: unknown motor (got 'tau7')", "tau"),
    ('point = "link4.C"', 'point = "link4.X"', "end_effector.point: unknown point (got 'link4.X')", "C"),
    (
        'point = "link4.C"',
        'point = "ground.A1"',
        "end_effector.point: the end-effector is a point of the ground, which does not move",
        "body's point",
    ),
    ('["x", "y"]', '["x", "z"]', "end_effector.coordinates: not a set of task coordinates", "angle"),
    ("link1 = 2.164\n", "", "assembly.outward: no angle for a body (got 'link1')", "rad"),
    ("link1 = 2.164\n", "lnk1 = 2.164\n", "assembly.outward: unknown body (got 'lnk1')", 'did you mean "link1"?'),
    ("radius = 0.050 ", "radius = -0.050 ", "path.circle.radius: must be positive", "metres"),
    ("max_acceleration = 40.0", "max_acceleration = 0.0", "path.square.max_acceleration: must be positive", "m/s^2"),
    ('type = "circle"', 'type = "ellipse"', "path.circle.type: unknown type (got 'ellipse')", '"circle"'),
    ('path = "square"', 'path = "sqare"', "study.path: unknown path (got 'sqare')", 'did you mean "square"?'),
    ('"++++"]\nduration', '"+++"]\nduration', "study.modes: not an actuation mode (got '+++')", "4 motors"),
    ("samples = 701", "samples = 1", "study.samples: too few samples", "at least 2"),
    ("duration = 0.7", "duration = -0.7", "study.duration: must be positive", "in s"),
    ('assembly = "outward"', 'assembly = "upside"', "study.assembly: unknown assembly", "outward"),
    ("[study]", "[studdy]", "studdy: unknown field", 'did you mean "study"?'),
    ('name = "RAParM-I"\n', "", "name: is missing", "a name for the mechanism"),
]


@pytest.mark.parametrize(("old", "new", "says", "remedy"), BROKEN, ids=[f"{a[:20]}>{b[:20]}" for a, b, *_ in BROKEN])
def test_broken_file_is_refused_by_name(tmp_path, old, new, says, remedy):
    assert old in SOURCE
    file = tmp_path / "broken.toml"
    file.write_text(SOURCE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load(file)
    message = str(caught.value)
    assert message.startswith(f"{file}: ")
    assert says in message
    assert remedy in message
    assert "\n" not in message


def test_disconnected_body_is_named(tmp_path):
    extra = '\n[body.stray]\ntype = "rigid"\nmass = 1.0\ninertia = 0.1\n'
    angles = SOURCE.replace("link1 = 2.164\n", "stray = 0.0\nlink1 = 2.164\n").replace(
        "link1 = 0.244\n", "stray = 0.0\nlink1 = 0.244\n"
    )
    file = tmp_path / "stray.toml"
    file.write_text(angles + extra, encoding="utf-8")
    with pytest.raises(InputError, match=r"joint: the mechanism is not connected \(got 'stray'\)"):
        load(file)


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"", "name: is missing"), (b"\xff\xfe\x00", "not a text file in UTF-8"), (b"x" * 6_000_000, "too large")],
    ids=["empty", "binary", "huge"],
)
def test_files_that_are_no_models(tmp_path, content, says):
    file = tmp_path / "odd.toml"
    file.write_bytes(content)
    with pytest.raises(InputError, match=says):
        load(file)


def test_missing_file_and_unknown_name(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path / "none.toml")
    with pytest.raises(InputError, match='did you mean "raparm_i"'):
        load("raparm_1")


def test_path_from_a_file_of_its_own(tmp_path):
    file = tmp_path / "eight.toml"
    file.write_text(
        '[path]\ntype = "points"\npoints = [[0.05, 0.25], [0.0, 0.28], [-0.05, 0.25]]\nmotion_time = 0.2\n',
        encoding="utf-8",
    )
    path = load_path(file)
    assert isinstance(path, PointPath)
    assert path.duration == 0.2
    file.write_text('[path]\ntype = "line"\nstart = [0, 0]\nend = [0, 0]\nmax_acceleration = 1\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"path\.corners: two neighbouring corners coincide"):
        load_path(file)


def test_rigid_body_and_prescribed_speed_from_a_file(tmp_path):
    file = tmp_path / "disc.toml"
    file.write_text(
        """
name = "disc"
[ground]
O = [0.0, 0.0]
[body.disc]
type = "rigid"
mass = 2.0
inertia = 0.1
points = { O = [0.0, 0.0], P = [0.5, 0.0] }
[joint]
O = ["ground.O", "disc.O"]
[prescribed.spin]
joint = "O"
speed = 3.0
[assembly.start]
disc = 0.0
""",
        encoding="utf-8",
    )
    mechanism = load(file).mechanism
    angle, rate, _ = mechanism.prescribed[0].profile.evaluate(__import__("numpy").array([2.0]))
    assert (angle[0], rate[0]) == (6.0, 3.0)
    assert mechanism.body("disc").points["P"] == (0.5, 0.0)
