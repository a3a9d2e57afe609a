"""Update of the data of a file after a change of the model that they describe."""

from collections.abc import Iterable, Mapping
from typing import Any


def same(one: Any, other: Any) -> bool:
    """Check whether data are equal, with keys in the same order."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return list(one) == list(other) and all(same(value, other[key]) for key, value in one.items())
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    return isinstance(one, bool) == isinstance(other, bool) and one == other


def merged(data: Any, before: Any, after: Any) -> Any:
    """Apply the differences between `before` and `after` to the data of a file.

    Parameters
    ----------
    data : any
        Data of the file.
    before, after : any
        Normalised forms of the same data, as they are and as they are to be.

    Returns
    -------
    any
        Updated data. An entry with a form of its own, such as an expression or an explicit default, is kept as long as
        its meaning does not change.
    """
    if same(before, after):
        return data
    if isinstance(data, list) and isinstance(before, list) and isinstance(after, list):
        if len(data) == len(before) == len(after):
            return [merged(*each) for each in zip(data, before, after, strict=True)]
    elif (
        isinstance(data, Mapping)
        and isinstance(before, Mapping)
        and isinstance(after, Mapping)
        and data.get("type") in (None, after.get("type"))
    ):
        return _merged_table(data, before, after)
    return after


def _merged_table(data: Mapping[str, Any], before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Any]:
    out = {key: value for key, value in data.items() if key in after or key not in before}
    for key, value in after.items():
        out[key] = merged(data[key], before[key], value) if key in data and key in before else value
    if order_of(before, after) == list(after):
        return out
    return {key: value for key, value in out.items() if key not in after} | {key: out[key] for key in after}


def order_of(before: Iterable[str], after: Mapping[str, Any]) -> list[str]:
    """Return the keys that are kept, in their previous order, followed by the new ones."""
    kept = [key for key in before if key in after]
    return [*kept, *(key for key in after if key not in kept)]
