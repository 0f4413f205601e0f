"""The checks of what agents said, heard and used: the message account, heals, stale values, last words."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from math import inf
from typing import Annotated

import msgspec

from gridpeers.agents.agent_config import MAX_AGE
from gridpeers.lab.communication.communication_summary import CommunicationSummary
from gridpeers.lab.communication.heals import Heal
from gridpeers.lab.communication.link_accounts import Missing
from gridpeers.lab.communication.record_pass import Link
from gridpeers.netem.ledger import LinkCounts
from gridpeers.scenarios.checks.check_verdict import (
    Check,
    NotJudgedError,
    Since,
    Violation,
    require_longer,
    require_time,
)
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.record.record_info import LIVE
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.schema.plausible import Plausible, Unit

_NO_ARRIVALS = 'in real time a record = "decisions" does not have what arrived'

_SAID = re.compile(r"\S+ (leaves|left|dies)\b")  # Events of an agent that ends as the scenario, or a person, wants it


class MessageAccount(Check):
    """Every state that was sent is accounted for at its receiver, link by link.

    Of emulated links the accounts and verdicts of their receivers count; of others in simulated time every decision
    has the neighbours' states of the tick before; in real time every number arrives, from the first one on that
    does between two processes, or once both have been there for 7 s (`LINKED_WITHIN`), unless its receiver says at that
    time that it dropped as many. A process that is silent for long, as it is frozen, begins anew: its links are given
    up.
    """

    in_flight_s: Annotated[float, Unit("s"), Plausible("the time of a message on its way", 0.0, 60.0)] = 1.0
    """Time (s) before the end of the run, or before an agent ends or is frozen, from which on a message may still be
    on its way."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the links whose account does not close."""
        found: CommunicationSummary = case.communication
        if found.unreadable:
            yield Violation(text="messages or parts of the record that cannot be read", value=found.unreadable, limit=0)
        for link, counts in sorted(found.counts.items()):
            yield from _closes(link, counts)
            text = f"states of {link[0]} without a verdict of the emulated link"
            yield from _missing(link, found.unjudged.get(link, Missing()), text)
        links = self._without_account(found)
        for agent in found.info.agent_names:
            for link, missing in links.items():
                if link[1] == agent:
                    yield from _missing(link, missing, f"states of {link[0]} neither heard nor lost")
        if not (found.counts or links):
            raise NotJudgedError("no agent listens to another" if found.has_arrivals else _NO_ARRIVALS)
        if links and not (found.counts or found.simulated):
            require_longer(found.t_end, "in_flight_s", self.in_flight_s)

    def _without_account(self, found: CommunicationSummary) -> dict[Link, Missing]:
        """Return what is missing on each link whose receiver keeps no account of it."""
        if found.simulated:
            return {link: missing for link, missing in found.unheard.items() if link not in found.counts}
        if not found.has_arrivals:
            return {}
        return {link: self._not_arrived(found, link) for link in sorted(found.arrivals)}

    def _not_arrived(self, found: CommunicationSummary, link: Link) -> Missing:
        missing = Missing()
        for account in found.arrivals[link]:
            until = min(account.until, found.t_end) - self.in_flight_s
            for t in account.missing.values():
                if t <= until:
                    missing.add(t)
        return missing


def _missing(link: Link, missing: Missing, text: str) -> Iterator[Violation]:
    if missing.count:
        yield Violation(text=text, t=missing.first, agent=link[1], value=missing.count, limit=0)


def _closes(link: Link, counts: LinkCounts) -> Iterator[Violation]:
    """Yield the difference of an account: sent + duplicated = delivered + dropped + in flight."""
    src, dst = link
    found = counts.delivered + sum(counts.dropped.values()) + counts.in_flight
    if not counts.closes:
        text = f"messages of {src} delivered, dropped or in flight, of {counts.sent + counts.duplicated} sent"
        yield Violation(text=text, agent=dst, value=found, limit=counts.sent + counts.duplicated)


class Rejoined(Check):
    """Some time after the end of each cut, the receiver uses what the sender has sent since: no split is for ever."""

    within_s: Annotated[float, Unit("s"), Plausible("a time to rejoin", 0.0, 3600.0, above_zero=True)] = 6.0
    """Longest time (s): what Zenoh needs at most to find again a peer that it has lost."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the links that stay silent though sender and receiver go on."""
        found: CommunicationSummary = case.communication
        if not found.heals:
            raise NotJudgedError("no link was cut and healed")
        judged = 0
        for agent in found.info.agent_names:
            for heal in found.heals:
                if heal.link[1] != agent:
                    continue
                took = self._took(heal)
                judged += took is not None
                if took is not None and took > self.within_s:
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

    def _took(self, heal: Heal) -> float | None:
        """Return after what time (s) a new value was used, infinity if never; None if there was no time for it."""
        if heal.took is not None:
            return heal.took
        return inf if heal.waited > self.within_s else None


class StaleValues(Check):
    """No decision uses a neighbour's value that is older than a limit.

    A value that the neighbour's law keeps in force, without sending it again, does not grow older.
    """

    max_age_s: Annotated[float, Unit("s"), Plausible("the greatest age of a state", 0.0, 3600.0)] = 0.0
    """Greatest age (s); 0: `max_age` of the agents, and where they have none, 0.25 s, as in real time."""
    since_s: Since = 0.0
    """Run time (s) from which on it is judged: the end of the last fault of links or agents, say."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the oldest value that was used of each link."""
        found: CommunicationSummary = case.communication
        if not found.used:
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
        for (neighbour, agent), use in ((link, beyond[link]) for link in order):
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
        """Yield the agents that stop without a reason."""
        found: CommunicationSummary = case.communication
        if not any(sent.epochs for sent in found.sent.values()):
            raise NotJudgedError("the record has no states of agents")
        joining = {name for event in case.scenario.events for name in event.join}
        killed = _killed(found)
        end = min(float(case.history.t[-1]), found.t_end)
        for agent in found.info.agent_names:
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
