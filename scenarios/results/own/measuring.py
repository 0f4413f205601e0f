"""A scenario's own metrics, of every window of every case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from plant.equipment import Feeder
from scenarios.results.history import History, Plates, read_only
from scenarios.results.metrics import Window
from scenarios.results.own.metric import Measured, make_metrics, measured
from scenarios.results.own.window_data import WindowData
from scenarios.spec import Scenario
from scenarios.spec.agentless import without_agent
from scenarios.spec.own_modules import metrics_of


def own_measures(
    scenario: Scenario,
    feeder: Feeder,
    plates: Plates,
    histories: Mapping[str, History],
    windows: Mapping[str, Sequence[Window]],
    saved: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
) -> dict[str, dict[str, Measured]]:
    """Return what the scenario's own metrics came to, by case and window; empty if it has none.

    Parameters
    ----------
    scenario, feeder : Scenario, Feeder
        What was run.
    plates : Plates
        Nameplates in the order of the histories' columns.
    histories, windows : Mapping
        By case: what was recorded, and where it is measured.
    saved : Mapping, optional
        Share of messages that the laws saved, by case and window.
    """
    metrics = make_metrics(metrics_of(scenario))
    if not metrics:
        return {}
    found: dict[str, dict[str, Measured]] = {}
    for case, history in histories.items():
        mine, whole = read_only(plates.without(without_agent(scenario, case))), read_only(history)
        with np.errstate(all="ignore"):  # what is no number is told as such
            found[case] = {
                window.label: measured(
                    metrics,
                    WindowData(
                        case=case,
                        window=window,
                        whole=whole,
                        plates=mine,
                        f_nom=feeder.f_nom,
                        T_c=scenario.time.T_c_s,
                        messages_saved=saved.get(case, {}).get(window.label, 0.0),
                    ),
                )
                for window in windows[case]
            }
    return found
