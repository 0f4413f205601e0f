"""Measure a run from its record, the same for `gridpeers run` and for a live run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from plant.equipment import Feeder
from scenarios.results.findings import Findings, find_in
from scenarios.results.history import History, Nameplates
from scenarios.results.metrics import Window, messages_saved
from scenarios.results.own.window_metrics import own_measures
from scenarios.results.record import Recorded
from scenarios.schema import ScenarioModel
from scenarios.schema.participants import with_agent


def measure_run(
    scenario: ScenarioModel,
    feeder: Feeder,
    nameplates: Nameplates,
    histories: Mapping[str, History],
    windows: Mapping[str, Sequence[Window]],
    recorded: Mapping[str, Recorded],
) -> tuple[Findings, dict[str, dict[str, float]]]:
    """Return the findings with the scenario's own metrics, and the share of messages that the laws saved.

    Parameters
    ----------
    scenario, feeder : ScenarioModel, Feeder
        What was run; its events are those that happened.
    nameplates : Nameplates
        Nameplates in the order of the histories' columns.
    histories, windows, recorded : Mapping
        By case: the history, its windows of measurement, and the record.
    """
    T_c = scenario.time.T_c_s
    saved = {
        case: messages_saved(record.quiet, windows[case], len(with_agent(scenario, feeder, case)), T_c)
        for case, record in recorded.items()
    }
    own = own_measures(scenario, feeder, nameplates, histories, windows, saved)
    return replace(find_in(windows, scenario, feeder, nameplates, histories), own=own), saved
