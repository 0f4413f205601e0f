"""Follow a run: receive what the plant publishes for recorders, in order, over a session that is renewed."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from msgspec.structs import replace

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.telemetry_stream import Recordable, TelemetryEndpoint, TelemetryStream
from gridpeers.wire.driver.inbox import Inbox
from gridpeers.wire.driver.session import Session
from gridpeers.wire.driver.zenoh_settings import Clock
from gridpeers.wire.messages import Pacing, PlantEvent, Telemetry
from gridpeers.wire.trust.credentials import Credentials

RECORDER = "history"  # Name of a driver's recorder in its run

RECORDER_WAIT = 1.0
"""Least wait (s) of the plant of a recorded live run; without its recorder the first row would be lost."""

LOOK = 0.5  # Longest wait (s) between two checks for missing messages


def with_recorder(config: PlantConfig, *, waits: bool = False) -> PlantConfig:
    """Return a plant with the recorder of its driver; with `waits` it waits for that recorder even without agents."""
    wait = max(RECORDER_WAIT, config.wait_for_agents) if waits else config.wait_for_agents
    return replace(config, recorders=(RECORDER,), wait_for_agents=wait)


class TelemetryClient:
    """Pass on each message that the plant publishes for recorders, in its order, and keep the state of the run.

    It asks again for missing messages, and opens a new session when the old one brings nothing any more.
    """

    def __init__(
        self,
        name: str,
        run: str,
        endpoint: str,
        clock: Clock,
        on_message: Callable[[Recordable], None],
        credentials: Credentials | None = None,
    ) -> None:
        self._credentials = credentials
        self._name, self._endpoint, self._clock, self._on_message = name, endpoint, clock, on_message
        self.latest: Telemetry | None = None
        self.pacing: Pacing | None = None
        self.message_at = monotonic()
        """Time of the last message, of any kind, or answer (s, monotonic)."""
        self.progress: tuple[float, float] | None = None
        """Run time of the last rows, and when they came (s, monotonic); None before the first."""
        self._stream = TelemetryStream(acknowledges=clock == "simulated")
        self._core = TelemetryEndpoint(name, run, self._stream)
        self._closed = False
        self.rejects = self._core.rejects
        self.inbox = Inbox(lossless=clock == "simulated")
        self._session = self._open()

    @property
    def t(self) -> float:
        return 0.0 if self.latest is None else self.latest.t

    @property
    def ended(self) -> bool:
        return self.latest is not None and self.latest.final

    def say(self, word: str) -> None:
        """Have `take` return a word; from any thread."""
        self.inbox.put(("word", word, b""))

    def take(self, timeout: float | None) -> list[str]:
        """Wait for messages, for `timeout` (s) at most, pass them on, and return the words of other threads."""
        timeout = LOOK if timeout is None else min(timeout, LOOK)
        words: list[str] = []
        for kind, key, payload, _ in self._session.take(1, timeout):
            if kind == "word":
                words.append(key)
            elif kind == "appeared":
                self._core.appeared(key)
            elif kind == "vanished":
                self._core.vanished(key)
            elif kind == "message":
                self.message_at = monotonic()
                self._core.received(key, payload, self.message_at)
                for message in self._core.take():
                    if isinstance(message, Telemetry):
                        self.latest, self.pacing = message, message.pacing or self.pacing
                        if message.rows and not message.final:
                            self.progress = message.t, self.message_at
                    self._on_message(message)
        for loss in self.inbox.take_losses():
            self._core.lost(loss, monotonic())
        if not self._closed:
            now = monotonic()
            if self._stream.is_astray(now):
                self._session.close()  # the plant publishes again what it had on its way
                self._session = self._open()
            question = self._core.question(now)
            if question is not None:
                self._session.publish(self._core.keys.request, question)
        return words

    def note_crash(self, agent: str, end: str) -> None:
        if self.latest is not None and not self.ended:
            event = PlantEvent(t=self.t, kind="law", subject=agent, text=f"{agent}: its process {end}")
            self._on_message(replace(self.latest, rows=(), events=(event,), awaited=(), quiet=(), others=0))

    def close(self) -> None:
        """Close the session and its token; the plant then knows that the last telemetry arrived."""
        self._closed = True
        self._session.close()

    def _open(self) -> Session:
        keys = self._core.keys
        session = Session(
            self._name,
            connect=(self._endpoint,),
            gossip=False,
            clock=self._clock,
            inbox=self.inbox,
            credentials=self._credentials,
        )
        if self._credentials is not None:
            self._core.post.vouches = session.vouches
        session.watch(keys.alive_plant("*"))  # before it subscribes: so it knows the plant when the plant speaks
        for key in self._core.subscriptions:
            session.subscribe(key)
        session.hold_token(keys.alive_recorder(self._name))
        return session
