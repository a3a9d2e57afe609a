"""What a newcomer meets first: the package's names, and that the project stands alone."""

import operator
from pathlib import Path

import pytest

import paraflex
from processes import python

ROOT = Path(__file__).parents[1]


def test_import_is_light():
    """Importing the package loads none of the heavy libraries; a name loads what it needs."""
    code = (
        "import sys, paraflex; "
        "heavy = {'numba', 'scipy', 'xarray', 'matplotlib', 'pydantic', 'rich'} & set(sys.modules); "
        "assert not heavy, heavy"
    )
    python("-c", code, check=True)


def test_all_names_are_there_in_a_new_process():
    """Submodules among them as well, which other tests have imported here."""
    python("-c", "from paraflex import *; from paraflex.studies import *; from paraflex.control import *", check=True)


@pytest.mark.parametrize("name", paraflex.__all__)
def test_public_names_exist(name):
    assert getattr(paraflex, name) is not None


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        paraflex.simulat  # noqa: B018


def test_nothing_reads_outside_the_project():
    """The project stands alone."""
    for folder in ("src", "tests", "benchmarks", "examples", "docs"):
        for file in (ROOT / folder).rglob("*"):
            if file.suffix in (".py", ".toml", ".md") and file != Path(__file__):
                assert "../shared" not in file.read_text(encoding="utf-8"), file


@pytest.mark.parametrize(
    ("old", "new"),
    [("plan_tracking", "plan"), ("sobol_indices", "indices"), ("raparm_i", "library.raparm_i"),
     ("four_bars_in_a_row", "library.four_bars_in_a_row"), ("library_names", "library.names")],
)  # fmt: skip
def test_names_of_the_last_version_work_and_say_what_they_are_called_now(old, new):
    with pytest.warns(DeprecationWarning, match=f"pf.{old} is called pf.{new} now"):
        found = getattr(paraflex, old)
    assert callable(found)
    assert old == "plan_tracking" or found is operator.attrgetter(new)(paraflex)


def test_every_public_name_is_offered_by_completion():
    assert {"load", "plan", "simulate", "verify", "sweep", "RevoluteJoint", "methods", "library"} <= set(dir(paraflex))
    assert paraflex.simulate is paraflex.tracking.simulate
