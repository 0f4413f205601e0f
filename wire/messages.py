"""The messages of a run. Frozen, validated, SI units on the wire.

The type of a field is its bounds (`wire.bounds`), and what a message says twice must agree (`__post_init__`). So
whatever has been decoded is safe to compute with, to print and to put into a key.

Every message carries its sender (`sender`), the epoch of that sender (`epoch`: the life of one process; see
`wire.admission`), a number (`seq`) and the run's time (`t`, s). In messages of the tick loop `seq` is the tick k and
`t` is k T_c.
"""

from __future__ import annotations

from math import inf
from typing import Annotated, Literal

import msgspec

from wire.bounds import (
    LATEST,
    MOST,
    Age,
    Count,
    Cycles,
    Data,
    Droop,
    Frequency,
    Label,
    Name,
    NameOrNone,
    Names,
    NominalFrequency,
    NominalVoltage,
    Power,
    QuickName,
    QuickNameOrNone,
    QuickNames,
    Rating,
    Reply,
    Shared,
    Text,
    Time,
    Tree,
    Voltage,
    check_names,
    check_tree,
)

PLANT = "plant"
"""Name under which the plant process sends."""

OFF = "off"
"""In place of an island's name: the inverter is off the network, or in an island that nothing feeds."""


def _once(what: str, names: tuple[str, ...]) -> None:
    if len(set(names)) != len(names):
        raise ValueError(f"{what}: a name stands there twice")


class Message(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What every message has."""

    sender: QuickName
    """Name of the inverter whose agent sent it, or `PLANT`."""
    epoch: Count
    """Epoch of the sender: the life of one process. Two are equal or not; which is greater says nothing."""
    seq: Count
    """Tick number k in the tick loop, roster number while a roster is prepared."""
    t: Time
    """Run time (s)."""

    def __post_init__(self) -> None:
        check_names(self.sender)


class Nameplate(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What an agent tells of itself once; the communication graph's rule is applied to these."""

    kind: Literal["GFM", "GFL"]
    """Grid-forming (a leader of the consensus) or grid-following (a follower)."""
    microgrid: Label
    """Name of the microgrid the inverter stands in."""
    P_rated: Rating
    """Rated real power s_i (W), base of every per-unit power of this inverter."""
    V_nom: NominalVoltage
    """Nominal terminal voltage (V, line-to-neutral RMS)."""
    f_nom: NominalFrequency
    """Nominal frequency (Hz)."""
    m_p: Droop
    """P-f droop (pu frequency per pu power; 0.01 = 1 %)."""
    m_q: Droop
    """Q-V droop (pu voltage per pu reactive power; 0.05 = 5 %)."""


class Measurement(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What an inverter's sensors read at tick k, and the grant to compute tick k (plant -> agent)."""

    to: QuickName
    """Inverter this measurement belongs to."""
    P: Power
    """Real power out of the inverter (W, three phases)."""
    Q: Power
    """Reactive power out of the inverter (var, three phases)."""
    V: Voltage
    """Terminal voltage (V, mean of the line-to-neutral RMS values)."""
    f: Frequency
    """Frequency (Hz): of the internal voltage of a GFM, of the PLL of a GFL."""
    P_set: Power
    """Real-power set-point the plant holds now (W)."""
    V_set: Voltage
    """Voltage set-point the plant holds now (V)."""
    grid_connected: bool
    """Whether a closed path leads to the substation: secondary control is then on hold."""
    island: QuickNameOrNone
    """Name of the island: "grid", or the first inverter in it; `OFF` if the inverter is out of service."""
    roster: QuickNames
    """Agents of this tick, in the order of the inverters. In wall-clock time those that the plant has heard of late."""

    def __post_init__(self) -> None:
        check_names(self.sender, self.to, self.island or self.to, *self.roster)
        _once("roster", self.roster)


class Angle(msgspec.Struct, frozen=True, forbid_unknown_fields=True, array_like=True):
    """The integral of an inverter's frequency: two that differ ever more are not in step."""

    cycles: Cycles
    """int (f - f_nom) dt."""
    since: Time
    """Run time whence it counts (s): it begins anew where measurements are missing."""


class State(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """What an agent decided at tick k: its set-points, heard by its neighbours and by the plant."""

    P_set: Power
    """Real-power set-point (W)."""
    V_set: Voltage
    """Voltage set-point (V)."""
    Q: Power
    """Reactive power measured at tick k (var)."""
    island: QuickNameOrNone = ""
    """Island the inverter stood in at that measurement: who stands in another one leaves this state out of its sums.
    Empty if it is not known."""
    angle: Angle | None = None
    """Where the inverter's angle stood at that measurement; sent only where islands are told apart by it."""
    idle: bool = False
    """Whether the agent stands still: paused, or without a measurement. In wall-clock time it then says nothing; in
    simulated time the tick waits for this state, which nobody uses."""
    shared: Shared = {}
    """What the law of the agent shares beside its set-points."""
    quiet: bool = False
    """Whether the law does not tell the neighbours: they keep what they heard last, the plant takes the set-points. In
    wall-clock time such a state goes to the plant alone, under a key of its own; in simulated time it keeps time."""
    skipped: Count = 0
    """Quiet states since the last that was not: no neighbour has missed those numbers. In wall-clock time only."""
    fault: Text = ""
    """What the law of the agent did that it must not; from then on the agent stands still."""

    def __post_init__(self) -> None:
        check_names(self.sender, self.island or self.sender)


class Prepare(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """The plant asks every agent of a roster to be ready to hear its neighbours (plant -> agents)."""

    roster: Names
    """Agents that will take part from the next tick on, in the order of the inverters."""
    instances: Names
    """Of each agent on the roster the instance that is meant: two processes may claim one name."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        _once("roster", self.roster)
        if len(self.instances) != len(self.roster):
            raise ValueError(f"instances: {len(self.instances)} for {len(self.roster)} names on the roster")


class Waiting(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """The plant is there, but not yet at t = 0; now and then until it is (plant -> agents, wall-clock time)."""

    waits_for: Names
    """Agents that have not come."""


class Ready(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """An agent hears all its in-neighbours of roster number `seq` (agent -> plant)."""


class Stop(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """The run is over and agents close; or, sent to one agent, it cannot take part or shall leave (plant -> agents)."""

    reason: Text
    """Why, for the log: "end of the scenario", or what went wrong."""
    refused: bool = False
    """Whether the agent never took part, as another has its name or no inverter has."""


class Leave(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """An agent leaves properly: the plant takes its inverter off the network (agent -> plant, wall-clock time)."""


class LinkReport(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What the emulated links into one receiver did of late (agent -> plant -> recorders)."""

    data: Data
    """A part of the receiver's book, for the record; no core looks into it."""
    instance: NameOrNone = ""
    """Which process of the sender's: it is told that its last part has come."""
    final: bool = False
    """Whether this is the last part: the sender closes once it is told."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        if self.final and not self.instance:
            raise ValueError("instance: the last part must say whom to tell that it has come")


class LinkRequest(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """A command to emulated links for messages sent at `t` or later; number 0 asks for status (plant -> agent)."""

    link_command: Tree
    """The command; empty for number 0."""
    reply_to: Name
    """Last part of the key under which the plant passes the `LinkAcknowledgement` on."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        check_tree(self.link_command)


class LinkAcknowledgement(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Links have taken the command of number `seq`, or report their status (agent -> plant -> command line)."""

    ok: bool
    """Whether it was done."""
    text: Text
    """The links that it changed, or why it was not done."""
    reply_to: Name
    """That of the `LinkRequest`."""
    data: Data = b""
    """The status of the links, to number 0; no core reads it."""


class Command(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """A command that a person gives the plant (command line -> plant, wall-clock time)."""

    verb: Literal["open", "close", "synchronise", "stop", "down", "status", "link", "links", "telemetry"]
    """Open or close a switch; close it if its sides are in step; have an agent leave; end the run; answer with its
    status; give emulated links a command; ask all of them for their status; publish telemetry again that a recorder has
    missed."""
    argument: Text = ""
    """Name of the switch or of the agent; number of the first Telemetry needed; empty for the others."""
    link_command: Tree = {}
    """The command to emulated links; empty for the others."""
    reply_to: Name
    """Unique id of the client: last part of the key of the `Answer`."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        check_tree(self.link_command)


class Answer(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """The result of a command; `seq` is the command's (plant -> command line)."""

    ok: bool
    """Whether it was done."""
    text: Reply
    """One sentence for a person; the answers to "status", "link", "links" are one JSON object each, that to "telemetry"
    is the number of the first Telemetry that comes again."""


class AgentStatus(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """How an agent fares (agent -> who watches, wall-clock time); `t` is its last measurement's."""

    phase: Literal["seeking", "waiting", "running"]
    """No plant is there; the plant is there but no fresh measurement; ticking."""
    waits_for: Text
    """What it waits for, for a person; empty while it runs."""
    island: NameOrNone
    """Island it stands in: "grid", the first inverter in it, or empty if that is not known."""
    neighbours: Names
    """Whom the run's rule tells it to listen to among those present."""
    ages: Annotated[tuple[Age, ...], msgspec.Meta(max_length=MOST)]
    """Of each neighbour the age of its last state (s of run time, on the own clock); -1 if none was heard."""
    used: Names
    """The neighbours in its sums now: heard, present, young enough and in the same island."""
    received: Count
    """Messages that came in and were used, since its start."""
    sent: Count
    """States sent since its start."""
    rejected: Count
    """Messages dropped since its start."""
    lost: Count
    """Messages that never came for use, since its start: by gaps in the numbers of who sent them, and by what emulated
    links dropped; not what a cut still keeps."""
    ticks: Count
    """Ticks done since its start."""
    missed: Count
    """Ticks skipped since its start, as their time was over."""
    lateness: Time
    """Longest delay of a tick behind its time since the last status (s of wall time)."""
    impaired: Names = ()
    """Senders between whom and this agent an emulated fault holds now."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        _once("neighbours", self.neighbours)
        if len(self.ages) != len(self.neighbours):
            raise ValueError(f"ages: {len(self.ages)} of {len(self.neighbours)} neighbours")


class PlantEvent(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Something that happened in the plant or to the roster, for `events.csv`."""

    t: Time
    """Run time (s)."""
    kind: Literal["switch", "island", "dead", "trip", "inverter", "limit", "roster", "link", "law", "warning"]
    """What sort of event."""
    subject: Label
    """The switch, island or agent concerned."""
    text: Text
    """One sentence for a person."""


class Pacing(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How well the plant keeps real time: delays of its steps behind their due times, in s of wall time."""

    steps: Count
    """Steps since the start."""
    late: Count
    """Steps more than one control period (of wall time) late."""
    p50: Time
    """Median delay (s)."""
    p95: Time
    """95 % of the steps were not later than this (s)."""
    p99: Time
    """99 % of the steps were not later than this (s)."""
    worst: Time
    """Longest delay (s)."""
    slipped: Time
    """By how much the schedule was put off in all, as it could not be caught up with (s)."""


VALUES = 6
"""Values of each inverter in a row of telemetry."""


class Telemetry(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """What the recorder writes: the plant's truth since the last telemetry (plant -> recorder)."""

    inverters: Names
    """Names of the inverters, the order of the columns."""
    rows: Annotated[tuple[tuple[float, ...], ...], msgspec.Meta(max_length=2000)]
    """Rows [t (s), then for each inverter f (Hz), P (W), Q (var), V (V), P_set (W), V_set (V)].

    P_set and V_set are those that were in force in the step that ended at t. Of t apart, a number may be infinite or
    none at all: the recorder is told the plant's truth.
    """
    events: Annotated[tuple[PlantEvent, ...], msgspec.Meta(max_length=1000)]
    """Events since the last telemetry."""
    final: bool
    """Whether this is the last one of the run."""
    outcome: Text
    """Empty while running and after a clean end; else why the run broke."""
    reproducible: bool
    """False once something unscripted (a dead agent) has entered the run; always false in wall-clock time."""
    pacing: Pacing | None = None
    """How well the plant keeps real time; only in wall-clock time."""
    awaited: Names = ()
    """Agents that the scenario lets join now: whoever runs the scenario starts them. Told once."""
    impaired: Names = ()
    """Agents between whom and the plant an emulated fault holds now; only in wall-clock time."""
    quiet: Annotated[tuple[tuple[Time, Count], ...], msgspec.Meta(max_length=2000)] = ()
    """Run time (s), and how many states of that tick the neighbours were not told of, as the laws had it."""
    others: Count = 0
    """Messages of other types on this key since the Telemetry before; only in wall-clock time. So a recorder knows
    whether it has got them all."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        _once("inverters", self.inverters)
        columns, before = 1 + VALUES * len(self.inverters), -inf
        for row in self.rows:
            if len(row) != columns:
                raise ValueError(
                    f"rows: one has {len(row)} values; t and those of {len(self.inverters)} inverters are {columns}"
                )
            if not (before < row[0] <= LATEST and row[0] >= 0.0):
                raise ValueError(f"rows: one of t = {row[0]:g} s comes after that of {before:g} s")
            before = row[0]


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
    | LinkRequest
    | LinkAcknowledgement
    | Command
    | Answer
    | AgentStatus
    | Telemetry
)
"""Everything that can arrive."""

MESSAGES = (
    Nameplate, Measurement, State, Prepare, Waiting, Ready, Stop, Leave, LinkReport, LinkRequest, LinkAcknowledgement,
    Command, Answer, AgentStatus, Telemetry,
)  # fmt: skip
"""The types of `AnyMessage`, for documentation that is made from the code."""
