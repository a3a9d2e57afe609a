"""Units in files: factors and dimensions by independent tables, and what is refused."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.checks.check import file_findings
from paraflex.expressions.dimensions import dimension_of, dimensions_of_parameters
from paraflex.expressions.evaluate import ExpressionError, evaluate
from paraflex.files import library_text, load_data, model_from
from paraflex.files.fields import units_at
from paraflex.files.schema import ModelTable
from paraflex.units import FIELD_UNITS, UNITS, dimension_text, unit_named

# In SI units, by hand: with the float that a file would have in its place.
KNOWN = {
    "80 mm": 0.08, "1.1 mm": 0.0011, "35 um": 35e-6, "35 µm": 35e-6, "2.5 cm": 0.025, "0.3 km": 300.0, "2 in": 0.0508,
    "30 deg": math.radians(30), "180°": math.pi, "1.5 rev": 3 * math.pi, "250 mrad": 0.25,
    "100 rpm": 100 * 2 * math.pi / 60, "10 deg/s": math.radians(10), "50 Hz": 50.0, "2 kHz": 2000.0, "3 1/s": 3.0,
    "500 ms": 0.5, "2 min": 120.0, "1 h": 3600.0, "250 g": 0.25, "1.5 t": 1500.0, "3 kN": 3000.0, "20 mN": 0.02,
    "5 N m": 5.0, "5 Nm": 5.0, "5 N·m": 5.0, "7 Nmm": 0.007, "7 N mm": 0.007, "2 kNm": 2000.0, "3 mNm": 0.003,
    "101 kPa": 101000.0, "70 MPa": 70e6, "210 GPa": 210e9, "2 bar": 2e5, "1 psi": 6894.757293168361,
    "7.85 g/cm^3": 7850.0, "2700 kg/m^3": 2700.0, "40 g mm^2": 4e-8, "4 kg m²": 4.0, "3 N/mm": 3000.0,
    "1 N m/deg": 180 / math.pi, "2 N s/m": 2.0, "2 N m s/rad": 2.0, "12 mm^4": 12e-12, "6 cm^4": 6e-8, "20 mm²": 2e-5,
    "9.81 m/s^2": 9.81, "3 m / s": 3.0, "1e3 mm": 1.0, "-.5 m": -0.5, "2 m s^-1": 2.0,
}  # fmt: skip


@pytest.mark.parametrize(("text", "value"), KNOWN.items())
def test_quantities_are_numbers_in_si_units(text, value):
    assert evaluate(text, {}) == pytest.approx(value, rel=2e-16)


def test_decimal_factors_are_rounded_once():
    for number in ("1.1", "35", "0.7", "123.456"):
        assert evaluate(f"{number} mm", {}) == float(f"{number}e-3")
        assert evaluate(f"{number} GPa", {}) == float(f"{number}e9")


def test_units_of_a_dimension_are_multiples_of_its_si_unit():
    for text, unit in {"g mm^2": "kg m^2", "N/mm": "N/m", "rpm": "rad/s", "psi": "Pa", "1/ms": "1/s"}.items():
        assert unit_named(text).dimension == unit_named(unit).dimension
        assert dimension_text(unit_named(text).dimension) == ("Hz" if unit == "1/s" else unit)
    for unit in FIELD_UNITS:
        assert unit_named(unit).factor == 1
    assert dimension_text((3, 1, 0, -1, 0)) == "kg m^3 rad^-1"
    assert UNITS["Nm"].dimension == unit_named("N m").dimension
    # An angle counts, so that frequencies are no speeds of rotation.
    assert unit_named("Hz").dimension != unit_named("rad/s").dimension


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [
        ("2 * 40 mm", 0.08, "m"),
        ("-L / 2 + 10 mm", -0.14, "m"),
        ("3 N * m", 6.0, None),
        ("(3 N) / m", 1.5, None),
        ("3 N m", 3.0, "N m"),
        ("L**2 / 4", 0.0225, "m^2"),
        ("sqrt(L * L)", 0.3, "m"),
        ("L * sin(30 deg)", 0.15, "m"),
        ("40 mm / 20 mm", 2.0, "1"),
        ("0.3 + 10 mm", 0.31, "m"),
        ("90 deg + 1", math.pi / 2 + 1, "rad"),
        ("m * 3 kg", 6.0, None),
        ("1 / 2 s", 0.5, "Hz"),
    ],
)
def test_units_in_expressions_stand_behind_numbers(text, value, unit):
    table = {"L": "300 mm", "m": 2.0}
    assert evaluate(text, {"L": 0.3, "m": 2.0}) == pytest.approx(value, rel=1e-15)
    dimension = dimension_of(text, dimensions_of_parameters(table))
    assert (dimension if dimension is None else dimension_text(dimension)) == unit


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("3 N/m", '"m" in "3 N/m" is a unit and a parameter'),
        ("3 N*s", 'unknown parameter "s"'),
        ("30 degs", 'unknown unit "degs"'),
        ("L mm", "neither a number nor an expression"),
        ('3 @ "mm"', "neither a number nor an expression"),
        ("3 mm mm2", "neither|unknown unit"),
        ("1e999 m", "too large a number"),
    ],
)
def test_what_is_neither_unit_nor_parameter_is_refused(text, says):
    with pytest.raises(ExpressionError, match=says):
        evaluate(text, {"L": 0.3, "m": 2.0})


@pytest.mark.parametrize(
    ("text", "says"), [("5 kg + 2 mm", "a sum of quantities in kg and in m"), ("sin(2 t)", "in kg")]
)
def test_expressions_of_unlike_quantities_are_refused(text, says):
    with pytest.raises(ExpressionError, match=says):
        dimension_of(text, {})


def changed(name, place, value):
    """A library model with another value at a place."""
    data, source = load_data(name)
    inside = data
    for key in place[:-1]:
        inside = inside.setdefault(key, {}) if isinstance(inside, dict) else inside[key]
    inside[place[-1]] = value
    return model_from(data, source)


@pytest.mark.parametrize(
    ("place", "text", "number"),
    [
        (("section", "bar", "width"), "30 mm", 0.03),
        (("material", "aluminium", "density"), "2.7 g/cm^3", 2700.0),
        (("lump", "tool", "inertia"), "50 kg mm^2", 5e-5),
        (("body", "distal1", "points", "C"), "250 mm", 0.25),
        (("ground", "A1", 1), "10 mm", 0.01),
        (("gravity",), ["0 m/s^2", "-9.81 m/s^2"], [0.0, -9.81]),
        (("assembly", "outward", "distal1"), "40 deg", math.radians(40)),
        (("study", "duration"), "500 ms", 0.5),
        (("spring", "s"), {"joint": "A1", "stiffness": "1 N m/deg", "rest": "10 deg"},
         {"joint": "A1", "stiffness": 180 / math.pi, "rest": math.radians(10)}),
        (("load", "f"), {"type": "force", "point": "distal1.C", "force": ["1 kN", 0.0]},
         {"type": "force", "point": "distal1.C", "force": [1000.0, 0.0]}),
    ],
)  # fmt: skip
def test_numbers_of_a_model_may_have_units(place, text, number):
    with_unit, plain = (changed("five_bar", place, value) for value in (text, number))
    assert with_unit.mechanism == plain.mechanism
    assert with_unit.study == plain.study
    assert with_unit.mechanism != pf.load("five_bar").mechanism or place[0] in (
        "section",
        "material",
        "lump",
        "study",
        "body",
    )


@pytest.mark.parametrize(
    ("place", "text", "says"),
    [
        (("body", "distal1", "length"), "80 kg",
         r"^five_bar.toml: body.distal1.length: a quantity in kg where one in m is asked for \(got '80 kg'\); give"),
        (("ground", "A1", 0), "2 rad", r"ground.A1.0: a quantity in rad where one in m"),
        (("assembly", "outward", "distal1"), "30 mm", r"assembly.outward.distal1: a quantity in m where one in rad"),
        (("parameters", "l1"), "2 kg + 1 m", r"parameters.l1: a sum of quantities in kg and in m"),
        (("parameters", "l1"), "2 kg", r"body.proximal1.length: a quantity in kg"),
        (("study", "duration"), "2 Hz", r"study.duration: a quantity in Hz where one in s"),
        (("body", "distal1", "damping"), {"ratios": ["1 mm"]},
         r"ratios.0: a quantity in m where a number without a unit"),
        (("body", "distal1", "elements"), "3 mm", r"body.distal1.elements"),
        (("spring", "s"), {"joint": "A1", "stiffness": "3 N/m"},
         r"spring.s.stiffness: a quantity in N/m where one in N m/rad"),
        (("path", "way"), {"type": "points", "points": [["1 mm", 0.0, "2 mm"]] * 2, "motion_time": 1.0},
         r"path.way.points.0.2: a quantity in m where one in rad"),
    ],
)  # fmt: skip
def test_units_of_another_dimension_are_refused(place, text, says):
    with pytest.raises(pf.InputError, match=says):
        changed("five_bar", place, text)


def test_a_name_may_look_like_a_quantity():
    assert changed("five_bar", ("name",), "2 mm").mechanism.name == "2 mm"


SLIDING = """
name = "slide"
ground = { O = [0.0, 0.0] }
[body.block]
type = "rigid"
mass = 2.0
inertia = 0.1
points = { C = [0.0, 0.0] }
[joint.rail]
type = "prismatic"
points = ["ground.O", "block.C"]
[assembly.start]
block = 0.0
"""
MOVED = '[prescribed.drive]\njoint = "rail"\ntable = "table.csv"\n'
PUSHED = '[load.push]\ntype = "force"\npoint = "block.C"\ntable = "table.csv"\n'
DRIVEN = '[motor]\nlift = "rail"\n[study.torques.lift]\ntable = "table.csv"\n'
DRAWN = '[path.p]\ntype = "table"\nmotion_time = 1.0\ntable = "table.csv"\n'


def with_table(folder, text, table):
    (folder / "table.csv").write_text(table)
    (folder / "slide.toml").write_text(SLIDING + text)
    return pf.load(folder / "slide.toml")


def columns_of(model):
    """Times and values of the table of a model's profile."""
    members = [one.profile for one in model.mechanism.prescribed] + [
        x for one in model.mechanism.loads for x in one.profiles
    ]
    return [(profile.times, profile.values) for profile in [*members, *model.study.torques.values()]]


@pytest.mark.parametrize(
    ("text", "table", "expected"),
    [
        (MOVED, "t [ms], x [mm]\n0, 0\n100, 1.1\n", [((0.0, 0.1), (0.0, 0.0011))]),
        (MOVED, "t; x (mm)\n0; 0\n1; 20\n", [((0.0, 1.0), (0.0, 0.02))]),
        (MOVED, "t [ms] x [m]\n0 0\n100 1\n", [((0.0, 0.1), (0.0, 1.0))]),
        # As NumPy's savetxt writes headings.
        (MOVED, "# measured\n# t [ms], x [mm]\n0,0\n100,20\n", [((0.0, 0.1), (0.0, 0.02))]),
        # Remarks, and names that end in a unit, are no units.
        (MOVED, "t (by hand), x_mm\n0, 0\n1, 2\n", [((0.0, 1.0), (0.0, 2.0))]),
        (MOVED, "# sampled at [1 kHz], [t]\nt, x\n0, 0\n1, 2\n", [((0.0, 1.0), (0.0, 2.0))]),
        (PUSHED, '"t [s]","x [kN]","y [mN]"\n0,0,0\n1,2,30\n', [((0, 1), (0, 2000)), ((0, 1), (0, 0.03))]),
        (DRIVEN, "t [min], F [kN]\n0 0\n0.5 2\n", [((0.0, 30.0), (0.0, 2000.0))]),
    ],
)
def test_columns_of_tables_may_have_units(tmp_path, text, table, expected):
    model = with_table(tmp_path, text, table)
    assert columns_of(model) == expected
    # A model that is saved beside the file names it still.
    replace(model, mechanism=replace(model.mechanism, gravity=(0.0, -9.81))).save(tmp_path / "saved.toml")
    assert 'table = "table.csv"' in (tmp_path / "saved.toml").read_text()
    assert columns_of(pf.load(tmp_path / "saved.toml")) == expected


def test_points_of_a_path_may_have_units(tmp_path):
    table = "x [mm], y [cm]\n" + "".join(f"{10 * k}, {k * k}\n" for k in range(5))
    path = with_table(tmp_path, DRAWN, table).path("p")
    np.testing.assert_allclose(path.points, [[0.01 * k, 0.01 * k * k] for k in range(5)], rtol=1e-15)
    (tmp_path / "path.toml").write_text(DRAWN.replace("[path.p]", "[path]"))
    np.testing.assert_array_equal(pf.load_path(tmp_path / "path.toml").points, path.points)
    timed = DRAWN.replace("motion_time = 1.0\n", "")
    table = "x [mm], y [mm], t [ms]\n" + "".join(f"{10 * k}, {k * k}, {100 * k}\n" for k in range(5))
    np.testing.assert_allclose(with_table(tmp_path, timed, table).path("p").times, [0, 0.1, 0.2, 0.3, 0.4], rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "table", "says"),
    [
        (
            MOVED, "t [s], x [deg]\n0, 0\n1, 2\n",
            "prescribed.drive.table: column 2 of table.csv is in rad where m is asked for (got 'x [deg]')",
        ),
        (PUSHED, "t [s], x [mm], y [N]\n0,0,0\n1,1,1\n", "load.push.table: column 2 of table.csv is in m where N is"),
        (PUSHED, "t [N], x [N], y [N]\n0,0,0\n1,1,1\n", "load.push.table: column 1 of table.csv is in N where s is"),
        (DRIVEN, "t, F [Nm]\n0,0\n1,1\n", "study.torques.lift.table: column 2 of table.csv is in N m where N is"),
        (DRAWN, "x [s], y [m]\n0,0\n1,1\n", "path.p.table: column 1 of table.csv is in s where m is"),
        (MOVED, "t [s], x [mn]\n0, 0\n1, 2\n", 'drive.table: column 2 of table.csv has the unknown unit "mn"'),
        (MOVED, "t [s], x [-]\n0, 0\n1, 2\n", 'drive.table: column 2 of table.csv has the unknown unit "-"'),
        (MOVED, "time of run x [mm]\n0 0\n1 2\n", "the headings of table.csv do not show to which of 2 columns"),
    ],
)  # fmt: skip
def test_units_of_columns_are_those_of_the_field(tmp_path, text, table, says):
    with pytest.raises(pf.InputError) as caught:
        with_table(tmp_path, text, table)
    assert says in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "slide.toml"))
    assert caught.value.remedy


def test_rows_of_a_force_have_units_of_their_place(tmp_path):
    rows = 'table = [[0, "1 kN", 0], ["1 min", 0, "3 mN"]]\n'
    model = with_table(tmp_path, PUSHED.replace('table = "table.csv"\n', rows), "")
    assert columns_of(model) == [((0.0, 60.0), (1000.0, 0.0)), ((0.0, 60.0), (0.0, 0.003))]


def test_joints_that_slide_have_forces_and_lengths():
    data = {"joint": {"A": {"type": "prismatic"}, "B": ["a", "b"]}, "motor": {"push": "A", "turn": "B"}}
    data |= {"spring": {"s": {"joint": "A"}, "t": {"joint": "B"}}, "friction": {"f": {"joint": "A"}}}
    data |= {"prescribed": {"p": {"joint": "A"}}}
    expected = {
        ("spring", "s", "stiffness"): "N/m", ("spring", "t", "stiffness"): "N m/rad", ("friction", "f", "speed"): "m/s",
        ("friction", "f", "limit"): "N", ("study", "torques", "push"): "N", ("study", "torques", "turn"): "N m",
        ("prescribed", "p", "speed"): "m/s", ("prescribed", "p", "displacement"): "m",
    }  # fmt: skip
    assert {place: units_at(ModelTable, data, place) for place in expected} == {
        place: (unit,) for place, unit in expected.items()
    }


def test_profiles_have_units():
    text = """
name = "rotor"
ground = { O = [0.0, 0.0] }
[body.rotor]
type = "rigid"
mass = "250 g"
inertia = "2 kg cm^2"
points = { O = [0.0, 0.0] }
[joint]
O = ["ground.O", "rotor.O"]
[prescribed.drive]
joint = "O"
angle = "30 deg * sin(2 * pi * 1 Hz * t)"
"""
    (drive,) = model_from(tomllib.loads(text), "rotor.toml").mechanism.prescribed
    value, rate, _ = drive.profile.evaluate(np.array([0.25, 0.5]))
    assert value == pytest.approx([math.radians(30), 0.0], abs=1e-15)
    assert rate == pytest.approx([0.0, -math.radians(30) * 2 * math.pi], abs=1e-12)
    with pytest.raises(pf.InputError, match=r"prescribed.drive.angle: a quantity in m where one in rad"):
        model_from(tomllib.loads(text.replace("30 deg *", "30 mm *")), "rotor.toml")


def test_saved_files_keep_units_and_write_si_numbers(tmp_path):
    text = library_text("five_bar").replace("width = 0.030", 'width = "30 mm"')
    assert '"30 mm"' in text
    (tmp_path / "five.toml").write_text(text)
    model = pf.load(tmp_path / "five.toml")
    assert model.mechanism == pf.load("five_bar").mechanism
    model.save(tmp_path / "again.toml")
    assert (tmp_path / "again.toml").read_text() == text
    bodies = [replace(one, section=pf.Section.rectangle(0.04, 0.005)) for one in model.mechanism.bodies]
    replace(model, mechanism=model.mechanism.with_bodies(bodies)).save(tmp_path / "wider.toml")
    lines = (tmp_path / "wider.toml").read_text().splitlines()
    assert [line.split("#")[0].strip() for line in lines if line.startswith("width")] == ["width = 0.04"]


def test_a_unit_is_no_use_of_a_parameter_of_its_name():
    data, source = load_data("five_bar")
    data["parameters"] |= {"m": 1.0, "half": 0.5}
    data["section"]["bar"] |= {"width": "0.03 m", "thickness": "half * 10 mm"}
    found = [finding.place for finding in file_findings(model_from(data, source)) if finding.code == "unused"]
    assert found == ["parameters.m"]


def test_gravity_among_the_points_of_the_ground_is_told_where_it_belongs():
    data, source = load_data("pendulum")
    data["ground"]["gravity"] = data.pop("gravity")
    (found,) = (one for one in file_findings(model_from(data, source)) if one.code == "unused")
    assert found.place == "ground.gravity"
    assert "before the first table" in found.remedy
