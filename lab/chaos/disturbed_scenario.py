"""Disturbances as entries of a scenario file, and a scenario with those of a schedule, checked as if a person wrote it.

So a scenario can say all that chaos can. The checks of such a run judge the promises of control once the last
disturbance has ended (docs/how-to/chaos.md).
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from math import inf
from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec
from msgspec.structs import replace

from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.netem.schema.partition import Partition
from gridpeers.plant.equipment import InverterRow, Tables
from gridpeers.plant.equipment.connectivity import Connectivity
from gridpeers.plant.equipment.named_loads import named_loads
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.checks.check_registry import ALWAYS, RETURNS, check_name
from gridpeers.scenarios.schema.checks import check_moves, check_times
from gridpeers.scenarios.schema.loading import check_tables, read_tables
from gridpeers.scenarios.schema.participants import check_agentless, check_netem, inverters_of, netem_of, without_agent
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_model import Event, ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.schema.supply import check_loads, powers_after
from gridpeers.wire.plugins.plugin import table_of
from gridpeers.wire.timing import rounded_up

WITHIN_S = 4.0
"""Time (s) after the last change within which a run must be restored. Set-points return from their limits at the rate
of the law. Vars are the slowest: they settle within 3 s after a large step."""

JUDGED_S = 0.8

REJOINED_S = 1.0
"""Longest time (s) after a cut until a value from the other side is used: simulated time needs no new connection, and
no delay is longer."""

LATEST_S = 0.5  # Time (s) after the last change from which no decision may use a stale value: the longest delay

_AFTER: Mapping[str, Mapping[str, Any]] = {
    "frequency": {"within_s": WITHIN_S},
    "voltage": {"within_s": WITHIN_S},
    "power_sharing": {"after_s": WITHIN_S, "with_killed": False},
    "var_sharing": {"after_s": WITHIN_S, "with_killed": False},
    "rating": {"with_killed": False},
    "steady": {"after_s": WITHIN_S},
}

RESTORED = frozenset({*_AFTER, "oscillation", RETURNS})
"""Checks of quantities that control restores; the other checks hold during disturbances too."""

_ALWAYS: Mapping[str, Mapping[str, Any]] = {"heal": {"within_s": REJOINED_S}, "oscillation": {"tail_s": 2.0}}

_LONGEST_NAME = 24


KINDS = (
    *("cut", "delay", "loss", "duplicate", "corrupt", "partition", "pause", "slow_s", "kill", "lies"),
    *("leave", "join", "open", "close", "load"),
)
"""Kinds of disturbances: the key that makes them, or their table."""


class Disturbance(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One disturbance.

    Examples
    --------
    >>> cut = Disturbance(table="link", entry={"on": "inv1 <-> inv4", "from_s": 2.0, "to_s": 3.0, "cut": True})
    >>> str(cut), cut.settled_s
    ('2 to 3 s: link on = "inv1 <-> inv4", cut = true', 3.0)
    >>> str(Disturbance(table="event", entry={"t_s": 2.0, "leave": ["inv2"]}))
    '2 s: event leave = ["inv2"]'
    """

    table: Literal["event", "link", "partition", "node"]
    entry: Mapping[str, Any]
    back: Mapping[str, Any] = {}

    @property
    def begins_s(self) -> float:
        return float(self.entry["t_s" if self.table == "event" else "from_s"])

    @property
    def ends_s(self) -> float:
        return float(self.back.get("t_s", inf) if self.table == "event" else self.entry.get("to_s", inf))

    @property
    def settled_s(self) -> float:
        return self.begins_s if self.ends_s == inf else self.ends_s

    @property
    def kind(self) -> str:
        return next(key for key in (self.table, *self.entry) if key in KINDS)

    def __str__(self) -> str:
        until = "" if self.ends_s == inf else f" to {self.ends_s:g}"
        what = [
            f"{key} = {json.dumps(value)}" for key, value in self.entry.items() if key not in ("t_s", "from_s", "to_s")
        ]
        return f"{self.begins_s:g}{until} s: {self.table} {', '.join(what)}"


Schedule = tuple[Disturbance, ...]  # Disturbances of one run, as they were drawn: not in the order of time


def in_order(schedule: Schedule) -> list[Disturbance]:
    return sorted(schedule, key=lambda it: it.begins_s)


@dataclass(frozen=True)
class ChaosBase:
    scenario: ScenarioModel
    feeder: Tables
    tree: Mapping[str, Any] = field(init=False, repr=False)
    supply: FeasibleSupply = field(init=False, repr=False)

    def __post_init__(self) -> None:
        assert len(self.scenario.cases) == 1, "a base has one case"
        name = f"{self.scenario.name[:_LONGEST_NAME]}-chaos"
        cases = {case: replace(of, expected_failures=()) for case, of in self.scenario.cases.items()}
        plain = replace(self.scenario, name=name, paper="", claims=(), metrics=(), cases=cases)
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
        for check in (check_agentless, check_moves, check_loads):
            check(scenario, self.feeder, problems)
        return not problems.any and not self.supply.objection(scenario, self.case)

    def kept(self, drawn: Iterable[Disturbance]) -> Schedule:
        """Return the disturbances that are possible together: of two that conflict, the first."""
        kept: Schedule = ()
        if self.is_possible(tuple(drawn)):
            return tuple(drawn)
        for disturbance in drawn:
            if self.is_possible((*kept, disturbance)):
                kept = (*kept, disturbance)
        return kept

    def _tree(self, schedule: Schedule, seed: int, since_s: float = 0.0) -> dict[str, Any]:
        changed, T_c = self.changed_s(schedule), self.scenario.time.T_c_s
        since = max(changed, since_s)
        end = rounded_up(since + WITHIN_S + JUDGED_S, T_c)
        tree: dict[str, Any] = {**self.tree, "seed": seed}
        tree["time"] = self.tree["time"] | {"end_s": end}
        tree["checks"] = chaos_checks(self.scenario.checks, changed, since)
        tree["event"] = merged_events(self.tree.get("event", []), schedule)
        for table in ("link", "partition", "node"):
            added = [dict(it.entry) for it in in_order(schedule) if it.table == table]
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
            if key in ("open", "close", "leave", "join"):
                event[key] = [*event.get(key, []), *value]
            elif key in ("load", "P_max_kW"):
                event[key] = event.get(key, {}) | dict(value)
            elif key != "t_s":
                event[key] = value
    return [found[t_s] for t_s in sorted(found)]


def _faultless(netem: Netem) -> Netem:
    return replace(netem, links=(), partitions=(), nodes=())


_read_feeder = lru_cache(maxsize=8)(read_feeder)


@lru_cache(maxsize=4)
def base_of(text: str) -> ChaosBase:
    problems = Problems("chaos")
    scenario, feeder = check_tables(tomllib.loads(text), Path("chaos.toml"), problems, _read_feeder)
    problems.raise_if_any()
    assert feeder is not None
    return ChaosBase(scenario, feeder)


def chaos_checks(
    own: Iterable[str | Mapping[str, Any]], changed_s: float, since_s: float
) -> list[str | dict[str, Any]]:
    """Return the checks of a run with disturbances, as entries of its scenario, from its own entries.

    The scenario's own keys of a check stay: its limits, but for those above, and that it is off. The run is to be
    restored from the last change (s of run time) on, or from later if inverters trip.
    """
    entries = {check_name(entry): entry if isinstance(entry, str) else dict(entry) for entry in own}
    limits_of: dict[str, Mapping[str, Any]] = {
        **{name: {**limits, "since_s": round(since_s, 9)} for name, limits in _AFTER.items()},
        "stale_values": {"since_s": round(changed_s + LATEST_S, 9)},
        **_ALWAYS,
    }
    for name in ALWAYS:
        given = table_of(entries.get(name, name))
        if name in limits_of and not given.get("off"):
            entries[name] = {**given, **limits_of[name]}
    entries.setdefault(RETURNS, RETURNS)
    return list(entries.values())


# -------------------------------------------------------------------- islands that their inverters can feed


MOST_LOAD, LEAST_LOAD = 0.97, 0.05
"""Bounds of the load of an island, as parts of the ratings of its controlled inverters. Above, losses and vars take the
rest. Below, inverters are at their lower limit, which the law does not move."""

KILLED = 0.5  # Part of its rating that counts for an inverter with a killed agent, which keeps its last set-points


class _Part(NamedTuple):
    inverters: tuple[InverterRow, ...]
    load: float
    buses: frozenset[str]
    has_substation: bool
    energised: bool


class _State(NamedTuple):
    t_s: float
    closed: frozenset[str]
    present: frozenset[str]
    killed: frozenset[str]
    powers: Mapping[str, complex]


class FeasibleSupply:
    """Find islands that their inverters cannot feed. No control can change that, so chaos draws none."""

    def __init__(self, feeder: Tables) -> None:
        self._feeder, self._graph = feeder, Connectivity(feeder)
        self._rows = (*feeder.inverters, *feeder.spares)
        self._switches = {name: switch.name for switch in feeder.switches for name in switch.names}
        self._loads = named_loads(feeder)
        self._demands = tuple(feeder.demands())
        self._source = (feeder.source.bus, "A") if feeder.source else None
        self._parts_of = cache(self._parts)

    def objection(self, scenario: ScenarioModel, case: str) -> str:
        """Return why an island cannot be fed or controlled at some time, "" if all can."""
        chosen, agentless = scenario.cases[case].secondary, without_agent(scenario, case)
        leaders = {row.name for row in self._rows if row.kind == "GFM" and chosen != "none"} - agentless
        leaders = leaders if isinstance(chosen, str) else leaders & set(chosen)
        for waiting_closes in (True, False):
            for state in self._states(scenario, case, waiting_closes=waiting_closes):
                forming = frozenset(row.name for row in self._rows if row.kind == "GFM" and row.name in state.present)
                for part in self._parts_of(state.closed, forming):
                    if text := self._objection(part, state, leaders):
                        return f"at {state.t_s:g} s {text}"
        return ""

    def _states(self, scenario: ScenarioModel, case: str, *, waiting_closes: bool) -> Iterator[_State]:
        """Yield the feeder at t = 0 and after each change; a switch that waits for synchronism may never close."""
        present = frozenset(row.name for row in inverters_of(scenario, self._feeder) if not row.spare)
        state = _State(0.0, self._graph.closed_at_start(), present, frozenset(), {})
        yield state
        set_powers = {event.t_s: powers for event, powers in powers_after(scenario, self._feeder)}
        changes: list[tuple[float, Event | str]] = [(event.t_s, event) for event in scenario.events]
        changes += [(node.from_s, node.name) for node in netem_of(scenario, case).nodes if node.kill]
        for t_s, change in sorted(changes, key=lambda item: item[0]):
            if isinstance(change, str):
                state = state._replace(t_s=t_s, killed=state.killed | {change})
            else:
                closed = state.closed - {self._switches.get(name, "") for name in change.open}
                if waiting_closes or not change.synchronised:
                    closed |= {self._switches[name] for name in change.close if name in self._switches}
                present = (state.present - set(change.leave)) | set(change.join)
                state = _State(t_s, closed, present, state.killed, set_powers[change.t_s])
            yield state

    def _parts(self, closed: frozenset[str], forming: frozenset[str]) -> tuple[_Part, ...]:
        fed, dead = self._graph.fed(closed, (row for row in self._rows if row.name in forming))
        return tuple(
            _Part(
                inverters=tuple(row for row in self._rows if row.node in nodes),
                load=sum(S.real for bus, ends, S in self._demands if any((bus, phase) in nodes for phase in ends)),
                buses=frozenset(bus for bus, _ in nodes),
                has_substation=self._source in nodes,
                energised=nodes in fed,
            )
            for nodes in (*fed, *dead)
        )

    def _objection(self, part: _Part, state: _State, leaders: set[str]) -> str:
        there = [row for row in part.inverters if row.name in state.present]
        if part.has_substation or not there:
            return ""
        names = ", ".join(row.name for row in there)
        if not part.energised:
            return f"no grid-forming inverter is with {names}"
        alive = [row for row in there if row.name not in state.killed]
        if leaders and not any(row.name in leaders for row in alive):
            return f"no grid-forming inverter with an agent that controls is with {names}"
        loads = ((S, self._loads[name]) for name, S in state.powers.items())
        load = part.load + sum(S.real - own.S.real for S, own in loads if own.bus in part.buses)
        able = sum(row.P_rated for row in alive)
        held = sum(row.P_rated for row in there) - able
        if not LEAST_LOAD * able + held <= load <= MOST_LOAD * able + KILLED * held:
            return f"{load / 1e3:.0f} kW of load do not fit the ratings of {names}"
        return ""
