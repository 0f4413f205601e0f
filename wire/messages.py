"""The messages of a run. Frozen, validated, SI units on the wire.

Every message carries who sent it (`sender`), which life of that sender (`incarnation`: a restarted
agent has a higher one than its ghost), a number (`seq`) and the run's time (`t`, s). In messages of
the tick loop `seq` is the tick k and `t` is k T_c.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

PLANT = "plant"
"""Name under which the plant process sends."""

Name = Annotated[str, msgspec.Meta(max_length=64)]
"""A name on the wire: never longer than 64 characters."""

Words = Annotated[str, msgspec.Meta(max_length=4000)]
"""An order to links, as text that no core reads."""

Number = Annotated[float, msgspec.Meta(ge=-1e300, le=1e300)]
"""A finite number: NaN and the infinities fail these bounds, and the message with them."""

Count = Annotated[int, msgspec.Meta(ge=0)]
"""A tick, a sequence number, an incarnation: never negative."""


class Message(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What every message has."""

    sender: Name
    """Name of the inverter whose agent sent it, or `PLANT`."""
    incarnation: Count
    """Which life of the sender: greater after every restart."""
    seq: Count
    """Tick number k in the tick loop, roster number while a roster is prepared."""
    t: Number
    """Run time (s)."""


class Nameplate(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What an agent tells of itself once; the communication graph's rule is applied to these."""

    kind: Literal["GFM", "GFL"]
    """Grid-forming (a leader of the consensus) or grid-following (a follower)."""
    microgrid: Name
    """Name of the microgrid the inverter stands in."""
    P_rated: Number
    """Rated real power s_i (W), base of every per-unit power of this inverter."""
    V_nom: Number
    """Nominal terminal voltage (V, line-to-neutral RMS)."""
    f_nom: Number
    """Nominal frequency (Hz)."""
    m_p: Number
    """P-f droop (pu frequency per pu power; 0.01 = 1 %)."""
    m_q: Number
    """Q-V droop (pu voltage per pu reactive power; 0.05 = 5 %)."""


class Measurement(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What an inverter's sensors read at tick k, and the grant to compute tick k (plant -> agent)."""

    to: Name
    """Inverter this measurement belongs to."""
    P: Number
    """Real power out of the inverter (W, three phases)."""
    Q: Number
    """Reactive power out of the inverter (var, three phases)."""
    V: Number
    """Terminal voltage (V, mean of the line-to-neutral RMS values)."""
    f: Number
    """Frequency (Hz): of the internal voltage of a GFM, of the PLL of a GFL."""
    P_set: Number
    """Real-power set-point the plant holds now (W)."""
    V_set: Number
    """Voltage set-point the plant holds now (V)."""
    grid_connected: bool
    """Whether a closed path leads to the substation: secondary control is then on hold."""
    island: Name
    """Name of the island: "grid", or the first inverter in it."""
    roster: tuple[Name, ...]
    """Agents of this tick, in the order of the inverters. In wall-clock time those that the plant has heard of late."""


class Angle(msgspec.Struct, frozen=True, forbid_unknown_fields=True, array_like=True):
    """The integral of an inverter's frequency: two that differ ever more are not in step."""

    cycles: Number
    """int (f - f_nom) dt."""
    since: Number
    """Run time whence it counts (s): it begins anew where measurements are missing."""


class State(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """What an agent decided at tick k: its set-points, heard by its neighbours and by the plant."""

    P_set: Number
    """Real-power set-point (W)."""
    V_set: Number
    """Voltage set-point (V)."""
    Q: Number
    """Reactive power measured at tick k (var)."""
    island: Name = ""
    """Island the inverter stood in at that measurement: who stands in another one leaves this state out of its sums.
    Empty if it is not known."""
    angle: Angle | None = None
    """Where the inverter's angle stood at that measurement; sent only where islands are told apart by it."""


class Prepare(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """The plant asks every agent of a roster to be ready to hear its neighbours (plant -> agents)."""

    roster: tuple[Name, ...]
    """Agents that will take part from the next tick on, in the order of the inverters."""
    instances: tuple[Name, ...]
    """Of each agent on the roster the instance that is meant: two processes may claim one name."""


class Waiting(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """The plant is there, but not yet at t = 0; now and then until it is (plant -> agents, wall-clock time)."""

    waits_for: tuple[Name, ...]
    """Agents that have not come."""


class Ready(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """An agent hears all its in-neighbours of roster number `seq` (agent -> plant)."""


class Stop(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """The run is over and agents close; or, sent to one agent, it cannot take part or shall leave (plant -> agents)."""

    reason: str
    """Why, for the log: "end of the scenario", or what went wrong."""
    refused: bool = False
    """Whether the agent never took part, as another has its name or no inverter has."""


class Leave(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """An agent leaves properly: the plant takes its inverter off the network (agent -> plant, wall-clock time)."""


class LinkReport(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What the emulated links into one receiver did of late (agent -> plant -> recorders)."""

    data: bytes
    """A part of the receiver's book, for the record; no core looks into it."""
    instance: Name = ""
    """Which process of the sender's: it is told that its last part has come."""
    final: bool = False
    """Whether this is the last part: the sender closes once it is told."""


class LinkOrder(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What emulated links shall do to messages sent at `t` or later; number 0 asks how they stand (plant -> agent)."""

    text: Words
    """What a person ordered, for the agent's links."""
    reply_to: Name
    """Who wants to know: last part of the key under which the plant passes the `LinkAnswer` on."""


class LinkAnswer(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Links have taken the order of number `seq`, or stand as asked (agent -> plant -> command line)."""

    ok: bool
    """Whether it was done."""
    text: str
    """Which links it concerned, or why it was not done."""
    reply_to: Name
    """Of the order."""
    data: bytes = b""
    """How the links stand, to number 0; no core looks into it."""


class Command(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """A person wants something of the plant (command line -> plant, wall-clock time)."""

    verb: Literal["open", "close", "stop", "down", "status", "link", "links"]
    """Open or close a switch; have an agent leave; end the run; tell how it stands; order emulated links to do
    something; ask all of them how they stand."""
    argument: Words = ""
    """Name of the switch or of the agent; the order; empty for the others."""
    reply_to: Name
    """Unique id of who asks: last part of the key of the `Answer`."""


class Answer(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What became of a command; `seq` is the command's (plant -> command line)."""

    ok: bool
    """Whether it was done."""
    text: str
    """One sentence for a person; the answers to "status", "link", "links" are one JSON object each."""


class AgentStatus(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """How an agent fares (agent -> who watches, wall-clock time); `t` is its last measurement's."""

    phase: Literal["seeking", "waiting", "running"]
    """No plant is there; the plant is there but no fresh measurement; ticking."""
    waits_for: str
    """What it waits for, for a person; empty while it runs."""
    island: Name
    """Island it stands in: "grid", the first inverter in it, or empty if that is not known."""
    neighbours: tuple[Name, ...]
    """Whom the run's rule tells it to listen to among those present."""
    ages: tuple[Number, ...]
    """Of each neighbour the age of its last state (s of run time, on the own clock); -1 if none was heard."""
    used: tuple[Name, ...]
    """The neighbours in its sums now: heard, present, young enough and in the same island."""
    received: Count
    """Messages that came in and were used, since its start."""
    sent: Count
    """States sent since its start."""
    rejected: Count
    """Messages dropped since its start."""
    lost: Count
    """Messages that never came, by gaps in the numbers of who sent them, since its start."""
    ticks: Count
    """Ticks done since its start."""
    missed: Count
    """Ticks skipped since its start, as their time was over."""
    lateness: Number
    """Longest delay of a tick behind its time since the last status (s of wall time)."""
    impaired: tuple[Name, ...] = ()
    """Senders between whom and this agent an emulated fault holds now."""


class PlantEvent(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Something that happened in the plant or to the roster, for `events.csv`."""

    t: float
    """Run time (s)."""
    kind: Literal["switch", "island", "dead", "inverter", "limit", "roster", "link", "warning"]
    """What sort of event."""
    subject: str
    """The switch, island or agent concerned."""
    text: str
    """One sentence for a person."""


class Pacing(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How well the plant keeps real time: delays of its steps behind their due times, in s of wall time."""

    steps: Count
    """Steps since the start."""
    late: Count
    """Steps more than one control period (of wall time) late."""
    p50: Number
    """Median delay (s)."""
    p95: Number
    """95 % of the steps were not later than this (s)."""
    p99: Number
    """99 % of the steps were not later than this (s)."""
    worst: Number
    """Longest delay (s)."""
    slipped: Number
    """By how much the schedule was put off in all, as it could not be caught up with (s)."""


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
    """False once something unscripted (a dead agent) has entered the run; always false in wall-clock time."""
    pacing: Pacing | None = None
    """How well the plant keeps real time; only in wall-clock time."""
    awaited: tuple[Name, ...] = ()
    """Agents that the scenario lets join now: whoever runs the scenario starts them. Told once."""
    impaired: tuple[Name, ...] = ()
    """Agents between whom and the plant an emulated fault holds now; only in wall-clock time."""


AnyMessage = (
    Nameplate
    | Measurement
    | State
    | Prepare
    | Waiting
    | Ready
    | Stop
    | Leave
    | LinkReport
    | LinkOrder
    | LinkAnswer
    | Command
    | Answer
    | AgentStatus
    | Telemetry
)
"""Everything that can arrive."""

MESSAGES = (
    Nameplate, Measurement, State, Prepare, Waiting, Ready, Stop, Leave, LinkReport, LinkOrder, LinkAnswer, Command,
    Answer, AgentStatus, Telemetry,
)  # fmt: skip
"""The types of `AnyMessage`, for documentation that is made from the code."""
