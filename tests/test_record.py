"""What a run says of its links, whatever they are cut into."""

from pathlib import Path

import numpy as np
import pytest

import paraflex as pf
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import Assembly, Mechanism, Motor, PointRef, PrismaticJoint, RigidBody, raparm_i
from paraflex.motion import simulate_motion
from paraflex.results import motion_dataset, tracking_dataset
from paraflex.tracking import plan_tracking

# Steps that damp the axial vibrations of links, which segments do not have.
FINE = IntegrationOptions(method="tr-bdf2", tolerance=1e-4, step=5e-4)


def study(mechanism, path, segments=None):
    task = plan_tracking(mechanism, path, duration=0.05, samples=26)
    task = task if segments is None else task.in_segments(segments)
    return tracking_dataset([task.simulate("++++", options=FINE)]).isel(mode=0)


@pytest.fixture(scope="module")
def links(square):
    return study(raparm_i().with_geometry("second-order"), square)


def test_the_chord_is_the_x_axis_of_a_pinned_frame(square):
    data = study(raparm_i().with_beams(reference=ReferenceCondition.PINNED).with_geometry("second-order"), square)
    np.testing.assert_allclose(data["chord_angle"], data["angle"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(data["chord_velocity"], data["angular_velocity"], rtol=0, atol=1e-10)


def test_the_chord_is_that_between_named_points(links):
    line = links["point_position"].sel(point="link4.C") - links["point_position"].sel(point="link4.B1")
    angle = np.arctan2(line.sel(axis="y"), line.sel(axis="x"))
    chord = links["chord_angle"].sel(body="link4")
    np.testing.assert_allclose(chord, angle, rtol=0, atol=1e-12)
    # The tangent at the first end is not the chord: links bend.
    assert np.abs(chord - links["angle"].sel(body="link4")).max() > 1e-4
    rate = np.gradient(chord.values, links["time"].values)
    np.testing.assert_allclose(links["chord_velocity"].sel(body="link4")[1:-1], rate[1:-1], rtol=0, atol=0.02)


def test_segments_are_told_as_links(links, square):
    cut = study(raparm_i(), square, 16)
    for name in ("body", "joint", "point", "motor"):
        assert list(cut[name].values) == list(links[name].values)
    # Both are of the same mechanism: a chord turns alike, a tip bends alike (segments are stiffer by 1/n).
    np.testing.assert_allclose(cut["chord_angle"], links["chord_angle"], rtol=0, atol=1e-4)
    deepest = np.abs(links["tip_transverse"]).max("time")
    np.testing.assert_allclose(np.abs(cut["tip_transverse"]).max("time"), deepest, rtol=0.25)
    np.testing.assert_allclose(cut["joint_force"][5:], links["joint_force"][5:], rtol=0, atol=0.5)
    np.testing.assert_array_equal(cut["angle_desired"], links["angle_desired"])


def test_segments_are_not_cut_again(square):
    with pytest.raises(InputError, match="cut into segments already"):
        plan_tracking(raparm_i(), square, samples=3).in_segments(4).in_segments(2)


def test_motors_speeds_and_powers(links, square):
    """Power is torque times the rate of the joint: all the work there is where nothing else acts."""
    np.testing.assert_allclose(links["motor_power"], links["torque"] * links["motor_speed"], rtol=1e-15)
    rate = links["angular_velocity"].sel(body="link1")
    np.testing.assert_array_equal(links["motor_speed"].sel(motor="tau1"), rate)
    assert (links["motor_speed"].attrs["units"], links["motor_power"].attrs["units"]) == ("rad/s", "W")
    # Without vibrations, which pass between samples.
    rigid = study(raparm_i().rigid(), square)
    done = np.trapezoid(rigid["motor_power"].sum("motor"), rigid["time"])
    assert rigid["work"].values[-1] == pytest.approx(done, rel=1e-3)
    # A motor turns the first segment of its link.
    cut = study(raparm_i(), square, 4)
    np.testing.assert_array_equal(cut["motor_speed"].sel(motor="tau1"), cut["angular_velocity"].sel(body="link1"))


def test_a_motor_that_slides_without_a_path():
    """A block of mass m pushed by a constant force F: v = F t / m, and the power F v."""
    block = RigidBody("block", 2.0, 1e-3, points={"P": (0.0, 0.0)})
    rail = PrismaticJoint("rail", PointRef("ground", "O"), PointRef("block", "P"), 0.0)
    home = Assembly("home", {"block": 0.0}, {PointRef("block", "P"): (0.0, 0.0)})
    mechanism = Mechanism(
        "push", {"O": (0.0, 0.0)}, (block,), (rail,), motors=(Motor("push", "rail"),), assemblies=(home,)
    )
    data = motion_dataset(simulate_motion(mechanism, 1.0, samples=5, torques={"push": 3.0}))
    np.testing.assert_allclose(data["motor_speed"].sel(motor="push"), 1.5 * data["time"], rtol=1e-9)
    np.testing.assert_allclose(data["motor_power"].sel(motor="push"), 4.5 * data["time"], rtol=1e-9)
    units = [data[name].attrs["units"] for name in ("motor_speed", "motor_power", "applied_torque")]
    assert units == ["m/s", "W", "N"]


@pytest.mark.filterwarnings("ignore::paraflex.errors.ModelWarning")
def test_a_body_both_of_whose_ends_are_in_one_place_turns_as_its_frame(tmp_path):
    text = (Path(__file__).parents[1] / "benchmarks" / "fuzzed" / "everything.toml").read_text(encoding="utf-8")
    (tmp_path / "one.toml").write_text(text.replace("position = [0.2, 0.0]", "position = [0.0, 0.0]"))
    run = simulate_motion(pf.load(tmp_path / "one.toml"), 0.01, samples=3)
    given = motion_dataset(run).sel(body="given")
    assert np.ptp(given["angle"].values) > 1e-4
    np.testing.assert_array_equal(given["chord_angle"], given["angle"])
    np.testing.assert_array_equal(given["chord_velocity"], given["angular_velocity"])
