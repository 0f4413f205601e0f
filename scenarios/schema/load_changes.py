"""Loads that the events of a scenario change: their powers after each event, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.load_powers import LoadPowers
from gridpeers.plant.plant_config import LoadEvent
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_model import Event, LoadChange, ScenarioModel
from gridpeers.wire.messages import LoadSetting


def load_events(scenario: ScenarioModel) -> tuple[LoadEvent, ...]:
    """Return the changes of loads in the order of time, in SI units.

    Examples
    --------
    >>> from gridpeers.scenarios.schema import load_scenario
    >>> load_events(load_scenario("islanding")[0])
    ()
    """
    return tuple(
        LoadEvent(t=event.t_s, load=name, setting=_setting(change))
        for event in scenario.events
        for name, change in event.load.items()
    )


def powers_after(scenario: ScenarioModel, feeder: Feeder) -> Iterator[tuple[Event, dict[str, complex]]]:
    """Yield each event of a checked scenario, and the loads whose power (VA, nominal) an event has set until then."""
    powers, now = _load_powers(scenario, feeder), dict[str, complex]()
    for event in scenario.events:
        for text, change in event.load.items():
            name = powers.name(text)
            now[name] = powers.power(name, _setting(change), now.get(name, powers.table(name)))
        yield event, dict(now)


def check_loads(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Note loads that there are not, that an event names twice, and powers that none of them can have."""
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
                now[name] = powers.power(name, _setting(change), now.get(name, powers.table(name)))
            except ValueError as error:
                more = "" if change != LoadChange() else ", e.g. { factor = 1.5 }"
                problems.add(path, f"{error}{more}")


def _load_powers(scenario: ScenarioModel, feeder: Feeder) -> LoadPowers:
    return LoadPowers(feeder, sum(row.P_rated for row in inverters_of(scenario, feeder)))


def _setting(change: LoadChange) -> LoadSetting:
    P, Q = change.P_kW, change.Q_kvar
    return LoadSetting(factor=change.factor, P=None if P is None else 1e3 * P, Q=None if Q is None else 1e3 * Q)
