"""Who may open the page, and what its server takes and gives."""

from __future__ import annotations

import asyncio
import base64
import os
import signal
import socket
import subprocess
import sys
from typing import Any, cast

import pytest

from gridpeers.scenarios.live.run_address import UsageError
from gridpeers.viewer.page_server import access, texts

pytest.importorskip("uvicorn", reason="the page needs the extra view")

SERVER = """
import asyncio, functools, socket, uvicorn
uvicorn.Config = functools.partial(uvicorn.Config, ws_ping_interval=0.1, ws_ping_timeout=0.1)
from gridpeers.viewer.page_server import PageServer, send, texts
class Pages:
    def close(self): pass
    def talk(self, page):
        async def talk():
            asyncio.get_running_loop().call_later(0.5, functools.partial(print, "given up", flush=True))
            while True:
                await send(page, "x" * 60_000)
                await asyncio.sleep(0.001)
        async def hear():
            async for text in texts(page): pass
        return talk(), hear()
listening = socket.create_server(("127.0.0.1", 0))
listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
print(listening.getsockname()[1], flush=True)
try:
    PageServer(Pages()).run(listening)
except KeyboardInterrupt:
    print("ended")
"""
"""Serves pages many frames, with uvicorn's patience cut to a fraction of a second."""


def test_a_page_that_never_reads_leaves_no_traceback() -> None:
    """Its frames find no room, and uvicorn would give it up after a while; then somebody ends the server."""
    server = subprocess.Popen(
        [sys.executable, "-c", SERVER],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    with server, socket.socket() as page:
        assert server.stdout is not None
        port = int(server.stdout.readline())
        page.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        page.connect(("127.0.0.1", port))
        key = base64.b64encode(os.urandom(16)).decode()
        page.sendall(
            f"GET /frames HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        said = server.stdout.readline()
        server.send_signal(signal.SIGINT)
        assert said + server.stdout.read() == "given up\nended\n"


class Socket:
    """A page that sends this, and goes."""

    def __init__(self, *messages: dict[str, Any]) -> None:
        self._messages = list(messages)

    async def receive(self) -> dict[str, Any]:
        """The next message, as starlette has it."""
        return self._messages.pop(0)


def test_bytes_are_nobodys_question_and_end_nothing() -> None:
    """A binary message is passed over, as are texts that nobody understands; what comes behind it is read."""
    kind = "websocket.receive"
    page = Socket(
        {"type": kind, "bytes": b"x"},
        {"type": kind, "text": None, "bytes": b"y"},
        {"type": kind, "text": "z"},
        {"type": "websocket.disconnect", "code": 1000},
    )

    async def read() -> list[str]:
        return [text async for text in texts(cast(Any, page))]

    assert asyncio.run(read()) == ["z"]


@pytest.mark.parametrize("address", ["0.0.0.0", "::", "lab.example"])
def test_beyond_this_host_a_token_is_asked_for(address: str) -> None:
    """It is made up, another one each time, unless one is given; the page answers under any name."""
    first, second = access(address, ""), access(address, "")

    assert len(first[0]) >= 20
    assert first[0] != second[0]
    assert first[1] == ()
    assert access(address, "mine") == ("mine", ())


@pytest.mark.parametrize("address", ["127.0.0.1", "localhost", "::1"])
def test_on_this_host_no_token_is_needed_but_a_name_of_this_host_is(address: str) -> None:
    """A page of others reaches it under no name of theirs."""
    token, hosts = access(address, "")

    assert token == ""
    assert {"127.0.0.1", "localhost", "[::1]"} <= set(hosts)
    assert access(address, "mine")[0] == "mine"


def test_a_token_of_no_text_is_refused() -> None:
    """Bytes of a command line that are no UTF-8 can be typed into no page."""
    with pytest.raises(UsageError, match="--token: has bytes that are no text"):
        access("127.0.0.1", "a\udcff")
