"""Check of the message account: what was sent was heard, lost, cut off, late or is in flight, on every link."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf
from typing import Annotated

from netem.ledger import LinkCounts
from scenarios.checks.check_verdict import NotJudgedError, Violation
from scenarios.checks.checked_case import CheckedCase
from scenarios.checks.communication.record_content import Link, RecordContent, SentState
from scenarios.checks.communication.used_states import used_states
from scenarios.record.journal_coverage import inside
from wire.messages import PLANT
from wire.schema.plausible import Plausible, Unit


class MessageAccount:
    """Every state that was sent is accounted for at its receiver, link by link.

    Of emulated links the accounts and verdicts of their receivers count; of others in simulated time every decision
    has the neighbours' states of the tick before; in wall-clock time every number arrives.
    """

    in_flight_s: Annotated[float, Unit("s"), Plausible("the time of a message on its way", 0.0, 60.0)] = 1.0
    """Time (s) before the end of the run, or of an agent, from which on a message may still be on its way."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the links whose account does not close."""
        content = case.content
        if content.unreadable:
            yield Violation(
                text="messages or parts of the record that cannot be read", value=content.unreadable, limit=0
            )
        links = 0
        for link, counts in sorted(content.counts.items()):
            links += 1
            yield from _closes(link, counts)
            yield from _all_judged(content, link)
        for agent in content.agents:
            for link, missing in self._missing(content, agent):
                links += 1
                if missing:
                    yield Violation(
                        text=f"states of {link[0]} neither heard nor lost", t=missing[0], agent=agent,
                        value=len(missing), limit=0,
                    )  # fmt: skip
        if not links:
            raise NotJudgedError("no agent listens to another")

    def _missing(self, content: RecordContent, agent: str) -> Iterator[tuple[Link, list[float]]]:
        """Yield the links to an agent, and when (s) states were sent there that are not accounted for."""
        if content.simulated:
            yield from _not_used(content, agent)
            return
        own: dict[int, list[float]] = {}
        for state in content.of_agent(agent):
            own.setdefault(state.epoch, []).append(state.t)
        for link, arrived in sorted(content.heard.items()):
            if link[1] == agent and link[0] != PLANT:
                states = content.states.get(link[0], {})
                spans = [(times[0], min(times[-1], content.t_end) - self.in_flight_s) for times in own.values()]
                yield link, [t for span in spans for t in _not_arrived(states, arrived, span)]


def _not_arrived(
    states: Mapping[tuple[int, int], SentState], arrived: Mapping[tuple[int, int], str], span: tuple[float, float]
) -> list[float]:
    """Return when (s) states were sent that did not arrive, from the first that did while a process was there."""
    there = {key: state for key, state in states.items() if span[0] <= state.t <= span[1] and not state.quiet}
    first = min((state.t for key, state in there.items() if key in arrived), default=inf)
    return [state.t for key, state in there.items() if state.t >= first and key not in arrived]


def _closes(link: Link, counts: LinkCounts) -> Iterator[Violation]:
    """Yield the difference of an account: sent + duplicated = delivered + dropped + in flight."""
    src, dst = link
    found = counts.delivered + sum(counts.dropped.values()) + counts.in_flight
    if not counts.closes:
        text = f"messages of {src} delivered, dropped or in flight, of {counts.sent + counts.duplicated} sent"
        yield Violation(text=text, agent=dst, value=found, limit=counts.sent + counts.duplicated)


def _all_judged(content: RecordContent, link: Link) -> Iterator[Violation]:
    """Yield the states between the first and the last verdict of a link that have none."""
    src, dst = link
    traces = content.traces.get(link, [])
    judged = {number for trace in traces for number in trace.seq}
    if not judged or src == PLANT or dst == PLANT or not content.simulated:
        return
    first, last = min(judged), max(judged)
    there = {state.number for state in content.of_agent(dst)}
    missing = [
        state.t
        for state in content.of_agent(src)
        if first <= state.number <= last
        and state.number not in judged
        and not (state.quiet or state.idle)
        and {state.number, state.number + 1} <= there
    ]
    if missing:
        text = f"states of {src} without a verdict of the emulated link"
        yield Violation(text=text, t=missing[0], agent=dst, value=len(missing), limit=0)


def _not_used(content: RecordContent, agent: str) -> Iterator[tuple[Link, list[float]]]:
    """Yield the links of simulated time without faults, and the decisions (s) without the state of the tick before.

    The first decision of a process, and the first after a pause, have nothing from before.
    """
    for_neighbours, all_sent = {}, {}
    for name, states in content.states.items():
        for_neighbours[name] = {state.number for state in states.values() if not (state.quiet or state.idle)}
        all_sent[name] = {state.number for state in states.values()}
    own = {state.number for state in content.of_agent(agent) if not state.idle}
    lost, T_c = content.holes.get(PLANT, ()), content.info.T_c
    found: dict[Link, list[float]] = {}
    for each in used_states(content, agent):
        if each.link in content.counts:
            continue
        missing = found.setdefault(each.link, [])
        sent, there = for_neighbours.get(each.link[0], set()), all_sent.get(each.link[0], set())
        lag = None if each.number is None else each.states[0].number - each.number
        if lag == 1 and {state.number - 1 for state in each.states} <= sent:
            continue
        for state in each.states:
            before = state.number - 1
            newer = before in sent and before in own and lag != 1
            invented = lag is not None and not each.unused and state.number - lag not in there
            invented = invented and not inside(lost, (state.number - (lag or 0)) * T_c)
            if newer or invented:
                missing.append(state.t)
    yield from found.items()
