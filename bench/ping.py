"""One-way time of a message between two processes, and the round trip of a bare Zenoh ping, at the size of a State.

Both are processes of their own, as agents are, and read one clock: that of the host. A message carries the time at
which it was handed to Zenoh; the time at which it has come is taken in Zenoh's receiving thread.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from struct import pack, unpack_from
from time import monotonic
from typing import Any

import msgspec

from scenarios.drivers.children import Child, Children
from wire.driver.session import Session
from wire.trust.credentials import Credentials

STAMP = 8
"""Bytes of a time (s)."""

TICK = 0.02
"""Time (s) between two messages: the control period."""

NEVER = 1 << 30
"""More messages than ever come: a process that waits for so many waits for the time."""

LONGEST = 60.0
"""Longest wait for a message (s)."""


class Role(msgspec.Struct, frozen=True):
    """The configuration of one of the two processes."""

    role: str
    """receive, send, ping or echo."""
    key: str
    """The key of the messages."""
    size: int
    """Bytes of a message."""
    count: int
    """Number of messages."""
    listen: tuple[str, ...]
    connect: tuple[str, ...]
    """Endpoints."""
    credentials: Credentials | None = None
    """Certificate of the process; None: links are open."""
    rules: bool = True
    """Whether access rules come with the certificate."""


class TlsAlone(Credentials, frozen=True):
    """A certificate without access rules: what of their cost is TLS's."""

    def zenoh_settings(self, *, star: bool) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return Zenoh's settings ``transport/link``, and no ``access_control``."""
        return super().zenoh_settings(star=star)[0], {}


def sent_at(payload: bytes) -> float:
    """Return the time (s) at which a payload was handed to Zenoh."""
    return float(unpack_from("<d", payload)[0])


def one_way(
    size: int,
    count: int,
    *,
    key: str,
    receiver: tuple[str, ...],
    sender: tuple[str, ...],
    connect: tuple[str, ...],
    receiver_credentials: Credentials | None = None,
    sender_credentials: Credentials | None = None,
    rules: bool = True,
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
    receiver_credentials, sender_credentials : Credentials or None, optional
        Their certificates; None: links are open.
    rules : bool, optional
        Whether access rules come with the certificates.
    """
    first = tuple(endpoint for endpoint in receiver if not endpoint.endswith(":0"))
    receive = Role("receive", key, size, count, receiver, connect, receiver_credentials, rules)
    return _pair(receive, Role("send", key, size, count, sender, first + connect, sender_credentials, rules))


def round_trip(size: int, count: int, *, key: str, endpoint: str) -> list[float]:
    """Return the times (s) of so many messages there and back, each sent when the one before is back."""
    return _pair(Role("ping", key, size, count, (endpoint,), ()), Role("echo", key, size, count, (), (endpoint,)))


def _pair(measuring: Role, other: Role) -> list[float]:
    """Run two processes and return the times that the first prints."""
    children, words = Children(), list[str]()
    with tempfile.TemporaryDirectory() as folder:
        try:
            for role, on_word in ((other, None), (measuring, words.append)):
                log = Path(folder) / f"{role.role}.log"
                children.add(Child(role.role, [__file__], role, log, lambda child: None, on_word))
            measurer = children[measuring.role]
            if not measurer.join(monotonic() + LONGEST) or measurer.status != 0:
                raise TimeoutError(measurer.report(f"within {LONGEST:g} s"))
        finally:
            children.end()
    return msgspec.json.decode(words[-1], type=list[float])


def receive(session: Session, key: str, count: int) -> list[float]:
    """Take so many messages in, after those that came while the link was new."""
    session.subscribe(key)
    took: list[float] = []
    while len(took) < count + WARM_UP:
        events = session.inbox.take(1, LONGEST)
        if not events:
            raise TimeoutError(f"nothing came for {LONGEST:g} s")
        took += [at - sent_at(payload) for _, _, payload, at in events]
    return took[WARM_UP : WARM_UP + count]


def send(session: Session, key: str, size: int) -> None:
    """Publish at the rate of ticks on a drift-free timer, until the process is ended; not for ever, if nobody does."""
    due, padding = monotonic(), bytes(size - STAMP)
    for _ in range(round(LONGEST / TICK)):
        session.publish(key, pack("<d", monotonic()) + padding)
        due += TICK
        while (left := due - monotonic()) > 0.0:
            session.inbox.take(NEVER, left)


def ping(session: Session, key: str, size: int, count: int) -> list[float]:
    """Send a message when the one before is back; one that found nobody is sent again."""
    session.subscribe(f"{key}/back")
    took: list[float] = []
    while len(took) < count + WARM_UP:
        session.publish(key, pack("<d", monotonic()) + bytes(size - STAMP))
        took += [at - sent_at(payload) for _, _, payload, at in session.inbox.take(1, 0.5)]
    return took[WARM_UP : WARM_UP + count]


def echo(session: Session, key: str) -> None:
    """Send back what comes, until the process is ended or nothing comes any more."""
    session.subscribe(key)
    while events := session.inbox.take(1, LONGEST):
        for _, _, payload, _ in events:
            session.publish(f"{key}/back", payload)


WARM_UP = 25
"""Messages that are not counted: links and publishers are new."""


def run(config: Role) -> None:
    """Be one of the two processes."""
    credentials = config.credentials
    if credentials is not None and not config.rules:
        credentials = TlsAlone(**msgspec.structs.asdict(credentials))
    session = Session(config.role, listen=config.listen, connect=config.connect, clock="wall", credentials=credentials)
    match config.role:
        case "send":
            send(session, config.key, config.size)
        case "echo":
            echo(session, config.key)
        case "receive":
            print(msgspec.json.encode(receive(session, config.key, config.count)).decode())
        case _:
            print(msgspec.json.encode(ping(session, config.key, config.size, config.count)).decode())
    session.close()


if __name__ == "__main__":
    run(msgspec.json.decode(sys.stdin.buffer.readline(), type=Role))
