"""What is shipped: contents and metadata of wheel and source distribution, the command, completion, citation."""

import email
import re
import shutil
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

from paraflex.compilation import compile_all_kernels
from paraflex.kernel.march import march
from processes import python, run

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
NAME = f"paraflex-{PROJECT['version']}"


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Wheel and source distribution, made without a network."""
    folder = tmp_path_factory.mktemp("dist")
    done = python("-m", "build", "--no-isolation", "--outdir", folder, ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def wheel(built):
    with zipfile.ZipFile(built / f"{NAME}-py3-none-any.whl") as archive:
        yield archive


def test_the_wheel_has_all_of_the_package_and_nothing_else(wheel):
    there = {name for name in wheel.namelist() if not name.startswith(f"{NAME}.dist-info/")}
    source = ROOT / "src"
    tracked = {str(path.relative_to(source)) for path in (source / "paraflex").rglob("*") if path.is_file()}
    assert there == {name for name in tracked if "__pycache__" not in name}
    assert "paraflex/py.typed" in there
    assert sum(name.startswith("paraflex/mechanism/library/") for name in there) >= 12


def test_metadata_of_the_wheel(wheel):
    metadata = email.message_from_string(wheel.read(f"{NAME}.dist-info/METADATA").decode())
    assert metadata["Name"] == "paraflex"
    assert metadata["License-Expression"] == "MIT"
    assert metadata["Requires-Python"] == ">=3.11"
    assert f"{NAME}.dist-info/licenses/LICENSE" in wheel.namelist()
    extras = set(metadata.get_all("Provides-Extra") or [])
    assert extras == set(PROJECT["optional-dependencies"])
    entry_points = wheel.read(f"{NAME}.dist-info/entry_points.txt").decode()
    assert "paraflex = paraflex.__main__:main" in entry_points


def test_all_extras_but_that_of_developers_are_in_all():
    (everything,) = PROJECT["optional-dependencies"]["all"]
    named = set(re.fullmatch(r"paraflex\[(.*)\]", everything)[1].split(","))
    assert named == set(PROJECT["optional-dependencies"]) - {"all", "dev"}


def test_the_source_distribution_can_be_worked_with(built):
    with tarfile.open(built / f"{NAME}.tar.gz") as archive:
        there = {name.removeprefix(f"{NAME}/") for name in archive.getnames()}
    files = (
        "hatch_build.py",
        "README.md",
        "LICENSE",
        "CITATION.cff",
        "CONTRIBUTING.md",
        "Makefile",
        "constraints.txt",
        "mkdocs.yml",
    )
    folders = (
        "docs/theory.md",
        "docs/hooks/mathematics.py",
        "docs/notebooks/closed_loop.ipynb",
        "docs/notebooks/raparm_i.ipynb",
        "examples/raparm_square.py",
    )
    assert there.issuperset((*files, *folders, "tests/test_packaging.py", "benchmarks/measured/peers.json"))
    assert not [name for name in there if name.startswith((".ci", "site/", "results/", ".venv"))]


def test_the_wheel_runs_by_itself(built, tmp_path):
    """Unpacked, without the checkout on the path: version and help, as module and as program."""
    with zipfile.ZipFile(built / f"{NAME}-py3-none-any.whl") as archive:
        archive.extractall(tmp_path)
    assert ask(["--version"], tmp_path) == f"paraflex {PROJECT['version']}"
    assert "compare-methods" in ask(["--help"], tmp_path)


def test_a_wheel_with_compiled_kernels_compiles_none(tmp_path):
    compile_all_kernels()
    shutil.copytree(Path(march.cache_path), tmp_path / "cache" / Path(march.cache_path).name)
    kernels = {"PARAFLEX_KERNELS": str(tmp_path / "cache")}
    python("-m", "build", "--no-isolation", "--wheel", "--outdir", tmp_path, ROOT, env=kernels, check=True)
    (file,) = tmp_path.glob("*.whl")
    release = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert re.fullmatch(rf"{re.escape(NAME)}-{release}-none-\w+\.whl", file.name)
    assert "py3-none-any" not in file.name
    with zipfile.ZipFile(file) as archive:
        archive.extractall(tmp_path / "installed")
    environment = {"PYTHONPATH": str(tmp_path / "installed"), "NUMBA_CACHE_DIR": str(tmp_path / "empty")}
    command = ("run", "raparm_i", "--mode", "++++", "--duration", "0.01", "--samples", "5", "--no-figures")
    done = python("-m", "paraflex", *command, cwd=tmp_path, env=environment, check=True)
    assert "compiling" not in done.stderr
    assert not list((tmp_path / "empty").rglob("*.nbc"))
    # Of another state of the sources none is used.
    source = tmp_path / "installed" / "paraflex" / "kernel" / "arrays.py"
    source.write_text(source.read_text(encoding="utf-8") + "# edited\n", encoding="utf-8")
    look = "from paraflex.compilation import are_compiled; print(are_compiled())"
    assert python("-c", look, cwd=tmp_path, env=environment, check=True).stdout == "False\n"


def test_a_wheel_of_kernels_that_are_not_there_is_refused(tmp_path):
    kernels = {"PARAFLEX_KERNELS": str(tmp_path)}
    done = python("-m", "build", "--no-isolation", "--wheel", "--outdir", tmp_path, ROOT, env=kernels)
    assert done.returncode != 0
    assert "holds kernels of 0 states; compile into a new folder" in done.stdout + done.stderr
    assert not list(tmp_path.glob("*.whl"))


def test_version_in_the_citation_is_that_of_the_package():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {PROJECT['version']}\n" in citation
    assert f"\nlicense: {PROJECT['license']}\n" in citation


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_script(shell):
    program = "import sys; sys.argv[0] = 'paraflex'; from paraflex.cli.app import main; main()"
    command = [sys.executable, "-c", program]
    script = complete(command, f"source_{shell}")
    assert "paraflex" in script
    assert f"complete_{shell}" in script


def test_completion_of_commands_and_options():
    program = "import sys; sys.argv[0] = 'paraflex'; from paraflex.cli.app import main; main()"
    command = [sys.executable, "-c", program]
    assert complete(command, "complete_bash", COMP_WORDS="paraflex ver", COMP_CWORD="1").split() == ["verify"]
    options = complete(command, "complete_bash", COMP_WORDS="paraflex run --m", COMP_CWORD="2").split()
    assert {"--mechanism", "--mode", "--method"} <= set(options)


def complete(command, instruction, **words):
    done = run(*command, env={"_PARAFLEX_COMPLETE": instruction, **words})
    assert not done.stderr
    return done.stdout


def ask(arguments, folder):
    done = python("-m", "paraflex", *arguments, cwd=folder, env={"PYTHONPATH": str(folder)}, check=True)
    return done.stdout.strip()
