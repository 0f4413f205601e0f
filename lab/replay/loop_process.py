"""A process of a closed loop: its calls in the record, the node made again, and how far it has come."""

from __future__ import annotations

from collections.abc import Iterator

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.realtime_agent import RealtimeAgent
from gridpeers.lab.replay.recorded_process import RecordedProcess, RecordedStep
from gridpeers.lab.replay.replayed_process import Message, ReplayedProcess, tick_message
from gridpeers.plant.realtime.realtime_plant import RealtimePlant
from gridpeers.wire.journal import MessageReference, ReceivedMessage, stream_of


class LoopProcess:
    """A process of the loop.

    Parameters
    ----------
    recorded : RecordedProcess
        As its journal has it.
    """

    def __init__(self, recorded: RecordedProcess) -> None:
        self.recorded = recorded
        self.again: ReplayedProcess | None = None
        """The process made again; None before its start."""
        self.config: AgentConfig | None = None
        """Configuration of an agent that was made again."""
        self._steps: Iterator[RecordedStep] = recorded.steps()
        self.head: RecordedStep | None = next(self._steps, None)
        """Its next call; None at its end."""
        self._sent: dict[str, int] = {}

    @property
    def name(self) -> str:
        """Its agent, or "plant"."""
        return self.recorded.name

    @property
    def agent(self) -> RealtimeAgent | None:
        """Its node, if it is an agent that was made again."""
        return self.again.node if self.again is not None and isinstance(self.again.node, RealtimeAgent) else None

    @property
    def plant(self) -> RealtimePlant | None:
        """Its node, if it is the plant, made again."""
        return self.again.node if self.again is not None and isinstance(self.again.node, RealtimePlant) else None

    def next(self) -> None:
        """Go on to the next call."""
        assert self.head is not None
        for sent in self.head.sent:
            if (message := tick_message(Message(sent.key, sent.payload))) is not None:
                self._sent[stream_of(sent.key)] = message.seq
        self.head = next(self._steps, None)

    def has_sent(self, of: str, number: int) -> bool:
        """Return whether it has sent a number of a stream, or a later one, in the record by now."""
        return self._sent.get(of, -1) >= number


def is_arrival(step: RecordedStep) -> bool:
    """Return whether a message arrives in a step."""
    return isinstance(step.entry, MessageReference | ReceivedMessage)
