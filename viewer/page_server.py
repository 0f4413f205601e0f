"""The server of the page: static files, and a web socket for each page that is open."""

from __future__ import annotations

import asyncio
import errno
import hashlib
import logging
import secrets
import signal
import socket
from collections.abc import AsyncIterator, Coroutine
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn, Protocol
from urllib.parse import parse_qs

import msgspec

from gridpeers.scenarios.live.run_address import UsageError, is_loopback_host
from gridpeers.wire.driver.drive import StoppedError

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import HTTPConnection, Request
    from starlette.responses import Response
    from starlette.websockets import WebSocket

PAGE = Path(__file__).parent / "page"

KINDS = {".css": "text/css", ".js": "text/javascript"}

HEARTBEAT = 0.25
"""Longest time (s) between two frames: a page that hears nothing for a second knows that its numbers are old."""

SILENT = 1.0

FASTEST = 0.05

_log = logging.getLogger("view")

COOKIE = "gridpeers_view"

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")

HEADERS = {
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",  # without any, a browser posts the token as of no origin
    "Cache-Control": "no-store",
}

_ASK_TOKEN = """<!doctype html><html lang="en"><meta charset="utf-8"><title>gridpeers view</title>
<link rel="stylesheet" href="/static/view.css"><main class="ask"><h1>gridpeers view</h1>
<form method="post" action="/token"><label>Token, as the command printed it
<input name="token" type="password" autofocus required></label><button>Open</button></form>
<p role="alert">%s</p></main></html>"""


Talk = Coroutine[Any, Any, None]


class Pages(Protocol):
    """What the pages show: a live run, or records."""

    def close(self) -> None: ...

    def talk(self, socket: WebSocket) -> tuple[Talk, Talk]:
        """Return what sends a page what it shows, and what takes what it says; both end with the first of them."""
        ...


class PageServer:
    """Serve pages to whoever knows the token ("" asks for none), under names of the page in an address.

    () takes any name. Without a list, a page of others could reach this one under a name of theirs (DNS rebinding).
    """

    def __init__(self, pages: Pages, token: str = "", hosts: tuple[str, ...] = LOOPBACK) -> None:
        self._pages, self._token, self._hosts = pages, token, hosts

    def run(self, listening: socket.socket) -> None:
        """Serve on a socket that listens; SIGINT ends in KeyboardInterrupt, SIGTERM in StoppedError."""
        import uvicorn

        config = uvicorn.Config(
            self._app(),
            log_level="error",
            access_log=False,
            server_header=False,
            ws="websockets-sansio",
            ws_max_size=4096,
            ws_per_message_deflate=False,
            ws_ping_interval=None,  # frames are the heartbeat; uvicorn tells nobody of a page that it gives up
            timeout_graceful_shutdown=1,
        )
        logging.getLogger("uvicorn.error").addFilter(lambda line: "graceful shutdown" not in str(line.msg))
        signal.signal(signal.SIGTERM, _stop)  # uvicorn ends, and then raises the signal again
        try:
            uvicorn.Server(config).run(sockets=[listening])
        finally:
            self._pages.close()

    def _app(self) -> Starlette:
        from starlette.applications import Starlette
        from starlette.routing import Route, WebSocketRoute

        return Starlette(
            routes=[
                Route("/", self._index),
                Route("/token", self._take_token, methods=["POST"]),
                Route("/static/{name}", self._static),
                WebSocketRoute("/frames", self._page),
            ]
        )

    def _admits(self, connection: HTTPConnection) -> bool:
        """Return whether a request comes from our own page: under a name of ours, and not from a page of others."""
        host = connection.headers.get("host", "")
        name = host.rpartition(":")[0] if host.rpartition(":")[2].isdigit() else host
        origin = connection.headers.get("origin")
        known = not self._hosts or name in self._hosts
        return known and (origin is None or origin in (f"http://{host}", f"https://{host}"))

    def _knows_token(self, connection: HTTPConnection) -> bool:
        token = self._token
        return not token or secrets.compare_digest(connection.cookies.get(COOKIE, "").encode(), _hashed(token).encode())

    async def _index(self, request: Request) -> Response:
        if not self._admits(request):
            return _refusal()
        if (given := request.query_params.get("token")) is not None:
            return self._let_in(given)
        if not self._knows_token(request):
            return _answer(_ASK_TOKEN % "", 401)
        return _answer((PAGE / "index.html").read_text())

    async def _take_token(self, request: Request) -> Response:
        if not self._admits(request):
            return _refusal()
        body = (await request.body())[:1000].decode(errors="replace")
        return self._let_in(parse_qs(body).get("token", [""])[0])

    def _let_in(self, given: str) -> Response:
        token = self._token
        if token and not secrets.compare_digest(_hashed(given), _hashed(token)):
            return _answer(_ASK_TOKEN % "That is not the token of this view.", 401)
        answer = _answer("", 303, Location="/")
        if token:
            answer.set_cookie(COOKIE, _hashed(token), httponly=True, samesite="strict")
        return answer

    async def _static(self, request: Request) -> Response:
        found = next((file for file in PAGE.iterdir() if file.name == request.path_params["name"]), None)
        if found is None or found.suffix not in KINDS or not self._admits(request):
            return _answer("not found", 404, "text/plain")
        return _answer(found.read_text(), 200, KINDS[found.suffix])

    async def _page(self, socket: WebSocket) -> None:
        from starlette.websockets import WebSocketDisconnect

        if not (self._admits(socket) and self._knows_token(socket)):
            await socket.close(4403)
            return
        await socket.accept()
        tasks = [asyncio.create_task(each) for each in self._pages.talk(socket)]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            for end in await asyncio.gather(*tasks, return_exceptions=True):
                if isinstance(end, Exception) and not isinstance(end, WebSocketDisconnect):
                    _log.error("a page was closed by an error", exc_info=end)


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    raise StoppedError(signal.Signals(number).name)


def _hashed(token: str) -> str:
    """Return a token as its cookie has it: a header takes few letters, a token may have any."""
    return hashlib.sha256(token.encode()).hexdigest()


def _refusal() -> Response:
    return _answer("this page is open under the address that the command printed, and no other", 403, "text/plain")


def _answer(text: str, status: int = 200, kind: str = "text/html", **headers: str) -> Response:
    from starlette.responses import Response

    return Response(text, status, HEADERS | headers, kind)


async def texts(socket: WebSocket) -> AsyncIterator[str]:
    while (message := await socket.receive())["type"] != "websocket.disconnect":
        if (text := message.get("text")) is not None:
            yield text


def as_json(value: Any) -> str:
    return msgspec.json.encode(value).decode()


async def send(socket: WebSocket, text: str) -> None:
    """Send a page a message; WebSocketDisconnect if the page has gone, or the server has closed the connection."""
    from starlette.websockets import WebSocketDisconnect

    try:
        await socket.send_text(text)
    except RuntimeError as error:  # of uvicorn, once it has closed the connection itself
        raise WebSocketDisconnect(1006, str(error)) from error


def listen(address: str, port: int) -> socket.socket:
    """Return a socket that listens; port 0 takes any free one. UsageError if the port is in use."""
    if not 0 <= port <= 65535:
        raise UsageError(f"--port: a port is a number from 0 to 65535, got {port}")
    try:
        family, kind, protocol, _, where = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM)[0]
    except OSError:
        raise UsageError(
            f'--address: "{address}" is not an address; 127.0.0.1 is this host alone, 0.0.0.0 all'
        ) from None
    listening = socket.socket(family, kind, protocol)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(where)
        listening.listen(64)
    except OSError as error:
        listening.close()
        if error.errno == errno.EADDRINUSE:
            raise UsageError(
                f"--port: {port} of {address} is in use; give another one, or 0 for any free one"
            ) from None
        raise UsageError(f"--address: {address} cannot be listened on: {error.strerror}") from None
    return listening


def access(address: str, token: str) -> tuple[str, tuple[str, ...]]:
    """Return the token that a page must know, and the names under which the page answers; () takes any name.

    On this host's loopback no token is needed, and only names of this host are taken. Beyond it a token is: without a
    given one it is made up.
    """
    if token != token.encode(errors="replace").decode():
        raise UsageError("--token: is not text; give letters and digits")
    if is_loopback_host(address):
        return token, tuple(dict.fromkeys((*LOOPBACK, address)))
    return token or secrets.token_urlsafe(16), ()


def url_of(listening: socket.socket, address: str) -> str:
    host = f"[{address}]" if ":" in address else address
    return f"http://{host}:{listening.getsockname()[1]}/"
