"""`paraflex new` and `paraflex schema`: a model file to start from, and the schema for editors to check it."""

import json
import re
from pathlib import Path

from paraflex.errors import OutputError, renamed
from paraflex.files import library_text, model_schema
from paraflex.writing import write_text
from .commands.models import NewRequest, SchemaRequest
from .tables import PlainConsole


def new_command(request: NewRequest) -> None:
    """Write a commented model file of the requested name, to be edited."""
    name, template = request.name, request.template
    with renamed("--from"):
        text = library_text(template)
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if path.exists():
        raise OutputError("already exists", field=str(path), remedy="choose another name, or remove it")
    text = re.sub(r'^name = ".*"$', lambda _: f"name = {json.dumps(path.stem)}", text, count=1, flags=re.MULTILINE)
    write_text(path, text, parents=False)
    console = PlainConsole()
    console.print_lines(f"{path}: a copy of {template} to edit. Then")
    console.print_lines(f"  paraflex info {path}\n  paraflex run {path}")


def schema_command(_: SchemaRequest) -> None:
    """Print the JSON Schema of model files."""
    print(json.dumps(model_schema(), indent=2))
