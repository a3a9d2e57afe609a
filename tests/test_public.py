"""What a newcomer meets first: imports, the README's example, the example scripts."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

import paraflex

ROOT = Path(__file__).parents[1]


def test_import_is_light():
    """Importing the package loads none of the heavy libraries; a name loads what it needs."""
    code = (
        "import sys, paraflex; "
        "heavy = {'numba', 'scipy', 'xarray', 'matplotlib', 'pydantic', 'rich'} & set(sys.modules); "
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", paraflex.__all__)
def test_public_names_exist(name):
    assert getattr(paraflex, name) is not None


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        paraflex.simulat  # noqa: B018


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_python_of_the_pages_runs(page, tmp_path, monkeypatch, capsys):
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    assert blocks
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    assert (tmp_path / "path.png").stat().st_size > 10_000
    # The block prints the tracking error in ++++; converged 6.288e-4 m, the default tolerance gives it to 1 %.
    assert float(capsys.readouterr().out) == pytest.approx(6.288e-4, rel=0.01)


def test_example_numbers(tmp_path, monkeypatch):
    spec = importlib.util.spec_from_file_location("example", ROOT / "examples" / "raparm_square.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    monkeypatch.chdir(tmp_path)
    errors = example.main()
    # Computed by an independent prototype of the same model; the default tolerance gives them to 1 %.
    assert errors["++++"] == pytest.approx(6.292e-4, rel=0.01)
    assert errors["+-+-"] == pytest.approx(4.796e-2, rel=0.01)


def test_nothing_reads_outside_the_project():
    """The project stands alone."""
    for folder in ("src", "tests", "benchmarks", "examples", "docs"):
        for file in (ROOT / folder).rglob("*"):
            if file.suffix in (".py", ".toml", ".md") and file != Path(__file__):
                assert "../shared" not in file.read_text(encoding="utf-8"), file
