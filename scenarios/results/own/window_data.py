"""What a metric is given: one event's window of one case, as arrays and as a pandas table."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from scenarios.results.history import Floats, History, Plates, read_only
from scenarios.results.metrics import Steady, Window, between, measure
from scenarios.results.settling import Settling, settling

if TYPE_CHECKING:
    import pandas as pd

QUANTITIES = ("f", "P", "Q", "V", "P_set", "V_set")
"""Quantities of an inverter, as in `History`: Hz, W, var, V, W, V."""


@dataclass(frozen=True, kw_only=True)
class WindowData:
    """Rows between an event and the next, and the inverters that they are of."""

    case: str
    """Name of the case."""
    window: Window
    """Label of the event, its time and the end of its window (s)."""
    whole: History
    """All rows of the case, those before the event too."""
    plates: Plates
    """Nameplates, in the order of the columns: s (W), V_nom (V), m_p, m_q (pu), GFM, shares."""
    f_nom: float
    """Nominal frequency (Hz)."""
    T_c: float
    """Control period (s)."""
    messages_saved: float = 0.0
    """Share of states that the laws did not tell in the window."""

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

    @property
    def inverters(self) -> tuple[str, ...]:
        """Names of the inverters, the order of all columns."""
        return self.whole.inverters

    @cached_property
    def record(self) -> History:
        """Rows of the window alone, as arrays (rows, inverters)."""
        inside = between(self.whole.t, self.window)
        columns = {field.name: getattr(self.whole, field.name)[inside] for field in fields(History)[1:]}
        return read_only(replace(self.whole, **columns))

    @property
    def t(self) -> Floats:
        """Time of the rows (s)."""
        return self.record.t

    @property
    def f(self) -> Floats:
        """Frequency (Hz), rows by inverters."""
        return self.record.f

    @property
    def P(self) -> Floats:
        """Real power (W)."""
        return self.record.P

    @property
    def Q(self) -> Floats:
        """Reactive power (var)."""
        return self.record.Q

    @property
    def V(self) -> Floats:
        """Terminal voltage (V)."""
        return self.record.V

    @property
    def P_set(self) -> Floats:
        """Set-point of real power (W)."""
        return self.record.P_set

    @property
    def V_set(self) -> Floats:
        """Set-point of voltage (V)."""
        return self.record.V_set

    @cached_property
    def history(self) -> pd.DataFrame:
        """Rows of the window as a table: columns (inverter, quantity), index t (s); each metric has its own."""
        import pandas as pd  # takes longer to import than a case to run

        values = np.stack([getattr(self.record, name) for name in QUANTITIES], axis=2).reshape(len(self.t), -1)
        columns = pd.MultiIndex.from_product([self.inverters, QUANTITIES], names=["inverter", "quantity"])
        return pd.DataFrame(values, index=pd.Index(self.t, name="t"), columns=columns)

    @cached_property
    def steady(self) -> Steady:
        """Measures that every run has in metrics.json, with the reason of each that is no steady value."""
        return measure(self.whole, self.plates, self.window, self.f_nom)

    @cached_property
    def settled(self) -> Settling:
        """How frequency and sharing settled, and what still swings."""
        return settling(self.whole, self.plates, self.window, self.f_nom)
