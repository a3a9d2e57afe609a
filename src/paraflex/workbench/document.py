"""The text of a model file while it is edited: its history, the file on the disk, and a draft that survives a crash."""

import codecs
import hashlib
import os
from contextlib import suppress
from pathlib import Path

from paraflex.errors import InputError, OutputError
from paraflex.files.library import library_names, library_text
from paraflex.files.read import exists, read_text
from paraflex.writing import write_text
from .leaving import text_of_link

EMPTY = 'name = "untitled"\n'
# Largest number of steps that can be undone, and of characters of all their texts.
_STEPS, _LETTERS = 1000, 50_000_000


class Document:
    """Text of a model file with its history; the file changes only when it is saved.

    Parameters
    ----------
    source : str, optional
        File, which need not exist yet, name of a library mechanism, or link of a model; an empty sheet by default.
    text : str, optional
        Text of a model without a file, in place of a source.
    drafts : Path, optional
        Folder of drafts; by default that of the user's state.

    Raises
    ------
    InputError
        File that cannot be read, or a name of neither a file nor a library mechanism.
    """

    def __init__(self, source: str | None = None, *, text: str | None = None, drafts: Path | None = None) -> None:
        self.file, text = _opened(source) if text is None else (None, text)
        self.name: str = "untitled" if source is None or "#model=" in source else source
        self.folder: Path = Path() if self.file is None else self.file.parent
        self._steps, self._now, self._on_disk = [text], 0, text if self.file is not None else None
        self._stamp, self._mark = self._stamped(), self._marked()
        folder = _drafts() if drafts is None else drafts
        self._draft = folder / f"{hashlib.sha256(str(self._identity()).encode()).hexdigest()[:20]}.toml"
        # Sheets without a name have no drafts: two of them would share one.
        self._has_draft = source is not None
        self.recovered: bool = self._has_draft and self._recover()

    @property
    def text(self) -> str:
        """The text now."""
        return self._steps[self._now]

    @property
    def saved(self) -> bool:
        """Whether the file on the disk has this text; True for a library mechanism that was not changed."""
        return self.text == (self._steps[0] if self._on_disk is None else self._on_disk)

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to take back."""
        return self._now > 0

    @property
    def can_redo(self) -> bool:
        """Whether a step was taken back."""
        return self._now + 1 < len(self._steps)

    def change(self, text: str, *, same: bool = False) -> None:
        """Make a text the next step of the history, or the same one again; one that does not differ is no step."""
        if text == self.text:
            return
        if same and self._now:
            self._now -= 1
        self._steps[self._now + 1 :] = [text]
        self._now += 1
        while len(self._steps) > 2 and (len(self._steps) > _STEPS or sum(map(len, self._steps)) > _LETTERS):
            # The text at the beginning stays, so that undoing everything returns to it.
            del self._steps[1]
            self._now -= 1
        self._keep()

    def undo(self) -> None:
        """Return to the step before, if there is one."""
        self._now = max(self._now - 1, 0)
        self._keep()

    def redo(self) -> None:
        """Return to the step that was taken back last, if there is one."""
        self._now = min(self._now + 1, len(self._steps) - 1)
        self._keep()

    def save(self, name: str | None = None) -> Path:
        """Write the text to the file, or to another one, which is then the file of the document.

        Raises
        ------
        InputError
            No file is known, or the name does not end in .toml or is that of another existing file.
        OutputError
            The file cannot be written.
        """
        file = self.file if name is None else self._named(name)
        if file is None:
            raise InputError("the model has no file yet", field="file", remedy="give a name, such as mine.toml")
        write_text(file, self._mark + self.text, remedy="choose another name")
        self.file, self.folder, self.name = file, file.parent, str(file)
        self._on_disk, self._stamp = self.text, self._stamped()
        with suppress(OSError):
            self._draft.unlink()
        return file

    def take_up(self) -> bool:
        """Make the text that another program has written to the file the next step; return whether there was one."""
        stamp = self._stamped()
        if self.file is None or stamp == self._stamp:
            return False
        try:
            text = read_text(self.file)
        except InputError:
            # A file that is gone, or no text any more, is not what was saved.
            lost, self._stamp, self._on_disk = self.saved, stamp, ""
            return lost
        self._stamp, self._mark = stamp, self._marked()
        if text == self._on_disk:
            return False
        self._on_disk = text
        self.change(text)
        return True

    def _named(self, name: str) -> Path:
        """Return the file of a name that a page gave: in the folder of the model or below it, and not there yet."""
        file = Path(name)
        if file.suffix != ".toml" or not name.isprintable() or file.is_absolute() or ".." in file.parts:
            remedy = f"a file in {self.folder.resolve()} or below it, which ends in .toml"
            raise InputError("not the name of a model file", field="file", value=name[:100], remedy=remedy)
        file = self.folder / file
        if exists(file) and (self.file is None or file.resolve() != self.file.resolve()):
            raise InputError("already there", field="file", value=str(file), remedy="choose another name")
        return file

    def _identity(self) -> Path | str:
        return self.name if self.file is None else self.file.resolve()

    def _stamped(self) -> str:
        """Return a text that changes when the file is written; empty while there is no file."""
        with suppress(OSError, ValueError):
            if self.file is not None:
                state = self.file.stat()
                return f"{state.st_mtime_ns} {state.st_size} {state.st_ino}"
        return ""

    def _marked(self) -> str:
        """Return the byte order mark with which the file begins, which is no part of its text; empty without one."""
        with suppress(OSError, ValueError):
            if self.file is not None:
                with self.file.open("rb") as stream:
                    return codecs.BOM_UTF8.decode() if stream.read(3) == codecs.BOM_UTF8 else ""
        return ""

    def _keep(self) -> None:
        """Write the draft, or delete it if the file has its text; a folder that cannot be written means no draft."""
        with suppress(OSError, OutputError):
            if not self._has_draft:
                return
            if self.saved:
                self._draft.unlink(missing_ok=True)
            else:
                self._draft.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                write_text(self._draft, self.text)

    def _recover(self) -> bool:
        """Make a draft of the file, left by a process that ended without saving, the next step."""
        with suppress(InputError, OSError):
            if self._draft.is_file():
                before = self.text
                self.change(read_text(self._draft))
                return self.text != before
        return False


def _opened(source: str | None) -> tuple[Path | None, str]:
    """Return the file of a source, None for an empty sheet, a link and the library, and its text."""
    if source is None:
        return None, EMPTY
    if "#model=" in source:
        return None, text_of_link(source)
    file = Path(source)
    if exists(file) or file.suffix == ".toml":
        return file, read_text(file) if exists(file) else EMPTY
    if ":" in source or source in library_names():
        return None, library_text(source)
    raise InputError(
        "neither a library mechanism nor a file", field="mechanism", value=source,
        remedy="name a file NAME.toml, which need not exist, or one of the library: paraflex info lists it",
    )  # fmt: skip


def _drafts() -> Path:
    """Return the folder of drafts, as the XDG base directories define it."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "paraflex" / "drafts"
