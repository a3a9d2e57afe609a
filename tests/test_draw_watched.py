"""`paraflex draw --watch`: its page over HTTP, and in a browser where there is one."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import sys
import threading
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from paraflex.cli import draw as command, watch
from paraflex.cli.commands.models import DrawRequest, ModelChoice
from paraflex.cli.watch import WatchServer, sliders
from paraflex.files import library_text
from processes import started
from shell import paraflex


def save(file: Path, text: str) -> None:
    """Save a file as editors do, which rename a new one; files of the same size within a tick of the clock differ."""
    new = file.with_suffix(".new")
    new.write_text(text, encoding="utf-8")
    os.replace(new, file)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    file = tmp_path / "mine.toml"
    save(file, library_text("five_bar").replace("l1 = 0.250 ", 'l1 = "250 mm" '))
    return file


@pytest.fixture
def server(model: Path) -> Iterator[WatchServer]:
    with WatchServer(DrawRequest(model=ModelChoice(source=str(model)))) as made:
        thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield made
        made.shutdown()
        thread.join()


def ask(address: str, what: str = "", **about: Any) -> Any:
    """Ask for a part of the page; JSON is parsed."""
    with urllib.request.urlopen(f"{address}{what}?{urllib.parse.urlencode(about, doseq=True)}", timeout=60) as found:
        text = found.read().decode("utf-8")
        return json.loads(text) if found.headers["Content-Type"] == "application/json" else text


def status(address: str) -> int:
    try:
        with urllib.request.urlopen(address, timeout=60) as found:
            return found.status
    except urllib.error.HTTPError as error:
        return error.code


def test_the_page_and_its_drawing(server: WatchServer) -> None:
    assert "<html" in ask(server.address)
    found = ask(server.address, "drawing")
    assert found["svg"].startswith("<svg")
    assert (found["name"], found["problems"]) == ("five-bar", [])
    assert found["parameters"] == [
        {"name": "base", "number": 0.1, "unit": "", "low": 0.05, "high": pytest.approx(0.15)},
        {"name": "l1", "number": 250.0, "unit": "mm", "low": 125.0, "high": 375.0},
        {"name": "l2", "number": 0.25, "unit": "", "low": 0.125, "high": 0.375},
    ]


def test_a_value_is_drawn_and_the_file_stays(server: WatchServer, model: Path) -> None:
    before = model.read_bytes()
    usual = ask(server.address, "drawing")
    shorter = ask(server.address, "drawing", set=["parameters.l1=220 mm"])
    assert shorter["svg"] != usual["svg"]
    # Sliders are those of the file.
    assert shorter["parameters"] == usual["parameters"]
    assert ask(server.address, "drawing", set=["parameters.l1=0.22"])["svg"] == shorter["svg"]
    assert model.read_bytes() == before
    assert ask(server.address, "drawing")["svg"] == usual["svg"]


def test_values_of_the_command_line_are_below_those_of_sliders(model: Path) -> None:
    choice = ModelChoice(source=str(model), settings=["parameters.l1=0.22", "parameters.l2=0.26"])
    with (
        WatchServer(DrawRequest(model=choice)) as made,
        WatchServer(DrawRequest(model=ModelChoice(str(model)))) as plain,
    ):
        assert made.drawing([])["svg"] == plain.drawing(["parameters.l1=0.22", "parameters.l2=0.26"])["svg"]
        expected = plain.drawing(["parameters.l1=0.23", "parameters.l2=0.26"])["svg"]
        assert made.drawing(["parameters.l1=0.23"])["svg"] == expected


def test_a_change_of_the_file_is_answered_when_it_is_saved(server: WatchServer, model: Path) -> None:
    stamp = ask(server.address, "changed", after="")["stamp"]
    answers: list[dict[str, str]] = []
    waiting = threading.Thread(target=lambda: answers.append(ask(server.address, "changed", after=stamp)))
    waiting.start()
    waiting.join(0.5)
    assert waiting.is_alive()
    save(model, model.read_text(encoding="utf-8").replace("l2 = 0.250", "l2 = 0.260"))
    waiting.join(60)
    assert answers[0]["stamp"] not in ("", stamp)
    assert ask(server.address, "drawing")["parameters"][2]["number"] == 0.26


def test_an_answer_comes_without_a_change_too(server: WatchServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watch, "_LONGEST", 0.05)
    stamp = ask(server.address, "changed", after="")["stamp"]
    assert ask(server.address, "changed", after=stamp) == {"stamp": stamp}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('length = "l1"', 'length = "l9"', "body.proximal1.length: "),
        ("[parameters]", "[parameters", "file: not valid TOML"),
    ],
)
def test_an_error_is_told_once_and_the_next_version_is_drawn(
    server: WatchServer, model: Path, capfd: pytest.CaptureFixture[str], old: str, new: str, says: str
) -> None:
    right = model.read_text(encoding="utf-8")
    save(model, right.replace(old, new, 1))
    found = ask(server.address, "drawing")
    assert set(found) == {"error"}
    assert says in found["error"]
    assert str(model) in found["error"]
    assert ask(server.address, "drawing") == found
    save(model, right)
    assert "svg" in ask(server.address, "drawing")
    told = capfd.readouterr()
    assert told.err == f"error: {found['error']}\n"
    assert told.out == "drawn again\n"


def test_links_that_do_not_meet_are_drawn_with_a_remark(server: WatchServer) -> None:
    found = ask(server.address, "drawing", set=["parameters.l2=0.06"])
    assert found["svg"].startswith("<svg")
    assert "beyond reach" in " ".join(found["problems"])


def test_a_file_that_is_away_for_a_moment(server: WatchServer, model: Path) -> None:
    text = model.read_text(encoding="utf-8")
    model.unlink()
    assert "cannot be read" in ask(server.address, "drawing")["error"]
    assert ask(server.address, "changed", after="")["stamp"] == "none"
    save(model, text)
    assert "svg" in ask(server.address, "drawing")


@pytest.mark.parametrize("setting", ["parameters.l1=nan", "parameters.l1=1e300", "parameters.l1=-1", "parameters.q=1",
                                     "parameters.l1=3 kg", "=", "parameters.l1=", "l1", "\x00=\x00"])  # fmt: skip
def test_wrong_values_are_errors_of_the_page(server: WatchServer, setting: str) -> None:
    found = ask(server.address, "drawing", set=[setting])
    assert set(found) == {"error"} or "svg" in found
    assert "svg" in ask(server.address, "drawing")
    if setting not in ("parameters.l1=-1", "parameters.l1=1e300"):
        assert "error" in found


def test_only_requests_with_the_token_on_this_machine_are_answered(server: WatchServer) -> None:
    host, token = server.address.split("/")[2:4]
    assert len(token) >= 20
    assert status(server.address) == 200
    other = token[:-1] + ("a" if token[-1] != "a" else "b")
    for place in (
        "",
        "drawing",
        f"{token[:-1]}/drawing",
        f"{other}/",
        f"{other}/drawing",
        "x" * 5000,
        "%00/é".encode(),
    ):
        text = place if isinstance(place, str) else urllib.parse.quote(place)
        assert status(f"http://{host}/{text}") == 404
    assert server.server_address[0] == "127.0.0.1"
    with socket.create_connection(("127.0.0.1", server.server_port)) as broken:
        broken.sendall(b"GET /\xff\xfe\x00 HTTP/1.0\r\n\r\n")
        assert b" 404 " in broken.recv(100)
    # Another method is not known.
    request = urllib.request.Request(f"{server.address}drawing", data=b"", method="POST")
    with pytest.raises(urllib.error.HTTPError, match="501"):
        urllib.request.urlopen(request, timeout=60)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", []),
        ("[parameters]", []),
        ('[parameters]\na = 0\nb = -2\nc = "3 N m/rad"\nd = "2 * b"\ne = "5"', [
            ("a", 0.0, "", -1.0, 1.0), ("b", -2.0, "", -3.0, -1.0), ("c", 3.0, "N m/rad", 1.5, 4.5),
            ("e", 5.0, "", 2.5, 7.5),
        ]),
        ("[parameters]\na = nan\nb = inf\nc = true\nd = [1.0]", []),
        ('[parameters]\na = "1e-3 mm"\nb = "2 mm + 1 mm"\nc = "mm"', [("a", 1e-3, "mm", 0.5e-3, 1.5e-3)]),
    ],
)  # fmt: skip
def test_sliders_are_for_numbers(text: str, found: list[tuple[Any, ...]]) -> None:
    names = ("name", "number", "unit", "low", "high")
    assert [tuple(one[name] for name in names) for one in sliders(text)] == found


def test_a_library_mechanism_has_sliders_too() -> None:
    with WatchServer(DrawRequest(model=ModelChoice("five_bar"))) as made:
        assert len(made.drawing(["parameters.l1=0.22"])["parameters"]) == 3


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("five_bar", "--output", "a.svg"), "--output: has no effect with --watch"),
        (("five_bar", "--theme", "grey"), "error: --theme: unknown theme (got 'grey')"),
        (("nowhere.toml",), "nowhere.toml: file: cannot be read"),
        (("five_baar",), 'did you mean "five_bar"?'),
    ],
)
def test_what_cannot_be_watched_is_refused(tmp_path: Path, options: tuple[str, ...], says: str) -> None:
    done = paraflex("draw", *options, "--watch", "--no-open", cwd=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert says in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_with_a_line(model: Path, number: int, code: int) -> None:
    with started(sys.executable, "-m", "paraflex", "draw", model, "--watch", "--no-open") as child:
        child.until(lambda: "Ctrl-C ends this\n" in child.out)
        (address,) = re.findall(r"http://127\.0\.0\.1:\d+/[\w-]+/", child.out)
        assert "svg" in ask(address, "drawing")
        child.send(number)
        done = child.end()
    assert done.returncode == code
    assert done.stderr == ""
    assert done.stdout.splitlines()[1:] == [f"{model} is no longer watched"]
    with pytest.raises(OSError):  # noqa: PT011  # refused, or reset
        ask(address)


def test_the_browser_is_opened_where_asked_for(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(command.webbrowser, "open", lambda address: opened.append(address) or True)

    def end(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(WatchServer, "serve_forever", end)
    assert paraflex("draw", model, "--watch", "--open").returncode == 0
    assert paraflex("draw", model, "--watch", "--no-open").returncode == 0
    (address,) = opened
    assert address.startswith("http://127.0.0.1:")


# --- In a browser ------------------------------------------------------------------------------------------------


@pytest.fixture
def page(browser: Any, server: WatchServer) -> Iterator[Any]:
    complaints: list[str] = []
    context = browser.new_context()
    opened = context.new_page()
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on(
        "request",
        lambda request: None if request.url.startswith((server.address, "data:")) else complaints.append(request.url),
    )
    opened.goto(server.address)
    opened.wait_for_selector("svg")
    yield opened
    context.close()
    assert complaints == []


def drag(page: Any, name: str, value: float) -> None:
    page.eval_on_selector(
        f"input[name={name}]", "(one, value) => { one.value = value; one.dispatchEvent(new Event('input')); }", value
    )


def test_a_slider_draws_and_gives_the_text_to_paste(page: Any, model: Path) -> None:
    before = page.inner_html("#drawing")
    assert page.inner_text("label:nth-child(2)").split() == ["l1", "250", "mm"]
    assert page.inner_text("#paste") == ""
    drag(page, "l1", 220.04)
    drag(page, "l2", 0.26)
    page.wait_for_function("before => document.getElementById('drawing').innerHTML !== before", arg=before)
    assert page.inner_text("label:nth-child(2)").split() == ["l1", "220", "mm"]
    assert page.inner_text("#paste").splitlines() == ["[parameters]", 'l1 = "220 mm"', "l2 = 0.26"]
    assert 'l1 = "250 mm"' in model.read_text(encoding="utf-8")


SAME = """expected => {
  const one = document.createElement("div");
  one.innerHTML = expected;
  return one.innerHTML === document.getElementById("drawing").innerHTML;
}"""


def test_the_page_follows_the_file_and_keeps_the_last_drawing(page: Any, server: WatchServer, model: Path) -> None:
    drag(page, "base", 0.12)
    right = model.read_text(encoding="utf-8")
    save(model, right.replace("[parameters]", "[parameters", 1))
    page.wait_for_function("document.getElementById('error').textContent.includes('not valid TOML')")
    assert page.query_selector("svg") is not None
    save(model, right.replace("base = 0.100", "base = 0.110").replace("l2 = 0.250", "l2 = 0.255"))
    page.wait_for_function("document.getElementById('sliders').textContent.includes('0.255')")
    page.wait_for_function("document.getElementById('error').textContent === ''")
    # A slider whose value has changed in the file is where the file is.
    page.wait_for_function(SAME, arg=server.drawing([])["svg"])
    assert page.inner_text("label:nth-child(1)").split() == ["base", "0.11"]
    assert page.inner_text("#paste") == ""


def test_the_end_of_the_server_is_told(page: Any, server: WatchServer) -> None:
    server.shutdown()
    server.socket.close()
    drag(page, "l2", 0.26)
    page.wait_for_function("document.getElementById('error').textContent === 'paraflex draw has ended'")
    assert page.query_selector("svg") is not None
