"""The structure of the package, as its imports have it."""

from graphlib import CycleError, TopologicalSorter

import grimp
import pytest


def circle(imports):
    """Modules whose imports lead back to them; None where none do."""
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return error.args[1]
    return None


def test_no_import_goes_in_a_circle():
    """Those within functions and those for types count, too."""
    graph = grimp.build_graph("paraflex", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    assert len(imports) > 300
    assert circle(imports) is None
    assert circle(imports | {"paraflex.errors": {"paraflex.simulate"}})


@pytest.mark.parametrize(("family", "others"), [("sweeps", "optimisation"), ("optimisation", "sensitivities")])
def test_families_of_studies_do_not_know_one_another(family, others):
    graph = grimp.build_graph("paraflex", cache_dir=None)
    names = [f"paraflex.studies.{name}" for name in (family, others)]
    assert not graph.chain_exists(*names, as_packages=True)
    assert not graph.chain_exists(*reversed(names), as_packages=True)
