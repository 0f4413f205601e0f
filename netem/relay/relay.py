"""The relay itself: a thread with an event loop, told what to do line by line."""

from __future__ import annotations

import asyncio
import socket
import threading
from types import TracebackType
from typing import Any

from netem.relay import relay_commands as words
from netem.relay.bottleneck import NEVER
from netem.relay.datagrams import UdpRelay
from netem.relay.direction import Counts, Direction, Road
from netem.relay.endpoint import Endpoint
from netem.relay.faults import Faults, FaultsError
from netem.relay.streams import TcpRelay

PATIENCE = 10.0
"""Longest wait (s) for the own thread to answer: it never waits for the network."""


class RelayError(ValueError):
    """A relay cannot be had; the message says why and what to do."""


class Relay:
    """A relay between two endpoints. Use it as a context.

    Peers must learn of nobody but the relay: the one listens at the target, the other connects to `endpoint`, and
    gossip is off, or they find each other and go past it.

    Parameters
    ----------
    listen : str
        Where the relay listens, e.g. ``tcp/127.0.0.1:0`` for any free port.
    connect : str
        The target, of the same transport. It need not be there yet.
    there, back : Faults, optional
        What is done to the traffic towards the target, and from it.
    seed : int, optional
        Of the random numbers.

    Raises
    ------
    EndpointError
        If an endpoint is none.
    RelayError
        If the two are of different transports, a host is unknown, or the relay cannot listen.
    FaultsError
        If TCP is told to reorder.
    """

    def __init__(
        self, listen: str, connect: str, *, there: Faults | None = None, back: Faults | None = None, seed: int = 0
    ) -> None:
        near, self._target = Endpoint.parse(listen), Endpoint.parse(connect)
        if near.transport != self._target.transport:
            raise RelayError(f"{listen} -> {connect}: a relay does not turn {near.transport} into another transport")
        self._transport = near.transport
        self._road = Road(Direction("there", there or Faults()), Direction("back", back or Faults()), seed)
        self._check(self._road.there.faults, self._road.back.faults)
        target = _resolve(self._target)
        self._near = _bind(near)
        self.endpoint = str(near._replace(port=self._near.getsockname()[1]))
        """Where it listens."""
        make = TcpRelay if near.transport == "tcp" else UdpRelay
        self._relay: TcpRelay | UdpRelay = make(self._road, self._near, target)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="netem relay", daemon=True)

    def __enter__(self) -> Relay:
        self._thread.start()
        self._wait(self._relay.start())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._wait(self._relay.close())
        self._wait(_settle())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(PATIENCE)
        self._loop.close()

    def do(self, line: str) -> str:
        """Do what a line says; see `netem.relay.relay_commands.HELP`.

        Returns
        -------
        str
            One line: what is so now.

        Raises
        ------
        WordError
            If the line is not understood.
        FaultsError
            If its values cannot be meant; nothing has changed then.
        """
        word = words.read(line)
        return str(self._wait(self._obey(word)))

    def counts(self) -> tuple[Counts, Counts]:
        """What was counted towards the target, and from it."""
        return self._road.there.counts, self._road.back.counts

    async def _obey(self, word: words.Word) -> str:
        road = self._road
        match word:
            case words.Change():
                return self._change(word)
            case words.Stall():
                road.opens = asyncio.get_running_loop().time() + word.duration
                road.changed()
                return "stalled until heal" if word.duration == NEVER else f"stalled for {word.duration:g} s"
            case "reset":
                ended = len(self._relay)
                await self._relay.reset()
                return f"{ended} {self._noun(ended)} reset"
            case "cut":
                road.is_cut = True
                await self._relay.cut()
                return "cut until heal"
            case "heal":
                road.is_cut, road.opens = False, -NEVER
                await self._relay.heal()
                road.changed()
                return "healed"
            case "show":
                return self._show()
            case "end":
                return "ending"

    def _change(self, change: words.Change) -> str:
        ways = [way for way in (self._road.there, self._road.back) if way.name in change.directions]
        try:
            new = [change.on(way.faults) for way in ways]
        except FaultsError as error:
            raise FaultsError(f"{'/'.join(change.directions)}: {error}") from None
        self._check(*new)
        for way, faults in zip(ways, new, strict=True):
            way.faults = faults
        self._road.changed()
        return "; ".join(f"{way.name}: {way.faults}" for way in ways)

    def _check(self, *faults: Faults) -> None:
        if self._transport == "tcp" and any(one.reorder for one in faults):
            raise FaultsError("reorder: a TCP connection keeps its order; it is for udp endpoints")

    def _show(self) -> str:
        road, count = self._road, len(self._relay)
        states = [f"{count} {self._noun(count)}"]
        if road.is_cut:
            states.append("cut")
        if road.opens > asyncio.get_running_loop().time():
            states.append("stalled")
        return f"{self.endpoint} -> {self._target}: {', '.join(states)}; {road.there}; {road.back}"

    def _noun(self, count: int) -> str:
        noun = "connection" if self._transport == "tcp" else "conversation"
        return noun if count == 1 else f"{noun}s"

    def _wait(self, work: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(PATIENCE)


async def _settle() -> None:
    """Let asyncio finish what it has begun, e.g. with a connection that came in the very last moment."""
    while others := asyncio.all_tasks() - {asyncio.current_task()}:
        for other in others:
            other.cancel()
        await asyncio.gather(*others, return_exceptions=True)
    for _ in range(3):  # turns of the loop: a task's last callback, the end of its transport, the end of its socket
        await asyncio.sleep(0)


def _resolve(endpoint: Endpoint) -> tuple[int, tuple[Any, ...]]:
    kind = socket.SOCK_STREAM if endpoint.transport == "tcp" else socket.SOCK_DGRAM
    try:
        family, *_, address = socket.getaddrinfo(endpoint.host, endpoint.port, type=kind)[0]
    except socket.gaierror as error:
        raise RelayError(f'{endpoint}: host "{endpoint.host}" is not known: {error.strerror}') from None
    return family, address


def _bind(endpoint: Endpoint) -> socket.socket:
    family, address = _resolve(endpoint)
    tcp = endpoint.transport == "tcp"
    near = socket.socket(family, socket.SOCK_STREAM if tcp else socket.SOCK_DGRAM)
    try:
        if tcp:  # a port that only waits for the last packets of an earlier connection is free
            near.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        near.bind(address)
        if tcp:
            near.listen()
    except OSError as error:
        near.close()
        why = (error.strerror or str(error)).lower()
        raise RelayError(f"cannot listen on {endpoint}: {why}; choose another port, or 0 for any free one") from None
    return near
