"""The processes of a closed loop: made as they were, and changed when it is time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.carriers.law_registry import close_laws, make_law
from gridpeers.agents.laws.law import Law
from gridpeers.agents.realtime_agent import RealtimeAgent
from gridpeers.lab.replay.changes import ChangedRule, lossless
from gridpeers.lab.replay.recorded_process import RecordedProcess, RecordedStep, ReplayError
from gridpeers.lab.replay.replayed_process import (
    Message,
    ReplayedProcess,
    agent_again,
    instance_of,
    plant_again,
    recorded_links,
    tick_message,
)
from gridpeers.netem.fault_schedule import Heal
from gridpeers.netem.schema.fault import Fault
from gridpeers.plant.plant_interface import LivePlant
from gridpeers.plant.realtime.realtime_plant import RealtimePlant
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.emulation.link_data import EVERYTHING, LinkCommand
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.journal import MessageReference, ReceivedMessage, stream_of
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, Command, LinkRequest


class LoopProcess:
    """A process of the loop: its calls in the record, the node made again, and how far it has come."""

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
        assert self.head is not None
        for sent in self.head.sent:
            if (message := tick_message(Message(sent.key, sent.payload))) is not None:
                self._sent[stream_of(sent.key)] = message.seq
        self.head = next(self._steps, None)

    def has_sent(self, of: str, number: int) -> bool:
        """Return whether it has sent a number of a stream, or a later one, in the record by now."""
        return self._sent.get(of, -1) >= number


def is_arrival(step: RecordedStep) -> bool:
    return isinstance(step.entry, MessageReference | ReceivedMessage)


class ChangedProcesses:
    """Makes the processes of a run, and changes their rule and their links from a time on; None changes nothing."""

    def __init__(self, info: RecordInfo, rule: ChangedRule | None) -> None:
        self._info, self._rule = info, rule
        self.changed = rule is not None and rule.changes.since <= 0.0
        """The change is made."""
        self._laws: list[Law] = []

    @property
    def is_due(self) -> float | None:
        """When the change is to be made (s of run time); None if there is none, or it is made."""
        return None if self._rule is None or self.changed else self._rule.changes.since

    def close(self) -> None:
        close_laws(self._laws)

    # ---------------------------------------------------------------- making

    def make_plant(self, process: LoopProcess, plant: LivePlant) -> None:
        links = self._links(PLANT, self._info.plant.links)
        process.again = plant_again(process.recorded, self._info, plant, links)

    def make_agent(self, process: LoopProcess, step: RecordedStep) -> bool:
        """Make an agent at its start; return False if that is not its start."""
        config, instance = self._info.agent(process.name), instance_of(step)
        if config is None or not instance:
            return False
        if self.changed and self._rule is not None and self._rule.control is not None:
            config = replace(config, control=self._rule.control)
        process.config, links = config, self._links(process.name, config.links)
        process.again = agent_again(process.recorded, config, instance, self._laws, links)
        return True

    def _links(self, name: str, recorded: dict[str, Any]) -> Links | None:
        """Return the links into a node: those of the change; but where the record has none, only once it is made."""
        rule = self._rule
        if rule is None or rule.links is None or not (recorded or self.changed):
            return recorded_links(self._info, name)
        return links_of(name, rule.links)

    # ---------------------------------------------------------------- the change

    def change(self, processes: list[LoopProcess]) -> None:
        rule, self.changed = self._rule, True
        assert rule is not None
        for process in processes:
            again = process.again
            if again is None or again.node.finished:
                continue
            if rule.links is not None and again.links is None:
                links = links_of(process.name, rule.links)
                assert links is not None
                again.use_links(links)
            if rule.changes.without_loss and again.links is not None:  # what people have made by commands
                heal = LinkCommand(heal=Heal(on=EVERYTHING, from_s=0.0, kinds=("loss",)))
                again.links.command(heal.to_tree(), rule.changes.since)
            self._reconfigure(process, rule)

    def _reconfigure(self, process: LoopProcess, rule: ChangedRule) -> None:
        node, config = process.agent, process.config
        if rule.control is None or config is None or node is None:
            return
        config = replace(config, control=rule.control, epoch=process.recorded.epoch, record="physics", deadline=0.0)
        try:
            law = make_law(rule.control)
        except ValueError as error:
            raise ReplayError(f"{config.name}: its law cannot be made here: {error}") from None
        self._laws.append(law)
        node.change(config, law)

    # ---------------------------------------------------------------- commands of people to links

    def command(self, message: Message) -> Message | None:
        """Return a command to links as it is under the change; None if nothing is left of it."""
        if self._rule is None or not self.changed:
            return message
        changes, decoded = self._rule.changes, decode(message.payload)
        if not isinstance(decoded, LinkRequest | Command) or not decoded.link_command:
            return message
        if changes.without_link_commands:
            return None
        try:
            command = LinkCommand.of_tree(decoded.link_command)
        except ValueError:  # the links refused it too
            return message
        if not changes.without_loss or command.fault is None:
            return message
        fault = lossless(command.fault)
        if fault is None:
            return None
        tree = replace(command, fault=fault).to_tree()
        return Message(message.key, encode(replace(decoded, link_command=tree)))

    def cut_again(self, process: LoopProcess, t: float) -> None:
        """Cut the links at t (s of run time) that a command of the record may have healed."""
        rule = self._rule
        if rule is None or not self.changed or process.again is None or process.again.links is None:
            return
        for pattern in rule.changes.without:
            cut = LinkCommand(fault=Fault(on=pattern, cut=True))
            process.again.links.command(cut.to_tree(), max(t, rule.changes.since))
