"""One-way time of a message between two processes, and the round trip of a bare Zenoh ping, at the size of a State.

Both are processes of their own, as agents are, and read one clock: that of the host. A message carries the time at
which it was handed to Zenoh; the time at which it has come is taken in Zenoh's receiving thread.
"""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import suppress
from struct import pack, unpack_from
from time import monotonic_ns

from wire.driver.inbox import Event, Inbox
from wire.driver.session import Session

STAMP = 8
"""Bytes of a time (ns)."""

TICK = 0.02
"""Distance of two messages (s): the control period."""

NEVER = 1 << 30
"""More messages than ever come: who waits for so many waits for the time."""

LONGEST = 60.0
"""Longest wait for a message (s)."""


class StampedInbox(Inbox):
    """An inbox that puts the time (ns) at which a payload came before it."""

    def put(self, event: Event) -> None:
        """Put an event in, from any thread."""
        kind, key, payload = event
        super().put((kind, key, pack("<q", monotonic_ns()) + payload))


def stamp_of(payload: bytes, offset: int = 0) -> float:
    """Return the time (s) that stands in a payload."""
    return float(unpack_from("<q", payload, offset)[0]) * 1e-9


def one_way(
    size: int, count: int, *, key: str, receiver: tuple[str, ...], sender: tuple[str, ...], connect: tuple[str, ...]
) -> list[float]:
    """Return the times (s) that so many messages of so many bytes took at the rate of ticks.

    Parameters
    ----------
    size, count : int
        Bytes of a message; messages.
    key : str
        What they are published on.
    receiver, sender : tuple[str, ...]
        Where the two listen.
    connect : tuple[str, ...]
        What both connect to, beside what the other listens on: the plant of a run, or nothing.
    """
    first = tuple(endpoint for endpoint in receiver if not endpoint.endswith(":0"))
    return _pair(("receive", key, size, count, receiver, connect), ("send", key, size, count, sender, first + connect))


def round_trip(size: int, count: int, *, key: str, endpoint: str) -> list[float]:
    """Return the times (s) of so many messages there and back, each sent when the one before is back."""
    return _pair(("ping", key, size, count, (endpoint,), ()), ("echo", key, size, count, (), (endpoint,)))


def _pair(measuring: tuple[object, ...], other: tuple[object, ...]) -> list[float]:
    """Run two processes; what the first prints."""
    command = [sys.executable, __file__]
    with subprocess.Popen([*command, json.dumps(other)], stdin=subprocess.PIPE) as second:
        try:
            done = subprocess.run(
                [*command, json.dumps(measuring)], stdout=subprocess.PIPE, check=True, timeout=LONGEST
            )
        finally:
            second.kill()
    return [float(seconds) for seconds in json.loads(done.stdout)]


def receive(session: Session, key: str, count: int) -> list[float]:
    """Take so many messages in, after those that came while the link was new."""
    session.subscribe(key)
    took: list[float] = []
    while len(took) < count + WARM_UP:
        events = session.inbox.take(1, LONGEST)
        if not events:
            raise TimeoutError(f"nothing came for {LONGEST:g} s")
        took += [stamp_of(payload) - stamp_of(payload, STAMP) for _, _, payload, _ in events]
    return took[WARM_UP : WARM_UP + count]


def send(session: Session, key: str, size: int) -> None:
    """Publish at the rate of ticks on a drift-free timer, until the process is ended; not for ever, if nobody does."""
    due, padding = monotonic_ns(), bytes(size - STAMP)
    for _ in range(round(LONGEST / TICK)):
        session.publish(key, pack("<q", monotonic_ns()) + padding)
        due += round(TICK * 1e9)
        while (left := due - monotonic_ns()) > 0:
            session.inbox.take(NEVER, left * 1e-9)


def ping(session: Session, key: str, size: int, count: int) -> list[float]:
    """Send a message when the one before is back; one that found nobody is sent again."""
    session.subscribe(f"{key}/back")
    took: list[float] = []
    while len(took) < count + WARM_UP:
        session.publish(key, pack("<q", monotonic_ns()) + bytes(size - STAMP))
        took += [stamp_of(p) - stamp_of(p, STAMP) for _, _, p, _ in session.inbox.take(1, 0.5)]
    return took[WARM_UP : WARM_UP + count]


def echo(session: Session, key: str) -> None:
    """Send back what comes, until the process is ended or nothing comes any more."""
    session.subscribe(key)
    while events := session.inbox.take(1, LONGEST):
        for _, _, payload, _ in events:
            session.publish(f"{key}/back", payload[STAMP:])


WARM_UP = 25
"""Messages that are not counted: links and publishers are new."""


def run(role: str, key: str, size: int, count: int, listen: list[str], connect: list[str]) -> None:
    """Be one of the two."""
    session = Session(role, listen=tuple(listen), connect=tuple(connect), clock="wall")
    session.inbox = StampedInbox()
    with suppress(KeyboardInterrupt):
        if role == "send":
            send(session, key, size)
        elif role == "echo":
            echo(session, key)
        else:
            print(json.dumps(receive(session, key, count) if role == "receive" else ping(session, key, size, count)))
    session.close()


if __name__ == "__main__":
    run(*json.loads(sys.argv[1]))
