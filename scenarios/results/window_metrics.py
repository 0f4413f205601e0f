"""The metrics of one event's window: the data that a metric gets, the metrics of gridpeers, and a scenario's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.results.event_windows import CaseRecord, Window
from gridpeers.scenarios.results.history import Flags, Floats, History, Nameplates, read_only
from gridpeers.scenarios.results.metric import Measured, make_metrics, measured
from gridpeers.scenarios.results.metrics import SHARING, Settling, Steady, measure, settling
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.participants import without_agent
from gridpeers.scenarios.schema.plugin_keys import metrics_of

if TYPE_CHECKING:
    import pandas as pd


LATE = 0.5  # Length (s) of the end of a window over which extremes are looked for


@dataclass(frozen=True, kw_only=True)
class WindowData(History):
    """Rows between an event and the next, as read-only arrays (rows, inverters), and the inverters that they are of."""

    case: str
    window: Window
    """Label of the event, its time and the end of its window (s)."""
    whole: History
    """All rows of the case, those before the event too."""
    nameplates: Nameplates
    """Nameplates, in the order of the columns: s (W), V_nom (V), m_p, m_q (pu), GFM, shares."""
    f_nom: float
    """Nominal frequency (Hz)."""
    T_c: float
    """Control period (s)."""
    messages_saved: float = 0.0
    """Share of states that the laws did not send in the window."""
    islands: Mapping[str, Steady] = field(default_factory=dict)
    """Steady values of each island at the end of the window, by its first inverter; empty where there is but one."""

    @classmethod
    def cut(cls, whole: History, window: Window, **about: Any) -> WindowData:
        inside = window.cut(whole)
        columns = {field.name: getattr(inside, field.name) for field in fields(History)}
        return read_only(cls(whole=whole, window=window, **columns, **about))

    @property
    def label(self) -> str:
        """Label of the event."""
        return self.window.label

    @property
    def start(self) -> float:
        """Time of the event (s)."""
        return self.window.start

    @property
    def end(self) -> float:
        """Time of the next event, or the end of the run (s)."""
        return self.window.end

    @cached_property
    def history(self) -> pd.DataFrame:
        """Rows of the window as a table: columns (inverter, quantity), index t (s); each metric has its own."""
        return self.frame()

    @property
    def late(self) -> Flags:
        """Which rows are of the last half second of the window."""
        rows: Flags = self.t >= self.end - LATE
        return rows

    @property
    def late_voltages(self) -> Floats:
        """Voltages (pu) of the inverters on the network in the last half second of the window, in one row."""
        on = self.present & self.late[:, None]
        voltages: Floats = (self.V / self.nameplates.V_nom)[on]
        return voltages

    @cached_property
    def steady(self) -> Steady:
        """Measures that every run has in metrics.json, with the reason of each that is no steady value."""
        return measure(self, self.nameplates, self.window, self.f_nom)

    @cached_property
    def settled(self) -> Settling:
        """Settling of frequency and sharing, and remaining swings."""
        return settling(self, self.nameplates, self.window, self.f_nom)


def _built_in(value: Callable[[WindowData], Any], text: str) -> Callable[[WindowData], Any]:
    """Return a metric of gridpeers with the sentence that `gridpeers doc metrics` prints."""

    def metric(window: WindowData) -> Any:
        return value(window)

    metric.__doc__ = text
    return metric


_STEADY = frozenset(each.name for each in fields(Steady))


def _measure(name: str, text: str) -> Callable[[WindowData], Any]:
    """Return the metric that is a field of `Steady` or of `Settling`; one of sharing is None over several islands."""

    def value(window: WindowData) -> Any:
        if name in SHARING and window.islands:
            return None
        return getattr(window.steady if name in _STEADY else window.settled, name)

    return _built_in(value, text)


f_error_Hz = _measure(
    "f_error_Hz", "abs(f - f_nom), mean over the grid-forming inverters, at the end of the window (Hz)."
)
MPSI = _measure("MPSI", "Mean power sharing index, (16), at the end of the window.")
V_error = _measure("V_error", "Mean of abs(V - 1) at the end of the window (pu).")
MQSI = _measure("MQSI", "Mean var sharing index, (17), at the end of the window.")
t_restore_s = _measure("t_restore_s", "Time until frequency and power sharing are restored for good (s).")
t_load_s = _measure("t_load_s", "Time until the inverters carry their steady load within 2 % for good (s).")
p = _measure("p", "Real power of each inverter at the end of the window (pu of its rating).")
t_f_s = _measure("t_f_s", "Time until the frequency is restored for good (s).")
t_share_s = _measure("t_share_s", "Time until power is shared equally for good (s).")
f_swing_Hz = _measure(
    "f_swing_Hz", "Highest minus lowest frequency of a grid-forming inverter at the end of the window (Hz)."
)
V_swing_pu = _measure("V_swing_pu", "Highest minus lowest voltage of an inverter at the end of the window (pu).")
messages_saved = _built_in(
    lambda window: window.messages_saved, "Share of states that the laws did not send to their neighbours."
)
f_off_Hz = _built_in(
    lambda window: np.abs(window.f[window.late][:, window.nameplates.GFM] - window.f_nom).max(),
    "Largest abs(f - f_nom) of a grid-forming inverter in the last half second of the window (Hz).",
)
S_max_pu = _built_in(
    lambda window: (np.hypot(window.P, window.Q) / window.nameplates.s)[window.late].max(),
    "Largest apparent power of an inverter in the last half second, per unit of its rated real power (pu).",
)
V_min_pu = _built_in(
    lambda window: window.late_voltages.min(), "Least voltage of an inverter in the last half second (pu)."
)
V_max_pu = _built_in(
    lambda window: window.late_voltages.max(), "Largest voltage of an inverter in the last half second (pu)."
)


def own_measures(
    scenario: ScenarioModel,
    feeder: Feeder,
    cases: Mapping[str, CaseRecord],
    islands: Mapping[str, Mapping[str, Mapping[str, Steady]]],
) -> dict[str, dict[str, Measured]]:
    """Return the values of the scenario's own metrics, by case and window; empty if it has none."""
    metrics = make_metrics(metrics_of(scenario))
    if not metrics:
        return {}
    values: dict[str, dict[str, Measured]] = {}
    for case, record in cases.items():
        whole = read_only(record.history)
        nameplates = Nameplates.of_columns(whole.inverters, feeder).without(without_agent(scenario, case))
        about = {
            "case": case,
            "nameplates": read_only(nameplates),
            "f_nom": feeder.f_nom,
            "T_c": scenario.time.T_c_s,
        }
        with np.errstate(all="ignore"):  # a value that is no number has its reason
            values[case] = {
                window.label: measured(
                    metrics,
                    WindowData.cut(
                        whole,
                        window,
                        messages_saved=record.messages_saved.get(window.label, 0.0),
                        islands=islands[case].get(window.label, {}),
                        **about,
                    ),
                )
                for window in record.windows
            }
    return values
