"""Which state of which neighbour each decision used, and how old it was."""

from __future__ import annotations

from typing import NamedTuple
from weakref import WeakKeyDictionary

from scenarios.checks.communication.record_content import Link, RecordContent, SentState


class UsedState(NamedTuple):
    """A neighbour at some decisions of an agent, which all treat it alike."""

    link: Link
    """The neighbour, and the agent."""
    states: list[SentState]
    """States of the agent that came out of these decisions, in the order of time."""
    number: int | None
    """Number of the neighbour's state at the first of them; in simulated time it goes up by one with each."""
    age: float | None
    """Age of that state (s); None if there was none."""
    unused: str
    """Why it was left out (`wire.journal.UNUSED`); empty if it was used."""

    @property
    def t(self) -> float:
        """Run time of the first of these decisions (s)."""
        return self.states[0].t


_found: WeakKeyDictionary[RecordContent, dict[str, list[UsedState]]] = WeakKeyDictionary()
"""What was found in a record, which three checks look at."""


def used_states(content: RecordContent, agent: str) -> list[UsedState]:
    """Return the neighbours of an agent's decisions, in the order of time."""
    known = _found.setdefault(content, {})
    if agent not in known:
        known[agent] = _used_states(content, agent)
    return known[agent]


def _used_states(content: RecordContent, agent: str) -> list[UsedState]:
    config = content.info.agent(agent)
    assert config is not None
    found, simulated, T_c = [], content.simulated, config.T_c
    for entry, states in content.segments(agent):
        own, unused, weights = states[0].number, entry.unused, entry.weights
        for i, name in enumerate(entry.neighbours):
            said = entry.states[i] if i < len(entry.states) else None
            if simulated:
                number, age = (None, None) if said is None else (own - said, said * T_c)
            else:
                number, age = said, entry.ages[i] if i < len(entry.ages) else None
            why = unused[i] if i < len(unused) else ""
            if not why and i < len(weights) and weights[i] == 0.0:
                why = "weight 0"
            found.append(UsedState((name, agent), states, number, age, why))
    return found
