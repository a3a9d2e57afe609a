"""Distance joints, rods without mass: closed forms, plans, studies, models in files and drawings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import paraflex as pf
from paraflex.cli.inspect import describe
from paraflex.designs.sweep import load_sweep
from paraflex.dynamics import build_system, consistent_state, natural_frequencies
from paraflex.dynamics.soundness import mobility
from paraflex.engines.common import check_engine
from paraflex.errors import InputError
from paraflex.mechanism import (
    Assembly,
    ConstantSpeed,
    DistanceJoint,
    FlexibleBeam,
    Geometry,
    LumpedMass,
    Material,
    Mechanism,
    ModalDamping,
    Motor,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    RigidBody,
    Section,
    finite_segments,
)
from paraflex.motion import simulate_motion
from paraflex.plots.marks import moving_marks, still_marks
from paraflex.plots.scene import scene
from paraflex.results import motion_dataset

ref = PointRef.parse
EXACT = pf.IntegrationOptions(tolerance=1e-8)
G = 9.81

ENGINE = """
name = "engine"
gravity = [0, -9.81]

[ground]
O = [0, 0]

[body.disc]
type = "rigid"
mass = 1
inertia = 0.1
points = {O = [0, 0], A = [0.3, 0]}

[body.piston]
type = "rigid"
mass = 3
inertia = 0.1
points = {B = [0, 0]}

[joint]
O = ["ground.O", "disc.O"]
rod = {type = "distance", points = ["disc.A", "piston.B"]}
rail = {type = "prismatic", points = ["ground.O", "piston.B"]}

[motor]
drive = "O"

[sensor.force]
type = "joint_force"
joint = "rod"
axis = "along"

[end_effector]
point = "piston.B"
coordinates = ["x"]

[mode]
"+" = ["drive"]

[path.stroke]
type = "line"
start = [0.9, 0]
end = [0.7, 0]
max_acceleration = 10.0

[assembly.a]
disc = 1.1
piston = 0
points = {"piston.B" = [0.9, 0]}
"""
# The piston's place by the angle of the crank, x = r cos t + sqrt(l^2 - r^2 sin^2 t), and its two derivatives.
R, L = 0.3, 0.8


def exact_angles(times):
    """Of the crank that begins at 0 with -2.5 rad/s: (J + m x'^2) w^2 is constant, the energy."""
    scale = (0.1 + 3.0 * piston(0.0)[1] ** 2) * 2.5**2
    return solve_ivp(
        lambda _, y: -np.sqrt(scale / (0.1 + 3.0 * piston(y)[1] ** 2)), (0, times[-1]), [0.0], "DOP853", times,
        rtol=1e-12, atol=1e-12,
    ).y[0]  # fmt: skip


def piston(angle):
    c, s = np.cos(angle), np.sin(angle)
    root = np.sqrt(L**2 - (R * s) ** 2)
    slope = -(R**2) * s * c / root
    return R * c + root, -R * s + slope, -R * c - R**2 * (c**2 - s**2) / root - slope**2 / root


@pytest.fixture
def engine(tmp_path):
    """The engine with a rod of 0.8 m, started at any angle."""

    def make(angle=0.0, more="", length="length = 0.8"):
        text = ENGINE.replace("disc = 1.1", f"disc = {angle}").replace("[0.9, 0]}", f"[{piston(angle)[0]}, 0]}}")
        text = text.replace('"piston.B"]}\nrail', f'"piston.B"], {length}}}\nrail') if length else text
        file = tmp_path / "engine.toml"
        file.write_text(text + more)
        return pf.load(file)

    return make


def point_mass(name, mass):
    return RigidBody(name, mass, 1e-3, (0.0, 0.0), {"C": (0.0, 0.0)})


def double_pendulum(**more):
    """Two point masses on rods of 0.5 m and 0.3 m; the masses do not turn."""
    return Mechanism(
        name="double pendulum",
        ground={"O": (0.1, 0.2)},
        bodies=(point_mass("upper", 1.2), point_mass("lower", 0.7)),
        joints=(
            DistanceJoint("one", ref("ground.O"), ref("upper.C"), 0.5),
            DistanceJoint("two", ref("lower.C"), ref("upper.C"), 0.3),
        ),
        assemblies=(
            Assembly("start", {"upper": 0.0, "lower": 0.0}, {
                ref("upper.C"): (0.1 + 0.5 * np.sin(0.8), 0.2 - 0.5 * np.cos(0.8)),
                ref("lower.C"): (0.1 + 0.5 * np.sin(0.8) + 0.3, 0.2 - 0.5 * np.cos(0.8)),
            }),
        ),
        gravity=(0.0, -G),
        **more,
    )  # fmt: skip


def by_lagrange(times):
    """Angles of the rods against the vertical, and their tensions."""
    (m1, m2), (l1, l2) = (1.2, 0.7), (0.5, 0.3)

    def rates(_, y):
        a, b, u, w = y
        d = a - b
        M = np.array([[(m1 + m2) * l1, m2 * l2 * np.cos(d)], [m2 * l1 * np.cos(d), m2 * l2]])
        right = [
            -m2 * l2 * w**2 * np.sin(d) - (m1 + m2) * G * np.sin(a),
            m2 * l1 * u**2 * np.sin(d) - m2 * G * np.sin(b),
        ]
        return np.array([u, w, *np.linalg.solve(M, right)])

    y = solve_ivp(rates, (0, times[-1]), [0.8, np.pi / 2, 0, 0], "DOP853", times, rtol=1e-12, atol=1e-12).y
    tensions = []
    for a, b, u, w in y.T:
        du, dw = rates(0.0, (a, b, u, w))[2:]
        along = np.array([np.sin(b), -np.cos(b)])
        acceleration = l1 * (du * np.array([np.cos(a), np.sin(a)]) + u**2 * np.array([-np.sin(a), np.cos(a)]))
        acceleration += l2 * (dw * np.array([np.cos(b), np.sin(b)]) + w**2 * np.array([-np.sin(b), np.cos(b)]))
        second = m2 * (np.array([0.0, -G]) - acceleration) @ along
        # Of both masses along the upper rod.
        up = np.array([np.sin(a), -np.cos(a)])
        first = m1 * (G * np.cos(a) + l1 * u**2) + second * along @ up
        tensions.append((first, second))
    return y, np.array(tensions)


# --- Closed forms ---------------------------------------------------------------------------------------------------


def test_a_rod_without_mass_drives_a_piston(engine):
    start = "\n[start.velocity.angular]\ndisc = -2.5\n[study]\nduration = 10.0\nsamples = 101\n"
    model = engine(more=start, length="")
    assert model.mechanism.joint("rod").length == pytest.approx(0.8, abs=1e-12)
    run = simulate_motion(model, 10.0, samples=101, options=EXACT)
    # By another program the angle at 10 s is -16.814995.
    np.testing.assert_allclose(run.solution.q[:, 2], exact_angles(run.times), rtol=0, atol=3e-6)
    assert run.solution.q[-1, 2] == pytest.approx(-16.814995, abs=3e-6)
    assert run.solution.energy_balance_max < 1e-7


# Of the lighter one accelerations are rounding: some 2e-5 rad, another number on every processor.
@pytest.mark.parametrize(("mass", "within"), [(1e-8, 3e-5), (1e-12, 1e-4)])
def test_a_body_of_nearly_no_mass_between_heavy_ones_moves_as_the_rod(engine, mass, within):
    """What it carries from one to the other starts them, and is no contradiction of constraints."""
    mechanism = engine().mechanism
    rod = RigidBody("rod", mass, mass, (0.5 * L, 0.0), {"A": (0.0, 0.0), "B": (L, 0.0)})
    joints = [joint for joint in mechanism.joints if joint.name != "rod"]
    pins = (RevoluteJoint("A", ref("disc.A"), ref("rod.A")), RevoluteJoint("B", ref("rod.B"), ref("piston.B")))
    light = replace(
        mechanism, bodies=(*mechanism.bodies, rod), joints=(*joints, *pins), sensors=(),
        assemblies=(Assembly("flat", {"disc": 0.0, "rod": 0.0, "piston": 0.0}),),
    )  # fmt: skip
    run = simulate_motion(light, 0.5, samples=2, start=pf.Start(angular={"disc": -2.5}), warning=False)
    turned = run.solution.q[:, run.system.body("disc").angle]
    exact = exact_angles(np.array([0.0, 0.5]))
    assert turned[1] - turned[0] == pytest.approx(exact[1], abs=within)


def test_point_masses_on_rods_swing_as_lagrange_has_it():
    sensors = tuple(pf.JointForceSensor(name, name, "along") for name in ("one", "two"))
    run = simulate_motion(double_pendulum(sensors=sensors), 1.5, samples=31, options=EXACT)
    exact, tensions = by_lagrange(run.times)
    solution, rows = run.solution, run.system.rows
    upper = np.column_stack([0.1 + 0.5 * np.sin(exact[0]), 0.2 - 0.5 * np.cos(exact[0])])
    lower = upper + 0.3 * np.column_stack([np.sin(exact[1]), -np.cos(exact[1])])
    np.testing.assert_allclose(solution.q[:, :2], upper, rtol=0, atol=1e-6)
    np.testing.assert_allclose(solution.q[:, 3:5], lower, rtol=0, atol=1e-6)
    # No moment turns them.
    assert np.max(np.abs(solution.q[:, [2, 5]])) < 1e-12
    scale = np.max(np.abs(tensions))
    found = solution.multipliers[:, [rows.index("one length"), rows.index("two length")]]
    np.testing.assert_allclose(found, tensions, rtol=0, atol=1e-5 * scale)
    data = motion_dataset(run)
    np.testing.assert_allclose(data["sensor_reading"].values, found, rtol=0, atol=1e-9 * scale)
    # The first body pulls the second towards itself: of "two" that is the upper mass, pulled down the rod.
    force = data["joint_force"].sel(joint="two").values
    along = np.column_stack([np.sin(exact[1]), -np.cos(exact[1])])
    np.testing.assert_allclose(force, tensions[:, 1:] * along, rtol=0, atol=1e-5 * scale)
    assert np.max(np.abs(data["joint_moment"].values)) == 0.0
    assert solution.energy_balance_max < 1e-7
    assert run.findings == ()


def held_bar(**more):
    """A level bar of 1 m and 2 kg on a pin, its end held by a tie to a point 0.75 m above the pin."""
    bar = RigidBody("bar", 2.0, 2.0 / 12.0, (0.5, 0.0), {"O": (0.0, 0.0), "P": (1.0, 0.0)})
    return Mechanism(
        name="held bar",
        ground={"O": (0.0, 0.0), "G": (0.0, 0.75)},
        bodies=(bar,),
        joints=(
            RevoluteJoint("O", ref("ground.O"), ref("bar.O")),
            DistanceJoint("tie", ref("bar.P"), ref("ground.G"), 1.25),
        ),
        assemblies=(Assembly("level", {"bar": 0.0}),),
        sensors=(pf.JointForceSensor("tension", "tie", "along"),),
        gravity=(0.0, -G),
        **more,
    )


def test_a_tie_holds_a_bar_in_equilibrium():
    # Moments about the pin: T sin = W / 2, with sin = 0.75 / 1.25; T cos presses the bar on its pin.
    found = pf.statics(held_bar())
    tension = 0.5 * 2.0 * G / 0.6
    data = pf.statics_dataset(found)
    assert data["sensor_reading"].values[-1] == pytest.approx(tension, rel=1e-9)
    force = data["joint_force"].sel(joint="tie").values[-1]
    # On the ground point G, towards the bar's end.
    np.testing.assert_allclose(force, tension * np.array([0.8, -0.6]), rtol=1e-9)
    np.testing.assert_allclose(data["joint_force"].sel(joint="O").values[-1], [0.8 * tension, G], rtol=1e-9)


def test_a_strut_is_pressed():
    mechanism = replace(held_bar(), ground={"O": (0.0, 0.0), "G": (0.0, -0.75)})
    assert pf.statics_dataset(pf.statics(mechanism))["sensor_reading"].values[-1] == pytest.approx(
        -0.5 * 2.0 * G / 0.6, rel=1e-9
    )


def test_a_pendulum_on_two_parallel_rods_has_their_frequency():
    # A plate on parallel rods moves without turning, as a point mass on one of them does.
    plate = RigidBody("plate", 1.5, 0.3, (0.13, -0.1), {"A": (0.0, 0.0), "B": (0.4, 0.0)})
    mechanism = Mechanism(
        name="swing",
        ground={"A": (0.0, 0.0), "B": (0.4, 0.0)},
        bodies=(plate,),
        joints=tuple(DistanceJoint(name, ref(f"ground.{name}"), ref(f"plate.{name}"), 0.7) for name in "AB"),
        assemblies=(Assembly("hanging", {"plate": 0.0}, {ref("plate.A"): (0.0, -0.7)}),),
        gravity=(0.0, -G),
    )
    system = build_system(mechanism)
    state = consistent_state(system, mechanism.assembly())
    assert mobility(system, state).freedoms == 1
    (omega,) = natural_frequencies(system, state).frequencies
    assert omega == pytest.approx(np.sqrt(G / 0.7), rel=1e-9)


@pytest.mark.parametrize("geometry", list(Geometry))
def test_beams_on_rods_keep_their_energy_balance(geometry):
    section, nylon = Section.rectangle(width=0.02, thickness=0.005), Material(2e9, 1100.0)
    beams = [FlexibleBeam(name, length, section, nylon, points={"A": 0.0, "M": 0.6 * length, "B": length}, elements=2,
                          lumps=(LumpedMass("B", 0.1),))
             for name, length in (("left", 0.3), ("right", 0.4))]  # fmt: skip
    mechanism = Mechanism(
        name="beams on rods",
        ground={"L": (0.0, 0.0), "R": (0.6, 0.0)},
        bodies=(*beams, point_mass("bob", 0.3)),
        joints=(
            RevoluteJoint("L", ref("ground.L"), ref("left.A")),
            RevoluteJoint("R", ref("ground.R"), ref("right.A")),
            DistanceJoint("rod", ref("left.B"), ref("right.M")),
            DistanceJoint("hang", ref("right.B"), ref("bob.C"), 0.2),
        ),
        assemblies=(Assembly("up", {"left": 1.7, "right": 1.2, "bob": 0.0}, {ref("bob.C"): (0.85, 0.25)}),),
        gravity=(0.0, -G),
        geometry=geometry,
    )
    run = simulate_motion(mechanism, 0.5, samples=26, options=pf.IntegrationOptions(tolerance=1e-7))
    solution = run.solution
    assert solution.energy_balance_max < 1e-4 * np.max(solution.kinetic_energy)
    assert solution.constraint_position_max < 1e-6
    data = motion_dataset(run)["point_position"]
    for a, b, length in (("left.B", "right.M", mechanism.joint("rod").length or 0.0), ("right.B", "bob.C", 0.2)):
        apart = np.linalg.norm(data.sel(point=a).values - data.sel(point=b).values, axis=1)
        np.testing.assert_allclose(apart, length, rtol=0, atol=1e-6)
    # Two models of the same beams: finite segments come to the same motion.
    if geometry is Geometry.SECOND_ORDER:
        cut = finite_segments(mechanism, 12).mechanism
        assert cut.joint("rod").length == mechanism.joint("rod").length
        other = simulate_motion(cut, 0.2, samples=11, options=pf.IntegrationOptions(tolerance=1e-6))
        away = motion_dataset(other)["point_position"].sel(point="bob.C").values - data.sel(point="bob.C").values[:11]
        assert np.max(np.abs(away)) < 3e-3


# --- Closure, plans, studies ----------------------------------------------------------------------------------------


def test_a_prescribed_crank_moves_the_piston(engine):
    mechanism = replace(engine().mechanism, motors=(), modes=(),
                        prescribed=(PrescribedAngle("spin", "O", ConstantSpeed(0.0, 6.0)),))  # fmt: skip
    run = simulate_motion(mechanism, 2.0, samples=41, options=EXACT)
    x, slope, bend = piston(6.0 * run.times)
    np.testing.assert_allclose(run.solution.q[:, 3], x, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run.solution.v[:, 3], 6.0 * slope, rtol=0, atol=1e-5)
    np.testing.assert_allclose(run.solution.a[:, 3], 36.0 * bend, rtol=0, atol=1e-4)


def test_a_plan_finds_the_torque_along_a_path(engine):
    task = engine(1.1).plan("stroke", duration=0.4, samples=41)
    motion = task.motion
    angle = motion.q[:, 2]
    x, slope, bend = piston(angle)
    np.testing.assert_allclose(motion.q[:, 3], x, rtol=0, atol=1e-12)
    rate = motion.v[:, 3] / slope
    np.testing.assert_allclose(motion.v[:, 2], rate, rtol=0, atol=1e-9)
    acceleration = (motion.a[:, 3] - bend * rate**2) / slope
    np.testing.assert_allclose(motion.a[:, 2], acceleration, rtol=0, atol=1e-8)
    torque = 0.1 * acceleration + 3.0 * motion.a[:, 3] * slope
    run = task.simulate("+", options=EXACT)
    np.testing.assert_allclose(run.applied[:, 0], torque, rtol=0, atol=1e-9 * np.max(np.abs(torque)))
    assert pf.tracking_dataset([run])["tracking_rms"].item() < 1e-5


@pytest.mark.parametrize("length", ["length = 0.8", ""], ids=["given", "of the assembly"])
def test_derivatives_by_the_length_and_by_what_it_follows_from(engine, tmp_path, length):
    engine(1.1, length=length)
    field = 'joint.rod.length"]\nlow = 0.7999\nhigh = 0.8001' if length else 'ground.O.1"]\nlow = -1e-4\nhigh = 1e-4'
    text = f"""
mechanism = "engine.toml"
paths = ["stroke"]
modes = ["+"]
duration = 0.3
samples = 31
metrics = ["peak_torque_max"]

[integration]
tolerance = 1e-8

[vary.one]
fields = ["{field}
"""
    (tmp_path / "study.toml").write_text(text)
    found = pf.sensitivities(tmp_path / "study.toml").derivatives.item()
    (tmp_path / "sweep.toml").write_text(text + "number = 2\n")
    low, high = load_sweep(tmp_path / "sweep.toml").run(tmp_path / "runs").data["peak_torque_max"].values
    assert abs(found) > 1e-2
    assert found == pytest.approx((high - low) / 2e-4, rel=1e-4)


def test_a_linear_model_has_the_rod(engine):
    """A piston over a crank that a spring holds: frequency of the reduced mass and stiffness."""
    mechanism = replace(engine(1.1).mechanism, springs=(pf.TorsionalSpring("coil", "O", 50.0, 1.1),))
    system = build_system(mechanism)
    state = consistent_state(system, mechanism.assembly())
    (omega,) = natural_frequencies(system, state).frequencies
    assert omega == pytest.approx(np.sqrt(50.0 / (0.1 + 3.0 * piston(1.1)[1] ** 2)), rel=1e-9)


def test_a_rod_holds_a_damped_beam_across():
    """Ratios are of the beam between its pin and the pin of the rod, as between two pins."""
    section, steel = Section.rectangle(width=0.02, thickness=0.004), Material(210e9, 7800.0)
    beam = FlexibleBeam("beam", 1.0, section, steel, points={"A": 0.0, "B": 1.0}, damping=ModalDamping((0.02,)))
    mechanism = Mechanism(
        name="tied beam",
        ground={"A": (0.0, 0.0), "G": (1.0, 0.5)},
        bodies=(beam,),
        joints=(
            RevoluteJoint("A", ref("ground.A"), ref("beam.A")),
            DistanceJoint("tie", ref("beam.B"), ref("ground.G"), 0.5),
        ),
        assemblies=(Assembly("level", {"beam": 0.0}),),
    )
    system = build_system(mechanism)
    state = consistent_state(system, mechanism.assembly())
    model = pf.linearise(mechanism, assembly="level", forces=["beam.B"])
    poles = model.poles()
    lowest = poles[np.argmin(np.abs(np.abs(poles) - natural_frequencies(system, state).frequencies[0]))]
    assert -lowest.real / abs(lowest) == pytest.approx(0.02, rel=1e-6)


# --- Files, drawings, engines ---------------------------------------------------------------------------------------


def test_a_saved_model_has_the_rod(engine, tmp_path):
    model = engine(1.1, length="")
    model.save(tmp_path / "saved.toml")
    text = (tmp_path / "saved.toml").read_text()
    assert 'type = "distance"' in text
    assert pf.load(tmp_path / "saved.toml").mechanism == model.mechanism
    assert describe(model)["degrees_of_freedom"] == 1


def test_rods_are_drawn_from_pin_to_pin(engine):
    hung = engine(0.4).mechanism
    hung = replace(
        hung, bodies=(*hung.bodies, point_mass("bob", 0.2)), ground={"O": (0.0, 0.0), "G": (0.5, 0.6)},
        joints=(*hung.joints, DistanceJoint("hang", ref("ground.G"), ref("bob.C"), 0.3)),
        assemblies=(Assembly("a", {"disc": 0.4, "piston": 0.0, "bob": 0.0}, {
            ref("piston.B"): (piston(0.4)[0], 0.0), ref("bob.C"): (0.5, 0.3)}),),
    )  # fmt: skip
    run = simulate_motion(hung, 0.3, samples=4)
    data = motion_dataset(run)
    shown = scene(data, run.times)
    rods = {mark.name: mark.places for mark in moving_marks(shown, shown.limits) if mark.look == "rod"}
    places = data["point_position"]
    ends = {"rod": ("disc.A", "piston.B"), "hang": (None, "bob.C")}
    for name, points in ends.items():
        for point in points:
            at = np.tile([0.5, 0.6], (4, 1)) if point is None else places.sel(point=point).values
            nearest = np.min(np.linalg.norm(rods[name] - at[:, None], axis=2), axis=1)
            assert np.all(nearest < 0.01 * shown.limits.size)
    # The support of a rod on the ground stands there, whichever point comes first.
    supports = [
        mark.places for mark in still_marks(shown, shown.limits) if mark.name == "hang" and mark.look == "ground"
    ]
    np.testing.assert_allclose(supports[0][0, 0], [0.5, 0.6], atol=1e-12)


@pytest.mark.parametrize("engine_name", ["exudyn", "mujoco"])
def test_engines_refuse_rods_by_name(engine_name):
    with pytest.raises(InputError, match="joint that is not revolute") as caught:
        check_engine(engine_name, double_pendulum())
    assert caught.value.field == "joint.one"


# --- What makes no sense --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("length = 0.8", "length = 0", r"joint\.rod\.length: must be positive \(got 0\.0\)"),
        ("length = 0.8", "length = -1", r"joint\.rod\.length: must be positive"),
        ("length = 0.8", 'length = "1 s"', r"joint\.rod\.length: a quantity in s where one in m"),
        ("length = 0.8", "direction = 1", r"joint\.rod\.direction: .*distance joint has no direction|a distance joint"),
        ('"disc.A", "piston.B"]', '"disc.O", "disc.A"]', "needs two different bodies"),
        ('drive = "O"', 'drive = "rod"', "a distance joint has no angle or travel to act on"),
        ("mass = 3", "mass = 0", r'body\.piston\.mass: must be positive.*type = "distance"'),
        ("inertia = 0.1", "inertia = 0", r'body\.disc\.inertia: must be positive.*type = "distance"'),
    ],
)
def test_bad_rods_are_refused(engine, tmp_path, old, new, says):
    engine(0.4)
    text = (tmp_path / "engine.toml").read_text()
    assert old in text
    (tmp_path / "engine.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=says):
        pf.load(tmp_path / "engine.toml")


def test_a_rod_without_length_needs_an_assembly_with_its_points_apart():
    rods = double_pendulum()
    free = replace(rods.joints[0], length=None)
    on_it = replace(rods.assemblies[0], points={**rods.assemblies[0].points, ref("upper.C"): (0.1, 0.2)})
    with pytest.raises(InputError, match=r"ground\.O and upper\.C coincide in assembly start") as caught:
        replace(rods, joints=(free, rods.joints[1]), assemblies=(on_it,))
    assert caught.value.field == "joint.one.length"
    with pytest.raises(InputError, match="no assembly to take it from"):
        replace(rods, joints=(free, rods.joints[1]), assemblies=())
    given = replace(rods, joints=(free, rods.joints[1])).joint("one").length
    assert given == pytest.approx(0.5, abs=1e-12)


def test_a_body_on_rods_alone_needs_a_place():
    rods = double_pendulum()
    only = {ref("upper.C"): (0.4, -0.2)}
    with pytest.raises(InputError, match=r"distances alone do not determine a body's place \(got 'lower'\)") as caught:
        replace(rods, assemblies=(replace(rods.assemblies[0], points=only),))
    assert caught.value.field == "assembly.start.points"


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_rods_of_any_size(size):
    """A pendulum's period goes with the root of its length, in gravity that goes with it always the same."""
    rods = double_pendulum()
    scaled = replace(
        rods,
        ground={name: tuple(size * x for x in place) for name, place in rods.ground.items()},
        bodies=tuple(replace(one, inertia=1e-3 * size**2) for one in rods.bodies),
        joints=tuple(replace(one, length=size * one.length) for one in rods.joints),
        assemblies=(replace(rods.assemblies[0], points={
            point: tuple(size * x for x in place) for point, place in rods.assemblies[0].points.items()}),),
        gravity=(0.0, -G * size),
    )  # fmt: skip
    one = simulate_motion(rods, 0.5, samples=6, options=EXACT)
    other = simulate_motion(scaled, 0.5, samples=6, options=pf.IntegrationOptions(tolerance=1e-8 * size))
    np.testing.assert_allclose(other.solution.q[:, 3:5], size * one.solution.q[:, 3:5], rtol=0, atol=1e-6 * size)


def test_a_motor_cannot_act_on_a_rod():
    with pytest.raises(InputError, match="no angle or travel to act on"):
        double_pendulum(motors=(Motor("drive", "one"),))
    with pytest.raises(InputError, match="keeps a distance, so that it has no coordinate"):
        pf.statics(held_bar(), moved={"tie": 0.1})
