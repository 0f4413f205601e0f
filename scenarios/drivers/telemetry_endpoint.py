"""Accept the plant's messages for a recorder, in order, without a session. Pure."""

from __future__ import annotations

from gridpeers.scenarios.drivers.telemetry_stream import Recordable, TelemetryStream
from gridpeers.wire.codec import RejectedError, encode
from gridpeers.wire.keys import epoch_of
from gridpeers.wire.messages import PLANT, Answer, AnyMessage, Command, Journal, LinkReport, LinkRequest, Telemetry
from gridpeers.wire.node import Route
from gridpeers.wire.plant_follower import PlantFollower


class TelemetryEndpoint(PlantFollower):
    """Accept the messages of one plant for recorders, from the first to the last.

    Parameters
    ----------
    name : str
        The recorder's name.
    run : str
        Name of the run.
    stream : TelemetryStream
        Puts messages in order.
    """

    def __init__(self, name: str, run: str, stream: TelemetryStream) -> None:
        super().__init__(name, run)
        self._name, self._stream = name, stream
        self._questions = 0
        self._recordable: list[Recordable] = []
        self.routes[self.keys.telemetry] = Route(
            PLANT, (Telemetry, LinkReport, Journal, LinkRequest), self._on_recordable
        )
        self.routes[self.keys.answer(name)] = Route(PLANT, (Answer,), self._on_answer)

    @property
    def finished(self) -> bool:
        """Whether nothing more is taken: never, as messages before the end of the session are recorded too."""
        return False

    @property
    def subscriptions(self) -> tuple[str, ...]:
        """Keys to subscribe to before the token is declared."""
        return tuple(self.routes)

    def appeared(self, key: str) -> None:
        """Note a token."""
        match self.keys.parts(key):
            case ("alive", "plant", part):
                self._plant_appeared(part)

    def vanished(self, key: str) -> None:
        """Note that a token is gone, but for that of the plant that it follows.

        A link that breaks takes the token away from a plant that goes on. All others make room for new ones.
        """
        match self.keys.parts(key):
            case ("alive", "plant", part) if epoch_of(part) != self.admission.epoch(PLANT):
                self._plant_vanished(part)

    def is_known(self, key: str, payload: bytes) -> bool:
        """Whether a message looks like one of the plant; in simulated time whatever comes for recorders counts as such.

        There the plant passes on what agents say, and goes as fast as the recorder reads.
        """
        return (self._stream.acknowledges and key == self.keys.telemetry) or super().is_known(key, payload)

    def take(self) -> list[Recordable]:
        """Take out the messages that can be recorded now, in order."""
        messages, self._recordable = self._recordable, []
        return messages

    def question(self, now: float) -> bytes | None:
        """Return the `Command` that asks the plant for missing messages, if it is to be asked now (s)."""
        number = self._stream.question(now)
        if number is None:
            return None
        self._questions += 1
        name = self._name
        return encode(
            Command(
                sender=name,
                epoch=1,
                seq=self._questions,
                t=0.0,
                verb="telemetry",
                argument=number,
                reply_to=name,
            )
        )

    def _admit(self, route: Route, message: AnyMessage, now: float) -> None:
        if not isinstance(
            message, LinkReport | Journal
        ):  # the plant passes them on as they are, once it has checked them
            super()._admit(route, message, now)

    def _on_recordable(self, message: Recordable, payload: bytes, now: float) -> None:
        self._recordable += self._stream.take(message, now)

    def _on_answer(self, answer: Answer, payload: bytes, now: float) -> None:
        """Take the answer to the last question: those before may be late, as a question is asked again after 1 s."""
        if not 1 <= answer.seq <= self._questions:
            raise RejectedError("unexpected", f"an answer to question {answer.seq}, which this recorder has not asked")
        if answer.seq == self._questions:
            self._stream.answered(answer, now)
