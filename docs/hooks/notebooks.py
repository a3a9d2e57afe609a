"""Notebooks as pages: text, code and the outputs that are kept in the file. Nothing is run here."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files


def on_files(files: Files, config: Any) -> Files:
    """Add a page for each notebook under docs/notebooks; the notebook itself can be downloaded beside it."""
    for path in sorted(Path(config.docs_dir, "notebooks").glob("*.ipynb")):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        images: dict[str, bytes] = {}
        text = "\n\n".join(_cell(cell, f"{path.stem}_{k}", images) for k, cell in enumerate(cells))
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=_with_link(text, path.name)))
        for name, content in images.items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
    return files


def _with_link(text: str, name: str) -> str:
    title, _, rest = text.partition("\n")
    return f"{title}\n\n*A notebook: [download it]({name}) and run it yourself.*\n{rest}"


def _cell(cell: dict[str, Any], name: str, images: dict[str, bytes]) -> str:
    source = _joined(cell["source"])
    if cell["cell_type"] == "markdown":
        return source
    outputs = [_output(output, f"{name}_{k}.png", images) for k, output in enumerate(cell["outputs"])]
    return "\n\n".join([f"```python\n{source}\n```", *outputs])


def _output(output: dict[str, Any], name: str, images: dict[str, bytes]) -> str:
    if output["output_type"] == "stream":
        return _fenced(_joined(output["text"]))
    data = output["data"]
    if "image/png" in data:
        images[name] = base64.b64decode(_joined(data["image/png"]))
        return f"![What the cell above draws]({name})"
    if "text/html" in data:
        return f'<div class="output">{_one_block(_joined(data["text/html"]))}</div>'
    return _fenced(_joined(data["text/plain"]))


def _fenced(text: str) -> str:
    return f"```text\n{text.rstrip()}\n```"


def _one_block(html: str) -> str:
    """HTML without empty lines, at which Markdown would take it for ended."""
    return "\n".join(line.strip() for line in html.splitlines() if line.strip())


def _joined(text: str | list[str]) -> str:
    return text if isinstance(text, str) else "".join(text)
