"""A workbench that a test serves: its process, its address, and a page that talks to it without a browser."""

from __future__ import annotations

import json
import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

from paraflex.workbench.document import Document
from paraflex.workbench.host import Host
from processes import Child, started


@contextmanager
def served(*arguments: str, folder: Path, **environment: str) -> Iterator[tuple[Child, str]]:
    """A process of `paraflex edit` and the address of its page; drafts are kept in the folder."""
    env = {"XDG_STATE_HOME": str(folder / "state"), **environment}
    with started(sys.executable, "-m", "paraflex", "edit", *arguments, "--no-open", cwd=folder, env=env) as child:
        child.until(lambda: "Ctrl-C" in child.out)
        yield child, re.search(r"http://\S+/", child.out)[0]  # type: ignore[index]


@contextmanager
def hosted(source: str | None = None, *, folder: Path) -> Iterator[tuple[Host, str]]:
    """A server as `paraflex edit` has it, with the same drafts, in a thread: a process would first import all again."""
    host = Host(Document(source, drafts=folder / "state" / "paraflex" / "drafts"))
    thread = threading.Thread(target=host.serve)
    thread.start()
    try:
        yield host, host.address
    finally:
        host.end()
        thread.join()


class Talk:
    """A page without a browser."""

    def __init__(self, address: str, **options: Any) -> None:
        self.origin = re.match(r"http://[^/]+", address)[0]  # type: ignore[index]
        options = {"origin": self.origin, "max_size": None, "proxy": None, "close_timeout": 1, **options}
        # Entered and never left: the socket is closed by the test or with its process.
        self.socket: ClientConnection = connect(address.replace("http", "ws", 1) + "socket", **options).__enter__()
        self.events: list[dict[str, Any]] = []
        self._next = 0

    def send(self, text: str | bytes) -> None:
        """Send anything."""
        self.socket.send(text)

    def take(self) -> dict[str, Any]:
        """The next message from Python."""
        return json.loads(self.socket.recv(timeout=60))

    def reply(self) -> dict[str, Any]:
        """The next reply; events before it are kept."""
        while "event" in (found := self.take()):
            self.events.append(found)
        return found

    def ask(self, what: str, **fields: Any) -> dict[str, Any]:
        """The whole reply to a request."""
        self._next += 1
        self.send(json.dumps({"id": self._next, "do": what, **fields}))
        found = self.reply()
        assert found["id"] == self._next
        return found

    def ok(self, what: str, **fields: Any) -> dict[str, Any]:
        """What a request brings that is not refused."""
        found = self.ask(what, **fields)
        assert "ok" in found, found
        return found["ok"]

    def event(self, name: str) -> dict[str, Any]:
        """The next event of a name."""
        while True:
            found = self.events.pop(0) if self.events else self.take()
            if found.get("event") == name:
                return found
