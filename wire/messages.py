"""The messages of a run. Frozen, validated, SI units on the wire.

The type of a field contains its bounds, which are physical: as wide as a plant, an inverter or a run can be, and no
wider. The codec checks them while it decodes, and fields of one message must agree (`__post_init__`). So a decoded
message is safe to compute with, to print and to put into a key.

Every message has its sender (`sender`), the sender's epoch (`epoch`, which identifies one process; see
`gridpeers.wire.membership`), a number (`seq`) and the run time (`t`, s). In messages of the tick loop `seq` is the tick
k and `t` is k T_c.
"""

from __future__ import annotations

import re
from functools import lru_cache
from math import inf, isfinite
from typing import Annotated, Any, Literal, get_args

import msgspec

from gridpeers.wire.wording import UNPRINTABLE

LONGEST_MESSAGE = 256_000
"""Longest message in bytes: room for a row of telemetry on `MOST_INVERTERS` inverters with long names. All other
messages are a hundredth of it."""

NAME = r"[A-Za-z0-9_.-]{1,64}"
"""Allowed form of a name. Zenoh forbids / * $ ? # in a chunk of a key; a leading @ would hide it from wildcards."""

_PRINTABLE = rf"^[^{UNPRINTABLE}]*\Z"

Name = Annotated[str, msgspec.Meta(pattern=rf"^{NAME}\Z")]
"""Name of an inverter, process or run: 1 to 64 letters, digits, "_", "-" or "."; safe in keys, files and logs."""

NameOrNone = Annotated[str, msgspec.Meta(pattern=rf"^({NAME})?\Z")]
"""The same, or empty if there is none or it is not known."""

QuickName = Annotated[str, msgspec.Meta(max_length=64, extra={"pattern": rf"^{NAME}\Z"})]
"""A `Name`; all of a message are checked together, because a pattern for each would cost several times the rest of
decoding a state or a measurement."""

QuickNameOrNone = Annotated[str, msgspec.Meta(max_length=64, extra={"pattern": rf"^({NAME})?\Z"})]
"""The same, or empty."""

Label = Annotated[str, msgspec.Meta(max_length=200, pattern=_PRINTABLE)]
"""A label from a user's table: up to 200 printable characters."""

Text = Annotated[str, msgspec.Meta(max_length=4000, pattern=_PRINTABLE)]
"""A sentence for people: up to 4000 printable characters on one line."""

Data = Annotated[bytes, msgspec.Meta(max_length=LONGEST_MESSAGE)]
"""Bytes that no core reads."""

Tree = Annotated[dict[str, Any], msgspec.Meta(max_length=16)]
"""Maps, lists, texts, numbers, booleans and nil, such as a table of a scenario file; no core reads it, and `check_tree`
bounds it."""

TREE_DEPTH = 8  # Most levels of a tree
MOST_COUNT = 2**53 - 1  # Largest `Count`

Count = Annotated[int, msgspec.Meta(ge=0, le=MOST_COUNT)]
"""A tick, a sequence number, an epoch: never negative, and exact as a float too."""

LATEST = 1e9  # Largest `Time` (s)

Time = Annotated[float, msgspec.Meta(ge=0.0, le=LATEST)]
"""Run time or waiting time (s): up to 30 years."""

Age = Annotated[float, msgspec.Meta(ge=-1.0, le=LATEST)]
"""Age (s); -1 if there is none."""

Rating = Annotated[float, msgspec.Meta(gt=0.0, le=1e9)]
"""Rating (W): positive, at most a gigawatt."""

Power = Annotated[float, msgspec.Meta(ge=-1e11, le=1e11)]
"""Power (W or var): up to 100 times the largest rating, the widest bound of an agent's set-points."""

Factor = Annotated[float, msgspec.Meta(ge=0.0, le=1e3)]
"""Factor on a power: never negative, and up to a thousand."""

NominalVoltage = Annotated[float, msgspec.Meta(gt=0.0, le=1e5)]
"""Nominal voltage (V, line-to-neutral) of an inverter's terminals: at most 100 kV."""

Voltage = Annotated[float, msgspec.Meta(ge=0.0, le=1e6)]
"""Voltage (V, line-to-neutral RMS): up to 10 times the highest nominal voltage."""

NominalFrequency = Annotated[float, msgspec.Meta(ge=1.0, le=1000.0)]
"""Nominal frequency (Hz): 16.7, 50, 60 and 400 are in use."""

Frequency = Annotated[float, msgspec.Meta(ge=0.0, le=2000.0)]
"""Frequency (Hz): from standstill to twice the highest nominal frequency."""

Droop = Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]
"""Droop (pu per pu), positive; at 1, full power would take the whole frequency, or voltage."""

Cycles = Annotated[float, msgspec.Meta(ge=-2e12, le=2e12)]
"""Angle (cycles): the largest frequency error over the longest time."""

MOST_SHARED = 16  # Most values that a law may share beside its set-points
SHARED_LIMIT = 1e12  # Largest absolute value of a shared number

Shared = Annotated[
    dict[
        Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,31}\Z")],
        Annotated[float, msgspec.Meta(ge=-SHARED_LIMIT, le=SHARED_LIMIT)],
    ],
    msgspec.Meta(max_length=MOST_SHARED),
]
"""Values that a law shares, by names of its own choice."""

MOST_INVERTERS = 1000  # Most inverters in a run: one row of telemetry on more would not fit into a message

Names = Annotated[tuple[Name, ...], msgspec.Meta(max_length=MOST_INVERTERS)]
"""Names of inverters or processes."""

QuickNames = Annotated[tuple[QuickName, ...], msgspec.Meta(max_length=MOST_INVERTERS)]
"""The same, checked together."""

_PATTERN = re.compile(NAME)

_TEXT = re.compile(_PRINTABLE)


def is_name(text: str) -> bool:
    return _PATTERN.fullmatch(text) is not None


@lru_cache(maxsize=4096)
def check_names(*names: str) -> None:
    """Raise ValueError for a bad name; cached, because a sender's names are the same each time."""
    if not all(map(is_name, names)):
        raise ValueError(f"a name is not 1 to 64 letters, digits, _, - or .: {', '.join(map(ascii, names))[:100]}")


def check_tree(tree: Any, levels: int = TREE_DEPTH) -> None:
    """Check that a tree is finite, printable, and at most `TREE_DEPTH` levels deep."""
    if not levels:
        raise ValueError(f"more than {TREE_DEPTH} levels are in it")
    match tree:
        case dict() if all(isinstance(key, str) for key in tree):
            check_tree([*tree, *tree.values()], levels)
        case list() | tuple():
            for value in tree:
                check_tree(value, levels - 1)
        case None | int():
            pass
        case float() if isfinite(tree):
            pass
        case str() if len(tree) <= 4000 and _TEXT.match(tree):
            pass
        case _:
            raise ValueError(f"a value in it is no finite number, printable text, list or map: {ascii(tree)[:100]}")


PLANT = "plant"  # Name under which the plant process sends
OFF = "off"  # In place of an island's name: the inverter is off the network, or in a de-energised island


def _once(what: str, names: tuple[str, ...]) -> None:
    if len(set(names)) != len(names):
        raise ValueError(f"{what}: a name is in it twice")


class Message(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Fields of every message."""

    sender: QuickName
    """Name of the sending agent's inverter, or `PLANT`."""
    epoch: Count
    """Epoch of the sender, which identifies one process; epochs are compared only for equality."""
    seq: Count
    """Tick number k in the tick loop, roster number while a roster is prepared."""
    t: Time
    """Run time (s)."""

    def __post_init__(self) -> None:
        check_names(self.sender)


class Nameplate(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """An agent's description of its inverter, fixed for an epoch; the rule of the communication graph applies to it."""

    kind: Literal["GFM", "GFL"]
    """Grid-forming (a leader of the consensus) or grid-following (a follower)."""
    microgrid: Label
    """Name of the inverter's microgrid."""
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
    """Sensor readings of an inverter at tick k, and the grant to compute tick k (plant -> agent)."""

    to: QuickName
    """Inverter of this measurement."""
    P: Power
    """Real power out of the inverter (W, all its phases)."""
    Q: Power
    """Reactive power out of the inverter (var, all its phases)."""
    V: Voltage
    """Terminal voltage (V, mean of the line-to-neutral RMS values)."""
    f: Frequency
    """Frequency (Hz): of the internal voltage of a GFM, of the PLL of a GFL."""
    P_set: Power
    """Real-power set-point that the plant holds now (W)."""
    V_set: Voltage
    """Voltage set-point that the plant holds now (V)."""
    grid_connected: bool
    """Whether a closed path leads to the substation: secondary control is then on hold."""
    island: QuickNameOrNone
    """Name of the island: "grid", or the first inverter in it; `OFF` if the inverter is out of service."""
    roster: QuickNames | None = None
    """In real time the agents that the plant hears, in the order of the inverters. None in simulated time, where
    the agents of a tick are those of the last `Prepare`."""

    def __post_init__(self) -> None:
        check_names(self.sender, self.to, self.island or self.to)
        if self.roster is not None:
            check_names(*self.roster)
            _once("roster", self.roster)


class Angle(msgspec.Struct, frozen=True, forbid_unknown_fields=True, array_like=True):
    """Integral of an inverter's frequency error: two angles that drift apart prove two islands."""

    cycles: Cycles
    """int (f - f_nom) dt (cycles)."""
    since: Time
    """Run time (s) from which it counts; it restarts where measurements are missing."""


class State(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """An agent's decision at tick k: its set-points (agent -> plant and neighbours)."""

    P_set: Power
    """Real-power set-point (W)."""
    V_set: Voltage
    """Voltage set-point (V)."""
    Q: Power
    """Reactive power measured at tick k (var)."""
    island: QuickNameOrNone = ""
    """Island of the inverter at that measurement: agents in another island leave this state out of their sums.
    Empty if it is not known."""
    angle: Angle | None = None
    """Angle of the inverter at that measurement; only if agents detect islands by frequency."""
    idle: bool = False
    """Whether the agent is idle: paused, or without a measurement. In real time it then sends nothing; in
    simulated time the tick waits for this state, which no neighbour uses."""
    shared: Shared = {}
    """Further values that the agent's law shares."""
    quiet: bool = False
    """Whether the law sends nothing to the neighbours: they keep its last state, the plant takes the set-points. In
    real time such a state goes to the plant alone, under a key of its own; in simulated time it only grants the
    next tick."""
    skipped: Count = 0
    """Number of quiet states just before this one, which neighbours do not count as lost. In real time only."""
    fault: Text = ""
    """Failure of the agent's law; from then on the agent is idle."""

    def __post_init__(self) -> None:
        check_names(self.sender, self.island or self.sender)


class Prepare(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Request to every agent of a roster to get ready to hear its neighbours (plant -> agents)."""

    roster: Names
    """Agents that will take part from the next tick on, in the order of the inverters."""
    instances: Names
    """Instance of each agent on the roster: two processes may claim one name."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        _once("roster", self.roster)
        if len(self.instances) != len(self.roster):
            raise ValueError(f"instances: {len(self.instances)} for {len(self.roster)} names on the roster")


class Waiting(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Sign of life of a plant that waits: before t = 0, in simulated time between two ticks (plant -> agents)."""

    waits_for: Names
    """Missing agents; or the recorders that a plant in simulated time waits for."""


class Ready(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Notice that an agent hears all its in-neighbours of roster number `seq` (agent -> plant)."""


class Stop(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """End of the run, for all agents; to one agent: a refusal, or a request to leave (plant -> agents)."""

    reason: Text
    """Reason, for the log: "end of the scenario", or the failure."""
    refused: bool = False
    """Whether the agent never took part, because its name is taken or no inverter has it."""


class Leave(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Notice of a proper leave: the plant takes the inverter off the network (agent -> plant, real time)."""


class LinkReport(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Account of the emulated links into one receiver since its last report (agent -> plant -> recorders)."""

    data: Data
    """A part of the account, for the record; no core reads it."""
    instance: NameOrNone = ""
    """Instance of the sender, which gets an acknowledgement of its last part."""
    final: bool = False
    """Whether this is the last part: the sender closes once it is acknowledged."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        if self.final and not self.instance:
            raise ValueError("instance: the last part must name the instance that gets its acknowledgement")


class Journal(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """A part of the sender's journal (agent -> plant -> recorders; plant -> recorders). `seq` counts the parts."""

    data: Data
    """Entries, one after the other (`gridpeers.wire.journal`), for the record; no core reads them."""


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
    """Acknowledgement of link request `seq`, or the links' status (agent -> plant -> command line)."""

    ok: bool
    """Whether the links have applied it."""
    text: Text
    """The links that it changed, or the reason of a rejection."""
    reply_to: Name
    """`reply_to` of the `LinkRequest`."""
    data: Data = b""
    """The status of the links, to number 0; no core reads it."""


class LoadSetting(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A power that a person or a scenario gives a load: a factor, or real and reactive power; what is nil stays."""

    factor: Factor | None = None
    """Factor on the real and the reactive power of its table; the plant refuses an implausible one."""
    P: Power | None = None
    """Real power at nominal voltage (W)."""
    Q: Power | None = None
    """Reactive power at nominal voltage (var)."""


class Command(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """A command that a person gives the plant (command line -> plant, real time), or a recorder's question."""

    verb: Literal["open", "close", "synchronise", "load", "stop", "down", "status", "link", "links", "telemetry"]
    """Open or close a switch; close it if its sides are in step; set a load; let an agent leave; end the run; answer
    with its status; send emulated links a command; ask all of them for their status; publish telemetry again that a
    recorder has missed."""
    argument: Text = ""
    """Name of the switch, of the load or of the agent; number of the first Telemetry needed; empty for the others."""
    link_command: Tree = {}
    """The command to emulated links; empty for the others."""
    load: LoadSetting | None = None
    """The power of the load; nil for the others."""
    reply_to: Name
    """Unique id of the client: last part of the key of the `Answer`."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        check_tree(self.link_command)


class Answer(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """The result of a command; `seq` is the command's (plant -> command line)."""

    ok: bool
    """Whether the plant carried it out."""
    text: Text
    """One sentence for a person; to "telemetry" the number of the first Telemetry that comes again."""
    data: Tree = {}
    """To "status" the run's status; to "link" and "links" the number of the command, its start and its receivers."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        check_tree(self.data)


class AgentStatus(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Status of an agent (agent -> watchers, real time); `t` is its last measurement's."""

    phase: Literal["seeking", "waiting", "running"]
    """No plant found; plant found, but no fresh measurement; ticking."""
    waits_for: Text
    """Reason of the wait, for a person; empty while it runs."""
    island: NameOrNone
    """Its island: "grid", the first inverter in it, or empty if that is not known."""
    neighbours: Names
    """Its in-neighbours by the run's rule, among the present agents."""
    ages: Annotated[tuple[Age, ...], msgspec.Meta(max_length=MOST_INVERTERS)]
    """Age of each neighbour's last state (s of run time, on the own clock); -1 if none was heard."""
    used: Names
    """Neighbours in its sums now: heard, present, young enough and in the same island."""
    received: Count
    """Messages received and used, since its start."""
    sent: Count
    """States sent since its start."""
    rejected: Count
    """Messages dropped since its start."""
    lost: Count
    """Messages lost since its start: gaps in the senders' numbers, and drops of emulated links; not those that a cut
    still holds."""
    ticks: Count
    """Ticks done since its start."""
    missed: Count
    """Ticks skipped since its start, because their time was over."""
    lateness: Time
    """Longest delay of a tick behind its time since the last status (s of real time)."""
    impaired: Names = ()
    """Senders whose links to this agent have an emulated fault now."""

    def __post_init__(self) -> None:
        check_names(self.sender)
        _once("neighbours", self.neighbours)
        if len(self.ages) != len(self.neighbours):
            raise ValueError(f"ages: {len(self.ages)} of {len(self.neighbours)} neighbours")


class PlantEvent(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """An event of the plant or of the roster, for `events.csv`."""

    t: Time
    """Run time (s)."""
    kind: Literal[
        "switch", "island", "dead", "trip", "inverter", "limit", "load", "roster", "link", "law", "warning", "command"
    ]  # fmt: skip
    """Kind of the event; a command is one that a person gave to the run."""
    subject: Label
    """The switch, load, island or agent concerned."""
    text: Text
    """One sentence for a person."""
    closed: bool | None = None
    """Of a switch: whether it is closed from now on; None of other events, and in records of format 1."""
    P: Power | None = None
    """Of a load: its real power at nominal voltage from now on (W); None as `closed`."""
    Q: Power | None = None
    """Of a load: its reactive power at nominal voltage from now on (var)."""


class Pacing(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Delays of the plant's steps behind their due times (s of real time)."""

    steps: Count
    """Steps since the start."""
    late: Count
    """Steps more than one control period (of real time) late."""
    p50: Time
    """Median delay (s)."""
    p95: Time
    """95 % of the steps were not later than this (s)."""
    p99: Time
    """99 % of the steps were not later than this (s)."""
    worst: Time
    """Longest delay (s)."""
    slipped: Time
    """Total time (s) by which the schedule was postponed, because it could not be caught up with."""


VALUES = 6  # Number of values of each inverter in a row of telemetry


class Telemetry(Message, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Rows and events of the plant since the last telemetry, for the record (plant -> recorder)."""

    inverters: Names
    """Names of the inverters, the order of the columns."""
    rows: Annotated[tuple[tuple[float, ...], ...], msgspec.Meta(max_length=2000)]
    """Rows [t (s), then for each inverter f (Hz), P (W), Q (var), V (V), P_set (W), V_set (V)].

    P_set and V_set are those in force in the step that ended at t. Every number but t may be infinite or NaN: the
    record shows the plant as it is.
    """
    events: Annotated[tuple[PlantEvent, ...], msgspec.Meta(max_length=1000)]
    """Events since the last telemetry."""
    final: bool
    """Whether this is the last one of the run."""
    outcome: Text
    """Empty while running and after a clean end; else why the run broke."""
    reproducible: bool
    """False once something unscripted (a dead agent) has entered the run; always false in real time."""
    pacing: Pacing | None = None
    """Delays of the plant's steps; only in real time."""
    awaited: Names = ()
    """Agents that join now by the scenario: the process that runs the scenario starts them. Sent once."""
    impaired: Names = ()
    """Agents whose links to the plant have an emulated fault now; only in real time."""
    quiet: Annotated[tuple[tuple[Time, Count], ...], msgspec.Meta(max_length=2000)] = ()
    """Run time (s) of each tick, and its number of quiet states."""
    others: Count = 0
    """Messages of other types on this key since the last Telemetry: so a recorder knows whether it has them all."""

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
    Nameplate | Measurement | State | Prepare | Waiting | Ready | Stop | Leave | LinkReport | Journal | LinkRequest
    | LinkAcknowledgement | Command | Answer | AgentStatus | Telemetry
)  # fmt: skip
"""Every type of message."""

MESSAGES: tuple[type[Message], ...] = get_args(AnyMessage)
