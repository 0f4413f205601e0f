"""Measures of the rows of a record, and of how a run settles after an event: pure functions of arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gridpeers.scenarios.results import metrics
from gridpeers.scenarios.results.history import Flags, Floats, History, Nameplates, Window
from gridpeers.scenarios.results.metric import DIGITS, HEADINGS, UNITS, Quantity, label
from gridpeers.scenarios.results.metrics import F_BAND, MPSI, MPSI_BAND, MQSI, STEADY, V_error, mean_frequency
from gridpeers.scenarios.results.metrics import Settling as Settling
from gridpeers.scenarios.results.metrics import Steady as Steady

if TYPE_CHECKING:
    from gridpeers.plant.equipment import Tables
    from gridpeers.scenarios.schema import ScenarioModel

__all__ = ["DIGITS", "F_BAND", "HEADINGS", "MPSI", "MPSI_BAND", "MQSI", "STEADY", "UNITS", "Flags", "Floats", "History"]
__all__ += ["Nameplates", "Quantity", "V_error", "Window", "label", "mean_frequency", "nameplates_of", "settling"]


def settling(history: History, nameplates: Nameplates, window: Window, f_nom: float) -> Settling:
    """Measure how a case settles in a window: from an event to the next one, or to the end of the run.

    `history` is `Result.record`; `nameplates` are in the order of its columns; f_nom is in Hz.
    """
    return metrics.settling(window.cut(history), nameplates, window, f_nom)


def nameplates_of(spec: ScenarioModel, feeder: Tables, case: str = "") -> Nameplates:
    """Return the nameplates of a scenario's inverters, in the order of a record's columns.

    With a case, inverters without an agent in it are left out, as in the sharing indices.
    """
    from gridpeers.scenarios.schema.participants import inverters_of, without_agent

    nameplates = Nameplates.of(inverters_of(spec, feeder))
    return nameplates.without(without_agent(spec, case)) if case else nameplates
