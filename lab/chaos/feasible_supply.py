"""Islands that their inverters cannot feed: no control can change that, so it is not drawn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import NamedTuple

from gridpeers.plant.equipment import Feeder, InverterRow
from gridpeers.plant.equipment.connectivity import Connectivity
from gridpeers.plant.equipment.named_loads import named_loads
from gridpeers.scenarios.schema.participants import inverters_of, netem_of, without_agent
from gridpeers.scenarios.schema.scenario_model import Event, ScenarioModel
from gridpeers.scenarios.schema.supply import powers_after

MOST_LOAD, LEAST_LOAD = 0.97, 0.05
"""Load of an island, as parts of the ratings of its inverters that control: above, losses and vars take what is left,
below, its inverters are at their lower limit, which is no business of the control law."""

KILLED = 0.5
"""Part of its rating that an inverter is counted with whose agent has been killed: it stays at its last set-points."""


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
    def __init__(self, feeder: Feeder) -> None:
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
            return f"{load / 1e3:.0f} kW of load are not what {names} can feed"
        return ""
