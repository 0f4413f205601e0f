"""The messages of a run. Frozen, validated, SI units on the wire.

Every message carries who sent it (`sender`), which life of that sender (`incarnation`: a restarted
agent has a higher one than its ghost), a number (`seq`) and the run's time (`t`, s). In messages of
the tick loop `seq` is the tick k and `t` is k T_c.
"""

from __future__ import annotations

from typing import Literal

import msgspec

PLANT = "plant"
"""Name under which the plant process sends."""


class Message(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What every message has."""

    sender: str
    """Name of the inverter whose agent sent it, or `PLANT`."""
    incarnation: int
    """Which life of the sender: greater after every restart."""
    seq: int
    """Tick number k in the tick loop, roster number while a roster is prepared."""
    t: float
    """Run time (s)."""


class Nameplate(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What an agent tells of itself once; the communication graph's rule is applied to these."""

    kind: Literal["GFM", "GFL"]
    """Grid-forming (a leader of the consensus) or grid-following (a follower)."""
    microgrid: str
    """Name of the microgrid the inverter stands in."""
    P_rated: float
    """Rated real power s_i (W), base of every per-unit power of this inverter."""
    V_nom: float
    """Nominal terminal voltage (V, line-to-neutral RMS)."""
    f_nom: float
    """Nominal frequency (Hz)."""
    m_p: float
    """P-f droop (pu frequency per pu power; 0.01 = 1 %)."""
    m_q: float
    """Q-V droop (pu voltage per pu reactive power; 0.05 = 5 %)."""


class Measurement(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What an inverter's sensors read at tick k, and the grant to compute tick k (plant -> agent)."""

    to: str
    """Inverter this measurement belongs to."""
    P: float
    """Real power out of the inverter (W, three phases)."""
    Q: float
    """Reactive power out of the inverter (var, three phases)."""
    V: float
    """Terminal voltage (V, mean of the line-to-neutral RMS values)."""
    f: float
    """Frequency (Hz): of the internal voltage of a GFM, of the PLL of a GFL."""
    P_set: float
    """Real-power set-point the plant holds now (W)."""
    V_set: float
    """Voltage set-point the plant holds now (V)."""
    grid_connected: bool
    """Whether a closed path leads to the substation: secondary control is then on hold."""
    island: str
    """Name of the island: "grid", or the first inverter in it."""
    roster: tuple[str, ...]
    """Agents of this tick, in the order of the inverters. Empty in wall-clock time."""


class State(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What an agent decided at tick k: its set-points, heard by its neighbours and by the plant."""

    P_set: float
    """Real-power set-point (W)."""
    V_set: float
    """Voltage set-point (V)."""
    Q: float
    """Reactive power measured at tick k (var)."""


class Prepare(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """The plant asks every agent of a roster to be ready to hear its neighbours (plant -> agents)."""

    roster: tuple[str, ...]
    """Agents that will take part from the next tick on."""


class Ready(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """An agent hears all its in-neighbours of roster number `seq` (agent -> plant)."""


class Stop(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """The run is over; agents close (plant -> agents)."""

    reason: str
    """Why, for the log: "end of scenario", or what went wrong."""


class PlantEvent(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Something that happened in the plant or to the roster, for `events.csv`."""

    t: float
    """Run time (s)."""
    kind: Literal["switch", "island", "dead", "roster", "warning"]
    """What sort of event."""
    subject: str
    """The switch, island or agent concerned."""
    text: str
    """One sentence for a person."""


class Telemetry(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What the recorder writes: the plant's truth since the last telemetry (plant -> recorder)."""

    inverters: tuple[str, ...]
    """Names of the inverters, the order of the columns."""
    rows: tuple[tuple[float, ...], ...]
    """Rows [t (s), then for each inverter f (Hz), P (W), Q (var), V (V), P_set (W), V_set (V)].

    P_set and V_set are those that were in force in the step that ended at t.
    """
    events: tuple[PlantEvent, ...]
    """Events since the last telemetry."""
    final: bool
    """Whether this is the last one of the run."""
    outcome: str
    """Empty while running and after a clean end; else why the run broke."""
    reproducible: bool
    """False once something unscripted (a dead agent) has entered the run."""


AnyMessage = Nameplate | Measurement | State | Prepare | Ready | Stop | Telemetry
"""Everything that can arrive."""
