"""TOML output that preserves the comments, order and spelling of the file from which the data come."""

import tomllib
from collections.abc import Collection, Mapping
from typing import Any

import tomlkit
from tomlkit.container import OutOfOrderTableProxy
from tomlkit.items import Item, Key, Table, Whitespace

from .merge import order_of, same

# Content of a table in order: members, and without a key the comments and blank lines.
_Body = list[tuple[Key | None, Item]]

# Lists of lists or tables longer than this number of characters are written with one item per line.
_LONGEST = 100


def document_text(data: Mapping[str, Any], text: str = "") -> str:
    """Return data as TOML, from which `tomllib` reads the same data.

    Parameters
    ----------
    data : mapping
        Strings, numbers, booleans, and lists and mappings of these.
    text : str
        Text of a file with other data. Parts with equal data are kept as written there, including comments.
    """
    written = _written(data, text)
    found = tomllib.loads(written)
    # A table that could not be changed in place is rewritten without its comments. That is the case if its data or the
    # order of its members differ. The order of deeper tables, and of the tables of the file, is not compared.
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
    """Update a table of a document from old to new data, in place."""
    if isinstance(container, OutOfOrderTableProxy) and list(old) != list(new):
        return  # the table is split over several places, where only existing members can be changed
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
    """Check whether tables inside a container have headers of their own."""
    if isinstance(container, Table):
        return any(isinstance(item, Table) for _, item in container.value.body)
    return isinstance(container, tomlkit.TOMLDocument)


def _append(container: Any, key: str, item: Item) -> None:
    """Append a member after the last one; trailing comments and blank lines stay behind it, with the next table."""
    if not isinstance(container, Table | tomlkit.TOMLDocument):
        container[key] = item
        return
    tail = _cut_tail(container)
    container.append(key, item)
    _innermost(container).extend(tail)


def _take_out(container: Any, key: str) -> None:
    """Remove a member, but keep the comments and blank lines behind a table, which belong to the next one."""
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
    """Remove and return the comments and blank lines behind the last member."""
    body = _innermost(container)
    size = max((k + 1 for k, (key, _) in enumerate(body) if key is not None), default=0)
    tail = body[size:]
    del body[size:]
    return tail


def _innermost(container: Table | tomlkit.TOMLDocument) -> _Body:
    """Return the content of the last nested table of a container."""
    body = _body(container)
    while body and isinstance(last := body[-1][1], Table):
        body = last.value.body
    return body


def _body(container: Table | tomlkit.TOMLDocument) -> _Body:
    return container.value.body if isinstance(container, Table) else container.body


def _item(value: Any, *, block: bool) -> Item:
    """Return a value as a TOML item.

    If `block` is True, a mapping becomes a table with a header, and so do its members if all of them are non-empty
    mappings. Otherwise a mapping becomes an inline table.
    """
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
