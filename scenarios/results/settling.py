"""How an event settles, for experiments on links: frequency and sharing apart, and whether anything still swings.

The report's "restored in" is both bands together (`scenarios.results.metrics`); theory predicts the two apart, and
bad links may slow one of them and not the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.results.history import Flags, Floats, History, Nameplates
from scenarios.results.metrics import MPSI, MPSI_BAND, Window, between, f_in_band, for_good

SWING = 2.0
"""Length of the end of a window over which a swing is measured (s), or half of the window if that is shorter. The
slowest swing that was met, of late links around a leader, has a period of 1.9 s."""


@dataclass(frozen=True, kw_only=True)
class Settling:
    """How one event of one case settled."""

    t_f_s: float | None
    """Time (s) from the event until abs(f - f_nom) < 0.01 Hz at every GFM for good; None if never."""
    t_share_s: float | None
    """Time (s) from the event until MPSI < 0.01 for good; None if never."""
    f_swing_Hz: float
    """Highest minus lowest frequency (Hz) of a GFM at the end of the window, the largest of all GFM."""
    V_swing_pu: float
    """Highest minus lowest terminal voltage (pu) of an inverter at the end of the window, the largest of all."""


def settling(history: History, nameplates: Nameplates, window: Window, f_nom: float) -> Settling:
    """Measure how one event of one case settled.

    Parameters
    ----------
    history : History
        The case as recorded.
    nameplates : Nameplates
        Nameplates in the order of its columns.
    window : Window
        The event's window, as for `scenarios.results.metrics.measure`.
    f_nom : float
        Nominal frequency (Hz).
    """
    inside = between(history.t, window)
    end = inside & (history.t >= window.end - min(SWING, 0.5 * (window.end - window.start)) - 1e-9)
    forming, f = history.present[:, nameplates.GFM], history.f[:, nameplates.GFM]
    shared: Flags = np.less(MPSI(history, nameplates)[inside], MPSI_BAND)
    return Settling(
        t_f_s=for_good(history.t[inside], f_in_band(history, nameplates, f_nom)[inside], window.start),
        t_share_s=for_good(history.t[inside], shared, window.start),
        f_swing_Hz=_swing(np.where(forming, f, np.nan)[end]),
        V_swing_pu=_swing(np.where(history.present, history.V / nameplates.V_nom, np.nan)[end]),
    )


def _swing(x: Floats) -> float:
    """Return the largest range of a column; who is off the network somewhere in it has none."""
    ranges = x.max(axis=0) - x.min(axis=0)
    return float(np.nanmax(ranges)) if np.isfinite(ranges).any() else np.nan
