"""Data as TOML: a text that keeps the comments, the order and the spelling of the file that the data come from."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from typing import Any

import tomlkit
from tomlkit.container import OutOfOrderTableProxy
from tomlkit.items import Item, Key, Table, Whitespace

from paraflex.files.merge import order_of, same

# What a table holds, in order: members, and without a key comments and blank lines.
_Body = list[tuple[Key | None, Item]]

# Longer rows of lists or tables are written a line each.
_LONGEST = 100


def document_text(data: Mapping[str, Any], text: str = "") -> str:
    """Data as TOML, from which `tomllib` reads them again.

    Parameters
    ----------
    data : mapping
        Texts, numbers, truth values, and lists and mappings of these.
    text : str
        A file that holds other data. What is alike stays as it is written there, comments and all.
    """
    written = _written(data, text)
    found = tomllib.loads(written)
    # Where a table cannot be changed in place it is written anew, without its comments: where something differs, or is
    # of another order; of a body's own fields, and of the file's tables, any will do.
    differing = {
        key
        for key in found.keys() | data.keys()
        if found.get(key) != data.get(key) or (isinstance(data[key], dict) and list(found[key]) != list(data[key]))
    }
    return _written(data, text, differing) if differing else written


def _written(data: Mapping[str, Any], text: str, anew: Collection[str] = ()) -> str:
    document, old = tomlkit.parse(text), tomllib.loads(text)
    for key in anew:
        if key in old:
            _take_out(document, key)
    _update(document, {key: value for key, value in old.items() if key not in anew}, data)
    return tomlkit.dumps(document).lstrip("\n")


def _update(container: Any, old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    """Change a table of a document that holds old data into one of new data."""
    if isinstance(container, OutOfOrderTableProxy) and list(old) != list(new):
        return  # its parts stand in several places, and only what they hold can be changed
    for key in old:
        if key not in new:
            _take_out(container, key)
    for key, value in new.items():
        if key not in old:
            _append(container, key, _item(value, block=_has_headers(container)))
        elif not same(old[key], value):
            _change(container, key, old[key], value)
    if isinstance(container, tomlkit.TOMLDocument):
        return
    order = order_of(old, new)
    moved = next((k for k, (one, other) in enumerate(zip(order, new, strict=True)) if one != other), len(order))
    for key in list(new)[moved:]:
        item = container[key]
        _take_out(container, key)
        _append(container, key, item)


def _change(container: Any, key: Any, old: Any, new: Any) -> None:
    if isinstance(old, dict) and isinstance(new, Mapping):
        _update(container[key], old, new)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, (one, other) in enumerate(zip(old, new, strict=True)):
            if not same(one, other):
                _change(container[key], k, one, other)
    else:
        container[key] = _item(new, block=False)


def _has_headers(container: Any) -> bool:
    """Whether tables in it have a header each."""
    if isinstance(container, Table):
        return any(isinstance(item, Table) for _, item in container.value.body)
    return isinstance(container, tomlkit.TOMLDocument)


def _append(container: Any, key: str, item: Item) -> None:
    """Add a member behind the last one; comments and blank lines after that belong to what follows."""
    if not isinstance(container, Table | tomlkit.TOMLDocument):
        container[key] = item
        return
    tail = _cut_tail(container)
    container.append(key, item)
    _innermost(container).extend(tail)


def _take_out(container: Any, key: str) -> None:
    """Remove a member; comments and blank lines behind a table belong to what follows and stay."""
    body = _body(container) if isinstance(container, Table | tomlkit.TOMLDocument) else []
    tails = {
        place: "".join(each.as_string() for _, each in _cut_tail(item))
        for place, (name, item) in enumerate(body)
        if name is not None and name.key == key and isinstance(item, Table)
    }
    del container[key]
    for place, tail in tails.items():
        body[place] = (None, Whitespace(tail, fixed=True))


def _cut_tail(container: Table | tomlkit.TOMLDocument) -> _Body:
    """Take out the comments and blank lines behind the last member."""
    body = _innermost(container)
    size = max((k + 1 for k, (key, _) in enumerate(body) if key is not None), default=0)
    tail = body[size:]
    del body[size:]
    return tail


def _innermost(container: Table | tomlkit.TOMLDocument) -> _Body:
    """What is written in the last of the tables within it."""
    body = _body(container)
    while body and isinstance(last := body[-1][1], Table):
        body = last.value.body
    return body


def _body(container: Table | tomlkit.TOMLDocument) -> _Body:
    return container.value.body if isinstance(container, Table) else container.body


def _item(value: Any, *, block: bool) -> Item:
    """A value; a mapping with a header of its own, as have those in one of mappings alone, or within one line."""
    if isinstance(value, Mapping):
        inner = block and bool(value) and all(isinstance(each, Mapping) and each for each in value.values())
        table = tomlkit.table(is_super_table=inner) if block else tomlkit.inline_table()
        for key, each in value.items():
            table.append(key, _item(each, block=inner))
        return table
    if isinstance(value, list):
        array = tomlkit.array()
        array.extend(_item(each, block=False) for each in value)
        nested = any(isinstance(each, list | Mapping) for each in value)
        return array.multiline(nested and len(array.as_string()) > _LONGEST)
    return tomlkit.item(value)
