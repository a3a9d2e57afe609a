"""Model and study files made wrong: seeded mutations of what they say, and of their text.

`fuzz_models.py` and the tests put them through the program. The same seed gives the same file.
"""

from __future__ import annotations

import json
import random
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
MODELS, STUDIES = "models", "studies"

# Lists and tables, and a key or index of it: where a value stands.
Place = tuple[Any, Any]

# What stands where something else was meant. TOML has no place for more than these types.
_ODD: Sequence[Any] = (
    0, 0.0, -0.0, 1, -1, 2, 1e-3, 1e-9, 1e-30, 5e-324, 1e-160, 1e9, 1e30, 1e160, 1.7e308, -1e160, 1e-200,
    float("nan"), float("inf"), float("-inf"), 2_000_000_000, 10**12, 2**63, -(2**63), 10**190,
    True, False, "", " ", "pi", "0", "1/0", "1e400", "t", "sin(t)", "t**-1", "sqrt(-1)", "log(0)", "10**10**10",
    "9**9**9",
    "80 mm", "30 deg", "-2 kg / 3", "1e999 km", "3 N m/rad", "2 * 40 mm + 1 s", "5 parsec", "1 m @ 2",
    "__import__('os')", "half", "." * 300, "(" * 150, "-" * 199 + "1", "ground.O", "ground", "a.b.c", ".",
    "{braces}", "{0}", "%s", "[red]bold[/red]", "\x1b[31mred", "\u202eesrever", "=cmd|'/C calc'!A0", "é" * 5000,
    "x" * 5000, "line\nbreak", "\x07", "/dev/zero", "/dev/urandom", "..", "/", "no_such.csv", "everything.toml",
    [], {}, [[]], [{}], [None], [0.0], [0.0, 0.0], [1.0, 2.0, 3.0], [[0.0, 0.0]], [[0.0, 0.0]] * 3, ["a", "b"],
    {"": 0}, {"a": {"b": {"c": 1}}}, {"type": "beam"}, {"type": 3}, [1e308, 1e308], ["nan", "inf"],
)  # fmt: skip
_NAMES = (
    "", " ", "ground", "a.b", "type", "points", "name", "x" * 5000, "\u202eabc", "\x1b[2J", "{x}", "=1+1", "[b]", "é",
    "t", "pi", "sin", "0", "-", "nul\x00", "line\nbreak", "body", "__class__", "." * 1000,
)  # fmt: skip
# Words that mean something in some field.
_WORDS = (
    "linear", "second-order", "pinned", "cantilever", "free", "separate", "shared", "hold", "whole", "motion",
    "beam", "rigid", "assumed-modes", "modal", "prismatic", "slot", "sliding", "weld", "revolute", "error", "warn",
    "stop", "polygon", "line", "circle", "points", "force", "torque", "x", "y", "angle", "esdirk5", "tr-bdf2",
    "trapezoidal", "newmark", "hht-alpha", "generalised-alpha", "wilson-theta", "rk45", "radau", "bdf", "ndf",
    "adams", "ida", "baumgarte", "projection", "ggl", "grid", "list", "sobol", "random", "log", "slsqp", "nelder-mead",
    "tracking_rms", "peak_torque_max", "deflection_max", "section.bar.width", "integration.tolerance", "four_bar",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A file to try.

    Attributes
    ----------
    seed : int
    origin : str
        The file it was made of.
    changes : tuple of str
        What was done to it.
    content : bytes
    """

    seed: int
    origin: str
    changes: tuple[str, ...]
    content: bytes


def originals(kind: str) -> dict[str, str]:
    """Texts of the files that are made wrong, by name: "models" or "studies"."""
    examples = {file.stem: file.read_text() for file in (HERE.parent / "examples").glob("*.toml")}
    models = {name: examples.pop(name) for name in ("laws",)}
    if kind == STUDIES:
        return examples | {name: (HERE / "fuzzed" / f"{name}.toml").read_text() for name in ("sweep", "search")}
    from paraflex.files import library_names, library_text
    from paraflex.files.generators import generated_text

    texts = models | {name: library_text(name) for name in library_names()}
    texts |= {name: generated_text(name) for name in ("four_bars:1", "chain:3")}
    return texts | {"everything": (HERE / "fuzzed" / "everything.toml").read_text()}


def mutated(seed: int, texts: Mapping[str, str], *, prepare: Callable[[dict[str, Any]], None] | None = None) -> Case:
    """One of some files with up to four things wrong.

    Parameters
    ----------
    seed : int
    texts : mapping
        Of valid TOML files, by name; see `originals`.
    prepare : callable, optional
        Changes the data before anything is made wrong of them, to short runs say.
    """
    chance = random.Random(f"paraflex {seed}")
    origin = chance.choice(sorted(texts))
    data = tomllib.loads(texts[origin])
    if prepare is not None:
        prepare(data)
    changes = []
    if chance.random() < 0.85:
        others = [tomllib.loads(texts[name]) for name in chance.sample(sorted(texts), 2)]
        # Most changes of other kinds are refused at once: numbers alone go deeper.
        known = _NUMBERS if chance.random() < 0.5 else _DATA_CHANGES
        for _ in range(chance.choice((1, 1, 1, 2, 2, 3, 4))):
            changes.append(_change_data(chance, data, others, known))
        text = toml_text(data)
    else:
        text = texts[origin] if prepare is None else toml_text(data)
    content = text.encode("utf-8", "surrogatepass")
    if not changes or chance.random() < 0.05:
        change = chance.choice(_TEXT_CHANGES)
        changes.append(change.__name__)
        content = change(chance, content)
    return Case(seed, origin, tuple(changes), content)


def toml_text(data: Mapping[str, Any]) -> str:
    """Data as TOML, a line for each value at the top: what `tomllib` reads again, whatever the names."""
    return "".join(f"{_quoted(key)} = {_value(value)}\n" for key, value in data.items())


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_quoted(key)} = {_value(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join("1979-05-27" if each is None else _value(each) for each in value) + "]"
    if isinstance(value, str):
        return _quoted(value)
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _places(data: Any) -> Iterator[Place]:
    """Every place in data, of tables, lists and plain values alike."""
    keys = data if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    for key in keys:
        yield data, key
        yield from _places(data[key])


def _change_data(
    chance: random.Random, data: dict[str, Any], others: Sequence[dict[str, Any]], known: Sequence[Callable[..., None]]
) -> str:
    """Change data in place; what was done."""
    places = list(_places(data))
    if not places:
        data["name"] = "x"
        return "named"
    change = chance.choice(known)
    # Numbers are most of a file, tables few: half of the changes are to what lies near the top.
    near = [place for place in places if place[0] is data or any(place[0] is each for each in data.values())]
    holder, key = chance.choice(near if near and chance.random() < 0.3 else places)
    change(chance, data, (holder, key), others)
    return f"{change.__name__}({str(key)[:40]!r})"


def _to_odd(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    place[0][place[1]] = deepcopy(chance.choice(_ODD))


def _scaled(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    """A number too large or too small by some powers of ten, or of the other sign."""
    numbers = [(holder, key) for holder, key in _places(data) if type(holder[key]) in (int, float)]
    if numbers:
        holder, key = chance.choice(numbers)
        how = chance.random()
        factor = -1.0 if how < 0.2 else 0.0 if how < 0.3 else 10.0 ** chance.choice((chance.uniform(-3, 3), 9, -9, 20))
        changed = holder[key] * factor
        keep_whole = type(holder[key]) is int and abs(changed) < 1e18 and chance.random() < 0.8
        holder[key] = int(changed) if keep_whole else changed


def _number_to_odd(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    """A number that may be one: zero, tiny, huge, negative."""
    numbers = [(holder, key) for holder, key in _places(data) if type(holder[key]) in (int, float)]
    if numbers:
        holder, key = chance.choice(numbers)
        odd = [value for value in _ODD if type(value) in (int, float) and abs(value) < 1e300]
        whole = [value for value in odd if type(value) is int and abs(value) < 2**63]
        holder[key] = chance.choice(whole if type(holder[key]) is int else odd)


def _numbers_swapped(
    chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]
) -> None:
    """Two numbers, each in place of the other."""
    numbers = [(holder, key) for holder, key in _places(data) if type(holder[key]) in (int, float)]
    if len(numbers) > 1:
        (one, key), (other, at) = chance.sample(numbers, 2)
        one[key], other[at] = other[at], one[key]


def _to_expression(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    """An expression of parameters that are there, or of each other."""
    names = [*data.get("parameters", {}), "pi", "t"] if isinstance(data.get("parameters", {}), dict) else ["pi"]
    one, other = chance.choice(names), chance.choice(names)
    form = chance.choice(("{a} - {b}", "{a} / {b}", "sin({a}) * {b}", "{a} ** {b}", "1e200 * {a}", "-{a}", "{a}({b})"))
    text = form.format(a=one, b=other)
    if chance.random() < 0.3 and isinstance(data.get("parameters"), dict) and data["parameters"]:
        data["parameters"][chance.choice(list(data["parameters"]))] = text
    else:
        place[0][place[1]] = text


def _deleted(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    del place[0][place[1]]


def _doubled(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    holder, key = place
    if isinstance(holder, list):
        holder.insert(key, deepcopy(holder[key]))
    else:
        holder[chance.choice((f"{key}2", f"_{key}", *_NAMES))] = deepcopy(holder[key])


def _multiplied(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    """A list many times as long, or a number in a list."""
    holder, key = place
    value = holder[key]
    holder[key] = value * 500 if isinstance(value, list) else [value] * chance.choice((1, 2, 3))


def _renamed(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    holder, key = place
    if isinstance(holder, dict):
        names = [str(each) for _, each in _places(data)]
        new = chance.choice((chance.choice(_NAMES), chance.choice(names), str(key)[:-1], f"{key}s", str(key).upper()))
        items = [(new if each == key else each, value) for each, value in holder.items()]
        holder.clear()
        holder.update(items)


def _crossed(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    """A value that stands elsewhere in the file."""
    holder, key = chance.choice(list(_places(data)))
    other, at = place
    kept, other[at] = other[at], deepcopy(holder[key])
    if chance.random() < 0.5 and holder is not other:
        holder[key] = deepcopy(kept)


def _names_crossed(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    """A text in place of another: the name of another point, joint or section."""
    texts = [(holder, key) for holder, key in _places(data) if isinstance(holder[key], str)]
    if len(texts) > 1:
        (one, key), (other, at) = chance.sample(texts, 2)
        one[key] = other[at]


def _to_word(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    """A word that may stand there, or a field of [study] that says another thing."""
    texts = [(holder, key) for holder, key in _places(data) if isinstance(holder[key], str)]
    if texts and chance.random() < 0.5:
        holder, key = chance.choice(texts)
        holder[key] = chance.choice(_WORDS)
    elif isinstance(study := data.setdefault("study", {}), dict):
        study |= chance.choice((
            {"method": chance.choice(_WORDS)}, {"step": 10.0 ** chance.uniform(-7, 1), "method": "newmark"},
            {"tolerance": 10.0 ** chance.uniform(-16, 3)}, {"duration": 10.0 ** chance.uniform(-9, 6)},
            {"after": "hold"}, {"samples": chance.choice((2, 3, 1000))}, {"orientation": chance.uniform(-9, 9)},
        ))  # fmt: skip


def _from_another(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    """A table of another file in place of this one's, or beside what this one has."""
    other = chance.choice(others)
    table = chance.choice(list(other))
    given = deepcopy(other[table])
    if isinstance(given, dict) and isinstance(data.get(table), dict) and chance.random() < 0.5:
        data[table] |= given
    else:
        data[table] = given


def _nested(chance: random.Random, data: dict[str, Any], place: Place, others: Sequence[dict[str, Any]]) -> None:
    """A value below brackets or tables that have no meaning."""
    holder, key = place
    for _ in range(chance.choice((1, 2, 50))):
        holder[key] = [holder[key]] if chance.random() < 0.5 else {"a": holder[key]}


_DATA_CHANGES = (
    _to_odd, _to_odd, _to_odd, _scaled, _scaled, _scaled, _to_expression, _deleted, _deleted, _doubled, _multiplied,
    _renamed, _renamed, _crossed, _crossed, _names_crossed, _names_crossed, _to_word, _from_another, _nested,
)  # fmt: skip


_NUMBERS = (_scaled, _scaled, _scaled, _number_to_odd, _numbers_swapped, _names_crossed, _to_word)


def _cut(chance: random.Random, content: bytes) -> bytes:
    return content[: chance.randrange(len(content))]


def _lines_changed(chance: random.Random, content: bytes) -> bytes:
    lines = content.split(b"\n")
    k, m = chance.randrange(len(lines)), chance.randrange(len(lines))
    how = chance.choice(("twice", "out", "moved", "repeated"))
    if how in ("twice", "moved"):
        lines.insert(m, lines[k])
    if how in ("out", "moved"):
        del lines[k]
    if how == "repeated":
        lines[k] = lines[k] * 200
    return b"\n".join(lines)


def _bytes_changed(chance: random.Random, content: bytes) -> bytes:
    changed = bytearray(content)
    for _ in range(chance.choice((1, 1, 1, 3, 30))):
        k = chance.randrange(len(changed))
        changed[k : k + chance.choice((0, 1, 1))] = bytes([chance.choice((0, 10, 34, 46, 93, 123, 255, 57, 45, 101))])
    return bytes(changed)


def _digits_changed(chance: random.Random, content: bytes) -> bytes:
    """Digits put in where others are: numbers a slip of the finger away."""
    places = [k for k, byte in enumerate(content) if 48 <= byte <= 57]
    changed = bytearray(content)
    for k in chance.sample(places, min(len(places), chance.choice((1, 2, 5)))):
        changed[k : k + 1] = chance.choice((b"0", b"9", b"-1", b"1e9", b"1e-9", b"." * 3, b"9" * 190, b"e"))
    return bytes(changed)


def _marked(chance: random.Random, content: bytes) -> bytes:
    """As other programs write files: a mark at the start, other line ends, another encoding."""
    text = content.decode("utf-8", "replace")
    return chance.choice((
        b"\xef\xbb\xbf" + content, content.replace(b"\n", b"\r\n"), text.encode("utf-16"), content + b"\x00", b"",
        content * 2, b"a" + b"." * 20_000 + content, b"[[" * 2000 + content, b"a.b.c.d" * 3000 + b" = 1\n" + content,
    ))  # fmt: skip


_TEXT_CHANGES = (_cut, _lines_changed, _bytes_changed, _bytes_changed, _digits_changed, _digits_changed, _marked)
