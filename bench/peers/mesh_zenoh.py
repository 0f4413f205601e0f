"""Bare Zenoh: sessions of the settings that decide the cost of ours, callbacks that only count, and nothing of ours.

`zenoh` has a link for each pair of processes; in `zenoh-star` the hub relays all messages, as our plant does.
"""

from __future__ import annotations

import json
import os
from _thread import allocate_lock
from collections import deque
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import zenoh

from bench.peers.mesh import DEADLINE, MeshMember
from scenarios.drivers.free_endpoint import free_endpoint
from wire.driver.foreign import keep_thread_state

RUNTIME = "(rx: (worker_threads: 1), acc: (handover: app), net: (handover: app), tx: (handover: app))"
"""As ours (docs/protocol.md): with Zenoh's defaults the floor is higher."""

ONE_THREAD = "(rx: (handover: app), acc: (handover: app), net: (handover: app), tx: (handover: app))"
"""As the clients of our relay."""


class ZenohTransport:
    """One session over TCP: of a full mesh, found by gossip, or of a star."""

    def __init__(self, member: MeshMember) -> None:
        star = member.transport == "zenoh-star"
        os.environ.setdefault("ZENOH_RUNTIME", ONE_THREAD if star and not member.is_hub else RUNTIME)
        address = Path(member.folder) / "address"
        if member.is_hub:
            endpoint = free_endpoint()
            listen, connect = endpoint, []
        else:
            listen, connect = "tcp/127.0.0.1:0", [_read(address)]
        mode = "peer" if not star else "router" if member.is_hub else "client"
        config = {
            "mode": mode,
            "listen": {"endpoints": [] if mode == "client" else [listen]},
            "connect": {"endpoints": connect, "timeout_ms": -1, "exit_on_failure": False},
            "scouting": {"delay": 0 if star else 500, "multicast": {"enabled": False}, "gossip": {"enabled": not star}},
            "transport": {
                "unicast": {"qos": {"enabled": False}},
                "link": {"tx": {"lease": 60_000}},
                "shared_memory": {"enabled": False},
            },
        }
        self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        if member.is_hub:
            partial = address.with_suffix(".partial")
            partial.write_text(listen)
            partial.rename(address)
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._declared: list[Any] = []
        self._came: deque[tuple[str, bytes]] = deque()
        self._needed = 1
        self._wake = allocate_lock()
        self._wake.acquire()

    def subscribe(self, topic: str) -> None:
        """Take in the messages of a topic, in Zenoh's receiving thread."""
        came, wake = self._came, self._wake

        def on_sample(sample: zenoh.Sample) -> None:
            keep_thread_state()
            came.append((topic, sample.payload.to_bytes()))
            if len(came) >= self._needed:
                with suppress(RuntimeError):  # awake already
                    wake.release()

        handler: Any = zenoh.handlers.Callback(on_sample, indirect=False)
        self._declared.append(
            self._session.declare_subscriber(f"mesh/{topic}", handler, allowed_origin=zenoh.Locality.REMOTE)
        )

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a message."""
        publisher = self._publishers.get(topic)
        if publisher is None:
            publisher = self._publishers[topic] = self._session.declare_publisher(
                f"mesh/{topic}",
                congestion_control=zenoh.CongestionControl.BLOCK,
                allowed_destination=zenoh.Locality.REMOTE,
            )
        publisher.put(payload)

    def take(self, needed: int, timeout: float) -> list[tuple[str, bytes]]:
        """Wait for so many messages; return those that came."""
        came = self._came
        self._wake.acquire(blocking=False)
        self._needed = needed
        if len(came) < needed:
            self._wake.acquire(timeout=timeout)
        return [came.popleft() for _ in range(len(came))]

    def close(self) -> None:
        """Leave."""
        self._session.close()  # type: ignore[no-untyped-call]  # as zenoh declares it


def _read(address: Path) -> str:
    """Return the hub's endpoint once it listens."""
    until = monotonic() + DEADLINE
    while not address.exists():
        if monotonic() > until:
            raise TimeoutError("the hub does not listen")
        sleep(0.005)
    return address.read_text()
