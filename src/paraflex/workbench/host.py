"""Server of the page on this machine alone; its address has a token that other programs and pages do not know."""

import asyncio
import json
import secrets
import socket
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, suppress
from contextvars import ContextVar, copy_context
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from .document import Document
from .page import module, page, style
from .session import SLOW, EditSession

# Largest message [bytes], time without a page after which the server ends, and time between two looks at the file [s].
_LARGEST, _ALONE, _LOOK = 8_000_000, 4.0, 0.3
_SERVING: dict[str, Any] = {
    "log_level": "critical", "lifespan": "on", "ws": "websockets-sansio", "ws_max_size": _LARGEST,
    "timeout_graceful_shutdown": 1,
}  # fmt: skip
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# Reports are complete in one file and load nothing.
_MADE_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; "
    "font-src data:"
)

# Replies to the page whose message is being answered; None when a file has changed.
_ASKING: ContextVar[Any] = ContextVar("replies to the page that asks", default=None)


class Host:
    """Server of one document for any number of pages.

    Parameters
    ----------
    document : Document
        Text that is edited.
    """

    def __init__(self, document: Document) -> None:
        self._socket = socket.create_server(("127.0.0.1", 0))
        self._port: int = self._socket.getsockname()[1]
        self._place: str = f"/{secrets.token_urlsafe(18)}"
        self._pages: dict[WebSocket, asyncio.Queue[dict[str, Any]]] = {}
        self._loop: asyncio.AbstractEventLoop | None = None
        self._opened = False
        self._context = copy_context()
        # One thread for all messages: they are answered in their order.
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="workbench")
        self._slow = ThreadPoolExecutor(1, thread_name_prefix="workbench-slow")
        self.session: EditSession = EditSession(document, self._send)
        self._server = uvicorn.Server(uvicorn.Config(self._app(), **_SERVING))

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://127.0.0.1:{self._port}{self._place}/"

    def serve(self) -> None:
        """Serve until the last page has been closed for some seconds, or a signal ends the process."""
        try:
            asyncio.run(self._server.serve(sockets=[self._socket]))
        finally:
            self._worker.shutdown(cancel_futures=True)
            self._slow.shutdown(cancel_futures=True)
            self.session.close()
            self._socket.close()

    def end(self) -> None:
        """End serving."""
        self._server.should_exit = True

    def _app(self) -> Starlette:
        place = self._place
        return Starlette(
            routes=[
                Route(f"{place}/", self._answer(page, "text/html")),
                Route(f"{place}/workbench.js", self._answer(module, "text/javascript")),
                Route(f"{place}/workbench.css", self._answer(style, "text/css")),
                Route(f"{place}/made/{{number:int}}/{{name}}", self._made),
                WebSocketRoute(f"{place}/socket", self._talk),
            ],
            lifespan=self._alive,
        )

    def _is_ours(self, asked: Request | WebSocket) -> bool:
        """Return whether a request names this server as its host, and no other page as its origin."""
        host = f"127.0.0.1:{self._port}"
        origin = asked.headers.get("origin")
        return asked.headers.get("host") == host and origin in (None, f"http://{host}")

    def _answer(self, text: Callable[[], str], kind: str) -> Callable[[Request], Any]:
        async def answer(request: Request) -> Response:
            if not self._is_ours(request):
                return PlainTextResponse("not found", 404)
            return Response(text(), media_type=f"{kind}; charset=utf-8", headers=_headers(_POLICY))

        return answer

    async def _made(self, request: Request) -> Response:
        """Answer with a file that was made for a page, such as a report."""
        made = self.session.made(request.path_params["number"]) if self._is_ours(request) else None
        if made is None or not made.is_file():
            return PlainTextResponse("not found", 404)
        return FileResponse(made, headers=_headers(_MADE_POLICY))

    async def _talk(self, page: WebSocket) -> None:
        """Answer the messages of one page until it leaves."""
        if not self._is_ours(page) or page.headers.get("origin") is None:
            await page.close(4403)
            return
        await page.accept()
        replies: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._pages[page], self._opened = replies, True
        sending = asyncio.create_task(_send_all(page, replies))
        try:
            while True:
                text = await page.receive_text()
                self._take(_parsed(text), replies)
        except (WebSocketDisconnect, RuntimeError, KeyError):
            pass
        finally:
            del self._pages[page]
            sending.cancel()

    def _take(self, message: Any, replies: "asyncio.Queue[dict[str, Any]]") -> None:
        """Have a message answered after those before it; slow ones after other slow ones."""
        slow = isinstance(message, dict) and message.get("do") in SLOW
        loop = asyncio.get_running_loop()
        future = loop.run_in_executor(self._slow if slow else self._worker, self._answered, message, replies)
        future.add_done_callback(lambda done: done.cancelled() or replies.put_nowait(done.result()))

    def _answered(self, message: Any, replies: "asyncio.Queue[dict[str, Any]]") -> dict[str, Any]:
        context = self._context.copy()
        context.run(_ASKING.set, replies)
        return context.run(self.session.answer, message)

    def _send(self, event: dict[str, Any]) -> None:
        """Send an event to all pages, from any thread; the state of a document is in the reply to who changed it."""
        asking = _ASKING.get() if event["event"] == "state" else None
        if self._loop is not None:
            with suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._put, event, asking)

    def _put(self, event: dict[str, Any], asking: "asyncio.Queue[dict[str, Any]] | None") -> None:
        for replies in self._pages.values():
            if replies is not asking:
                replies.put_nowait(event)

    @asynccontextmanager
    async def _alive(self, _: Starlette) -> AsyncIterator[None]:
        """Look for changes of the file, and end when no page has been there for a while after the first one."""
        self._loop = asyncio.get_running_loop()
        watching = asyncio.create_task(self._watch())
        yield
        watching.cancel()

    async def _watch(self) -> None:
        alone = 0.0
        while True:
            await asyncio.sleep(_LOOK)
            alone = 0.0 if self._pages else alone + _LOOK
            if self._opened and alone > _ALONE:
                self.end()
            await asyncio.get_running_loop().run_in_executor(self._worker, self.session.take_up)


async def _send_all(page: WebSocket, replies: "asyncio.Queue[dict[str, Any]]") -> None:
    while True:
        await page.send_text(json.dumps(await replies.get(), allow_nan=False))


def _parsed(text: str) -> Any:
    """Return a message; None, which is refused, for a text that is not JSON."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _headers(policy: str) -> dict[str, str]:
    return {
        "Content-Security-Policy": policy, "Cache-Control": "no-store", "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer", "Cross-Origin-Resource-Policy": "same-origin",
    }  # fmt: skip
