"""Bounded sizes, bounded reading, text that does nothing where it is shown: what is too large is one line at once."""

import os
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import paraflex as pf
from paraflex import limits
from paraflex.checks import check
from paraflex.dynamics import build_system
from paraflex.errors import InputError, NumericalError, ProportionError, printable
from paraflex.files import library_text
from paraflex.limits import solvable
from paraflex.mechanism import PointRef, RevoluteJoint, RigidBody
from paraflex.results.tables import spreadsheet_table, spreadsheet_text
from shell import paraflex

ROD = """
name = "rod"
[ground]
O = [0.0, 0.0]
[body.rod]
type = "rigid"
mass = 1.0
inertia = 0.1
points = { O = [0.0, 0.0], P = [0.5, 0.0] }
[joint]
O = ["ground.O", "rod.O"]
[assembly.home]
rod = 0.0
[study]
duration = 0.1
samples = 11
"""


def loaded_quietly(function, file):
    """What a function makes of a file, whatever doubts `load` warns of."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pf.ModelWarning)
        return function(file)


def model_with(tmp_path, old, new, text=ROD):
    assert old in text
    file = tmp_path / "odd.toml"
    file.write_text(text.replace(old, new), encoding="utf-8")
    return file


# --- Reading ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/urandom"])
def test_devices_are_no_model_files(device):
    with pytest.raises(InputError, match=r"file: cannot be read \(not a regular file\); check its name"):
        pf.load(device)


def test_a_pipe_is_not_waited_for(tmp_path):
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="not a regular file"):
        pf.load(pipe)
    driven = model_with(
        tmp_path, "[study]", '[prescribed.drive]\njoint = "O"\ntable = "pipe.toml"\n[study]'
    )  # fmt: skip
    with pytest.raises(InputError, match=r"prescribed.drive.table: cannot be read \(not a regular file\)"):
        pf.load(driven)


def test_a_mark_at_the_start_of_a_file_is_no_part_of_it(tmp_path):
    file = tmp_path / "marked.toml"
    file.write_bytes(b"\xef\xbb\xbf" + ROD.encode())
    assert pf.load(file).mechanism == pf.load(model_with(tmp_path, "rod", "rod")).mechanism


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('name = "rod"', "a" + ".a" * 200_000 + " = 1", "file: not valid TOML: a name of too many parts; at most 32"),
        ('name = "rod"', "a" + ' . "a"' * 4000 + " = 1", "file: not valid TOML: a name of too many parts"),
        ("[body.rod]", f"[body.{'x' * 5000}]", "body: a name of 5000 letters (got 'xxxxx"),
        ('name = "rod"', f'name = "{"x" * 5000}"', "name: string should have at most 2000 characters"),
        ("samples = 11", "samples = 2_000_000_000", "study.samples: too many samples (got 2000000000); at most 1 0"),
        ("samples = 11", f"samples = {'9' * 190}", "study.samples: should be less than or equal to 9007199254740992"),
        ("mass = 1.0", f"mass = {'9' * 190}", "body.rod.mass: should be less than or equal to 1"),
        ("duration = 0.1", "duration = 1e-160", "study.duration: too short for a run (got 1e-160); give it in seconds"),
        ("mass = 1.0", "mass = 1e-300", "body.rod.mass: far out of range (got 1e-300); give it in kg "),
        ("mass = 1.0", 'mass = "1e200"', "body.rod.mass: should be less than or equal to 1"),
        (
            "[ground]", "[parameters]\n" + "".join(f'p{k} = "p{k + 1}"\n' for k in range(3000)) + "p3000 = 1\n[ground]",
            "parameters.p0: a chain of too many parameters (got 'p1'); at most 100; give one of them a number",
        ),
    ],
)  # fmt: skip
def test_what_is_too_large_is_refused_at_once(tmp_path, old, new, says):
    with pytest.raises(InputError) as caught:
        pf.load(model_with(tmp_path, old, new))
    assert str(caught.value).partition(".toml: ")[2].startswith(says)
    assert len(str(caught.value)) < 500


def test_long_chains_that_may_be_and_keys_of_numbers(tmp_path):
    """A table of numbers in one line is no key, and a hundred parameters may follow from one another."""
    rows = "[" + ", ".join(f"[{k}.0, 0.5]" for k in range(200)) + "]"
    chain = "".join(f'p{k} = "p{k + 1}"\n' for k in range(99)) + "p99 = 2.0\n"
    text = ROD.replace("mass = 1.0", 'mass = "p0"').replace("[ground]", f"[parameters]\n{chain}[ground]")
    driven = f'[prescribed.drive]\njoint = "O"\ntable = {rows}\n[study]'
    model = pf.load(model_with(tmp_path, "[study]", driven, text))
    assert model.mechanism.bodies[0].mass == 2.0
    assert len(model.mechanism.prescribed[0].profile.times) == 200


def test_elements_and_shape_functions_are_bounded():
    five_bar = pf.load("five_bar").mechanism
    with pytest.raises(InputError, match=r"elements: too many elements of a beam \(got 1000000000000\); at most 64"):
        five_bar.with_beams(elements=10**12)
    assert build_system(five_bar.with_beams(elements=limits.ELEMENTS // 10)).n > 0


@pytest.mark.parametrize(
    "command",
    [
        ["run", "-m", "pendulum", "--out"],
        ["sweep", str(Path(__file__).parents[1] / "examples" / "thickness_study.toml"), "--output"],
        ["export", "there", "--to", "csv", "--out"],
        ["report"],
    ],
)
def test_a_folder_that_no_file_system_can_have(command):
    run = paraflex(*command, "o" * 300)
    assert run.returncode == 2
    assert "\n" not in run.stderr.strip()
    assert re.match(r"\s*error: .*file name too long|error: file: the name is too long|error: there: ", run.stderr)


def test_a_model_whose_name_no_file_can_have():
    run = paraflex("info", "m" * 300)
    assert run.returncode == 2
    assert run.stderr.startswith("error: mechanism: neither a library mechanism nor a file")


# --- Numbers that cannot be computed with ----------------------------------------------------------------------------


def pendulum(**about):
    rod = RigidBody("rod", **{"mass": 1.0, "inertia": 0.1, "centre_of_mass": (0.25, 0.0)} | about)
    return pf.Mechanism(
        "rod", {"O": (0.0, 0.0)}, (replace(rod, points={"O": (0.0, 0.0), "P": (0.5, 0.0)}),),
        (RevoluteJoint("O", PointRef("ground", "O"), PointRef("rod", "O")),),
    )  # fmt: skip


def test_an_inertia_that_is_rounding_beside_the_offset_of_the_mass():
    """M = [m, m c; m c, J + m c^2] is singular where J is rounding of m c^2; its exact determinant is m J."""
    assert build_system(pendulum(inertia=1e-12)).n == 3
    with pytest.raises(InputError, match=r"body.rod: its mass matrix is not positive definite, or only by rounding"):
        build_system(pendulum(inertia=1e-17))


@pytest.mark.parametrize(
    "compute",
    [
        lambda: np.linalg.inv(np.zeros((2, 2))),
        lambda: np.sqrt(np.array([-1.0])),
        lambda: np.linalg.svd(np.full((2, 2), np.nan)),
        lambda: np.array([1e200]) * 1e200,
        lambda: np.array([1.0]) / 0.0,
        lambda: 1e200**2,
        lambda: 1.0 / 0.0,
    ],
)
def test_what_cannot_be_solved_is_named(compute):
    with (
        pytest.raises(ProportionError, match="the pose cannot be computed: some numbers") as caught,
        solvable("the pose"),
    ):
        compute()
    assert "SI units" in caught.value.remedy
    assert isinstance(caught.value, NumericalError)


def test_a_slip_in_the_computation_is_not_taken_for_numbers_out_of_proportion():
    with pytest.raises(KeyError), solvable("the pose"):
        {}["x"]


def test_a_model_out_of_proportion_is_judged_and_not_raised_about(tmp_path):
    """A beam of 6e19 m and a bob of 0.2 kg: what vibrates has squares of frequencies that rounding decides."""
    file = model_with(tmp_path, "length = 0.600", "length = 6e19", library_text("pendulum"))
    found = [one for one in loaded_quietly(check, file) if one.code == "out-of-proportion"]
    assert [one.text.partition(":")[0] for one in found] == ["natural frequencies cannot be computed"]
    run = paraflex("info", str(file))
    assert run.returncode == 1
    assert "wrong: assembly: natural frequencies cannot be computed" in run.stdout
    assert "out-of-proportion" not in check("pendulum").codes


def test_damping_of_a_beam_whose_spans_are_too_far_apart_names_the_beam():
    """Second moments of area of 1e-9 and 1e11 m^4 side by side: frequencies of the held beam are rounding."""
    model = Path(__file__).parents[1] / "benchmarks" / "fuzzed" / "everything.toml"
    mechanism = loaded_quietly(pf.load, model).mechanism
    beam = mechanism.body("beam")
    assert build_system(mechanism).body("beam").damping.any()
    stiff = replace(beam, section=(beam.section[0], pf.Section(1e-4, 1e11)))
    with pytest.raises(ProportionError, match="the damping of beam cannot be computed"):
        build_system(mechanism.with_bodies([stiff]))


# --- Tolerance -------------------------------------------------------------------------------------------------------


def test_a_tolerance_is_held_against_the_size_of_the_mechanism():
    model = pf.load("pendulum")
    size = build_system(model.mechanism).size

    def run(tolerance):
        return pf.simulate_motion(model.mechanism, 0.02, samples=3, options=pf.IntegrationOptions(tolerance=tolerance))

    assert not [one for one in run(0.04 * size).findings if one.code == "tolerance-loose"]
    with pytest.warns(pf.ResultWarning, match=r"tolerance: .* m, in a mechanism of about 0.5 m: .*\[tolerance-loose\]"):
        run(0.06 * size)
    with pytest.raises(InputError, match=r"tolerance: larger than the mechanism, about 0.5 m \(got 2.0\)"):
        run(2.0)


def test_info_and_run_say_so_of_a_study(tmp_path):
    file = model_with(tmp_path, "duration = 2.0", "tolerance = 0.2\nduration = 2.0", library_text("pendulum"))
    assert "tolerance-loose" in check(file).codes
    assert "tolerance-loose" not in check("pendulum").codes
    run = paraflex("run", "-m", "pendulum", "--tol", "3", "--out", str(tmp_path / "out"))
    assert run.returncode == 2
    assert run.stderr.startswith("error: --tol: larger than the mechanism, about 0.5 m (got 3.0); it is in m:")


# --- Text that is shown ----------------------------------------------------------------------------------------------

HOSTILE = "{x} \x1b[31m\u202e[red]\x07"


def test_names_do_nothing_to_a_terminal(tmp_path):
    toml = HOSTILE.replace("\x1b", r"\u001b").replace("\u202e", r"\u202e").replace("\x07", r"\u0007")
    file = model_with(tmp_path, 'name = "rod"', f'name = "{toml}"')
    shown = r"{x} \x1b[31m\u202e[red]\x07"
    for command in (["info", str(file)], ["run", "-m", str(file), "--no-report", "--out", str(tmp_path / "out")]):
        run = paraflex(*command)
        assert run.returncode == 0
        assert printable(run.stdout) == run.stdout
        assert printable(run.stderr) == run.stderr
        assert "{x} \\x1b[31m\\u202e[red]" in run.stdout, shown


def test_errors_are_one_line_whatever_names_say(tmp_path):
    file = model_with(tmp_path, "[ground]", '"line\\nbreak\\u001b" = 1\n[ground]')
    with pytest.raises(InputError) as caught:
        pf.load(file)
    assert r"odd.toml: line\nbreak\x1b: unknown field (got 1)" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("=cmd|'/C calc'!A0", "'=cmd|'/C calc'!A0"),
        ("@sum(1)", "'@sum(1)"),
        ("-1+cmd", "'-1+cmd"),
        ("+tau1", "'+tau1"),
        ("\tx", r"'\tx"),
        ("a\x1b[2J\u202e", r"a\x1b[2J\u202e"),
        # Names of actuation modes, and plain ones.
        ("+-+-", "+-+-"),
        ("++++", "++++"),
        ("-", "-"),
        ("link1", "link1"),
        ("1-2", "1-2"),
        ("", ""),
    ],
)
def test_text_in_cells_is_no_formula(text, cell):
    assert spreadsheet_text(text) == cell


def test_tables_for_spreadsheets_change_texts_and_headings_alone():
    import pyarrow as pa

    table = pa.table({"=a": ["=1", "b", None], "x": [1.0, 2.0, 3.0]})
    assert spreadsheet_table(table).to_pydict() == {"'=a": ["'=1", "b", None], "x": [1.0, 2.0, 3.0]}
    plain = pa.table({"mode": ["+-+-", "++"], "x": [1.0, 2.0]})
    assert spreadsheet_table(plain) == plain
