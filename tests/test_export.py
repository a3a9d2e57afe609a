"""Results for other programs: values, units and names in CSV, Parquet, MATLAB files and netCDF; what is refused."""

import csv
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xarray as xr
from scipy.io import loadmat
from typer.testing import CliRunner

import paraflex as pf
from paraflex.cli.app import app, main
from paraflex.errors import InputError, OutputError
from paraflex.integrators import IntegrationOptions
from paraflex.motion import simulate_motion
from paraflex.results import motion_dataset
from paraflex.results.export import export, matlab_name, matlab_struct, result_tables
from paraflex.results.storage import SCHEMA

OLD = Path(__file__).parent / "data" / "schema1.nc"


@pytest.fixture(scope="module")
def data(raparm, square):
    """Two modes of RAParM-I; the second stops early, so it has samples that are missing."""
    task = pf.plan(raparm, square, duration=0.1, samples=21)
    whole = task.simulate("++++", options=IntegrationOptions(tolerance=1e-4))
    with pytest.raises(pf.NumericalError) as caught:
        task.simulate("+--+", options=IntegrationOptions(tolerance=1e-4, max_steps=40))
    return pf.tracking_dataset([whole, caught.value.partial])


@pytest.fixture(scope="module")
def folder(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    pf.save_results(data, folder / "results.nc")
    return folder


def read_csv(file):
    """Columns of a CSV file by name, as text."""
    with file.open(newline="", encoding="utf-8") as stream:
        head, *rows = csv.reader(stream)
    return dict(zip(head, zip(*rows, strict=True), strict=True))


def test_tables_are_tidy(data):
    tables = result_tables(data, shapes=True)
    assert list(tables) == ["time_series", "figures", "shapes", "sections"]
    series = tables["time_series"]
    assert len(series) == 2 * 21
    assert list(series.columns[:2]) == ["mode", "time"]
    second = series["mode"].values == "+--+"
    np.testing.assert_array_equal(series["time"].values[second], data["time"])
    expected = data["joint_force"].sel(mode="+--+", joint="B1", axis="y")
    np.testing.assert_array_equal(series["joint_force_B1_y"].values[second], expected)
    np.testing.assert_array_equal(tables["figures"]["peak_torque_tau1"].values, data["peak_torque"].sel(motor="tau1"))
    shapes = tables["shapes"]
    assert shapes["shape_x"].values.size == 2 * 21 * data.sizes["station"]
    row = np.flatnonzero((shapes["station"].values == 40) & (shapes["mode"].values == "++++"))[7]
    assert shapes["station_body"].values[row] == data["station_body"].values[40]
    assert shapes["shape_y"].values[row] == data["shape"].values[0, 7, 40, 1]
    assert "shape_x" not in series


def test_csv_has_units_in_its_head_and_gaps_where_nothing_was_reached(data, tmp_path):
    files = export(data, tmp_path / "out", "csv")
    assert [file.name for file in files] == ["time_series.csv", "figures.csv"]
    columns = read_csv(files[0])
    torque = np.array([float(value) for value in columns["torque_tau1 [N m]"]]).reshape(2, 21)
    np.testing.assert_array_equal(torque, data["torque"].sel(motor="tau1"))
    assert columns["mode"][0] == "++++"
    place = columns["end_effector_x [m]"]
    assert place[-1] == ""
    assert float(place[0]) == float(data["end_effector"][0, 0, 0])
    figures = read_csv(files[1])
    assert list(figures["status"]) == ["complete", "failed"]
    assert figures["tracking_rms [m]"][1] == ""


def test_parquet_has_units_in_its_metadata(data, tmp_path):
    (file,) = export(data, tmp_path / "series.parquet", "parquet")
    table = pq.read_table(file)
    field = table.schema.field("end_effector_velocity_x")
    assert field.metadata == {b"unit": b"m/s", b"long_name": b"end-effector velocity"}
    values = table["end_effector_velocity_x"].to_numpy().reshape(2, 21)
    np.testing.assert_array_equal(values, data["end_effector_velocity"].sel(axis="x"))
    assert table.schema.metadata[b"mechanism"] == b"RAParM-I"
    assert table["end_effector_x"].null_count > 0


def test_matlab_finds_time_first_and_names_that_it_allows(data, tmp_path):
    (file,) = export(data, tmp_path, "mat")
    assert file == tmp_path / "results.mat"
    results = loadmat(file, simplify_cells=True)["results"]
    assert results["torque"].shape == (21, 4, 2)
    np.testing.assert_array_equal(results["torque"][:, 1, 1], data["torque"].sel(mode="+--+", motor="tau2"))
    assert results["shape"].shape == (21, data.sizes["station"], 2, 2)
    np.testing.assert_array_equal(results["shape"][5, 9, :, 0], data["shape"][0, 5, 9])
    assert list(results["mode"]) == ["++++", "+--+"]
    assert list(results["dims"]["torque"]) == ["time", "motor", "mode"]
    assert results["units"]["torque"] == "N m"
    assert results["meaning"]["work"].startswith("work of motors")
    assert results["attributes"]["mechanism"] == "RAParM-I"
    assert results["attributes"]["schema"] == SCHEMA
    assert np.isnan(results["end_effector"][-1, :, 1]).all()
    # As MATLAB sees it: a column of time, a column of cells, text.
    raw = loadmat(file)["results"][0, 0]
    assert raw["time"].shape == (21, 1)
    assert raw["mode"].dtype == object
    assert raw["mode"].shape == (2, 1)
    assert all(matlab_name(name) == name for name in raw.dtype.names)


@pytest.mark.parametrize(
    ("name", "allowed"),
    [("link1.A x", "link1_A_x"), ("3prr", "x3prr"), ("_a", "x_a"), ("", "x"), ("é" * 3, "x___"), ("a" * 80, "a" * 63)],
)
def test_names_for_matlab(name, allowed):
    assert matlab_name(name) == allowed


def test_netcdf_is_the_dataset_itself(data, tmp_path):
    (file,) = export(data, tmp_path / "copy.nc", "netcdf")
    assert pf.open_results(file).equals(pf.open_results(file).load())
    assert pf.open_results(file)["torque"].equals(data["torque"])


def test_a_run_without_a_path_and_one_of_the_first_schema(tmp_path):
    model = pf.load("pendulum")
    run = motion_dataset(simulate_motion(model.mechanism, 0.02, samples=3))
    names = list(result_tables(run)["time_series"])
    assert names[:2] == ["time", "coordinate_value_beam.x"]
    assert matlab_struct(run)["coordinate_value"].shape == (3, run.sizes["coordinate"])
    files = export(pf.open_results(OLD), tmp_path, "csv", shapes=True)
    assert [file.name for file in files] == ["time_series.csv", "figures.csv"]


def test_results_of_several_models_have_a_row_for_each(data, tmp_path):
    models = xr.concat([data, data], xr.Variable("model", ["rigid", "linear"]))
    series = result_tables(models)["time_series"]
    assert list(series.columns[:3]) == ["model", "mode", "time"]
    assert series["torque_tau1"].values.size == 2 * 2 * 21
    assert matlab_struct(models)["torque"].shape == (21, 4, 2, 2)


# --- What is refused -------------------------------------------------------------------------------------------------


def test_nothing_is_written_over_unasked(data, tmp_path):
    (tmp_path / "figures.csv").write_text("mine")
    with pytest.raises(InputError, match=r"figures.csv: exists already.*--force"):
        export(data, tmp_path, "csv")
    # Not even the file that was not there.
    assert [file.name for file in tmp_path.iterdir()] == ["figures.csv"]
    export(data, tmp_path, "csv", force=True)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["figures.csv", "time_series.csv"]


def test_a_folder_that_cannot_be_written(data, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        export(data, tmp_path / "file" / "deeper", "mat")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--to", "matlab"], "--to: no such format (got 'matlab'); did you mean \"mat\"?"),
        (
            ["--to", "mat", "--output", "out.csv"],
            "--output: does not have the ending of mat (got 'out.csv'); end it in .mat",
        ),
    ],
)
def test_the_command_names_the_option_at_fault(folder, monkeypatch, capsys, arguments, message):
    monkeypatch.setattr(sys, "argv", ["paraflex", "export", str(folder), *arguments])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert capsys.readouterr().err == f"error: {message}\n"


# --- The command -----------------------------------------------------------------------------------------------------


def test_the_command_writes_beside_the_results(folder):
    done = CliRunner().invoke(app, ["export", str(folder), "--to", "parquet", "--shapes"])
    assert done.exit_code == 0, done.output
    names = sorted(file.name for file in (folder / "export").iterdir())
    assert names == ["figures.parquet", "sections.parquet", "shapes.parquet", "time_series.parquet"]


@pytest.fixture
def study(tmp_path):
    """The folder of a study of many runs: a table with units, one run failed."""
    fields = [pa.field("mode", pa.string()), pa.field("error", pa.float64(), metadata={"unit": "m"})]
    table = pa.table([["++++", "+--+"], [1.5e-4, None]], schema=pa.schema(fields))
    pq.write_table(table, tmp_path / "results.parquet")
    return tmp_path


def test_the_table_of_a_study_becomes_csv_or_a_struct(study):
    for to in ("csv", "mat"):
        assert CliRunner().invoke(app, ["export", str(study), "--to", to]).exit_code == 0
    assert read_csv(study / "export" / "results.csv") == {"mode": ("++++", "+--+"), "error [m]": ("0.00015", "")}
    results = loadmat(study / "export" / "results.mat", simplify_cells=True)["results"]
    assert list(results["mode"]) == ["++++", "+--+"]
    np.testing.assert_array_equal(results["error"], [1.5e-4, np.nan])
    refused = CliRunner().invoke(app, ["export", str(study), "--to", "netcdf"])
    assert "Parquet already" in str(refused.exception)
    (study / "results.parquet").write_bytes(b"PAR1 and no more")
    refused = CliRunner().invoke(app, ["export", str(study), "--to", "csv", "--force"])
    assert "damaged: cut short, or not a readable table" in str(refused.exception)
