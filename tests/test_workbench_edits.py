"""Actions of the workbench: minimal edits of model files, and mechanisms drawn from an empty sheet."""

import json
import math
import random
import re
import tomllib
from contextlib import suppress

import pytest

import paraflex as pf
from paraflex.errors import InputError
from paraflex.files.fields import leaves, value_at
from paraflex.files.library import library_file, library_names
from paraflex.results.posed import posed
from paraflex.workbench.actions import apply, what_goes
from paraflex.workbench.document import Document
from paraflex.workbench.edits import renamed, with_item, with_table, with_value, without
from paraflex.workbench.items import fields, outline
from paraflex.workbench.sheet import Sheet
from paraflex.workbench.spans import entries_of

EMPTY = 'name = "untitled"\n'
# Actions that change each of two texts, by whether the mechanism has more than six bodies: 1,004 in all.
ACTIONS = {True: 12, False: 43}


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
    headers = [entry.place for entry in entries_of(other) if entry.kind == "header"]
    lines = text.splitlines(keepends=True)
    kept = {k for k, line in enumerate(lines) if line.strip().startswith("#")}
    for entry in entries_of(text):
        same = value_at(data, entry.place) == value_at(compared, entry.place)
        if (entry.kind == "pair" and same) or (entry.kind == "header" and entry.place in headers):
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
    data = tomllib.loads(new)
    gone_tables = [one for one in entries_of(old) if one.kind == "header" and value_at(data, one.place) is None]
    assert len(gone) <= 4 * len(gone_tables)
    # Of a line that has changed, the part outside of the changed values stays.
    found = places_of(new)
    for place, entry in places_of(old).items():
        if place in found:
            assert line_frame(old, entry) == line_frame(new, found[place])


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
        number = choose(
            ["95 mm", "0.31", "l1 / 2", "2 * 3", "-1", "true", "steel", "[1, 2]", "1e-3", "", "5 Hz", '"', "#"]
        )
        places = [place for place, _ in leaves(data)]
        tables = [table for table, each in data.items() if isinstance(each, dict)]
        return choose(
            [
                lambda: {"kind": "add-ground", "at": [0.1, 0.2]},
                lambda: {
                    "kind": "add-link",
                    "points": [self.at(data) for _ in range(choose([2, 2, 3]))],
                    "flexible": choose([True, False]),
                },
                lambda: {
                    "kind": "add-joint",
                    "type": choose(["revolute", "weld", "slot", "prismatic", "distance", "sliding"]),
                    "a": self.ref(data),
                    "b": self.ref(data),
                },
                lambda: {"kind": "add-slider", "at": self.at(data), "direction": 0.3, "block": choose([True, False])},
                lambda: {"kind": "add-motor", "joint": joint},
                lambda: {"kind": "add-drive", "joint": joint, "speed": 3.0},
                lambda: {"kind": "add-spring", "joint": joint, "stiffness": 2.0},
                lambda: {"kind": "add-spring", "points": [self.ref(data), self.ref(data)]},
                lambda: {"kind": "add-damper", "joint": joint},
                lambda: {"kind": "add-damper", "points": [self.ref(data), self.ref(data)]},
                lambda: {"kind": "retype", "joint": joint, "type": choose(["weld", "prismatic", "slot", "revolute"])},
                lambda: {"kind": "move", "names": [f"body.{one}" for one in data["body"]], "by": [0.01, -0.02]},
                lambda: {"kind": "move", "names": [self.ref(data), self.ref(data)], "by": [0.0, 0.03]},
                lambda: {"kind": "add-gear", "joints": [joint, self.name(data, "joint")[1]], "ratio": -2},
                lambda: {
                    "kind": "add-load",
                    "at": self.ref(data),
                    choose(["force", "torque"]): choose([[1.0, 2.0], 3.0]),
                },
                lambda: {"kind": "add-lump", "at": self.ref(data)},
                lambda: {
                    "kind": "add-sensor",
                    choose(["at", "joint", "body"]): choose([joint, self.ref(data), *data["body"]]),
                },
                lambda: {"kind": "add-point", "body": self.name(data, "body")[1], "at": [0.1, 0.1]},
                lambda: {"kind": "set-effector", "at": self.ref(data)},
                lambda: {
                    "kind": "add-path",
                    "type": choose(["line", "polygon", "points"]),
                    "points": [[0.1, 0.2], [0.15, 0.2], [0.1, 0.25]][: choose([2, 3])],
                },
                lambda: {"kind": "add-mode", "motors": list(data.get("motor", {}))[:1]},
                lambda: {"kind": "add-gravity"},
                lambda: {
                    "kind": "move-point",
                    "ref": self.ref(data),
                    "to": [round(self.random.uniform(-0.3, 0.3), 3), 0.1],
                },
                lambda: {
                    "kind": "move-point",
                    "ref": self.ref(data),
                    "to": [0.2, round(self.random.uniform(-0.3, 0.3), 3)],
                },
                lambda: {"kind": "set", "place": list(choose(places)), "text": number},
                lambda: {
                    "kind": "set",
                    "place": [*choose(places)[:2], choose(["mass", "flexible", "elements", "x"])],
                    "text": number,
                },
                lambda: {"kind": "unset", "place": list(choose(places))},
                lambda: {
                    "kind": "rename",
                    "name": ".".join(self.name(data, *tables)),
                    "to": choose(["new", "a b", "x1", "m"]),
                },
                lambda: {"kind": "rename", "name": self.ref(data), "to": choose(["new", "Z9", "A"])},
                lambda: {"kind": "delete", "names": [".".join(self.name(data, *tables))]},
                lambda: {"kind": "delete", "names": [self.ref(data)]},
                lambda: {"kind": "delete", "names": [f"body.{name}" for name in data.get("body", {})]},
                lambda: {
                    "kind": "copy",
                    "names": [f"body.{name}" for name in list(data["body"])[:2]],
                    "by": [0.1, 0.0],
                },
                lambda: {
                    "kind": "mirror",
                    "names": [f"body.{name}" for name in list(data["body"])[:2]],
                    "axis": choose("xy"),
                },
                lambda: {"kind": "pose", "angles": dict.fromkeys(data["body"], 0.5)},
            ]
        )()


def outcome(text, action):
    """New text of an action, or None if it is refused; a refusal has one line."""
    try:
        return apply(text, action).text
    except InputError as error:
        line = str(error)
    assert len(line.splitlines()) == 1, action
    return None


@pytest.mark.parametrize("name", library_names())
def test_random_actions_change_nothing_else_or_are_refused_in_one_line(name):
    original = texts()[name]
    hand, many = Hand(name), len(tomllib.loads(original)["body"]) > 6
    for first, newline in ((original, "\n"), (original.replace("\n", "\r\n"), "\r\n")):
        document, done = Document(text=first), 0
        for _ in range(5 * ACTIONS[many]):
            text = document.text
            action = hand.action(tomllib.loads(text))
            new = outcome(text, action)
            if new is None:
                continue
            done += 1
            check_minimal(text, new)
            assert Sheet(new).problem is None, action
            assert {line[len(line.rstrip("\r\n")) :] for line in new.splitlines(keepends=True)} <= {newline, ""}, action
            document.change(new)
            # Copies would grow for ever, and of nothing there is nothing to do.
            if done % 12 == 0 or done == ACTIONS[many] or not tomllib.loads(new).get("body"):
                undo_all(document)
                assert document.text == first
            if done == ACTIONS[many]:
                break
        assert done == ACTIONS[many]


def undo_all(document):
    while document.can_undo:
        document.undo()


def test_messages_of_nonsense_are_refused_in_one_line():
    hand = random.Random(7)
    values = [
        None,
        1,
        -1.5,
        float("nan"),
        1e999,
        "",
        "x" * 300,
        "A",
        "ground.A",
        [],
        [1],
        [1, 2],
        ["a", "b"],
        {},
        {"a": []},
        True,
        ["body", 0],
        "body.link1",
        [["ground.A", "link1.B"]],
        "\n",
        [[0, 0], [0, 0]],
        10**400,
    ]
    keys = [
        "at",
        "points",
        "name",
        "joint",
        "joints",
        "a",
        "b",
        "type",
        "ref",
        "to",
        "place",
        "text",
        "value",
        "names",
        "by",
        "axis",
        "about",
        "body",
        "assembly",
        "angles",
        "motors",
        "speed",
        "direction",
        "of",
        "flexible",
    ]
    kinds = [
        "add-ground",
        "add-link",
        "add-joint",
        "retype",
        "move",
        "add-slider",
        "add-point",
        "add-motor",
        "add-mode",
        "add-drive",
        "add-gear",
        "add-spring",
        "add-damper",
        "add-load",
        "add-lump",
        "add-sensor",
        "set-effector",
        "add-path",
        "add-gravity",
        "set",
        "unset",
        "rename",
        "copy",
        "mirror",
        "delete",
        "pose",
        "move-point",
        "none",
        None,
        [],
    ]
    for text in (EMPTY, drawn(CHAIN)):
        for _ in range(400):
            chosen = {key: hand.choice(values) for key in hand.sample(keys, 6)}
            new = outcome(text, {"kind": hand.choice(kinds), **chosen})
            if new is not None:
                assert Sheet(new).problem is None, chosen


@pytest.mark.parametrize(
    "text",
    [
        "",
        "body = 3\njoint = []\n",
        'name = "x"\n[joint]\nA = 3\n[motor]\nm = [1]\n[body.b]\ntype = "rigid"\npoints = 3\n',
        'name = "x"\n[assembly]\na = 3\n[study]\nmodes = 3\n[ground]\nA = [1]\n[mode]\na = 3\n',
        'name = "x"\n[body.b]\npoints = { A = "q" }\n[joint]\nA = ["ground", "b"]\n[parameters]\nq = "q"\n',
    ],
)
def test_texts_that_are_no_models_are_refused_in_one_line(text):
    known = {
        "ground": {"A": 0},
        "body": {"b": {"points": {"A": 0}}},
        "joint": {"A": 1},
        "motor": {"m": 1},
        "study": {"x": 1},
    }
    hand = Hand(3)
    for _ in range(80):
        outcome(text, hand.action(known))
    for place in ([], ["body"], ["joint"], ["motor", "m"], ["ground", "A"], ["body", "b"]):
        with suppress(InputError):
            fields(text, place)
    with suppress(InputError):
        outline(text)


def test_text_that_is_not_toml_is_refused_with_its_line_and_column():
    with pytest.raises(InputError, match=r"line 2, column \d+"):
        apply('name = "x"\nlength = = 3\n', {"kind": "add-ground", "at": [0.0, 0.0]})


FIVE_BAR = [
    {"kind": "add-ground", "at": [-0.1, 0.0]},
    {"kind": "add-ground", "at": [0.1, 0.0]},
    {"kind": "add-link", "points": ["ground.A", [-0.25, 0.2]], "flexible": True},
    {"kind": "add-link", "points": ["ground.B", [0.25, 0.2]], "flexible": True},
    {"kind": "add-link", "points": ["link1.C", [0.0, 0.35]], "flexible": True},
    {"kind": "add-link", "points": ["link2.D", "link3.E"], "flexible": True},
    {"kind": "add-motor", "joint": "A"},
    {"kind": "add-motor", "joint": "B"},
    {"kind": "set-effector", "at": "link3.E"},
    {"kind": "add-path", "points": [[0.03, 0.36], [-0.03, 0.36], [-0.03, 0.3], [0.03, 0.3]]},
]
FOUR_BAR = [
    {"kind": "add-ground", "at": [0.0, 0.0]},
    {"kind": "add-ground", "at": [0.4, 0.0]},
    {"kind": "add-link", "points": ["ground.A", [0.06, 0.08]]},
    {"kind": "add-link", "points": ["link1.C", [0.35, 0.25], [0.2, 0.3]]},
    {"kind": "add-link", "points": ["ground.B", "link2.D"]},
    {"kind": "add-drive", "joint": "A", "speed": 20.0},
]
SLIDER_CRANK = [
    {"kind": "add-ground", "at": [0.0, 0.0]},
    {"kind": "add-link", "points": ["ground.A", [0.06, 0.08]]},
    {"kind": "add-link", "points": ["link1.B", [0.3, 0.0]]},
    {"kind": "add-slider", "at": "link2.C"},
    {"kind": "add-drive", "joint": "A", "speed": 20.0},
]
CHAIN = [
    {"kind": "add-ground", "at": [0.0, 0.0]},
    {"kind": "add-link", "points": ["ground.A", [0.2, 0.1]], "flexible": True},
    {"kind": "add-link", "points": ["link1.B", [0.4, 0.05]], "flexible": True},
    {"kind": "add-motor", "joint": "A"},
    {"kind": "add-motor", "joint": "B"},
    {"kind": "set-effector", "at": "link2.C"},
    {"kind": "add-path", "type": "line", "points": [[0.3, 0.1], [0.35, 0.1]]},
    {"kind": "add-gravity"},
]
QUICK_RETURN = [
    {"kind": "add-ground", "at": [0.0, 0.1]},
    {"kind": "add-ground", "at": [0.0, -0.1]},
    {"kind": "add-link", "points": ["ground.A", [0.05, 0.1]]},
    {"kind": "add-link", "points": ["ground.B", [0.1, 0.3]]},
    {"kind": "add-joint", "type": "slot", "a": "link2.B", "b": "link1.C", "direction": 1.3258},
    {"kind": "add-link", "points": ["link2.D", [0.3, 0.32]]},
    {"kind": "add-slider", "at": "link3.E"},
    {"kind": "add-drive", "joint": "A", "speed": 6.0},
]


@pytest.mark.parametrize("actions", [FIVE_BAR, FOUR_BAR, SLIDER_CRANK, CHAIN, QUICK_RETURN])
def test_mechanisms_drawn_from_the_empty_sheet_close_where_they_were_drawn(actions, tmp_path):
    model = loaded(drawn(actions), tmp_path)
    pose = posed(model.mechanism)
    assert pose.closes
    given = model.mechanism.assemblies[0].angles
    assert all(abs(pose.angles[body] - angle) < 1e-3 for body, angle in given.items())


@pytest.mark.parametrize("actions", [FOUR_BAR, SLIDER_CRANK, QUICK_RETURN])
def test_drawn_cranks_turn_once(actions, tmp_path):
    motion = pf.kinematics(loaded(drawn(actions), tmp_path))
    speed = actions[-1]["speed"]
    assert motion.times[-1] == pytest.approx(2.0 * math.pi / speed, rel=1e-4)


@pytest.mark.parametrize("actions", [FIVE_BAR, CHAIN])
def test_drawn_manipulators_follow_their_paths(actions, tmp_path):
    model = loaded(drawn(actions), tmp_path)
    assert [mode.name for mode in model.modes()] == ["++"]
    task = model.plan(samples=51)
    assert task.motion.t[-1] == pytest.approx(model.paths["path1"].duration)


def test_deleting_all_bodies_leads_back_to_a_sheet_that_can_be_drawn_on():
    text = drawn(FOUR_BAR)
    bodies = [f"body.{name}" for name in tomllib.loads(text)["body"]]
    empty = apply(text, {"kind": "delete", "names": bodies}).text
    data = tomllib.loads(empty)
    assert not data.keys() & {"body", "joint", "prescribed", "assembly"}
    again = apply(empty, {"kind": "add-link", "points": ["ground.A", [0.1, 0.1]]}).text
    assert Sheet(again).problem is None
    grounds = apply(empty, {"kind": "delete", "names": ["ground.A", "ground.B"]}).text
    assert apply(grounds, {"kind": "unset", "place": ["study", "duration"]}).text == EMPTY


MOVED = """\
name = "moved"
[parameters]
l = 0.2   # m
w = 0.1
[ground]
A = ["-w", "l - w"]\t# a tab
B = [ "80 mm",0.250 ]
[body.arm]
type = "rigid"
points = { A = [0.0, 0.0], C = ["2 * l", 0.0] }
[joint]
A = ["ground.A", "arm.A"]
[assembly.one]
arm = "90 deg"   # up
"""


def move(ref, to, text=MOVED):
    return apply(text, {"kind": "move-point", "ref": ref, "to": to}).text


def test_numbers_keep_their_units_and_their_places_in_the_line():
    assert move("ground.B", [0.095, 0.25]) == MOVED.replace("80 mm", "95 mm")
    assert move("ground.B", [0.095, 0.25], MOVED.replace("\n", "\r\n")) == move("ground.B", [0.095, 0.25]).replace(
        "\n", "\r\n"
    )


def test_of_an_expression_with_one_parameter_the_parameter_changes():
    assert move("arm.C", [-0.1, 0.6]) == MOVED.replace("l = 0.2 ", "l = 0.25 ")


def test_a_link_turns_to_the_place_of_its_point():
    turned = move("arm.C", [0.3, 0.1])
    assert turned == MOVED.replace('"90 deg"', '"0 deg"')


def test_an_expression_of_several_parameters_is_refused_with_their_names():
    with pytest.raises(InputError, match=r"parameters\.l, parameters\.w"):
        move("ground.A", [-0.1, 0.2])


def test_what_is_joined_moves_along_and_the_picture_stays():
    text = drawn(FOUR_BAR)
    moved = Sheet(move("link2.D", [0.38, 0.22], text))
    sheet = Sheet(text)
    for ref in sheet.refs:
        expected = (0.38, 0.22) if ref in ("link2.D", "link3.D") else sheet.place(ref, "drawn")
        assert moved.place(ref, "drawn") == pytest.approx(expected, abs=1e-5), ref


def test_points_at_the_end_of_a_beam_follow_the_length_typed_for_it():
    text = apply(drawn(CHAIN), {"kind": "set", "place": ["body", "link1", "length"], "text": "95 mm"}).text
    body = tomllib.loads(text)["body"]["link1"]
    assert body["length"] == body["points"]["B"] == "95 mm"
    with pytest.raises(InputError, match=r"body\.link1\.length"):
        apply(text, {"kind": "set", "place": ["body", "link1", "length"], "text": "5 kg"})


def test_deleting_names_what_depends_and_keeps_the_rest_in_place():
    text = drawn(FIVE_BAR)
    gone = [one["name"] for one in what_goes(text, ["body.link1"])]
    assert gone == ["joint.A", "joint.C", "motor.motor1", "mode.++"]
    edited = apply(text, {"kind": "delete", "names": ["body.link1"]})
    assert edited.note == "also deleted: joint.A, joint.C, motor.motor1, mode.++"
    before, after = Sheet(text), Sheet(edited.text)
    assert after.place("link3.C", "drawn") == pytest.approx(before.place("link3.C", "drawn"), abs=1e-6)
    with pytest.raises(InputError, match=r"is used by body\.link1"):
        apply(text, {"kind": "delete", "names": ["section.bar"]})


def test_links_that_would_hang_on_nothing_go_as_well():
    text = drawn(CHAIN)
    assert [one["name"] for one in what_goes(text, ["joint.B"])][2:4] == ["body.link2", "end_effector"]
    # Without its joint on the ground the chain is whole, and stays where it is.
    free = apply(text, {"kind": "delete", "names": ["joint.A"]}).text
    assert Sheet(free).place("link2.C", "drawn") == pytest.approx((0.4, 0.05), abs=1e-5)
    joined = apply(free, {"kind": "add-joint", "a": "ground.A", "b": "link1.A"}).text
    assert "points" not in tomllib.loads(joined)["assembly"]["drawn"]


def test_names_change_in_references_expressions_and_keys():
    text = library_file("slider_crank_flexible").read_text(encoding="utf-8")
    new = apply(text, {"kind": "rename", "of": "parameters", "name": "crank", "to": "throw"}).text
    assert '"0.002727 - 0.36 * (throw/2)**2"' in new
    assert 'y = "throw * speed"' in new
    assert [body.name for body in Sheet(new).model.mechanism.bodies] == ["crank", "rod", "slider"]
    new = apply(new, {"kind": "rename", "name": "body.crank", "to": "main arm"}).text
    assert '"main arm" = { x = 0.0, y = 0.0, phi = 0.0 }' in new
    assert Sheet(new).model.mechanism.joint("A").a.body == "main arm"


def test_mirror_images_have_the_places_of_a_mirror():
    text = drawn(FOUR_BAR[:5])
    new = Sheet(apply(text, {"kind": "mirror", "names": ["body.link1", "body.link2"], "axis": "y", "about": 0.0}).text)
    for old, image in (("link1.C", "link4.C"), ("link2.E", "link5.E"), ("link2.D", "link5.D")):
        x, y = new.place(old, "drawn")
        assert new.place(image, "drawn") == pytest.approx((-x, y), abs=1e-5)
    # The pivot on the axis serves both.
    assert list(new.data["ground"]) == ["A", "B"]


def test_copies_stand_at_a_distance():
    new = Sheet(
        apply(drawn(FOUR_BAR[:5]), {"kind": "copy", "names": ["body.link1", "body.link2"], "by": [0.5, 0.1]}).text
    )
    x, y = new.place("link2.E", "drawn")
    assert new.place("link5.E", "drawn") == pytest.approx((x + 0.5, y + 0.1), abs=1e-5)
    assert [str(joint.a) for joint in new.joints][-2:] == ["ground.F", "link4.C"]


ODD = """\
# heading
name = 'odd'   # single quotes
"gravity" = [ 0.0,
  -9.81,  # down
]
[section . "a bar"]
width = 2.0e-2
thickness = 0.250
[ground]
A.x = 1
[[load.push.pieces]]
until = 0.1
[[load.push.pieces]]
force = [1.0, 2.0]
[joint]
[body.b]
points.A = [0.0, 0.0]
points."B.C" = [0.1, 0]
text = \"\"\"
[no.table]
\"\"\"
[section.c]
shape = "round"
"""


@pytest.mark.parametrize(
    ("edit", "old", "new"),
    [
        (lambda text: with_value(text, ["gravity", 1], "-1.6"), "-9.81,", "-1.6,"),
        (lambda text: with_value(text, ["section", "a bar", "wall"], "1"), "0.250\n", "0.250\nwall = 1\n"),
        (
            lambda text: with_value(text, ["body", "b", "points", "D"], "[1, 2]"),
            "[0.1, 0]\n",
            "[0.1, 0]\npoints.D = [1, 2]\n",
        ),
        (lambda text: with_value(text, ["load", "push", "pieces", 1, "until"], "3"), "2.0]\n", "2.0]\nuntil = 3\n"),
        (lambda text: without(text, ["load", "push", "pieces", 0, "until"]), "until = 0.1\n", ""),
        (lambda text: without(text, ["body", "b", "points", "B.C"]), 'points."B.C" = [0.1, 0]\n', ""),
        (lambda text: renamed(text, ["section", "a bar"], "leaf"), '"a bar"', "leaf"),
        (lambda text: renamed(text, ["body", "b", "points"], "spots"), "points.", "spots."),
        (lambda text: with_item(text, ["gravity"], "0"), "-9.81,", "-9.81, 0,"),
        (
            lambda text: with_table(text, ["section", "d"], {"area": 1.0}),
            '"round"\n',
            '"round"\n\n[section.d]\narea = 1.0\n',
        ),
        (lambda text: without(text, ["section", "c"]), '[section.c]\nshape = "round"\n', ""),
    ],
)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_odd_spellings_survive_edits(edit, old, new, newline):
    assert edit(ODD.replace("\n", newline)) == ODD.replace(old, new).replace("\n", newline)


def test_members_and_their_fields():
    text = library_file("five_bar").read_text(encoding="utf-8")
    members = {(one["kind"], one["name"]): one for one in outline(text)}
    assert members["joint", "A1"]["owns"] == [["motor", "left"]]
    assert members["body", "distal1"]["owns"] == [["joint", "B1"], ["joint", "C"], ["end_effector"]]
    found = fields(text, ["body", "proximal1"])
    length = next(row for row in found["fields"] if row["label"] == "length")
    assert length == {
        "place": ["body", "proximal1", "length"],
        "label": "length",
        "text": "l1",
        "value": 0.25,
        "unit": "m",
        "help": "the length in m",
        "choices": None,
    }
    assert {"label": "flexible", "help": "false for a rigid beam", "unit": ""} in found["addable"]


@pytest.mark.parametrize("name", library_names())
def test_fields_of_all_members_are_plain_data(name):
    text = texts()[name]
    for one in outline(text):
        found = fields(text, one["place"])
        assert json.loads(json.dumps(found, allow_nan=False)) == found
        for row in found["fields"]:
            assert value_at(tomllib.loads(text), row["place"]) is not None


def test_a_driven_crank_begins_where_a_person_puts_it():
    begins = ("prescribed", "drive", "angle")
    text = library_file("four_bar").read_text(encoding="utf-8")
    moved = Sheet(apply(text, {"kind": "move-point", "ref": "crank.A", "to": [0.0, 0.12]}).text)
    assert moved.number(begins) == pytest.approx(math.pi / 2.0, abs=1e-5)
    begun = posed(moved.model.mechanism)
    assert begun.closes
    assert begun.place(pf.PointRef("crank", "A")) == pytest.approx([0.0, 0.12], abs=1e-5)
    turned = {**begun.angles, "crank": begun.angles["crank"] + 0.25}
    kept = Sheet(apply(moved.text, {"kind": "pose", "angles": turned}).text)
    assert kept.number(begins) == pytest.approx(math.pi / 2.0 + 0.25, abs=1e-5)


def drawn_places(text):
    sheet = Sheet(text)
    return {ref: sheet.place(ref, sheet.shown) for ref in sheet.refs}


def test_a_linkage_is_moved_as_a_whole():
    text = library_file("four_bar").read_text(encoding="utf-8")
    names = ["body.crank", "body.coupler", "body.rocker"]
    moved = apply(text, {"kind": "move", "names": names, "by": [0.03, -0.02]}).text
    before, after = drawn_places(text), drawn_places(moved)
    for ref, (x, y) in before.items():
        assert after[ref] == pytest.approx((x + 0.03, y - 0.02), abs=1e-9), ref
    assert tomllib.loads(moved)["body"] == tomllib.loads(text)["body"]
    back = apply(moved, {"kind": "move", "names": names, "by": [-0.03, 0.02]}).text
    assert drawn_places(back) == {ref: pytest.approx(at, abs=1e-9) for ref, at in before.items()}
    assert tomllib.loads(moved)["ground"]["Q"][0] == "base + 0.03"
    assert back == text
    with pytest.raises(InputError, match=r"joint.* joined to what stays .*select coupler as well"):
        apply(text, {"kind": "move", "names": names[:1], "by": [0.03, 0.0]})


def test_several_points_move_by_the_same_step():
    text = library_file("four_bar").read_text(encoding="utf-8")
    moved = apply(text, {"kind": "move", "names": ["crank.A", "ground.O"], "by": [0.0, 0.01]}).text
    before, after = drawn_places(text), drawn_places(moved)
    for ref in ("ground.O", "crank.O", "crank.A", "coupler.A"):
        assert after[ref] == pytest.approx((before[ref][0], before[ref][1] + 0.01), abs=1e-6), ref


def test_a_damper_between_points_is_a_spring_without_stiffness():
    text = library_file("four_bar").read_text(encoding="utf-8")
    edited = apply(text, {"kind": "add-damper", "points": ["crank.A", "ground.Q"]})
    assert edited.selected == "linear_spring.damper1"
    (made,) = Sheet(edited.text).model.mechanism.linear_springs
    assert (made.stiffness, made.damping, str(made.a), str(made.b)) == (0.0, 10.0, "crank.A", "ground.Q")


def test_a_sensor_on_a_rigid_link_needs_a_point():
    with pytest.raises(InputError, match=r"sensor: a rigid link has no strain .*crank.*Further point"):
        apply(library_file("four_bar").read_text(encoding="utf-8"), {"kind": "add-sensor", "body": "crank"})


def test_a_joint_of_another_type_keeps_its_motor_if_it_moves():
    text = library_file("five_bar").read_text(encoding="utf-8")
    sliding = apply(text, {"kind": "retype", "joint": "A1", "type": "prismatic"})
    assert sliding.note == ""
    assert Sheet(sliding.text).data["motor"] == Sheet(text).data["motor"]
    welded = apply(text, {"kind": "retype", "joint": "A1", "type": "weld"})
    assert welded.note == "also deleted: motor.left, mode.++"
    for edited, kind in ((sliding, "prismatic"), (welded, "weld")):
        joint = next(one for one in Sheet(edited.text).joints if one.name == "A1")
        assert (joint.kind, str(joint.a), str(joint.b)) == (kind, "ground.A1", "proximal1.A1")


def test_links_of_an_open_chain_are_welded():
    text = EMPTY
    for action in (
        {"kind": "add-ground", "at": [0.0, 0.0], "name": "A"},
        {"kind": "add-link", "points": ["ground.A", [0.2, 0.1]]},
        {"kind": "add-link", "points": ["link1.B", [0.4, 0.0]]},
    ):
        text = apply(text, action).text
    welded = Sheet(apply(text, {"kind": "retype", "joint": "B", "type": "weld"}).text)
    before = Sheet(text)
    assert [one.kind for one in welded.joints] == ["revolute", "weld"]
    for ref in before.refs:
        assert welded.place(ref, welded.shown) == pytest.approx(before.place(ref, before.shown), abs=1e-5)
