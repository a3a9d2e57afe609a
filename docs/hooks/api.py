"""The API pages: every public name, where it lives, in the words of its docstring."""

from __future__ import annotations

import ast
from contextlib import suppress
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

SOURCE = Path(__file__).parents[2] / "src" / "paraflex"

# In the order of the theory; a name is told once, in the first of these that has it.
PACKAGES = (
    "library",
    "files",
    "checks",
    "checks.drawing",
    "findings",
    "mechanism",
    "paths",
    "actuation",
    "tracking",
    "motion",
    "driven",
    "validity",
    "elastodynamics",
    "reduced_bodies",
    "linear",
    "control.loop.simulation",
    "control.loop.chain",
    "control.laws.discrete",
    "control.laws.compiled",
    "control.laws.controllers",
    "control.laws.joints",
    "control.laws.kinds.joint_pid",
    "control.laws.kinds.computed_torque",
    "control.laws.kinds.rate_feedback",
    "control.design.rate_gains",
    "control.loop.runs",
    "control.loop.run_loop",
    "control.design.sampled",
    "control.design.regulators",
    "control.laws.lqg_law",
    "control.laws.kinds.lqg",
    "control.laws.kinds.state_space",
    "control.laws.law",
    "control.laws.linear_law",
    "control.laws.estimators",
    "control.design.closed_loops",
    "control.design.margins",
    "control.shaping.shapers",
    "control.shaping.shaped",
    "control.environment",
    "control.vector_environment",
    "equilibria",
    "integrators.methods",
    "integrators",
    "dynamics",
    "fem",
    "results",
    "results.export",
    "plots",
    "plots.film",
    "plots.compare",
    "reports",
    "results.metrics",
    "designs.measure",
    "designs.setting",
    "designs.samples",
    "designs.run",
    "designs.derivatives.gradient",
    "studies",
    "studies.report",
    "workbench.notebook",
    "campaign",
    "engines",
    "errors",
    "compilation",
)

_TITLES = {"integrators.methods": "methods of integration"}

# Public names that are modules, and constants, which have no docstrings.
_MODULES = {"library": "library", "methods": "integrators.methods", "plots": "plots"}
_CONSTANTS = {"METHODS": "Methods of integration by their names."}


def on_config(config: Any) -> Any:
    """List the pages of packages last in the navigation of the reference."""
    reference = next(item["Reference"] for item in config.nav if "Reference" in item)
    reference.append({"Packages": [{_TITLES.get(package, package): _page(package)} for package in PACKAGES]})
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add a page a package, and one for `paraflex` itself."""
    homes: dict[str, str] = {}
    told: set[str] = set()
    for package in PACKAGES:
        names = [name for name in public_names(package) if _origin(package, name) not in told]
        told |= {_origin(package, name) for name in names}
        homes |= {name: f"paraflex.{package}.{name}" for name in public_names(package) if name not in homes}
        files.append(File.generated(config, _page(package), content=_package_page(package, names)))
    files.append(File.generated(config, "reference/api/index.md", content=_index_page(homes)))
    return files


def public_names(package: str) -> list[str]:
    """Names that a package hands on (`name as name`), and its own functions and classes that are not private."""
    tree, names = _tree(package), []
    for node in tree.body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            with suppress(ValueError):  # of packages that read it from their stubs
                return ast.literal_eval(node.value)
        if isinstance(node, ast.ImportFrom) and (node.module or not package):
            names += [alias.name for alias in node.names if alias.asname == alias.name]
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            names.append(node.name)
    return names


def _page(package: str) -> str:
    return f"reference/api/{package}.md"


def _tree(package: str, kind: str = "pyi") -> ast.Module:
    """A package as its stub has it where there is one, or its code; a module."""
    path = SOURCE / package.replace(".", "/")
    file = path / f"__init__.{kind}" if path.is_dir() else path.with_suffix(".py")
    return ast.parse(file.read_text(encoding="utf-8")) if file.is_file() else _tree(package, "py")


def _module(package: str, node: ast.ImportFrom) -> str:
    """The module that a package imports from, below `paraflex`."""
    if node.level:
        return ".".join(part for part in (package, node.module) if part)
    return (node.module or "").removeprefix("paraflex.")


def _origin(package: str, name: str) -> str:
    """The module a package takes a name from, followed as far as packages hand it on; and the name."""
    for node in _tree(package).body:
        # `from . import NAME` names a module of the package itself.
        if not isinstance(node, ast.ImportFrom) or node.module is None:
            continue
        if any((alias.asname or alias.name) == name for alias in node.names):
            module = _module(package, node)
            return _origin(module, name) if (SOURCE / module.replace(".", "/")).is_dir() else f"{module}.{name}"
    if package == "plots":
        # A figure with charts is described where it is defined.
        for file in (SOURCE / "figures").glob("*.py"):
            if f"\ndef {name}(" in file.read_text(encoding="utf-8"):
                return f"figures.{file.stem}.{name}"
    return f"{package}.{name}"


def _package_page(package: str, names: list[str]) -> str:
    about = ast.get_docstring(_tree(package, "py")) or ""
    names = sorted(names, key=str.isupper)  # constants last
    return f"# paraflex.{package}\n\n{about}\n\n" + "\n".join(f"::: paraflex.{package}.{name}\n" for name in names)


def _index_page(homes: dict[str, str]) -> str:
    names = public_names("")
    rows = [f"| {_link(name, homes)} | {_described(name)} |" for name in names]
    packages = [f"| [paraflex.{package}]({package}.md) | {_about(package)} |" for package in PACKAGES]
    return "\n".join(
        [
            "# Python, name by name",
            "",
            "Made from the docstrings. `import paraflex as pf`; what stands here is public.",
            "",
            *["| Name | |", "|---|---|", *rows, ""],
            *["| Package | |", "|---|---|", *packages, ""],
            _about(""),
        ]
    )


def _link(name: str, homes: dict[str, str]) -> str:
    if name in _MODULES:
        return f"[`pf.{name}`]({_MODULES[name]}.md)"
    return f"[`pf.{name}`][{homes[name]}]"


def _described(name: str) -> str:
    """The first sentence of a public name's docstring, as a cell of a table."""
    if name in _MODULES:
        return _about(_MODULES[name])
    module, _, own = _origin("", name).rpartition(".")
    for node in _tree(module, "py").body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == own:
            about = (ast.get_docstring(node) or "").split("\n\n")[0]
            return " ".join(about.split()).replace("|", r"\|")
    return _CONSTANTS.get(name, "")


def _about(package: str) -> str:
    """The first paragraph of a package's docstring."""
    return (ast.get_docstring(_tree(package, "py")) or "").split("\n\n")[0].replace("\n", " ")
