"""Data of the figures of a run; made without matplotlib, which takes longer to import than a case to run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from gridpeers.scenarios.console import in_order, short
from gridpeers.scenarios.results.history import History, Nameplates, windows
from gridpeers.scenarios.results.island_membership import IslandInterval, Islands, RecordedIsland
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.configs import limits_of
from gridpeers.scenarios.schema.participants import without_agent
from gridpeers.scenarios.schema.plugin_keys import law_of
from gridpeers.scenarios.schema.scenario_model import Event, LoadChange

if TYPE_CHECKING:
    from gridpeers.scenarios.checks.checked_case import CheckedCase
    from gridpeers.scenarios.results.shared_quantities import SharedRecord


class Mark(NamedTuple):
    label: str
    """Label of its window; "" for none."""
    t: float
    what: str = ""
    """The event in a few words."""


@dataclass(frozen=True, kw_only=True)
class Drawing:
    histories: Mapping[str, History]
    titles: Mapping[str, str]
    nameplates: Nameplates
    events: Sequence[Mark]
    f_nom: float
    without_agent: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Inverters that have no agent, by case: the sharing indices leave them out."""
    moves: bool = False
    """True if inverters leave or join: that has a figure of its own."""
    limited: Sequence[str] = ()
    """Inverters whose available power changes: that has a figure of its own too."""
    island_intervals: Mapping[str, Sequence[IslandInterval]] = field(default_factory=dict)
    """Times with several islands, by case; only of cases that have any. Measures are those of the worst island then."""
    microgrid_of: Mapping[str, str] = field(default_factory=dict)
    shared: Mapping[str, SharedRecord] = field(default_factory=dict)
    """Quantities that laws declare to share, each with a figure of its own."""

    def most_islands(self, case: str) -> Islands:
        """Return the islands of a case when there are most of them; they have a figure of their own."""
        return max((interval.islands for interval in self.island_intervals[case]), key=len)

    @property
    def end(self) -> float:
        """End of the longest case (s)."""
        return max(float(history.t[-1]) for history in self.histories.values())

    def words(self, case: str) -> str:
        title = self.titles.get(case, "")
        return f"{case}: {title}" if title else case

    def island_title(self, island: RecordedIsland) -> str:
        """Return a few words on an island: its microgrid if it lies in one, or its first inverter."""
        microgrids = {self.microgrid_of.get(name, "") for name in island.inverters}
        if len(microgrids) == 1 and (microgrid := microgrids.pop()):
            return f"microgrid {microgrid.removeprefix('MG')}"
        return f"island of {island.inverters[0]}"


def drawing_of(scenario: ScenarioModel, cases: Mapping[str, CheckedCase]) -> Drawing:
    *_, last = cases.values()  # in real time each case has its own events
    came = [window for window in windows(scenario, last.events) if window.start < last.history.t[-1]]
    commands = [Mark("", event.t, event.subject) for event in last.events if event.kind == "command"]
    what = {event.label: happening(event, scenario) for event in scenario.events}
    limited = dict.fromkeys(limit.inverter for case in scenario.cases for limit in limits_of(scenario, case))
    several = {name: [it for it in case.islands if len(it.islands) > 1] for name, case in cases.items()}
    return Drawing(
        histories={name: case.history for name, case in cases.items()},
        titles={case: rule.title for case, rule in scenario.cases.items()},
        nameplates=Nameplates.of_columns(last.history.inverters, last.feeder),
        events=[*(Mark(it.label, it.start, what.get(it.label, "")) for it in came), *commands],
        f_nom=last.f_nom,
        without_agent={case: without_agent(scenario, case) for case in scenario.cases},
        moves=any(event.leave or event.join for event in scenario.events)
        or any(mark.what in last.history.inverters for mark in commands),
        limited=tuple(limited),
        island_intervals={case: of for case, of in several.items() if of},
        microgrid_of={row.name: row.microgrid for row in (*last.feeder.inverters, *last.feeder.spares)},
        shared=_shared(cases),
    )


def _shared(cases: Mapping[str, CheckedCase]) -> Mapping[str, SharedRecord]:
    if not any(law_of(case.scenario, name).shared for name, case in cases.items()):
        return {}
    from gridpeers.scenarios.results.shared_quantities import shared_records  # it imports what reads records

    return shared_records(cases)


def happening(event: Event, scenario: ScenarioModel) -> str:
    """Return an event in a few words, as "13-152 opens"."""
    done = (
        (event.open, ", ".join(event.open), "open"),
        (event.close, ", ".join(event.close), "close"),
        (event.leave, short(in_order(event.leave)), "leave"),
        (event.join, short(in_order(event.join)), "join"),
    )
    parts = [f"{text} {verb}{'s' if len(names) == 1 else ''}" for names, text, verb in done if names]
    limits = [limit for case in scenario.cases for limit in limits_of(scenario, case) if limit.t == event.t_s]
    if limits:
        names, powers = short(in_order({limit.inverter for limit in limits})), {limit.P_max for limit in limits}
        parts += [f"{names}: {powers.pop() / 1e3:g} kW" if len(powers) == 1 else f"{names}: P_max by case"]
    if event.load:
        changes = {_power_in_short(change) for change in event.load.values()}
        names = f"load {next(iter(event.load))}" if len(event.load) == 1 else f"{len(event.load)} loads"
        parts.append(f"{names}: {changes.pop()}" if len(changes) == 1 else f"{names} change")
    return ", ".join(parts)


def _power_in_short(change: LoadChange) -> str:
    given = ((change.factor, "times"), (change.P_kW, "kW"), (change.Q_kvar, "kvar"))
    return ", ".join(f"{value:g} {unit}" for value, unit in given if value is not None)
