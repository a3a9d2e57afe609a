"""Actions of the workbench: minimal edits of model files, of every library mechanism and of sheets drawn from nothing."""

import random
import re
import tomllib
from itertools import pairwise

import pytest

import paraflex as pf
from paraflex.errors import InputError
from paraflex.files.fields import leaves, value_at
from paraflex.files.library import library_file, library_names
from paraflex.results.posed import posed
from paraflex.workbench.actions import apply, what_goes
from paraflex.workbench.edits import renamed, with_item, with_table, with_value, without
from paraflex.workbench.sheet import Sheet
from paraflex.workbench.spans import entries_of

EMPTY = 'name = "untitled"\n'
ACTIONS_PER_MECHANISM = 67


def texts():
    names = library_names()
    return {name: library_file(name).read_text(encoding="utf-8") for name in names}


def drawn(actions, text=EMPTY):
    for action in actions:
        text = apply(text, action).text
    return text


def loaded(text, folder):
    path = folder / "drawn.toml"
    path.write_text(text, encoding="utf-8")
    return pf.load(path)


def kept_lines(text, other):
    """Lines of a text whose tables and values another text has as well, and its comments, each with its line break."""
    data, compared = tomllib.loads(text), tomllib.loads(other)
    lines = text.splitlines(keepends=True)
    kept = {k for k, line in enumerate(lines) if line.strip().startswith("#")}
    for entry in entries_of(text):
        same = value_at(data, entry.place) == value_at(compared, entry.place)
        if entry.kind == "pair" and same or entry.kind == "header" and value_at(compared, entry.place) is not None:
            start = text.count("\n", 0, entry.whole[0])
            kept |= set(range(start, start + max(1, text[slice(*entry.whole)].count("\n"))))
    return [lines[k] for k in sorted(kept)]


def check_minimal(old, new):
    """Lines about what has not changed are byte-identical and in order; comments go with deleted tables only."""
    comment = re.compile(r"\s*#")
    before, after = kept_lines(old, new), kept_lines(new, old)
    assert [line for line in before if not comment.match(line)] == [line for line in after if not comment.match(line)]
    gone = [line for line in before if comment.match(line)]
    for line in (line for line in after if comment.match(line)):
        gone.remove(line)
    gone_tables = [one for one in entries_of(old) if one.kind == "header" and value_at(tomllib.loads(new), one.place) is None]
    assert len(gone) <= 4 * len(gone_tables)
    # Of a line that has changed, the part outside of the changed values stays.
    changed = [entry for entry in entries_of(old) if entry.kind == "pair" and entry.place in places_of(new)]
    for entry in changed:
        assert line_frame(old, entry) == line_frame(new, places_of(new)[entry.place])


def places_of(text):
    return {entry.place: entry for entry in entries_of(text) if entry.kind == "pair"}


def line_frame(text, entry):
    """Key before a value and comment behind it, as written."""
    return text[entry.whole[0] : entry.value[0]], text[entry.value[1] : entry.whole[1]].rstrip("\r\n")


class Hand:
    """Random actions on a text."""

    def __init__(self, seed):
        self.random = random.Random(seed)

    def name(self, data, *tables):
        found = [(table, name) for table in tables for name in data.get(table, {})]
        return self.random.choice(found) if found else ("body", "none")

    def ref(self, data):
        refs = [f"ground.{name}" for name in data.get("ground", {})]
        refs += [f"{name}.{point}" for name, body in data.get("body", {}).items() for point in body.get("points", {})]
        return self.random.choice(refs) if refs else [0.1, 0.1]

    def at(self, data):
        free = [round(self.random.uniform(-0.3, 0.3), 3), round(self.random.uniform(-0.3, 0.3), 3)]
        return self.ref(data) if self.random.random() < 0.5 else free

    def action(self, data):
        choose, joint = self.random.choice, self.name(data, "joint")[1]
        number = choose(["95 mm", "0.31", "l1 / 2", "2 * 3", "-1", "true", "steel", "[1, 2]", "1e-3", "", "5 Hz", '"', "#"])
        places = [place for place, _ in leaves(data)]
        tables = [table for table, each in data.items() if isinstance(each, dict)]
        return choose([
            lambda: {"kind": "add-ground", "at": [0.1, 0.2]},
            lambda: {"kind": "add-link", "points": [self.at(data) for _ in range(choose([2, 2, 3]))],
                     "flexible": choose([True, False])},
            lambda: {"kind": "add-joint", "type": choose(["revolute", "weld", "slot", "prismatic", "distance", "sliding"]),
                     "a": self.ref(data), "b": self.ref(data)},
            lambda: {"kind": "add-slider", "at": self.at(data), "direction": 0.3, "block": choose([True, False])},
            lambda: {"kind": "add-motor", "joint": joint},
            lambda: {"kind": "add-drive", "joint": joint, "speed": 3.0},
            lambda: {"kind": "add-spring", "joint": joint, "stiffness": 2.0},
            lambda: {"kind": "add-spring", "points": [self.ref(data), self.ref(data)]},
            lambda: {"kind": "add-damper", "joint": joint},
            lambda: {"kind": "add-gear", "joints": [joint, self.name(data, "joint")[1]], "ratio": -2},
            lambda: {"kind": "add-load", "at": self.ref(data), choose(["force", "torque"]): choose([[1.0, 2.0], 3.0])},
            lambda: {"kind": "add-lump", "at": self.ref(data)},
            lambda: {"kind": "add-sensor", choose(["at", "joint", "body"]): choose([joint, self.ref(data), *data["body"]])},
            lambda: {"kind": "add-point", "body": self.name(data, "body")[1], "at": [0.1, 0.1]},
            lambda: {"kind": "set-effector", "at": self.ref(data)},
            lambda: {"kind": "add-path", "type": choose(["line", "polygon", "points"]),
                     "points": [[0.1, 0.2], [0.15, 0.2], [0.1, 0.25]][: choose([2, 3])]},
            lambda: {"kind": "add-mode", "motors": list(data.get("motor", {}))[:1]},
            lambda: {"kind": "add-gravity"},
            lambda: {"kind": "move-point", "ref": self.ref(data), "to": [round(self.random.uniform(-0.3, 0.3), 3), 0.1]},
            lambda: {"kind": "move-point", "ref": self.ref(data), "to": [0.2, round(self.random.uniform(-0.3, 0.3), 3)]},
            lambda: {"kind": "set", "place": list(choose(places)), "text": number},
            lambda: {"kind": "set", "place": [*choose(places)[:2], choose(["mass", "flexible", "elements", "x"])], "text": number},
            lambda: {"kind": "unset", "place": list(choose(places))},
            lambda: {"kind": "rename", "name": ".".join(self.name(data, *tables)), "to": choose(["new", "a b", "x1", "m"])},
            lambda: {"kind": "rename", "name": self.ref(data), "to": choose(["new", "Z9", "A"])},
            lambda: {"kind": "delete", "names": [".".join(self.name(data, *tables))]},
            lambda: {"kind": "delete", "names": [self.ref(data)]},
            lambda: {"kind": "delete", "names": [f"body.{name}" for name in data.get("body", {})]},
            lambda: {"kind": "copy", "names": [f"body.{name}" for name in list(data["body"])[:2]], "by": [0.1, 0.0]},
            lambda: {"kind": "mirror", "names": [f"body.{name}" for name in list(data["body"])[:2]], "axis": choose("xy")},
            lambda: {"kind": "pose", "angles": {body: 0.5 for body in data["body"]}},
        ])()  # fmt: skip


@pytest.mark.parametrize("name", library_names())
def test_random_actions_change_nothing_else_or_are_refused_in_one_line(name):
    original = texts()[name]
    hand, done = Hand(name), 0
    for text in (original, original.replace("\n", "\r\n")):
        for _ in range(ACTIONS_PER_MECHANISM // 2 + 1):
            data = tomllib.loads(text)
            if not data.get("body"):
                text = original
                continue
            action = hand.action(data)
            try:
                new = apply(text, action).text
            except InputError as error:
                assert "\n" not in str(error), action
                continue
            done += 1
            check_minimal(text, new)
            assert Sheet(new).problem is None, action
            assert ("\r\n" in new) == ("\r\n" in text) and "\n" not in new.replace("\r\n", "" if "\r\n" in text else "\r\n"), action
            text = new
    assert done > 15
