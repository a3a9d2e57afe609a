"""Kinds of results: one record has all that folders, figures, exports and reports ask of a kind."""

import numpy as np
import pytest
import xarray as xr

import paraflex.reports
from paraflex.errors import InputError
from paraflex.figures.charts import Curve
from paraflex.folders import DATA_FILES, FOLDER_FILES, RESULT_KINDS
from paraflex.plots.catalogue import CATALOGUE
from paraflex.plots.sources import kind_of_numbers
from paraflex.results.export import result_tables
from paraflex.results.kinds import kind_of


def test_every_kind_with_data_has_figures_and_a_report_or_says_why_not():
    drawn = {name for name, kind in RESULT_KINDS.items() if kind.data or kind.marks or name == "sweep"}
    assert set(CATALOGUE) == drawn
    for kind in RESULT_KINDS.values():
        if kind.producers:
            assert bool(kind.page) != ("page" in kind.refusals), kind.name
            assert kind.data in kind.files
        if kind.page:
            module, _, function = kind.page.partition(".")
            assert callable(getattr(getattr(paraflex.reports, module), function))


def test_folders_are_told_apart_by_their_files():
    """The summary of a study of many runs is one of its further files: it is looked for before runs are."""
    names = [name for files in FOLDER_FILES.values() for name in files]
    assert len(names) == len(set(names))
    assert list(FOLDER_FILES).index("study of many runs") < list(FOLDER_FILES).index("run")
    assert DATA_FILES[0] == "results.nc"


@pytest.mark.parametrize(
    ("found", "kind"),
    [
        ({"kind": "indices"}, "indices"),
        ({"kind": "sweep"}, ""),
        ({"parameters": [], "units": {}, "runs": []}, "sensitivity"),
        ([{"mode": "++", "motors": []}], "modes"),
        ({"mode": "++", "motors": []}, ""),
        ([{"kind": "indices"}], ""),
        ([], ""),
        (3, ""),
    ],
)
def test_plain_numbers_are_recognised_by_their_entries(found, kind):
    assert kind_of_numbers(found) == kind


def test_a_misspelt_kind_is_not_taken_for_runs():
    data = xr.Dataset({"torque": ("time", np.zeros(3))}, attrs={"kind": "motoin"})
    with pytest.raises(InputError, match=r"kind: unknown kind of results \(got 'motoin'\); did you mean \"motion\"\?"):
        kind_of(data)
    assert kind_of(data.assign_attrs(kind="motion")) == "motion"


@pytest.mark.parametrize(("dim", "name", "shape"), [("time", "time_series", (3, 2)), ("tiem", "figures", (1, 3))])
def test_no_table_is_empty(dim, name, shape):
    """Variables along another dimension than that of their kind are figures, one for each of its places."""
    data = xr.Dataset({"torque": (dim, np.zeros(3))}, attrs={"kind": "motion"})
    assert {table: found.shape for table, found in result_tables(data).items()} == {name: shape}


def test_a_curve_has_as_many_abscissae_as_ordinates():
    with pytest.raises(ValueError, match='curve "one" has'):
        Curve("one", np.zeros(3), np.zeros(4))
