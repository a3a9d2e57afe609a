"""Run the notebooks beside this file anew and keep their outputs: `python docs/notebooks/execute.py`."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).parent


def execute(path: Path, folder: str | Path) -> Any:
    """A notebook with the outputs of a run in a folder; nothing is written to the notebook's file."""
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(folder)}}
    # What a cell prints arrives in as many parts as it takes time: one output all the same.
    settings = {"timeout": 600, "kernel_name": "python3", "coalesce_streams": True}
    NotebookClient(notebook, resources=resources, **settings).execute()
    for cell in notebook.cells:
        cell.metadata = {}
        cell.pop("id", None)
        for output in cell.get("outputs", []):
            if "metadata" in output:
                output.metadata = {}
    notebook.metadata = {
        "kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"},
        "language_info": {"name": "python"},
    }
    notebook.nbformat_minor = 4  # cells without identifiers
    return notebook


def main() -> None:
    """Run all and write them back."""
    for path in sorted(HERE.glob("*.ipynb")):
        with tempfile.TemporaryDirectory() as folder:
            nbformat.write(execute(path, folder), path)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
