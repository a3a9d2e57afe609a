"""The reference of the model file, from the schema that files are checked by."""

from __future__ import annotations

import re
from typing import Any

from mkdocs.structure.files import File, Files

from paraflex.files import model_schema

PAGE = "reference/model-file.md"
EXPLAINED = "../model-file-tables.md"

HEAD = """# The model file, field by field

This page is made from the schema that files are checked by; `paraflex schema` prints the same as JSON Schema, for
editors. [Tables of the model file](../model-file-tables.md) explains the tables with examples, limits and remarks;
[Your own mechanism](../model-file.md) is a guide to writing a file.

Plain numbers are in SI units and radians. Wherever a *number* may stand, so may one with a unit, `"80 mm"`, and an
expression in quotes, `"l1 - 0.5 * l2"`: of numbers, names from `[parameters]`, `pi`, `+ - * / **`, brackets, and of one
argument `sin cos tan asin acos atan sinh cosh tanh exp log sqrt`. Where *of the time* is said it may hold
`t` as well. NAME stands for one that you choose.

"""


def on_files(files: Files, config: Any) -> Files:
    """Add the page."""
    files.append(File.generated(config, PAGE, content=file_format_page()))
    return files


def file_format_page() -> str:
    """All tables of a model file in the order of the schema: a section each, a row a field."""
    schema = model_schema()
    writer = _Writer(schema["$defs"])
    plain = {name: field for name, field in schema["properties"].items() if not writer.tables(field)}
    tables = {name: field for name, field in schema["properties"].items() if writer.tables(field)}
    parts = [HEAD, f"## Top level\n\n{_explained('top-level')}", writer.fields(plain, schema.get("required", []))]
    for name, field in tables.items():
        kinds = writer.tables(field)
        if len(kinds) > 1:
            where = _explained(_slug(_named(name, field)))
            parts.append(f"## {name}\n\n{_sentence(field.get('description', ''))}{where}")
        parts += [writer.table(name, field, kind, "###" if len(kinds) > 1 else "##") for kind in kinds]
    return "".join(parts) + writer.nested()


class _Writer:
    """Writes tables; remembers those that stand within fields of others, to write them at the end."""

    def __init__(self, definitions: dict[str, Any]) -> None:
        self.definitions = definitions
        self.inner: list[str] = []

    def tables(self, field: dict[str, Any]) -> list[str]:
        """Names of the definitions that a field at top level is made of."""
        inside = field.get("additionalProperties")
        found = _references(inside if isinstance(inside, dict) else field)
        return [name for name in found if self.definitions[name].get("type") == "object"]

    def table(self, name: str, field: dict[str, Any], kind: str, level: str) -> str:
        """One kind of a table, under its heading."""
        definition = self.definitions[kind]
        named = _named(name, field)
        tag = definition.get("properties", {}).get("type", {}).get("const")
        told = f', type = "{tag}"' if tag else ""
        head = f"{level} `[{named}]`{told}\n\n{_sentence(definition.get('description', ''))}"
        if level == "##":
            head += _explained(_slug(named))
        return head + self.fields(definition.get("properties", {}), definition.get("required", []), skip_type=bool(tag))

    def fields(self, properties: dict[str, Any], required: list[str], *, skip_type: bool = False) -> str:
        """A row a field: name, what it holds, default, meaning."""
        rows = [
            f"| `{name}` | {self.kind(field)} | {_default(field, name in required)} | {_meaning(field)} |"
            for name, field in properties.items()
            if not (skip_type and name == "type")
        ]
        return "| Field | Holds | Default | Meaning |\n|---|---|---|---|\n" + "\n".join(rows) + "\n\n"

    def kind(self, field: dict[str, Any]) -> str:
        """What a field holds, in words."""
        if "$ref" in field:
            name = field["$ref"].rsplit("/", 1)[-1]
            if name not in self.inner:
                self.inner.append(name)
            return f"[table](#{_anchor(name)})"
        if "const" in field or "enum" in field:
            return " or ".join(f'`"{value}"`' for value in field.get("enum", [field.get("const")]))
        if "anyOf" in field or "oneOf" in field:
            kinds = [self.kind(option) for option in field.get("anyOf", field.get("oneOf", []))]
            kinds = [kind for kind in dict.fromkeys(kinds) if kind != "nothing"]
            return "number" if set(kinds) == {"number", "text"} else " or ".join(kinds)
        if field.get("type") == "array":
            return self._array(field)
        if field.get("type") == "object":
            inside = field.get("additionalProperties")
            return f"table: name = {self.kind(inside)}" if isinstance(inside, dict) else "table: name = number"
        names = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}
        return names.get(field.get("type", ""), "nothing" if field.get("type") == "null" else "number")

    def _array(self, field: dict[str, Any]) -> str:
        least, most = field.get("minItems"), field.get("maxItems")
        inside = self.kind(field.get("items", {}))
        many = re.sub(r"^(number|text|table|list|whole number)\b", r"\1s", inside)
        if least is not None and least == most:
            return f"{least} {many}"
        return f"list of {many}" if least is None or most is None else f"list of {least} to {most} {many}"

    def nested(self) -> str:
        """The tables that stand within others."""
        parts = ["## Tables within tables\n\n"]
        done: set[str] = set()
        while left := [name for name in self.inner if name not in done]:
            for name in left:
                done.add(name)
                definition = self.definitions[name]
                parts.append(f"### {_title(name)}\n\n{_sentence(definition.get('description', ''))}")
                parts.append(self.fields(definition.get("properties", {}), definition.get("required", [])))
        return "".join(parts)


def _references(field: Any) -> list[str]:
    """Definitions that a field refers to, wherever in it but in lists."""
    if not isinstance(field, dict) or field.get("type") == "array":
        return []
    if "$ref" in field:
        return [field["$ref"].rsplit("/", 1)[-1]]
    options = [*field.get("anyOf", []), *field.get("oneOf", [])]
    return [name for option in options for name in _references(option)]


def _named(name: str, field: dict[str, Any]) -> str:
    """Return the name of a table as files write it."""
    return f"{name}.NAME" if "additionalProperties" in field else name


def _slug(named: str) -> str:
    """Return the anchor of the heading of a table on the page `EXPLAINED`."""
    return re.sub(r"[^\w-]", "", named.lower())


def _explained(anchor: str) -> str:
    """Return the link to the section with an example and remarks."""
    return f"[Example and remarks]({EXPLAINED}#{anchor})\n\n"


def _title(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", " ", name.removesuffix("Table")).capitalize()


def _anchor(name: str) -> str:
    return _title(name).lower().replace(" ", "-")


def _default(field: dict[str, Any], required: bool) -> str:
    if required:
        return "*needed*"
    value = field.get("default")
    if value in (None, "", [], {}):
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else value!r}`".replace("'", '"')


def _meaning(field: dict[str, Any]) -> str:
    return _escape(field.get("description", ""))


def _sentence(text: str) -> str:
    return f"{_escape(text[:1].upper() + text[1:])}\n\n" if text else ""


def _escape(text: str) -> str:
    return re.sub(r"(\[[^\]]*\])", r"`\1`", " ".join(text.split())).replace("|", r"\|").replace("*", r"\*")
