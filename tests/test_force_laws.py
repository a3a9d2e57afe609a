"""Forces over the motion: closed forms, springs and dampers that they stand for, all methods, files, messages."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import paraflex as pf
from conftest import make_five_bar
from paraflex import ForceLaw, InputError
from paraflex.dynamics import build_system
from paraflex.dynamics.load_values import line_laws, load_values
from paraflex.errors import IntegrationError
from paraflex.files import ExpressionProfile, model_from
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    AppliedTorque,
    Assembly,
    LinearSpring,
    Mechanism,
    Motor,
    PointForce,
    PointRef,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    TabulatedProfile,
    TorsionalDamper,
    TorsionalSpring,
    raparm_i,
)
from paraflex.motion import simulate_motion
from paraflex.paths import Line
from paraflex.results import tracking_dataset
from paraflex.tracking import plan_tracking
from shell import paraflex
from test_loads import MASS, pendulum
from test_loads_in_time import K, slider

DAMPING, REST = 2.0, 0.3
FINE = IntegrationOptions(tolerance=1e-8)


def oscillator(**changes):
    force = ForceLaw("-k * (rail.travel - x0) - c * rail.rate", {"k": K, "c": DAMPING, "x0": REST})
    return slider(force, **changes)


def damped(t):
    pace, decay = np.sqrt(K / MASS - (0.5 * DAMPING / MASS) ** 2), 0.5 * DAMPING / MASS
    return REST * (1.0 - np.exp(-decay * t) * (np.cos(pace * t) + decay / pace * np.sin(pace * t)))


@pytest.mark.parametrize("method", ["esdirk5", "tr-bdf2", "generalised-alpha", "radau", "bdf", "ida", "rk45"])
def test_an_oscillator_by_every_kind_of_method(method):
    run = simulate_motion(oscillator(), 2.0, samples=41, options=IntegrationOptions(method=method, tolerance=1e-7))
    assert_allclose(run.solution.q[:, 0], damped(run.times), rtol=0, atol=1e-5)
    # The force's work is all the energy there is.
    assert run.solution.energy_balance_max < 1e-4


def springs(mechanism, joint="rail"):
    """A spring and a damper at the joint, in place of laws."""
    spring, damper = TorsionalSpring("k", joint, K, rest=REST), TorsionalDamper("c", joint, DAMPING)
    return replace(mechanism, loads=(), springs=(spring,), dampers=(damper,))


def turning(word):
    """The pendulum with a torque by law at its pin, which is all that a spring and a damper there do."""
    law = ForceLaw(f"-k * (pin.angle - x0) - c * {word}", {"k": K, "c": DAMPING, "x0": REST})
    return pendulum(loads=(AppliedTorque("turn", PointRef("arm", "A"), law),), gravity=(0.0, -9.81))


@pytest.mark.parametrize("made", [oscillator(), turning("pin.rate")], ids=["slides", "turns"])
def test_a_law_is_the_spring_and_the_damper_that_it_stands_for(made):
    joint = made.joints[0].name
    runs = [simulate_motion(each, 1.0, samples=11, options=FINE) for each in (made, springs(made, joint))]
    for name, within in (("q", 1e-6), ("v", 2e-5), ("a", 4e-4)):
        assert_allclose(getattr(runs[0].solution, name), getattr(runs[1].solution, name), rtol=0, atol=within)
    poles = [
        np.sort_complex(pf.linearise(replace(each, motors=(Motor("m", joint),))).poles())
        for each in (made, springs(made, joint))
    ]
    assert_allclose(poles[0], poles[1], rtol=1e-9)


def tied(**spring):
    """The pendulum held by a spring between its tip and the ground, whose force on the ground is in results."""
    cord = LinearSpring("cord", PointRef("ground", "O"), PointRef("arm", "B"), **spring)
    return pendulum(linear_springs=(cord,), ground={"O": (0.2, 0.1), "W": (0.1, -0.3)}, gravity=(0.0, -9.81))


def test_a_characteristic_is_the_spring_that_it_stands_for():
    law = ForceLaw("k * (cord.length - 0.2) + 3 * cord.length_rate", {"k": 90.0})
    cords = [{"stiffness": 90.0, "length": 0.2, "damping": 3.0}, {"force": law}]
    made = [tied(**one) for one in cords]
    made = [replace(one, linear_springs=(replace(one.linear_springs[0], a=PointRef("ground", "W")),)) for one in made]
    runs = [simulate_motion(one, 1.0, samples=11, options=FINE) for one in made]
    assert_allclose(runs[1].solution.q, runs[0].solution.q, rtol=0, atol=1e-6)
    assert runs[1].solution.energy_balance_max < 1e-5
    one, other = (pf.motion_dataset(run) for run in runs)
    assert_allclose(other["frame_force"], one["frame_force"], rtol=0, atol=1e-3)
    assert_allclose(other["frame_moment"], one["frame_moment"], rtol=0, atol=1e-3)


def turned(joint):
    """The other way round, the ground second."""
    return replace(joint, a=joint.b, b=joint.a)


def two_bars():
    """Two bars in a row, pinned to each other and to the ground."""
    bars = tuple(RigidBody(name, MASS, 0.02, points={"A": (0.0, 0.0), "B": (0.3, 0.0)}) for name in ("one", "two"))
    joints = RevoluteJoint("root", "ground.O", "one.A"), RevoluteJoint("pin", "one.B", "two.A")
    start = Assembly("start", {"one": 0.0, "two": 0.4})
    return Mechanism("bars", {"O": (0.0, 0.0)}, bars, joints, gravity=(0.0, -9.81), assemblies=(start,))


@pytest.mark.parametrize(
    "made",
    [
        slider(0.0, joints=(replace(slider(0.0).joints[0], direction=2.0),), gravity=(3.0, -9.81)),
        pendulum(gravity=(0.0, -9.81)),
        pendulum(joints=tuple(map(turned, pendulum().joints)), gravity=(0.0, -9.81)),
        two_bars(),
    ],
    ids=["slides", "turns", "turns, on the ground second", "turns between two bodies"],
)
def test_a_spring_with_a_law_is_the_spring_that_it_stands_for(made):
    name, word = made.joints[-1].name, "travel" if made.joints[-1].slides else "angle"
    law = ForceLaw(f"-k * ({name}.{word} - x0) - c * {name}.rate", {"k": K, "x0": REST, "c": DAMPING})
    table = TabulatedProfile((-50.0, 50.0), (50.0 * K, -50.0 * K), "linear")
    damper = (TorsionalDamper("c", name, DAMPING),)
    one = replace(made, loads=(), springs=(TorsionalSpring("s", name, K, rest=REST, torque=law),))
    over = TorsionalSpring("t", name, torque=ForceLaw(f"{name}.{word}", table=table))
    two = replace(made, loads=(), springs=(over, TorsionalSpring("s", name, K, rest=2.0 * REST)), dampers=damper)
    plain = replace(made, loads=(), springs=(TorsionalSpring("s", name, 2.0 * K, rest=REST),), dampers=damper)
    wanted = simulate_motion(plain, 0.5, samples=6, options=FINE).solution
    for own in (one, two):
        assert (len(own.springs), len(own.loads)) == (1, 1)
        found = simulate_motion(own, 0.5, samples=6, options=FINE).solution
        assert_allclose(found.q, wanted.q, rtol=0, atol=1e-6)
        assert_allclose(found.v, wanted.v, rtol=0, atol=2e-5)


def test_results_have_the_law_of_a_spring_under_loads():
    """The moment in a joint is that of its stiffnesses, motors and constraints; loads stand beside it."""
    made = pendulum(springs=(TorsionalSpring("s", "pin", 3.0, torque=ForceLaw("-7 * pin.angle")),))
    data = pf.motion_dataset(simulate_motion(made, 0.2, samples=5, options=FINE))
    angle = data["joint_coordinate"].sel(joint="pin")
    assert_allclose(data["load_torque"].sel(load="s"), -7.0 * angle, rtol=1e-12)
    assert_allclose(data["joint_moment"].sel(joint="pin"), -3.0 * angle, rtol=0, atol=1e-3)
    assert float(abs(angle).max()) > 0.3


def test_a_law_of_a_spring_along_an_axis_that_moves_is_refused():
    cart = RigidBody("cart", MASS, 0.02, points={"C": (0.0, 0.0)})
    rail = PrismaticJoint("rail", "one.B", "cart.C")
    start = Assembly("start", {"one": 0.0, "cart": 0.0})
    moving = replace(two_bars(), bodies=(two_bars().bodies[0], cart), joints=(two_bars().joints[0], rail),
                     assemblies=(start,))  # fmt: skip
    with pytest.raises(InputError, match=r"^spring\.s\.torque: the axis of its joint moves.*\(got 'rail'\)"):
        replace(moving, springs=(TorsionalSpring("s", "rail", torque=ForceLaw("-rail.travel")),))


def test_a_constant_tension_does_the_work_of_its_shortening():
    cord = LinearSpring("cord", PointRef("ground", "W"), PointRef("arm", "B"), force=ForceLaw("F", {"F": 7.0}))
    run = simulate_motion(replace(tied(force=cord.force), linear_springs=(cord,), gravity=(0.0, 0.0)), 0.3, samples=7)
    places = ["first(arm.B.x)", "first(arm.B.y)", "last(arm.B.x)", "last(arm.B.y)"]
    x0, y0, x1, y1 = pf.metrics(run, places).values()
    shorter = np.hypot(x0 - 0.1, y0 + 0.3) - np.hypot(x1 - 0.1, y1 + 0.3)
    assert run.solution.kinetic_energy[-1] == pytest.approx(7.0 * shorter, rel=1e-4)
    assert shorter > 0.05


def test_a_load_and_its_reaction_leave_the_momentum_as_it_is():
    """Two free bars: a torque by law between them turns both, and a force between their ends moves both."""
    bars = tuple(RigidBody(name, MASS, 0.02, points={"A": (0.0, 0.0), "B": (0.3, 0.0)}) for name in ("one", "two"))
    law, ref = ForceLaw("5 * sin(2 * pin.angle) - 0.1 * pin.rate"), PointRef
    spring = AppliedTorque("twist", ref("two", "A"), law, reaction=ref("one", "B"))
    push = PointForce("push", ref("two", "A"), (ForceLaw("two.A.x"), 2.0), reaction=ref("one", "B"))
    assembly = Assembly("start", {"one": 0.0, "two": 0.4}, {ref("one", "A"): (0.0, 0.0)})
    pin = RevoluteJoint("pin", ref("one", "B"), ref("two", "A"))
    free = Mechanism("bars", {}, bars, (pin,), loads=(spring, push), assemblies=(assembly,))
    run = simulate_motion(free, 1.0, samples=5, options=FINE)
    v, q = run.solution.v, run.solution.q
    assert_allclose(v[:, [0, 1]] + v[:, [3, 4]], 0.0, rtol=0, atol=1e-9)
    about = sum(0.02 * v[:, k + 2] + MASS * (q[:, k] * v[:, k + 1] - q[:, k + 1] * v[:, k]) for k in (0, 3))
    assert_allclose(about, 0.0, rtol=0, atol=1e-7)
    assert np.max(np.abs(v)) > 1.0
    assert run.solution.energy_balance_max < 1e-5
    # Results have the load at its point.
    data = pf.motion_dataset(run)
    assert_allclose(data["load_force"].sel(load="push", axis="x"), data["point_position"].sel(point="two.A", axis="x"))


def test_a_law_in_time_and_a_table_over_the_travel_are_what_they_say():
    """t and a linear table; a table's first and last values hold beyond its ends."""
    table = TabulatedProfile((-1.0, 0.0, 0.1, 5.0), (0.0, 0.0, -3.0, -3.0), "linear")
    both = [
        slider(ForceLaw("2 + sin(4 * t) + 0 * rail.travel")),
        slider(ExpressionProfile("2 + sin(4 * t)")),
        slider(ForceLaw("rail.travel", table=table)),
        slider(ForceLaw("-30 * min(max(rail.travel, 0), 0.1)")),
    ]
    ends = [simulate_motion(each, 0.7, samples=3, options=FINE).solution.q[:, 0] for each in both]
    assert_allclose(ends[0], ends[1], rtol=0, atol=1e-6)
    assert_allclose(ends[2], ends[3], rtol=0, atol=1e-6)
    found = load_values(
        build_system(both[2]), np.zeros(4), np.array([[x, 0, 0] for x in (-9, 0.05, 0.1, 80)]), np.zeros((4, 3))
    )
    assert_allclose(found[:, 0, 0], [0.0, -1.5, -3.0, -3.0], rtol=0, atol=1e-15)
    spline = TabulatedProfile((-1.0, 0.0, 0.2, 1.0, 2.0, 4.0), (1.0, 2.0, -1.0, 0.0, 3.0, 2.0))
    places = np.linspace(-1.0, 4.0, 41)
    q = np.column_stack([places, np.zeros((41, 2))])
    found = load_values(build_system(slider(ForceLaw("rail.travel", table=spline))), places, q, 0.0 * q)
    assert_allclose(found[:, 0, 0], spline.evaluate(places)[0], rtol=0, atol=1e-11)


def test_statics_balance_a_hardening_law_and_give_its_stiffness():
    """2 N against 5 x + 100 x^3."""
    hardening = slider(ForceLaw("-5 * rail.travel - 100 * rail.travel**3"))
    found = pf.statics(hardening, loads={"rail": 2.0}, stiffness=["rail"], steps=4)
    data = pf.statics_dataset(found)
    (x,) = [root.real for root in np.roots([100.0, 0.0, 5.0, -2.0]) if abs(root.imag) < 1e-12]
    assert data["joint_coordinate"].sel(joint="rail").values[-1] == pytest.approx(x, rel=1e-9)
    assert found.stiffness("rail")[-1] == pytest.approx(5.0 + 300.0 * x**2, rel=1e-9)


def test_torques_along_a_path_carry_laws():
    """The tool's force by a law of its place and speed, taken by the motors; and in results the same force."""
    push = (ForceLaw("-20 * (distal2.C.x - 0.01) - 3 * distal2.C.vx"), ForceLaw("5 * sin(A1.angle) + t"))
    loads = (PointForce("tool", PointRef("distal2", "C"), push),)
    mechanism = replace(make_five_bar(), loads=loads)
    task = plan_tracking(mechanism, Line((0.0, 0.30), (0.04, 0.27), 20.0), duration=0.2, samples=41)
    run = task.simulate("++", options=FINE)
    assert np.max(np.linalg.norm(run.driven.actual - run.driven.desired, axis=1)) < 1e-6
    data = tracking_dataset([run])
    place, speed = (data[name].sel(point="distal2.C", axis="x")[0] for name in ("point_position", "point_velocity"))
    expected = -20.0 * (place - 0.01) - 3.0 * speed
    assert_allclose(data["load_force"].sel(load="tool", axis="x")[0], expected, rtol=0, atol=1e-12)
    angle = data["joint_coordinate"].sel(joint="A1")[0]
    assert_allclose(
        data["load_force"].sel(load="tool", axis="y")[0], 5 * np.sin(angle) + data["time"], rtol=0, atol=1e-12
    )


def test_finite_segments_and_frames_have_laws_of_points_on_their_parts():
    law = ForceLaw("-300 * (link1.B1.y - 0.2) - 2 * link1.B1.vy")
    loads = (PointForce("hold", PointRef("link1", "B1"), (0.0, law)),)
    mechanism = replace(raparm_i(), loads=loads)
    line = Line((0.0, 0.264), (0.01, 0.264), 5.0)
    task = plan_tracking(mechanism, line, duration=0.05, samples=6)
    whole = task.simulate("++++").driven.actual
    framed = mechanism.with_bodies([replace(mechanism.body("link1"), frames=2, elements=4)])
    for other in (task.in_segments(12), task.remodelled(framed)):
        assert_allclose(other.simulate("++++").driven.actual, whole, rtol=0, atol=2e-5)


PRESS = """
name = "press"
[parameters]
k = "40 N/mm"
[ground]
O = [0, 0]
[body.ram]
type = "rigid"
mass = 0.05
inertia = 1e-5
points = { B = [0, 0], "T-1" = [0, "-30 mm"] }
[joint.guide]
type = "prismatic"
points = ["ground.O", "ram.B"]
[assembly.start]
ram = 0
[load.press]
type = "force"
point = "ram.B"
force = ["-k * max(0, guide.travel - 20 mm) - 30 N s/m * guide.rate", "'ram.T-1.vy' * 3"]
[load.stroke]
type = "torque"
point = "ram.B"
over = "1000 * guide.travel"
table = [[0, 0], [10, 2], [20, 5]]
interpolation = "linear"
[linear_spring.bumper]
points = ["ground.O", "ram.T-1"]
force = "k * (bumper.length - 30 mm) + 2 N s/m * bumper.length_rate"
[study]
duration = 0.1
"""


def read(text=PRESS):
    return model_from(tomllib.loads(text), "press.toml")


def test_a_file_over_the_travel_has_columns_in_units(tmp_path):
    (tmp_path / "stroke.csv").write_text("s [mm], M [N m]\n0, 0\n10, 2\n20, 5\n")
    text = PRESS.replace('"1000 * guide.travel"', '"guide.travel"').replace(
        "[[0, 0], [10, 2], [20, 5]]", '"stroke.csv"'
    )
    (tmp_path / "press.toml").write_text(text)
    assert_allclose(pf.load(tmp_path / "press.toml").mechanism.loads[1].torque.table.times, [0.0, 0.01, 0.02])
    (tmp_path / "stroke.csv").write_text("s [kg], M [N m]\n0, 0\n10, 2\n")
    with pytest.raises(InputError, match=r"column 1 of stroke.csv is in kg where m is asked for"):
        pf.load(tmp_path / "press.toml")
    (tmp_path / "stroke.csv").write_text("0, 0, 0\n")
    with pytest.raises(InputError, match=r"give guide.travel in m and a value in every line below the headings"):
        pf.load(tmp_path / "press.toml")


def test_rigid_torques_name_a_law_that_is_not_finite():
    law = '"log((10 mm - guide.travel) / 1 m)"'
    model = read(PRESS.replace('"-k * max(0, guide.travel - 20 mm) - 30 N s/m * guide.rate"', law))
    with pytest.raises(InputError, match=r"load.press.force: not a finite number at t = 0\.\d+ s"):
        pf.torques(model, "guide", start=0.0, end=0.02, speed=0.1)
    spring = f'[spring.coil]\njoint = "guide"\ntorque = {law.replace("log", "1 N * log")}\n[study]'
    with pytest.raises(InputError, match=r"spring.coil.torque: not a finite number at t = 0\.\d+ s"):
        pf.torques(read(PRESS.replace("[study]", spring)), "guide", start=0.0, end=0.02, speed=0.1)


def test_files_hold_laws_of_springs(tmp_path):
    """A file has them as loads once it is saved; a force may be a number with a unit."""
    springs = '[spring.s]\njoint = "guide"\ntorque = "-k * guide.travel - 2 N"\n[linear_spring.rope]\n'
    springs += 'points = ["ground.O", "ram.T-1"]\nforce = "0.02 kN"\n[study]'
    model = read(PRESS.replace("[study]", springs))
    model.save(tmp_path / "again.toml")
    again = pf.load(tmp_path / "again.toml").mechanism
    assert again == model.mechanism
    assert again.loads[-1] == PointForce(
        "s", PointRef("ram", "B"), (ForceLaw("-k * guide.travel - 2 N", {"k": 4e4}), 0.0)
    )
    system = build_system(again)
    assert line_laws(system, np.array([[0.021, 0.0, 0.0]]), np.zeros((1, 3)))[0, 1] == pytest.approx(20.0, rel=1e-12)


def test_files_hold_laws(tmp_path):
    model = read()
    (force, vertical), torque = model.mechanism.loads[0].force, model.mechanism.loads[1].torque
    assert (force.parameters, vertical.parameters, torque.table.values) == ({"k": 4e4}, {}, (0.0, 2.0, 5.0))
    assert torque.text == "1000 * guide.travel"
    assert model.mechanism.linear_springs[0].force.parameters == {"k": 4e4}
    model.save(tmp_path / "again.toml")
    assert pf.load(tmp_path / "again.toml").mechanism == model.mechanism
    system = build_system(model.mechanism)
    found = load_values(system, np.zeros(1), np.array([[0.021, 0.0, 0.0]]), np.array([[0.1, 2.0, 0.0]]))
    assert_allclose(found[0], [[-40.0 - 3.0, 6.0, 0.0], [0.0, 0.0, 5.0]], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("guide.travel - 20 mm", "guide.angle - 20 mm", "a sum of quantities in rad and in m"),
        ("'ram.T-1.vy' * 3", "guide.angle", "load.press.force.1: a prismatic joint has a travel and not an angle"),
        ("'ram.T-1.vy' * 3", "gide.rate", "unknown joint (got 'gide')"),
        ("'ram.T-1.vy' * 3", "ram.C.y", "load.press.force.1: unknown point (got 'ram.C')"),
        ("'ram.T-1.vy' * 3", "ram.B.z", "ram.B has x, y, vx, vy"),
        ("'ram.T-1.vy' * 3", "guide.x", "a joint has angle, travel, rate"),
        ("'ram.T-1.vy' * 3", "step(guide.travel)", 'a force must not jump as "step" does'),
        ("'ram.T-1.vy' * 3", "max(guide.travel)", "max takes two arguments, not 1"),
        ("'ram.T-1.vy' * 3", "guide.travel * q", 'unknown parameter "q"'),
        ("'ram.T-1.vy' * 3", "5 mm * guide.travel", "a quantity in m^2 where one in N is asked for"),
        ('over = "1000 * guide.travel"', 'over = "2 * t"', "load.stroke.over: contains no joint and no point"),
        ('over = "1000 * guide.travel"', 'over = "guide.angle"', "load.stroke.over: a prismatic joint has a travel"),
        (
            '"1000 * guide.travel"',
            '"guide"',
            "unknown parameter \"guide\" (got 'guide'); choose from k; of a joint write guide.angle or guide.travel",
        ),
        ("table = [[0, 0], [10, 2], [20, 5]]", "torque = 3", "load.stroke.over: is for tables only"),
        ("[10, 2], [20, 5]", "[20, 2], [10, 5]", "its values of 1000 * guide.travel must ascend, but row 3 does not"),
        (
            '1000 * guide.travel"\ntable = [[0, 0], [10, 2]',
            'guide.travel"\ntable = [[0, 0], ["-1 mm", 2]',
            "its values of guide.travel must ascend, but row 2 does not (got -0.001); it follows 0 m",
        ),
        (
            '1000 * guide.travel"\ntable = [[0,',
            'guide.travel"\ntable = [["0 s",',
            "give a list of [guide.travel, torque] in m and N m, or the name of a file with two such columns",
        ),
        (
            '1000 * guide.travel"\ntable = [[0, 0]',
            'guide.rate"\ntable = [[0, 0, 0]',
            "give a list of [guide.rate, torque] in SI units and N m",
        ),
        ("2 N s/m * bumper.length_rate", "t * 1 N/s", "linear_spring.bumper.force: contains the time"),
        ("bumper.length_rate", "bumber.length_rate", "linear_spring.bumper.force: unknown spring between points"),
        ("bumper.length_rate", "bumper.rate", "linear_spring.bumper.force: unknown joint"),
        ('force = "k * (', 'length = 2 # "', "linear_spring.bumper: gives no force"),
        ('force = "k * (', 'force = "5 mm" # "', "a quantity in m where one in N is asked for"),
        ("[study]", '[spring.s]\njoint = "guide"\n[study]', "spring.s: gives no torque; give the stiffness in N m/rad"),
        ("[study]", '[spring.s]\njoint = "guide"\ntorque = "guid.travel"\n[study]', "spring.s.torque: unknown joint"),
        ("[study]", '[spring.s]\njoint = "guide"\ntorque = "3 N m * guide.travel / 1 m"\n[study]', "where one in N is"),
        ("[study]", '[spring.press]\njoint = "guide"\ntorque = 3\n[study]', "spring.press: a load has its name"),
        ('force = "k * (', 'force = "bumper.length * 1 m" # "', "a quantity in m^2 where one in N is asked for"),
        ('1000 * guide.travel"\ntable = [[0,', 'guide.travel"\ntable = [["0 kg",', "kg where one in m is asked for"),
        ('point = "ram.B"\nover', 'point = "ram.B"\nreaction = "ram.Q"\nover', "unknown point"),
        (
            'point = "ram.B"\nover',
            'point = "ram.B"\nreaction = "ram.B"\nover',
            "load.stroke.reaction: at its own point",
        ),
    ],
)
def test_mistakes_are_named(old, new, says):
    text = PRESS.replace(old, new)
    if "torque = 3" in text:
        text = text.replace('interpolation = "linear"\n', "")
    with pytest.raises(InputError) as error:
        read(text)
    assert says in str(error.value)


@pytest.mark.parametrize(("force", "told"), [("-9 * arm.B.y", False), ("-9 * (arm.B.x + arm.B.y)", True)])
def test_forces_without_energy_are_told(force, told):
    """A force along y by y is a spring; one along y by x has no energy, and no symmetric stiffness."""
    made = pendulum(loads=(PointForce("hold", PointRef("arm", "B"), (0.0, ForceLaw(force))),), gravity=(0.0, -9.81))
    joints = (PrismaticJoint("up", PointRef("ground", "O"), PointRef("post", "A"), direction=np.pi / 2), made.joints[0])
    post = RigidBody("post", 1.0, 0.1, points={"A": (0.0, 0.0)})
    pin = replace(joints[1], a=PointRef("post", "A"))
    assembly = Assembly("start", {"arm": 0.5, "post": 0.0})
    free = replace(made, bodies=(post, *made.bodies), joints=(joints[0], pin), assemblies=(assembly,))
    assert ("laws-without-energy" in {one.code for one in pf.check(free).findings}) == told
    found = pf.statics(free, held=["pin"], loads={"up": 1.0}, warning=False)
    assert ("laws-without-energy" in {one.code for one in found.findings}) == told


def test_a_parameter_with_a_unit_is_varied_in_its_dimension():
    study = {"mechanism": read(), "duration": 0.1, "samples": 11, "metrics": ["stress_max"]}
    assert pf.load_sweep(study | {"vary": {"parameters.k": {"values": ["3 N/mm"]}}}).designs.tolist() == [[3000.0]]
    with pytest.raises(InputError, match=r"^vary.parameters.k.values: a quantity in m where one in N/m is asked for"):
        pf.load_sweep(study | {"vary": {"parameters.k": {"values": ["3 km"]}}})


def test_a_law_that_stops_being_finite_in_a_run_is_named():
    """A root that has no value beyond 0.2 m, which the mass reaches at its speed then."""
    made = slider(ForceLaw("1 + sqrt(0.2 - rail.travel)"))
    with pytest.raises(IntegrationError, match=r"^load\.push\.force has no finite value beyond this state") as error:
        simulate_motion(made, 3.0, samples=31, options=FINE)
    assert error.value.partial.solution.q[-1, 0] < 0.2


@pytest.mark.parametrize("words", [["statics", "--load", "guide=1"], ["linearise", "--force-at", "ram.B"]])
def test_commands_name_the_file_of_a_law_that_is_not_finite(tmp_path, words):
    file = tmp_path / "press.toml"
    law = '"log(-1 - guide.travel / 1 m) * 1 N"'
    file.write_text(PRESS.replace('"-k * max(0, guide.travel - 20 mm) - 30 N s/m * guide.rate"', law))
    done = paraflex(words[0], str(file), *words[1:])
    assert done.returncode == 2
    assert f"{file}: load.press.force: not a finite number at t = 0 s" in done.stderr


def test_commands_name_the_file_of_a_spring_whose_law_is_not_finite(tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text(
        'name = "arm"\nground = { O = [0, 0] }\njoint = { O = ["ground.O", "arm.O"] }\n'
        '[body.arm]\nmass = 1.0\ninertia = 0.01\npoints = { O = [0, 0], E = ["200 mm", 0] }\n'
        '[spring.coil]\njoint = "O"\ntorque = "-1 / O.angle"\n'
        "[assembly.home]\narm = 0.0\n"
    )
    done = paraflex("statics", file, "--load", "arm.E.y=-1", "--hold", "none")
    assert done.returncode == 2
    assert f"{file}: spring.coil.torque: not a finite number at t = 0 s" in done.stderr


def test_components_over_different_quantities_have_no_file(tmp_path):
    """A table over the travel beside a law of its own, beside a table in time, and beside one over another quantity."""
    table, text = TabulatedProfile((0.0, 1.0), (0.0, 2.0)), "rail.travel"
    for other in (ForceLaw(text), table, ForceLaw("2 * rail.travel", table=table)):
        made = slider(0.0, loads=(PointForce("push", PointRef("block", "C"), (ForceLaw(text, table=table), other)),))
        with pytest.raises(InputError, match=r"^load\.push"):
            made.save(tmp_path / "no.toml")
