"""The workbench in a notebook: the widget answers as the server does, and gives what it holds."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import pytest

import paraflex as pf
from paraflex.errors import InputError
from paraflex.files import library_text


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """What a widget sends to its page."""
    from anywidget import AnyWidget

    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    found: list = []
    monkeypatch.setattr(AnyWidget, "send", lambda _, content, buffers=None: found.append(content))
    return found


def ask(widget, sent, do, **fields):
    widget._handle_custom_msg({"id": 7, "do": do, **fields}, [])
    found = sent[-1]
    assert found["id"] == 7
    return found


def test_the_widget_answers_as_the_server_does(sent):
    widget = pf.edit("five_bar")
    assert ask(widget, sent, "open")["ok"]["text"] == widget.text == library_text("five_bar")
    changed = widget.text.replace("l1 = 0.250", "l1 = 0.300")
    assert ask(widget, sent, "text", text=changed)["ok"]["undo"]
    assert widget.edited.mechanism.body("proximal1").length == 0.3
    assert "error" in ask(widget, sent, "nonsense")


def test_what_is_made_for_a_page_is_in_the_reply(sent):
    made = ask(pf.edit("five_bar"), sent, "leave", what="svg")["ok"]
    assert b"<svg" in base64.b64decode(made["data"])


def test_models_of_python_can_be_edited(sent):
    model = pf.load("four_bar", set={"crank": 0.12})
    for given in (model, model.mechanism):
        assert pf.edit(given).edited.mechanism == model.mechanism


def test_an_empty_sheet_is_the_default(sent):
    widget = pf.edit()
    assert widget.text == 'name = "untitled"\n'
    with pytest.raises(InputError, match="body"):
        _ = widget.edited


def test_one_module_has_all_parts(sent):
    module = pf.edit("five_bar")._esm
    assert "export default" in str(module)
    assert not re.search(r"^import ", str(module), re.MULTILINE)


def test_an_unknown_model_is_refused():
    with pytest.raises(InputError, match="neither a library mechanism nor a file"):
        pf.edit("five_baar")
