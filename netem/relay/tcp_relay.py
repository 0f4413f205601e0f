"""The relay of TCP: every connection to it goes on to the target, byte for byte, in order."""

from __future__ import annotations

import asyncio
import socket
import struct
from functools import partial
from typing import Any, cast

from netem.draws import Stream
from netem.relay.direction import Direction
from netem.relay.flow import Flow, RelayedLink
from netem.relay.line import ImpairedLine
from netem.relay.segments import SIZE, Segments

_LINGER = struct.pack("ii", 1, 0)
"""Close at once: what is unsent is thrown away, and the other side gets RST."""


class _End(asyncio.Protocol):
    """One end of a connection: its data leave at the other end."""

    def __init__(self, relay: TcpRelay, name: str, direction: Direction, back: Direction) -> None:
        way = Segments(partial(Stream, relay.link.seed, name, direction.name), direction, back)
        self.flow = Flow(relay.link, ImpairedLine(direction, way), self._forward, self._after_look)
        self.flow.is_blocked = True
        self.other = self
        self.transport: asyncio.Transport | None = None
        """None before it is connected and after it is closed."""
        self._relay = relay
        self._has_ended = self.is_done = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = cast("asyncio.Transport", transport)
        if self.flow.is_closed:  # ended meanwhile
            self.close(reset=True)
        else:
            self.resume_writing()

    def data_received(self, data: bytes) -> None:
        for start in range(0, len(data), SIZE):
            self.flow.put(data[start : start + SIZE])

    def eof_received(self) -> bool:
        self._has_ended = True
        self.flow.look()
        return True  # bytes on the way go on, and so does the other direction

    def pause_writing(self) -> None:
        self.other.flow.is_blocked = True

    def resume_writing(self) -> None:
        self.other.flow.unblock()

    def connection_lost(self, error: Exception | None) -> None:
        self.transport = None
        self._relay.end(self, reset=error is not None)

    def close(self, *, reset: bool) -> None:
        """Close it: at once with RST, or after the last byte."""
        self.flow.close()
        if self.transport is None:
            return
        sock = self.transport.get_extra_info("socket")
        if not reset:
            self.transport.close()
        elif sock is not None and sock.fileno() >= 0:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER)
            self.transport.abort()

    def _forward(self, segments: list[bytes]) -> None:
        assert self.other.transport is not None
        if not self.other.transport.is_closing():  # else it ends in this turn of the loop
            self.other.transport.writelines(segments)

    def _after_look(self) -> None:
        """Read on only if there is room; after the last byte, end the other end too."""
        if self.transport is None or self.other.transport is None:
            return
        if not self._has_ended:
            (self.transport.resume_reading if self.flow.line.has_room else self.transport.pause_reading)()
        elif not self.flow.line and not self.is_done:
            self.is_done = True
            try:
                self.other.transport.write_eof()
            except OSError:  # that end has gone
                self._relay.end(self, reset=True)
            if self.other.is_done:
                self._relay.end(self, reset=False)


class TcpRelay:
    """Relays connections from a bound socket to the target, which is a family and an address."""

    noun = "connection"

    def __init__(self, link: RelayedLink, near: socket.socket, target: tuple[int, tuple[Any, ...]]) -> None:
        self.link, self._near, self._target = link, near, target
        self._is_listening = False
        self._connections: set[_End] = set()
        """The near ends."""
        self._tasks: set[asyncio.Task[None]] = set()

    def __len__(self) -> int:
        return len(self._connections)

    async def start(self) -> None:
        """Begin."""
        self._listen()

    def _listen(self) -> None:
        # not by asyncio's own server, which forgets a connection that comes at the moment at which it is closed
        self._near.listen()
        self._near.setblocking(False)
        asyncio.get_running_loop().add_reader(self._near, self._accept)
        self._is_listening = True

    def reset(self) -> None:
        """Close all connections with RST."""
        for near in list(self._connections):
            self.end(near, reset=True)

    def cut(self) -> None:
        """Reset, and refuse new connections."""
        family, address = self._near.family, self._near.getsockname()
        self.close()
        # bound but not listening: the port stays ours, and the kernel answers SYN with RST
        self._near = socket.socket(family, socket.SOCK_STREAM)
        self._near.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._near.bind(address)

    def heal(self) -> None:
        """Accept again."""
        if not self._is_listening:
            self._listen()

    def close(self) -> None:
        """End."""
        if self._is_listening:
            asyncio.get_running_loop().remove_reader(self._near)
            self._is_listening = False
        self._near.close()
        self.reset()

    def _accept(self) -> None:
        try:
            sock, _ = self._near.accept()
        except OSError:  # it has gone again
            return
        link, name = self.link, self.link.new_connection()
        near, far = _End(self, name, link.there, link.back), _End(self, name, link.back, link.there)
        near.other, far.other = far, near
        self._connections.add(near)
        task = asyncio.get_running_loop().create_task(self._connect(near, sock))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _connect(self, near: _End, sock: socket.socket) -> None:
        loop, (family, address) = asyncio.get_running_loop(), self._target
        try:
            await loop.connect_accepted_socket(lambda: near, sock)
            await loop.create_connection(lambda: near.other, *address[:2], family=family)
        except OSError:  # nobody listens there: the near end learns it as from the kernel
            self.end(near, reset=True)

    def end(self, end: _End, *, reset: bool) -> None:
        """Close both ends of a connection, and forget it when both are closed."""
        for one in (end, end.other):
            one.close(reset=reset)
        if end.transport is None and end.other.transport is None:
            self._connections -= {end, end.other}
