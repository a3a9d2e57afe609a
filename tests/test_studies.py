"""Every study runs alike, and every result offers the same: labelled data, plain values, files."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import paraflex as pf
from made_up import STUDY, made_up, write_study
from paraflex.campaign import Progress, Result, Study, Workers
from paraflex.control import ControllerDescription
from paraflex.errors import InputError
from paraflex.studies import (
    load_identification,
    load_indices,
    load_optimisation,
    load_sensitivities,
    load_sweep,
    tracking_case,
)
from paraflex.studies.compare import ComparisonOptions, ComparisonStudy
from paraflex.studies.laws import LawStudy
from paraflex.studies.tracking import TrackingStudy
from paraflex.studies.verification import VerificationOptions, VerificationStudy
from paraflex.writing import read_json

LOOSE = pf.IntegrationOptions(tolerance=1e-3)
SAMPLED = STUDY.replace("[vary.x]", '[sampling]\nkind = "sobol"\nnumber = 4\n\n[vary.x]')
OBJECTIVE = "\n[objective]\nminimise = { tracking_rms = 1.0 }\n[search]\nevaluations = 6\n"
TARGET = '\n[[target]]\nmetric = "tracking_rms"\nvalue = 0.004\n[search]\nevaluations = 6\n'
OF_FILES = {
    "sweep": (load_sweep, SAMPLED),
    "optimisation": (load_optimisation, STUDY + OBJECTIVE),
    "identification": (load_identification, STUDY + TARGET),
    "indices": (lambda file: load_indices(file, ["tracking_rms"], 8), STUDY),
}
FILES = {
    "sweep": {"summary.json", "results.parquet", "results.csv"},
    "optimisation": {"result.json", "results.parquet", "results.csv"},
    "identification": {"result.json", "results.parquet", "results.csv"},
    "indices": {"indices.json", "indices.parquet", "results.csv"},
    "tracking": {"results.nc", "summary.json"},
    "verification": {"verify.nc", "verify.json"},
    "comparison": {"compare-methods.json"},
    "laws": {"laws.nc", "laws.json", "laws.csv"},
    "sensitivity": {"sensitivity.json", "sensitivity.csv", "sensitivity.parquet"},
}


def made():
    return made_up(
        tracking_rms=lambda mode, x, y: x + 1e-4 * y, peak_torque_max=lambda mode, x, y: y, total_mass=lambda *_: 3.0
    )


@pytest.fixture(scope="module")
def task():
    return pf.plan(pf.load("five_bar"), "line", duration=0.02, samples=5)


@pytest.fixture(scope="module")
def studies(task, tmp_path_factory):
    """One of every family, and what else its runs take."""
    folder = tmp_path_factory.mktemp("files")
    differentiated = STUDY.replace('"raparm_i"', '"five_bar"').replace('"++++"', '"++"').replace("0.15", "0.02")
    differentiated = differentiated.replace("samples = 26", "samples = 5").replace("lump.end.mass", "lump.tool.mass")
    sensitivity = load_sensitivities(write_study(folder, differentiated, "sensitivity.toml"))
    read = {kind: load(write_study(folder, text, f"{kind}.toml")) for kind, (load, text) in OF_FILES.items()}
    gentle = ControllerDescription("pd", pf.JointPID(1.0), 1e-3)
    return read | {
        "tracking": TrackingStudy(task, ["++"], LOOSE),
        "verification": VerificationStudy(task, ["++"], ("rigid", "linear"), VerificationOptions(tolerance=1e-3)),
        "comparison": ComparisonStudy(
            tracking_case(task, "++"), ["esdirk5", "tr-bdf2"], ComparisonOptions((1e-3,), repetitions=1)
        ),
        "laws": LawStudy({"line": task}, {"open loop": (), "pd": [gentle]}, ["++"], LOOSE),
        "sensitivity": sensitivity,
    }


@pytest.fixture(scope="module")
def done(studies, tmp_path_factory):
    """What came of it, where, and what was told on the way."""
    out = {}
    for kind, study in studies.items():
        told, folder = [], tmp_path_factory.mktemp(kind) / "out"
        more = {"run": made()} if kind in OF_FILES else {}
        out[kind] = study.run(folder, on_progress=told.append, **more), folder, told
    return out


@pytest.mark.parametrize("kind", FILES)
def test_every_study_is_one_and_gives_a_result(studies, done, kind):
    result, folder, told = done[kind]
    assert isinstance(studies[kind], Study)
    assert isinstance(result, Result)
    assert result.complete
    assert {file.name for file in folder.iterdir()} >= FILES[kind]
    assert told
    assert all(isinstance(each, Progress) and 0 <= each.done <= each.total for each in told)
    assert "<table" in result._repr_html_()


@pytest.mark.parametrize("kind", FILES)
def test_plain_values_are_those_of_the_file(done, kind):
    result, folder, _ = done[kind]
    written = read_json(folder / result.values_file)
    assert json.loads(json.dumps(result.to_dict(), default=str)) == written


@pytest.mark.parametrize("kind", FILES)
def test_it_is_saved_elsewhere_the_same(done, kind, tmp_path):
    result, folder, _ = done[kind]
    assert result.save(tmp_path / "copy") == tmp_path / "copy"
    kept = {"study.json"} & {file.name for file in folder.iterdir()}
    assert {file.name for file in (tmp_path / "copy").iterdir()} == FILES[kind] | {"manifest.json", ".lock"} | kept
    for name in FILES[kind] - {"results.nc", "verify.nc", "laws.nc"}:
        assert (tmp_path / "copy" / name).read_bytes() == (folder / name).read_bytes(), name
    result.save(folder)


@pytest.mark.parametrize("kind", FILES)
def test_data_have_names(done, kind):
    data = done[kind][0].data
    assert isinstance(data, xr.Dataset)
    assert data.sizes


def test_runs_of_many_designs_stand_along_one_dimension_with_units(done):
    result, folder, _ = done["sweep"]
    table = pd.read_csv(folder / "results.csv", dtype={"reason": str}).assign(reason="")
    assert result.data.sizes == {"run": 4}
    assert result.data["total_mass"].attrs["units"] == "kg"
    np.testing.assert_array_equal(result.data["x"], table["x"])
    kept = pd.read_parquet(folder / "results.parquet")
    assert list(table) == list(kept)
    for name in kept:
        np.testing.assert_array_equal(table[name].to_numpy(), kept[name].to_numpy(), name)


def test_indices_and_derivatives_are_found_by_name(done):
    indices = done["indices"][0].data
    assert indices["first"].sel(parameter="x").shape == (1,)
    assert list(indices["metric"].values) == ["tracking_rms"]
    found = done["sensitivity"][0]
    one = found.data["derivative"].sel(metric="total_mass", parameter="x").item()
    assert one == found.to_dict()["runs"][0]["metrics"]["total_mass"]["derivatives"]["x"]


def test_times_and_errors_of_methods_are_found_by_name(done):
    found = done["comparison"][0]
    assert list(found.data["method"].values) == ["esdirk5", "tr-bdf2"]
    assert found.data["error"].values[0] == found.measurements[0].error


@pytest.mark.parametrize("kind", OF_FILES)
def test_many_runs_need_a_folder(studies, kind):
    with pytest.raises(InputError, match=r'folder: many runs are kept in a folder; name one: run\("out"\)'):
        studies[kind].run()


@pytest.mark.parametrize("kind", ["verification", "comparison", "sensitivity"])
def test_what_runs_one_after_the_other_takes_no_workers(studies, kind):
    with pytest.raises(InputError, match=r"workers: .* after another; leave it out"):
        studies[kind].run(workers=Workers())


def test_modes_run_in_threads_of_any_number(studies, done):
    with pytest.raises(InputError, match=r"workers: modes run in threads \(got 'dask'\)"):
        studies["tracking"].run(workers=Workers("dask"))
    one = replace(studies["tracking"], modes=["++"]).run(workers=Workers(number=1))
    np.testing.assert_array_equal(one.data["end_effector"], done["tracking"][0].data["end_effector"])
