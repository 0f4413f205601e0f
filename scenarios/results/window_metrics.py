"""The metrics of one event's window: the data that a metric gets, and the metrics of gridpeers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gridpeers.scenarios.results.history import Flags, Floats, History, Nameplates, Window, read_only
from gridpeers.scenarios.results.metrics import SHARING, Settling, Steady, measure, settling

if TYPE_CHECKING:
    import pandas as pd


LATE = 0.5  # Length (s) of the end of a window over which extremes are looked for


@dataclass(frozen=True, kw_only=True)
class WindowData(History):
    """Rows from an event to the next one, as a metric gets them: read-only arrays of shape (rows, inverters)."""

    case: str
    window: Window
    whole: History
    """All rows of the case."""
    nameplates: Nameplates
    f_nom: float
    """Nominal frequency (Hz)."""
    T_c: float
    """Control period (s)."""
    messages_saved: float = 0.0
    """Share of states that the laws did not send in the window."""
    islands: Mapping[str, Steady] = field(default_factory=dict)
    """Steady values of each island at the end of the window, by its first inverter; empty for one island."""

    @classmethod
    def cut(cls, whole: History, window: Window, **about: Any) -> WindowData:
        inside = window.cut(whole)
        columns = {field.name: getattr(inside, field.name) for field in fields(History)}
        return read_only(cls(whole=whole, window=window, **columns, **about))

    @property
    def label(self) -> str:
        return self.window.label

    @property
    def start(self) -> float:
        return self.window.start

    @property
    def end(self) -> float:
        return self.window.end

    @cached_property
    def history(self) -> pd.DataFrame:
        """Rows of the window as a table: columns (inverter, quantity), index t (s); a copy for each metric."""
        return self.frame()

    @property
    def late(self) -> Flags:
        """Rows of the last half second of the window."""
        rows: Flags = self.t >= self.end - LATE
        return rows

    @property
    def late_voltages(self) -> Floats:
        """Voltages (pu) of the inverters on the network in the last half second of the window, as a flat array."""
        on = self.present & self.late[:, None]
        voltages: Floats = (self.V / self.nameplates.V_nom)[on]
        return voltages

    @cached_property
    def steady(self) -> Steady:
        return measure(self, self.nameplates, self.window, self.f_nom)

    @cached_property
    def settled(self) -> Settling:
        return settling(self, self.nameplates, self.window, self.f_nom)


def _measure(name: str, text: str) -> Callable[[WindowData], Any]:
    """Return the metric that is a field of `Steady` or of `Settling`; one of sharing is None over several islands."""

    def metric(window: WindowData) -> Any:
        if name in SHARING and window.islands:
            return None
        return getattr(window.steady if hasattr(window.steady, name) else window.settled, name)

    metric.__doc__ = text  # which `gridpeers doc metrics` prints
    return metric


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


def messages_saved(window: WindowData) -> float:
    """Share of states that the laws did not send to their neighbours."""
    return window.messages_saved


def f_off_Hz(window: WindowData) -> Any:
    """Largest abs(f - f_nom) of a grid-forming inverter in the last half second of the window (Hz)."""
    return np.abs(window.f[window.late][:, window.nameplates.GFM] - window.f_nom).max()


def S_max_pu(window: WindowData) -> Any:
    """Largest apparent power of an inverter in the last half second, per unit of its rated real power (pu)."""
    return (np.hypot(window.P, window.Q) / window.nameplates.s)[window.late].max()


def V_min_pu(window: WindowData) -> Any:
    """Least voltage of an inverter in the last half second (pu)."""
    return window.late_voltages.min()


def V_max_pu(window: WindowData) -> Any:
    """Largest voltage of an inverter in the last half second (pu)."""
    return window.late_voltages.max()
