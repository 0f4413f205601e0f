"""A scenario with the disturbances of a schedule: checked as if a person had written it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from gridpeers.lab.chaos.chaos_checks import JUDGED_S, WITHIN_S, chaos_checks
from gridpeers.lab.chaos.disturbance import Disturbance, Schedule
from gridpeers.lab.chaos.feasible_supply import FeasibleSupply
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.netem.schema.partition import Partition
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.schema.check_notes import AgentEvent, why_away
from gridpeers.scenarios.schema.checks import check_switches, check_times
from gridpeers.scenarios.schema.loading import check_tables, read_tables
from gridpeers.scenarios.schema.participants import check_agentless, check_netem, check_schedule, inverters_of, netem_of
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.schema.supply import check_loads
from gridpeers.wire.timing import rounded_up

_LISTS = ("open", "close", "leave", "join")

_TABLES = ("load", "P_max_kW")

_LONGEST_NAME = 24


@dataclass(frozen=True)
class ChaosBase:
    scenario: ScenarioModel
    feeder: Feeder
    tree: Mapping[str, Any] = field(init=False, repr=False)
    supply: FeasibleSupply = field(init=False, repr=False)

    def __post_init__(self) -> None:
        assert len(self.scenario.cases) == 1, "a base has one case"
        name = f"{self.scenario.name[:_LONGEST_NAME]}-chaos"
        plain = replace(self.scenario, name=name, paper="", claims=(), metrics=())
        object.__setattr__(self, "tree", tomllib.loads(to_toml(plain, {}, terse=True)))
        object.__setattr__(self, "supply", FeasibleSupply(self.feeder))

    @property
    def text(self) -> str:
        return to_toml(self.scenario, {}, terse=True)

    @property
    def case(self) -> str:
        return next(iter(self.scenario.cases))

    @property
    def settled_s(self) -> float:
        netem = netem_of(self.scenario, self.case)
        faults: list[Fault | Partition | NodeFault] = [*netem.links, *netem.partitions, *netem.nodes]
        ends = [fault.from_s if fault.to_s is None else fault.to_s for fault in faults]
        return max([*ends, *(event.t_s for event in self.scenario.events)], default=0.0)

    def without_faults(self) -> ChaosBase:
        cases = {name: replace(case, netem=_faultless(case.netem)) for name, case in self.scenario.cases.items()}
        scenario = replace(self.scenario, netem=_faultless(self.scenario.netem), cases=cases)
        return self if scenario == self.scenario else ChaosBase(scenario, self.feeder)

    def changed_s(self, schedule: Schedule) -> float:
        return max([self.settled_s, *(disturbance.settled_s for disturbance in schedule)])

    def disturbed(self, schedule: Schedule, seed: int, since_s: float = 0.0) -> ScenarioModel:
        """Return the scenario with a schedule that `is_possible`, and with a seed of the messages' fates.

        It is to be restored from a run time (s) on, that of the last change or later.
        """
        problems = Problems("chaos")
        scenario, _ = check_tables(self._tree(schedule, seed, since_s), Path("chaos.toml"), problems, _read_feeder)
        problems.raise_if_any()
        return scenario

    def is_possible(self, schedule: Schedule) -> bool:
        """Return whether a scenario can say all of a schedule, and inverters can feed what it leaves."""
        problems = Problems("chaos")
        tree = self._tree(schedule, 1)
        del tree["checks"]  # a schedule does not change them, nor what is not checked here
        scenario = read_tables(tree, problems)
        check_times(scenario, problems)
        check_netem(scenario, self.feeder, problems)
        for check in (check_agentless, check_switches, check_loads, check_schedule):
            check(scenario, self.feeder, problems)
        return not problems.any and not self.supply.objection(scenario, self.case)

    def kept(self, drawn: Iterable[Disturbance]) -> Schedule:
        """Return those of some disturbances that are possible together: of two that are not, the first."""
        kept = tuple(drawn)
        if self.is_possible(kept):
            return kept
        kept = ()
        for disturbance in drawn:
            if self.is_possible((*kept, disturbance)):
                kept = (*kept, disturbance)
        return kept

    def lines(self, schedule: Schedule) -> list[str]:
        lines = []
        for disturbance in sorted(schedule, key=lambda it: it.begins_s):
            why = self._why_idle(schedule, disturbance)
            lines.append(f"{disturbance} (nothing happens: {why})" if why else str(disturbance))
        return lines

    def effective(self, schedule: Schedule) -> Schedule:
        """Return the disturbances of a schedule without those that only meet an agent that is away."""
        return tuple(it for it in schedule if not self._why_idle(schedule, it))

    def _why_idle(self, schedule: Schedule, disturbance: Disturbance) -> str:
        """Return why a disturbance has no effect, as a lie of an agent that has left before; "" if it may have one."""
        if disturbance.table != "node":
            return ""
        name = str(disturbance.entry["name"])
        events = merged_events(self.tree.get("event", ()), schedule)
        agent_events = [AgentEvent(float(it["t_s"]), it.get("leave", ()), it.get("join", ())) for it in events]
        at_start = any(row.name == name and not row.spare for row in inverters_of(self.scenario, self.feeder))
        why = why_away(name, disturbance.begins_s, disturbance.ends_s, agent_events, at_start=at_start)
        return f"{name} {why}" if why else ""

    def _tree(self, schedule: Schedule, seed: int, since_s: float = 0.0) -> dict[str, Any]:
        changed, T_c = self.changed_s(schedule), self.scenario.time.T_c_s
        since = max(changed, since_s)
        end = rounded_up(since + WITHIN_S + JUDGED_S, T_c)
        tree: dict[str, Any] = {**self.tree, "seed": seed}
        tree["time"] = self.tree["time"] | {"end_s": end}
        tree["checks"] = chaos_checks(self.scenario.checks, changed, since)
        tree["event"] = merged_events(self.tree.get("event", []), schedule)
        for table in ("link", "partition", "node"):
            added = [dict(it.entry) for it in sorted(schedule, key=lambda it: it.begins_s) if it.table == table]
            if entries := [*self.tree.get(table, []), *added]:
                tree[table] = entries
        return tree


def merged_events(own: Iterable[Mapping[str, Any]], schedule: Schedule) -> list[dict[str, Any]]:
    """Return the events of a scenario and of a schedule in the order of time; those of one time are one event.

    Examples
    --------
    >>> leave = Disturbance(table="event", entry={"t_s": 1.0, "leave": ["inv2"]}, back={"t_s": 2.0, "join": ["inv2"]})
    >>> for event in merged_events([{"label": "first", "t_s": 1.0, "open": ["13-152"]}], (leave,)):
    ...     print(event)
    {'label': 'first', 't_s': 1.0, 'open': ['13-152'], 'leave': ['inv2']}
    {'label': 'chaos1', 't_s': 2.0, 'join': ['inv2']}
    """
    found = {round(float(event["t_s"]), 9): dict(event) for event in own}
    taken = {event["label"] for event in found.values()}
    added = [part for it in schedule if it.table == "event" for part in (it.entry, it.back) if part]
    for entry in sorted(added, key=lambda part: float(part["t_s"])):
        t_s = round(float(entry["t_s"]), 9)
        if t_s not in found:
            label = next(name for k in range(1, len(added) + len(taken) + 2) if (name := f"chaos{k}") not in taken)
            taken.add(label)
            found[t_s] = {"label": label, "t_s": t_s}
        event = found[t_s]
        for key, value in entry.items():
            if key in _LISTS:
                event[key] = [*event.get(key, []), *value]
            elif key in _TABLES:
                event[key] = event.get(key, {}) | dict(value)
            elif key != "t_s":
                event[key] = value
    return [found[t_s] for t_s in sorted(found)]


def _faultless(netem: Netem) -> Netem:
    return replace(netem, links=(), partitions=(), nodes=())


_read_feeder = lru_cache(maxsize=8)(read_feeder)


@lru_cache(maxsize=4)
def base_of(text: str) -> ChaosBase:
    """Return the base with a text; a process makes it once."""
    problems = Problems("chaos")
    scenario, feeder = check_tables(tomllib.loads(text), Path("chaos.toml"), problems, _read_feeder)
    problems.raise_if_any()
    assert feeder is not None
    return ChaosBase(scenario, feeder)
