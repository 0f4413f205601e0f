"""The checks of what agents said, heard and used: the message account, heals, stale values, last words."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import inf
from typing import Annotated

from gridpeers.agents.agent_config import MAX_AGE
from gridpeers.lab.communication.accounts import Missing
from gridpeers.lab.communication.communication_summary import CommunicationSummary
from gridpeers.lab.communication.sent_states import Link
from gridpeers.scenarios.checks.check_verdict import (
    Check,
    NotJudgedError,
    Since,
    Violation,
    require_longer,
    require_time,
)
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.record.record_info import LIVE
from gridpeers.wire.schema.table_schema import Plausible, Unit

_NO_ARRIVALS = 'in real time a record = "decisions" does not have what arrived'

_SAID = re.compile(r"\S+ (leaves|left|dies)\b")  # Events of an agent that ends as the scenario, or a person, wants it


class MessageAccount(Check):
    """Every state that was sent is accounted for at its receiver, link by link.

    Of emulated links the accounts of their receivers count; of others in simulated time every decision
    has the neighbours' states of the tick before; in real time every number arrives, from the first one on that
    does between two processes, or once both have been there for 7 s (`LINKED_WITHIN`), unless its receiver says that
    it dropped as many. A process that is silent for long, as it is frozen, begins anew: its links are given up.
    """

    in_flight_s: Annotated[float, Unit("s"), Plausible("the time of a message on its way", 0.0, 60.0)] = 1.0
    """Time (s) before the end of the run, or before an agent ends or is frozen, from which on a message may still be
    on its way."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        found: CommunicationSummary = case.communication
        if found.unreadable:
            yield Violation(text="messages or parts of the record that cannot be read", value=found.unreadable, limit=0)
        for (src, dst), counts in sorted(found.counts.items()):
            if not counts.closes:
                sent = counts.sent + counts.duplicated
                text = f"messages of {src} delivered, dropped or in flight, of {sent} sent"
                there = counts.delivered + sum(counts.dropped.values()) + counts.in_flight
                yield Violation(text=text, agent=dst, value=there, limit=sent)
        links = self._without_account(found)
        for agent in found.info.agent_names:
            for link, missing in links.items():
                if link[1] == agent and missing.count:
                    text = f"states of {link[0]} neither heard nor lost"
                    yield Violation(text=text, t=missing.first, agent=agent, value=missing.count, limit=0)
        if not (found.counts or links):
            has_arrivals = found.info.simulated or found.info.level == "all"
            raise NotJudgedError("no agent listens to another" if has_arrivals else _NO_ARRIVALS)
        if links and not (found.counts or found.info.simulated):
            require_longer(found.t_end, "in_flight_s", self.in_flight_s)

    def _without_account(self, found: CommunicationSummary) -> dict[Link, Missing]:
        if found.info.simulated:
            return {link: missing for link, missing in found.unheard.items() if link not in found.counts}
        links: dict[Link, Missing] = {}
        for link in sorted(found.arrivals) if found.info.level == "all" else ():
            links[link] = Missing()
            late = [
                t
                for account in found.arrivals[link]
                for t in account.missing.values()
                if t <= min(account.until, found.t_end) - self.in_flight_s
            ]
            for t in late[found.dropped.get(link, 0) :]:
                links[link].add(t)
        return links


class Rejoined(Check):
    """Some time after the end of each cut, the receiver uses what the sender has sent since: no split is for ever."""

    within_s: Annotated[float, Unit("s"), Plausible("a time to rejoin", 0.0, 3600.0, above_zero=True)] = 6.0
    """Longest time (s): what Zenoh needs at most to find again a peer that it has lost."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        found: CommunicationSummary = case.communication
        if not found.heals:
            raise NotJudgedError("no link was cut and healed")
        judged = 0
        for agent in found.info.agent_names:
            for heal in found.heals:
                took = heal.took
                if took is None and heal.waited > self.within_s:
                    took = inf
                if heal.link[1] != agent or took is None:
                    continue
                judged += 1
                if took > self.within_s:
                    yield Violation(
                        text=f"no new value of {heal.link[0]} is used after the cut ended at {heal.t:g} s",
                        t=heal.t + self.within_s,
                        agent=agent,
                        value=None if took == inf else took,
                        unit="s",
                        limit=self.within_s,
                    )
        if not judged:
            raise NotJudgedError(
                f"after no cut was its link whole, and both of its agents at work, for {self.within_s:g} s"
            )


class StaleValues(Check):
    """No decision uses a neighbour's value that is older than a limit.

    A value that the neighbour's law keeps in force, without sending it again, does not grow older.
    """

    max_age_s: Annotated[float, Unit("s"), Plausible("the greatest age of a state", 0.0, 3600.0)] = 0.0
    """Greatest age (s); 0: `max_age` of the agents, and where they have none, 0.25 s, as in real time."""
    since_s: Since = 0.0

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        found: CommunicationSummary = case.communication
        if not found.oldest:
            raise NotJudgedError("no decision used a neighbour's value")
        require_time(case.history, self.since_s)
        limits = {
            config.name: self.max_age_s or config.control.degraded_communication.max_age or MAX_AGE
            for config in found.info.agents
        }
        beyond = {
            link: use
            for link, uses in found.oldest.items()
            if (use := next((each for each in uses if each.last >= self.since_s), None)) is not None
            and use.age > limits[link[1]] + 0.5 * found.info.T_c
        }
        place = {name: i for i, name in enumerate(found.info.agent_names)}
        order = sorted(beyond, key=lambda link: (-beyond[link].age, place[link[1]], place.get(link[0], 0)))
        for neighbour, agent in order:
            use = beyond[neighbour, agent]
            yield Violation(
                text=f"age of the value of {neighbour} that was used",
                t=max(use.t, self.since_s),
                agent=agent,
                value=use.age if use.age < inf else None,
                unit="s",
                limit=limits[agent],
            )


class LastWords(Check):
    """Each process of an agent speaks until the run ends, or it leaves or is killed as the scenario or a person says.

    An unexplained silence is a failure of the agent, of its process, or of its connection.
    """

    silent_s: Annotated[float, Unit("s"), Plausible("a silence", 0.0, 3600.0)] = 1.0
    """Longest time (s) between an agent's last state and the end of the run, or the event that explains it."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        found: CommunicationSummary = case.communication
        if not any(sent.epochs for sent in found.sent.values()):
            raise NotJudgedError("the record has no states of agents")
        joining = {name for event in case.scenario.events for name in event.join}
        setup = found.info.emulation
        nodes = setup.netem.nodes if setup else ()
        ended = [(node.name, node.from_s, self.silent_s + 2.0 * case.T_c) for node in nodes if node.kill]
        ended += [
            (event.subject, event.t, self.silent_s)
            for event in case.events
            if event.kind == "roster" and _SAID.match(event.text)
        ]
        end = min(float(case.history.t[-1]), found.t_end)
        for agent in found.info.agent_names:
            sent = found.sent.get(agent)
            epochs = sent.epochs if sent else {}
            if not epochs and agent not in joining and found.info.driver != LIVE:
                yield Violation(text="never sends a state", agent=agent, t=0.0)
            for _, last in epochs.values():
                if last >= end - self.silent_s:
                    continue
                if any(name == agent and abs(last - t) <= within for name, t, within in ended):
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
