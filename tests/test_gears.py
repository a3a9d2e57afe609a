"""Gears: closed forms of wheels, planets, racks and chains; what they do to plans, studies and other models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import paraflex as pf
from paraflex.cli.inspect import describe
from paraflex.cli.inspect_tables import print_facts
from paraflex.dynamics import build_system, consistent_state, natural_frequencies, redundant_rows, static_equilibrium
from paraflex.dynamics.joint_coordinates import joint_coordinate
from paraflex.dynamics.joint_loads import joint_loads
from paraflex.dynamics.soundness import mobility
from paraflex.elastodynamics import simulate_ked
from paraflex.engines.common import check_engine
from paraflex.engines.mujoco import MuJoCoOptions, simulate_mujoco
from paraflex.errors import AssemblyError, InputError
from paraflex.files import load_data, model_from
from paraflex.integrators import METHODS
from paraflex.mechanism import (
    Assembly,
    FlexibleBeam,
    Gear,
    Geometry,
    Material,
    Mechanism,
    Motor,
    PointForce,
    PointRef,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    Section,
    TorsionalSpring,
    WeldJoint,
)
from paraflex.motion import simulate_motion
from paraflex.plots.marks import moving_marks
from paraflex.plots.scene import scene
from paraflex.plots.svg import sketch
from paraflex.reports.film import animation
from paraflex.reports.sweep import side_by_side
from paraflex.results import motion_dataset
from paraflex.results.drawing import assembled_data
from paraflex.results.record import record

ref = PointRef.parse
EXACT = pf.IntegrationOptions(tolerance=1e-9, step=1e-3)


def wheel(name, inertia, mass=0.5):
    return RigidBody(name, mass, inertia, (0.0, 0.0), {"O": (0.0, 0.0)})


def train(ratio, *, phase=None, angles=(0.3, -0.2), **more):
    """Two wheels on fixed pins."""
    return Mechanism(
        name="train",
        ground={"A": (0.0, 0.0), "B": (0.3, 0.0)},
        bodies=(wheel("one", 0.02), wheel("two", 0.05)),
        joints=(
            RevoluteJoint("A", ref("ground.A"), ref("one.O")),
            RevoluteJoint("B", ref("ground.B"), ref("two.O")),
        ),
        motors=(Motor("drive", "A"),),
        gears=(Gear("mesh", "A", "B", ratio, phase),),
        assemblies=(Assembly("start", dict(zip(("one", "two"), angles, strict=True))),),
        **more,
    )


def planetary(sun=0.04, planet=0.03):
    """A planet wheel on an arm, meshing with a sun that is fixed: by Willis, against the arm it turns with rs/rp."""
    arm = RigidBody("arm", 0.4, 1e-3, (0.03, 0.0), {"O": (0.0, 0.0), "P": (sun + planet, 0.0)})
    return Mechanism(
        name="planetary",
        ground={"O": (0.0, 0.0)},
        bodies=(arm, RigidBody("planet", 0.3, 2e-4, (0.0, 0.0), {"O": (0.0, 0.0)})),
        joints=(
            RevoluteJoint("centre", ref("ground.O"), ref("arm.O")),
            RevoluteJoint("pin", ref("arm.P"), ref("planet.O")),
        ),
        motors=(Motor("drive", "centre"),),
        gears=(Gear("mesh", "centre", "pin", sun / planet),),
        assemblies=(Assembly("start", {"arm": 0.2, "planet": -0.4}),),
    )


def rack(radius=0.04, **more):
    """A pinion on a pin and a rack on an inclined rail."""
    return Mechanism(
        name="rack and pinion",
        ground={"A": (0.0, 0.0), "R": (0.157, 0.04)},
        bodies=(wheel("pinion", 3e-4), RigidBody("rack", 0.8, 1e-3, (0.1, 0.0), {"R": (0.0, 0.0)})),
        joints=(
            RevoluteJoint("A", ref("ground.A"), ref("pinion.O")),
            PrismaticJoint("rail", ref("ground.R"), ref("rack.R"), direction=0.5, angle=0.5),
        ),
        gears=(Gear("mesh", "A", "rail", radius),),
        assemblies=(Assembly("start", {"pinion": 0.0, "rack": 0.5}),),
        **more,
    )


def turned(mechanism, name):
    """The same with the points of a joint in the other order."""
    joints = [replace(one, a=one.b, b=one.a) if one.name == name else one for one in mechanism.joints]
    return replace(mechanism, joints=tuple(joints))


def chain(ratio=-2.0, angles=(0.1, 0.5), **more):
    """Two links hanging in gravity, the second geared to the first."""
    links = [
        RigidBody(name, m, J, (c, 0.0), {"A": (0.0, 0.0), "B": (0.4, 0.0)})
        for name, m, J, c in (("upper", 1.2, 0.02, 0.2), ("lower", 0.7, 0.01, 0.15))
    ]
    return Mechanism(
        name="geared chain",
        ground={"O": (0.1, 0.2)},
        bodies=tuple(links),
        joints=(
            RevoluteJoint("hip", ref("ground.O"), ref("upper.A")),
            RevoluteJoint("knee", ref("upper.B"), ref("lower.A")),
        ),
        gears=(Gear("mesh", "hip", "knee", ratio),),
        gravity=(0.0, -9.81),
        assemblies=(Assembly("start", dict(zip(("upper", "lower"), angles, strict=True))),),
        **more,
    )


def chain_motion(times, ratio=-2.0):
    """The chain's angle from Lagrange's equation in its one coordinate, by another integrator."""
    (m1, J1, c1), (m2, J2, c2), l, g = (1.2, 0.02, 0.2), (0.7, 0.01, 0.15), 0.4, 9.81
    phase = 0.4 - ratio * 0.1

    def rates(_, y):
        theta, omega = y
        relative = ratio * theta + phase
        # T = 1/2 M(theta) omega^2, V(theta), with the lower link's angle theta + relative.
        n = 1.0 + ratio
        M = J1 + m1 * c1**2 + m2 * l**2 + (J2 + m2 * c2**2) * n**2 + 2 * m2 * l * c2 * n * np.cos(relative)
        dM = -2 * m2 * l * c2 * n * ratio * np.sin(relative)
        dV = g * ((m1 * c1 + m2 * l) * np.cos(theta) + m2 * c2 * n * np.cos(theta + relative))
        return [omega, (-dV - 0.5 * dM * omega**2) / M]

    run = solve_ivp(rates, (0.0, times[-1]), [0.1, 0.0], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=times)
    return run.y[0]


# --- Closed forms ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [-0.4, 3.0])
def test_a_wheel_feels_the_other_by_the_square_of_the_ratio(ratio):
    # Several turns: angles go on counting.
    run = simulate_motion(train(ratio), 2.0, torques={"drive": 1.5}, options=EXACT, samples=21)
    solution, t = run.solution, run.times
    expected = 0.5 * 1.5 / (0.02 + ratio**2 * 0.05) * t**2
    assert expected[-1] > 2 * np.pi
    np.testing.assert_allclose(solution.q[:, 2], 0.3 + expected, rtol=1e-7)
    np.testing.assert_allclose(solution.q[:, 5], -0.2 + ratio * expected, rtol=1e-7, atol=1e-7)
    # The multiplier is the torque on the second wheel, less.
    row = run.system.rows.index("mesh angle")
    np.testing.assert_allclose(-solution.multipliers[:, row], 0.05 * ratio * 1.5 / (0.02 + ratio**2 * 0.05), rtol=1e-7)


def test_a_planet_on_a_fixed_sun_turns_as_willis_has_it():
    mechanism, torque = planetary(), 0.3
    run = simulate_motion(mechanism, 1.0, torques={"drive": torque}, options=EXACT, samples=11)
    turned = run.solution.q - run.solution.q[0]
    whole = 1.0 + 0.04 / 0.03
    inertia = 1e-3 + 0.4 * 0.03**2 + 0.3 * 0.07**2 + 2e-4 * whole**2
    np.testing.assert_allclose(turned[:, 2], 0.5 * torque / inertia * run.times**2, rtol=1e-7)
    np.testing.assert_allclose(turned[:, 5], whole * turned[:, 2], rtol=1e-9, atol=1e-9)


def test_a_pinion_drives_a_rack():
    force = PointForce("push", ref("rack.R"), (2.0 * np.cos(0.5), 2.0 * np.sin(0.5)))
    run = simulate_motion(rack(loads=(force,)), 1.0, options=EXACT, samples=11)
    travel = joint_coordinate(run.system, "rail", run.solution.q).value
    np.testing.assert_allclose(travel, 0.5 * 2.0 / (0.8 + 3e-4 / 0.04**2) * run.times**2, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(run.solution.q[:, 2], travel / 0.04, rtol=1e-9, atol=1e-8)


def test_a_geared_chain_swings_as_lagrange_has_it():
    times = np.linspace(0.0, 1.5, 31)
    run = simulate_motion(chain(), 1.5, options=EXACT, samples=31)
    np.testing.assert_allclose(run.solution.q[:, 2], chain_motion(times), rtol=0, atol=1e-6)
    assert run.solution.energy_balance_max < 1e-7
    assert run.findings == ()


@pytest.mark.parametrize("method", METHODS)
def test_every_method_integrates_a_geared_chain(method):
    times = np.linspace(0.0, 0.5, 6)
    step = 5e-4 if METHODS[method].fixed_step else None
    options = pf.IntegrationOptions(method=method, tolerance=1e-6, step=step)
    run = simulate_motion(chain(), 0.5, options=options, samples=6)
    np.testing.assert_allclose(run.solution.q[:, 2], chain_motion(times), rtol=0, atol=2e-3)


def test_a_spring_at_one_wheel_swings_both():
    sprung = train(-0.5, springs=(TorsionalSpring("spring", "B", 7.0, -0.2),))
    system = build_system(sprung)
    found = natural_frequencies(system, consistent_state(system, sprung.assembly())).frequencies
    # In the angle of the second wheel: the first has four times its inertia there.
    np.testing.assert_allclose(found, [np.sqrt(7.0 / (0.05 + 0.02 / 0.5**2))], rtol=1e-9)


def soft_beam(geometry, wheel_inertia=2e-3):
    """A beam on a pin, geared to a wheel: the pin turns with the beam's slope."""
    beam = FlexibleBeam(
        "beam", 0.6, Section.rectangle(0.02, 0.006), Material(2e9, 1200.0), {"A": 0.0, "B": 0.6}, elements=4
    )
    return Mechanism(
        name="soft",
        ground={"A": (0.0, 0.0), "W": (0.2, 0.0)},
        bodies=(beam, wheel("one", wheel_inertia)),
        joints=(
            RevoluteJoint("pin", ref("ground.A"), ref("beam.A")),
            RevoluteJoint("W", ref("ground.W"), ref("one.O")),
        ),
        motors=(Motor("drive", "W"),),
        gears=(Gear("mesh", "W", "pin", -0.5),),
        gravity=(0.0, -9.81),
        geometry=geometry,
        assemblies=(Assembly("start", {"beam": 0.4, "one": 0.0}),),
    )


@pytest.mark.parametrize("geometry", list(Geometry), ids=lambda g: g.value)
def test_energy_is_kept_where_a_gear_turns_a_bending_beam(geometry):
    run = simulate_motion(
        soft_beam(geometry), 0.5, torques={"drive": 1.0}, samples=6, options=pf.IntegrationOptions(tolerance=1e-8)
    )
    solution = run.solution
    pin = joint_coordinate(run.system, "pin", solution.q).value
    np.testing.assert_allclose(pin, 0.4 - 0.5 * solution.q[:, -1], rtol=0, atol=1e-8)
    body = run.system.body("beam")
    slope = run.system.marker(ref("beam.A")).slope @ solution.q[:, body.flexible].T
    assert np.max(np.abs(slope)) > 0.01
    assert solution.energy_balance_max < 1e-5 * np.max(solution.kinetic_energy)


def test_a_wheel_that_cannot_turn_clamps_the_beam():
    """A gear holds the slope: frequencies are those of the beam welded to the ground."""
    geared = replace(soft_beam(Geometry.LINEAR, wheel_inertia=1e9), gravity=(0.0, 0.0))
    beam = geared.body("beam")
    weld = WeldJoint("pin", ref("ground.A"), ref("beam.A"), 0.4)
    clamped = replace(
        geared, bodies=(beam,), joints=(weld,), motors=(), gears=(), assemblies=(Assembly("start", {"beam": 0.4}),)
    )
    found, expected = (
        natural_frequencies(system, consistent_state(system, system.mechanism.assembly())).frequencies
        for system in (build_system(geared), build_system(clamped))
    )
    np.testing.assert_allclose(found[1:4], expected[:3], rtol=1e-6)
    # The first mode of a cantilever.
    mass = 1200.0 * 0.02 * 0.006
    stiffness = 2e9 * 0.02 * 0.006**3 / 12
    assert found[1] == pytest.approx(3.51602 * np.sqrt(stiffness / mass / 0.6**4), rel=1e-3)


def test_a_chain_in_equilibrium_swings_about_it():
    mechanism = chain(1.5, angles=(-1.3, -1.5))
    (m1, J1, c1), (m2, J2, c2), l, g, n = (1.2, 0.02, 0.2), (0.7, 0.01, 0.15), 0.4, 9.81, 2.5
    phase = -0.2 + 1.5 * 1.3

    def slope(theta):
        return g * ((m1 * c1 + m2 * l) * np.cos(theta) + m2 * c2 * n * np.cos(n * theta + phase))

    system = build_system(mechanism)
    state = static_equilibrium(system, consistent_state(system, mechanism.assembly()), [])
    theta = brentq(slope, state.q[2] - 0.1, state.q[2] + 0.1, xtol=1e-14)
    assert state.q[2] == pytest.approx(theta, abs=1e-9)
    M = J1 + m1 * c1**2 + m2 * l**2 + (J2 + m2 * c2**2) * n**2 + 2 * m2 * l * c2 * n * np.cos(1.5 * theta + phase)
    stiffness = (slope(theta + 1e-6) - slope(theta - 1e-6)) / 2e-6
    found = natural_frequencies(system, state)
    np.testing.assert_allclose(found.frequencies, [np.sqrt(stiffness / M)], rtol=1e-7)


def test_moments_in_joints_turn_the_wheels():
    """Euler's law for either wheel: the gear's torque is part of what its joint does."""
    run = simulate_motion(train(-2.0), 0.2, torques={"drive": 1.5}, options=EXACT, samples=3)
    loads = joint_loads(run.system, ("A", "B"), run.solution.q, run.solution.multipliers, np.full((3, 1), 1.5))
    np.testing.assert_allclose(loads.moment, run.solution.a[:, [2, 5]] * [0.02, 0.05], rtol=1e-9)


def test_one_brake_holds_both_cranks_as_two_do():
    task = pf.plan(pf.load("geared_five_bar"), "stroke", duration=0.4, samples=21, after="hold")
    assert task.holds
    both, one = (task.simulate(mode, options=pf.IntegrationOptions(tolerance=1e-7)).solution for mode in ("++", "+-"))
    np.testing.assert_allclose(both.q, one.q, rtol=0, atol=2e-6)
    cranks = [joint_coordinate(task.system, name, one.q).value[-3:] for name in ("A1", "A2")]
    np.testing.assert_allclose(np.ptp(cranks, axis=1), 0.0, atol=1e-9)


# --- What a gear is to a mechanism ----------------------------------------------------------------------------------


def test_a_gear_takes_a_freedom_once():
    geared = train(-2.0)
    twice = replace(geared, gears=(*geared.gears, Gear("again", "B", "A", -0.5)))
    for mechanism, repeated in ((geared, 0), (twice, 1)):
        system = build_system(mechanism)
        free = mobility(system, consistent_state(system, mechanism.assembly()))
        assert (free.freedoms, len(free.redundant)) == (1, repeated)
    assert redundant_rows(system, np.zeros(system.n))[0] in ("mesh angle", "again angle")
    assert set(free.redundant[0].among) == {"mesh", "again"}
    # Both hold, and the motion is the same.
    ends = [simulate_motion(each, 0.5, torques={"drive": 1.0}, samples=2).solution.q[-1] for each in (geared, twice)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-6)


def test_phases_that_contradict_each_other_are_told():
    contrary = replace(train(-2.0), gears=(Gear("mesh", "A", "B", -2.0), Gear("again", "A", "B", -2.0, 1.0)))
    with pytest.raises(AssemblyError, match=r"do not close: a gap of .* rad remains in (mesh|again) and (mesh|again)"):
        consistent_state(build_system(contrary), "start")


@pytest.mark.parametrize(
    ("make", "phase"),
    [(lambda: train(-2.0), -0.2 + 2.0 * 0.3), (planetary, -0.6 - 4 / 3 * 0.2), (chain, 0.4 + 0.2), (rack, 0.0)],
)
def test_a_phase_is_as_the_first_assembly_stands(make, phase):
    assert make().gears[0].phase == pytest.approx(phase, abs=1e-15)


def test_the_phase_of_a_rack_counts_its_travel():
    pushed = rack()
    assembly = Assembly(
        "start", {"pinion": 0.5, "rack": 0.5}, {ref("rack.R"): (0.157 + 0.3 * np.cos(0.5), 0.04 + 0.3 * np.sin(0.5))}
    )
    phase = replace(pushed, gears=(replace(pushed.gears[0], phase=None),), assemblies=(assembly,)).gears[0].phase
    assert phase == pytest.approx(0.3 - 0.04 * 0.5)


def test_a_phase_given_moves_the_assembly():
    mechanism = train(-2.0, phase=1.0)
    system = build_system(mechanism)
    q = consistent_state(system, mechanism.assembly()).q
    assert q[5] == pytest.approx(-2.0 * q[2] + 1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("gear", "says"),
    [
        (Gear("mesh", "A", "C", 2.0), "gear.mesh.joints: unknown joint .got 'C'."),
        (Gear("mesh", "A", "A", 2.0), "gear.mesh.joints: a gear needs two different joints"),
        (Gear("mesh", "A", "B", 0.0), "gear.mesh.ratio: must be a finite number other than zero .got 0.0"),
        (Gear("mesh", "A", "B", np.inf), "gear.mesh.ratio: must be a finite number other than zero .got inf"),
        (Gear("mesh", "A", "B", 1.0, np.nan), "gear.mesh.phase: not a finite number"),
        (Gear("me.sh", "A", "B", 1.0), "gear: not usable as a name"),
    ],
)
def test_bad_gears_are_refused(gear, says):
    with pytest.raises(InputError, match=says):
        replace(train(1.0), gears=(gear,))


def test_a_gear_needs_a_phase_or_an_assembly_and_joints_that_move():
    mechanism = train(1.0)
    bare = replace(mechanism, assemblies=(), gears=(Gear("mesh", "A", "B", 1.0, 0.0),))
    with pytest.raises(InputError, match=r"gear.mesh.phase: a gear's phase is not given, and there is no assembly"):
        replace(bare, gears=(Gear("mesh", "A", "B", 1.0),))
    weld = WeldJoint("B", ref("ground.B"), ref("two.O"))
    with pytest.raises(InputError, match=r"gear.mesh.joints: a weld does not move"):
        replace(mechanism, joints=(mechanism.joint("A"), weld))


# --- The geared five-bar of the library -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def five_bar():
    return pf.plan(pf.load("geared_five_bar"), "stroke", duration=0.12, samples=25)


def test_cranks_in_mirror_image_draw_a_straight_line(five_bar):
    place = five_bar.motion.desired.position
    np.testing.assert_allclose(place[:, 0], 0.0, atol=1e-12)
    assert np.ptp(place[:, 1]) > 0.03
    q, bodies = five_bar.motion.q, five_bar.motion.system
    angles = [q[:, bodies.body(f"proximal{side}").angle] for side in "12"]
    np.testing.assert_allclose(angles[0] + angles[1], np.pi, rtol=0, atol=1e-12)


def test_one_motor_drives_both_cranks_as_two_do(five_bar):
    both, left = (five_bar.torques(mode).evaluate(five_bar.motion.t) for mode in ("++", "+-"))
    # Least norm: torques +-T/2 each do half of the work.
    np.testing.assert_allclose(both, 0.5 * left[:, :1] * [1.0, -1.0], rtol=1e-9, atol=1e-9)
    runs = [five_bar.simulate(mode, options=pf.IntegrationOptions(tolerance=1e-8)) for mode in ("++", "+-")]
    ends = [pf.tracking_dataset([run])["end_effector"].values for run in runs]
    # Torques on bending cranks: the same only as far as these are stiff at their pins.
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-6)
    assert max(run.solution.energy_balance_max for run in runs) < 1e-5


def test_elastodynamics_hold_one_crank_or_both(five_bar):
    both, left = (simulate_ked(five_bar, mode, step=5e-4).solution.q for mode in ("++", "+-"))
    np.testing.assert_allclose(both, left, rtol=0, atol=1e-9)


def test_mujoco_has_the_same_gear(five_bar):
    task = five_bar.in_segments(3)
    ours = record(task.simulate("+-", options=pf.IntegrationOptions(tolerance=1e-9)))
    theirs = simulate_mujoco(task, "+-", MuJoCoOptions(step=2e-5))
    for what, within in (("point_position", 1e-7), ("angle", 1e-6), ("kinetic_energy", 1e-6), ("work", 1e-6)):
        a, b = ours.links[what], theirs.links[what]
        np.testing.assert_allclose(a, b, rtol=0, atol=within * np.ptp(a))
    with pytest.raises(InputError, match=r"gear.mesh: Exudyn cannot express a gear"):
        check_engine("exudyn", task.mechanism)


def test_segments_come_to_bend_as_beams_do(five_bar):
    # The wheels are heavy, and the nearest hinge is half a segment away: errors go with the length of segments.
    def error(task):
        found = pf.tracking_dataset([task.simulate("+-", options=pf.IntegrationOptions(tolerance=1e-6))])
        return (found["end_effector"] - found["end_effector_desired"]).values

    beams = error(five_bar)
    few, many = (np.max(np.abs(error(five_bar.in_segments(n)) - beams)) for n in (12, 48))
    assert many < 0.4 * few
    assert many < 0.1 * np.max(np.abs(beams))


def test_info_tells_what_gears_hold(capsys):
    facts = describe(pf.load("geared_five_bar"))
    assert facts["gears"] == ["mesh: A2 = -1 A1 + 3.142"]
    print_facts(facts)
    assert "mesh: A2 = -1 A1 + 3.142" in capsys.readouterr().out
    print_facts(describe(pf.load("pendulum")))
    assert "gears" not in capsys.readouterr().out


def test_a_saved_model_has_the_gear(tmp_path):
    model = pf.load("geared_five_bar")
    model.save(tmp_path / "saved.toml")
    assert pf.load(tmp_path / "saved.toml").mechanism == model.mechanism
    assert 'joints = ["A1", "A2"]' in (tmp_path / "saved.toml").read_text()


def test_derivatives_by_ratio_and_phase(tmp_path):
    (tmp_path / "study.toml").write_text("""
mechanism = "geared_five_bar"
paths = ["stroke"]
modes = ["+-"]
duration = 0.03
samples = 13
metrics = ["tracking_rms", "peak_torque_max"]

[integration]
step = 1e-3
tolerance = 1e-7

[vary.ratio]
fields = ["gear.mesh.ratio"]

[vary.phase]
fields = ["gear.mesh.phase"]

[vary.arm]
fields = ["parameters.l1"]
""")

    def metrics(place, value):
        data, name = load_data("geared_five_bar")
        *tables, key = place.split(".")
        table = data
        for each in tables:
            table = table[each]
        table[key] = value
        task = pf.plan(model_from(data, name), "stroke", duration=0.03, samples=13)
        found = pf.tracking_dataset([task.simulate("+-", options=pf.IntegrationOptions(step=1e-3, tolerance=1e-7))])
        return np.array([found["tracking_rms"].item(), found["torque"].isel(motor=0).max().item()])

    found, h = pf.sensitivities(tmp_path / "study.toml").derivatives.reshape(2, 3), 1e-4
    places = (("gear.mesh.ratio", -1.0), ("gear.mesh.phase", np.pi), ("parameters.l1", 0.25))
    for k, (place, value) in enumerate(places):
        difference = (metrics(place, value + h) - metrics(place, value - h)) / (2.0 * h)
        np.testing.assert_allclose(found[:, k], difference, rtol=2e-5)


# --- Drawings -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "radii"),
    [
        (planetary, (0.04, 0.03)),
        (lambda: train(-2.0), (0.2, 0.1)),
        (lambda: train(2.0), None),
        # A screw: the ratio is no radius.
        (lambda: rack(0.5), None),
        (rack, (0.04, np.inf)),
        (lambda: rack(-0.04), (0.04, -np.inf)),
        (lambda: turned(rack(), "A"), (0.04, -np.inf)),
        (lambda: turned(rack(), "rail"), (0.04, -np.inf)),
    ],
)
def test_wheels_that_mesh_outside_and_racks_have_pitch_lines(make, radii):
    mechanism = make()
    (found,) = assembled_data(mechanism)["gear_radius"].values
    np.testing.assert_allclose(found, (np.nan, np.nan) if radii is None else radii)
    lines = [part for part in sketch(mechanism).split("<polyline")[1:] if 'class="gear"' in part]
    circles = [len(line.split('points="')[1].split('"')[0].split()) > 2 for line in lines]
    assert circles == [False] if radii is None else [True, np.isfinite(radii[1])]
    assert all("stroke-dasharray" in line for line in lines)


@pytest.mark.parametrize("first", ["A", "rail"])
@pytest.mark.parametrize("radius", [0.04, -0.04])
def test_a_rack_moves_as_its_pinion_does_where_they_touch(radius, first):
    mechanism = rack(radius)
    if first == "rail":
        mechanism = replace(mechanism, gears=(Gear("mesh", "rail", "A", 1.0 / radius),))
    force = PointForce("push", ref("rack.R"), (2.0 * np.cos(0.5), 2.0 * np.sin(0.5)))
    run = simulate_motion(replace(mechanism, loads=(force,)), 0.3, samples=4, options=EXACT)
    shown = scene(motion_dataset(run), run.times)
    circle, line = (mark.places for mark in moving_marks(shown, shown.limits) if mark.look == "gear")
    along = np.array([np.cos(0.5), np.sin(0.5)])
    for k in range(4):
        start, end = line[k]
        np.testing.assert_allclose((end - start) / np.linalg.norm(end - start), along, atol=1e-9)
        distance, foot = np.linalg.norm(circle[k], axis=1), start - (start @ along) * along
        np.testing.assert_allclose(distance, 0.04, rtol=1e-9)
        assert np.linalg.norm(foot) == pytest.approx(0.04)
        # The pinion's velocity there, omega times the lever turned by a quarter, is the rack's.
        omega, speed = run.solution.v[k, 2], run.solution.v[k, 3:5]
        np.testing.assert_allclose(omega * np.array([-foot[1], foot[0]]), speed, rtol=1e-6, atol=1e-9)
    low, high = [shown.limits.left, shown.limits.bottom], [shown.limits.right, shown.limits.top]
    assert all(np.all(places >= low) and np.all(places <= high) for places in (circle, line))


def test_pitch_circles_touch_and_move_with_their_wheels():
    data = motion_dataset(simulate_motion(planetary(), 0.5, torques={"drive": 0.3}, samples=11))
    shown = scene(data, np.linspace(0.0, 0.5, 3))
    sun, planet = (mark.places for mark in moving_marks(shown, shown.limits) if mark.look == "gear")
    np.testing.assert_allclose(np.ptp(sun, axis=1), 0.08, rtol=1e-6)
    np.testing.assert_allclose(np.ptp(planet, axis=1), 0.06, rtol=1e-6)
    middle = planet[:, :-1].mean(axis=1)
    np.testing.assert_allclose(np.linalg.norm(middle, axis=1), 0.07, rtol=1e-5)
    assert np.linalg.norm(middle[-1] - middle[0]) > 0.01
    for places in (sun, planet):
        low, high = places.min(axis=(0, 1)), places.max(axis=(0, 1))
        assert np.all(low >= [shown.limits.left, shown.limits.bottom])
        assert np.all(high <= [shown.limits.right, shown.limits.top])


def test_pages_of_designs_draw_the_wheels_of_each():
    runs = []
    for ratio in (-1.0, -0.8):
        data, name = load_data("geared_five_bar")
        data["gear"]["mesh"]["ratio"] = ratio
        task = pf.plan(model_from(data, name), "stroke", duration=0.05, samples=6)
        runs.append(pf.tracking_dataset([task.simulate("+-")]))
    both = side_by_side(runs, ["a", "b"])
    np.testing.assert_allclose(both["gear_radius"].values, [[[0.1, 0.1]], [[0.2 / 2.25, 0.25 / 2.25]]])
    page = animation(both).to_dict()
    assert page["looks"]["gear"].dashed
    assert all([look for look, *_ in moving["pieces"]].count("gear") == 2 for _, moving in page["marks"])


RACK = """
name = "rack"
ground = { O = [0.0, 0.0], R = [0.0, 0.1] }
[body.pinion]
type = "rigid"
mass = 1.0
inertia = 0.1
points = { O = [0.0, 0.0] }
[body.rack]
type = "rigid"
mass = 1.0
inertia = 0.1
points = { R = [0.0, 0.0] }
[joint]
O = ["ground.O", "pinion.O"]
[joint.slide]
type = "prismatic"
points = ["ground.R", "rack.R"]
direction = 0.0
angle = 0.0
[gear.g]
joints = ["O", "slide"]
ratio = RATIO
[assembly.a]
pinion = 0.0
rack = 0.0
"""


@pytest.mark.parametrize("ratio", ["0.08", '"80 mm"', '"80 mm/rad"', '"0.08 m"'])
def test_the_ratio_of_a_rack_is_a_length(tmp_path, ratio):
    (tmp_path / "rack.toml").write_text(RACK.replace("RATIO", ratio))
    (gear,) = pf.load(tmp_path / "rack.toml").mechanism.gears
    assert gear.ratio == 0.08
    for wrong in ("80 kg", "80 deg/m", "80 N m"):
        (tmp_path / "rack.toml").write_text(RACK.replace("RATIO", f'"{wrong}"'))
        with pytest.raises(InputError, match=r"gear.g.ratio: a quantity in .* where one in m/rad or m is asked for"):
            pf.load(tmp_path / "rack.toml")
