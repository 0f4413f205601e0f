"""The metrics of one event's window: the data that a metric gets, the metrics of gridpeers, and a scenario's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from plant.equipment import Feeder
from scenarios.results.history import Floats, History, Nameplates, read_only
from scenarios.results.metrics import Steady, Window, between, measure
from scenarios.results.own.metric import Measured, make_metrics, measured
from scenarios.results.settling import Settling, settling
from scenarios.schema import ScenarioModel
from scenarios.schema.own_modules import metrics_of
from scenarios.schema.participants import without_agent

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True)
class WindowData:
    """Rows between an event and the next, and the inverters that they are of."""

    case: str
    """Name of the case."""
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
        return self.record.frame()

    @cached_property
    def steady(self) -> Steady:
        """Measures that every run has in metrics.json, with the reason of each that is no steady value."""
        return measure(self.whole, self.nameplates, self.window, self.f_nom)

    @cached_property
    def settled(self) -> Settling:
        """How frequency and sharing settled, and what still swings."""
        return settling(self.whole, self.nameplates, self.window, self.f_nom)


def f_error_Hz(window: WindowData) -> float:
    """abs(f - f_nom), mean over the grid-forming inverters, at the end of the window (Hz)."""
    return window.steady.f_error_Hz


def MPSI(window: WindowData) -> float:
    """Mean power sharing index, (16), at the end of the window."""
    return window.steady.MPSI


def V_error(window: WindowData) -> float:
    """Mean of abs(V - 1) at the end of the window (pu)."""
    return window.steady.V_error


def MQSI(window: WindowData) -> float:
    """Mean var sharing index, (17), at the end of the window."""
    return window.steady.MQSI


def t_restore_s(window: WindowData) -> float | None:
    """Time until frequency and power sharing are restored for good (s)."""
    return window.steady.t_restore_s


def t_load_s(window: WindowData) -> float | None:
    """Time until the inverters carry their steady load within 2 % for good (s)."""
    return window.steady.t_load_s


def p(window: WindowData) -> dict[str, float]:
    """Real power of each inverter at the end of the window (pu of its rating)."""
    return window.steady.p


def t_f_s(window: WindowData) -> float | None:
    """Time until the frequency is restored for good (s)."""
    return window.settled.t_f_s


def t_share_s(window: WindowData) -> float | None:
    """Time until power is shared equally for good (s)."""
    return window.settled.t_share_s


def f_swing_Hz(window: WindowData) -> float:
    """Highest minus lowest frequency of a grid-forming inverter at the end of the window (Hz)."""
    return window.settled.f_swing_Hz


def V_swing_pu(window: WindowData) -> float:
    """Highest minus lowest voltage of an inverter at the end of the window (pu)."""
    return window.settled.V_swing_pu


def messages_saved(window: WindowData) -> float:
    """Share of states that the laws did not tell their neighbours."""
    return window.messages_saved


def own_measures(
    scenario: ScenarioModel,
    feeder: Feeder,
    nameplates: Nameplates,
    histories: Mapping[str, History],
    windows: Mapping[str, Sequence[Window]],
    saved: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
) -> dict[str, dict[str, Measured]]:
    """Return the values of the scenario's own metrics, by case and window; empty if it has none.

    Parameters
    ----------
    scenario, feeder : ScenarioModel, Feeder
        What was run.
    nameplates : Nameplates
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
        mine, whole = read_only(nameplates.without(without_agent(scenario, case))), read_only(history)
        with np.errstate(all="ignore"):  # what is no number is told as such
            found[case] = {
                window.label: measured(
                    metrics,
                    WindowData(
                        case=case,
                        window=window,
                        whole=whole,
                        nameplates=mine,
                        f_nom=feeder.f_nom,
                        T_c=scenario.time.T_c_s,
                        messages_saved=saved.get(case, {}).get(window.label, 0.0),
                    ),
                )
                for window in windows[case]
            }
    return found
