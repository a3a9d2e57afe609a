"""The notebooks of the documentation run, and give the numbers that they show."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest

from pages import check_output
from paraflex.kernel.notice import NOTICE

NOTEBOOKS = Path(__file__).parents[1] / "docs" / "notebooks"
# Kept in the repository and loaded by whoever reads the page.
LARGEST = 400_000


def names():
    return sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb"))


@pytest.fixture(scope="module")
def execute():
    spec = importlib.util.spec_from_file_location("execute_notebooks", NOTEBOOKS / "execute.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.execute


def test_there_are_four():
    assert names() == ["closed_loop", "raparm_i", "redundancy", "thickness"]


@pytest.mark.filterwarnings("default")  # of the libraries that run notebooks
@pytest.mark.parametrize("name", names())
def test_a_notebook_runs_and_gives_what_it_shows(name, execute, tmp_path, monkeypatch):
    # The kernel is to be the Python that runs the tests, whatever is registered under its name.
    monkeypatch.setenv("JUPYTER_PREFER_ENV_PATH", "1")
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    assert sys.executable
    path = NOTEBOOKS / f"{name}.ipynb"
    assert path.stat().st_size < LARGEST
    kept = outputs(json.loads(path.read_text(encoding="utf-8")))
    new = outputs(execute(path, tmp_path))
    assert len(kept) == len(new)
    assert kept
    for before, after in zip(kept, new, strict=True):
        assert kinds(before) == kinds(after)
        if "image/png" not in kinds(after):
            check_output(text(before), text(after))


def outputs(notebook):
    """All but the notice of a notebook that is the first to need a kernel."""
    found = [output for cell in notebook["cells"] for output in cell.get("outputs", [])]
    return [output for output in found if NOTICE not in "".join(output.get("text", ""))]


def kinds(output):
    return sorted(output.get("data", {"stream": None}))


def text(output):
    found = output["text"] if output["output_type"] == "stream" else output["data"]["text/plain"]
    return found if isinstance(found, str) else "".join(found)
