"""An entry `[[partition]]`: groups of agents without links to each other for a time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Literal

import msgspec

from gridpeers.netem.models.medium import Cut
from gridpeers.netem.schema.fault import EndTime, RunTime, Span
from gridpeers.wire.messages import PLANT
from gridpeers.wire.schema.table_schema import Example, Problem, problems_of
from gridpeers.wire.wording import suggestion


class Partition(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Cut of every link between two groups, in both directions. Agents in no group form one more group.

    The plant keeps all its links unless a group names it.
    """

    groups: Annotated[tuple[tuple[str, ...], ...], Example('[["inv1", "inv2"], ["MG2"]]')] = ()
    """Groups of inverters or microgrids, e.g. [["inv1", "inv2"], ["MG2"]]."""
    by: Literal["", "microgrid", "island", "halves"] = ""
    """Groups by rule: "microgrid", one for each microgrid; "island", one for each electrical island; "halves", the
    first and the second half of the table of inverters."""
    alone: str = ""
    """Inverter whose agent is alone in its group, instead of groups."""
    from_s: RunTime = 0.0
    """Start (s of run time)."""
    to_s: EndTime = None
    """End (s); without it, the end of the run."""
    hold: bool = False
    """true: messages between groups wait, and arrive after the partition ends; false: they are lost."""

    def group(self, name: str, microgrids: Mapping[str, str]) -> str | None:
        """Return the group of an agent; None for the plant, unless a group names it."""
        microgrid = microgrids.get(name, "").lower()
        for i, group in enumerate(self.groups):
            if name in group or (microgrid and microgrid in (other.lower() for other in group)):
                return str(i)
        if name == PLANT:
            return None
        if self.by == "microgrid":
            return microgrid
        if self.by == "halves":
            order = list(microgrids)
            return "first" if name in order and 2 * order.index(name) < len(order) else "second"
        return "alone" if name == self.alone else "the rest"

    def spans(self, src: str, dst: str, microgrids: Mapping[str, str]) -> list[Span]:
        """Return the cut of one link, if it joins two groups."""
        one, other = self.group(src, microgrids), self.group(dst, microgrids)
        if one is None or other is None or one == other:
            return []
        return [Span("partition", self.from_s, math.inf if self.to_s is None else self.to_s, Cut(hold=self.hold))]

    def over(self, timeline: Sequence[tuple[float, Mapping[str, str]]]) -> tuple[Partition, ...]:
        """Return the partitions of listed groups that do the same as this one by island; any other unchanged.

        `timeline` says from when on (s of run time, rising) each inverter stands in which island.

        Examples
        --------
        >>> split = Partition(by="island", from_s=1.0)
        >>> [(part.from_s, part.to_s, part.groups) for part in split.over([(0.0, {"inv1": "grid", "inv4": "grid"}),
        ...                                                                 (2.0, {"inv1": "inv1", "inv4": "inv4"})])]
        [(2.0, None, (('inv1',), ('inv4',)))]
        """
        if self.by != "island":
            return (self,)
        end = math.inf if self.to_s is None else self.to_s
        found = []
        for (since, island_of), (until, _) in pairwise((*timeline, (math.inf, {}))):
            start, stop = max(since, self.from_s), min(until, end)
            islands: dict[str, list[str]] = {}
            for name, island in island_of.items():
                islands.setdefault(island, []).append(name)
            if start < stop and len(islands) > 1:
                found.append(
                    Partition(
                        groups=tuple(tuple(names) for names in islands.values()),
                        from_s=start,
                        to_s=None if math.isinf(stop) else stop,
                        hold=self.hold,
                    )
                )
        return tuple(found)

    def problems(self, names: Sequence[str] | None, microgrids: Mapping[str, str]) -> list[Problem]:
        """Return the problems of the values: unknown names, and groups that part no two agents.

        Without names of agents any may be one.
        """
        found = problems_of(self)
        given = [key for key in ("groups", "by", "alone") if getattr(self, key)]
        if len(given) != 1:
            got = f"got {' and '.join(given)}" if given else "got none"
            found.append(Problem("", f'a partition needs one of groups, by = "microgrid" or alone = "inv1"; {got}'))
        if names is None:
            return found
        known = [*names, *dict.fromkeys(microgrids.values())]
        lower = {name.lower() for name in microgrids.values()} | {*names, PLANT}
        if self.alone and self.alone not in names:
            found.append(Problem("alone", f'no agent "{self.alone}"; {suggestion(self.alone, names, "agents")}'))
        seen: dict[str, int] = {}
        for i, group in enumerate(self.groups):
            for name in group:
                if name not in lower and name.lower() not in lower:
                    text = f'no agent or microgrid "{name}"; {suggestion(name, known, "names")}'
                    found.append(Problem(f"groups[{i}]", text))
                elif name in seen:
                    text = f'"{name}" is in groups[{seen[name]}] already; an agent is in one group only'
                    found.append(Problem(f"groups[{i}]", text))
                seen.setdefault(name, i)
        if not found and self.by != "island":
            parts = {self.group(name, microgrids) for name in (*names, PLANT)} - {None}
            if len(parts) < 2:
                found.append(Problem("", "separates no agents: all are in one group"))
        return found
