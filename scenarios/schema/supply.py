"""Loads that events change, and islands that neither the substation nor a grid-forming inverter feeds."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import chain
from typing import NamedTuple

from gridpeers.plant.equipment import Tables
from gridpeers.plant.equipment.connectivity import Connectivity, Node
from gridpeers.plant.equipment.named_loads import LoadPowers, with_powers
from gridpeers.plant.plant_config import LoadEvent
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_model import Event, LoadChange, ScenarioModel
from gridpeers.wire.messages import LoadSetting


def load_events(scenario: ScenarioModel) -> tuple[LoadEvent, ...]:
    return tuple(
        LoadEvent(t=event.t_s, load=name, setting=_setting(change))
        for event in scenario.events
        for name, change in event.load.items()
    )


def powers_after(scenario: ScenarioModel, feeder: Tables) -> Iterator[tuple[Event, dict[str, complex]]]:
    """Yield each event of a checked scenario, and the loads whose power (VA, nominal) an event has set until then."""
    powers, now = _load_powers(scenario, feeder), dict[str, complex]()
    for event in scenario.events:
        for text, change in event.load.items():
            name = powers.name(text)
            now[name] = powers.power(name, _setting(change), now)
        yield event, dict(now)


def check_loads(scenario: ScenarioModel, feeder: Tables, problems: Problems) -> None:
    powers, now = _load_powers(scenario, feeder), dict[str, complex]()
    for i, event in enumerate(scenario.events):
        named: set[str] = set()
        for text, change in event.load.items():
            path = f"event[{i}].load.{text}"
            try:
                name = powers.name(text)
            except ValueError as error:
                problems.add(f"event[{i}].load", str(error))
                continue
            if name in named:
                problems.add(path, f'load "{name}" is named twice in event "{event.label}"; name it once')
                continue
            named.add(name)
            if problems.touch(path) or problems.below(path):
                continue
            try:
                now[name] = powers.power(name, _setting(change), now)
            except ValueError as error:
                more = "" if change != LoadChange() else ", e.g. { factor = 1.5 }"
                problems.add(path, f"{error}{more}")


def _load_powers(scenario: ScenarioModel, feeder: Tables) -> LoadPowers:
    return LoadPowers(feeder, sum(row.P_rated for row in inverters_of(scenario, feeder)))


def _setting(change: LoadChange) -> LoadSetting:
    P, Q = change.P_kW, change.Q_kvar
    return LoadSetting(factor=change.factor, P=None if P is None else 1e3 * P, Q=None if Q is None else 1e3 * Q)


_SHOWN = 6


class SupplyState(NamedTuple):
    """Supply of the feeder from an event on."""

    event: Event | None
    dead: frozenset[Node]
    """De-energised nodes."""
    new: frozenset[Node]
    """Those of them that were fed until then."""
    islands: tuple[frozenset[Node], ...]
    inverters: frozenset[str]


def check_supply(scenario: ScenarioModel, feeder: Tables, problems: Problems) -> None:
    start = next(supply_states(scenario, feeder))
    if what := _what(start.dead, start.inverters, feeder):
        problems.add(
            "plant.feeder",
            f"at t = 0 nothing feeds {what}: neither the substation nor a grid-forming inverter is connected to them; "
            "close a switch in switches.csv, add a source.csv, or make an inverter there a GFM",
        )


def supply_notes(scenario: ScenarioModel, feeder: Tables) -> tuple[str, ...]:
    """Return sentences on what each event of a checked scenario de-energises or overloads: it may be meant."""
    notes, rows = [], inverters_of(scenario, feeder)
    after = (with_powers(feeder, powers) if powers else feeder for _, powers in powers_after(scenario, feeder))
    for state, loaded in zip(supply_states(scenario, feeder), chain([feeder], after), strict=True):
        event = state.event
        when = f'event "{event.label}" at {event.t_s:g} s' if event else "the start"
        if event and (what := _what(state.new, state.inverters, loaded)):
            notes.append(
                f"{when} de-energises {what}: neither the substation nor a grid-forming inverter is connected to them"
            )
        for part in state.islands:
            there = [row for row in rows if row.node in part]
            rated = sum(row.P_rated for row in there if row.name in state.inverters)
            load = _load(part, loaded)
            if load > rated:
                names = ", ".join(row.name for row in there if row.name in state.inverters)
                notes.append(
                    f"{when} leaves {load / 1e3:.0f} kW of load to an island of {names}, rated "
                    f"{rated / 1e3:.0f} kW together, which is too little"
                )
    return tuple(notes)


def supply_states(scenario: ScenarioModel, feeder: Tables) -> Iterator[SupplyState]:
    graph = Connectivity(feeder)
    closed = graph.closed_at_start()
    names = {name: switch.name for switch in feeder.switches for name in switch.names}
    forming = [row for row in inverters_of(scenario, feeder) if row.kind == "GFM"]
    present = frozenset(row.name for row in feeder.inverters)
    source = (feeder.source.bus, "A") if feeder.source else None
    before: frozenset[Node] = frozenset()
    for event in (None, *scenario.events):
        if event is not None:  # `check_moves` notes unknown names
            closed = closed - {names.get(name, "") for name in event.open}
            closed = closed | {names[name] for name in event.close if name in names}
            present = (present - set(event.leave)) | set(event.join)
        fed, dead = graph.fed(closed, (row for row in forming if row.name in present))
        nodes = frozenset(node for part in dead for node in part)
        islands = tuple(part for part in fed if source not in part)
        yield SupplyState(event, nodes, nodes - before, islands, present)
        before = nodes


def _load(nodes: Collection[Node], feeder: Tables) -> float:
    """Real power (W) of the loads at some nodes; of a delta load every branch that has one of its ends there."""
    return sum(S.real for bus, ends, S in feeder.demands() if any((bus, phase) in nodes for phase in ends))


def _what(nodes: frozenset[Node], inverters: frozenset[str], feeder: Tables) -> str:
    """Buses with their load and inverters; "" where there is nothing that would miss its voltage."""
    buses = [bus.name for bus in feeder.buses if any((bus.name, phase) in nodes for phase in bus.phases)]
    lost = _load(nodes, feeder)
    idle = [row.name for row in (*feeder.inverters, *feeder.spares) if row.name in inverters and row.node in nodes]
    if not lost and not idle:
        return ""
    some = ", ".join(buses[:_SHOWN]) + (", ..." if len(buses) > _SHOWN else "")
    count = "a bus" if len(buses) == 1 else f"{len(buses)} buses"
    return f"{count} ({some}) with {lost / 1e3:.0f} kW of load" + (f" and {', '.join(idle)}" if idle else "")
