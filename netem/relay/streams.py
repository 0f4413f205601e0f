"""The relay of TCP: every connection to it goes on to the target, byte for byte, in order."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import struct
from functools import partial
from typing import Any

from netem.draws import Stream
from netem.relay.bottleneck import NEVER, Bottleneck
from netem.relay.direction import Direction, Road
from netem.relay.segments import SIZE, Segments

WINDOW = 4 << 20
"""Bytes that may be on the way: what Linux gives a connection at most (tcp_wmem)."""

_LINGER = struct.pack("ii", 1, 0)
"""Close at once: what is unsent is thrown away, and the other side gets RST."""


class _Way:
    """One direction of a connection."""

    def __init__(
        self,
        road: Road,
        directions: tuple[Direction, Direction],
        name: str,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> None:
        self._road, (self._direction, back) = road, directions
        self._reader, self._writer = reader, writer
        counts = self._direction.counts

        def on_loss() -> None:
            counts.lost += 1

        stream = partial(Stream, road.seed, name, self._direction.name)
        self._queue = Bottleneck(self._direction.faults.rate)
        self._segments = Segments(stream, lambda: (self._direction.faults, back.faults), on_loss)
        self._ended = False
        self._work, self._room = asyncio.Event(), asyncio.Event()

    async def read(self) -> None:
        """Take in, as long as there is room."""
        loop, counts = asyncio.get_running_loop(), self._direction.counts
        while data := await self._reader.read(SIZE):
            counts.came += 1
            self._queue.put(data, loop.time())
            self._work.set()
            while self._queue.bytes >= self._direction.faults.queue or self._segments.bytes >= WINDOW:
                self._room.clear()
                await self._room.wait()
        self._ended = True
        self._work.set()

    async def write(self) -> None:
        """Give out what has arrived."""
        loop, counts, queue, segments = asyncio.get_running_loop(), self._direction.counts, self._queue, self._segments
        self._road.listeners.add(self._work.set)
        try:
            while True:
                self._work.clear()
                now = loop.time()
                queue.set_rate(self._direction.faults.rate, now)
                for data, left in queue.take(now):
                    segments.send(data, left)
                stalled = self._road.opens > now
                if not stalled and (ready := segments.take(now)):
                    counts.forwarded += len(ready)
                    self._writer.write(b"".join(ready))
                    await self._writer.drain()
                self._room.set()
                if self._ended and not queue and not segments:
                    break
                until = min(queue.until, self._road.opens if stalled else segments.until)
                timer = loop.call_at(until, self._work.set) if until < NEVER else None
                await self._work.wait()
                if timer is not None:
                    timer.cancel()
            self._writer.write_eof()
        finally:
            self._road.listeners.discard(self._work.set)
            counts.cut += len(queue) + len(segments)


class TcpRelay:
    """Relays connections.

    Parameters
    ----------
    road : Road
        What is done to their bytes.
    near : socket.socket
        Bound, not yet listening.
    target : tuple[int, tuple]
        Family and address of the other end.
    """

    def __init__(self, road: Road, near: socket.socket, target: tuple[int, tuple[Any, ...]]) -> None:
        self._road, self._near, self._target = road, near, target
        self._family, self._address = near.family, near.getsockname()
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._writers: set[asyncio.StreamWriter] = set()

    def __len__(self) -> int:
        return len(self._tasks)

    async def start(self) -> None:
        """Accept connections."""
        self._server = await asyncio.start_server(self._accept, sock=self._near)

    async def reset(self) -> None:
        """Close all connections with RST."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def cut(self) -> None:
        """Reset, and refuse whoever comes."""
        await self._deafen()
        # bound but not listening: the port stays ours, and the kernel answers SYN with RST
        self._near = socket.socket(self._family, socket.SOCK_STREAM)
        self._near.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._near.bind(self._address)
        await self.reset()

    async def heal(self) -> None:
        """Accept again."""
        if self._server is None:
            await self.start()

    async def close(self) -> None:
        """End."""
        await self._deafen()
        await self.reset()

    async def _deafen(self) -> None:
        if self._server is not None:
            self._server.close()
            self._server = None
        self._near.close()

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.get_running_loop().create_task(self._relay(reader, writer))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        # a task that is cancelled before its first step never comes to its own `finally`
        task.add_done_callback(lambda _: _abort([writer]))

    async def _relay(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        name, road = str(self._road.new_connection()), self._road
        writers = [writer]
        family, address = self._target
        work: list[asyncio.Task[None]] = []
        try:
            far_reader, far_writer = await asyncio.open_connection(*address[:2], family=family)
            writers.append(far_writer)
            there = _Way(road, (road.there, road.back), name, reader, far_writer)
            back = _Way(road, (road.back, road.there), name, far_reader, writer)
            loop = asyncio.get_running_loop()
            work = [loop.create_task(does()) for way in (there, back) for does in (way.read, way.write)]
            await asyncio.gather(*work)
        except OSError:  # one side is gone, or was never there: the other is told as the kernel would tell it
            _abort(writers)
        except asyncio.CancelledError:
            _abort(writers)
            raise
        finally:
            for task in work:
                task.cancel()
            await asyncio.gather(*work, return_exceptions=True)
            for one in writers:
                one.close()
                with contextlib.suppress(OSError):
                    await one.wait_closed()


def _abort(writers: list[asyncio.StreamWriter]) -> None:
    for writer in writers:
        sock = writer.get_extra_info("socket")
        if sock is not None and sock.fileno() >= 0:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER)
        writer.transport.abort()
