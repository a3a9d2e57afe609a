"""Spans of keys, values and tables in the text of a TOML file that `tomllib` accepts."""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from paraflex.files.fields import Place
from paraflex.files.read import parse_toml

_BLANK = re.compile(r"[ \t]*")
_BETWEEN = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_TO_LINE_END = re.compile(r"[^\n]*(?:\n|\Z)")
# Strings of several lines come first, because their quotes begin like those of short ones.
_STRING = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'', re.DOTALL
)  # fmt: skip
_SCALAR = re.compile(r"[^,\]}#\r\n]*[^,\]}#\s]")
_BARE = re.compile(r"[A-Za-z0-9_-]+")

Span = tuple[int, int]


@dataclass(frozen=True)
class Entry:
    """Header of a table, key with its value, or item of a list.

    Attributes
    ----------
    kind : str
        "header", "pair", "member" (a pair of an inline table) or "item" (of a list).
    place : tuple
        Keys and indices from the top of the file.
    keys : tuple of spans
        Spans of the last parts of the place that are written here; empty for an item.
    value : span
        Span of the value; for a header that of its line.
    whole : span
        Span of the lines of a header or pair, or of a member or item without its comma.
    section : int
        Start of the header under which the entry stands; -1 above the first.
    """

    kind: str
    place: Place
    keys: tuple[Span, ...]
    value: Span
    whole: Span
    section: int


@lru_cache(maxsize=16)
def data_of(text: str) -> dict[str, Any]:
    """Return the data of a text, not to be modified; see `parse_toml` for the errors."""
    return parse_toml(text)


@lru_cache(maxsize=16)
def entries_of(text: str) -> tuple[Entry, ...]:
    """Return all entries of a text in their order; those inside a value follow the entry of that value."""
    return tuple(_entries(text))


def _entries(text: str) -> Iterator[Entry]:
    at, table, section = 0, (), -1
    counts: dict[Place, int] = {}
    while (at := _end(_BETWEEN, text, at)) < len(text):
        start = text.rfind("\n", 0, at) + 1
        if text[at] == "[":
            listed = text.startswith("[[", at)
            names, keys, end = _key(text, at + 1 + listed)
            table, section = _indexed(names, counts), start
            if listed:
                counts[table] = counts.get(table, -1) + 1
                table = (*table, counts[table])
            line_end = _end(_TO_LINE_END, text, end)
            yield Entry("header", table, keys, (at, end + 1 + listed), (start, line_end), section)
        else:
            names, keys, end = _key(text, at)
            begin = _end(_BLANK, text, end + 1)
            inner = list(_value(text, begin, (*table, *names), section))
            value = inner.pop().value
            line_end = _end(_TO_LINE_END, text, value[1])
            yield Entry("pair", (*table, *names), keys, value, (start, line_end), section)
            yield from inner
        at = line_end


def _indexed(names: Place, counts: dict[Place, int]) -> Place:
    """Return a place with the indices of the lists of tables that it leads through."""
    place: Place = ()
    for name in names:
        if place in counts:
            place = (*place, counts[place])
        place = (*place, name)
    return place


def _key(text: str, at: int) -> tuple[Place, tuple[Span, ...], int]:
    """Return the parts of a key, their spans, and the position behind it: that of "=" or "]"."""
    names: list[str] = []
    spans: list[Span] = []
    while True:
        at = _end(_BLANK, text, at)
        end = _end(_STRING if text[at] in "\"'" else _BARE, text, at)
        spans.append((at, end))
        names.append(plain_key(text[at:end]))
        at = _end(_BLANK, text, end)
        if text[at] != ".":
            return tuple(names), tuple(spans), at
        at += 1


def plain_key(written: str) -> str:
    """Return the name that a part of a key stands for."""
    return next(iter(tomllib.loads(f"{written} = 0"))) if written[0] in "\"'" else written


def _value(text: str, at: int, place: Place, section: int) -> Iterator[Entry]:
    """Yield the entries inside a value, and at last one with the span of the value itself."""
    opening = text[at]
    if opening not in "[{":
        end = _end(_STRING if opening in "\"'" else _SCALAR, text, at)
        yield Entry("item", place, (), (at, end), (at, end), section)
        return
    start, at, number = at, _end(_BETWEEN, text, at + 1), 0
    while text[at] not in "]}":
        names, keys, begin = ((number,), (), at) if opening == "[" else _key(text, at)
        if opening == "{":
            begin = _end(_BLANK, text, begin + 1)
        inner = list(_value(text, begin, (*place, *names), section))
        value = inner.pop().value
        yield Entry("item" if opening == "[" else "member", (*place, *names), keys, value, (at, value[1]), section)
        yield from inner
        at, number = _end(_BETWEEN, text, value[1]), number + 1
        if text[at] == ",":
            at = _end(_BETWEEN, text, at + 1)
    yield Entry("item", place, (), (start, at + 1), (start, at + 1), section)


def _end(pattern: re.Pattern[str], text: str, at: int) -> int:
    found = pattern.match(text, at)
    assert found is not None, f"no TOML at position {at}"
    return found.end()
