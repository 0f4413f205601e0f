"""The metrics of gridpeers, as anybody would write them."""

from __future__ import annotations

from scenarios.results.own.window_data import WindowData


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
