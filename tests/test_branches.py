"""Starts on the branch of the assembly: drives that start elsewhere, change points, dead centres, limits of reach."""

import re
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.dynamics import State, build_system, consistent_state, moment_signals
from paraflex.errors import (
    AssemblyError,
    InconsistentConstraintsError,
    InputError,
    ResultWarning,
    SingularPositionError,
)
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import (
    Assembly,
    ConstantSpeed,
    EndEffector,
    Gear,
    Mechanism,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SampledAngle,
    Start,
)
from paraflex.paths.closure import PathClosure
from shell import paraflex

LENGTHS = (1.0, 0.5, 1.2, 0.8)
# The branches of this one come within 0.03 rad of each other on the way: it is nearly a change-point mechanism.
NARROW = ((1.02160967, 0.3255869, 0.82152807, 0.52611172), 0.7678788853396403, 1.0, 3.3815175168739025)


def body(name, length, first, last, mass=1.0):
    points = {first: (0.0, 0.0), last: (length, 0.0)}
    return RigidBody(name, mass, 0.1 * mass, (0.5 * length, 0.0), points)


def pin(name, a, b):
    return RevoluteJoint(name, PointRef.parse(a, "a"), PointRef.parse(b, "b"))


def angles_of(lengths, crank, side):
    """Angles of crank, coupler and rocker of a four-bar (ground, crank, coupler, rocker) in closed form."""
    ground, a, b, c = lengths
    pin_a = a * np.exp(1j * crank)
    span = ground - pin_a
    inner = np.arccos((b**2 + abs(span) ** 2 - c**2) / (2.0 * b * abs(span)))
    coupler = np.angle(span) + side * inner
    return crank, coupler, np.angle(pin_a + b * np.exp(1j * coupler) - ground)


def four_bar(lengths, crank, side, profile, **changes):
    angles = dict(zip(("crank", "coupler", "rocker"), angles_of(lengths, crank, side), strict=True))
    given = {
        "ground": {"O": (0.0, 0.0), "D": (lengths[0], 0.0)},
        "bodies": (body("crank", lengths[1], "O", "A"), body("coupler", lengths[2], "A", "B"),
                   body("rocker", lengths[3], "D", "B")),
        "joints": (pin("O", "ground.O", "crank.O"), pin("A", "crank.A", "coupler.A"),
                   pin("B", "coupler.B", "rocker.B"), pin("D", "ground.D", "rocker.D")),
        "prescribed": () if profile is None else (PrescribedAngle("drive", "O", profile),),
        "assemblies": (Assembly("above", angles),),
    }  # fmt: skip
    return Mechanism("four-bar", **(given | changes))


def slider_crank(travel, crank=0.5):
    """Crank of 0.3 m, rod of 0.8 m, slider driven along the rail; it reaches 1.1 m."""
    rod = -np.arcsin(0.3 / 0.8 * np.sin(crank))
    place = 0.3 * np.cos(crank) + 0.8 * np.cos(rod)
    slider = RigidBody("slider", 3.0, 0.1, points={"B": (0.0, 0.0)})
    return Mechanism(
        "slider-crank",
        ground={"O": (0.0, 0.0)},
        bodies=(body("crank", 0.3, "O", "A"), body("rod", 0.8, "A", "B"), slider),
        joints=(pin("O", "ground.O", "crank.O"), pin("A", "crank.A", "rod.A"), pin("B", "rod.B", "slider.B"),
                PrismaticJoint("rail", PointRef("ground", "O"), PointRef("slider", "B"))),
        prescribed=(PrescribedAngle("push", "rail", travel),),
        assemblies=(Assembly("start", {"crank": crank, "rod": rod, "slider": 0.0},
                             {PointRef("slider", "B"): (place, 0.0)}),),
    )  # fmt: skip


def polynomial(*coefficients):
    one = np.polynomial.Polynomial(coefficients)
    return SampledAngle(one, one.deriv(), one.deriv(2))


def found_angles(mechanism, q):
    system = build_system(mechanism)
    return np.array([q[system.body(one.name).angle] for one in mechanism.bodies])


def off_by_turns(found, expected):
    """Angles less those expected, whole turns apart."""
    return np.abs(np.remainder(np.asarray(found) - expected + np.pi, 2.0 * np.pi) - np.pi)


def random_four_bars(count):
    """Four-bars whose crank turns all round, and their assemblies: crank-rockers and drag links of either side."""
    random = np.random.default_rng(4)
    while count:
        lengths = random.uniform(0.2, 2.0, 4)
        least, *middle, most = np.sort(lengths)
        if least + most < sum(middle) and np.argmin(lengths) in (0, 1):
            count -= 1
            yield lengths, random.uniform(-3.0, 3.0), random.choice([-1.0, 1.0]), random.uniform(-7.0, 7.0)


# --- Drives that start away from the assembly ---------------------------------------------------------------------


@pytest.mark.parametrize(("lengths", "crank", "side", "start"), [NARROW, *random_four_bars(40)])
def test_a_drive_that_starts_elsewhere_stays_on_the_branch_of_the_assembly(lengths, crank, side, start):
    mechanism = four_bar(lengths, crank, side, ConstantSpeed(start, 1.0))
    found = found_angles(mechanism, consistent_state(build_system(mechanism), None).q)
    assert found[0] == pytest.approx(start, abs=1e-10)
    assert np.max(off_by_turns(found, angles_of(lengths, start, side))) < 1e-9


@pytest.mark.parametrize("turns", [-3, -1, 1, 2, 1000])
@pytest.mark.parametrize(("lengths", "crank", "side", "_"), list(random_four_bars(4)))
def test_a_profile_whole_turns_ahead_has_the_pose_of_the_assembly(lengths, crank, side, _, turns):
    mechanism = four_bar(lengths, crank, side, ConstantSpeed(crank + 2.0 * np.pi * turns, 1.0))
    found = found_angles(mechanism, consistent_state(build_system(mechanism), None).q)
    assert found - angles_of(lengths, crank, side) == pytest.approx([2.0 * np.pi * turns, 0.0, 0.0], abs=1e-8)


def test_a_turn_ahead_where_the_crank_cannot_turn():
    """A double rocker, whose crank swings by less than a turn."""
    lengths = (2.0, 1.8, 1.0, 1.6)
    mechanism = four_bar(lengths, 0.6, 1.0, ConstantSpeed(0.6 + 2.0 * np.pi, 1.0))
    found = found_angles(mechanism, consistent_state(build_system(mechanism), None).q)
    assert found - angles_of(lengths, 0.6, 1.0) == pytest.approx([2.0 * np.pi, 0.0, 0.0], abs=1e-9)


def test_two_turns_of_a_geared_crank_turn_the_gear_along():
    """Through a gear all of the way is followed: the follower turns by minus a third of it."""
    bodies = (body("crank", 0.5, "O", "P"), body("follower", 0.5, "D", "Q"))
    mechanism = Mechanism(
        "geared", {"O": (0.0, 0.0), "D": (1.0, 0.0)}, bodies,
        (pin("O", "ground.O", "crank.O"), pin("D", "ground.D", "follower.D")),
        gears=(Gear("gear", "O", "D", -1.0 / 3.0),),
        prescribed=(PrescribedAngle("drive", "O", ConstantSpeed(13.0, 1.0)),),
        assemblies=(Assembly("start", {"crank": 0.2, "follower": 0.1}),),
    )  # fmt: skip
    found = found_angles(mechanism, consistent_state(build_system(mechanism), None).q)
    assert found == pytest.approx([13.0, 0.1 - 12.8 / 3.0], abs=1e-9)


@pytest.mark.parametrize("crank", [0.5, -0.5])
def test_a_slider_driven_elsewhere_keeps_the_side_of_the_crank(crank):
    mechanism = slider_crank(ConstantSpeed(0.6, 0.1), crank)
    q = consistent_state(build_system(mechanism), None).q
    # The cosine rule of the triangle with sides 0.3 m, 0.8 m and 0.6 m.
    expected = np.sign(crank) * np.arccos((0.3**2 + 0.6**2 - 0.8**2) / (2.0 * 0.3 * 0.6))
    assert found_angles(mechanism, q)[0] == pytest.approx(expected, abs=1e-9)


def test_planned_motions_start_on_the_branch_too():
    mechanism = four_bar(LENGTHS, 1.0, 1.0, ConstantSpeed(-0.5, 1.0), end_effector=EndEffector(PointRef("rocker", "B")))
    closure = PathClosure(mechanism, 0.0, 1.0)
    q = closure.assembled(mechanism.assembly())
    assert np.max(off_by_turns(found_angles(mechanism, q), angles_of(LENGTHS, -0.5, 1.0))) < 1e-9


def test_a_start_of_given_velocities_is_on_the_branch():
    mechanism = four_bar(LENGTHS, 1.0, 1.0, ConstantSpeed(-0.5, 1.0))
    run = pf.simulate_motion(mechanism, 0.01, samples=2, start=Start(angular={"crank": 1.0}))
    assert np.max(off_by_turns(found_angles(mechanism, run.solution.q[0]), angles_of(LENGTHS, -0.5, 1.0))) < 1e-9


def test_a_start_that_was_moved_is_a_warning_in_python_as_in_run():
    mechanism = four_bar(LENGTHS, 1.0, 1.0, ConstantSpeed(-0.5, 1.0))
    with pytest.warns(ResultWarning, match="closed far from what was given: crank at -0.5 rad") as caught:
        pf.simulate_motion(mechanism, 0.01, samples=2)
    (finding,) = [one.message.finding for one in caught]
    assert finding.code == "assembly-elbow"
    assert finding in pf.check(mechanism).findings


def test_a_drive_that_starts_beyond_reach_names_the_limit():
    with pytest.raises(AssemblyError, match=r"push at 1\.1 m, the limit of their reach"):
        consistent_state(build_system(slider_crank(ConstantSpeed(1.15, 0.1))), None)


# --- Drives without a start ---------------------------------------------------------------------------------------

TWO_ASSEMBLIES = """
name = "rotor"
[ground]
O = [0, 0]
[body.arm]
type = "rigid"
mass = 1
inertia = 0.1
points = {O = [0, 0]}
[body.block]
type = "rigid"
mass = 1
inertia = 0.1
points = {S = [0, 0]}
[joint]
O = ["ground.O", "arm.O"]
rail = {type = "prismatic", points = ["ground.O", "block.S"], direction = 1.5707963267948966}
[prescribed.turn]
joint = "O"
speed = 2.0
[prescribed.lift]
joint = "rail"
[assembly.a]
arm = 0.7
block = 0.0
points = {"block.S" = [0, 0.4]}
[assembly.b]
arm = -1.2
block = 0.0
points = {"block.S" = [0, -0.3]}
[study]
duration = 0.5
samples = 3
"""
EXPECTED = {"a": (0.7, 0.4), "b": (-1.2, -0.3)}


@pytest.fixture
def two_assemblies(tmp_path):
    file = tmp_path / "rotor.toml"
    file.write_text(TWO_ASSEMBLIES, encoding="utf-8")
    return file


def arm_and_block(run):
    system = run.system
    return run.solution.q[:, [system.body("arm").angle, system.body("block").offset + 1]]


@pytest.mark.parametrize("name", ["a", "b"])
def test_a_drive_without_a_start_begins_where_the_assembly_stands(two_assemblies, name):
    model = pf.load(two_assemblies)
    found = arm_and_block(pf.simulate_motion(model, start=name, samples=3))
    turn, lift = EXPECTED[name]
    assert found == pytest.approx(np.array([[turn, lift], [turn + 0.5, lift], [turn + 1.0, lift]]), abs=1e-9)
    chosen = pf.load(two_assemblies, set={"study.assembly": name}).mechanism
    assert [one.profile for one in chosen.prescribed] == [ConstantSpeed(turn, 2.0), ConstantSpeed(lift, 0.0)]


def test_a_drive_without_a_start_goes_on_from_a_state(two_assemblies):
    model = pf.load(two_assemblies)
    first = pf.simulate_motion(model, start="b", samples=3)
    state = State(0.5, first.solution.q[-1], first.solution.v[-1])
    found = arm_and_block(pf.simulate_motion(model, start=state, samples=3))
    assert found[-1] == pytest.approx([-1.2 + 2.0, -0.3], abs=1e-9)


def test_the_command_line_takes_the_assembly_asked_for(two_assemblies, tmp_path):
    out = tmp_path / "out"
    done = paraflex("run", str(two_assemblies), "--assembly", "b", "--no-report", "--out", str(out))
    assert done.returncode == 0, done.stderr
    with pf.open_results(out) as data:
        assert float(data["angle"].sel(body="arm")[0]) == pytest.approx(-1.2, abs=1e-9)
    assert pf.check(pf.load(two_assemblies), assembly="b").findings == pf.check(pf.load(two_assemblies)).findings


def test_a_drive_without_a_start_is_saved_without_one_and_a_start_at_zero_with_it(two_assemblies, tmp_path):
    model = pf.load(two_assemblies)
    model.save(tmp_path / "saved.toml")
    text = (tmp_path / "saved.toml").read_text(encoding="utf-8")
    assert "angle" not in re.search(r"\[prescribed.turn\](.*?)\n\[", text, re.DOTALL).group(1)
    turn, lift = model.mechanism.prescribed
    zero = replace(model.mechanism, prescribed=(replace(turn, profile=ConstantSpeed(0.0, 2.0)), lift))
    zero.save(tmp_path / "zero.toml")
    assert pf.load(tmp_path / "zero.toml").mechanism.prescribed[0].profile == ConstantSpeed(0.0, 2.0)


# --- Change points and dead centres -------------------------------------------------------------------------------

# Folded flat: (1 +- sqrt 6)/5 of the crank's rate are the rates of the rocker (ground 4, crank 1, coupler 3, rocker 2).
CHANGE_POINT = (4.0, 1.0, 3.0, 2.0)
RATES = ((1.0 + np.sqrt(6.0)) / 5.0, (1.0 - np.sqrt(6.0)) / 5.0)


def folded(profile):
    flat = Assembly("flat", {"crank": np.pi, "coupler": 0.0, "rocker": np.pi})
    return four_bar(CHANGE_POINT, np.pi - 0.1, 1.0, profile, assemblies=(flat,))


@pytest.mark.parametrize("speed", [1.0, -3.0])
def test_a_change_point_is_named_with_both_rates(speed):
    mechanism = folded(ConstantSpeed(np.pi, speed))
    with pytest.raises(InconsistentConstraintsError, match="a change point, at which two branches meet") as caught:
        consistent_state(build_system(mechanism), None)
    rates = sorted(f"{speed * each:.6g}" for each in RATES)
    assert sorted(re.search(r"rocker at (\S+) or (\S+) rad/s", str(caught.value)).groups()) == rates
    (finding,) = [one for one in pf.check(mechanism).findings if one.code == "assembly-open"]
    assert "start.velocity.angular" in finding.remedy


@pytest.mark.parametrize("rate", RATES)
def test_a_rate_given_at_a_change_point_chooses_the_branch(rate):
    mechanism, speed = folded(ConstantSpeed(np.pi, 1.0)), 1.0
    run = pf.simulate_motion(mechanism, 0.5, samples=11, start=Start(angular={"rocker": float(rate)}))
    rocker = run.solution.q[:, run.system.body("rocker").angle]
    side = -1.0 if rate > 0.0 else 1.0
    expected = [angles_of(CHANGE_POINT, np.pi + speed * t, side)[2] for t in run.times[1:]]
    assert np.max(off_by_turns(rocker[1:], expected)) < 3e-5


@pytest.mark.parametrize("crank", [0.5, -0.5, 3.0])
def test_a_drive_that_starts_at_a_change_point_away_from_the_assembly(crank):
    """A parallelogram, led flat: its rocker goes on with the crank's rate, or three times against it."""
    lengths, profile = (0.4, 0.2, 0.4, 0.2), ConstantSpeed(0.0, 3.0)
    assembled = Assembly("open", {"crank": crank, "coupler": 0.0, "rocker": crank})
    mechanism = four_bar(lengths, 1.0, 1.0, profile, assemblies=(assembled,))
    with pytest.raises(InconsistentConstraintsError, match="a change point, at which two branches meet") as caught:
        consistent_state(build_system(mechanism), None)
    rates = [float(each) for each in re.search(r"rocker at (\S+) or (\S+) rad/s", str(caught.value)).groups()]
    assert sorted(rates) == pytest.approx([-9.0, 3.0], rel=1e-5)
    run = pf.simulate_motion(mechanism, 0.1, samples=2, start=Start(angular={"rocker": 3.0})).solution
    assert run.v[0, [2, 5, 8]] == pytest.approx([3.0, 0.0, 3.0], abs=1e-6)
    assert run.q[0, [2, 5, 8]] == pytest.approx(np.zeros(3), abs=1e-8)
    assert run.q[-1, [2, 5, 8]] == pytest.approx([0.3, 0.0, 0.3], abs=1e-5)


@pytest.mark.parametrize("crank", [0.5, -1.0])
def test_a_drive_that_starts_at_a_dead_centre_away_from_the_assembly(crank):
    with pytest.raises(InconsistentConstraintsError, match=r"a dead centre, with push at 1\.1 m") as caught:
        consistent_state(build_system(slider_crank(polynomial(1.1, 0.0, -0.1), crank)), None)
    rate = np.sqrt(0.2 / (0.3 + 0.3**2 / 0.8))
    found = float(re.search(r"crank at (\S+) or", str(caught.value)).group(1))
    assert abs(found) == pytest.approx(rate, rel=1e-5)


def test_an_undriven_change_point_asks_for_a_rate():
    with pytest.raises(InputError, match=r"change point.* rocker at 0\.689898 or -0\.289898 rad/s"):
        pf.simulate_motion(folded(None), 0.1, start=Start(angular={"crank": 1.0}))
    assert pf.simulate_motion(folded(None), 0.1, samples=2).solution.status == "complete"


def test_a_drive_that_leaves_a_dead_centre_from_rest_has_two_rates():
    """Stretched the slider is at 1.1 m - (0.3 + 0.3^2 / 0.8) theta^2 / 2."""
    with pytest.raises(InconsistentConstraintsError, match=r"a dead centre, with push at 1\.1 m") as caught:
        consistent_state(build_system(slider_crank(polynomial(1.1, 0.0, -0.1), 0.0)), None)
    rate = np.sqrt(0.2 / (0.3 + 0.3**2 / 0.8))
    assert re.search(r"crank at (\S+) or", str(caught.value)).group(1).lstrip("-") == f"{rate:.6g}"


@pytest.mark.parametrize("profile", [(1.1, 0.1), (1.1, -0.1), (1.1, 0.0, 0.1)])
def test_a_drive_that_a_dead_centre_bars_is_named(profile):
    with pytest.raises(InconsistentConstraintsError, match=r"a dead centre, the limit of reach, with push at 1\.1 m"):
        consistent_state(build_system(slider_crank(polynomial(*profile), 0.0)), None)


def test_a_slider_held_at_its_dead_centre_runs():
    run = pf.simulate_motion(slider_crank(polynomial(1.1), 0.0), 0.1, samples=2)
    assert run.solution.status == "complete"


@pytest.mark.parametrize("method", ["esdirk5", "tr-bdf2"])
def test_a_slider_driven_past_its_reach_stops_at_the_limit_that_is_named(method):
    crank = np.arccos((0.3**2 + 1.06**2 - 0.8**2) / (2.0 * 0.3 * 1.06))
    mechanism = slider_crank(polynomial(1.06, 0.1), crank)
    with pytest.raises(SingularPositionError, match=r"the limit of reach, push at 1\.1 m") as caught:
        pf.simulate_motion(mechanism, 1.0, samples=101, options=IntegrationOptions(method=method))
    assert caught.value.moment.time == pytest.approx(0.4, abs=1e-3)
    assert "method" not in caught.value.remedy


# --- Links of nearly no mass --------------------------------------------------------------------------------------


@pytest.mark.parametrize("mass", [1e-6, 1e-9, 1e-11])
def test_light_links_do_not_change_the_start(mass):
    """A crank of 1 kg m^2 that turns at 5 rad/s drags links of nearly no mass along: 5 rad in 1 s."""
    crank = RigidBody("crank", 1.0, 1.0 - 0.25**2, (0.25, 0.0), {"O": (0.0, 0.0), "A": (0.5, 0.0)})
    links = (crank, body("coupler", 1.2, "A", "B", mass), body("rocker", 0.8, "D", "B", mass))
    mechanism = four_bar(LENGTHS, 1.0, 1.0, None, bodies=links)
    run = pf.simulate_motion(mechanism, 1.0, samples=2, start=Start(angular={"crank": 5.0}))
    turned = run.solution.q[:, run.system.body("crank").angle]
    assert turned[1] - turned[0] == pytest.approx(5.0, abs=max(1e-6, mass))
    _, rate = run.system.constraints(moment_signals(mechanism, 0.0), 0.0, run.solution.q[0], run.solution.v[0])
    assert np.max(np.abs(rate)) < 1e-9


def test_a_start_at_a_change_point_is_on_one_of_the_branches():
    """Their rates are enough as they are printed; any other is refused. The pole at the start is no shared load."""
    mechanism = folded(ConstantSpeed(np.pi, 1.0))
    with pytest.raises(
        InputError, match=r"on neither branch of a change point.* rocker at 0\.689898 or -0\.289898 rad/s"
    ) as caught:
        pf.simulate_motion(mechanism, 0.1, start=Start(angular={"rocker": 0.5}))
    assert caught.value.field == "start.velocity.angular.rocker"
    run = pf.simulate_motion(mechanism, 0.1, samples=11, start=Start(angular={"rocker": 0.689898}))
    assert run.solution.singular_positions == (0.0,)
    assert np.all(np.isnan(run.solution.multipliers[0]))
    assert np.all(np.isfinite(run.solution.multipliers[1:]))
    assert not run.findings
    model = pf.Model(mechanism, start=Start(angular={"rocker": 0.689898}))
    assert not [one for one in pf.check(model).findings if one.code == "assembly-open"]


def test_a_start_from_rest_at_a_change_point_is_a_singular_position_too():
    run = pf.simulate_motion(replace(folded(None), gravity=(0.0, -9.81)), 0.2, samples=11, warning=False)
    assert run.solution.singular_positions == (0.0,)
    assert np.isnan(run.solution.multipliers).any(axis=1).tolist() == [True, *[False] * 10]
    assert not run.findings


@pytest.mark.parametrize("swapped", [False, True])
def test_rates_of_a_branch_are_those_of_bodies_as_the_start_wants_them(swapped):
    """A parallelogram folded flat goes on as one, or crosses with -65/7: six digits of it choose the branch."""
    crank, rocker = (body(name, 0.3, *ends, 1.0) for name, ends in (("crank", ("O", "A")), ("rocker", ("Q", "B"))))
    pins = PointRef("ground", "Q"), PointRef("rocker", "Q")
    mechanism = pf.Mechanism(
        name="kite", ground={"O": (0.0, 0.0), "Q": (1.0, 0.0)}, bodies=(crank, rocker),
        joints=(
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "O")),
            RevoluteJoint("Q", *(reversed(pins) if swapped else pins)),
            pf.DistanceJoint("rod", PointRef("crank", "A"), PointRef("rocker", "B"), 1.0),
        ),
        assemblies=(Assembly("flat", {"crank": 0.0, "rocker": 0.0}),), gravity=(0.0, 0.0),
        prescribed=(PrescribedAngle("drive", "O", ConstantSpeed(0.0, 5.0)),),
    )  # fmt: skip
    with pytest.raises(InputError, match=r"two branches meet: rocker at -9\.28571 or 5 rad/s"):
        pf.simulate_motion(mechanism, 0.1, start=Start(angular={"rocker": 1.0}))
    for given, exact in ((-9.28571, -65.0 / 7.0), (5.0, 5.0)):
        run = pf.simulate_motion(mechanism, 0.02, samples=3, start=Start(angular={"rocker": given}), warning=False)
        assert run.solution.v[0, run.system.body("rocker").angle] == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("method", "part"), [("esdirk5", 5e-3), ("tr-bdf2", 5e-3)])
def test_forces_after_a_start_at_a_dead_centre_are_those_of_its_branch(side, method, part):
    """Of a stretched slider-crank, its rod without mass: the rate of energy over the speed of the slider."""
    r, length, inertia, mass = 0.2, 0.5, 0.03, 0.5

    def energy(t):
        x, speed = 0.7 - 0.1 * (1.0 - np.cos(10.0 * t)), -np.sin(10.0 * t)
        cosine = (x * x + r * r - length**2) / (2.0 * r * x)
        rate = speed * (x * x - r * r + length**2) / (2.0 * r * x * x) / np.sqrt(1.0 - cosine**2)
        return 0.5 * inertia * rate**2 + 0.5 * mass * speed**2

    crank = RigidBody("crank", 1.0, 0.02, (0.1, 0.0), {"O": (0.0, 0.0), "A": (r, 0.0)})
    slider = RigidBody("slider", mass, 1e-3, (0.0, 0.0), {"P": (0.0, 0.0)})
    profile = pf.SampledAngle(
        lambda t: 0.7 - 0.1 * (1.0 - np.cos(10.0 * t)), lambda t: -np.sin(10.0 * t), lambda t: -10.0 * np.cos(10.0 * t)
    )
    mechanism = pf.Mechanism(
        name="stretched", ground={"O": (0.0, 0.0)}, bodies=(crank, slider), gravity=(0.0, 0.0),
        joints=(
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "O")),
            pf.DistanceJoint("rod", PointRef("crank", "A"), PointRef("slider", "P"), length),
            pf.PrismaticJoint("rail", PointRef("ground", "O"), PointRef("slider", "P")),
        ),
        assemblies=(Assembly("a", {"crank": 0.0, "slider": 0.0}, {PointRef("slider", "P"): (0.7, 0.0)}),),
        prescribed=(PrescribedAngle("push", "rail", profile),),
    )  # fmt: skip
    start = Start(angular={"crank": side * np.sqrt(10.0 / (r + r * r / length))})
    run = pf.simulate_motion(mechanism, 0.05, samples=51, start=start, options=IntegrationOptions(method=method))
    h, t = 1e-5, run.times[2:]
    exact = (energy(t + h) - energy(t - h)) / (2.0 * h) / -np.sin(10.0 * t)
    found = pf.motion_dataset(run)["drive_torque"].values.ravel()
    assert np.isnan(found[0])
    np.testing.assert_allclose(found[2:], exact, rtol=0, atol=part * 3.97)
    assert not run.findings


FLAT = """
name = "flat"
gravity = [0.0, -9.81]
ground = { O = [0.0, 0.0], D = [1.0, 0.0] }
[body.crank]
type = "rigid"
mass = 1.0
inertia = 0.05
centre_of_mass = [0.1, 0.0]
points = { O = [0.0, 0.0], A = [0.3, 0.0] }
[body.coupler]
type = "rigid"
mass = 1.0
inertia = 0.05
centre_of_mass = [0.4, 0.0]
points = { A = [0.0, 0.0], B = [1.0, 0.0] }
[body.rocker]
type = "rigid"
mass = 1.0
inertia = 0.05
centre_of_mass = [0.4, 0.0]
points = { D = [0.0, 0.0], B = [0.3, 0.0] }
[joint]
O = ["ground.O", "crank.O"]
A = ["crank.A", "coupler.A"]
B = ["coupler.B", "rocker.B"]
D = ["ground.D", "rocker.D"]
[prescribed.drive]
joint = "O"
angle = "PROFILE"
[assembly.a]
"""
PARALLEL = "crank = 0.5\ncoupler = 0.0\nrocker = 0.5\n"
CROSSED = "crank = 0.5\ncoupler = -0.35\nrocker = -0.85\n"


def parallelogram(tmp_path, profile, assembly):
    (tmp_path / "flat.toml").write_text(FLAT.replace("PROFILE", profile) + assembly)
    return pf.load(tmp_path / "flat.toml")


@pytest.mark.parametrize("profile", ["0.5 - 0.5 * cos(4 * t)", "2.5 * t**2"])
def test_a_drive_that_leaves_a_change_point_from_rest_is_refused(tmp_path, profile):
    """Two branches lead on, and no velocity chooses one: forces were those of neither (3.6 N where 61 kN are right)."""
    model = parallelogram(tmp_path, profile, "crank = 0.0\ncoupler = 0.0\nrocker = 0.0\n")
    with pytest.raises(InconsistentConstraintsError, match="at rest at a change point, from which two branches lead"):
        pf.simulate_motion(model, 0.1)
    held = parallelogram(tmp_path, "0.0", "crank = 0.0\ncoupler = 0.0\nrocker = 0.0\n")
    assert pf.simulate_motion(held, 0.1, samples=2).solution.status == "complete"


@pytest.mark.filterwarnings("ignore:prescribed.drive. it starts at -7 rad")
@pytest.mark.parametrize("start", [4.0, -7.0])
def test_a_way_through_a_change_point_is_barred(tmp_path, start):
    """Either branch may lead on there: the rocker began whole turns away, or on the branch of the parallelogram."""
    with pytest.raises(AssemblyError, match=r"block the way .* or a change point"):
        pf.simulate_motion(parallelogram(tmp_path, f"{start} + 5 * t", CROSSED), 0.1)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_way_that_is_barred_is_gone_the_other_way_round(side):
    """A crank that cannot pass zero, where coupler and rocker are too long, reaches -1.2 rad."""
    lengths = (1.0, 0.5, 1.2, 0.5)
    q = consistent_state(build_system(four_bar(lengths, 1.2, side, ConstantSpeed(-1.2, 0.1))), None).q
    assert off_by_turns(q[2::3], angles_of(lengths, -1.2, side)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("samples", [101, 1001])
def test_forces_beside_a_change_point_that_is_passed(tmp_path, samples):
    """Bodies of a parallelogram turn and move alike: the force in D by Newton and Euler at each.

    Steps near there hold rows of constraints: between their stages forces were 7 % off at the largest sample.
    """
    run = pf.simulate_motion(parallelogram(tmp_path, "0.5 + 5 * t", PARALLEL), 1.2, samples=samples, warning=False)
    data = pf.motion_dataset(run)
    found = np.abs(data["joint_force"].sel(joint="D").values)
    exact = np.abs([force_in_rocker(0.5 + 5.0 * t, 5.0) for t in data["time"].values])
    known = np.isfinite(found[:, 0])
    assert np.sum(~known) < 0.02 * samples + 2
    assert np.max(np.abs(found - exact)[known]) < 4e-3 * np.max(exact[known])


def force_in_rocker(angle, rate):
    """Forces on crank, coupler and rocker of the parallelogram, and the torque, at a constant rate: that in D."""
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    A, b = np.zeros((9, 9)), np.zeros(9)
    # Unknown: forces on the crank in O and A, on the rocker in B (reversed on the coupler) and D, and the torque.
    for row, signs, reach in ((0, (1, 1, 0, 0), 0.1), (3, (0, -1, 1, 0), 0.3), (6, (0, 0, -1, 1), 0.4)):
        for k, sign in enumerate(signs):
            A[row : row + 2, 2 * k : 2 * k + 2] = sign * np.eye(2)
        b[row : row + 2] = -(rate**2) * reach * along + [0.0, 9.81]
    A[2, 0:2], A[2, 2:4], A[2, 8] = -0.1 * across, 0.2 * across, 1.0
    A[5, 2:4], A[5, 4:6] = [0.0, 0.4], [0.0, 0.6]
    A[8, 4:6], A[8, 6:8] = 0.1 * across, -0.4 * across
    return np.linalg.solve(A, b)[6:8]
