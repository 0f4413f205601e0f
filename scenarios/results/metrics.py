"""The paper's measures of a run: abs(f - f_nom), MPSI (16), MQSI (17), V_error, times to restore, and swings.

Steady values are means over the last 0.2 s of an event's window, which lasts to the next event or to the end. Powers
enter per unit of each inverter's own rating (the paper writes kW in (9) and pu elsewhere). An inverter that is off the
network takes no part: each row is measured over those that are present in it.

A measure counts as steady when its mean over the last 0.2 s of the window differs from its mean over the 0.2 s before
by no more than one unit of the last digit that the paper prints: 0.01 Hz, 0.01 (MPSI, MQSI), 0.001 pu (V_error), and
0.01 pu for powers. Above 0.2, where the paper's MQSI has values up to 2, 5 % of MQSI do. Within the last 0.2 s it may
swing by five times as much: a ripple averages out, a limit cycle does not count. A window of less than 0.4 s is halved.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import NamedTuple

import numpy as np

from gridpeers.scenarios.results.history import Flags, Floats, History, Nameplates, Window
from gridpeers.scenarios.results.metric import DIGITS, UNITS, Measure
from gridpeers.scenarios.results.sharing_index import NO_LOAD, mean_over, sharing_index

F_BAND, MPSI_BAND = 0.01, 0.01  # Frequency (Hz) and MPSI below which a microgrid counts as restored
LOAD_BAND = 0.02  # Part of the steady total real power within which the load counts as taken over

SWING = 2.0
"""Length of the end of a window over which a swing is measured (s), or half of the window if that is shorter. The
slowest swing that was met, of late links around a leader, has a period of 1.9 s."""

STEADY = 0.2
"""Length of the end of a window over which steady values are means (s); 12 periods of 60 Hz, ten control periods."""

SWINGS = 5.0  # Factor by which a measure may swing more within `STEADY` than its mean may move
FEWEST = 2  # Rows that each of the two means needs at least
PART = 0.05  # Part of MQSI by which it may move, where that is more than a unit of its last digit


@dataclass(frozen=True, kw_only=True)
class Steady:
    """Steady values after one event."""

    f_error_Hz: float
    """abs(f - f_nom) (Hz), mean over the GFM."""
    MPSI: float
    V_error: float
    """Mean of abs(V_i - 1) (pu)."""
    MQSI: float
    t_restore_s: float | None
    """Time (s) from the event until abs(f - f_nom) < 0.01 Hz at every GFM and MPSI < 0.01 for good; None if never."""
    p: dict[str, float]
    """Real power of each inverter (pu of its rating); exactly 0 of one that is off the network."""
    t_load_s: float | None = None
    """Time (s) from the event until the inverters' total real power is within 2 % of its steady value for good: until
    those that remain carry the load of one that left. None if never, and where nothing is fed."""
    reasons: Mapping[str, str] = field(default_factory=dict)
    """Reason of each measure that is no steady value, by its name."""


@dataclass(frozen=True, kw_only=True)
class Settling:
    """Settling after one event: times of frequency and of sharing apart, as theory predicts them, and last swings."""

    t_f_s: float | None
    """Time (s) from the event until abs(f - f_nom) < 0.01 Hz at every GFM for good; None if never."""
    t_share_s: float | None
    """Time (s) from the event until MPSI < 0.01 for good; None if never."""
    f_swing_Hz: float
    """Highest minus lowest frequency (Hz) of a GFM at the end of the window, the largest of all GFM."""
    V_swing_pu: float
    """Highest minus lowest terminal voltage (pu) of an inverter at the end of the window, the largest of all."""


SHARING = ("MPSI", "MQSI", "t_restore_s", "t_share_s")
"""Measures of sharing. They mean nothing over several islands at once, as each island shares for itself."""

SHARING_OF_ISLANDS = tuple(each.name for each in fields(Steady) if each.name in SHARING)
"""Measures of sharing among the steady values: where there are several islands, each has its own."""


def mean_voltage(history: History, nameplates: Nameplates) -> Floats:
    """Return the mean terminal voltage of each row (pu)."""
    return mean_over(history.V / nameplates.V_nom, history.present)


def mean_frequency(history: History, nameplates: Nameplates) -> Floats:
    """Return frequency of each row (Hz): the mean over the GFM, which alone set it; a PLL's reading lags and rings."""
    return mean_over(history.f[:, nameplates.GFM], history.present[:, nameplates.GFM])


def f_in_band(history: History, nameplates: Nameplates, f_nom: float) -> Flags:
    """Return whether there is a GFM in a row, and each that is there is within `F_BAND` of f_nom (Hz)."""
    forming = history.present[:, nameplates.GFM]
    near = np.abs(history.f[:, nameplates.GFM] - f_nom) < F_BAND
    within: Flags = np.all(near | ~forming, axis=1) & np.any(forming, axis=1)
    return within


def MPSI(history: History, nameplates: Nameplates) -> Floats:
    """Return the mean power sharing index of each row, (16)."""
    return sharing_index(history.P, nameplates.s, nameplates.m_p, history.present & nameplates.shares)


def MQSI(history: History, nameplates: Nameplates) -> Floats:
    """Return the mean var sharing index of each row, (17)."""
    return sharing_index(history.Q, nameplates.s, nameplates.m_q, history.present & nameplates.shares)


def V_error(history: History, nameplates: Nameplates) -> Floats:
    """Return the mean of abs(V_i - 1) of each row (pu)."""
    return mean_over(np.abs(history.V / nameplates.V_nom - 1.0), history.present)


def measure(history: History, nameplates: Nameplates, window: Window, f_nom: float) -> Steady:
    assert nameplates.names == history.inverters
    assert window.rows(history.t).all()
    t, total = history.t, history.P.sum(axis=1)
    f_error = mean_over(np.abs(history.f[:, nameplates.GFM] - f_nom), history.present[:, nameplates.GFM])
    sharing, voltage, vars_ = MPSI(history, nameplates), V_error(history, nameplates), MQSI(history, nameplates)
    ends = ends_of(t, window.start, window.end)
    steady = ends.steady
    restored = f_in_band(history, nameplates, f_nom) & (sharing < MPSI_BAND)
    carried = np.abs(total - _mean(total[steady])) <= LOAD_BAND * abs(_mean(total[steady]))
    return Steady(
        f_error_Hz=_mean(f_error[steady]),
        MPSI=_mean(sharing[steady]),
        V_error=_mean(voltage[steady]),
        MQSI=_mean(vars_[steady]),
        t_restore_s=for_good(t, restored, window.start),
        p={name: _mean(history.P[steady, i] / nameplates.s[i]) for i, name in enumerate(nameplates.names)},
        t_load_s=for_good(t, carried, window.start) if total[steady].any() else None,
        reasons=_reasons(history, nameplates, ends, sharing, voltage, vars_),
    )


_NO_LOAD = f"nothing shared: the total is below {NO_LOAD:.1%} of the ratings"


def _reasons(
    history: History, nameplates: Nameplates, ends: Ends, sharing: Floats, voltage: Floats, vars_: Floats
) -> dict[str, str]:
    present, forming = history.present, nameplates.GFM
    sharing_now = present & nameplates.shares
    dead = "de-energised: no inverter is on the network"
    nobody = dead if nameplates.shares.all() else "nothing shared: no inverter with an agent is on the network"
    alone = nobody if not sharing_now[ends.steady].any(axis=1).all() else _NO_LOAD
    leaderless = "no grid-forming inverter is on the network" if forming.any() else "there is no grid-forming inverter"
    f, leaders = np.where(present, history.f, np.nan)[:, forming], tuple(np.array(nameplates.names)[forming])
    found = {
        "f_error_Hz": reason("f_error_Hz", f, ends, f"no leader: {leaderless}", leaders if len(leaders) > 1 else ()),
        "MPSI": reason("MPSI", sharing, ends, alone),
        "V_error": reason("V_error", voltage, ends, dead),
        "MQSI": reason("MQSI", vars_, ends, alone),
        "p": reason("p", history.P / nameplates.s, ends, dead, nameplates.names),
    }
    return {name: text for name, text in found.items() if text}


def _mean(x: Floats) -> float:
    return float(x.mean()) if x.size else float("nan")


def for_good(t: Floats, holds: Flags, start: float) -> float | None:
    """Return the time (s) from `start` to the first row from which on all rows hold; None if the last does not."""
    failing = np.flatnonzero(~holds)
    first = 0 if failing.size == 0 else int(failing[-1]) + 1
    return None if first >= t.size else round(float(t[first]) - start, 9)


def settling(history: History, nameplates: Nameplates, window: Window, f_nom: float) -> Settling:
    assert window.rows(history.t).all()
    end = history.t >= window.end - min(SWING, 0.5 * (window.end - window.start)) - 1e-9
    forming, f = history.present[:, nameplates.GFM], history.f[:, nameplates.GFM]
    shared: Flags = np.less(MPSI(history, nameplates), MPSI_BAND)
    return Settling(
        t_f_s=for_good(history.t, f_in_band(history, nameplates, f_nom), window.start),
        t_share_s=for_good(history.t, shared, window.start),
        f_swing_Hz=_swing(np.where(forming, f, np.nan)[end]),
        V_swing_pu=_swing(np.where(history.present, history.V / nameplates.V_nom, np.nan)[end]),
    )


def _swing(x: Floats) -> float:
    """Return the largest range of a column; an inverter that is off the network somewhere in it has none."""
    ranges = x.max(axis=0) - x.min(axis=0)
    return float(np.nanmax(ranges)) if np.isfinite(ranges).any() else np.nan


class Ends(NamedTuple):
    """Rows at the end of a window, and its limits (s)."""

    start: float
    end: float
    apart: float
    """Time (s) between the middles of the last two parts."""
    last: Flags
    before: Flags
    """Rows of the part before `last`."""
    steady: Flags
    """Rows over which steady values are means: the last `STEADY`."""


def ends_of(t: Floats, start: float, end: float) -> Ends:
    """Return the rows at the end of a window from start to end (s); t has the times (s) of its rows."""
    span = min(STEADY, 0.5 * (end - start))
    last = t >= end - span - 1e-9
    before = ~last & (t >= end - 2.0 * span - 1e-9)
    apart = float(t[last].mean() - t[before].mean()) if last.any() and before.any() else span
    return Ends(start, end, apart, last, before, t >= end - STEADY - 1e-9)


def reason(measure: Measure, x: Floats, ends: Ends, missing: str, names: tuple[str, ...] = ()) -> str:
    """Return why a measure has no steady value; "" where it has.

    Its rows x, shape (T,), or (T, M) for the inverters of these names, are not numbers where it has no value: `missing`
    says why, as "de-energised: no inverter is on the network".
    """
    if not ends.steady.any():
        return f"no samples: no row was recorded between {ends.start:g} s and {ends.end:g} s"
    columns = x.reshape(len(x), -1)
    valid = np.isfinite(columns[ends.steady]).any(axis=1)
    if not valid.all():
        return f"{missing} in a part of the last {STEADY:g} s" if valid.any() else missing
    if min(ends.last.sum(), ends.before.sum()) < FEWEST:
        rows = "1 row" if len(x) == 1 else f"{len(x)} rows"
        are = "is" if len(x) == 1 else "are"
        return f"not steady: {rows} ({ends.end - ends.start:.3g} s) {are} too few to tell"
    unit, reasons = UNITS[measure], []
    for i, column in enumerate(columns.T):
        recent, earlier = (part[np.isfinite(part)] for part in (column[ends.last], column[ends.before]))
        if not recent.size:
            continue
        of = f"{names[i]} " if names else ""
        part = PART * abs(float(recent.mean())) if measure == "MQSI" else 0.0
        allowed, swing = max(10.0 ** -DIGITS[measure], part), float(np.ptp(recent))
        change = float(recent.mean() - earlier.mean()) if earlier.size else 0.0
        if abs(change) * STEADY > allowed * ends.apart * (1.0 + 1e-9):
            per = f"{unit.strip() or '1'}/s"
            reasons.append((abs(change) / allowed, f"not steady: {of}still moves {change / ends.apart:+.2g} {per}"))
        elif swing > SWINGS * allowed:
            reasons.append((swing / allowed / SWINGS, f"not steady: {of}still swings by {swing:.2g}{unit}"))
    return max(reasons, default=(0.0, ""))[1]
