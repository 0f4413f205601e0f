"""Check of last words: each agent that stops speaking has a reason that the run knows."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from typing import Annotated

import msgspec

from gridpeers.lab.communication.communication_summary import CommunicationSummary
from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Violation, require_longer
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.record.record_info import LIVE
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.schema.plausible import Plausible, Unit

_SAID = re.compile(r"\S+ (leaves|left|dies)\b")
"""Events of an agent that ends as the scenario, or a person, wants it."""


class LastWords(Check):
    """Each process of an agent speaks until the run ends, or it leaves or is killed as the scenario or a person says.

    An unexplained silence is a failure of the agent, of its process, or of its connection.
    """

    silent_s: Annotated[float, Unit("s"), Plausible("a silence", 0.0, 3600.0)] = 1.0
    """Longest time (s) between an agent's last state and the end of the run, or the event that explains it."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the agents that stop without a reason."""
        found = case.communication
        if not any(sent.epochs for sent in found.sent.values()):
            raise NotJudgedError("the record has no states of agents")
        joining = {name for event in case.scenario.events for name in event.join}
        killed = _killed(found)
        end = min(float(case.history.t[-1]), found.t_end)
        for agent in found.agents:
            sent = found.sent.get(agent)
            epochs = sent.epochs if sent else {}
            if not epochs and agent not in joining and found.info.driver != LIVE:
                yield Violation(text="never sends a state", agent=agent, t=0.0)
            for _, last in epochs.values():
                if last >= end - self.silent_s or self._explained(case, agent, last, killed):
                    continue
                later = [max(0.0, first - last) for first, then in epochs.values() if then > last]
                yield Violation(
                    text="its process ends, and no event says why; its next one sends after"
                    if later
                    else "sends nothing more, and no event says why",
                    agent=agent,
                    t=last,
                    value=min(later, default=end - last),
                    unit="s",
                    limit=None if later else self.silent_s,
                )
        require_longer(end, "silent_s", self.silent_s)

    def _explained(self, case: CheckedCase, agent: str, last: float, killed: Collection[tuple[str, float]]) -> bool:
        """Whether an event, or a fault of the scenario, explains that an agent ends at a time (s)."""
        if any(name == agent and abs(last - t) <= self.silent_s + 2.0 * case.T_c for name, t in killed):
            return True
        return any(_ends(event, agent) and abs(event.t - last) <= self.silent_s for event in case.events)


def _ends(event: PlantEvent, agent: str) -> bool:
    return event.kind == "roster" and event.subject == agent and bool(_SAID.match(event.text))


def _killed(found: CommunicationSummary) -> Collection[tuple[str, float]]:
    """Return the agents that the scenario kills, and when (s)."""
    for tree in (found.info.plant.links, *(config.links for config in found.info.agents)):
        if not tree:
            continue
        try:
            return [(node.name, node.from_s) for node in EmulationConfig.of_tree(tree).netem.nodes if node.kill]
        except msgspec.ValidationError:
            continue
    return ()
