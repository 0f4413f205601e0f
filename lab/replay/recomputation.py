"""Compute the decisions of an agent again, by the same core from the recorded inputs, and compare them with the record.

The core gets the measurement of each decision, the neighbours, and the states that the agent had heard by then.
So a difference means that the record lacks an input, or that the code or the law is another one than in the run.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing
from typing import NamedTuple

from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.carriers.law_registry import make_law
from gridpeers.agents.laws.law import Law
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from gridpeers.wire.codec import encode
from gridpeers.wire.messages import State


class Recomputed(NamedTuple):
    decision: RecordedDecision
    state: State

    @property
    def agrees(self) -> bool:
        return encode(self.decision.state) == encode(self.state)


def recomputed(record: RunRecord, agent: str, law: Law | None = None) -> Iterator[Recomputed]:
    """Yield the decisions of an agent, each with its state computed again.

    A law may have a memory, so this begins with the first decision, and each process of the agent has a law of its own
    unless `law` is given. It ends with the first decision that is not whole, as where the record is cut off.
    """
    config = record.info.agent(agent)
    assert config is not None
    config = config if config.clock == "realtime" else config.by_own_clock()
    with ExitStack() as ends:
        core: Agent | None = None
        epoch = -1
        for decision in record.decisions(agent):
            if not decision.is_whole:
                return
            if core is None or decision.state.epoch != epoch:  # another process of this name
                epoch = decision.state.epoch
                own = law or ends.enter_context(closing(make_law(config.control)))
                core = Agent(replace(config, epoch=epoch), own)
            yield Recomputed(decision, _decided_again(core, config, decision))


def _decided_again(core: Agent, config: AgentConfig, decision: RecordedDecision) -> State:
    for each in decision.neighbours:
        heard = core.heard.get(each.name)
        if each.state is None:
            if heard is not None:
                core.forget(each.name)
            core.meet(each.nameplate)
        elif heard is None or (heard.epoch, heard.seq) != (each.state.epoch, each.state.seq):
            core.meet(each.nameplate)
            core.hear(each.state)
    if decision.action == "idle" and not core.fault:
        return core.idle_state(decision.measurement)
    if config.clock == "simulated":
        return core.tick(decision.measurement, [each.name for each in decision.neighbours])
    if decision.restarted:
        core.restart()
    ages = {each.name: each.age for each in decision.neighbours if each.age is not None and each.unused != "stale"}
    return replace(core.tick(decision.measurement, tuple(ages), ages), seq=decision.tick)
