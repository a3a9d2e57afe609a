"""Output units: numbers are shown in the units that --units or [units] of a file chooses, and data stay in SI units."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import paraflex as pf
from paraflex import plots
from paraflex.cli.tables import in_own_units
from paraflex.designs.units import unit_of
from paraflex.errors import InputError
from paraflex.figures.charts import Axis, Chart, Curve
from paraflex.figures.kinematics import kinematics_tables
from paraflex.figures.loads import joint_tables
from paraflex.figures.tables import Column
from paraflex.files import load_data
from paraflex.formatting import axis_unit, common_unit, display_unit, output_unit, output_units, prefer_units, quantity
from paraflex.reports import motion_page
from paraflex.reports.page import render
from paraflex.results import motion_dataset, save_results
from paraflex.results.export import export
from paraflex.results.loads import load_figures
from paraflex.units import QUANTITIES, unit_named
from shell import paraflex

UNITS = '[units]\nlength = "cm"\nangle = "deg"\nforce = "kN"\nangular_velocity = "rpm"\n'


@cache
def four_bar() -> xr.Dataset:
    return motion_dataset(pf.simulate_motion(pf.load("four_bar").mechanism.rigid(), 0.1, samples=21))


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A four-bar's file with a table of units."""
    file = tmp_path / "mine.toml"
    file.write_text(pf.library.text("four_bar") + "\n" + UNITS, encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("chosen", "unit", "factor"),
    [
        ("deg", "rad", 180.0 / np.pi), ("mm", "m", 1e3), ("kN", "N", 1e-3), ("rpm", "rad/s", 30.0 / np.pi),
        ("N mm", "N m", 1e3), ("MPa", "Pa", 1e-6), ("in", "m", 1.0 / 0.0254), ("mm/s^2", "m/s²", 1e3),
        ("kHz", "Hz", 1e-3), ("N/mm", "N/m", 1e-3), ("ms", "s", 1e3),
    ],
)  # fmt: skip
def test_every_rule_for_display_follows_the_choice(chosen, unit, factor):
    before = display_unit(unit, 3e7)
    with output_units([chosen]):
        for values in (0.0, 1e-9, 3e7):
            for rule in (display_unit, axis_unit):
                assert rule(unit, values).name == chosen
                assert rule(unit, values).factor == pytest.approx(factor, rel=1e-15)
        assert common_unit(unit, [1e-9, None, 3e7]).name == output_unit(unit).name == chosen
        assert Column("a", [1e-9, 3e7], unit).head == ("a", f"[{chosen}]")
        assert display_unit("J", 1e-3).name == "J"
    assert display_unit(unit, 3e7) == before
    assert output_unit(unit) == (unit, 1.0)


def test_a_choice_ends_with_its_context_even_if_that_fails():
    with output_units(["deg", "mm"]):
        assert quantity(0.001, "m") == "1.00 mm"
        with output_units(["kN"]):
            prefer_units({"length": "cm", "time": "ms"})
            assert [output_unit(unit).name for unit in ("N", "m", "s", "rad")] == ["kN", "mm", "ms", "deg"]
        assert [output_unit(unit).name for unit in ("N", "s")] == ["N", "s"]
    with pytest.raises(ZeroDivisionError), output_units(["deg"]):
        raise ZeroDivisionError
    assert output_unit("rad").name == "rad"


def test_every_quantity_has_a_unit_of_its_own():
    assert len({unit_named(unit).dimension for unit in QUANTITIES.values()}) == len(QUANTITIES)
    for name, unit in QUANTITIES.items():
        with output_units([unit]):
            prefer_units({name: unit})
            assert output_unit(unit) == (unit, 1.0)
    # A rate of decay is no frequency.
    with output_units(["kHz"]):
        assert display_unit("1/s", 5.0).name == "1/s"


def test_axes_of_figures_and_pages_have_the_units():
    data = four_bar()
    with output_units(["deg", "m", "kN"]):
        figure = plots.joint_forces(data, over="O")
        html = render(motion_page(data))
    (panel,) = figure.axes
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("angle of $O$ [deg]", "force [kN]")
    turned = np.asarray(panel.lines[0].get_xdata())
    np.testing.assert_allclose(turned, np.rad2deg(data["joint_coordinate"].sel(joint="O").values), rtol=1e-12)
    assert re.search(r'"x of \w+\.A \[m\]"', html)
    for label in ("angle of O [deg]", "force [kN]", "x [m]", "velocity v [m/s]"):
        assert f'"{label}"' in html
    assert "[rad]" not in html


def test_a_plane_has_one_unit():
    chart = Chart("a", "A", Axis("", "m", "y"), [Curve("", [3e-6], [5.0])], Axis("", "m", "x"), equal=True)
    with output_units(["cm"]):
        assert {chart.shown_units().x.name, chart.shown_units().of(None).name} == {"cm"}


def test_tables_for_spreadsheets_have_the_units_and_data_stay_in_si(tmp_path):
    data = four_bar()
    with output_units(["mm", "deg", "ms"]):
        export(data, tmp_path, "csv")
        export(data, tmp_path, "parquet")
        save_results(data, tmp_path / "results.nc")
    table, plain = pd.read_csv(tmp_path / "time_series.csv"), pd.read_parquet(tmp_path / "time_series.parquet")
    np.testing.assert_allclose(table["time [ms]"].to_numpy(), 1e3 * data["time"].values, rtol=1e-12)
    place = data["point_position"].sel(point="crank.A", axis="x").values
    np.testing.assert_allclose(table["point_position_crank.A_x [mm]"].to_numpy(), 1e3 * place, rtol=1e-12)
    turned = np.rad2deg(data["angle"].sel(body="crank").values)
    np.testing.assert_allclose(table["angle_crank [deg]"].to_numpy(), turned, rtol=1e-12)
    np.testing.assert_array_equal(plain["point_position_crank.A_x"].to_numpy(), place)
    xr.testing.assert_identical(pf.load_results(tmp_path / "results.nc")["angle"], data["angle"])


def test_units_of_a_file_are_those_of_its_run_and_of_what_is_made_of_its_results(model, tmp_path):
    out, other = tmp_path / "out", tmp_path / "other"
    run = paraflex("run", str(model), "--out", str(out), "--duration", "0.05", "--no-figures")
    assert "crank.A: (" in run.stdout
    assert ") cm\n" in run.stdout
    assert " kN in " in run.stdout
    assert "[deg]" in (out / "report.html").read_text(encoding="utf-8")
    assert paraflex("export", str(out), "--to", "csv", "--units", "kN").returncode == 0
    heads = pd.read_csv(out / "export" / "time_series.csv").columns
    assert {"point_position_crank.A_x [cm]", "joint_force_O_x [kN]", "angle_crank [deg]"} <= set(heads)
    paraflex("report", str(out), "--units", "mm, rad", "--force")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "[cm]" not in page
    assert "[deg]" not in page
    assert "[kN]" in page
    plain = tmp_path / "plain.toml"
    plain.write_text(model.read_text(encoding="utf-8").replace(UNITS, ""), encoding="utf-8")
    paraflex("run", str(plain), "--out", str(other), "--duration", "0.05", "--no-figures", "--units", "deg,cm")
    one, two = (pf.load_results(folder / "results.nc") for folder in (out, other))
    for name in ("point_position", "joint_force", "angle"):
        xr.testing.assert_identical(one[name], two[name])
    loads = [json.loads((folder / "summary.json").read_text(encoding="utf-8"))["loads"] for folder in (out, other)]
    assert loads[0] == loads[1]
    # The choice of a command is not that of the next one in the same process.
    assert display_unit("m", 1.0).name == "mm"


def test_comparisons_have_the_units_of_the_first_file_or_of_the_command(model, tmp_path):
    out = [tmp_path / "a", tmp_path / "b"]
    for folder, thick in zip(out, ("6 mm", "7 mm"), strict=True):
        given = ("--set", f"section.strip.thickness={thick}", "--duration", "0.05", "--no-figures", "--no-report")
        done = paraflex("run", model, *given, "--out", folder)
        assert done.returncode == 0, done.stderr
    own, chosen = (paraflex("compare", *out, *given).stdout for given in ((), ("--units", "N")))
    assert "kN" in own
    assert "kN" not in chosen


def test_sweeps_have_the_units_of_the_file_of_their_mechanism(model, tmp_path):
    study = tmp_path / "study.toml"
    study.write_text(f'''name = "s"
mechanism = "{model.name}"
duration = 0.05
samples = 11
metrics = ["joint_force_max"]
[vary.thickness]
fields = ["section.strip.thickness"]
values = ["6 mm", "7 mm"]
''')
    done = paraflex("sweep", study, "--output", tmp_path / "s", "--workers", "1")
    assert done.returncode == 0, done.stderr
    page = tmp_path / "s" / "report.html"
    assert "[kN]" in page.read_text(encoding="utf-8")
    # So has what is made of the folder later.
    for given, wanted in (((), "kN"), (("--units", "N"), "N")):
        drawn = ("plot", tmp_path / "s", "all", "--format", "svg", "--svg-text")
        for command in (("report", tmp_path / "s"), drawn, ("export", tmp_path / "s", "--to", "csv")):
            made = paraflex(*command, *given, "--force")
            assert made.returncode == 0, made.stderr
        figures = "".join(file.read_text(encoding="utf-8") for file in (tmp_path / "s" / "figures").glob("*.svg"))
        heads = pd.read_csv(tmp_path / "s" / "export" / "results.csv").columns
        for text in (page.read_text(encoding="utf-8"), figures, " ".join(heads)):
            assert f"[{wanted}]" in text
            assert f"[{'kN' if wanted == 'N' else 'N'}]" not in text


def test_plain_numbers_have_the_units_of_the_model_in_their_parameters():
    with output_units([]):
        in_own_units({"parameters": {"model": {"units": {"length": "cm"}}}})
        assert display_unit("m", 1.0).name == "cm"


def test_a_model_keeps_its_units_when_it_is_saved(model, tmp_path):
    pf.load(model).save(tmp_path / "copy.toml")
    assert load_data(tmp_path / "copy.toml")[0]["units"] == load_data(model)[0]["units"]


def test_info_has_lengths_and_masses_in_the_units():
    found = paraflex("info", "four_bar", "--units", "cm,g").stdout
    for text in ("length", "[cm]", "total mass [g]", "682.6", "264.8"):
        assert text in found


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("mmm", "--units: no such unit (got 'mmm'); did you mean \"mm\"?"),
        ("", "--units: no such unit (got ''); write a unit such as"),
        ("deg,,mm", "--units: no such unit (got '')"),
        ("mm, m", "--units: a second unit of length beside mm (got 'm'); leave one of them out"),
        ("deg/s,rpm", "a second unit of angular_velocity beside deg/s (got 'rpm')"),
        ("s^3", "--units: not a unit of a quantity that is shown (got 's^3'); choose from units of length, angle"),
        ("ψ", "--units: no such unit (got 'ψ')"),
        ("3 mm", "--units: no such unit (got '3 mm')"),
    ],
)
@pytest.mark.parametrize("command", [("info", "four_bar"), ("plot", "nowhere")])
def test_units_that_are_none_are_named_before_anything_is_read(command, text, words):
    refused = paraflex(*command, "--units", text)
    assert refused.returncode == 2
    assert words in refused.stderr
    assert refused.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ('length = "kg"', "units.length: not a unit of length (got 'kg'); write \"m\""),
        ('length = "mmm"', "units.length: no such unit (got 'mmm'); did you mean \"mm\"?"),
        ('lenght = "mm"', 'did you mean "length"?'),
        ("length = 3", "units.length"),
        ('angular_velocity = "deg"', "units.angular_velocity: not a unit of angular_velocity (got 'deg')"),
    ],
)
def test_a_file_with_a_wrong_unit_is_named(tmp_path, entry, words):
    file = tmp_path / "wrong.toml"
    file.write_text(f"{pf.library.text('pendulum')}\n[units]\n{entry}\n", encoding="utf-8")
    with pytest.raises(InputError) as error:
        pf.load(file)
    assert str(error.value).startswith(str(file))
    assert words in str(error.value)


def test_a_parameter_has_the_unit_of_the_fields_that_are_it():
    data = load_data("slider_crank")[0]
    assert unit_of(data, ("parameters", "rod")) == "m"
    assert unit_of(load_data("slider_crank_flexible")[0], ("parameters", "speed")) == "rad/s"
    # The name of a section or a point is no number, and fields of several units have none in common.
    body = {"type": "rigid", "section": "rod", "inertia": "l", "mass": "l"}
    data = {
        "name": "rod",
        "parameters": {"rod": 0.3, "l": 1.0},
        "body": {"a": body},
        "joint": {"rod": ["a.rod", "rod"]},
    }
    assert unit_of(data, ("parameters", "rod")) == unit_of(data, ("parameters", "l")) == ""


def test_ranges_have_the_unit_of_the_largest_end_however_near_zero_the_smallest_is():
    """A sample that comes close to zero, by rounding or by chance, does not change the unit of a column."""
    data = motion_dataset(pf.kinematics(pf.load("raparm_i"), samples=3))
    first = data["point_position"].transpose("point", "axis", "time")[0, 0]
    data["point_position"] = data["point_position"].where(
        (data["point"] != first["point"]) | (data["axis"] != "x") | (data["time"] > 0.0), 3e-8
    )
    (points,) = (table for table in kinematics_tables(data) if table.title == "Points")
    assert {unit for _, unit in points.heads()[1:5]} == {"mm"}
    loads = load_figures(data)
    for one in loads["joints"].values():
        one.update(least=3e-8, most=0.3)
    turning = next(joint_tables(loads))
    assert turning.heads()[1:3] == [("from", "rad"), ("to", "rad")]
    assert turning.texts()[0][1:3] == ["3e-08", "0.3"]
