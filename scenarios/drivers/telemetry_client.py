"""Receive what the plant publishes for recorders, in order, over a session that is renewed when it breaks."""

from __future__ import annotations

from time import monotonic
from typing import NamedTuple

from scenarios.drivers.telemetry_endpoint import TelemetryEndpoint
from scenarios.drivers.telemetry_stream import Recordable, TelemetryStream
from wire.driver.inbox import Inbox
from wire.driver.session import Clock, Session

RECORDER = "history"
"""Name of a driver's recorder in its run."""

LOOK = 0.5
"""Longest wait (s) between two checks for missing messages."""


class Word(NamedTuple):
    """A word from another thread of this process."""

    text: str


class TelemetryClient:
    """Receives what the plant publishes for recorders.

    In wall-clock time it asks again for what did not come, e.g. as this process stood still for longer than Zenoh's
    lease, and opens a new session when the old one brings nothing any more.

    Parameters
    ----------
    name : str
        The recorder's name; the plant waits for it before the start.
    run : str
        Name of the run.
    endpoint : str
        Where the plant listens.
    clock : {"simulated", "wall"}
        Which kind of time the run has.
    """

    def __init__(self, name: str, run: str, endpoint: str, clock: Clock) -> None:
        self._name, self._endpoint, self._clock = name, endpoint, clock
        self._stream = TelemetryStream() if clock == "wall" else None
        self._core = TelemetryEndpoint(name, run, self._stream)
        self._closed = False
        self.rejects = self._core.rejects
        """What was dropped."""
        self.inbox = Inbox()
        """Where other threads put words."""
        self._session = self._open()

    def say(self, word: str) -> None:
        """Have `take` return a word; from any thread."""
        self.inbox.put(("word", word, b""))

    def take(self, timeout: float | None) -> list[Recordable | Word]:
        """Wait for what comes.

        Parameters
        ----------
        timeout : float or None
            Longest wait (s); None for no end. It may return with nothing before.
        """
        if self._stream is not None:
            timeout = LOOK if timeout is None else min(timeout, LOOK)
        found: list[Recordable | Word] = []
        for kind, key, payload, _ in self._session.take(1, timeout):
            if kind == "word":
                found.append(Word(key))
            elif kind == "appeared":
                self._core.appeared(key)
            elif kind == "message":
                self._core.received(key, payload, monotonic())
                found += self._core.take()
        if self._stream is not None and not self._closed:
            self._look_after(self._stream)
        return found

    def close(self) -> None:
        """Leave; with the session goes the token, so the plant knows that the last telemetry is here."""
        self._closed = True
        self._session.close()

    def _open(self) -> Session:
        keys = self._core.keys
        session = Session(self._name, connect=(self._endpoint,), gossip=False, clock=self._clock, inbox=self.inbox)
        session.watch(keys.alive_plant("*"))  # before it subscribes: so it knows the plant when the plant speaks
        for key in self._core.subscriptions:
            session.subscribe(key)
        session.hold_token(keys.alive_recorder(self._name))
        return session

    def _look_after(self, stream: TelemetryStream) -> None:
        now = monotonic()
        if stream.is_astray(now):
            self._session.close()
            self._session = self._open()
        question = self._core.question(now)
        if question is not None:
            self._session.publish(self._core.keys.command, question)
