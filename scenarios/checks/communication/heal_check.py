"""Check of heals: agents that a cut parted use each other's values again soon after its end."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator
from math import inf
from typing import Annotated, NamedTuple

import msgspec

from netem.schema.pattern import Link as LinkEnds
from scenarios.checks.check_verdict import NotJudgedError, Violation
from scenarios.checks.checked_case import CheckedCase
from scenarios.checks.communication.record_content import Link, RecordContent
from scenarios.checks.communication.used_states import UsedState, used_states
from scenarios.emulation.emulation_config import EmulationConfig
from wire.schema.plausible import Plausible, Unit

_CUTS = ("cut", "partition")
"""Faults with an end, and reasons of dropped messages, that part two agents."""


class Heal(NamedTuple):
    """The end of a cut of one link."""

    link: Link
    t: float
    """When (s)."""


class Rejoined:
    """Some time after the end of each cut, the receiver uses what the sender has sent since: no split is for ever."""

    within_s: Annotated[float, Unit("s"), Plausible("a time to rejoin", 0.0, 3600.0, above_zero=True)] = 6.0
    """Longest time (s): what Zenoh needs at most to find again a peer that it has lost."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the links that stay silent though sender and receiver go on."""
        content = case.content
        heals = list(_heals(content))
        if not heals:
            raise NotJudgedError("no link was cut and healed")
        judged = 0
        for agent in content.agents:
            mine = [heal for heal in heals if heal.link[1] == agent]
            used = _by_link(content, agent) if mine else {}
            for heal in mine:
                found = self._took(content, heal, used.get(heal.link, []))
                judged += found is not None
                if found is not None and found > self.within_s:
                    yield Violation(
                        text=f"no new value of {heal.link[0]} is used after the cut ended at {heal.t:g} s",
                        t=heal.t + self.within_s,
                        agent=agent,
                        value=None if found == inf else found,
                        unit="s",
                        limit=self.within_s,
                    )
        if not judged:
            raise NotJudgedError(f"no cut ended more than {self.within_s:g} s before both of its agents did")

    def _took(self, content: RecordContent, heal: Heal, used: list[UsedState]) -> float | None:
        """Return after what time (s) a new value was used, infinity if never; None if that cannot be told."""
        src = heal.link[0]
        times = {state.number: state.t for state in content.of_agent(src)}
        first = bisect_left(used, heal.t, key=lambda each: each.states[-1].t)
        for each in used[first:]:
            if each.number is None or each.unused in ("silent", "stale"):
                continue
            for k, state in enumerate(each.states):
                if state.t >= heal.t and times.get(each.number + k, -inf) >= heal.t - 1e-9:
                    return state.t - heal.t
        return inf if self._both_go_on(content, heal) else None

    def _both_go_on(self, content: RecordContent, heal: Heal) -> bool:
        """Whether the sender speaks to its neighbours, and the receiver decides, for the limit's time after a heal."""
        src, dst = heal.link
        until = heal.t + self.within_s
        speaks = any(state.t >= until and not (state.quiet or state.idle) for state in reversed(content.of_agent(src)))
        return speaks and any(state.t >= until and not state.idle for state in reversed(content.of_agent(dst)))


def _by_link(content: RecordContent, agent: str) -> dict[Link, list[UsedState]]:
    """Return what an agent used, by link, in the order of time."""
    found: dict[Link, list[UsedState]] = defaultdict(list)
    for each in used_states(content, agent):
        found[each.link].append(each)
    return found


def _heals(content: RecordContent) -> Iterator[Heal]:
    """Yield the ends of the cuts of links over which an agent listens: those planned, and those of link commands."""
    listens: set[Link] = {
        (name, agent)
        for agent, entries in content.decisions.items()
        for _, entry in entries
        for name in entry.neighbours
    }
    found: dict[tuple[Link, int], Heal] = {}
    for tree in (config.links for config in content.info.agents if config.links):
        try:
            setup = EmulationConfig.of_tree(tree)
        except msgspec.ValidationError:
            continue
        for link in listens:
            for span in setup.netem.spans(LinkEnds(*link), setup.microgrids):
                if span.kind in _CUTS and span.to_s < content.t_end:
                    found[link, round(1e3 * span.to_s)] = Heal(link, span.to_s)
        break
    for link in sorted(listens & content.traces.keys()):
        was_cut = False
        for trace in content.traces[link]:
            for t, outcome in zip(trace.t, trace.outcome, strict=True):
                if was_cut and outcome not in _CUTS:
                    found.setdefault((link, round(1e3 * t)), Heal(link, t))
                was_cut = outcome in _CUTS
    yield from sorted(found.values())
