"""Docstrings keep the rules that a test can hold: how they open, items with descriptions, words that are not used."""

import ast
import re
from pathlib import Path

import pytest

import paraflex

PACKAGE = Path(paraflex.__file__).parent
# A docstring names a thing or says what a function does; a sentence that begins so has no subject.
OPENINGS = {
    "Of", "What", "That", "Those", "Which", "Nothing", "None,", "None:", "As", "Its", "It", "For", "With", "Where",
    "By", "In", "Such", "Who", "Whose", "To", "Itself", "Themselves", "Also", "Not", "So", "From", "How", "If",
}  # fmt: skip
# Words of this package for which the field has its own.
WORDS = re.compile(
    r"\b(told|tells|said|says|saying|seldom|lasting|unsettled|mend|mends|mended)\b|(?<!strain )\bgauges?\b"
)
_LISTS = ("Parameters", "Other Parameters", "Attributes", "Returns", "Yields", "Raises")
_SECTIONS = (*_LISTS, "Notes", "Examples", "References", "See Also")


def items(docstring):
    """Items of the lists of a docstring: section, name, description."""
    lines, section, found = docstring.splitlines(), "", []
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if line.strip() in _SECTIONS and below.strip() and set(below.strip()) == {"-"}:
            section = line.strip()
        elif section in _LISTS and line.strip() and set(line.strip()) != {"-"}:
            if not line.startswith(" "):
                found.append([section, line, ""])
            elif found:
                found[-1][2] = f"{found[-1][2]} {line.strip()}".strip()
    return found


def faults(docstring):
    texts = [docstring.strip(), *(text for *_, text in items(docstring) if text)]
    yield from (f"opens with {text.split()[0]}: {text[:60]}" for text in texts if text.split()[0] in OPENINGS)
    yield from (f"{name} has no description" for section, name, text in items(docstring)
                if not text and section in ("Parameters", "Other Parameters", "Attributes"))  # fmt: skip
    yield from (f"the word {word}" for word in WORDS.findall(docstring))


@pytest.mark.parametrize("room", sorted({file.relative_to(PACKAGE).parts[0] for file in PACKAGE.rglob("*.py")}))
def test_docstrings_keep_the_rules(room):
    files = [PACKAGE / room] if room.endswith(".py") else sorted((PACKAGE / room).rglob("*.py"))
    found = []
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
                where = f"{file.relative_to(PACKAGE)}:{getattr(node, 'lineno', 1)}"
                found += [f"{where}: {fault}" for fault in faults(text)]
    assert found == []


def test_faults_are_found():
    bad = "Of a run.\n\nParameters\n----------\nt : array\nq : array\n    What is told."
    assert list(faults(bad)) == [
        f"opens with Of: {bad[:60]}", "opens with What: What is told.", "t : array has no description", "the word told",
    ]  # fmt: skip
