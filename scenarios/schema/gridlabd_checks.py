"""What GridLAB-D as the plant cannot do: each is refused by name, before anything starts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from plant.equipment import F_NOM, Feeder
from plant.inverter_parameters import GfmParameters
from scenarios.schema.scenario_errors import Problems
from scenarios.schema.scenario_model import ScenarioModel
from scenarios.schema.supply import supply_states

_OTHERWISE = 'or use simulator = "gridpeers"'


def check_gridlabd(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Note what a scenario with `simulator = "gridlabd"` asks for beyond GridLAB-D's delta mode and our model of it.

    That no inverter leaves or joins is noted for all other simulators together (`check_simulator`).
    """
    if scenario.plant.simulator != "gridlabd":
        return
    for text in _of_feeder(feeder):
        problems.add("plant.feeder", f"{text}; choose another feeder, {_OTHERWISE}")
    if feeder.f_nom != F_NOM:
        path = "plant.feeder" if scenario.plant.f_nom_Hz is None else "plant.f_nom_Hz"
        problems.add(
            path,
            f"GridLAB-D's inverters are written for {F_NOM:g} Hz, got {feeder.f_nom:g} Hz; take that, {_OTHERWISE}",
        )
    steps = 1.0 / scenario.time.h_s if scenario.time.h_s else 0.0
    if abs(steps - round(steps)) > 1e-6 and not problems.touch("time.h_s"):
        problems.add(
            "time.h_s", f"GridLAB-D's step must divide 1 s, got {scenario.time.h_s:g} s; choose 0.002 s, {_OTHERWISE}"
        )
    for i, event in enumerate(scenario.events):
        if event.synchronised:
            problems.add(
                f"event[{i}].synchronised",
                f'event "{event.label}": GridLAB-D as the plant has no synchronism check; '
                f"close at a time that you know to be good, without it, {_OTHERWISE}",
            )
    _check_parameters(scenario, feeder, problems)
    _check_supply(scenario, feeder, problems)


def _of_feeder(feeder: Feeder) -> Iterator[str]:
    """Yield what of a feeder is not written for GridLAB-D."""
    if feeder.elements or feeder.load_parts:
        yield f'feeder "{feeder.name}" comes from another program, with elements that are not written for GridLAB-D'
    elif feeder.source is None:
        yield f'feeder "{feeder.name}" has no substation, and GridLAB-D begins with a swing bus'
    switches = ((switch.from_bus, switch.to_bus, 3) for switch in feeder.switches)
    branches = Counter(bus for one, other, _ in (*feeder.branches(), *switches) for bus in (one, other))
    used = {load.bus for load in feeder.loads} | {bank.bus for bank in feeder.capacitors}
    used |= {unit.bus for unit in feeder.inverters}
    for unit in feeder.transformers:
        ends = (unit.from_bus, unit.to_bus)
        if not any(bus not in used and branches[bus] == 1 for bus in ends):
            yield f"the transformer from {ends[0]} to {ends[1]} feeds something, and none is written for GridLAB-D"


def _check_parameters(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Note parameters that GridLAB-D's inverters do not have, or tie to others."""
    seen: set[str] = set()
    for row in feeder.inverters:
        own = feeder.parameters_of(row, scenario.plant.gfm, scenario.plant.gfl)
        if isinstance(own, GfmParameters):
            path, default = "plant.gfm.V_lim_pu", GfmParameters().V_lim
            wrong = own.V_lim != default
            text = f"GridLAB-D has no such bound, got {own.V_lim:g} pu at {row.name}; leave it at {default:g}"
        else:
            path, wrong = "plant.gfl.P_set_lim_pu", own.P_set_lim > own.S_max
            text = (
                f"GridLAB-D clips P_set at S_max_pu = {own.S_max:g} pu, got {own.P_set_lim:g} pu at {row.name}; "
                "choose at most that"
            )
        if wrong and path not in seen:
            problems.add(path, f"{text}, {_OTHERWISE}")
            seen.add(path)


def _check_supply(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Note events that leave an inverter without voltage: GridLAB-D's does not come back from there."""
    index = {event.label: i for i, event in enumerate(scenario.events)}
    for state in supply_states(scenario, feeder):
        idle = [row.name for row in feeder.inverters if (row.bus, "A") in state.new]
        if state.event and idle:
            problems.add(
                f"event[{index[state.event.label]}]",
                f'event "{state.event.label}" de-energises {", ".join(idle)}, and an inverter of GridLAB-D needs a '
                f"voltage; leave a GFM connected to it, {_OTHERWISE}",
            )
