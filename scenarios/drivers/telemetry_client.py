"""A recorder's end of a run: what the plant publishes for it, in order, over a session that comes back."""

from __future__ import annotations

from time import monotonic
from typing import NamedTuple

from scenarios.drivers.telemetry_stream import Recordable, TelemetryStream
from wire.admission import Admission
from wire.codec import RejectedError, Rejects, decode, encode
from wire.driver.inbox import Inbox
from wire.driver.session import Clock, Session
from wire.keys import Keys
from wire.messages import PLANT, Answer, AnyMessage, Command, LinkReport

LOOK = 0.5
"""Longest wait (s) before it is looked whether something is missing."""


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
        self._name, self._keys, self._endpoint, self._clock = name, Keys(run), endpoint, clock
        self._stream = TelemetryStream() if clock == "wall" else None
        self._questions = 0
        self._closed = False
        self._admission = Admission()
        self.rejects = Rejects(name)
        """What was dropped."""
        self.inbox = Inbox()
        """Where other threads put words."""
        self._session = self._open()

    @property
    def lost(self) -> bool:
        """Whether something is lost for good."""
        return self._stream is not None and self._stream.lost

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
            elif kind == "message":
                try:
                    message = decode(payload)
                    self._identify(message)
                    if isinstance(message, Answer):
                        self._answered(message)
                    elif not isinstance(message, Recordable):
                        raise RejectedError("unexpected", f"a {type(message).__name__} instead of Telemetry")
                    elif self._stream is None:
                        found.append(message)
                    else:
                        found += self._stream.take(message, monotonic())
                except RejectedError as rejected:
                    self.rejects.add(rejected.kind, key, rejected.text)
                except Exception as error:
                    self.rejects.failed(key, error)
        if self._stream is not None and not self._closed:
            self._look_after(self._stream)
        return found

    def close(self) -> None:
        """Leave; with the session goes the token, so the plant knows that the last telemetry is here."""
        self._closed = True
        self._session.close()

    def _open(self) -> Session:
        session = Session(self._name, connect=(self._endpoint,), gossip=False, clock=self._clock, inbox=self.inbox)
        session.subscribe(self._keys.telemetry)
        if self._stream is not None:
            session.subscribe(self._keys.answer(self._name))
        session.hold_token(self._keys.alive_recorder(self._name))
        return session

    def _identify(self, message: AnyMessage) -> None:
        """Make sure that a message is of the plant: the one that spoke first, as there is no other at its endpoint."""
        if isinstance(message, LinkReport):  # the plant passes them on as they are, once it has checked them
            return
        if message.sender == PLANT and self._admission.epoch(PLANT) is None:
            self._admission.bind(PLANT, message.incarnation)
        if message.sender != PLANT:
            raise RejectedError("foreign", f"a {type(message).__name__} of {message.sender}")
        self._admission.check(message)

    def _answered(self, answer: Answer) -> None:
        if self._stream is None or answer.seq != self._questions:
            raise RejectedError("stale", f"an answer to question {answer.seq}, {self._questions} is the last")
        self._stream.answered(answer, monotonic())

    def _look_after(self, stream: TelemetryStream) -> None:
        now = monotonic()
        if stream.is_astray(now):
            self._session.close()
            self._session = self._open()
        question = stream.question(now)
        if question is not None:
            self._questions += 1
            command = Command(
                sender=self._name,
                incarnation=1,
                seq=self._questions,
                t=0.0,
                verb="telemetry",
                argument=question,
                reply_to=self._name,
            )
            self._session.publish(self._keys.command, encode(command))
