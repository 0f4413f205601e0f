"""ZeroMQ: publishers and subscribers over Unix domain sockets (ipc), every process connected to every other."""

from __future__ import annotations

from pathlib import Path
from time import monotonic

import zmq

from bench.peers.mesh import MeshMember


class ZeromqTransport:
    """A publishing socket and a subscribing socket."""

    def __init__(self, member: MeshMember) -> None:
        self._context = zmq.Context()
        self._out = self._context.socket(zmq.PUB)
        self._in = self._context.socket(zmq.SUB)
        for socket in (self._out, self._in):
            socket.setsockopt(zmq.SNDHWM, 0)
            socket.setsockopt(zmq.RCVHWM, 0)
            socket.setsockopt(zmq.LINGER, 1000)
        folder = Path(member.folder)
        self._out.bind(f"ipc://{folder / member.name}")
        for other in member.others:
            self._in.connect(f"ipc://{folder / other}")  # it waits for a socket that is not there yet

    def subscribe(self, topic: str) -> None:
        """Take in the messages of a topic."""
        self._in.setsockopt(zmq.SUBSCRIBE, f"{topic} ".encode())

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a message."""
        self._out.send(f"{topic} ".encode() + payload)

    def take(self, needed: int, timeout: float) -> list[tuple[str, bytes]]:
        """Wait for so many messages; return those that came."""
        came: list[tuple[str, bytes]] = []
        until = monotonic() + timeout
        while len(came) < needed:
            if not self._in.poll(max(0, round(1e3 * (until - monotonic())))):
                break
            try:
                while True:
                    topic, _, payload = self._in.recv(zmq.NOBLOCK).partition(b" ")
                    came.append((topic.decode(), payload))
            except zmq.Again:
                continue
        return came

    def close(self) -> None:
        """Leave."""
        self._out.close()
        self._in.close()
        self._context.term()
