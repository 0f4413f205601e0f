"""A page that never reads: its server ends without a word of it."""

from __future__ import annotations

import base64
import os
import signal
import socket
import subprocess
import sys

import pytest

pytest.importorskip("uvicorn", reason="the page needs the extra view")

SERVER = """
import asyncio, functools, socket, uvicorn
uvicorn.Config = functools.partial(uvicorn.Config, ws_ping_interval=0.1, ws_ping_timeout=0.1)
from gridpeers.viewer.page_server import PageOptions, PageServer, send, texts
class Pages:
    def begin(self): pass
    def end(self): pass
    def close(self): pass
    def talk(self, page):
        async def talk():
            asyncio.get_running_loop().call_later(0.5, functools.partial(print, "given up", flush=True))
            while True:
                await send(page, "x" * {size})
                await asyncio.sleep(0.001)
        async def hear():
            async for text in texts(page): pass
        return talk(), hear()
listening = socket.create_server(("127.0.0.1", 0))
listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
print(listening.getsockname()[1], flush=True)
try:
    PageServer(Pages(), PageOptions()).run(listening)
except KeyboardInterrupt:
    print("ended")
"""
"""Serves pages many frames, with uvicorn's patience cut to a fraction of a second."""


@pytest.mark.parametrize("size", [200, 60_000])
def test_a_page_that_never_reads_leaves_no_traceback(size: int) -> None:
    """Whether or not its frames find room, uvicorn would give it up after a while; then somebody ends the server."""
    server = subprocess.Popen(
        [sys.executable, "-c", SERVER.replace("{size}", str(size))],
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
