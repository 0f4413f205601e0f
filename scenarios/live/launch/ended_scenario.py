"""The scenario of a live run that has ended: as long as the run was, so that it can be run again for as long."""

from __future__ import annotations

from msgspec.structs import replace

from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.schema.scenario_model import LONGEST_RUN, Case, ScenarioModel
from gridpeers.wire.timing.clock import rounded_up


def ended_scenario(scenario: ScenarioModel, ended: float) -> tuple[ScenarioModel, tuple[str, ...]]:
    """Return the scenario of a live run with its true end, and sentences on that for the head of its file.

    What would come at or after the end is left out, as no scenario may have it: events, and faults of links and nodes.

    Parameters
    ----------
    scenario : ScenarioModel
        As the run began, with its one case.
    ended : float
        Run time of the last row (s).
    """
    begun = scenario.time.end_s
    end = min(rounded_up(ended, scenario.time.T_c_s), LONGEST_RUN)
    reached = tuple(event for event in scenario.events if event.t_s < end)
    missed = [f'"{event.label}" at {event.t_s:g} s' for event in scenario.events[len(reached) :]]
    labels = {event.label for event in reached}
    cases = {name: _case(case, end, labels) for name, case in scenario.cases.items()}
    changed = replace(
        scenario,
        time=replace(scenario.time, end_s=end),
        events=reached,
        netem=_netem(scenario.netem, end),
        cases=cases,
    )
    remarks = [f"A live run: what people did in it is in events.csv and run.mcap. It lasted {ended:.2f} s."]
    if end != begun:
        remarks.append(f"So end_s is {end:g}, where the scenario it began with had {begun:g}.")
    if ended > LONGEST_RUN:
        remarks.append(f"No scenario may be longer than {LONGEST_RUN:g} s.")
    if missed:
        remarks.append(f"Events that it did not reach are left out: {', '.join(missed)}.")
    if changed.netem != scenario.netem or any(cases[name].netem != case.netem for name, case in scenario.cases.items()):
        remarks.append("Faults of links and nodes that it did not reach are left out.")
    return changed, tuple(remarks)


def _case(case: Case, end: float, labels: set[str]) -> Case:
    """Return a case without what its scenario's events that are left out, and late faults, need."""
    available = {label: powers for label, powers in case.P_max_kW.items() if label in labels}
    return replace(case, P_max_kW=available, netem=_netem(case.netem, end))


def _netem(netem: Netem, end: float) -> Netem:
    """Return the entries that begin before the end (s)."""
    return replace(
        netem,
        links=tuple(each for each in netem.links if each.from_s < end),
        partitions=tuple(each for each in netem.partitions if each.from_s < end),
        nodes=tuple(each for each in netem.nodes if each.from_s < end),
    )
