"""Kinematics and rigid torques against the PMKS reference set, textbook formulas, closed forms and integration."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy

import paraflex as pf
from conftest import QUICK_RETURN
from paraflex.errors import InputError, UnreachablePathError
from paraflex.figures.kinematics import kinematics_of, kinematics_tables
from paraflex.figures.run_motion import moving_points, point_paths
from paraflex.figures.selection import as_runs
from paraflex.formatting import output_units
from paraflex.plots import save_figures
from paraflex.reports import motion_page
from paraflex.reports.loads import load_tiles
from paraflex.results.kinematics import add_kinematics
from paraflex.results.loads import joint_line, load_figures
from shell import paraflex

REFERENCE = {
    one["name"]: one for one in json.loads((Path(__file__).parent / "data" / "pmks.json").read_text())["mechanisms"]
}
# Relative to the largest number of a kind; the reference is right to about 1e-13.
EXACT = 1e-9


def built(case, gravity=(0.0, 0.0)):
    """Return the mechanism of a reference case; a link's x axis goes from its first joint to its second."""
    at = {one["id"]: np.array(one["initial"], dtype=float) for one in case["joints"] + case["points"]}
    on = {}
    for one in case["joints"]:
        for link in one["links"]:
            on.setdefault(link, []).append(one["id"])
    for one in case["points"]:
        on[one["link"]].append(one["id"])
    masses, load = case.get("masses", {}), case.get("load")
    ground = {name: tuple(at[name]) for name in on.pop("ground")}
    bodies, angles = [], {}
    for link, names in on.items():
        origin, (x, y) = at[names[0]], at[names[1]] - at[names[0]]
        angles[link] = math.atan2(y, x)
        c, s = math.cos(angles[link]), math.sin(angles[link])

        def local(place, origin=origin, c=c, s=s):
            dx, dy = np.asarray(place) - origin
            return float(c * dx + s * dy), float(c * dy - s * dx)

        points = {name: local(at[name]) for name in names}
        given = {}
        if link in masses:
            points["com"] = local(masses[link]["com_initial"])
            given = {"mass": masses[link]["mass"], "inertia": masses[link]["inertia"], "centre_of_mass": points["com"]}
        bodies.append(pf.RigidBody(link, points=points, **given))
    joints = []
    for one in case["joints"]:
        a, b = (pf.PointRef(link, one["id"]) for link in sorted(one["links"], key=lambda link: link != "ground"))
        if "guide_axis" in one:
            x, y = one["guide_axis"]
            joints.append(pf.SlotJoint(one["id"], a, b, direction=math.atan2(y, x)))
        else:
            joints.append(pf.RevoluteJoint(one["id"], a, b))
    loads = () if load is None else (pf.PointForce("load", pf.PointRef(load["link"], "com"), tuple(load["force"])),)
    return pf.Mechanism(
        name=case["name"], ground=ground, bodies=tuple(bodies), joints=tuple(joints), loads=loads, gravity=gravity,
        assemblies=(pf.Assembly("start", angles),),
    )  # fmt: skip


def reference_motion(function, case, instant, gravity=(0.0, 0.0)):
    """Return the motion of the input by the angle of an instant; the last sample is the instant."""
    turned, speed = math.radians(instant["angle"]), instant["omega"]
    mechanism = built(case, gravity)
    crank = next(one["id"] for one in case["joints"] if set(one["links"]) == {"ground", case["input"]})
    start = mechanism.assembly("start").angles[case["input"]]
    # An instant at the start is the first sample of a stroke.
    end = start + (turned if turned else math.copysign(0.05, speed))
    motion = function(mechanism, crank, start=start, end=end, speed=abs(speed))
    # Accelerations, reactions and torques do not depend on the direction in which the stroke is traversed.
    return motion, (-1 if turned else 0), math.copysign(1.0, speed) * math.copysign(1.0, end - start), crank


def close(found, right, scale=None):
    right = np.asarray(right, dtype=float)
    return np.max(np.abs(np.asarray(found) - right)) <= EXACT * (scale or max(1.0, float(np.max(np.abs(right)))))


INSTANTS = [(name, k) for name, case in REFERENCE.items() for k in range(len(case["instants"]))]


@pytest.mark.parametrize(("name", "k"), INSTANTS)
def test_motions_are_those_of_the_reference_set(name, k):
    case = REFERENCE[name]
    instant = case["instants"][k]
    motion, at, sign, _ = reference_motion(pf.kinematics, case, instant)
    data = pf.motion_dataset(motion).isel(time=at)
    signs = np.array([1.0, 1.0, sign, sign, 1.0, 1.0])

    def motion_of(point):
        return np.concatenate([
            data[f"point_{what}"].sel(point=point).values for what in ("position", "velocity", "acceleration")
        ]) * signs  # fmt: skip

    for label, right in instant["points"].items():
        link = next(one for one in (j for j in case["joints"] + case["points"] if j["id"] == label))
        body = link.get("link") or next(each for each in link["links"] if each != "ground")
        assert close(motion_of(f"{body}.{label}"), right), label
    for label, right in instant.get("com", {}).items():
        assert close(motion_of(f"{label}.com"), right), label
    for label, (omega, alpha) in instant["links"].items():
        one = data.sel(body=label)
        assert close([sign * one["angular_velocity"], one["angular_acceleration"]], [omega, alpha]), label


FORCES = [
    (name, k, scenario) for name, case in REFERENCE.items() for k, instant in enumerate(case["instants"])
    for scenario in instant.get("dynamics", {})
]  # fmt: skip


@pytest.mark.parametrize(("name", "k", "scenario"), FORCES)
def test_torques_and_reactions_are_those_of_the_reference_set(name, k, scenario):
    case = REFERENCE[name]
    instant = case["instants"][k]
    gravity = (0.0, -9.81) if scenario == "newton_gravity" else (0.0, 0.0)
    motion, at, _, crank = reference_motion(pf.torques, case, instant, gravity)
    data, right = pf.motion_dataset(motion).isel(time=at), instant["dynamics"][scenario]
    scale = max([1.0, *np.abs(list(right["reactions"].values()) or [0.0]).ravel()])
    for joint, force in right["reactions"].items():
        b = motion.system.mechanism.joint(joint).b.body
        sign = case["ownership"][b][joint]
        assert close(sign * data["joint_force"].sel(joint=joint), force, scale), joint
    assert close(data["drive_torque"].sel(drive=crank), right["torque"])


def revolute(name, a, b):
    return pf.RevoluteJoint(name, pf.PointRef.parse(a), pf.PointRef.parse(b))


def four_bar(base, crank, coupler, rocker, point=(0.0, 0.0)):
    return pf.Mechanism(
        name="four-bar", ground={"O": (0.0, 0.0), "Q": (base, 0.0)},
        bodies=(
            pf.RigidBody("crank", points={"O": (0.0, 0.0), "A": (crank, 0.0)}),
            pf.RigidBody("coupler", points={"A": (0.0, 0.0), "B": (coupler, 0.0), "P": point}),
            pf.RigidBody("rocker", points={"Q": (0.0, 0.0), "B": (rocker, 0.0)}),
        ),
        joints=(
            revolute("O", "ground.O", "crank.O"), revolute("A", "crank.A", "coupler.A"),
            revolute("B", "coupler.B", "rocker.B"), revolute("Q", "ground.Q", "rocker.Q"),
        ),
        assemblies=(pf.Assembly("open", {"crank": 0.7, "coupler": 0.3, "rocker": 1.0}),),
    )  # fmt: skip


def test_a_textbook_four_bar_has_the_angles_and_rates_of_freudensteins_equations():
    """Norton, Design of Machinery, 4.5 and 6.7: links of 40, 120, 80 and 100 at 40 degrees, 25 rad/s."""
    d, a, b, c, crank, omega = 100.0, 40.0, 120.0, 80.0, math.radians(40.0), 25.0
    motion = pf.kinematics(four_bar(d, a, b, c), "O", start=crank, end=crank + 1.0, speed=omega)
    first = pf.motion_dataset(motion).isel(time=0)
    k1, k2, k3, k4 = d / a, d / c, (a**2 - b**2 + c**2 + d**2) / (2 * a * c), d / b
    k5 = (c**2 - d**2 - a**2 - b**2) / (2 * a * b)
    A, B, C = math.cos(crank) * (1 - k2) - k1 + k3, -2 * math.sin(crank), k1 - (k2 + 1) * math.cos(crank) + k3
    D, F = math.cos(crank) * (1 + k4) - k1 + k5, k1 + (k4 - 1) * math.cos(crank) + k5
    rocker = 2 * math.atan2(-B - math.sqrt(B**2 - 4 * A * C), 2 * A)
    coupler = 2 * math.atan2(-B - math.sqrt(B**2 - 4 * D * F), 2 * D)
    rate = a * omega / b * math.sin(rocker - crank) / math.sin(coupler - rocker)
    other = a * omega / c * math.sin(crank - coupler) / math.sin(rocker - coupler)
    turned = first["angle"].sel(body=["coupler", "rocker"]).values - [coupler, rocker]
    assert np.exp(1j * turned) == pytest.approx([1.0, 1.0], abs=1e-12)
    assert first["angular_velocity"].sel(body=["coupler", "rocker"]).values == pytest.approx([rate, other], rel=1e-12)


def test_a_crank_rocker_has_its_known_dead_points_transmission_angles_and_time_ratio():
    base, crank, coupler, rocker = 0.4, 0.1, 0.35, 0.25
    found = pf.kinematics(four_bar(base, crank, coupler, rocker), "O").features
    # At dead points crank and coupler are in line.
    far, near = (
        math.acos((base**2 + arm**2 - rocker**2) / (2 * base * arm)) for arm in (coupler + crank, coupler - crank)
    )
    drives = sorted((one.drive or 0.0) % (2 * math.pi) for one in found.dead_points["Q"])
    assert drives == pytest.approx(sorted([far, near + math.pi]), abs=1e-12)
    forward = (near + math.pi - far) % (2 * math.pi)
    ratio = max(forward, 2 * math.pi - forward) / min(forward, 2 * math.pi - forward)
    assert found.time_ratios["Q"] == pytest.approx(ratio, rel=1e-12)
    (one,) = found.transmissions
    # The transmission angle is smallest where crank and base are in line.
    ends = [
        math.acos((coupler**2 + rocker**2 - (base + side * crank) ** 2) / (2 * coupler * rocker)) for side in (1, -1)
    ]
    acute = [min(angle, math.pi - angle) for angle in ends]
    assert (one.joint, one.coupler) == ("B", "coupler")
    assert one.smallest.value == pytest.approx(min(acute), abs=1e-12)
    assert one.largest.value == pytest.approx(math.pi / 2, abs=1e-12)
    assert found.freedoms == 1


def test_a_rocker_that_drives_moves_between_its_limits_of_reach():
    base, crank, coupler, rocker = 0.4, 0.1, 0.35, 0.25
    drive = pf.kinematics(four_bar(base, crank, coupler, rocker), "Q").drive
    low, high = (
        math.pi - math.acos((base**2 + rocker**2 - arm**2) / (2 * base * rocker))
        for arm in (coupler + crank, coupler - crank)
    )
    assert drive is not None
    assert drive.reach == pytest.approx((low, high), abs=1e-10)
    assert low < drive.start < low + 0.01 * (high - low)
    assert high - 0.01 * (high - low) < drive.end < high
    assert not drive.full_turn


def test_a_quick_return_has_its_closed_form_time_ratio(tmp_path):
    file = tmp_path / "quick.toml"
    file.write_text(QUICK_RETURN)
    model = pf.load(file)
    motion = pf.kinematics(model, "O")
    side = math.asin(100.0 / 150.0)
    assert motion.features.time_ratios["Q"] == pytest.approx((math.pi + 2 * side) / (math.pi - 2 * side), rel=1e-11)
    assert [one.value for one in motion.features.dead_points["S"]] == pytest.approx([0.25, 0.05], abs=1e-12)
    # Forces need masses, and nothing stands in for them.
    assert np.isnan(motion.solution.multipliers).all()
    with pytest.raises(InputError, match=r"body\.crank\.mass: is missing"):
        pf.torques(model, "O")
    with pytest.raises(InputError, match=r"body\.crank\.mass"):
        pf.simulate_motion(model, 1.0)


def test_a_coupler_curve_crosses_itself_on_the_circle_of_foci():
    """Double points lie on the circle through both pivots and the third focus, a triangle as the coupler's."""
    base, coupler, point = 2.0, 2.5, np.array([1.25, -2.0])
    motion = pf.kinematics(four_bar(base, 1.0, coupler, 2.5, tuple(point)), "O")
    (one,) = motion.features.trails["coupler.P"].crunodes
    focus = point * base / coupler
    height = (focus @ focus - base * focus[0]) / (2 * focus[1])
    centre = np.array([base / 2, height])
    assert np.linalg.norm(one.position - centre) == pytest.approx(np.linalg.norm(centre), abs=1e-12)
    assert motion.drive is not None
    assert one.drives == pytest.approx([motion.drive.at(t) for t in one.times])
    assert abs(one.times[1] - one.times[0]) > 0.1


def test_a_point_at_the_instant_centre_has_a_cusp_there():
    pose = pf.motion_dataset(pf.kinematics(four_bar(0.4, 0.1, 0.35, 0.25), "O", start=1.0, end=2.0)).isel(time=0)
    A, B = (pose["point_position"].sel(point=name).values for name in ("coupler.A", "coupler.B"))
    # The instant centre of the coupler is where the lines of crank and rocker meet.
    s = np.linalg.solve(np.column_stack([A, -(B - [0.4, 0.0])]), [0.4, 0.0])[0]
    x, y = s * A - A
    turn = float(pose["angle"].sel(body="coupler"))
    local = (x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn))
    trail = pf.kinematics(four_bar(0.4, 0.1, 0.35, 0.25, local), "O", start=0.3).features.trails["coupler.P"]
    assert any(one.drive == pytest.approx(1.0, abs=1e-6) for one in trail.cusps)
    assert not pf.kinematics(four_bar(0.4, 0.1, 0.35, 0.25, (0.1, 0.1)), "O").features.trails["coupler.P"].cusps


def test_all_assemblies_of_a_four_bar_are_the_two_mirrored_in_its_diagonal():
    found = pf.kinematics(four_bar(0.4, 0.1, 0.35, 0.25), "O", start=1.0).assemblies()
    assert len(found) == 2
    assert all(-math.pi <= angle < math.pi for angle in found[1].angles.values())
    A = 0.1 * np.array([math.cos(1.0), math.sin(1.0)])
    diagonal = math.atan2(-A[1], 0.4 - A[0])
    both = sum(one.angles["coupler"] for one in found) - 2 * diagonal
    assert math.cos(both) == pytest.approx(1.0, abs=1e-12)
    assert all(one.found > 10 for one in found)


def test_rigid_torques_are_those_of_an_integrated_run_with_springs_and_loads():
    mechanism = pf.load("four_bar").mechanism.rigid()
    mechanism = replace(
        mechanism, gravity=(0.0, -9.81),
        springs=(pf.TorsionalSpring("spring", "Q", 3.0, 1.5),), dampers=(pf.TorsionalDamper("damper", "A", 0.02),),
        frictions=(pf.JointFriction("friction", "B", 0.05, 0.1),),
        loads=(pf.PointForce("load", pf.PointRef("coupler", "B"), (10.0, -5.0)),),
    )  # fmt: skip
    exact = pf.motion_dataset(pf.torques(mechanism))
    options = pf.IntegrationOptions(tolerance=1e-10)
    run = pf.simulate_motion(mechanism, 2 * math.pi / 20.0, samples=361, options=options, warning=False)
    integrated = pf.motion_dataset(run)
    for name in ("drive_torque", "joint_force", "joint_moment", "frame_force", "frame_moment", "kinetic_energy"):
        scale = float(abs(integrated[name]).max())
        assert float(abs(exact[name] - integrated[name]).max()) < 1e-6 * scale, name


def test_a_flywheel_absorbs_the_fluctuation_of_a_slider_crank():
    motion = pf.torques(pf.load("four_bar").mechanism)
    found = pf.flywheel(motion, 0.05)
    data = pf.motion_dataset(motion)
    # Without loads the energy exchanged with the drive is the kinetic energy of the mechanism.
    energy = data["kinetic_energy"].values
    assert found.energy == pytest.approx(np.ptp(energy), rel=1e-3)
    assert found.inertia == pytest.approx(found.energy / (0.05 * 20.0**2), rel=1e-12)
    assert found.mean_torque == pytest.approx(0.0, abs=1e-9 * float(abs(data["drive_torque"]).max()))
    assert found.error < 1e-6 * found.inertia
    for wrong in (0.0, -1.0, 1.0, math.nan):
        with pytest.raises(InputError, match="fluctuation: not between 0 and 1"):
            pf.flywheel(motion, wrong)
    with pytest.raises(InputError, match="the motion has no loads"):
        pf.flywheel(pf.kinematics(pf.load("four_bar"), "O"), 0.05)
    with pytest.raises(InputError, match="whole turn"):
        pf.flywheel(pf.torques(pf.load("four_bar"), "O", start=0.0, end=1.0), 0.05)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"drive": "X"}, "drive: unknown joint"),
        ({"start": 0.3, "end": 0.3}, "end: the drive does not move"),
        ({"speed": 0.0}, "speed: not positive"),
        ({"speed": math.nan}, "speed: not a finite number"),
        ({"speed": 1e-320}, "speed: of no machine"),
        ({"start": math.inf}, "start: not a finite number"),
        ({"end": 360.0}, "end: more than 20 turns"),
        ({"samples": 1}, "samples: too few"),
        ({"assembly": "none"}, "assembly"),
        ({"end": 1.0, "duration": 1.0}, "duration: has no effect where the end of the drive is given"),
        ({"duration": 500.0}, "duration: more than 20 turns"),
        ({"duration": math.nan}, "duration"),
        ({"drive": "crank"}, r"drive: not a joint \(got 'crank'\); name one of its joints: O, A"),
        ({"drive": None, "held": {"O": 1.0}}, "held: nothing moves where all degrees of freedom are held"),
        ({"held": {"O": 1.0}}, "drive: one joint both moves and is held"),
        ({"held": {"Q": 1.0}}, "drive: 2 drives, where the mechanism has 1 degree of freedom"),
        ({"held": {"Q": math.nan}}, "held.Q"),
        ({"held": {"X": 1.0}}, "held: unknown joint"),
        ({"path": "square"}, "drive: has no effect along a path"),
    ],
)
def test_wrong_arguments_are_named(given, message):
    with pytest.raises(InputError, match=message):
        pf.kinematics(pf.load("four_bar"), **{"drive": "O", **given})


def test_drives_that_do_not_determine_the_motion_are_named():
    with pytest.raises(
        InputError, match=r"drive: is missing; name the joint that drives .*, and 1 to hold, as --drive"
    ):
        pf.kinematics(pf.load("five_bar").mechanism)
    with pytest.raises(InputError, match="drive: no joint moves"):
        pf.kinematics(pf.load("cross_spring_pivot"))
    with pytest.raises(InputError, match="leave 1 degree of freedom of the mechanism open"):
        pf.kinematics(pf.load("five_bar"), "A1")
    chain = pf.Mechanism(
        name="open chain", ground={"O": (0.0, 0.0)},
        bodies=(pf.RigidBody("one", points={"O": (0.0, 0.0), "A": (1.0, 0.0)}),
                pf.RigidBody("two", points={"A": (0.0, 0.0)})),
        joints=(revolute("O", "ground.O", "one.O"), revolute("A", "one.A", "two.A")),
        assemblies=(pf.Assembly("a", {"one": 0.1, "two": 0.2}),),
    )  # fmt: skip
    with pytest.raises(InputError, match="leave 1 degree of freedom of the mechanism open"):
        pf.kinematics(chain, "O")


def test_a_range_beyond_reach_names_the_limit():
    with pytest.raises(UnreachablePathError, match=r"Q reaches its limit of reach, 2\.49809 rad"):
        pf.kinematics(four_bar(0.4, 0.1, 0.35, 0.25), "Q", start=2.0, end=3.0)


def test_properties_do_not_depend_on_the_samples_nor_on_the_number_of_turns():
    mechanism = four_bar(2.0, 1.0, 2.5, 2.5, (1.25, -2.0))
    right = pf.kinematics(mechanism, "O").features
    for given in ({"samples": 2}, {"samples": 5000}, {"start": 0.7, "end": 0.7 + 6 * math.pi}):
        found = pf.kinematics(mechanism, "O", **given).features
        assert found.transmissions[0].smallest.value == pytest.approx(right.transmissions[0].smallest.value, abs=1e-12)
        assert found.time_ratios == pytest.approx(right.time_ratios, abs=1e-10)
        (one,), (other,) = (each.trails["coupler.P"].crunodes for each in (found, right))
        assert one.position == pytest.approx(other.position, abs=1e-11)


def driven_by(mechanism, **profiles):
    """Return a mechanism with prescribed motions of joints, by functions of time and their two derivatives."""
    laws = tuple(pf.PrescribedAngle(joint, joint, pf.SampledAngle(*three)) for joint, three in profiles.items())
    return replace(mechanism, prescribed=laws)


def over_of(motion):
    return kinematics_of(pf.motion_dataset(motion))["over"]


def test_curves_are_drawn_over_the_only_drive_unless_it_reverses(tmp_path):
    crank = four_bar(0.4, 0.1, 0.35, 0.25)
    speeds_up = (lambda t: 1.0 + t**2 + t, lambda t: 2.0 * t + 1.0, lambda t: 2.0 + 0.0 * t)
    motion = pf.kinematics(driven_by(crank, O=speeds_up), duration=2.0, samples=11)
    assert (over_of(motion), over_of(pf.kinematics(driven_by(crank, O=SWING), duration=6.0, samples=11))) == ("O", "")
    assert over_of(pf.kinematics(crank, "O", samples=5)) == "O"
    assert over_of(pf.kinematics(pf.load("five_bar"), samples=5)) == ""
    data = pf.motion_dataset(motion)
    save_figures(data, tmp_path)
    assert "angle of $O$" in (tmp_path / "joint_motions.svg").read_text(encoding="utf-8")
    assert motion_page(data).over == "O"


SWING = (lambda t: 1.0 + 0.5 * np.sin(t), lambda t: 0.5 * np.cos(t), lambda t: -0.5 * np.sin(t))


def test_where_a_drive_reverses_there_is_no_cusp_and_an_end_at_the_start_is_no_crossing():
    swung = driven_by(four_bar(0.4, 0.1, 0.35, 0.25, (0.1, 0.1)), O=SWING)
    found = pf.kinematics(swung, duration=2.0 * math.pi).features
    assert found.trails["coupler.P"].cusps == ()
    assert found.trails["coupler.P"].crunodes == ()
    # All joints reverse with the drive, and the rocker at its own dead point as well.
    times = np.array([one.time for one in found.dead_points["Q"]])
    assert len(times) == 4
    assert [np.min(np.abs(times - t)) for t in (math.pi / 2, 3 * math.pi / 2)] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_links_that_only_translate_have_no_special_points():
    rhomb = four_bar(0.2, 0.2, 0.2, 0.2, (0.1, 0.1))
    rhomb = replace(rhomb, assemblies=(pf.Assembly("open", {"crank": 0.5, "coupler": 0.0, "rocker": 0.5}),))
    motion = pf.kinematics(rhomb, "O", start=math.radians(10), end=math.radians(90))
    assert (
        motion.features.trails["coupler.P"]
        == pf.kinematics(rhomb, "O", start=0.2, end=1.5).features.trails["coupler.P"]
    )
    # All points of the coupler move on circles as the crank's pin does.
    data = pf.motion_dataset(motion)
    speed = np.linalg.norm(data["point_velocity"].sel(point="coupler.P").values, axis=1)
    assert speed == pytest.approx(0.2, abs=1e-12)


def test_a_named_drive_leaves_the_prescribed_motions_of_other_freedoms():
    five = pf.load("five_bar").mechanism
    both = driven_by(five, A1=SWING, A2=SWING)
    motion = pf.kinematics(replace(both, assemblies=five.assemblies), "A1", start=2.0, end=2.2)
    assert [one.joint for one in motion.system.mechanism.prescribed] == ["A1", "A2"]
    assert motion.features.freedoms == 2


def test_a_flywheel_needs_enough_samples_and_a_torque_that_repeats():
    model = pf.load("four_bar")
    with pytest.raises(InputError, match="samples: too few samples for a flywheel"):
        pf.flywheel(pf.torques(model, "O", samples=5), 0.05)
    sine = pf.SampledAngle(
        lambda t: np.sin(3.3 * t), lambda t: 3.3 * np.cos(3.3 * t), lambda t: -10.89 * np.sin(3.3 * t)
    )
    pushed = replace(model.mechanism, loads=(pf.AppliedTorque("push", pf.PointRef("rocker", "B"), sine),))
    with pytest.raises(InputError, match="the torque does not repeat after a turn"):
        pf.flywheel(pf.torques(pushed), 0.05)


@pytest.mark.parametrize("size", [1e-6, 1e3])
def test_a_mechanism_of_any_size_has_the_same_angles(size):
    lengths = np.array([0.4, 0.1, 0.35, 0.25])
    right, found = (
        pf.motion_dataset(pf.kinematics(four_bar(*(scale * lengths), (scale * 0.1, scale * 0.2)), "O", start=1.0))
        for scale in (1.0, size)
    )
    assert float(abs(found["angle"] - right["angle"]).max()) < 1e-9
    for name in ("point_position", "point_velocity", "point_acceleration"):
        assert float(abs(found[name] / size - right[name]).max()) < 1e-9, name


PARALLELOGRAM = replace(
    four_bar(0.4, 0.1, 0.4, 0.1, (0.2, 0.1)),
    assemblies=(pf.Assembly("open", {"crank": 0.7, "coupler": 0.0, "rocker": 0.7}),
                pf.Assembly("crossed", {"crank": 0.7, "coupler": -0.3, "rocker": -1.2})),
)  # fmt: skip


@pytest.mark.parametrize(("start", "samples"), [(0.7, 361), (math.radians(60), 361), (0.7, 2), (math.radians(179), 9)])
def test_a_parallelogram_turns_through_its_folded_poses_without_turning_its_coupler(start, samples):
    motion = pf.kinematics(PARALLELOGRAM, "O", start=start, samples=samples)
    turned = [motion.drive.at(t) for t in motion.passed]
    first = math.pi * math.ceil(start / math.pi)
    assert turned == pytest.approx([first, first + math.pi], abs=1e-6)
    data = pf.motion_dataset(motion)
    names = ("angle", "angular_velocity", "angular_acceleration")
    for name, least in zip(names, (1e-11, 1e-9, 1e-6), strict=True):
        assert float(abs(data[name].sel(body="coupler")).max()) < least, name
        rocker, crank = (data[name].sel(body=body) for body in ("rocker", "crank"))
        assert float(abs(rocker - crank).max()) < least, name
    assert [one.code for one in motion.findings] == ["special-pose"]
    upward = pf.kinematics(PARALLELOGRAM, "O", start=-0.1, end=0.1, samples=samples)
    assert upward.findings[0].text == "assemblies meet, a change point, with O at 0 rad"
    assert "3.14159 rad" in motion.findings[0].text or start > 3.0
    assert motion.features.trails["coupler.P"].crunodes == ()


def test_a_crossed_parallelogram_stays_crossed():
    motion = pf.kinematics(PARALLELOGRAM, "O", assembly="crossed")
    data = pf.motion_dataset(motion)
    turned = data["angle"].sel(body="rocker")
    assert float(turned[0] - turned[-1]) == pytest.approx(2.0 * math.pi, abs=1e-11)
    assert len(motion.passed) == 2
    # Crossed, the tangents of half the angles have a constant ratio.
    crank, rocker = (np.tan(data["angle"].sel(body=body).values / 2.0) for body in ("crank", "rocker"))
    usual = (np.abs(crank) < 10.0) & (np.abs(crank) > 0.1)
    assert (crank / rocker)[usual] == pytest.approx(-(0.4 - 0.1) / (0.4 + 0.1), abs=1e-9)


def test_a_motion_from_an_assembly_at_a_change_point_is_refused():
    folded = pf.Assembly("folded", {"crank": math.pi, "coupler": 0.0, "rocker": math.pi})
    says = (
        r"^the assembly is at a change point, O at 180 deg, where others meet it; .* another position, 1\.00 deg away"
    )
    with output_units(["deg"]), pytest.raises(UnreachablePathError, match=says):
        pf.kinematics(replace(PARALLELOGRAM, assemblies=(folded,)), "O")
    # Rounding is not shown, and as far away the motion may start there.
    flat = pf.Assembly("flat", {"crank": -1e-25, "coupler": 0.0, "rocker": 0.0})
    with pytest.raises(UnreachablePathError, match="change point, O at 0 rad, where"):
        pf.kinematics(replace(PARALLELOGRAM, assemblies=(flat,)), "O", start=0.5)
    away = pf.Assembly("away", {"crank": math.radians(1), "coupler": 0.0, "rocker": math.radians(1)})
    assert len(pf.kinematics(replace(PARALLELOGRAM, assemblies=(away,)), "O", start=0.0, samples=5).passed) == 3


def angles_of(motion):
    data = pf.motion_dataset(motion)
    return [data["angle"].sel(body=body).values for body in ("crank", "coupler", "rocker")]


@pytest.mark.parametrize("beside", [-0.4, -0.01, -1e-5, 0.0, 1e-4, 0.1, 0.6])
def test_a_motion_starts_at_a_change_point_or_beside_it(beside):
    start = math.pi + math.radians(beside)
    motion = pf.kinematics(PARALLELOGRAM, "O", start=start, end=math.pi + 0.3, samples=31)
    crank, coupler, rocker = angles_of(motion)
    assert np.max(np.abs(coupler)) < 1e-10
    assert np.max(np.abs(rocker - crank)) < 1e-10
    assert [motion.drive.at(t) for t in motion.passed] == pytest.approx([math.pi] if beside <= 1e-4 else [], abs=1e-6)
    data = pf.motion_dataset(motion)
    assert float(abs(data["angular_acceleration"].sel(body="coupler")).max()) < 1e-8
    # Backwards, the motion ends where it started.
    back = pf.kinematics(PARALLELOGRAM, "O", start=math.pi + 0.3, end=start, samples=31)
    assert np.max(np.abs(angles_of(back)[2][::-1] - rocker)) < 1e-10


@pytest.mark.parametrize("beside", [-0.1, -1e-3, 0.0, 0.2])
def test_a_crossed_parallelogram_starts_crossed_beside_a_change_point(beside):
    start = math.pi + math.radians(beside)
    crank, _, rocker = angles_of(
        pf.kinematics(PARALLELOGRAM, "O", start=start, end=math.pi + 0.3, samples=31, assembly="crossed")
    )
    usual = np.abs(crank - math.pi) > 0.02
    ratio = np.tan(crank / 2.0) / np.tan(rocker / 2.0)
    assert ratio[usual] == pytest.approx(-(0.4 - 0.1) / (0.4 + 0.1), abs=1e-9)


def test_a_motion_by_a_table_starts_beside_a_change_point():
    angles = {"crank": math.radians(179.9), "coupler": 0.0, "rocker": math.radians(179.9)}
    near = replace(PARALLELOGRAM, assemblies=(pf.Assembly("open", angles),))
    t = np.linspace(0.0, 1.0, 11)
    table = pf.TabulatedProfile(tuple(t), tuple(math.radians(179.9) + 0.3 * t))
    motion = pf.kinematics(replace(near, prescribed=(pf.PrescribedAngle("O", "O", table),)), duration=1.0, samples=31)
    assert np.max(np.abs(angles_of(motion)[1])) < 1e-11
    assert motion.passed == pytest.approx([math.radians(0.1) / 0.3], abs=1e-6)


def bar(name, a, b, length):
    return pf.RigidBody(
        name, mass=1.0, inertia=length**2 / 12, points={a: (0.0, 0.0), b: (length, 0.0)},
        centre_of_mass=(length / 2, 0.0),
    )  # fmt: skip


def picker(links=3):
    """Return a pick-and-place arm of two parallelograms; a third link of each repeats a constraint."""
    numbers = range(1, links + 1)
    low, high = ((0.0, 0.0), (0.1, 0.0), (0.04, 0.06)), ((0.0, 0.02), (0.1, 0.02), (0.05, -0.05))
    bodies = [
        *(bar(f"arm{k}", "O", "A", 0.3) for k in numbers), *(bar(f"fore{k}", "C", "E", 0.25) for k in numbers),
        pf.RigidBody("elbow", 0.5, 1e-3, points={f"{at}{k}": place[k - 1] for k in numbers
                                                 for at, place in (("A", low), ("C", high))}),
        pf.RigidBody("plate", 0.3, 1e-3, points={f"E{k}": high[k - 1] for k in numbers} | {"P": (0.05, -0.1)}),
    ]  # fmt: skip
    joints = [
        revolute(f"{at}{k}", a, b) for k in numbers for at, a, b in (
            ("O", f"ground.O{k}", f"arm{k}.O"), ("A", f"arm{k}.A", f"elbow.A{k}"),
            ("C", f"elbow.C{k}", f"fore{k}.C"), ("E", f"fore{k}.E", f"plate.E{k}"),
        )
    ]  # fmt: skip
    angles = {body.name: {"a": 1.2, "f": -0.4}.get(body.name[0], 0.0) for body in bodies}
    return pf.Mechanism(
        "picker", {f"O{k}": low[k - 1] for k in numbers}, tuple(bodies), tuple(joints),
        motors=(pf.Motor("m1", "O1"), pf.Motor("m2", "C1")), gravity=(0.0, -9.81),
        end_effector=pf.EndEffector(pf.PointRef("plate", "P"), ("x", "y")), assemblies=(pf.Assembly("a", angles),),
    )  # fmt: skip


@pytest.mark.parametrize("beyond", [-1e-6, -1e-7, -1e-12, 0.0, 1e-10])
@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_a_motion_ends_at_a_change_point(beyond, speed):
    """The loops may close there, with accelerations that are rounding errors over the distance."""
    motion = pf.torques(HEAVY, "O", start=math.pi - 0.3, end=math.pi + beyond, samples=31, speed=speed)
    data = pf.motion_dataset(motion).isel(time=-1)
    assert np.max(np.abs(data["angular_acceleration"])) < 1e-7 * speed**2
    assert data["joint_force"].sel(joint="B").values == pytest.approx([-0.05 * speed**2, 0.0], abs=1e-6 * speed**2)


HEAVY = replace(PARALLELOGRAM, bodies=tuple(bar(*one) for one in (
    ("crank", "O", "A", 0.1), ("coupler", "A", "B", 0.4), ("rocker", "Q", "B", 0.1))))  # fmt: skip


@pytest.mark.parametrize("half", [0.1, 0.005])
def test_forces_at_a_change_point_are_the_limit_of_those_beside_it(half):
    """The coupler's pins, which move alike, carry its inertia in equal parts: m r w^2 / 2 = 5 N, towards the pivots."""
    span = {"start": math.pi - half, "end": math.pi + half, "speed": 10.0, "samples": 21}
    motion = pf.torques(HEAVY, "O", **span)
    at = pf.motion_dataset(motion).isel(time=10)
    assert motion.drive.at(motion.solution.t[10]) == pytest.approx(math.pi, abs=1e-12)
    within = 1e-6 if half > 0.02 else 1e-4
    assert at["joint_force"].sel(joint="B").values == pytest.approx([-5.0, 0.0], abs=within)
    assert float(at["drive_torque"].sel(drive="O")) == pytest.approx(0.0, abs=1e-7)
    assert [one.code for one in motion.findings] == ["special-pose"]
    # Weights do work on the motion of coupler and rocker that is free there. The drive does none, and has its torque.
    motion = pf.torques(replace(HEAVY, gravity=(0.0, -9.81)), "O", **span)
    at = pf.motion_dataset(motion).isel(time=10)
    assert np.isnan(at["joint_force"].sel(joint="B", axis="x"))
    # All weights sink by r cos(crank), or half of it: (1/2 + 1 + 1/2) m g r.
    assert float(at["drive_torque"].sel(drive="O")) == pytest.approx(-2.0 * 9.81 * 0.1, rel=1e-7)
    assert [one.code for one in motion.findings] == ["special-pose", "loads-unbounded"]
    assert "forces in O, A, B, Q grow without bound towards O at 3.14159 rad" in motion.findings[-1].text
    # The largest sample of these forces is not their maximum. That of the torque is one.
    figures = load_figures(pf.motion_dataset(motion))
    assert [(one["force_max"], one["force_unbounded"]) for one in figures["joints"].values()] == 4 * [(None, True)]
    assert figures["drives"]["O"]["torque_max"] == pytest.approx(2.0 * 9.81 * 0.1, rel=1e-2)
    assert joint_line({"": figures}) == "largest joint force: unbounded in O, A, B, Q"
    assert load_tiles({"": figures})[-1] == ("largest joint force", "unbounded", "O, A, B, Q")


def test_torques_between_samples_are_examined():
    motion = pf.torques(pf.load("four_bar"), "O", speed=10.0, samples=5)
    (found,) = motion.findings
    assert (found.code, found.place) == ("samples-coarse", "samples")
    fine = pf.motion_dataset(pf.torques(pf.load("four_bar"), "O", speed=10.0, samples=3601))
    torques = [float(np.max(np.abs(data["drive_torque"]))) for data in (pf.motion_dataset(motion), fine)]
    said = re.search(r"torque of \S+ is up to (\S+) N m in them and (\S+) N m", found.text)
    assert said is not None
    assert [float(each) for each in said.groups()] == pytest.approx(torques, rel=1e-3)
    enough = int(found.remedy.split()[-1])
    assert pf.torques(pf.load("four_bar"), "O", speed=10.0, samples=enough).findings == ()
    # Along a path motors give the torques. Forces that grow without bound are left out, others at change points not.
    along = pf.torques(pf.load("five_bar"), mode="++", samples=9)
    assert [one.code for one in along.findings] == ["samples-coarse"]
    assert "the torque of motor left is up to" in along.findings[0].text
    gravity = replace(HEAVY, gravity=(0.0, -9.81))
    for samples in (7, 361):
        past = pf.torques(gravity, "O", start=math.pi / 3, samples=samples)
        assert [one.code for one in past.findings] == ["special-pose", "loads-unbounded"]


def test_a_flywheel_takes_samples_at_change_points():
    gravity = replace(HEAVY, gravity=(0.0, -9.81))
    at, beside = (pf.torques(gravity, "O", start=math.radians(start), speed=10.0) for start in (30.0, 30.3))
    assert np.isnan(at.solution.multipliers).any()
    assert pf.flywheel(at, 0.05).inertia == pytest.approx(pf.flywheel(beside, 0.05).inertia, rel=1e-8)


@pytest.mark.parametrize("links", [2, 3])
def test_links_that_repeat_a_constraint_move_as_the_others(links):
    motion = pf.torques(picker(links), "O1", held={"C1": -1.6}, start=1.2, end=1.9)
    data = pf.motion_dataset(motion)
    assert motion.features.freedoms == 2
    assert float(abs(data["angle"].sel(body=["elbow", "plate"])).max()) < 1e-12
    arms = data["angle"].sel(body=[f"arm{k}" for k in range(1, links + 1)])
    assert float(abs(arms - np.linspace(1.2, 1.9, 361)[:, None]).max()) < 1e-12
    # Held against an elbow that only translates, the forearm does not turn.
    weight = 9.81 * (links * (0.15 + 0.3) + 0.3 * (0.5 + 0.3))
    expected = weight * np.cos(np.linspace(1.2, 1.9, 361))
    assert data["drive_torque"].sel(drive="O1").values == pytest.approx(expected, abs=1e-9)
    undetermined = [one.code for one in motion.findings]
    assert undetermined == (["loads-undetermined"] if links == 3 else [])


def test_constraints_that_contradict_elsewhere_stop_the_motion():
    mechanism = picker()
    longer = tuple(replace(b, points=b.points | {"O": (-0.004, 0.0)}) if b.name == "arm3" else b
                   for b in mechanism.bodies)  # fmt: skip
    x, y = 0.3 * math.cos(1.2), 0.3 * math.sin(1.2)
    # The third arm is longer; its pivot lies such that loops close at the assembly only.
    ground = mechanism.ground | {"O3": (0.04 + x - 0.304 * math.cos(1.2), 0.06 + y - 0.304 * math.sin(1.2))}
    with pytest.raises((InputError, UnreachablePathError)):
        pf.kinematics(replace(mechanism, bodies=longer, ground=ground), "O1", held={"C1": -1.6}, end=1.9)


@pytest.mark.parametrize("links", [2, 3])
def test_torques_along_a_path_are_those_that_drive_a_run(links):
    mechanism, line = picker(links), pf.Line((0.38, 0.08), (0.3, 0.15), 4.0)
    found = pf.torques(mechanism, path=line, samples=101)
    run = pf.simulate(pf.plan(mechanism, line, samples=101, warning=False), "++", warning=False)
    exact, driven = pf.motion_dataset(found), pf.tracking_dataset([run]).isel(mode=0)
    assert found.mode == "++"
    assert float(abs(exact["point_position"].sel(point="plate.P") - driven["end_effector_desired"]).max()) < 1e-12
    assert float(abs(exact["applied_torque"] - driven["torque"]).max()) < 1e-9
    for name in ("frame_force", "frame_moment", "kinetic_energy", *(["joint_force"] if links == 2 else [])):
        assert float(abs(exact[name] - driven[name]).max()) < 1e-4 * float(abs(driven[name]).max()), name
    assert float(abs(exact["motor_energy"] - driven["motor_energy"]).max()) < 1e-3


def test_a_model_with_a_path_follows_it_unless_a_drive_is_named():
    model = pf.load("five_bar")
    motion = pf.kinematics(model, samples=51)
    assert (motion.path, motion.drive) == ("square", None)
    data = pf.motion_dataset(motion)
    desired = model.path("square").evaluate(data["time"].values)
    assert data["point_position"].sel(point="distal1.C").values == pytest.approx(desired.position, abs=1e-12)
    assert data["point_acceleration"].sel(point="distal1.C").values == pytest.approx(desired.acceleration, abs=1e-9)
    # Forces, torques and energies of kinematics are not known, and none is zero.
    for name in ("motor_energy", "motor_power", "applied_torque", "joint_force", "kinetic_energy"):
        assert np.isnan(data[name]).all(), name
    # Couplers of cranks with motors transmit no force of another drive.
    assert motion.features.transmissions == ()
    held = pf.kinematics(model, "A1", held={"A2": 3.0})
    assert held.path == ""
    assert pf.motion_dataset(held)["joint_coordinate"].sel(joint="A2").values == pytest.approx(3.0, abs=1e-12)
    assert pf.kinematics(model, path="line", samples=5).path == "line"


def test_two_cranks_of_a_five_bar_turn_together():
    """Their drives do the work that the kinetic energy takes; mirrored, they move the point on the middle line."""
    model = pf.load("five_bar")
    motion = pf.torques(model, "A1", held={"A2": (0.9, 0.9 + 2.0 * math.pi)})
    data = pf.motion_dataset(motion)
    first, second = (data["joint_coordinate"].sel(joint=joint).values for joint in ("A1", "A2"))
    assert second - first == pytest.approx(0.9 - 2.16, abs=1e-12)
    assert motion.drive.full_turn
    assert motion.features.time_ratios["B1"] == pytest.approx(motion.features.time_ratios["B2"], rel=1e-9)
    power = (data["drive_torque"] * data["drive_speed"]).sum("drive").values
    energy = data["kinetic_energy"].values
    spline = scipy.interpolate.CubicSpline(motion.solution.t, energy, bc_type="periodic")
    assert spline(motion.solution.t, 1) == pytest.approx(power, abs=1e-3 * np.max(np.abs(power)))
    mirrored = pf.kinematics(model, "A1", start=2.16, end=2.0, held={"A2": (math.pi - 2.16, math.pi - 2.0)}, samples=5)
    x = pf.motion_dataset(mirrored)["point_position"].sel(point="distal1.C", axis="x").values
    assert x == pytest.approx(x[0], abs=1e-12)
    for wrong, says in (((1.0, math.nan), "not a finite number"), ((1, 2, 3), "not a number or two numbers")):
        with pytest.raises(InputError, match=rf"held\.A2: {says}"):
            pf.kinematics(model, "A1", held={"A2": wrong})
    slider = pf.load("slider_crank")
    with pytest.raises(InputError, match="2 drives, where the mechanism has 1 degree of freedom"):
        pf.kinematics(slider, "O", held={slider.mechanism.joints[-1].name: (0.1, 0.2)})


def test_a_duration_gives_the_end_of_a_drive():
    motion = pf.kinematics(pf.load("four_bar"), "O", start=0.5, speed=2.0, duration=0.25)
    assert motion.drive.end == pytest.approx(1.0, abs=1e-15)
    assert motion.solution.t[-1] == pytest.approx(0.25, abs=1e-15)


def test_a_prescribed_speed_lasts_as_long_as_the_study():
    model = pf.load("four_bar")
    assert (model.study.duration, pf.kinematics(model, samples=3).solution.t[-1]) == (0.7, pytest.approx(0.7))
    assert pf.kinematics(model, duration=0.2, samples=3).drive.duration == pytest.approx(0.2)
    for turns_once in (pf.kinematics(model, "O", samples=3), pf.kinematics(model, speed=7.0, samples=3),
                       pf.kinematics(model.mechanism, samples=3)):  # fmt: skip
        assert turns_once.drive.full_turn
    with pytest.raises(InputError, match=r"duration: more than 20 turns \(got 9\.0\); give less, or name the drive"):
        pf.kinematics(replace(model, study=replace(model.study, duration=9.0)))


def test_an_assembly_that_had_to_be_moved_is_reported():
    angles = {"crank": math.radians(200), "coupler": 0.4, "rocker": math.radians(100)}
    moved = replace(four_bar(0.4, 0.1, 0.35, 0.25), assemblies=(pf.Assembly("open", angles),))
    assert [one.code for one in pf.kinematics(moved, "O").findings] == ["assembly-elbow"]
    assert pf.kinematics(moved, "O", start=1.0).findings == ()
    # The rocker cannot be at 70 degrees; the crank's angle is nearer.
    angles = {"crank": math.radians(60), "coupler": 0.4, "rocker": math.radians(70)}
    beyond = replace(moved, assemblies=(pf.Assembly("open", angles),))
    (one,) = pf.kinematics(beyond, "Q", end=1.8).findings
    assert one.code == "assembly-moved"
    assert "do not close with Q at 1.22173 rad as given" in one.text
    # A start within reach is taken, and of one that is not the limits are given.
    assert pf.kinematics(beyond, "Q", start=2.0, end=1.8, samples=3).drive.start == 2.0
    says = r"start: not between the limits of reach of Q, 1\.67096 rad and 2\.49809 rad \(got 3\.0\); give one between"
    with pytest.raises(InputError, match=says):
        pf.kinematics(beyond, "Q", start=3.0, end=1.8)


def test_drives_are_named_as_the_user_does():
    heavy = picker(2)
    data = pf.motion_dataset(pf.torques(heavy, "O1", held={"C1": -1.6}, start=1.2, end=1.9, speed=1e6))
    found = json.loads(data.attrs["findings"])
    assert [one["place"] for one in found if one["code"] == "speed-large"] == ["drive O1"]


ROCKER = """
name = "rocker"
[ground]
O = [0, 0]
Q = ["400 mm", 0]
[body.crank]
points = { O = [0, 0], A = ["100 mm", 0] }
[body.coupler]
points = { A = [0, 0], B = ["350 mm", 0], P = ["175 mm", "-280 mm"] }
[body.rocker]
points = { Q = [0, 0], B = ["250 mm", 0] }
[joint]
O = ["ground.O", "crank.O"]
A = ["crank.A", "coupler.A"]
B = ["coupler.B", "rocker.B"]
Q = ["ground.Q", "rocker.Q"]
[assembly.open]
crank = "60 deg"
coupler = "25 deg"
rocker = "100 deg"
"""


@pytest.fixture
def rocker(tmp_path):
    file = tmp_path / "rocker.toml"
    file.write_text(ROCKER)
    return file


def test_the_commands_write_results_that_other_commands_take(rocker, tmp_path):
    folder = tmp_path / "k"
    done = paraflex("kinematics", rocker, "--drive", "O", "--assemblies", "--out", folder)
    assert done.returncode == 0, done.stderr
    assert "1 degree of freedom; O moves from 1.0472 rad to 7.3304 rad, a whole turn" in done.stdout
    assert "crunode" in done.stdout
    assert "repeats" not in done.stdout
    longer = paraflex("kinematics", rocker, "--drive", "O", "--to", "800 deg", "--samples", "9")
    assert "The motion repeats after each turn of O: dead points, transmission angles and" in longer.stdout
    found = json.loads(pf.load_results(folder).attrs["kinematics"])
    assert len(found["assemblies"]) == 2
    assert found["drive"]["full_turn"]
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Transmission angles" in page
    assert "paraflex kinematics" in page
    # The page begins with the range, the smallest transmission angle and the time ratio, over the angle of the drive.
    assert "smallest transmission angle" in page
    assert "Motors and prescribed motions" not in page
    data = json.loads(re.search(r'<script type="application/json" id="report-data">(.*?)</script>', page, re.DOTALL)[1])
    assert data["abscissae"][data["over"] - 1]["name"] == "angle of O"
    assert not data["film"]["bends"]
    assert {each.stem for each in (folder / "figures").iterdir()} == {"joint_motions", "motion_overview", "point_paths"}
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["kinematics"]["time_ratios"]["Q"] == pytest.approx(1.0374965917973495)
    # Without masses no force has a value, and none is zero.
    assert all(one["force_max"] is None for one in summary["loads"]["joints"].values())
    assert summary["loads"]["drives"]["O"]["torque_max"] is None
    assert paraflex("plot", folder, "--out", tmp_path / "figures").returncode == 0
    for over, says in (("o", 'did you mean "O"?'), ("O.angle", 'write "O", the coordinate of the joint')):
        assert says in paraflex("plot", folder, "point_components", "--over", over).stderr
    done = paraflex("kinematics", "five_bar", "--drive", "A1=2.16:2", "--drive", "A2=1:57.3 deg", "--samples", "5")
    assert "A1 moves from 2.1600 rad to 2.0000 rad" in done.stdout
    assert "A2 moves from 1.0000 rad to 1.0001 rad in the same time" in done.stdout
    words = ("four_bar", "--speed", "100 rpm", "--drive", "O", "--fluctuation", "0.02", "--no-report")
    done = paraflex("torques", *words, "--out", tmp_path / "torques")
    drawn = {each.stem for each in tmp_path.glob("torques/figures/*")}
    assert {"drive_efforts", "joint_forces", "frame_loads"} <= drawn
    assert "flywheel for a fluctuation of 0.02: 0.0754 kg m^2" in done.stdout


@pytest.mark.parametrize("speed", [1e-9, 1e9])
def test_a_change_point_is_passed_at_any_speed(speed):
    motion = pf.kinematics(PARALLELOGRAM, "O", start=1.0, end=4.0, speed=speed, samples=31)
    assert np.max(np.abs(angles_of(motion)[1])) < 1e-10
    assert motion.passed == pytest.approx([(math.pi - 1.0) / speed], rel=1e-5)


@pytest.mark.parametrize("first", [-math.pi / 3, -0.17, -1.0])
def test_a_change_point_at_zero_is_shown_as_zero(first):
    (found,) = pf.kinematics(PARALLELOGRAM, "O", start=first, end=1.0, samples=31).findings
    assert found.text.endswith("with O at 0 rad")


def test_loads_have_bounds_of_their_errors():
    """A share of the largest load, in which moments count by the size of the mechanism."""
    motion = pf.torques(pf.load("four_bar"), "O", speed=10.0)
    data = pf.motion_dataset(motion)
    force, torque = (data[f"{name}_error"].values for name in ("joint_force", "drive_torque"))
    largest = np.max(np.linalg.norm(data["joint_force"].values, axis=-1))
    assert np.all((0.3e-9 * largest < force) & (force < 3e-9 * largest))
    assert np.all((0.03e-9 * largest < torque) & (torque < 0.3e-9 * largest))


def test_paths_of_points_mark_cusps_and_crunodes(rocker):
    motion = pf.kinematics(pf.load(rocker), "O")
    chart = next(iter(point_paths(as_runs(pf.motion_dataset(motion)))))
    (mark,) = [curve for curve in chart.curves if curve.name in ("cusp", "crunode")]
    (node,) = motion.features.trails["coupler.P"].crunodes
    assert np.array_equal([mark.x, mark.y], np.array(node.position)[:, None])
    only = next(iter(point_paths(as_runs(pf.motion_dataset(motion)), points=["crank.A"])))
    assert "crunode" not in {curve.name for curve in only.curves}


def test_tables_show_no_rounding_and_name_points_as_figures_do(rocker):
    motion = pf.kinematics(pf.load(rocker), "O", start=1.0)
    data = pf.motion_dataset(motion)
    add_kinematics(data, motion, assemblies=True)
    found = kinematics_of(data)
    found["trails"]["coupler.P"]["crunodes"][0]["position"] = [0.1, -7e-18]
    found["assemblies"][0]["angles"]["rocker"] = 8e-17
    data.attrs["kinematics"] = json.dumps(found)
    tables = {table.title: table for table in kinematics_tables(data)}
    assert tables["Special points of coupler curves"].texts()[0][2:4] == ["100", "0"]
    assert tables["Assemblies"].texts()[0][3] == "0"
    # Of coincident points the first is shown, whichever travels farther by rounding, or else the end-effector.
    names = [str(name) for name in data["point"].values]
    shown = ["crank.A", "coupler.B", "coupler.P"]
    data["point_position"][:, names.index("rocker.B")] *= 1.0 + 1e-14
    for effector, said in (("", shown), ("rocker.B", ["crank.A", "coupler.P", "rocker.B"])):
        data.attrs["end_effector_point"] = effector
        table = next(table for table in kinematics_tables(data) if table.title == "Points")
        assert list(table.columns[0].cells) == said
        assert {names[k] for k in moving_points(as_runs(data))} == set(said)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["torques", "FILE", "--drive", "O"], r"body\.crank\.mass: is missing"),
        (["statics", "FILE"], r"error: .*rocker\.toml: body\.crank\.mass: is missing"),
        (["run", "FILE"], r"rocker\.toml: body\.crank\.mass: is missing"),
        (["kinematics", "LOOSE"], r"loose\.toml: assembly\.NAME: the mechanism has none; add an \[assembly\.NAME\] ta"),
        (["kinematics", "FILE"], "--drive: is missing; name the joint that drives the mechanism: O, A, B, Q"),
        (
            ["kinematics", "FILE", "--drive", "O", "--from", "1 kg"],
            "--from: a quantity in kg where one in rad is asked",
        ),
        (["kinematics", "FILE", "--drive", "O", "--speed", "nan"], "--speed"),
        (["kinematics", "FILE", "--drive", "Q", "--to", "3"], "--drive: Q reaches its limit of reach, 2.49809 rad"),
        (["torques", "four_bar", "--fluctuation", "0"], "--fluctuation: not between 0 and 1"),
        (["torques", "four_bar", "--drive", "Q", "--fluctuation", "0.1"], "--fluctuation: a flywheel needs a drive"),
        (["torques", "four_bar", "--fluctuation", "2%"], r"--fluctuation: not a number \(got '2%'\); write a number w"),
        (
            ["kinematics", "FILE", "--samples", "2.5"],
            r"--samples: not a whole number \(got '2.5'\); write it in digits",
        ),
        (["kinematics", "FILE", "--rpm", "60"], '--rpm: no such option of paraflex kinematics; write --speed "60 rpm"'),
        (["run", "FILE", "--drive", "O"], "--drive: no such option of paraflex run; it is one of paraflex kinematics"),
        (["kinematics", "FILE", "O"], r"kinematics: unexpected argument \(got 'O'\)"),
        (
            ["kinematics", "FILE", "--drive", "O", "--drive", "Q"],
            r"--drive: two joints move \(got 'O, Q'\); hold the others, or give",
        ),
        (["kinematics", "FILE", "--drive", "O", "--drive", "Q=1 m"], "--drive: a quantity in m where one in rad is"),
        (["kinematics", "FILE", "--drive", "O", "--drive", "Q="], r"--drive: has no value \(got 'Q='\)"),
        (["kinematics", "FILE", "-drive", "O"], r"error: -drive: one dash; did you mean --drive\?"),
        (
            ["torques", "FILE", "-d", "O"],
            r"-d: no such option of paraflex torques; did you mean --drive or --duration\?",
        ),
        (["kinematics", "FILE", "--drive", "O", "--from", "abc"], "--from: not a number"),
        (["kinematics", "five_bar", "--drive", "A1", "--drive", "A2=60 rpm"], 'has two, "A2=FIRST:LAST"'),
        (
            ["kinematics", "five_bar", "--drive", "A1", "--drive", "A1=3"],
            r"--drive: names a joint twice \(got 'A1=3'\)",
        ),
        (["kinematics", "five_bar", "--drive", "A1=2", "--drive", "A2=3"], "--drive: nothing moves where all"),
        (["kinematics", "five_bar", "--drive", "A1, A2"], "--drive: several joints .*; give one --drive for each"),
        (["kinematics", "FILE", "--drive", "o"], r"--drive: unknown joint \(got 'o'\); did you mean \"O\"\?"),
        (["kinematics", "FILE", "--drive", "O", "--speed", "60 1/min"], 'its own: write "60 rpm"'),
        (["kinematics", "FILE", "--drive", "O", "--units", "DEG"], r'--units: .*; did you mean "deg"\?'),
        (["kinematics", "FILE", "--drive", "O", "--units", "deg mm"], 'separate units by commas, as in "deg,mm"'),
        (["torques", "FILE", "--flywheel", "0.02"], "--flywheel: no such option .*; write --fluctuation 0.02"),
        (["torques", "FILE", "--helm", "0.02"], "--helm: no such option of paraflex torques; --help lists all"),
        (["kinematics", "FOLDER", "--drive", "O"], "is a directory.*; name a TOML file, not a folder"),
        (["torques", "five_bar", "--mode", "+-"], r'--mode: mode "\+-" cannot drive'),
        (["torques", "four_bar", "--mode", "++"], "--mode: has no effect without a path"),
    ],
)
def test_wrong_requests_are_answered_in_one_line(rocker, tmp_path, words, message):
    loose = tmp_path / "loose.toml"
    loose.write_text(ROCKER.partition("[assembly")[0])
    files = {"FILE": str(rocker), "FOLDER": str(tmp_path), "LOOSE": str(loose)}
    words = [files.get(word, word) for word in words]
    done = paraflex(*words, "--out", tmp_path / "out")
    assert done.returncode == 2, done.stdout
    (line,) = done.stderr.strip().splitlines()
    assert re.search(message, line)
    assert not (tmp_path / "out").exists()


def test_a_file_without_masses_is_named_and_a_model_that_is_not_named_is_told(rocker):
    done = paraflex("info", rocker)
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {rocker}: body.crank.mass: is missing")
    assert paraflex("modes").stderr == "no model is named: this is raparm_i\n"


def test_points_that_pause_with_the_whole_mechanism_have_no_cusp():
    """At the corners of a path all points stop; the followed one has corners there and no cusps."""
    motion = pf.kinematics(pf.load("five_bar"))
    assert motion.features.trails["distal1.C"].cusps == ()


def geared(ratio):
    """Return the crank-rocker, its crank O driven by a motor M through a gear."""
    return replace(
        four_bar(0.4, 0.1, 0.35, 0.25), gears=(pf.Gear("gear", "M", "O", ratio),),
        ground={"O": (0.0, 0.0), "Q": (0.4, 0.0)},
        bodies=(*four_bar(0.4, 0.1, 0.35, 0.25).bodies, pf.RigidBody("motor", points={"M": (0.0, 0.0)})),
        joints=(*four_bar(0.4, 0.1, 0.35, 0.25).joints, revolute("M", "ground.O", "motor.M")),
        assemblies=(pf.Assembly("open", {"crank": 0.7, "coupler": 0.3, "rocker": 1.0, "motor": 0.0}),),
    )  # fmt: skip


@pytest.mark.parametrize("turns", [2, 5])
def test_a_cycle_of_two_turns_of_a_geared_drive_is_searched_once(turns):
    """Angles of the crank are 0.7 plus half those of the motor: one turn shows half of the crank's positions."""
    base, crank, coupler, rocker = 0.4, 0.1, 0.35, 0.25
    found = pf.kinematics(geared(0.5), "M", end=2 * math.pi * turns, samples=5).features
    far, near = (
        math.acos((base**2 + arm**2 - rocker**2) / (2 * base * arm)) for arm in (coupler + crank, coupler - crank)
    )
    drives = sorted(2.0 * ((place - 0.7) % (2 * math.pi)) for place in (far, near + math.pi))
    assert [one.drive for one in found.dead_points["Q"]] == pytest.approx(drives, abs=1e-11)
    assert found.cycle == 2
    ratio = (drives[1] - drives[0]) / (4 * math.pi - drives[1] + drives[0])
    assert found.time_ratios["Q"] == pytest.approx(max(ratio, 1.0 / ratio), rel=1e-11)
    # The gear drives the crank, at which there is no transmission angle.
    (one,) = found.transmissions
    least = math.acos((coupler**2 + rocker**2 - (base - crank) ** 2) / (2 * coupler * rocker))
    assert (one.joint, one.smallest.value) == ("B", pytest.approx(least, abs=1e-12))
    assert one.smallest.drive == pytest.approx(2.0 * (2 * math.pi - 0.7), abs=1e-5)


def test_one_turn_of_a_geared_drive_is_no_cycle():
    found = pf.kinematics(geared(0.5), "M").features
    assert found.cycle is None
    assert found.time_ratios == {}
    assert pf.kinematics(four_bar(0.4, 0.1, 0.35, 0.25), "O", end=20.0).features.cycle == 1


def test_all_cusps_and_crunodes_of_a_wheel_that_rolls_on_are_found():
    """A point of the rim rests where it touches the rail; one beyond it makes a loop there."""
    mechanism = pf.Mechanism(
        "wheel", {"O": (0.0, 0.05)},
        (pf.RigidBody("carriage", points={"S": (0.0, 0.0)}),
         pf.RigidBody("wheel", points={"C": (0.0, 0.0), "R": (0.05, 0.0), "X": (0.08, 0.0)})),
        (revolute("C", "carriage.S", "wheel.C"),
         pf.PrismaticJoint("rail", pf.PointRef.parse("ground.O"), pf.PointRef.parse("carriage.S"), direction=0.0)),
        gears=(pf.Gear("roll", "C", "rail", -0.05),), assemblies=(pf.Assembly("a", {"carriage": 0.0, "wheel": 0.0}),),
    )  # fmt: skip
    turns = 6
    trails = pf.kinematics(mechanism, "C", start=0.0, end=-2 * math.pi * turns).features.trails
    touches = [-math.pi / 2 - 2 * math.pi * k for k in range(turns)]
    assert [one.drive for one in trails["wheel.R"].cusps] == pytest.approx(touches, abs=1e-9)
    # Half a loop turns by u with r u = p sin(u); that about the first touch begins before the motion.
    half = scipy.optimize.brentq(lambda u: 0.05 * u - 0.08 * math.sin(u), 0.5, 3.0)
    nodes = [(0.05 * (math.pi / 2 + 2 * math.pi * k), 0.05 - 0.08 * math.cos(half)) for k in range(1, turns)]
    assert np.array([one.position for one in trails["wheel.X"].crunodes]) == pytest.approx(np.array(nodes), abs=1e-12)
