"""A recorded case as arrays, with the nameplates of its inverters, and its windows, from each event to the next."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from hashlib import sha256
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.equipment import InverterRow, Tables
from gridpeers.scenarios.results.case_tables import QUANTITIES
from gridpeers.scenarios.schema.participants import with_agent
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.messages import PlantEvent

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Nameplates:
    """Nameplates of N inverters as arrays, in the order of the history's columns."""

    names: tuple[str, ...]
    GFM: NDArray[np.bool_]
    """Which are grid-forming."""
    s: Floats
    """Rated real power s_i (W)."""
    V_nom: Floats
    """Nominal terminal voltage (V, line-to-neutral RMS)."""
    m_p: Floats
    """P-f droop (pu per pu)."""
    m_q: Floats
    """Q-V droop (pu per pu)."""
    shares: Flags = field(default_factory=lambda: np.zeros(0, bool))
    """Which count in the sharing indices: those that have an agent. All, if left out."""

    def __post_init__(self) -> None:
        if not self.shares.size:
            object.__setattr__(self, "shares", np.ones(len(self.names), bool))

    def without(self, names: Collection[str]) -> Nameplates:
        return replace(self, shares=np.array([name not in names for name in self.names], bool)) if names else self

    @classmethod
    def of(cls, inverters: Sequence[InverterRow]) -> Nameplates:
        return cls(
            names=tuple(row.name for row in inverters),
            GFM=np.array([row.kind == "GFM" for row in inverters]),
            s=np.array([row.P_rated for row in inverters]),
            V_nom=np.array([row.V_nom for row in inverters]),
            m_p=np.array([row.m_p for row in inverters]),
            m_q=np.array([row.m_q for row in inverters]),
        )

    @classmethod
    def of_columns(cls, names: Sequence[str], feeder: Tables) -> Nameplates:
        """Take the nameplates of the columns of a history, spare inverters among them."""
        rows = {row.name: row for row in (*feeder.inverters, *feeder.spares)}
        return cls.of([rows[name] for name in names])


T = TypeVar("T", bound="Nameplates | History")

UNITS = {"t": "s", "f": "Hz", "P": "W", "Q": "var", "V": "V", "P_set": "W", "V_set": "V"}
"""Units of a history's time and quantities."""

_OF_INVERTERS = tuple(name for name in UNITS if name != "t")


@dataclass(frozen=True, kw_only=True)
class History:
    """One case: T rows of N inverters, terminal quantities as the plant reported them, in `UNITS`.

    Time has the shape (T,), all else (T, N).
    """

    inverters: tuple[str, ...]
    """Names, order of the columns."""
    t: Floats
    f: Floats
    P: Floats
    Q: Floats
    V: Floats
    P_set: Floats
    V_set: Floats

    @property
    def present(self) -> Flags:
        """Which inverters are on the network in each row, shape (T, N).

        The plant reports exactly no power of an inverter that is off it; of others P and Q are never both exactly 0.
        """
        on: Flags = (self.P != 0.0) | (self.Q != 0.0)
        return on

    def until(self, t: float) -> History:
        return self.rows(self.t <= t + 1e-9)

    def rows(self, which: Flags | slice) -> History:
        columns = {of.name: getattr(self, of.name)[which] for of in fields(self) if of.name != "inverters"}
        return replace(self, **columns)

    def frame(self) -> pd.DataFrame:
        """Return a table with columns (inverter, quantity) and the index t (s); `attrs["units"]` has the units."""
        import pandas as pd  # takes longer to import than a case to run

        columns = pd.MultiIndex.from_product([self.inverters, _OF_INVERTERS], names=["inverter", "quantity"])
        frame = pd.DataFrame(self.table[:, 1:], index=pd.Index(self.t, name="t"), columns=columns)
        frame.attrs["units"] = dict(UNITS)
        return frame

    @property
    def table(self) -> Floats:
        """All numbers, row by row, as `gridpeers.wire.messages.Telemetry.rows` has them; shape (T, 1 + 6 N)."""
        values = np.stack([getattr(self, name) for name in _OF_INVERTERS], axis=2)
        return np.column_stack((self.t, values.reshape(len(self.t), len(_OF_INVERTERS) * len(self.inverters))))

    @property
    def sha256(self) -> str:
        """Fingerprint of the rows, see `gridpeers.scenarios.results.record.canonical`."""
        return sha256(self.table.astype("<f8").tobytes()).hexdigest()

    @classmethod
    def of(cls, inverters: tuple[str, ...], rows: Sequence[Sequence[float]] | Floats | bytes | bytearray) -> History:
        """Return the arrays of rows, or of their canonical bytes; ValueError if one is too short or long."""
        columns = 1 + len(QUANTITIES) * len(inverters)
        if isinstance(rows, bytes | bytearray):  # the arrays are views of them: a history is in memory once
            table = np.frombuffer(rows, "<f8").reshape(-1, columns)
        else:
            table = np.asarray(rows, np.float64)
            if table.shape != (len(rows), columns):
                raise ValueError(f"the rows of a history have {table.shape[1:]} numbers instead of {columns}")
        values = table[:, 1:].reshape(len(table), len(inverters), len(QUANTITIES))
        f, P, Q, V, P_set, V_set = np.moveaxis(values, 2, 0)
        return cls(inverters=inverters, t=table[:, 0], f=f, P=P, Q=Q, V=V, P_set=P_set, V_set=V_set)


def read_only(of: T) -> T:
    """Return the same with arrays that cannot be written to: no metric may spoil what is measured after it."""
    views: dict[str, Any] = {}
    for item in fields(of):
        if isinstance(array := getattr(of, item.name), np.ndarray):
            views[item.name] = array.view()
            views[item.name].setflags(write=False)
    return replace(of, **views)


@dataclass(frozen=True, kw_only=True)
class Window:
    """Time that belongs to one event."""

    label: str
    start: float
    """Time of the event (s)."""
    end: float
    """Time of the next one, or the end of the run (s)."""

    def rows(self, t: Floats) -> Flags:
        """Return the rows after the event and before the next one; a run's last row belongs to its last window.

        Rows at the very moments of events are left out: they belong to both sides.
        """
        tolerance = 1e-9
        last = bool(t.size) and self.end >= t[-1] - tolerance
        rows: Flags = (t > self.start + tolerance) & (t < self.end + (tolerance if last else -tolerance))
        return rows

    def cut(self, history: History) -> History:
        return history.rows(self.rows(history.t))


def windows(scenario: ScenarioModel, recorded: Iterable[PlantEvent]) -> tuple[Window, ...]:
    """Return the window of each event: from the scenario's time, or that at which its last inverter moved, to the next.

    In real time a process takes its time to start, and inverters join later than the scenario says.
    """
    moved = [(event.t, event.subject) for event in recorded if event.kind == "inverter"]
    ends = [*(event.t_s for event in scenario.events), scenario.time.end_s][1:]
    starts = []
    for event, end in zip(scenario.events, ends, strict=True):
        names = {*event.leave, *event.join}
        times = [t for t, name in moved if name in names and event.t_s - 1e-9 <= t < end]
        starts.append(max(times, default=event.t_s))
    pairs = pairwise([*starts, scenario.time.end_s])
    return tuple(
        Window(label=event.label, start=start, end=end)
        for event, (start, end) in zip(scenario.events, pairs, strict=True)
    )


def late_moves(scenario: ScenarioModel, recorded: Iterable[PlantEvent]) -> list[str]:
    """Return sentences on events that came later than the scenario says, as processes, or people, took their time."""
    return [
        f"{event.label}, planned for t = {event.t_s:g} s, came at {came.start:g} s, when the last of its agents had "
        "moved; its window begins there"
        for event, came in zip(scenario.events, windows(scenario, recorded), strict=True)
        if came.start > event.t_s + 1e-9
    ]


def messages_saved(
    scenario: ScenarioModel, feeder: Tables, case: str, quiet: Sequence[tuple[float, int]], windows: Sequence[Window]
) -> dict[str, float]:
    """Return the share of states that the laws did not send, by window; nothing if they sent all."""
    if not quiet:
        return {}
    T_c, agents = scenario.time.T_c_s, len(with_agent(scenario, feeder, case))
    near = 0.5 * T_c
    saved = {}
    for window in windows:
        count = sum(n for t, n in quiet if window.start - near <= t < window.end - near)
        saved[window.label] = count / (agents * max(1, round((window.end - window.start) / T_c)))
    return saved
