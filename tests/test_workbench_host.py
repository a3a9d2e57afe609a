"""The server of the workbench: who may talk to it, what hostile messages bring, and that no text is lost."""

from __future__ import annotations

import json
import random
import signal
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from paraflex.files import library_text
from paraflex.workbench.document import EMPTY, Document
from paraflex.workbench.session import EditSession
from workbenches import Talk, hosted, served

FIVE_BAR = library_text("five_bar")


@pytest.fixture
def model(tmp_path: Path) -> Path:
    file = tmp_path / "mine.toml"
    file.write_text(FIVE_BAR, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory):
    with hosted("five_bar", folder=tmp_path_factory.mktemp("served")) as (_, address):
        keeps_it_alive = Talk(address)
        yield address
        keeps_it_alive.socket.close()


def status(address: str, **headers: str) -> int:
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=60) as found:
            return found.status
    except urllib.error.HTTPError as error:
        return error.code


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_a_byte_order_mark_is_kept(tmp_path, mark):
    file = tmp_path / "mine.toml"
    file.write_bytes(mark + b'name = "one"\n')
    document = Document(str(file), drafts=tmp_path)
    assert document.text == 'name = "one"\n'
    document.change('name = "two"\n')
    document.save()
    assert file.read_bytes() == mark + b'name = "two"\n'
    # Another program writes the file without a mark, or with one.
    file.write_bytes(b"\xef\xbb\xbf"[: 3 - len(mark)] + b'name = "three"\n')
    assert document.take_up()
    document.change('name = "four"\n')
    document.save()
    assert file.read_bytes() == b"\xef\xbb\xbf"[: 3 - len(mark)] + b'name = "four"\n'


def test_the_page_loads_nothing_from_elsewhere(address):
    for part in ("", "workbench.js", "workbench.css"):
        with urllib.request.urlopen(address + part, timeout=60) as found:
            policy = found.headers["Content-Security-Policy"]
            assert "default-src 'none'" in policy
            assert "http" not in policy
            assert found.headers["Cache-Control"] == "no-store"
            text = found.read().decode()
            assert "https://" not in text


def test_only_those_who_know_the_token_are_answered(address):
    host = "/".join(address.split("/")[:3])
    for place in ("/", "/socket", "/workbench.js", "/x/", f"/{'a' * 24}/"):
        assert status(host + place) == 404
    with pytest.raises(InvalidStatus):
        Talk(f"{host}/{'a' * 24}/")


@pytest.mark.parametrize("origin", ["http://example.org", "null", "https://127.0.0.1", "http://localhost", None])
def test_other_pages_are_refused(address, origin):
    with pytest.raises((InvalidStatus, ConnectionClosed)):
        Talk(address, origin=origin).ask("open")
    if origin is not None:
        assert status(address, Origin=origin) == 404


def test_a_name_that_was_bound_to_this_machine_is_refused(address):
    assert status(address, Host="example.org") == 404
    assert status(address, Host="localhost") == 404


def test_files_that_were_not_made_are_not_there(address):
    for place in (
        "made/0/report.html",
        "made/-1/x",
        "made/99999999999999999999/x",
        "made/0/..%2f..%2fetc%2fpasswd",
        "../x",
    ):
        assert status(address + place) == 404


HOSTILE = [
    "", "null", "[]", "3", '"open"', "{}", '{"do": 3}', '{"do": null, "id": []}', '{"do": "__init__"}',
    '{"do": "close"}', '{"do": "text"}', '{"do": "text", "text": 7}', '{"do": "text", "text": "["}',
    '{"do": "view", "limits": "abcd"}', '{"do": "view", "limits": [1, 2, NaN, 4]}', '{"do": "start", "name": "../x"}',
    '{"do": "view", "limits": [1e308, 1e308, -1e308, 0]}', '{"do": "view", "limits": [0, 0, 1e-300, 1e-300]}',
    '{"do": "save", "name": "/proc/x.toml"}', '{"do": "save", "name": "a\\u0000.toml"}',
    '{"do": "start", "name": "four_bars:-1"}', '{"do": "start", "name": "four_bars:99999999999999999999"}',
    '{"id": 1e400, "do": "open"}', "[" * 100_000, '{"do":' * 50_000, "\u0000", "{'do': 'open'}",
    '{"do": "text", "text": "' + "a." * 30_000 + ' = 1"}', '{"do": "start", "link": "#model=AAAA"}',
    '{"do": "leave", "what": "../x"}', '{"do": "fields", "place": [[], {}]}', '{"do": "act", "action": {"kind": []}}',
]  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_messages_bring_one_line(address, text):
    talk = Talk(address)
    talk.send(text)
    found = talk.reply()
    if "error" in found:
        assert "\n" not in found["error"]["text"]
        assert "itself" not in found["error"]["text"]
        assert len(found["error"]["text"]) < 1000
    assert talk.ok("open")["revision"] >= 0
    talk.ok("start", name="five_bar")
    talk.socket.close()


def test_too_large_a_message_ends_only_its_own_page(address):
    talk = Talk(address)
    with pytest.raises(ConnectionClosed):  # noqa: PT012  where it is noticed depends on the socket
        talk.send("x" * 9_000_000)
        talk.reply()
    assert Talk(address).ok("open")["name"] == "five_bar"


def test_bytes_are_no_message(address):
    talk = Talk(address)
    talk.send(b"\xff\x00")
    with pytest.raises(ConnectionClosed):
        talk.reply()
    assert Talk(address).ok("open")["name"] == "five_bar"


def test_random_messages_never_raise(tmp_path):
    session, random_ = EditSession(Document("five_bar", drafts=tmp_path), lambda _: None), random.Random(3)
    names = [name.removeprefix("_do_") for name in dir(session) if name.startswith("_do_")]
    names = [name for name in names if name not in ("save", "leave", "run")]
    # Those that compute for long are asked for less often.
    weights = [1 if name in ("turn", "library", "assemblies", "check", "linear") else 5 for name in names]
    values = [
        None,
        True,
        -1,
        0,
        1e308,
        float("nan"),
        float("inf"),
        "",
        "x",
        "../x",
        "link1.A",
        [],
        [1, 2],
        [[1, 2], "a"],
        {},
        {"kind": "delete"},
    ]
    fields = [
        "text",
        "name",
        "limits",
        "action",
        "place",
        "body",
        "local",
        "to",
        "point",
        "names",
        "number",
        "drive",
        "mode",
        "modes",
        "ref",
        "force",
        "what",
    ]
    for _ in range(600):
        message = {"id": 1, "do": random_.choices(names, weights)[0]}
        message |= {random_.choice(fields): random_.choice(values) for _ in range(random_.randrange(4))}
        found = session.answer(message)
        assert json.dumps(found, allow_nan=False)
        assert "ok" in found or "\n" not in found["error"]["text"]
    session.close()


def test_two_pages_see_the_same_text(model, tmp_path):
    with hosted(str(model), folder=tmp_path) as (_, address):
        one, other = Talk(address), Talk(address)
        assert other.ok("open")["text"] == FIVE_BAR
        one.ok("text", text=FIVE_BAR.replace("0.250", "0.300"))
        seen = other.event("state")["state"]
        assert seen["text"] == FIVE_BAR.replace("0.250", "0.300")
        assert not seen["saved"]
        other.ok("undo")
        # What a page has changed itself is in the reply alone.
        assert one.event("state")["state"]["text"] == FIVE_BAR
        assert model.read_text(encoding="utf-8") == FIVE_BAR


def test_a_file_changed_by_another_program_is_taken_up(model, tmp_path):
    with hosted(str(model), folder=tmp_path) as (_, address):
        talk = Talk(address)
        talk.ok("text", text=FIVE_BAR + "# mine\n")
        model.write_text(FIVE_BAR + "# theirs\n", encoding="utf-8")
        state = talk.event("state")["state"]
        assert (state["text"], state["saved"]) == (FIVE_BAR + "# theirs\n", True)
        assert talk.ok("undo")["text"] == FIVE_BAR + "# mine\n"
        assert not talk.ok("open")["saved"]


def test_a_save_does_not_overwrite_what_another_program_has_just_written(tmp_path):
    file, other = tmp_path / "mine.toml", FIVE_BAR + "# theirs\n"
    file.write_text(FIVE_BAR, encoding="utf-8")
    session = EditSession(Document(str(file), drafts=tmp_path), lambda _: None)
    session.answer({"id": 1, "do": "text", "text": FIVE_BAR + "# mine\n"})
    file.write_text(other, encoding="utf-8")
    assert "another program" in session.answer({"id": 2, "do": "save"})["ok"]["note"]
    assert file.read_text(encoding="utf-8") == session.document.text == other
    assert session.answer({"id": 3, "do": "undo"})["ok"]["text"] == FIVE_BAR + "# mine\n"
    assert "ok" in session.answer({"id": 4, "do": "save"})
    assert file.read_text(encoding="utf-8") == FIVE_BAR + "# mine\n"


def test_the_server_ends_with_its_last_page(tmp_path):
    with served("five_bar", folder=tmp_path) as (child, address):
        one, other = Talk(address), Talk(address)
        one.socket.close()
        other.ok("open")
        other.socket.close()
        done = child.end()
    assert (done.returncode, done.stderr) == (0, "")


def test_ctrl_c_is_its_usual_end(tmp_path):
    with served("five_bar", folder=tmp_path) as (child, address):
        talk = Talk(address)
        talk.ok("open")
        child.send(signal.SIGINT)
        done = child.end()
    assert (done.returncode, done.stderr) == (0, "")


def test_unsaved_work_survives_a_kill(model, tmp_path):
    mine = FIVE_BAR + "# unsaved\n"
    with served("mine.toml", folder=tmp_path) as (child, address):
        Talk(address).ok("text", text=mine)
        child.send(signal.SIGKILL)
        child.end()
    with hosted(str(model), folder=tmp_path) as (_, address):
        talk = Talk(address)
        found = talk.ok("open")
        assert (found["text"], found["recovered"], found["saved"]) == (mine, True, False)
        assert talk.ok("undo")["text"] == FIVE_BAR == model.read_text(encoding="utf-8")


def test_a_kill_in_the_middle_of_a_save_leaves_a_whole_file(model, tmp_path):
    texts = {FIVE_BAR} | {FIVE_BAR + f"# {k}\n" * 20_000 for k in range(2)}
    for wait in (0.0, 0.05, 0.13):
        with served("mine.toml", folder=tmp_path) as (child, address):
            talk = Talk(address)
            for text in sorted(texts):
                talk.send(json.dumps({"id": 0, "do": "text", "text": text}))
                talk.send(json.dumps({"id": 0, "do": "save"}))
            time.sleep(wait)
            child.send(signal.SIGKILL)
            child.end()
        assert model.read_text(encoding="utf-8") in texts


def test_documents_have_a_history(tmp_path):
    document = Document(None, drafts=tmp_path)
    assert (document.text, document.saved, document.can_undo) == (EMPTY, True, False)
    document.change("a = 1\n")
    document.change("a = 1\n")
    document.change("a = 2\n")
    document.undo()
    document.change("a = 3\n")
    assert not document.can_redo
    document.undo()
    document.undo()
    document.undo()
    assert (document.text, document.can_undo, document.can_redo) == (EMPTY, False, True)


def test_long_histories_forget_the_middle_but_not_the_beginning(tmp_path):
    document = Document(None, drafts=tmp_path)
    for k in range(1500):
        document.change(f"a = {k}\n")
    for _ in range(1500):
        document.undo()
    assert document.text == EMPTY


def test_what_is_not_a_file_of_a_model_is_refused_before_a_page_is_served(tmp_path):
    from shell import paraflex

    (tmp_path / "wrong.toml").write_bytes(b"\xff\xfe")
    (tmp_path / "folder.toml").mkdir()
    for source in ("five_baar", "wrong.toml", "folder.toml", "notes.txt"):
        done = paraflex("edit", str(tmp_path / source) if "." in source else source, "--no-open")
        assert done.returncode == 2, done
        assert len(done.stderr.strip().splitlines()) == 1
