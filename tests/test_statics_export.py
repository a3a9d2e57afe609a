"""Equilibria and reduced models as tables and structs for other programs."""

from __future__ import annotations

import pandas as pd
import pytest
import scipy.io

import paraflex as pf
from paraflex.results import save_results
from paraflex.results.export import export, result_tables
from shell import paraflex


@pytest.fixture(scope="module")
def pushed():
    directions = ["stage.T.x", "stage.T.angle"]
    return pf.statics_dataset(pf.statics(pf.load("leaf_spring_guide"), steps=4, stiffness=directions))


def test_equilibria_are_a_row_a_step_with_the_unit_of_each_coordinate(pushed, tmp_path):
    files = export(pushed, tmp_path, "csv")
    assert [file.name for file in files] == ["steps.csv", "figures.csv"]
    table = pd.read_csv(files[0])
    assert len(table) == 5
    assert table["travel_stage.T.x [m]"].to_numpy() == pytest.approx(pushed["travel"].sel(named="stage.T.x").values)
    stiffness = table["stiffness_stage.T.angle [N m/rad]"].to_numpy()
    assert stiffness == pytest.approx(pushed["stiffness"].sel(named="stage.T.angle").values)
    assert "joint_force_L_x [N]" in table
    assert "strength_left [Pa]" in pd.read_csv(files[1]) or "stress_max_left [Pa]" in pd.read_csv(files[1])


def test_of_coordinates_of_one_kind_there_is_one_unit():
    data = pf.statics_dataset(pf.statics(pf.load("leaf_spring_guide"), steps=1))
    assert data["travel"].attrs["units"] == "m"
    assert data["stiffness"].attrs["units"] == "N/m"
    assert result_tables(data)["steps"].attrs["units"]["effort_stage.T.x"] == "N"


def test_steps_are_the_first_dimension_for_matlab(pushed, tmp_path):
    (file,) = export(pushed, tmp_path / "guide.mat", "mat")
    found = scipy.io.loadmat(file, squeeze_me=True, struct_as_record=False)["results"]
    assert found.joint_force.shape[0] == 5


def test_shapes_have_a_row_a_step_and_point(pushed):
    shapes = result_tables(pushed, shapes=True)["shapes"]
    assert len(shapes) == pushed.sizes["step"] * pushed.sizes["station"]


def test_reduced_models_are_a_row_a_mode_and_frequency(tmp_path):
    data = pf.reduction_dataset([pf.linearise(pf.load("five_bar"), mode="++")], 8)
    save_results(data, tmp_path / "reduced.nc")
    done = paraflex("export", "reduced.nc", "--to", "csv", "--output", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"frequencies.csv", "figures.csv"}
    table = pd.read_csv(tmp_path / "out" / "frequencies.csv")
    assert len(table) == data.sizes["frequency"]
    full = data["gain"].sel(mode="++", variant="full", output="x").values
    column = next(name for name in table if name.startswith("gain_full_x"))
    assert table[column].to_numpy() == pytest.approx(full)
