"""Measures of the rows of a record, and how a run settles after an event; all pure functions of arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gridpeers.scenarios.results import metrics
from gridpeers.scenarios.results.event_windows import Window
from gridpeers.scenarios.results.history import Flags, Floats, History, Nameplates
from gridpeers.scenarios.results.metric import DIGITS, HEADINGS, UNITS, Quantity, label
from gridpeers.scenarios.results.metrics import (
    F_BAND,
    MPSI,
    MPSI_BAND,
    MQSI,
    STEADY,
    Settling,
    Steady,
    V_error,
    mean_frequency,
    mean_voltage,
)

if TYPE_CHECKING:
    from gridpeers.plant.equipment import Feeder
    from gridpeers.scenarios.schema import ScenarioModel

__all__ = [
    "DIGITS",
    "F_BAND",
    "HEADINGS",
    "MPSI",
    "MPSI_BAND",
    "MQSI",
    "STEADY",
    "UNITS",
    "Flags",
    "Floats",
    "History",
    "Nameplates",
    "Quantity",
    "Settling",
    "Steady",
    "V_error",
    "Window",
    "label",
    "mean_frequency",
    "mean_voltage",
    "nameplates_of",
    "settling",
]


def settling(history: History, nameplates: Nameplates, window: Window, f_nom: float) -> Settling:
    """Measure how a case settles in a window.

    Parameters
    ----------
    history : History
        The case as recorded (`Result.record`).
    nameplates : Nameplates
        Nameplates in the order of its columns.
    window : Window
        From an event to the next, or to the end of the run.
    f_nom : float
        Nominal frequency (Hz).
    """
    return metrics.settling(window.cut(history), nameplates, window, f_nom)


def nameplates_of(spec: ScenarioModel, feeder: Feeder, case: str = "") -> Nameplates:
    """Return the nameplates of a scenario's inverters, in the order of a record's columns.

    With a case, those without an agent in it are left out, as the sharing indices do.
    """
    from gridpeers.scenarios.schema.participants import inverters_of, without_agent

    nameplates = Nameplates.of(inverters_of(spec, feeder))
    return nameplates.without(without_agent(spec, case)) if case else nameplates
