"""The table of codes on the page of findings, from the table in the code."""

from __future__ import annotations

from typing import Any

from paraflex.findings import CODES, Level

MARK = "<!-- codes of level {} -->"


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put the codes of each level where the page marks them."""
    if page.file.src_uri != "findings.md":
        return markdown
    for level in Level:
        markdown = markdown.replace(MARK.format(level.value), table(level))
    return markdown


def table(level: Level) -> str:
    """Codes of a level and what they mean."""
    rows = [f"| `{name}` | {code.meaning} |" for name, code in CODES.items() if code.level is level]
    return "\n".join(["| code | when |", "|---|---|", *rows])
