"""Datagrams on the way, and the relay of UDP."""

from __future__ import annotations

import asyncio
import heapq
import socket
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from netem.draws import Stream
from netem.relay.bottleneck import NEVER, Bottleneck
from netem.relay.direction import Direction, Road

LARGEST = 65536
"""No datagram is longer (bytes)."""

IDLE = 60.0
"""Time (s) after which who said nothing is forgotten, once somebody new comes: NAT boxes keep UDP for as long."""

BUFFER = 4 << 20
"""Bytes asked for in the kernel, so that nothing is lost but by our doing."""


class Datagrams:
    """One direction of a conversation over a link that delays, drops and reorders. Time is an argument (s).

    Parameters
    ----------
    direction : Direction
        What is set for it.
    stream : Callable[[str], Stream]
        The random numbers of this conversation and direction, for a purpose: the fate of datagram n depends on n alone.
    """

    def __init__(self, direction: Direction, stream: Callable[[str], Stream]) -> None:
        self._direction = direction
        self._loss, self._delay, self._reorder = stream("loss"), stream("delay"), stream("reorder")
        self._queue = Bottleneck(direction.faults.rate)
        self._flight: list[tuple[float, int, bytes]] = []
        self._numbers: deque[int] = deque()
        self._number = 0

    def __len__(self) -> int:
        return len(self._queue) + len(self._flight)

    def send(self, data: bytes, now: float) -> None:
        """Put a datagram on its way."""
        faults = self._direction.faults
        self._number += 1
        self._queue.set_rate(faults.rate, now)
        if self._queue and self._queue.bytes + len(data) > faults.queue:
            self._direction.counts.full += 1
        else:
            self._queue.put(data, now)
            self._numbers.append(self._number)

    def take(self, now: float) -> list[bytes]:
        """What arrives by now."""
        faults = self._direction.faults
        self._queue.set_rate(faults.rate, now)
        for data, left in self._queue.take(now):
            number = self._numbers.popleft()
            if self._loss.uniform(number) < faults.loss:
                self._direction.counts.lost += 1
                continue
            delay = faults.delayed(self._delay.uniform(number))
            if self._reorder.uniform(number) < faults.reorder:
                delay = 0.0
            heapq.heappush(self._flight, (left + delay, number, data))
        ready = []
        while self._flight and self._flight[0][0] <= now:
            ready.append(heapq.heappop(self._flight)[2])
        return ready

    @property
    def until(self) -> float:
        """When something is to be done next (s)."""
        return min(self._queue.until, self._flight[0][0] if self._flight else NEVER)


class _Carrier:
    """Carries the datagrams of one direction of a conversation, when their time has come."""

    def __init__(self, road: Road, direction: Direction, name: str, forward: Callable[[bytes], bool]) -> None:
        self._road, self._direction, self._forward = road, direction, forward
        self._line = Datagrams(direction, partial(Stream, road.seed, name, direction.name))
        self._timer: asyncio.TimerHandle | None = None
        self._loop = asyncio.get_running_loop()
        self.last = self._loop.time()
        """When the last one came (s)."""
        road.listeners.add(self.look)

    def came(self, data: bytes) -> None:
        self._direction.counts.came += 1
        self.last = self._loop.time()
        self._line.send(data, self.last)
        self.look()

    def look(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        now, counts = self._loop.time(), self._direction.counts
        stalled = self._road.opens > now
        if not stalled:
            for data in self._line.take(now):
                if self._road.is_cut or not self._forward(data):
                    counts.cut += 1
                else:
                    counts.forwarded += 1
        until = self._road.opens if stalled else self._line.until
        if len(self._line) and until < NEVER:
            self._timer = self._loop.call_at(until, self.look)

    def close(self) -> None:
        self._road.listeners.discard(self.look)
        self._direction.counts.cut += len(self._line)
        if self._timer is not None:
            self._timer.cancel()


class _Conversation:
    """One who talks to the relay, with a socket of his own towards the target."""

    def __init__(self, road: Road, target: tuple[int, tuple[Any, ...]], answer: Callable[[bytes], bool]) -> None:
        family, address = target
        self.far = socket.socket(family, socket.SOCK_DGRAM)
        self.far.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        self.far.setblocking(False)
        self.far.connect(address)
        name = str(road.new_connection())
        self.there = _Carrier(road, road.there, name, self._forward)
        self.back = _Carrier(road, road.back, name, answer)
        asyncio.get_running_loop().add_reader(self.far, self._answered)

    def _forward(self, data: bytes) -> bool:
        try:
            self.far.send(data)
        except OSError:  # nobody listens there, or the kernel has no room: as on a wire, it is lost
            return False
        return True

    def _answered(self) -> None:
        try:
            data = self.far.recv(LARGEST)
        except OSError:  # word from the kernel that nobody listened
            return
        self.back.came(data)

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self.far)
        self.far.close()
        self.there.close()
        self.back.close()


class UdpRelay:
    """Relays datagrams: each who sends to `near` talks with the target through a socket of his own.

    Parameters
    ----------
    road : Road
        What is done to them.
    near : socket.socket
        Bound.
    target : tuple[int, tuple[Any, ...]]
        Family and address of the other end.
    """

    def __init__(self, road: Road, near: socket.socket, target: tuple[int, tuple[Any, ...]]) -> None:
        self._road, self._near, self._target = road, near, target
        self._conversations: dict[tuple[Any, ...], _Conversation] = {}

    def __len__(self) -> int:
        return len(self._conversations)

    async def start(self) -> None:
        """Begin."""
        self._near.setblocking(False)
        self._near.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        asyncio.get_running_loop().add_reader(self._near, self._came)

    async def reset(self) -> None:
        """Forget all conversations."""
        while self._conversations:
            self._conversations.popitem()[1].close()

    async def cut(self) -> None:
        """Everything is dropped from now on: `Road.is_cut` says it."""

    async def heal(self) -> None:
        """Nothing is dropped any more."""

    async def close(self) -> None:
        """End."""
        asyncio.get_running_loop().remove_reader(self._near)
        await self.reset()
        self._near.close()

    def _came(self) -> None:
        try:
            data, address = self._near.recvfrom(LARGEST)
        except OSError:
            return
        conversation = self._conversations.get(address)
        if conversation is None:
            self._forget_idle()
            conversation = _Conversation(self._road, self._target, lambda data: self._answer(data, address))
            self._conversations[address] = conversation
        conversation.there.came(data)

    def _answer(self, data: bytes, address: tuple[Any, ...]) -> bool:
        try:
            self._near.sendto(data, address)
        except OSError:
            return False
        return True

    def _forget_idle(self) -> None:
        before = asyncio.get_running_loop().time() - IDLE
        for address, one in list(self._conversations.items()):
            if max(one.there.last, one.back.last) < before:
                self._conversations.pop(address).close()
