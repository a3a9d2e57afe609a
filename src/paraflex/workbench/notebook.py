"""The page in a notebook, as an anywidget."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paraflex.errors import InputError
from .document import Document
from .messages import Message
from .page import module, style
from .session import EditSession

if TYPE_CHECKING:
    from paraflex.files import Model
    from paraflex.mechanism import Mechanism


def edit(model: Model | Mechanism | str | Path | None = None) -> Any:
    """Return a widget that edits a model in a notebook.

    Parameters
    ----------
    model : Model, Mechanism, str or Path, optional
        Model, or its name or file; an empty sheet by default. The widget's `text` is the text of the model's file.

    Raises
    ------
    InputError
        Model that cannot be read, or anywidget is missing.
    """
    try:
        from anywidget import AnyWidget
    except ImportError:
        raise InputError("anywidget is missing", field="edit", remedy="pip install 'paraflex[edit]'") from None

    class Workbench(AnyWidget):
        """Editor of one document; `text` is its text and `model` what it describes."""

        _esm = module()
        _css = style()

        def __init__(self, document: Document) -> None:
            super().__init__()
            self.session = EditSession(document, self.send)
            self.on_msg(lambda _, message, __: self.send(_with_data(self.session.answer(message))))

        @property
        def text(self) -> str:
            """Text of the model's file."""
            return self.session.document.text

        @property
        def edited(self) -> Model:
            """Model of the text; InputError if it cannot be read."""
            return self.session.bench.read()

    return Workbench(_document(model))


def _with_data(reply: Message) -> Message:
    """Return a reply with the contents of the file that it names, as a notebook has no server for it."""
    made = reply.get("ok", {}).get("file") if "address" in reply.get("ok", {}) else None
    if made is None:
        return reply
    return {**reply, "ok": {**reply["ok"], "data": base64.b64encode(Path(made).read_bytes()).decode("ascii")}}


def _document(model: Model | Mechanism | str | Path | None) -> Document:
    if model is None or isinstance(model, str | Path):
        return Document(None if model is None else str(model))
    from paraflex.files.model import text_of_model

    return Document(text=text_of_model(model))
