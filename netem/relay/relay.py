"""The relay itself: an event loop in a thread of its own, which obeys commands line by line."""

from __future__ import annotations

import asyncio
import socket
import threading
from concurrent.futures import Future
from types import TracebackType
from typing import Any

import msgspec

from netem.relay.direction import Direction, Faults, FaultsError, PacketCounts
from netem.relay.endpoint import Endpoint
from netem.relay.flow import RelayedLink
from netem.relay.packets import NEVER
from netem.relay.relay_command import new_faults, number
from netem.relay.tcp_relay import TcpRelay
from netem.relay.udp_relay import UdpRelay

PATIENCE = 10.0
"""Longest wait (s) for the own thread to answer: it never waits for the network."""


class RelayError(ValueError):
    """A relay that cannot be; the message says why and what to do."""


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
        Faults of the traffic towards the target, and from it.
    seed : int, optional
        Of the random numbers.

    Raises
    ------
    EndpointError
        If an endpoint is none.
    RelayError
        If the two are of different transports, a host is unknown, or the relay cannot listen.
    FaultsError
        If there is reordering on TCP.
    """

    def __init__(
        self, listen: str, connect: str, *, there: Faults | None = None, back: Faults | None = None, seed: int = 0
    ) -> None:
        near, self._target = Endpoint.parse(listen), Endpoint.parse(connect)
        if near.transport != self._target.transport:
            raise RelayError(f"{listen} -> {connect}: a relay does not turn {near.transport} into another transport")
        self._link = RelayedLink(Direction("there", there or Faults()), Direction("back", back or Faults()), seed)
        self._transport = near.transport
        self._check(self._link.there.faults, self._link.back.faults)
        target, sock = _resolve(self._target), _bind(near)
        self.endpoint = str(near._replace(port=sock.getsockname()[1]))
        """Where it listens."""
        make = TcpRelay if near.transport == "tcp" else UdpRelay
        self._relay: TcpRelay | UdpRelay = make(self._link, sock, target)
        self._ended = asyncio.Event()
        self._loop: Future[asyncio.AbstractEventLoop] = Future()
        self._thread = threading.Thread(target=asyncio.run, args=(self._run(),), name="netem relay", daemon=True)

    async def _run(self) -> None:
        await self._relay.start()
        self._loop.set_result(asyncio.get_running_loop())
        await self._ended.wait()
        self._relay.close()
        for _ in range(3):  # turns of the loop: a task's last callback, the end of its transport, the end of its socket
            await asyncio.sleep(0)

    def __enter__(self) -> Relay:
        self._thread.start()
        self._loop.result(PATIENCE)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._loop.result().call_soon_threadsafe(self._ended.set)
        self._thread.join(PATIENCE)

    def do(self, line: str) -> str:
        """Obey a command; see `netem.relay.relay_command.HELP`.

        Returns
        -------
        str
            One line: the new state.

        Raises
        ------
        RelayCommandError
            If the line is no command.
        FaultsError
            If its values cannot be meant; nothing has changed then.
        """
        return asyncio.run_coroutine_threadsafe(self._obey(line), self._loop.result()).result(PATIENCE)

    def counts(self) -> tuple[PacketCounts, PacketCounts]:
        """Return the counts of packets towards the target, and from it."""
        return self._link.there.counts, self._link.back.counts

    async def _obey(self, line: str) -> str:
        link, answer = self._link, ""
        match line.split():
            case ["show"]:
                return self._show()
            case ["end"]:
                return "ending"
            case ["stall"]:
                link.stalled_until, answer = NEVER, "stalled until heal"
            case ["stall", text]:
                duration = number("stall", text)
                link.stalled_until = asyncio.get_running_loop().time() + duration
                answer = f"stalled for {duration:g} s"
            case ["reset"]:
                answer = f"{self._connections()} reset"
                self._relay.reset()
            case ["cut"]:
                link.is_cut, answer = True, "cut until heal"
                self._relay.cut()
            case ["heal"]:
                link.is_cut, link.stalled_until, answer = False, -NEVER, "healed"
                self._relay.heal()
            case _:
                answer = self._set_faults(*new_faults(line))
        link.changed()
        return answer

    def _set_faults(self, values: dict[str, float], names: tuple[str, ...]) -> str:
        directions = [direction for direction in (self._link.there, self._link.back) if direction.name in names]
        try:
            faults = [msgspec.structs.replace(direction.faults, **values) for direction in directions]
        except FaultsError as error:
            raise FaultsError(f"{'/'.join(names)}: {error}") from None
        self._check(*faults)
        for direction, new in zip(directions, faults, strict=True):
            direction.faults = new
        return "; ".join(f"{direction.name}: {direction.faults}" for direction in directions)

    def _check(self, *faults: Faults) -> None:
        if self._transport == "tcp" and any(one.reorder for one in faults):
            raise FaultsError("reorder: a TCP connection keeps its order; it is for udp endpoints")

    def _show(self) -> str:
        link, states = self._link, [self._connections()]
        if link.is_cut:
            states.append("cut")
        if link.stalled_until > asyncio.get_running_loop().time():
            states.append("stalled")
        return f"{self.endpoint} -> {self._target}: {', '.join(states)}; {link.there}; {link.back}"

    def _connections(self) -> str:
        count = len(self._relay)
        return f"{count} {self._relay.noun}{'s' if count != 1 else ''}"


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
