"""Check of power balance: what inverters generate is what loads and losses take."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Annotated

import numpy as np

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.load_powers import set_power
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.checks.physics.island_power_flow import MOST_NODES, IslandPowerFlow, NetworkState
from gridpeers.scenarios.results.switch_positions import closed_switches
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.schema.plausible import Plausible, Unit

_latest: list[tuple[Feeder, tuple[str, ...], PlantSettings, IslandPowerFlow]] = []
"""The power flows of the last feeder: the cases of a run have one in common."""


class PowerBalance(Check):
    """In each island, generation is load plus losses: the power flow of the feeder's tables has the recorded powers.

    The rows are those in the middle and at the end of each window. A load that was set, by the scenario or by hand, has
    the power that its event says. A row with the substation cannot be judged: the record does not have the substation's
    power.
    """

    tolerance_percent: Annotated[float, Unit("%"), Plausible("a tolerance", 1e-6, 100.0, above_zero=True)] = 0.5
    """Largest difference, of real or of reactive power (% of the island's apparent power)."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the worst row of each island."""
        flows, history, judged = _flows_of(case), case.history, 0
        worst: dict[tuple[str, str], Violation] = {}
        for row in _rows(case):
            try:
                balances = flows.balances(
                    _state_at(case, float(history.t[row])),
                    history.P[row],
                    history.Q[row],
                    history.V[row],
                    history.present[row],
                )
            except RuntimeError as error:
                yield Violation(
                    text=f"no state of the network has the recorded powers: {error}", t=float(history.t[row])
                )
                continue
            for balance in balances:
                judged += 1
                off, size = balance.generated - balance.taken, abs(balance.generated)
                for kind, part in (("real power", off.real), ("reactive power", off.imag)):
                    found = 100.0 * abs(part) / size if size else 0.0
                    name = history.inverters[balance.inverters[0]]
                    before = worst.get((name, kind))
                    if not found <= self.tolerance_percent and (before is None or found > (before.value or 0.0)):
                        worst[name, kind] = Violation(
                            text=f"generation minus load and losses, {kind}, island of {name}",
                            t=float(history.t[row]),
                            agent=name,
                            value=found,
                            unit="%",
                            limit=self.tolerance_percent,
                        )
        if not judged and not worst:
            raise NotJudgedError("no recorded row has an island without the substation")
        yield from worst.values()


def _flows_of(case: CheckedCase) -> IslandPowerFlow:
    plant = case.scenario.plant
    if plant.simulator == "helics":
        raise NotJudgedError("the network is that of a HELICS federate, which only that knows")
    nodes = sum(len(bus.phases) for bus in case.feeder.buses)
    if nodes > MOST_NODES:
        raise NotJudgedError(f"the feeder has {nodes} nodes, more than the {MOST_NODES} that a verdict has time for")
    settings = PlantSettings(gfm=plant.gfm, gfl=plant.gfl)
    names = case.history.inverters
    if not (_latest and _latest[0][0] is case.feeder and _latest[0][1:3] == (names, settings)):
        _latest[:] = [(case.feeder, names, settings, IslandPowerFlow(case.feeder, names, settings))]
    return _latest[0][3]


def _rows(case: CheckedCase) -> list[int]:
    """Return the rows in the middle and at the end of each window; the last row of a run without events."""
    t = case.history.t
    found = []
    for window in case.windows:
        inside = np.flatnonzero(window.rows(t))
        found += [int(inside[inside.size // 2]), int(inside[-1])] if inside.size else []
    untold = min((e.t for e in case.events if e.kind == "load" and _power_of(e) is None), default=inf)
    if untold < inf and not any(t[row] <= untold for row in found):
        raise NotJudgedError("loads were changed in the run, and its events do not say to which power")
    return [row for row in found if t[row] <= untold] or [len(t) - 1]


def _state_at(case: CheckedCase, t: float) -> NetworkState:
    """Return switches and loads at a time (s), by the plant's events; a load takes its power after its event."""
    powers = {
        event.subject: S
        for event in case.events
        if event.kind == "load" and event.t < t - 1e-9 and (S := _power_of(event)) is not None
    }
    until = (event for event in case.switch_events if event.t <= t + 1e-9)
    return NetworkState(closed_switches(case.feeder, until), frozenset(powers.items()))


def _power_of(event: PlantEvent) -> complex | None:
    """Return the power (VA, nominal) of a load from its event on; of a table of events, by its words."""
    return set_power(event.text) if event.P is None or event.Q is None else complex(event.P, event.Q)
