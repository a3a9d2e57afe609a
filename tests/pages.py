"""Fenced blocks of a page, run one after the other as a reader would, and what they print held against the page."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from paraflex.cli.app import main
from paraflex.files import library_names, library_text

# Numbers shown on a page: the default tolerance gives tracking errors to 1 %, and many are rounded to two digits.
TOLERANCE = 0.01
# Counts of steps: where links vibrate, error control takes some per cent more or fewer as processors round otherwise.
COUNTS, MANY = 0.2, 500.0

_FENCE = re.compile(
    r"(?:<!-- (?P<note>[^\n]*?) -->\n)?^```(?P<language>\w*)(?: title=\"(?P<title>[^\"]*)\")?\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
# Frames of tables, which depend on how wide the terminal is.
_FRAME = re.compile(r"[\u2500-\u257f]+")


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, title, text, and the comment right above it."""

    language: str
    title: str
    text: str
    note: str


def blocks_of(page: Path) -> list[Block]:
    """All fenced blocks of a page, in order; fences are counted so that none is missed."""
    text = page.read_text(encoding="utf-8")
    found = [
        Block(*(match[part] or "" for part in ("language", "title", "text", "note"))) for match in _FENCE.finditer(text)
    ]
    assert 2 * len(found) == len(re.findall(r"^\s*```", text, flags=re.MULTILINE)), f"{page}: a block is not seen"
    return found


def run_page(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    """Run all blocks of a page in a folder; how many were run.

    Python blocks share their names. Of a shell block every line is a `paraflex` command. A `diff` block edits the
    file of its title, a `toml` block with a title is added to that file, one without must stand in a file of the
    folder or of the library. A `text` block is what the block above printed. A block of another kind, or one that is
    not to be run, has a comment above it that says so: `<!-- not run: REASON -->`.
    """
    count, names = 0, {}
    for block, printed in _blocks_run(page, folder, monkeypatch, names):
        if block.language == "text":
            check_output(block.text, printed, last_differs=block.note == "last column differs")
        count += block.language in ("python", "sh")
    text = page.read_text(encoding="utf-8")
    for what, shown in marks_of_run(text):
        _, form, expression = what.split(maxsplit=2)
        now = format(eval(expression, names), form)
        assert _same_word(shown, now), f"{page.name}: shown {shown!r}, now {now!r}: {expression}"
    return count


def marks_of_run(text: str) -> list[tuple[str, str]]:
    """Numbers of a text that follow from its blocks, `<!--=run FORMAT EXPRESSION-->NUMBER<!--/-->`: mark, number."""
    return re.findall(r"<!--=(run [^>]+?)-->(.*?)<!--/-->", text)


def refreshed(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, filled: Any) -> str:
    """A page that shows what its blocks print now; `filled` puts numbers between marks, given the names of the blocks.

    Raises
    ------
    AssertionError
        A line that is shown is printed no more: words are for a person to change.
    """
    text, names = page.read_text(encoding="utf-8"), {}
    for block, printed in _blocks_run(page, folder, monkeypatch, names):
        if block.language == "text":
            text = text.replace(f"```text\n{block.text}```", f"```text\n{with_numbers_of(block.text, printed)}```", 1)
    return filled(text, names)


def with_numbers_of(shown: str, printed: str) -> str:
    """Lines as shown with the numbers of the lines that were printed."""
    rest, lines = [line for line in printed.splitlines() if _tokens(line)], []
    for line in shown.splitlines():
        words = [_NUMBER.sub("#", word) for word in _tokens(line)]
        if words and words != ["..."]:
            while rest and [_NUMBER.sub("#", word) for word in _tokens(rest[0])] != words:
                rest.pop(0)
            assert rest, f"shown {line!r}, printed:\n{printed}"
            numbers = iter(_NUMBER.findall(" ".join(_tokens(rest.pop(0)))))
            line = _NUMBER.sub(lambda _, numbers=numbers: next(numbers), line)
        lines.append(line)
    return "\n".join([*lines, ""])


def _blocks_run(
    page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, names: dict[str, Any]
) -> Iterator[tuple[Block, str]]:
    """Blocks of a page one after the other, and what the last that was run has printed.

    The names are those of Python's blocks, and `printed_number`: of what a pattern found in all output.
    """
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "80")
    printed, all_printed = "", []
    names["printed_number"] = lambda pattern: float(re.search(pattern, "\n".join(all_printed))[1])
    for before, block in pairwise([None, *blocks_of(page)]):
        assert block is not None
        if block.note.startswith("not run: "):
            continue
        if block.language == "python":
            printed = _run_python(block.text, page.name, names)
        elif block.language == "sh":
            printed = _run_shell(block.text)
        elif block.language == "text":
            assert before is not None
            assert before.language in ("python", "sh"), block
        elif block.language == "diff":
            apply_diff(folder / block.title, block.text)
        elif block.language == "toml":
            _append_or_find(folder, block)
        else:
            pytest.fail(f"{page.name}: a block that is neither run nor marked: {block}")
        all_printed.append(printed)
        yield block, printed


def check_output(shown: str, printed: str, *, last_differs: bool = False) -> None:
    """Lines as shown, in order; `...` stands for any lines; numbers within `TOLERANCE`, or a last digit shown."""
    actual = [tokens for line in printed.splitlines() if (tokens := _tokens(line))]
    position, skipping = 0, False
    for line in shown.splitlines():
        tokens = _tokens(line)
        if not tokens:
            continue
        if tokens == ["..."]:
            skipping = True
            continue
        while skipping and position < len(actual) and not _same(tokens, actual[position], last_differs):
            position += 1
        found = actual[position] if position < len(actual) else None
        assert found is not None, f"shown {line!r}, printed:\n{printed}"
        assert _same(tokens, found, last_differs), f"shown {line!r}, printed:\n{printed}"
        position, skipping = position + 1, False
    assert skipping or position == len(actual), f"more was printed:\n{printed}"


def _same(shown: list[str], printed: list[str], last_differs: bool) -> bool:
    if last_differs and _NUMBER.fullmatch(shown[-1]):
        shown, printed = shown[:-1], printed[:-1]
    return len(shown) == len(printed) and all(_same_word(a, b) for a, b in zip(shown, printed, strict=True))


def _same_word(shown: str, printed: str) -> bool:
    if _NUMBER.sub("#", shown) != _NUMBER.sub("#", printed):
        return False
    pairs = zip(_NUMBER.findall(shown), _NUMBER.findall(printed), strict=True)
    return all(abs(float(a) - float(b)) <= max(_within(a) * abs(float(a)), 1.01 * last_digit(a)) for a, b in pairs)


def _within(number: str) -> float:
    return COUNTS if number.isdigit() and float(number) > MANY else TOLERANCE


def last_digit(number: str) -> float:
    """What one more in the last digit of a number is worth, zero for an integer."""
    mantissa, _, exponent = number.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals) if decimals else 0.0


def _tokens(line: str) -> list[str]:
    return _FRAME.sub(" ", line).split()


def _run_python(text: str, name: str, names: dict[str, Any]) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(text, name, "exec"), names)
    return out.getvalue()


def _run_shell(text: str) -> str:
    """What commands print, on both streams."""
    out = io.StringIO()
    for line in text.splitlines():
        words = shlex.split(line, comments=True)
        assert words[:1] == ["paraflex"], f"not a command of ours: {line!r}"
        with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            patch.setattr(sys, "argv", words)
            with contextlib.suppress(SystemExit):
                main()
    return out.getvalue()


def apply_diff(path: Path, diff: str) -> None:
    """Change a file as a diff says: hunks of lines that stand there (blank or minus first) and of what they become.

    The last line of a hunk may be cut short. One of plus lines alone goes below the file's first line. Hunks are parted
    by `@@`, or where a minus follows a plus.
    """
    text = path.read_text(encoding="utf-8")
    for hunk in _hunks(diff.splitlines()):
        old = "\n".join(line[1:] for line in hunk if line[0] != "+")
        new = "\n".join(line[1:] for line in hunk if line[0] != "-")
        assert f"\n{old}" in text, f"{path.name} does not have\n{old}"
        text = text.replace(f"\n{old}", f"\n{new}" if old else f"\n{new}\n", 1)
    path.write_text(text, encoding="utf-8")


def _hunks(lines: list[str]) -> list[list[str]]:
    hunks: list[list[str]] = [[]]
    for line in lines:
        if line == "@@" or (line[0] == "-" and hunks[-1] and hunks[-1][-1][0] == "+"):
            hunks.append([])
        if line != "@@":
            hunks[-1].append(line)
    return hunks


def _append_or_find(folder: Path, block: Block) -> None:
    if block.title:
        path = folder / block.title.partition(",")[0]
        with path.open("a", encoding="utf-8") as file:
            file.write(f"\n{block.text}")
    else:
        texts = [path.read_text(encoding="utf-8") for path in folder.glob("*.toml")]
        texts += [library_text(name) for name in library_names()]
        assert any(block.text in text for text in texts), f"stands in no file:\n{block.text}"
