"""The entries of a scenario on links and nodes, and their problems."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Annotated

import msgspec

from gridpeers.netem.models.delay import LONGEST_DELAY
from gridpeers.netem.models.lie import AnyLie
from gridpeers.netem.schema.fault import EndTime, Fault, RunTime, Span
from gridpeers.netem.schema.partition import Partition
from gridpeers.netem.schema.pattern import Link, links_among, objections
from gridpeers.wire.schema.table_schema import NO_KEY, Example, Plausible, Problem, Unit, below, problems_of
from gridpeers.wire.wording import suggestion


def _in_ppm(factor: float) -> str:
    return f"; did you mean {1.0 + factor * 1e-6:.9g} ({factor:g} ppm)?" if factor > 2.0 else ""


class Skew(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An agent's own clock: it shows factor * t + offset_s at run time t."""

    factor: Annotated[float, Plausible("the rate of a clock", 0.5, 2.0, hint=_in_ppm)] = 1.0
    """Rate of the clock: 1.0001 gains 100 ppm, as a cheap crystal may."""
    offset_s: Annotated[float, Unit("s"), Plausible("the offset of a clock", -3600.0, 3600.0)] = 0.0
    """Lead of the clock at t = 0 (s); negative is a lag."""


class NodeFault(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Faults of the agent of one inverter."""

    name: Annotated[str, Example('"inv3"')]
    """The inverter."""
    from_s: RunTime = 0.0
    """Start (s of run time)."""
    to_s: EndTime = None
    """End (s); without it, the end of the run."""
    kill: bool = False
    """true: its process is killed at from_s, and does not return."""
    pause: bool = False
    """true: its process stops from from_s to to_s; messages to it wait."""
    slow_s: Annotated[float, Unit("s"), Plausible("a computing delay", 0.0, LONGEST_DELAY)] = 0.0
    """Added computing time of each tick (s); its state is sent that much later."""
    skew: Skew | None = None
    """Error of its clock."""
    lies: AnyLie | None = None
    """False values that others hear in place of its states, from from_s to to_s."""

    def problems(self, names: Sequence[str] | None) -> list[Problem]:
        """Return the problems of the values; without names of agents any name may be one."""
        found = problems_of(self)
        if names is not None and self.name not in names:
            found.append(Problem("name", f'no agent "{self.name}"; {suggestion(self.name, names, "agents")}'))
        if not (self.kill or self.pause or self.slow_s or self.skew or self.lies):
            found.append(Problem("", "does nothing; give it kill, pause, slow_s, skew or lies"))
        if self.lies is not None:
            found += self._wrong_lies(self.lies, names)
        if self.kill and (self.pause or self.to_s is not None):
            found.append(
                Problem("kill", "a killed agent does not return; for a limited time, write pause = true with to_s")
            )
        elif self.pause and self.to_s is None:
            found.append(Problem("pause", "a pause needs an end; give to_s, or write kill = true"))
        return found

    def _wrong_lies(self, lie: AnyLie, names: Sequence[str] | None) -> list[Problem]:
        other, found = lie.in_name_of, []
        if other == self.name:
            found.append(Problem("lies.in_name_of", f"{other} is the liar itself; leave it out"))
        elif other and names is not None and other not in names:
            text = f'no agent "{other}"; {suggestion(other, names, "agents")}'
            found.append(Problem("lies.in_name_of", text))
        if self.kill or self.pause:
            found.append(Problem("lies", "a killed or paused agent sends nothing; write an entry for each"))
        return found


class Netem(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Faults of the links and nodes of a run. Every agent gets all of them, and applies those of its incoming links."""

    seed: Annotated[int, NO_KEY] = 1
    """Seed of all random draws."""
    links: tuple[Fault, ...] = msgspec.field(default=(), name="link")
    """Entries `[[link]]`."""
    partitions: tuple[Partition, ...] = msgspec.field(default=(), name="partition")
    """Entries `[[partition]]`."""
    nodes: tuple[NodeFault, ...] = msgspec.field(default=(), name="node")
    """Entries `[[node]]`."""

    def spans(self, link: Link, microgrids: Mapping[str, str]) -> tuple[Span, ...]:
        """Return the faults of one link by all entries; microgrids are in the order of the inverters' table."""
        found = [span for fault in self.links for span in fault.spans(*link, microgrids)]
        return (*found, *(span for part in self.partitions for span in part.spans(*link, microgrids)))

    def over(self, timeline: Sequence[tuple[float, Mapping[str, str]]]) -> Netem:
        """Return the same entries with partitions by island resolved; see `Partition.over`."""
        parts = tuple(part for entry in self.partitions for part in entry.over(timeline))
        return msgspec.structs.replace(self, partitions=parts)

    def problems(
        self, names: Sequence[str] | None, microgrids: Mapping[str, str], end_s: float, noted: Collection[str] = ()
    ) -> list[Problem]:
        """Return everything that is wrong, each with the path of its key, e.g. `link[2].loss.p`.

        Without `names`, as of a feeder that could not be read, what does not depend on them is checked. `noted` has the
        paths of the problems that the reader found: their values are defaults, which are not judged.
        """
        found: list[Problem] = []
        for i, fault in enumerate(self.links):
            wrong = [Problem("on", text) for text in objections(fault.on, names, microgrids)]
            found += below(f"link[{i}]", wrong + fault.problems() + _too_late(fault.from_s, end_s))
        for i, partition in enumerate(self.partitions):
            wrong = partition.problems(names, microgrids)
            found += below(f"partition[{i}]", wrong + _too_late(partition.from_s, end_s))
        for i, node in enumerate(self.nodes):
            found += below(f"node[{i}]", node.problems(names) + _too_late(node.from_s, end_s))
        if noted:
            entries = {_entry_of(path) for path in noted}
            hidden = {*noted, *entries}  # an entry as a whole is judged only when all of its keys are right
            return [it for it in found if it.path not in hidden and _entry_of(it.path) not in noted]
        if names is None:
            return found or self._contradictions_of_nodes()
        return found or self._contradictions(names, microgrids)

    def _contradictions(self, names: Sequence[str], microgrids: Mapping[str, str]) -> list[Problem]:
        """Return pairs of entries that contradict each other about a link, each with the first such link."""
        found: dict[tuple[str, str], Problem] = {}
        entries = [(f"link[{i}]", entry) for i, entry in enumerate(self.links)]
        parts = [(f"partition[{i}]", entry) for i, entry in enumerate(self.partitions)]
        several = len(entries) + len(parts) > 1  # an entry does not contradict itself, and there are many links
        for link in links_among(names) if several else ():
            placed = [(path, span) for path, entry in entries for span in entry.spans(*link, microgrids)]
            placed += [(path, span) for path, entry in parts for span in entry.spans(*link, microgrids)]
            for j, (path, span) in enumerate(placed):
                for other, before in placed[:j]:
                    if other != path and (other, path) not in found and _contradict(before, span):
                        found[other, path] = _contradiction(link, path, span, other, before)
        return list(found.values()) + self._contradictions_of_nodes()

    def _contradictions_of_nodes(self) -> list[Problem]:
        found = []
        for j, node in enumerate(self.nodes):
            for i, before in enumerate(self.nodes[:j]):
                if not _overlap(before.from_s, before.to_s, node.from_s, node.to_s):
                    continue
                if before.name == node.name:
                    text = f"overlaps node[{i}], also of {node.name}; write one entry, or times that do not meet"
                    found.append(Problem(f"node[{j}]", text))
                elif before.lies and node.lies and before.lies.in_name_of == node.lies.in_name_of != "":
                    text = f"node[{i}] lies in that name as well; write another name, or times that do not meet"
                    found.append(Problem(f"node[{j}].lies.in_name_of", text))
        return found


def _entry_of(path: str) -> str:
    return path.partition("]")[0] + "]"


def _too_late(from_s: float, end_s: float) -> list[Problem]:
    if from_s < end_s:
        return []
    return [Problem("from_s", f"{from_s:g} s is not before the end of the run at {end_s:g} s; move it, or raise end_s")]


def _overlap(from_s: float, to_s: float | None, other_from_s: float, other_to_s: float | None) -> bool:
    ends = (math.inf if to_s is None else to_s, math.inf if other_to_s is None else other_to_s)
    return from_s < ends[1] and other_from_s < ends[0]


def _contradict(one: Span, other: Span) -> bool:
    if not _overlap(one.from_s, one.to_s, other.from_s, other.to_s):
        return False
    if "partition" in (one.kind, other.kind):
        return {one.kind, other.kind} <= {"cut", "partition"} and one.model.hold != other.model.hold
    return one.kind == other.kind


def _contradiction(link: Link, path: str, span: Span, other: str, before: Span) -> Problem:
    start = max(span.from_s, before.from_s)
    key = f"{path}.{span.kind}" if span.kind != "partition" else path
    if span.kind == before.kind and span.kind != "partition":
        text = f"{other} gives {link} a {span.kind} as well, both at {start:g} s; change on, or the times"
    else:
        text = f"{other} cuts {link} as well at {start:g} s, and only one of them has hold = true; give it to both"
    return Problem(key, text)
