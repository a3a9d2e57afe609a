"""Minimal edits of the text of a TOML file: all that an edit is not about stays byte for byte as it is."""

import copy
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from paraflex.files.document import document_text
from paraflex.files.fields import Place, value_at
from paraflex.files.schema import ModelTable
from .spans import Entry, data_of, entries_of

_COMMA = re.compile(r"\s*,[ \t]*")
_BLANK_LINES = re.compile(r"(?:[ \t]*\r?\n)+")
_BARE = re.compile(r"[A-Za-z0-9_-]+\Z")
# Order of tables in files: that of the schema.
_ORDER = list(ModelTable.model_fields)


def written(value: Any, *, exact: bool = False) -> str:
    """Return a value as TOML in one line; numbers are rounded to the digits of a drawing unless they are exact."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(value) if exact else number_text(value)
    if isinstance(value, Mapping):
        members = [f"{key_text(key)} = {written(each, exact=exact)}" for key, each in value.items()]
        return f"{{ {', '.join(members)} }}" if members else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(written(each, exact=exact) for each in value)}]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f") if isinstance(value, str) else str(value)


def number_text(value: float) -> str:
    """Return a number with six decimals, or with five digits if it is small."""
    if abs(value) < 1e-12:
        return "0.0"
    return repr(round(value, 6)) if abs(value) >= 0.1 else repr(float(f"{round(value, 9):.5g}"))


def key_text(key: str) -> str:
    """Return a key, in quotes if it needs them."""
    return key if _BARE.match(key) else written(key)


def with_value(text: str, place: Sequence[str | int], value: str) -> str:
    """Write a value, given as TOML, at a place; the tables on the way there are added where they are missing."""
    place = tuple(place)
    entry = _entry(text, place)
    if entry is not None:
        edited = text[: entry.value[0]] + value + text[entry.value[1] :]
    elif value_at(data_of(text), place) is not None:
        edited = ""  # a table over several headers or dotted keys, which is written anew
    else:
        edited = _with_new(text, place, value)
    return _checked(text, edited, place, data_of(f"value = {value}")["value"])


def with_table(text: str, place: Sequence[str], table: Mapping[str, Any], *, exact: bool = False) -> str:
    """Add a table with a header of its own behind the others of its kind."""
    members = [f"{key_text(key)} = {written(one, exact=exact)}" for key, one in table.items()]
    edited = _with_section(text, tuple(place), [f"[{'.'.join(map(key_text, place))}]", *members])
    return _checked(text, edited, tuple(place), data_of(f"value = {written(table, exact=exact)}")["value"])


def with_item(text: str, place: Sequence[str | int], value: str) -> str:
    """Append an item, given as TOML, to the list at a place; the list is added if it is missing."""
    entry, old = _entry(text, tuple(place)), value_at(data_of(text), place)
    if entry is None or not old:
        return with_value(text, place, f"[{value}]")
    last = _entry(text, (*place, len(old) - 1))
    assert last is not None
    edited = text[: last.whole[1]] + f", {value}" + text[last.whole[1] :]
    return _checked(text, edited, tuple(place), [*old, data_of(f"value = {value}")["value"]])


def without(text: str, place: Sequence[str | int]) -> str:
    """Remove the value or table at a place, and tables that are empty then."""
    place, data = tuple(place), data_of(text)
    if value_at(data, place) is None:
        return text
    found = [one for one in entries_of(text) if one.place[: len(place)] == place]
    cuts = [_cut(text, one) for one in found if one.place == place or one.kind in ("header", "pair")]
    edited = text
    for start, end in reversed(_joined(cuts)):
        edited = _closed(edited[:start], edited[end:])
    edited = _checked(text, edited, place)
    above = place[:-1]
    rest = value_at(data_of(edited), above) if above else 0
    empty = rest == [] or (rest == {} and isinstance(above[-1], str) and (len(above) != 2 or above[0] == "assembly"))
    return without(edited, above) if empty else edited


def renamed(text: str, place: Sequence[str | int], name: str) -> str:
    """Give the key at a place another name, in all headers and dotted keys that contain it."""
    place = tuple(place)
    spans: list[tuple[int, int]] = []
    for one in entries_of(text):
        at = len(place) - 1 - _outside(one)
        if one.place[: len(place)] == place and 0 <= at < len(one.keys):
            spans.append(one.keys[at])
    for start, end in sorted(set(spans), reverse=True):
        text = text[:start] + key_text(name) + text[end:]
    return text


def _entry(text: str, place: Place) -> Entry | None:
    """Return the entry with the value of a place; None if there is none, or headers or dotted keys make it up."""
    return next((one for one in entries_of(text) if one.place == place and one.kind != "header"), None)


def _outside(entry: Entry) -> int:
    """Return the number of parts of a place that headers or values outside of the entry give."""
    return len(entry.place) - len(entry.keys)


def _newline(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def _with_new(text: str, place: Place, value: str) -> str:
    above, entries = place[:-1], entries_of(text)
    line = f"{key_text(str(place[-1]))} = {value}"
    inline = _entry(text, above) if above else None
    if inline is not None:
        members = [one.whole[1] for one in entries if one.kind == "member" and one.place[: len(above)] == above]
        start, end = inline.value
        if not members:
            return text[:start] + f"{{ {line} }}" + text[end:]
        return text[: max(members)] + f", {line}" + text[max(members) :]
    header = next((one for one in entries if one.kind == "header" and one.place == above), None)
    if header is not None or not above:
        section = -1 if header is None else header.section
        own = [one for one in entries if one.kind == "pair" and one.section == section]
        return _with_line(text, own[-1] if own else header, line)
    dotted = [one for one in entries if one.kind == "pair" and _outside(one) < len(above) < len(one.place)
              and one.place[: len(above)] == above]  # fmt: skip
    if dotted:
        keys = dotted[-1].keys
        shared = text[keys[0][0] : keys[len(above) - _outside(dotted[-1]) - 1][1]]
        return _with_line(text, dotted[-1], f"{shared}.{line}")
    explicit = any(one.place == above[:-1] and one.kind != "item" for one in entries)
    if len(above) > 1 and explicit:
        return _with_new(text, above, f"{{ {line} }}")
    return _with_section(text, above, [f"[{'.'.join(map(key_text, map(str, above)))}]", line])


def _with_line(text: str, behind: Entry | None, line: str) -> str:
    """Insert a line behind an entry, with its indentation; without an entry at the top of the file."""
    newline = _newline(text)
    if behind is None:
        return line + newline + (newline if text.strip() else "") + text
    start, end = behind.whole
    before = text[:end] if text[:end].endswith("\n") else text[:end] + newline
    indentation = re.match(r"[ \t]*", text[start:end])
    assert indentation is not None
    return before + indentation[0] + line + newline + text[end:]


def _with_section(text: str, place: Place, lines: list[str]) -> str:
    """Insert the lines of a table behind the last table of its group, or of the groups that come before it."""
    newline, rank = _newline(text), _rank(place)
    tops = [one for one in entries_of(text) if one.kind in ("header", "pair")]
    same = [one for one in tops if one.place[0] == place[0]]
    before = same or [one for one in tops if one.section < 0 or _rank(one.place) <= rank]
    headers = [one.section for one in tops]
    end = max((one.whole[1] for one in tops if one.section == before[-1].section), default=0) if before else 0
    after = re.compile(r"(?:[ \t]*#[^\n]*\n)+(?=\r?\n|\Z)").match(text, end)
    end = after.end() if after and headers else end
    head = text[:end] + ("" if not end or text[:end].endswith("\n") else newline) + (newline if end else "")
    tail = text[end:]
    gap = newline if tail and not re.match(r"[ \t]*\r?\n", tail) else ""
    return head + newline.join(lines) + newline + gap + tail


def _rank(place: Place) -> int:
    return _ORDER.index(str(place[0])) if place[0] in _ORDER else len(_ORDER)


def _cut(text: str, entry: Entry) -> tuple[int, int]:
    """Return the span to remove with an entry: its lines, or the member or item with one comma."""
    start, end = entry.whole
    if entry.kind in ("header", "pair"):
        return (_with_comment(text, entry) if entry.kind == "header" else start), end
    if behind := _COMMA.match(text, end):
        return start, behind.end()
    before = re.search(r",\s*\Z", text[:start])
    return (before.start() if before else start), end


def _with_comment(text: str, header: Entry) -> int:
    """Return the start of the comment directly above a header if it is about this table alone, or of the header."""
    start = header.whole[0]
    following = next((one for one in entries_of(text) if one.kind == "header" and one.section > header.section), None)
    if following is not None and following.place[0] == header.place[0]:
        return start
    above = re.compile(r"(?:\A|(?<=\n))(?:[ \t]*#[^\n]*\n)+\Z").search(text[:start])
    return (
        above.start() if above and (not above.start() or text[: above.start()].endswith(("\n\n", "\n\r\n"))) else start
    )


def _joined(cuts: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    joined: list[tuple[int, int]] = []
    for start, end in sorted(cuts):
        if joined and start <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(end, joined[-1][1])
        else:
            joined.append((start, end))
    return joined


def _checked(text: str, edited: str, place: Place, value: Any = None) -> str:
    """Return an edited text if it has the data asked for; else the data are written by `document_text`."""
    data = copy.deepcopy(data_of(text))
    _put(data, place, value)
    try:
        found = data_of(edited)
        if edited and (found == data if value is not None else _filled(found) == _filled(data)):
            return edited
    except ValueError:
        pass
    return document_text(data, text)


def _closed(head: str, tail: str) -> str:
    """Join what is left around a cut, with the blank lines on one side of it only."""
    if not head or head.endswith(("\n\n", "\n\r\n")):
        blank = _BLANK_LINES.match(tail)
        tail = tail[blank.end() :] if blank else tail
        head = head if tail else re.sub(r"(?:\r?\n[ \t]*)+\Z", _newline(head), head)
    return head + tail


def _filled(data: Any) -> Any:
    """Return data without empty tables: a super-table ends with its last table."""
    inner = {key: _filled(each) for key, each in data.items()} if isinstance(data, dict) else data
    return {key: each for key, each in inner.items() if each != {}} if isinstance(inner, dict) else inner


def _put(data: Any, place: Place, value: Any) -> None:
    """Write a value into data, or remove it if it is None."""
    for key in place[:-1]:
        data = data.setdefault(key, {}) if isinstance(data, dict) else data[key]
    if value is None:
        del data[place[-1]]
    elif isinstance(data, dict):
        data[place[-1]] = value
    else:
        data[int(place[-1])] = value
