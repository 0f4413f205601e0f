"""All messages and decisions of a record in memory, up to `MOST_BYTES`, for checks of a user's own.

The checks that judge every run go through the record once instead (`communication_summary`), whatever its size.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from gridpeers.lab.communication.record_pass import RecordSink, end_of, opened, read_into
from gridpeers.lab.communication.sent_states import Link, SentState
from gridpeers.netem.ledger import LinkCounts, LinkTrace
from gridpeers.scenarios.checks.check_verdict import NotJudgedError
from gridpeers.scenarios.record.decision_entries import Hole
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.wire.journal import Decision

MOST_BYTES = 64_000_000  # Largest record that is taken into memory: some ten minutes of nine agents


@dataclass(kw_only=True, eq=False)
class RecordContent(RecordSink):
    """States sent and heard, decisions, and accounts of emulated links."""

    info: RecordInfo
    t_end: float = 0.0
    states: dict[str, dict[tuple[int, int], SentState]] = field(default_factory=lambda: defaultdict(dict))
    """States of each agent by epoch and number, in the order of the file."""
    decisions: dict[str, list[tuple[int, Decision]]] = field(default_factory=lambda: defaultdict(list))
    """How each agent decided, with its epoch, in the order of time; in simulated time each holds until the next one."""
    holes: Mapping[str, Sequence[Hole]] = field(default_factory=dict)
    """Simulated time: run times (s) between which it is not known how an agent decided, or what the plant heard: the
    file is damaged there, or the rest of a journal is missing."""
    heard: dict[Link, dict[tuple[int, int], str]] = field(default_factory=lambda: defaultdict(dict))
    """Real time: epoch and number of each state that arrived, and why it was rejected, if it was."""
    dropped: dict[Link, int] = field(default_factory=lambda: defaultdict(int))
    """Real time: how many states a receiver dropped unread."""
    counts: dict[Link, LinkCounts] = field(default_factory=dict)
    traces: dict[Link, list[LinkTrace]] = field(default_factory=lambda: defaultdict(list))
    """Verdicts of each emulated link."""
    unreadable: int = 0
    complete: bool = True
    """The record was closed properly."""

    def of_agent(self, agent: str) -> list[SentState]:
        """Return the states of an agent in the order of time."""
        return sorted(self.states[agent].values(), key=lambda state: state.t)

    # ---------------------------------------------------------------- filled by a pass

    def take_state(self, agent: str, state: SentState) -> None:
        self.states[agent].setdefault((state.epoch, state.number), state)

    def take_decision(self, agent: str, epoch: int, decision: Decision) -> None:
        self.decisions[agent].append((epoch, decision))

    def take_heard(self, link: Link, epoch: int, number: int, rejected: str) -> None:
        self.heard[link][epoch, number] = rejected

    def take_dropped(self, link: Link, count: int) -> None:
        self.dropped[link] += count

    def take_counts(self, link: Link, counts: LinkCounts) -> None:
        self.counts[link] = counts

    def take_trace(self, trace: LinkTrace) -> None:
        self.traces[trace.src, trace.dst].append(trace)


def read_content(path: Path) -> RecordContent:
    """Read the file of a record; raise NotJudgedError if it has no decisions, or is too large for the memory."""
    file = opened(path)
    if (size := path.stat().st_size) > MOST_BYTES:
        raise NotJudgedError(
            f"its record has {size / 1e6:.0f} MB, more than the {MOST_BYTES / 1e6:.0f} MB that are taken into memory"
        )
    found = RecordContent(info=file.info, t_end=end_of(file))
    end = read_into(file, found)
    found.unreadable, found.holes, found.complete = end.unreadable, end.holes, file.complete
    for agent, decisions in found.decisions.items():  # a part of a journal may come twice, or late
        known = {(epoch, decision.tick): (epoch, decision) for epoch, decision in decisions}
        in_order = sorted(known.values(), key=lambda each: each[1].tick) if file.info.simulated else known.values()
        found.decisions[agent] = list(in_order)
    return found
