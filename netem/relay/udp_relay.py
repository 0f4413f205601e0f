"""The relay of UDP: each sender talks with the target through a socket of its own."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from functools import partial
from typing import Any, cast

from netem.draws import Stream
from netem.relay.direction import Direction
from netem.relay.flow import Flow, RelayedLink
from netem.relay.line import ImpairedLine
from netem.relay.packets import Datagrams

IDLE = 60.0
"""Time (s) after which a silent sender is forgotten, once a new one comes: NAT boxes keep UDP for as long."""

BUFFER = 4 << 20
"""Bytes asked for in the kernel, so that only the relay loses datagrams."""


class _Conversation(asyncio.DatagramProtocol):
    """One sender's datagrams, and the target's answers."""

    def __init__(self, link: RelayedLink, answer: Callable[[list[bytes]], None]) -> None:
        name = link.new_connection()

        def flow(direction: Direction, forward: Callable[[list[bytes]], None]) -> Flow:
            way = Datagrams(partial(Stream, link.seed, name, direction.name), direction)
            return Flow(link, ImpairedLine(direction, way), forward)

        self.there, self.back = flow(link.there, self._forward), flow(link.back, answer)
        self.there.is_blocked = True
        self._far: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._far = _with_room(transport)
        self.there.unblock()

    def datagram_received(self, data: bytes, address: object) -> None:
        self.back.put(data)

    def _forward(self, datagrams: list[bytes]) -> None:
        assert self._far is not None
        for data in datagrams:
            self._far.sendto(data)

    def close(self) -> None:
        self.there.close()
        self.back.close()
        if self._far is not None:
            self._far.close()


class UdpRelay(asyncio.DatagramProtocol):
    """Relays datagrams from a bound socket to the target, which is a family and an address."""

    noun = "conversation"

    def __init__(self, link: RelayedLink, near: socket.socket, target: tuple[int, tuple[Any, ...]]) -> None:
        self._link, self._socket, self._target = link, near, target
        self._conversations: dict[tuple[Any, ...], tuple[_Conversation, asyncio.Task[Any]]] = {}

    def __len__(self) -> int:
        return len(self._conversations)

    async def start(self) -> None:
        """Begin."""
        await asyncio.get_running_loop().create_datagram_endpoint(lambda: self, sock=self._socket)

    def reset(self) -> None:
        """Forget all conversations."""
        for address in list(self._conversations):
            self._forget(address)

    def cut(self) -> None:
        """Do nothing: flows drop all data while `RelayedLink.is_cut` holds."""

    def heal(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """End."""
        self._near.close()
        self.reset()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Note the socket."""
        self._near = _with_room(transport)

    def datagram_received(self, data: bytes, address: tuple[Any, ...]) -> None:
        """Pass a datagram on in its sender's conversation."""
        if address not in self._conversations:
            self._forget_idle()
            loop, (family, target) = asyncio.get_running_loop(), self._target
            conversation = _Conversation(self._link, partial(self._answer, address))
            connecting = loop.create_datagram_endpoint(
                lambda: conversation, remote_addr=cast("tuple[str, int]", target), family=family
            )
            self._conversations[address] = conversation, loop.create_task(connecting)
        self._conversations[address][0].there.put(data)

    def _answer(self, address: tuple[Any, ...], datagrams: list[bytes]) -> None:
        for data in datagrams:
            self._near.sendto(data, address)

    def _forget_idle(self) -> None:
        before = asyncio.get_running_loop().time() - IDLE
        for address, (conversation, _) in list(self._conversations.items()):
            if max(conversation.there.last, conversation.back.last) < before:
                self._forget(address)

    def _forget(self, address: tuple[Any, ...]) -> None:
        conversation, connecting = self._conversations.pop(address)
        connecting.cancel()
        conversation.close()


def _with_room(transport: asyncio.BaseTransport) -> asyncio.DatagramTransport:
    transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
    return cast("asyncio.DatagramTransport", transport)
