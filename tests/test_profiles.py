"""Prescribed profiles of model files: exact derivatives, pieces that meet, tables; and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.interpolate

from paraflex.checks.check import profiles_cut_short
from paraflex.dynamics import constant_signals, pack_signals
from paraflex.errors import InputError
from paraflex.expressions.evaluate import ExpressionError, evaluate_in_time
from paraflex.files import load
from paraflex.integrators import IntegrationOptions
from paraflex.kernel.signals import evaluate_signal
from paraflex.mechanism import ConstantSpeed, PiecewiseProfile, PrescribedAngle, SpeedProfile, TabulatedProfile
from paraflex.mechanism.profiles import Interpolation
from paraflex.motion import simulate_motion
from test_spin_up import acceleration, angle, rate

DISC = """
name = "disc"
[parameters]
a = 0.3
w = 5.0
[ground]
O = [0.0, 0.0]
[body.disc]
type = "rigid"
mass = 2.0
inertia = 0.1
centre_of_mass = [0.1, 0.0]
points = { O = [0.0, 0.0] }
[joint]
O = ["ground.O", "disc.O"]
[assembly.start]
disc = 0.0
[prescribed.drive]
joint = "O"
"""
# Of the disc about O [m].
GYRATION = np.sqrt(0.1 / 2.0 + 0.1**2)
PARAMETERS = {"a": 0.3, "w": 5.0, "n": 3.0}


def write(folder, profile, head=""):
    file = folder / "disc.toml"
    file.write_text(head + DISC + profile, encoding="utf-8")
    return file


def profile_of(folder, text):
    return load(write(folder, text)).mechanism.prescribed[0].profile


# --- Jets ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "t",
        "a",
        "-t + a - (+w)",
        "a - t",
        "w * t * (t - a)",
        "t / (1 + t ** 2)",
        "a / t",
        "(a * t + 1) ** n",
        "t ** -2",
        "t ** 2.5",
        "2 ** t",
        "t ** t",
        "a * sin(w * t) * cos(t / w)",
        "tan(t) + asin(t / 2) - acos(t / 3) * atan(w * t)",
        "sinh(t) * cosh(2 * t) / tanh(t)",
        "exp(-t ** 2) * log(1 + t) + sqrt(t)",
        "sin(cos(exp(a * t)))",
    ],
)
def test_derivatives_of_expressions_against_those_of_an_interpolating_polynomial(text):
    reach = 0.1
    for t0 in (0.4, 0.9):
        x = np.cos(np.pi * (np.arange(19) + 0.5) / 19)
        functions = {name: getattr(np, name.replace("a", "arc", 1) if name in ("asin", "acos", "atan") else name)
                     for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log",
                                  "sqrt")}  # fmt: skip
        values = eval(text, {"__builtins__": {}}, {**functions, **PARAMETERS, "t": t0 + reach * x}) + 0.0 * x
        series = np.polynomial.Chebyshev.fit(t0 + reach * x, values, 18)
        jet = evaluate_in_time(text, PARAMETERS, np.array([t0]))
        assert jet.value[0] == pytest.approx(series(t0), rel=1e-12, abs=1e-12)
        assert jet.rate[0] == pytest.approx(series.deriv()(t0), rel=1e-9, abs=1e-9)
        assert jet.acceleration[0] == pytest.approx(series.deriv(2)(t0), rel=1e-6, abs=1e-6)


def test_powers_of_time_have_their_derivatives_at_zero():
    zero = np.zeros(1)
    expected = {"t ** 0": (1, 0, 0), "t": (0, 1, 0), "t ** 1": (0, 1, 0), "t ** 2": (0, 0, 2), "t ** 3": (0, 0, 0)}
    for text, values in expected.items():
        jet = evaluate_in_time(text, {}, zero)
        assert (jet.value[0], jet.rate[0], jet.acceleration[0]) == values, text


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t ** 1.5", "its second derivative is not a finite number at t = 0 s"),
        ("sqrt(t)", "its rate is not a finite number at t = 0 s"),
        ("1 / (t - 1)", "its value is not a finite number at t = 1 s"),
        ("sqrt(1.5 - t)", "its value is not a finite number at t = 2 s"),
        ("exp(1000 * t)", "its value is not a finite number at t = 1 s"),
        ("t * 9 ** 9 ** 9", "too large a number"),
        ("t + 1 / 0", "a division by zero"),
        ("abs(t)", 'the function "abs" has no derivative everywhere'),
        ("x + t", 'unknown parameter "x"'),
        ("t.real", "only numbers, parameters"),
        ("[t for t in (1, 2)]", "only numbers, parameters"),
        ("t * (-1) ** 0.5", "not a finite number"),
    ],
)
def test_expressions_without_finite_derivatives_are_refused_with_the_time(text, says):
    with pytest.raises(ExpressionError) as caught:
        evaluate_in_time(text, PARAMETERS, np.array([0.0, 1.0, 2.0]))
    assert says in caught.value.problem


# --- Profiles from files ----------------------------------------------------------------------------------------------


def test_a_speed_without_an_assembly_is_refused_by_what_needs_one(tmp_path):
    (tmp_path / "model.toml").write_text(
        'name = "arm"\nground = { O = [0.0, 0.0] }\n[body.arm]\ntype = "rigid"\nmass = 2.0\ninertia = 0.3\n'
        "centre_of_mass = [0.4, 0.0]\npoints = { O = [0.0, 0.0] }\n[joint]\nO = ['ground.O', 'arm.O']\n"
        '[prescribed.drive]\njoint = "O"\nspeed = 1.0\n[study]\nduration = 1.0\n'
    )
    model = load(tmp_path / "model.toml")
    with pytest.raises(InputError, match="the mechanism has none; add an"):
        simulate_motion(model)


def test_constant_speed_as_ever(tmp_path):
    assert profile_of(tmp_path, "angle = 0.5\nspeed = 3.0") == ConstantSpeed(0.5, 3.0)
    assert profile_of(tmp_path, 'angle = "pi / 2"\nspeed = "w / 2"') == ConstantSpeed(np.pi / 2, 2.5)
    assert profile_of(tmp_path, "speed = 3") == ConstantSpeed(0.0, 3.0)
    assert profile_of(tmp_path, "") == ConstantSpeed(0.0, 0.0)


def test_pieces_are_the_spin_up_profile(tmp_path):
    profile = load("spin_up").mechanism.prescribed[0].profile
    t = np.linspace(0.0, 20.0, 801)
    assert profile.knots == (15.0,)
    for found, expected in zip(profile.evaluate(t), (angle, rate, acceleration), strict=True):
        np.testing.assert_allclose(found, expected(t, w_s=6.0), rtol=1e-13, atol=1e-13)


def test_a_run_follows_an_expression_and_pieces_whose_acceleration_jumps(tmp_path):
    pieces = 'pieces = [{ until = 0.2, angle = "10 * t ** 2" }, { angle = "0.4 + 4 * (t - 0.2)" }]'
    for text, expected in (
        ('angle = "a * sin(w * t)"', lambda t: 0.3 * np.sin(5.0 * t)),
        (pieces, lambda t: np.where(t < 0.2, 10.0 * t**2, 0.4 + 4.0 * (t - 0.2))),
    ):
        mechanism = load(write(tmp_path, text)).mechanism
        # The tolerance is a length, root mean square over the mass: of a radian the radius of gyration about O.
        options = IntegrationOptions(method="tr-bdf2", tolerance=1e-7 * GYRATION)
        run = simulate_motion(mechanism, 0.5, samples=51, options=options)
        np.testing.assert_allclose(run.solution.q[:, 2], expected(run.times), rtol=0, atol=1e-7)
        # The torque jumps with the acceleration: its work is right on either side.
        assert run.solution.energy_balance_max < 1e-6


def test_a_table_is_a_spline_with_four_continuous_derivatives_and_signals_are_it():
    t = np.sort(np.concatenate([[0.0, 2.0], np.random.default_rng(1).uniform(0.0, 2.0, 60)]))
    profile = TabulatedProfile(tuple(t), tuple(np.sin(3.0 * t)))
    fine = np.linspace(0.05, 1.95, 1001)
    for found, expected, within in zip(
        profile.evaluate(fine), (np.sin(3 * fine), 3 * np.cos(3 * fine), -9 * np.sin(3 * fine)), (1e-5, 1e-3, 5e-2),
        strict=True,
    ):  # fmt: skip
        np.testing.assert_allclose(found, expected, rtol=0, atol=within)
    pieces = scipy.interpolate.PPoly.from_spline(profile._spline)
    for order in range(5):
        left, right = pieces.derivative(order)(t[3:-3] - 1e-9), pieces.derivative(order)(t[3:-3] + 1e-9)
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-4)


def test_signals_of_a_table_reproduce_it_between_its_rows(tmp_path):
    """Denser rows than a profile is sampled at otherwise, and a run that ends between two of them."""
    t = np.linspace(0.0, 1.0, 5001)
    rows = np.column_stack([t, 0.2 * np.sin(40.0 * t)])
    np.savetxt(tmp_path / "motion.csv", rows, delimiter=",", header="time, angle", comments="")
    mechanism = load(write(tmp_path, 'table = "motion.csv"')).mechanism
    signals, knots = pack_signals(mechanism, constant_signals([], 0.73333), 0.73333)
    assert knots == []
    times = np.random.default_rng(2).uniform(0.0, 0.73333, 200)
    found = np.array([evaluate_signal(signals, 0, time) for time in times])
    for column, expected, within in zip(
        found.T, mechanism.prescribed[0].profile.evaluate(times), (1e-13, 1e-11, 1e-7), strict=True
    ):
        np.testing.assert_allclose(column, expected, rtol=0, atol=within)


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6])
def test_few_rows_are_passed_by_the_polynomial_through_them(count):
    t = np.linspace(0.0, 1.0, count)
    profile = TabulatedProfile(tuple(t), tuple(t ** (count - 1)))
    value, first, second = profile.evaluate(np.array([0.3]))
    n = count - 1
    assert value[0] == pytest.approx(0.3**n)
    assert first[0] == pytest.approx(n * 0.3 ** (n - 1))
    assert second[0] == pytest.approx(n * (n - 1) * 0.3 ** (n - 2) if n > 1 else 0.0, abs=1e-12)


@pytest.mark.parametrize(
    "content",
    [
        "0,0\n1,2\n2,5",
        "t [s];angle\n0;0\n1;2\n2;5\n",
        "\ufefftime\tangle\n\n# measured\n0\t0\n1\t2\n2\t5\n",
        "0 0\n1 2\n2 5",
    ],
)
def test_tables_from_files_of_many_a_form(tmp_path, monkeypatch, content):
    (tmp_path / "far").mkdir()
    (tmp_path / "motion.csv").write_text(content, encoding="utf-8")
    file = write(tmp_path, 'table = "motion.csv"')
    # The name is relative to the model, wherever one works.
    monkeypatch.chdir(tmp_path / "far")
    model = load(file)
    assert model.mechanism.prescribed[0].profile == TabulatedProfile((0.0, 1.0, 2.0), (0.0, 2.0, 5.0))
    # Provenance has the rows and not the name of a file that may change.
    assert model.parameters["prescribed"]["drive"]["table"] == [[0.0, 0.0], [1.0, 2.0], [2.0, 5.0]]


def test_a_run_longer_than_its_table_is_refused_with_both_times(tmp_path):
    mechanism = load(write(tmp_path, "table = [[0.0, 0.0], [0.5, 0.2], [1.0, 1.0]]")).mechanism
    simulate_motion(mechanism, 1.0, samples=3)
    with pytest.raises(InputError) as caught:
        simulate_motion(mechanism, 1.5, samples=3)
    assert str(caught.value) == (
        "prescribed.drive.table: it covers t = 0 to 1 s, the run goes to t = 1.5 s; add rows, or shorten the run"
    )


def test_a_profile_is_asked_only_for_the_times_of_the_run(tmp_path):
    """This one ends at 0.6 s; a start at 0 s must not look beyond."""
    mechanism = load(write(tmp_path, 'angle = "sqrt(0.6 - t)"')).mechanism
    simulate_motion(mechanism, 0.5, samples=3)
    with pytest.raises(InputError, match=r"prescribed\.drive\.angle: its value is not a finite number at t = 0\.6"):
        simulate_motion(mechanism, 0.7, samples=3)


def test_pieces_may_be_nested_and_name_all_knots():
    inner = PiecewiseProfile((ConstantSpeed(0.0, 1.0), ConstantSpeed(0.0, 1.0)), (2.0,))
    assert PiecewiseProfile((inner, ConstantSpeed(0.0, 1.0)), (3.0,)).knots == (2.0, 3.0)
    assert PiecewiseProfile((inner, ConstantSpeed(0.0, 1.0)), (1.0,)).knots == (1.0,)


STUDY = "[study]\nduration = 2.0\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('angle = "a * sin(wt)"', "prescribed.drive.angle: unknown parameter \"wt\" (got 'a * sin(wt)')"),
        ("angle = nan", "prescribed.drive.angle: not a finite number (got nan)"),
        ("angle = [1.0]", "prescribed.drive.angle: neither a number nor an expression (got [1.0])"),
        ("angle = true", "prescribed.drive.angle: neither a number nor an expression (got True)"),
        ('angle = "t"\nspeed = 1.0', "prescribed.drive.speed: a speed can only be added to"),
        ('angle = "t"\ntable = [[0, 0], [1, 1]]', "prescribed.drive.table: a profile is given in two ways"),
        ("displacement = 1.0", "prescribed.drive.displacement: a revolute joint has no displacement (got 'O')"),
        ('angle = "1 / (1 - t)"\n' + STUDY, "prescribed.drive.angle: its value is not a finite number at t = 1 s"),
        ('pieces = []', "prescribed.drive.pieces: list should have at least 1 item"),
        ('pieces = [{ angle = "t" }, { angle = "t" }]', "prescribed.drive.pieces.0.until: every piece but the last"),
        ('pieces = [{ until = 1, angle = "t" }]', "prescribed.drive.pieces.0.until: every piece but the last has an"),
        ("pieces = [{ until = 1 }, { angle = 1 }]", "prescribed.drive.pieces.0: a piece needs one profile"),
        (
            'pieces = [{ until = 1, angle = "t" }, { until = 1, angle = "t" }, { angle = "t" }]',
            "prescribed.drive.pieces: the times of pieces must ascend from 0 (got 1.0)",
        ),
        (
            'pieces = [{ until = 2, angle = "t" }, { angle = "t - 1" }]',
            "prescribed.drive.pieces: the profile jumps by -1 at t = 2 s (got '2 before, 1 after')",
        ),
        (
            'pieces = [{ until = 2, angle = "t ** 2" }, { angle = "4 + 3.5 * (t - 2)" }]',
            "prescribed.drive.pieces: the rate jumps by -0.5 at t = 2 s (got '4 before, 3.5 after')",
        ),
        ("table = [[0.0, 1.0]]", "prescribed.drive.table: a table needs two rows (got 1)"),
        ("table = [[0, 1], [1, 1], [1, 2]]",
         "prescribed.drive.table: its times must ascend, but row 3 does not (got 1.0)"),
        ("table = [[0, 1], [inf, 1]]", "prescribed.drive.table.1.0: should be a finite number (got inf)"),
        ("table = [[0, 1], [1]]", "prescribed.drive.table.1: list should have at least 2 items"),
        ("table = [[0.5, 1], [3, 1]]", "prescribed.drive.table: it covers t = 0.5 to 3 s, the run goes to t = 0 s"),
        ("table = [[0, 1], [1, 1]]\n" + STUDY, "prescribed.drive.table: it covers t = 0 to 1 s, the run goes to t = 2"),
        ('table = "none.csv"', "prescribed.drive.table: cannot be read (no such file or directory) (got 'none.csv')"),
        ('table = "."', "prescribed.drive.table: cannot be read (is a directory) (got '.')"),
        ('table = "odd.csv"', "prescribed.drive.table: line 3 of odd.csv is not two numbers (got '1;2;3')"),
        ('table = "binary.csv"', "prescribed.drive.table: not a text file in UTF-8 (got 'binary.csv')"),
        ('table = "heads.csv"', "prescribed.drive.table: line 2 of heads.csv is not two numbers (got 'in s, in rad')"),
        ('table = "empty.csv"', "prescribed.drive.table: empty.csv has no row of numbers; give a time"),
        ('table = "gap.csv"', "prescribed.drive.table: line 2 of gap.csv has a number that is not finite"),
        ('ramps = "gap.csv"', "prescribed.drive.ramps: line 2 of gap.csv has a number that is not finite"),
        ('table = "comma.csv"', "prescribed.drive.table: line 2 of comma.csv is not two numbers "
         "(got '0,5;1,5'); write decimal points in place of decimal commas"),
        ('table = "wide.csv"', "prescribed.drive.table: line 1 of wide.csv is not two numbers (got '0,1,2')"),
    ],
)  # fmt: skip
def test_profiles_that_make_no_sense_are_refused_by_name(tmp_path, text, says):
    (tmp_path / "odd.csv").write_text("t;angle\n0;1\n1;2;3\n")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    (tmp_path / "heads.csv").write_text("time, angle\nin s, in rad\n0, 1\n")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "gap.csv").write_text("0, 1\n1, nan\n")
    (tmp_path / "comma.csv").write_text("0;1\n0,5;1,5\n")
    (tmp_path / "wide.csv").write_text("0,1,2\n1,2,3\n")
    file = write(tmp_path, text)
    with pytest.raises(InputError) as caught:
        load(file)
    assert f"{file}: {says}" in str(caught.value)
    assert caught.value.remedy


def test_a_parameter_called_t_is_no_time(tmp_path):
    file = tmp_path / "disc.toml"
    file.write_text(DISC.replace("w = 5.0", "t = 5.0") + 'angle = "t"')
    with pytest.raises(InputError, match=r'prescribed\.drive\.angle: "t" is the time in this expression'):
        load(file)


# --- Speeds -------------------------------------------------------------------------------------------------------


def test_a_speed_by_an_expression_is_integrated_to_rounding(tmp_path):
    profile = profile_of(tmp_path, 'angle = 1.0\nspeed = "20 * (1 - exp(-t / 0.01))"')
    t = np.linspace(0.0, 3.0, 301)
    angle, rate, acceleration = profile.evaluate(t)
    assert angle == pytest.approx(1.0 + 20.0 * t - 0.2 * (1.0 - np.exp(-t / 0.01)), abs=1e-12)
    assert rate == pytest.approx(20.0 * (1.0 - np.exp(-t / 0.01)), abs=1e-12)
    assert acceleration == pytest.approx(2000.0 * np.exp(-t / 0.01), abs=1e-9)


def test_ramps_are_parabolas_that_meet_in_value_and_rate(tmp_path):
    profile = profile_of(tmp_path, 'ramps = [[0, 0], ["0.2 s", "60 rpm"], [0.5, "60 rpm"], [1, 0]]')
    speed = 2.0 * np.pi
    t = np.array([0.0, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0])
    angle, rate, _ = profile.evaluate(t)
    falling = speed * ((t - 0.5) - (t - 0.5) ** 2)
    right = np.where(t < 0.2, speed * t**2 / 0.4, np.where(t < 0.5, speed * (t - 0.1), 0.4 * speed + falling))
    assert angle == pytest.approx(right, abs=1e-13)
    assert rate == pytest.approx(np.interp(t, [0.0, 0.2, 0.5, 1.0], [0.0, speed, speed, 0.0]), abs=1e-13)
    assert profile.knots == (0.2, 0.5)


def test_ramps_from_a_file_are_those_of_the_list(tmp_path):
    (tmp_path / "speed.csv").write_text("t [ms],speed [rpm]\n0,0\n200,60\n1000,0\n", encoding="utf-8")
    read = profile_of(tmp_path, 'ramps = "speed.csv"')
    given = profile_of(tmp_path, 'ramps = [[0, 0], ["0.2 s", "60 rpm"], [1, 0]]')
    t = np.linspace(0.0, 1.0, 21)
    assert np.allclose(read.evaluate(t), given.evaluate(t), rtol=1e-12, atol=1e-12)
    (tmp_path / "speed.csv").write_text("t,speed [mm]\n0,0\n1,60\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"prescribed.drive.ramps: column 2 of speed.csv is in m where rad/s"):
        profile_of(tmp_path, 'ramps = "speed.csv"')


def test_a_run_follows_ramps_from_its_assembly_and_files_keep_them(tmp_path):
    model = load(write(tmp_path, "ramps = [[0, 0], [0.5, 4], [1, 4]]"))
    run = simulate_motion(model, 1.0, samples=3, warning=False)
    turned = run.solution.q[:, -1] - run.solution.q[0, -1]
    assert turned == pytest.approx([0.0, 1.0, 3.0], abs=1e-7)
    model.save(tmp_path / "again.toml")
    assert load(tmp_path / "again.toml").mechanism.prescribed == model.mechanism.prescribed
    swept = SpeedProfile(0.5, TabulatedProfile((0.0, 1.0), (0.0, 2.0), Interpolation.LINEAR))
    assert swept.begun(9.0, 0.0) is swept
    assert replace(swept, from_assembly=True).begun(9.0, 1.0).angle == pytest.approx(8.0, abs=1e-14)


def test_pieces_of_speed_are_integrated_from_the_start(tmp_path):
    rising, falling = '"w * sin(5 * pi * t / 2)"', '"w * exp(0.5 - t)"'
    pieces = (
        f'pieces = [{{ until = 0.2, speed = {rising} }}, {{ until = "0.5 s", speed = "w" }}, {{ speed = {falling} }}]'
    )
    profile = profile_of(tmp_path, f"angle = 1.0\n{pieces}")
    t = np.array([0.0, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0])
    rising = 2.0 / (5.0 * np.pi) * (1.0 - np.cos(2.5 * np.pi * np.minimum(t, 0.2)))
    steady, falling = np.clip(t - 0.2, 0.0, 0.3), 1.0 - np.exp(0.5 - np.maximum(t, 0.5))
    angle, rate, acceleration = profile.evaluate(t)
    assert angle == pytest.approx(1.0 + 5.0 * (rising + steady + falling), abs=1e-12)
    assert rate[[1, 3, 6]] == pytest.approx([5.0 * np.sqrt(0.5), 5.0, 5.0 * np.exp(-0.5)], abs=1e-12)
    assert acceleration[[3, 6]] == pytest.approx([0.0, -5.0 * np.exp(-0.5)], abs=1e-12)
    assert profile.knots == (0.2, 0.5)


def test_a_run_follows_pieces_of_speed_and_files_keep_them(tmp_path):
    model = load(write(tmp_path, 'pieces = [{ until = 0.5, speed = "8 * t" }, { speed = 4 }]'))
    run = simulate_motion(model, 1.0, samples=3, warning=False)
    assert run.solution.q[:, -1] - run.solution.q[0, -1] == pytest.approx([0.0, 1.0, 3.0], abs=1e-7)
    model.save(tmp_path / "again.toml")
    assert load(tmp_path / "again.toml").mechanism.prescribed == model.mechanism.prescribed
    assert [finding.code for finding in profiles_cut_short(model.mechanism, 0.4)] == ["law-cut-short"]


def test_a_smooth_table_of_a_speed_is_not_written_as_ramps(tmp_path):
    speed = TabulatedProfile((0.0, 0.5, 1.0), (0.0, 2.0, 1.0))
    model = load(write(tmp_path, "speed = 3"))
    [drive] = model.mechanism.prescribed
    other = replace(model.mechanism, prescribed=(replace(drive, profile=SpeedProfile(0.0, speed)),))
    with pytest.raises(InputError, match="cannot express this profile"):
        other.save(tmp_path / "again.toml")


def test_a_speed_of_a_motion_may_not_jump():
    jumping = PiecewiseProfile((ConstantSpeed(1.0, 0.0), ConstantSpeed(2.0, 0.0)), (0.5,))
    with pytest.raises(InputError, match=r"pieces: the speed jumps by 1 at t = 0.5 s .*; make the speed of the pieces"):
        PrescribedAngle("drive", "O", SpeedProfile(0.0, jumping))
    # The angle of successive pieces meets in value and rate, a speed in its value alone.
    PrescribedAngle(
        "drive", "O", SpeedProfile(0.0, PiecewiseProfile((ConstantSpeed(0.0, 2.0), ConstantSpeed(1.0, 0.0)), (0.5,)))
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("pieces = [{ until = 1, speed = 1 }, { speed = 2 }]", "pieces: the speed jumps by 1 at t = 1 s"),
        ("pieces = [{ until = 1, speed = 1 }, { angle = 2 }]", "pieces.1: speeds and values are given"),
        ("pieces = [{ until = 1, angle = 1 }, { speed = 2 }]", "pieces.0: speeds and values are given"),
        ("pieces = [{ angle = 1, speed = 2 }]", "pieces.0: a piece needs one profile, an angle, a displacement or"),
        ("speed = 3\npieces = [{ speed = 3 }]", "pieces: a speed is given in two ways"),
        ('angle = "t"\npieces = [{ speed = 3 }]', "pieces: a speed can only be added to an angle"),
        ("pieces = [{ speed = 3 }]\ntable = [[0, 1], [1, 2]]", "table: speeds and values are given"),
        ('pieces = [{ speed = "10 mm/s" }]', "pieces.0.speed: a quantity in m/s where one in rad/s is asked for"),
        ("pieces = [{ speed = nan }]", "pieces.0.speed: not a finite number"),
        ("pieces = [{ until = 1, speed = true }, { speed = 1 }]", "pieces.0.speed: neither a number nor an expression"),
        ("pieces = [{ until = -1, speed = 1 }, { speed = 1 }]", "pieces: the times of pieces must ascend from 0"),
        ("pieces = [{ until = 1, speed = 1 }]", "pieces.0.until: every piece but the last has an end"),
        ('pieces = [{ speed = "1 / t" }]', "pieces.0.speed: its value is not a finite number at t = 0 s"),
        ('speed = "20"\nramps = [[0, 0], [1, 1]]', "ramps: a speed is given in two ways"),
        ('angle = "t"\nspeed = "t"', "speed: a speed can only be added to an angle or displacement that is a number"),
        ('speed = "t"\npieces = [{ angle = 1 }]', "pieces: speeds and values are given"),
        ("ramps = [[0, 0]]", "ramps: a table needs two rows"),
        ("ramps = [[0, 0], [0, 1]]", "ramps: its times must ascend"),
        ('ramps = [[0, 0], [1, "60 mm"]]', "ramps.1.1: a quantity in m where one in rad/s is asked for"),
        ('speed = "10 mm/s"', "speed: a quantity in m/s where one in rad/s is asked for"),
        ('speed = "1 / t"', "speed: its value is not a finite number at t = 0 s"),
        ("speed = true", "speed: neither a number nor an expression"),
        ("speed = nan", "speed: not a finite number"),
    ],
)
def test_speeds_that_make_no_sense_are_refused_by_name(tmp_path, text, says):
    with pytest.raises(InputError) as caught:
        load(write(tmp_path, text))
    assert f"prescribed.drive.{says}" in str(caught.value)
