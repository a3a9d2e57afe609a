"""Install the package with the oldest dependencies that it declares, and with the newest there are; run it with both.

    python tests/oldest_and_newest.py [--in FOLDER] [--only oldest] [--pythons python3.11 python3.13]

Each has a virtual environment of its own; packages come from wherever pip is set up to find them. It takes a quarter of
an hour, most of it for kernels, and is no part of `make test`.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
# What reads and writes files, tables, figures and kernels: what depends on the releases of others.
TESTS = ("test_fem_element", "test_kernel_cache", "test_campaign", "test_saving", "test_export")
TOOLS = ("pytest", "psutil")


def oldest(requirements: list[str]) -> list[str]:
    """Pins of the releases from which on a package is said to do: numpy>=2.0 is numpy~=2.0.0, the newest of 2.0."""
    found = (re.fullmatch(r"([\w.-]+)>=([\d.]+)", each) for each in requirements)
    return [f"{one[1]}~={one[2]}{'.0' * (one[2].count('.') < 2)}" for one in found if one is not None]


def pins(which: str) -> list[str]:
    """What pip is held to; nothing for the newest."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return oldest(project["dependencies"]) if which == "oldest" else []


def tried(which: str, python: str, folder: Path) -> bool:
    """Whether an installation runs and passes tests; what it consists of is printed."""
    folder.mkdir(parents=True)
    subprocess.run([python, "-m", "venv", str(folder / "venv")], check=True)
    scripts = "Scripts" if os.name == "nt" else "bin"
    own = str(folder / "venv" / scripts / "python")
    (folder / "pins.txt").write_text("\n".join(pins(which)) + "\n", encoding="utf-8")
    # Not the checkout's sources: what is tried is the installation.
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "NUMBA_CACHE_DIR")}
    tests = [str(ROOT / "tests" / f"{name}.py") for name in TESTS]
    commands = [
        ["-m", "pip", "install", "--quiet", "--constraint", str(folder / "pins.txt"), str(ROOT), *TOOLS],
        ["-m", "pip", "list"],
        ["-m", "pip", "check"],
        ["-m", "paraflex.compilation"],
        ["-m", "paraflex", "run", "raparm_i", "--mode", "++++", "--out", str(folder / "results")],
        # Warnings of theirs are no errors here: old releases know nothing of the deprecations of others.
        ["-m", "pytest", "-q", "-W", "default", "-p", "no:cacheprovider", *tests],
    ]
    return all(subprocess.run([own, *each], env=environment, cwd=folder).returncode == 0 for each in commands)


def main() -> int:
    """The exit code: 1 where one of them does not work."""
    reader = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    reader.add_argument("--in", dest="folder", type=Path, help="made for the environments; a temporary one by default")
    reader.add_argument("--only", choices=("oldest", "newest"))
    reader.add_argument("--pythons", nargs=2, default=(sys.executable, sys.executable), metavar=("OLDEST", "NEWEST"))
    given = reader.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or Path(temporary)
        chosen = dict(zip(("oldest", "newest"), given.pythons, strict=True))
        wanted = [given.only] if given.only else list(chosen)
        works = {which: tried(which, chosen[which], folder / which) for which in wanted}
    for which, well in works.items():
        print(f"{which}: {'works' if well else 'does not work'} ({chosen[which]})")
    return 0 if all(works.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
