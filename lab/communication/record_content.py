"""All that a record has of messages and decisions, for checks of one's own: in memory, so of a record of some size.

The checks that judge every run go through the record once instead (`communication_summary`), whatever its size.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from gridpeers.lab.communication.record_pass import DroppedStates, Link, RecordSink, end_of, opened, read_into
from gridpeers.lab.communication.sent_states import SentState
from gridpeers.netem.ledger import LinkCounts, LinkTrace
from gridpeers.scenarios.checks.check_verdict import NotJudgedError
from gridpeers.scenarios.record.decision_entries import Hole
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.wire.journal import Decision

MOST_BYTES = 64_000_000  # Largest record that is taken into memory: some ten minutes of nine agents


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordContent:
    """States sent and heard, decisions, and accounts of emulated links."""

    info: RecordInfo
    """The run."""
    t_end: float = 0.0
    """Latest run time in the record (s)."""
    states: Mapping[str, dict[tuple[int, int], SentState]] = field(default_factory=dict)
    """States of each agent by epoch and number, in the order of time."""
    decisions: Mapping[str, list[tuple[int, Decision]]] = field(default_factory=dict)
    """How each agent decided, with its epoch, in the order of time; in simulated time each holds until the next one."""
    holes: Mapping[str, Sequence[Hole]] = field(default_factory=dict)
    """Simulated time: run times (s) between which it is not known how an agent decided, or what the plant heard: the
    file is damaged there, or the rest of a journal is missing."""
    heard: Mapping[Link, dict[tuple[int, int], str]] = field(default_factory=dict)
    """Real time: epoch and number of each state that arrived, and why it was rejected, if it was."""
    dropped: Mapping[Link, list[DroppedStates]] = field(default_factory=dict)
    """Real time: numbers of states that a receiver dropped, without more."""
    counts: Mapping[Link, LinkCounts] = field(default_factory=dict)
    """Last account of each emulated link."""
    traces: Mapping[Link, list[LinkTrace]] = field(default_factory=dict)
    """Verdicts of each emulated link."""
    unreadable: int = 0
    """Messages and reports that could not be read."""
    complete: bool = True
    """Whether the record was closed properly."""

    @property
    def simulated(self) -> bool:
        """Whether the run kept simulated time."""
        return self.info.simulated

    @property
    def agents(self) -> tuple[str, ...]:
        """All configured agents."""
        return self.info.agent_names

    def of_agent(self, agent: str) -> list[SentState]:
        """Return the states of an agent in the order of time."""
        return self._in_order.get(agent, [])

    @cached_property
    def _in_order(self) -> dict[str, list[SentState]]:
        return {agent: sorted(of.values(), key=lambda state: state.t) for agent, of in self.states.items()}


def read_content(path: Path) -> RecordContent:
    """Read the file of a record; raise NotJudgedError if it has no decisions, or is too large for the memory."""
    file, found = opened(path), _Content()
    if (size := path.stat().st_size) > MOST_BYTES:
        raise NotJudgedError(
            f"its record has {size / 1e6:.0f} MB, more than the {MOST_BYTES / 1e6:.0f} MB that are taken into memory"
        )
    end = read_into(file, found)
    decisions = {
        agent: [(epoch, decision) for (epoch, _), decision in of.items()] for agent, of in found.decisions.items()
    }
    if file.info.simulated:
        decisions = {agent: sorted(of, key=lambda each: each[1].tick) for agent, of in decisions.items()}
    return RecordContent(
        info=file.info,
        t_end=end_of(file),
        states=found.states,
        decisions=decisions,
        holes=end.holes,
        heard=found.arrivals,
        dropped=found.drops,
        counts=found.last_counts,
        traces=found.traces,
        unreadable=end.unreadable,
        complete=file.complete,
    )


class _Content(RecordSink):
    def __init__(self) -> None:
        self.states: dict[str, dict[tuple[int, int], SentState]] = defaultdict(dict)
        self.decisions: dict[str, dict[tuple[int, int], Decision]] = defaultdict(dict)
        self.arrivals: dict[Link, dict[tuple[int, int], str]] = defaultdict(dict)
        self.drops: dict[Link, list[DroppedStates]] = defaultdict(list)
        self.last_counts: dict[Link, LinkCounts] = {}
        self.traces: dict[Link, list[LinkTrace]] = defaultdict(list)

    def state(self, agent: str, state: SentState) -> None:
        self.states[agent].setdefault((state.epoch, state.number), state)

    def decision(self, agent: str, epoch: int, decision: Decision) -> None:
        self.decisions[agent][epoch, decision.tick] = decision

    def heard(self, link: Link, epoch: int, number: int, rejected: str) -> None:
        self.arrivals[link][epoch, number] = rejected

    def dropped(self, link: Link, states: DroppedStates) -> None:
        self.drops[link].append(states)

    def counts(self, link: Link, counts: LinkCounts) -> None:
        self.last_counts[link] = counts

    def trace(self, trace: LinkTrace) -> None:
        self.traces[trace.src, trace.dst].append(trace)
