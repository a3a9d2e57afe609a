"""Input shapers: impulses against published ones, residuals, shaped paths and torques, what is left of vibration."""

from __future__ import annotations

from dataclasses import replace
from math import asin, cos, exp, pi, sqrt

import numpy as np
import pytest

import paraflex as pf
from paraflex.errors import InputError
from paraflex.files import load_path
from paraflex.integrators.sensitivity import run_derivatives
from paraflex.paths import turning_of
from paraflex.studies import load_sensitivities
from shell import paraflex
from test_paths import PATHS, TABLES
from test_sensitivities import STUDY, Design, write

SHAPER = pf.shaper("zvd", [13.4, 18.7], 0.01)

# --- Impulses ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "times", "amplitudes", "residual"),
    [
        ("zv", [0.0, 0.05001], [0.51570594, 0.48429406], 0.15108),
        ("zvd", [0.0, 0.05001, 0.10002], [0.26595261, 0.49950665, 0.23454074], 0.022824),
        ("zvdd", [0.0, 0.05001, 0.10002, 0.15003], [0.13715334, 0.38639782, 0.36286216, 0.11358669], 0.0034481),
    ],
)
def test_impulses_and_residual_of_a_damped_mode(kind, times, amplitudes, residual):
    shaper = pf.shaper(kind, 10.0, damping=0.02)
    np.testing.assert_allclose(shaper.times, times, rtol=0, atol=1e-6)
    np.testing.assert_allclose(shaper.amplitudes, amplitudes, rtol=0, atol=1e-8)
    assert shaper.residual(11.0) == pytest.approx(residual, rel=5e-5)
    assert shaper.residual(10.0) < 1e-14
    assert shaper.duration == shaper.times[-1]


def test_an_undamped_ei_shaper_is_the_published_one():
    shaper = pf.shaper("ei", 8.0, tolerance=0.05)
    np.testing.assert_allclose(shaper.times, [0.0, 0.0625, 0.125], rtol=1e-15)
    np.testing.assert_allclose(shaper.amplitudes, [1.05 / 4, 0.95 / 2, 1.05 / 4], rtol=1e-15)


@pytest.mark.parametrize("damping", [0.01, 0.1, 0.3])
@pytest.mark.parametrize("tolerance", [0.02, 0.05])
def test_a_damped_ei_shaper_is_within_its_tolerance_and_near_the_published_fits(damping, tolerance):
    shaper = pf.shaper("ei", 8.0, damping, tolerance)
    band = 8.0 * np.linspace(0.7, 1.4, 7001)
    residual = shaper.residual(band)
    inner = np.abs(band / 8.0 - 1.0) < 0.05
    assert shaper.residual(8.0) == pytest.approx(tolerance, rel=1e-9)
    assert np.max(residual[inner]) <= tolerance * (1.0 + 1e-9)
    # Zero on either side, down to the spacing of the band.
    assert max(np.min(residual[band < 8.0]), np.min(residual[band > 8.0])) < 2e-3
    # Singhose, Seering and Singer's fits, good to half a percent; there the last impulse is at T_d.
    V, z = tolerance, damping
    first = 0.24968 + 0.24961 * V + 0.80008 * z + 1.23328 * V * z + 0.49599 * z**2 + 3.17316 * V * z**2
    last = 0.25149 + 0.21474 * V - 0.83249 * z + 1.41498 * V * z + 0.85181 * z**2 - 4.90094 * V * z**2
    np.testing.assert_allclose(shaper.amplitudes[[0, 2]], [first, last], rtol=0, atol=3e-3)
    periods = shaper.times * 8.0 * sqrt(1.0 - z**2)
    np.testing.assert_allclose(periods[1:], [0.5, 1.0], rtol=0, atol=0.03)


def test_widths_of_the_bands_are_those_of_closed_forms():
    # Residuals |cos(pi r / 2)|^n of ZV, ZVD and ZVDD at the relative frequency r.
    for n, kind, published in ((1, "zv", 0.0637), (2, "zvd", 0.2871), (3, "zvdd", 0.4804)):
        width = pf.shaper(kind, 10.0).insensitivity()
        assert width == pytest.approx(4.0 / pi * asin(0.05 ** (1.0 / n)), rel=1e-12)
        assert width == pytest.approx(published, abs=5e-5)
    ei = pf.shaper("ei", 10.0)
    # Residual |(1 - V) + (1 + V) cos(pi r)| / 2, V within +-0.05.
    assert ei.insensitivity() == pytest.approx(2.0 / pi * np.arccos((1.0 - 3 * 0.05) / 1.05), rel=1e-9)
    assert ei.insensitivity() == pytest.approx(0.3994, abs=1e-4)
    assert ei.insensitivity(0.04) == 0.0
    assert pf.shaper("ei", 3.0, 0.1).insensitivity() > 0.4


def test_shapers_of_one_frequency_twice_are_the_next_kind():
    """Convolution and merging of impulses against the binomial formulas."""
    for order, kind in ((2, "zvd"), (3, "zvdd")):
        several, one = pf.shaper("zv", [7.0] * order, 0.03), pf.shaper(kind, 7.0, 0.03)
        np.testing.assert_allclose(several.times, one.times, rtol=1e-14)
        np.testing.assert_allclose(several.amplitudes, one.amplitudes, rtol=1e-14)


def test_a_shaper_of_several_modes_leaves_none_of_them():
    shaper = pf.shaper("zvd", np.array([13.4, 18.7, 40.0]), [0.01, 0.0, 0.05])
    assert shaper.times.size == 27
    assert shaper.times[0] == 0.0
    assert np.all(np.diff(shaper.times) > 0.0)
    assert np.sum(shaper.amplitudes) == pytest.approx(1.0, rel=1e-14)
    for frequency, damping in zip((13.4, 18.7, 40.0), (0.01, 0.0, 0.05), strict=True):
        assert shaper.residual(frequency, damping) < 1e-14


def test_the_residual_is_what_an_oscillator_does():
    """The response of x'' + 2 z w x' + w^2 x to the impulses, in closed form, after the last of them."""
    shaper, z, w = pf.shaper("zvd", 10.0, 0.05), 0.08, 2 * pi * 12.0
    wd, end = w * sqrt(1.0 - z**2), shaper.duration
    x, v = 0.0, 0.0
    for t, weight in zip(shaper.times, shaper.amplitudes, strict=True):
        decay = weight * exp(-z * w * (end - t))
        x += decay * np.sin(wd * (end - t)) / wd
        v += decay * (cos(wd * (end - t)) - z * w / wd * np.sin(wd * (end - t)))
    assert shaper.residual(12.0, z) == pytest.approx(np.hypot(wd * x, v + z * w * x), rel=1e-12)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: pf.shaper("zvt", 10.0), "kind: unknown shaper kind .*; "),
        (lambda: pf.shaper("zv", 0.0), "frequencies: must be positive .*; give it in Hz"),
        (lambda: pf.shaper("zv", np.nan), "frequencies: must be positive"),
        (lambda: pf.shaper("zv", [10.0, -1.0]), "frequencies: must be positive"),
        (lambda: pf.shaper("zv", []), "frequencies: no frequency; give those of the modes in Hz"),
        (lambda: pf.shaper("zv", "fast"), "frequencies: not "),
        (lambda: pf.shaper("zv", [10.0] * 9), r"frequencies: too many.*\(got 512\); at most 256"),
        (lambda: pf.shaper("zv", 10.0, 1.0), "damping: not a valid damping ratio .*from 0 to 1"),
        (lambda: pf.shaper("zv", 10.0, -0.1), "damping: not a valid damping ratio"),
        (lambda: pf.shaper("ei", 10.0, 0.4), "damping: not a valid damping ratio .*from 0 to 0.3"),
        (lambda: pf.shaper("ei", 10.0, 0.3, 0.9), "tolerance: there is no EI shaper"),
        (lambda: pf.shaper("zv", [10.0, 20.0, 30.0], [0.1, 0.2]), "damping: there are 3 frequencies and 2 damping"),
        (lambda: pf.shaper("zvd", 10.0, tolerance=0.1), "tolerance: only an EI shaper has a tolerance"),
        (lambda: pf.shaper("ei", 10.0, tolerance=0.0), "tolerance: not a fraction"),
        (lambda: pf.shaper("zv", 10.0).insensitivity(1.0), "tolerance: not a fraction"),
        (lambda: pf.ShapedPath("square", SHAPER), "path: not a path"),
        (lambda: pf.ShapedPath(PATHS["line"], "zv"), "shaper: not a shaper .*; give a shaper, as"),
    ],
)
def test_shapers_that_make_no_sense_are_refused(make, says):
    with pytest.raises(InputError, match=f"^{says}") as caught:
        make()
    assert caught.value.remedy


# --- Paths ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", [*PATHS.values(), *TABLES.values()], ids=[*PATHS, *TABLES])
def test_a_shaped_path_is_the_sum_of_delayed_ones(path):
    shaped = pf.ShapedPath(path, SHAPER)
    t = np.linspace(-0.1, shaped.duration + 0.1, 403)
    copies = [np.stack(path.evaluate(t - delay)) for delay in SHAPER.times]
    expected = np.tensordot(SHAPER.amplitudes, copies, 1)
    # Splines end with accelerations of rounding at their start, which is rest.
    np.testing.assert_allclose(np.stack(shaped.evaluate(t)), expected, rtol=0, atol=1e-9)
    assert shaped.duration == path.duration + SHAPER.duration
    assert {round(delay + knot, 9) for delay in SHAPER.times for knot in path.knots} == {
        round(knot, 9) for knot in shaped.knots
    }
    ends = shaped.evaluate(np.array([0.0, shaped.duration])).position
    np.testing.assert_allclose(ends, path.evaluate(np.array([0.0, path.duration])).position, rtol=0, atol=1e-12)
    middle = t[5:-5]
    difference = (shaped.evaluate(middle + 1e-6).position - shaped.evaluate(middle - 1e-6).position) / 2e-6
    np.testing.assert_allclose(shaped.evaluate(middle).velocity, difference, rtol=0, atol=1e-5)


def test_angles_of_a_path_are_shaped_too():
    path = pf.PointPath(((0.4, -0.3, 0.1), (0.2, 0.0, 0.5)), 0.3)
    shaped, t = pf.ShapedPath(path, SHAPER), np.linspace(0.0, 0.45, 91)
    copies = [path.turning(np.maximum(t - delay, 0.0)) for delay in SHAPER.times]
    np.testing.assert_allclose(turning_of(shaped, t), np.tensordot(SHAPER.amplitudes, copies, 1), rtol=0, atol=1e-9)
    assert turning_of(pf.ShapedPath(PATHS["line"], SHAPER), t) is None
    tour = pf.SequencePath((shaped, pf.PointPath(((0.2, 0.0, 0.5), (0.0, 0.0, 0.0)), 0.3)))
    assert turning_of(tour, np.array([shaped.duration]))[0] == pytest.approx([0.5])


class Rushed:
    """A path of one's own, which does not say where it rests before its start."""

    duration, knots = 0.5, (0.0, 0.5)

    def evaluate(self, t):
        t = np.minimum(t, 0.5)[:, None]
        return pf.paths.PathMotion(t**2 * [1.0, 0.0], 2 * t * [1.0, 0.0], np.where(t < 0.5, 2.0, 0.0) * [1.0, 0.0])


def test_a_path_rests_before_its_start():
    position, velocity, acceleration = pf.ShapedPath(Rushed(), pf.shaper("zv", 10.0)).evaluate(np.array([0.02, 0.06]))
    np.testing.assert_allclose(position[:, 0], 0.5 * np.array([0.0004, 0.0036 + 0.0001]), rtol=1e-12)
    np.testing.assert_allclose(velocity[:, 0], 0.5 * np.array([0.04, 0.12 + 0.02]), rtol=1e-12)
    np.testing.assert_allclose(acceleration[:, 0], [1.0, 2.0], rtol=1e-12)


SHAPED = 'shaper = { type = "zvd", frequencies = [13.4, "18.7 Hz"], damping = 0.01 }\n'


def with_shaper(folder, shaper, name="square"):
    text = pf.load("raparm_i").text.replace(f"[path.{name}]\n", f"[path.{name}]\n{shaper}")
    (folder / "shaped.toml").write_text(text)
    return folder / "shaped.toml"


def test_a_file_shapes_a_path_and_is_written_again(tmp_path):
    plain = pf.load("raparm_i").paths["square"]
    model = pf.load(with_shaper(tmp_path, SHAPED))
    assert model.paths["square"] == pf.ShapedPath(plain, SHAPER)
    model.save(tmp_path / "same.toml")
    assert (tmp_path / "same.toml").read_text() == model.text
    made = {
        "square": plain,
        "ei": pf.ShapedPath(plain, pf.shaper("ei", 13.4, tolerance=0.1)),
        "both": pf.ShapedPath(pf.SequencePath((plain, plain)), SHAPER),
    }
    pf.Model(model.mechanism, made).save(tmp_path / "made.toml")
    assert pf.load(tmp_path / "made.toml").paths == made
    with pytest.raises(InputError, match=r"^path.twice.shaper: a model file cannot express this .*one shaper all freq"):
        pf.Model(model.mechanism, {"twice": pf.ShapedPath(made["ei"], SHAPER)}).save(tmp_path / "no.toml")
    file = tmp_path / "path.toml"
    file.write_text('[path]\ntype = "line"\nstart = [0, 0]\nend = [1, 0]\nmax_acceleration = 1\n' + SHAPED)
    assert load_path(file) == pf.ShapedPath(pf.Line((0, 0), (1, 0), 1.0), SHAPER)


@pytest.mark.parametrize(
    ("shaper", "says"),
    [
        ('shaper = { type = "zvx", frequencies = 3 }', "path.square.shaper.type: "),
        ('shaper = { frequencies = 3 }', "path.square.shaper.type: is missing; give the kind"),
        ('shaper = { type = "zv" }', "path.square.shaper.frequencies: is missing; give the undamped natural freq"),
        ('shaper = { type = "zv", frequencies = -3 }', "path.square.shaper.frequencies: must be positive (got -3"),
        ('shaper = { type = "zv", frequencies = "3 rpm" }', "path.square.shaper.frequencies: "),
        ('shaper = { type = "zv", frequencies = 3, dampin = 0 }', "path.square.shaper.dampin: unknown field"),
        ('shaper = { type = "zv", frequencies = 3, damping = 2 }', "path.square.shaper.damping: not a valid damping"),
        ('shaper = { type = "zv", frequencies = 3, tolerance = 0.1 }', "path.square.shaper.tolerance: only an EI"),
        ('shaper = "zv"', "path.square.shaper: "),
    ],
)  # fmt: skip
def test_shapers_of_files_that_make_no_sense_are_refused_by_name(tmp_path, shaper, says):
    file = with_shaper(tmp_path, shaper + "\n")
    with pytest.raises(InputError) as caught:
        pf.load(file)
    assert f"{file}: {says}" in str(caught.value)
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("shaper", "field"),
    [
        ('{ type = "zvd", frequencies = 42.0, damping = 0.01 }', "max_acceleration"),
        ('{ type = "zvd", frequencies = 42.0, damping = 0.01 }', "shaper.frequencies"),
        ('{ type = "ei", frequencies = 42.0 }', "shaper.frequencies"),
    ],
)
def test_derivatives_of_a_run_by_numbers_of_a_shaped_path_against_differences(tmp_path, shaper, field):
    file = with_shaper(tmp_path, f"shaper = {shaper}\n", "line")
    head = STUDY.split("[vary.")[0].replace('"raparm_i"', f'"{file}"')
    design = Design(load_sensitivities(write(tmp_path, f'{head}[vary.one]\nfields = ["path.line.{field}"]\n')))
    direction, error = design.direction(0)
    assert error < 1e-12
    found = run_derivatives(design.given.problem, design.options, [direction])
    for kind, exact, expected in zip(found.motion._fields, found.derivatives, design.differences(0, 2e-4), strict=True):
        assert np.abs(exact[0] - expected).max() < 3e-6 * np.abs(expected).max(), kind


def test_no_derivative_by_the_damping_of_an_ei_shaper(tmp_path):
    file = with_shaper(tmp_path, 'shaper = { type = "ei", frequencies = 42.0, damping = 0.01 }\n', "line")
    head = STUDY.split("[vary.")[0].replace('"raparm_i"', f'"{file}"')
    study = write(tmp_path, f'{head}[vary.one]\nfields = ["path.line.shaper.damping"]\n')
    design = Design(load_sensitivities(study))
    with pytest.raises(InputError, match=r"^shaper: no derivative by damping or tolerance of an EI shaper"):
        design.direction(0)


def test_info_and_a_run_name_and_draw_a_shaped_path(tmp_path):
    file = with_shaper(tmp_path, SHAPED)
    assert "square" in paraflex("info", file).stdout
    asked = ("--mode=++++", "--samples", 41, "--tol", 1e-4, "--no-figures", "--out", tmp_path / "out")
    done = paraflex("run", file, *asked)
    assert done.returncode == 0
    data = pf.load_results(tmp_path / "out")
    model = pf.load(file)
    assert data.attrs["motion_end"] == pytest.approx(model.paths["square"].duration)
    desired = model.paths["square"].evaluate(data["time"].values).position
    np.testing.assert_allclose(data["end_effector_desired"].isel(mode=0).values, desired, rtol=0, atol=1e-12)
    assert pf.plots.desired_path(data).axes
    assert pf.plots.end_effector_path(data, "++++").axes


# --- Vibration -----------------------------------------------------------------------------------------------------


def arm():
    """A flexible link on a motor, tip to follow a path."""
    link = pf.FlexibleBeam(
        "link", 0.6, pf.Section.rectangle(0.02, 0.003), pf.Material(210e9, 7850.0), {"hub": 0.0, "tip": 0.6}, elements=2
    )
    return pf.Mechanism(
        "arm", {"O": (0, 0)}, [link], [pf.RevoluteJoint("A", "ground.O", "link.hub")], [pf.Motor("drive", "A")],
        end_effector=pf.EndEffector("link.tip", ["y"]), assemblies=[pf.Assembly("flat", {"link": 0.0})],
    )  # fmt: skip


def vibration(task, end, mode="+", tolerance=1e-7):
    """The largest peak-to-peak deflection of a tip from a time on [m]."""
    run = task.simulate(mode, options=pf.IntegrationOptions(tolerance=tolerance), warning=False)
    deflection = pf.tracking_dataset([run])["deflection"].isel(mode=0).values[run.solution.t > end]
    return np.max(np.ptp(deflection, axis=0))


def reductions(mechanism, line, shaper, mode="+", tolerance=1e-7, duration=0.6):
    """Vibration without shaper over that with a shaped path, and with shaped torques."""
    end = line.duration + shaper.duration
    plain = pf.plan(mechanism, line, duration=duration)
    tasks = pf.plan(mechanism, pf.ShapedPath(line, shaper), duration=duration), pf.shape_torques(plain, shaper)
    before, *after = (vibration(task, end, mode, tolerance) for task in (plain, *tasks))
    return [before / each for each in after]


def test_free_frequencies_shape_what_torques_drive_and_held_ones_do_not():
    mechanism, line = arm(), pf.Line((0.6, -0.1), (0.6, 0.1), 60.0)
    linear = pf.linearise(mechanism, mode="+")
    free, held = linear.frequencies[1:3] / (2 * pi), linear.held_frequencies()[:1] / (2 * pi)
    # Measured: 36 and 93 times less with two modes, whatever is left being curved geometry; with the wrong ones 1.3.
    assert min(reductions(mechanism, line, pf.shaper("zvd", free))) > 20.0
    assert max(reductions(mechanism, line, pf.shaper("zvd", held))) < 2.0


def test_held_frequencies_shape_what_prescribed_motions_drive_and_free_ones_do_not():
    """A drive that turns the link whatever the torque, its motion shaped as a function of time."""
    linear = pf.linearise(arm(), mode="+")
    frequencies = {"held": linear.held_frequencies()[:2] / (2 * pi), "free": linear.frequencies[1:3] / (2 * pi)}
    quintic, T = np.polynomial.Polynomial([0.0, 0.0, 0.0, 3.0, -4.5, 1.8]), 0.12
    functions = [lambda t, k=k: quintic.deriv(k)(np.clip(t / T, 0.0, 1.0)) / T**k for k in range(3)]

    def left(of_time, end):
        law = pf.SampledAngle(*of_time)
        drive = pf.PrescribedAngle("drive", "A", law)
        driven = replace(arm(), motors=(), end_effector=None, prescribed=(drive,))
        run = pf.simulate_motion(driven, 0.7, options=pf.IntegrationOptions(tolerance=1e-7), warning=False)
        return np.max(np.ptp(run.solution.q[run.solution.t > end, 3:], axis=0))

    fall = {}
    for name, each in frequencies.items():
        shaper = pf.shaper("zvd", each)
        end = T + shaper.duration
        fall[name] = left(functions, end) / left([shaper.shaped(one) for one in functions], end)
    assert fall["held"] > 20.0
    assert fall["free"] < 3.0


def test_raparm_i_is_at_rest_after_a_shaped_line():
    mechanism, line = (
        pf.load("raparm_i").mechanism.with_geometry("second-order"),
        pf.Line((-0.04, 0.264), (0.04, 0.264), 20.0),
    )
    linear = pf.linearise(pf.plan(mechanism, line), mode="++++", at=line.duration)
    free, held = linear.frequencies[2:4] / (2 * pi), linear.held_frequencies()[:2] / (2 * pi)
    options = {"mode": "++++", "tolerance": 1e-6, "duration": 0.4}
    # Measured: 111 and 110 times less with free frequencies, 51.4 and 60.9 Hz; 8.4 with held ones, 13.4 and 18.6 Hz.
    assert min(reductions(mechanism, line, pf.shaper("zvd", free), **options)) > 50.0
    assert max(reductions(mechanism, line, pf.shaper("zvd", held), **options)) < 15.0


# --- Torques -------------------------------------------------------------------------------------------------------


def test_shaped_torques_are_the_sum_of_delayed_ones():
    mechanism = replace(pf.load("raparm_i").mechanism, gravity=(0.0, -9.81))
    line = pf.Line((-0.04, 0.264), (0.04, 0.264), 20.0)
    plain = pf.plan(mechanism, line, duration=0.4, samples=81)
    shaper = pf.shaper("zvd", [51.4, 60.9], 0.01)
    task = pf.shape_torques(plain, shaper)
    before, after = plain.torques("+-+-"), task.torques("+-+-")
    t = np.linspace(0.0, 0.4, 1201)
    copies = [before.evaluate(np.maximum(t - delay, 0.0)) for delay in shaper.times]
    # Values of the splines' pieces about other places: rounding of torques of some 10 N m.
    np.testing.assert_allclose(after.evaluate(t), np.tensordot(shaper.amplitudes, copies, 1), rtol=0, atol=1e-10)
    np.testing.assert_allclose(after.evaluate(t[:1]), before.evaluate(t[:1]), rtol=1e-12)
    assert np.max(np.abs(after.evaluate(t[:1]))) > 1.0
    for signal in after.signals:
        assert signal.breaks[[0, -1]].tolist() == [0.0, 0.4]
        assert np.min(np.diff(signal.breaks)) > 1e-13
    assert set(np.round(after.knots, 9)) >= {round(delay + knot, 9) for delay in shaper.times for knot in line.knots}
    # The desired motion is that along the shaped path, of the plan too.
    assert task.path == pf.ShapedPath(line, shaper)
    np.testing.assert_allclose(task.motion.desired.position, task.path.evaluate(task.motion.t).position, atol=1e-12)
    np.testing.assert_allclose(task.plan.follow(task.motion.t).q, task.motion.q, atol=1e-12)


def test_shaped_torques_move_a_mechanism_of_constant_inertia_along_the_shaped_path():
    cart = pf.Mechanism(
        "cart", {"O": (0, 0)}, [pf.RigidBody("cart", 2.0, 0.1, (0, 0), {"P": (0, 0)})],
        [pf.PrismaticJoint("rail", "ground.O", "cart.P")], [pf.Motor("drive", "rail")],
        end_effector=pf.EndEffector("cart.P", ["x"]), assemblies=[pf.Assembly("home", {"cart": 0.0})],
    )  # fmt: skip
    plain = pf.plan(cart, pf.Line((0.0, 0.0), (0.5, 0.0), 5.0), duration=1.2)
    task = pf.shape_torques(plain, pf.shaper("zv", 5.0, 0.1))
    run = task.simulate("+", after="hold", options=pf.IntegrationOptions(tolerance=1e-8))
    assert run.driven.deviation < 1e-7
    # Brakes engage when the shaped torques end, not when the path without shaper does.
    assert run.task.holds
    segments = pf.shape_torques(
        pf.plan(arm(), pf.Line((0.6, -0.1), (0.6, 0.1), 60.0), duration=0.3).in_segments(3), SHAPER
    )
    assert segments.whole.path == segments.path


def test_a_run_too_short_for_shaped_torques_is_refused():
    task = pf.plan(arm(), pf.Line((0.6, -0.1), (0.6, 0.1), 60.0))
    with pytest.raises(InputError, match=r"^duration: the run ends before the shaped torques do .*at least 0\.\d+ s"):
        pf.shape_torques(task, SHAPER)
    with pytest.raises(InputError, match=r"^shaper: not a shaper"):
        pf.shape_torques(task, "zvd")
