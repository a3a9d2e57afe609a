"""The structure of the package, as its imports have it."""

import ast
import re
import sys
import tomllib
from collections import Counter
from graphlib import CycleError, TopologicalSorter
from importlib.metadata import packages_distributions
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[1]


def circle(imports):
    """Modules whose imports lead back to them; None where none do."""
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return error.args[1]
    return None


def module_name(file):
    parts = file.relative_to(ROOT / "src").with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def named_modules(tree, package):
    """Names of what a file imports: within functions, for types, and by `import_module` too.

    Both names of `from package import module` count, as the package runs as well. A name that is put together may end
    in any text of the file.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            name = ".".join(filter(None, [*above, node.module]))
            yield from (name, *(f"{name}.{each.name}" for each in node.names))
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "import_module":
            (name,) = node.args
            if isinstance(name, ast.JoinedStr):
                texts = [each.value for each in ast.walk(tree) if isinstance(each, ast.Constant)]
                yield from (f"{name.values[0].value}{str(text).partition('.')[0]}" for text in texts)
            elif isinstance(name, ast.Constant):
                yield name.value


def test_no_import_goes_in_a_circle():
    files = {module_name(file): file for file in (ROOT / "src").rglob("*.py")}
    imports = {}
    for module, file in files.items():
        package = module if file.name == "__init__.py" else module.rpartition(".")[0]
        named = set(named_modules(ast.parse(file.read_text(encoding="utf-8")), package))
        imports[module] = files.keys() & named - {module}
    assert len(imports) > 300
    assert "paraflex.cli.draw" in imports["paraflex.cli.commands.shell"]
    assert "paraflex.mechanism.quantities" in imports["paraflex.mechanism.loads"]
    assert circle(imports) is None
    assert circle(imports | {"paraflex.errors": {"paraflex.tracking"}})


@pytest.mark.parametrize(("family", "others"), [("sweeps", "optimisation"), ("optimisation", "sensitivity")])
def test_families_of_studies_do_not_know_one_another(family, others):
    graph = grimp.build_graph("paraflex", cache_dir=None)
    names = [f"paraflex.studies.{name}" for name in (family, others)]
    assert not graph.chain_exists(*names, as_packages=True)
    assert not graph.chain_exists(*reversed(names), as_packages=True)


def test_a_class_has_a_name_of_its_own():
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in (ROOT / "src").rglob("*.py")]
    names = Counter(node.name for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    assert [name for name, count in names.items() if count > 1] == []


def imported(tree):
    """First names of what a file imports, within functions too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name.split(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module.split(".")[0]


def test_what_is_imported_is_declared():
    """Other packages' needs are theirs to change."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [each for name, listed in project["optional-dependencies"].items() if name != "dev" for each in listed]
    declared = {plain(re.match(r"[\w.-]+", each)[0]) for each in [*project["dependencies"], *extras]}
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in (ROOT / "src").rglob("*.py")]
    names = {name for tree in trees for name in imported(tree)} - sys.stdlib_module_names - {"paraflex"}
    homes = packages_distributions()
    assert {"numpy", "tomlkit", "optuna"} <= names
    assert sorted(name for name in names if not declared & set(map(plain, homes.get(name, [name])))) == []


def plain(distribution):
    """A name as package indices compare it."""
    return re.sub(r"[-_.]+", "-", distribution).lower()
