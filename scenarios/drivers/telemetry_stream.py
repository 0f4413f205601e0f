"""The plant's messages for a recorder, in order and without gaps; when to ask for missing ones again. Pure.

A recorder that stands still for longer than Zenoh's lease loses its link, and with it messages on the way. The plant
publishes its latest messages again when asked by a `Command` (`gridpeers.plant.recorder_feed`). In simulated time the
same question acknowledges all before its number.
"""

from __future__ import annotations

from gridpeers.wire.codec import RejectedError, encode
from gridpeers.wire.keys import epoch_of
from gridpeers.wire.messages import PLANT, Answer, Command, Journal, LinkReport, LinkRequest, Telemetry
from gridpeers.wire.post import FollowedPlant, Post, Route

QUIET = 1.5  # Time (s) without a message from a running plant, after which the recorder asks; it sends five per second

AGAIN = 1.0

ASTRAY = 3.0  # Time (s) without an answer, after which a new session opens; it doubles after each session without one

ASTRAY_SIMULATED = 10.0
"""The same in simulated time, where a plant answers between two steps, or after it closed a full link."""

LONGEST = 60.0

Recordable = Telemetry | LinkReport | Journal | LinkRequest


class TelemetryStream:
    """Let messages through in the order in which the plant published them, each once; in simulated time, acknowledge.

    `lost` becomes True once messages are lost, as the plant did not have them any more.
    """

    def __init__(self, *, acknowledges: bool = False) -> None:
        self.acknowledges = acknowledges
        self.lost = False
        self._next = 0
        self._held: list[Recordable] = []
        """Other messages since the last Telemetry; the next one proves their order."""
        self._gap_since: float | None = None
        """Time (s) since which messages are dropped, until the plant answers with the first number that comes again."""
        self._heard_at: float | None = None
        self._asked_at = self._opened_at = float("-inf")
        self._over = False
        self._patience = self._shortest = ASTRAY_SIMULATED if acknowledges else ASTRAY
        self._acknowledged = -1

    def take(self, message: Recordable, now: float) -> list[Recordable]:
        """Note a message at `now` (s, monotonic); return the messages that can be recorded, in order."""
        self._heard_at = now
        if self._gap_since is not None:
            return []  # it comes again, in its order
        if not isinstance(message, Telemetry):
            self._held.append(message)
            return []
        held, self._held = self._held, []
        if message.seq < self._next:
            return []
        if message.seq > self._next or len(held) < message.others:
            self._gap_since, self._asked_at = now, float("-inf")
            return []
        self._next += 1
        self._over = message.final
        return [*held, message]

    def answered(self, answer: Answer, now: float) -> None:
        """Note the plant's answer: the number from which on it publishes again."""
        if answer.ok and answer.text.isascii() and answer.text.isdigit():
            self._heard_at, self._patience, self._gap_since = now, self._shortest, None
            self._held.clear()
            if int(answer.text) > self._next:
                self.lost, self._next = True, int(answer.text)

    def question(self, now: float) -> str | None:
        """Return the number of the first Telemetry to be published again, if the plant is to be asked for it now."""
        if self.acknowledges:
            if self._next == self._acknowledged and now - self._asked_at < AGAIN:
                return None
            self._acknowledged, self._asked_at = self._next, now
            return str(self._next)
        if self._heard_at is None or self._over or now - self._asked_at < AGAIN:
            return None
        if self._gap_since is None:
            if now - self._heard_at < QUIET:
                return None
            self._gap_since = now
            self._held.clear()
        self._asked_at = now
        return str(self._next)

    def is_astray(self, now: float) -> bool:
        """Return True if a new session is due, because questions have had no answer for long."""
        since = self._heard_at if self.acknowledges else self._gap_since
        if since is None or now - max(since, self._opened_at) < self._patience:
            return False
        self._opened_at, self._patience = now, min(2.0 * self._patience, LONGEST)
        return True


class TelemetryEndpoint:
    """Accept the messages of one plant for recorders, from the first to the last."""

    def __init__(self, name: str, run: str, stream: TelemetryStream) -> None:
        post = self.post = Post(name, run, 1)
        self._plant, self._stream = FollowedPlant(post), stream
        self._questions = 0
        self._recordable: list[Recordable] = []
        recordable = Telemetry, LinkReport, Journal, LinkRequest
        post.routes[post.keys.telemetry] = Route(PLANT, recordable, self._on_recordable, relayed=(LinkReport, Journal))
        post.routes[post.keys.answer(name)] = Route(PLANT, (Answer,), self._on_answer)
        self.keys, self.rejects, self.subscriptions = post.keys, post.rejects, tuple(post.routes)
        self.received, self.lost, self.take_rejects = post.received, post.lost, post.take_rejects

    def appeared(self, key: str) -> None:
        match self.keys.parts(key):
            case ("alive", "plant", part):
                self._plant.appeared(part)

    def vanished(self, key: str) -> None:
        """Note that a token is gone, but for the followed plant's: a broken link takes it from a plant that goes on."""
        match self.keys.parts(key):
            case ("alive", "plant", part) if epoch_of(part) != self.post.admission.epochs.get(PLANT):
                self._plant.vanished(part)

    def take(self) -> list[Recordable]:
        messages, self._recordable = self._recordable, []
        return messages

    def question(self, now: float) -> bytes | None:
        """Return the `Command` that asks the plant for missing messages, if it is to be asked now (s)."""
        number = self._stream.question(now)
        if number is None:
            return None
        self._questions += 1
        name, seq = self.post.name, self._questions
        return encode(Command(sender=name, epoch=1, seq=seq, t=0.0, verb="telemetry", argument=number, reply_to=name))

    def _on_recordable(self, message: Recordable, payload: bytes, now: float) -> None:
        self._recordable += self._stream.take(message, now)

    def _on_answer(self, answer: Answer, payload: bytes, now: float) -> None:
        """Take the answer to the last question: those before may be late, as a question is asked again after 1 s."""
        if not 1 <= answer.seq <= self._questions:
            raise RejectedError("unexpected", f"an answer to question {answer.seq}, which this recorder has not asked")
        if answer.seq == self._questions:
            self._stream.answered(answer, now)
