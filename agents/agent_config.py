"""Configuration of one agent, and its nameplate by it: its own data and the run's rule, nothing about others. Pure."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec

from gridpeers.wire.codec import RejectedError, decode, encode
from gridpeers.wire.journal import RecordLevel
from gridpeers.wire.messages import SHARED_LIMIT, Nameplate
from gridpeers.wire.plugins.plugin import Plugin
from gridpeers.wire.schema.table_schema import NO_KEY, Below, Example, Plausible, Range, Unit
from gridpeers.wire.trust.credentials import Credentials

MAX_AGE = 0.25  # Age (s of run time) of a state or a measurement beyond which it is not used in real time


class Gains(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Gains and limits of the secondary law (12)-(15), per unit of own rating, w in pu."""

    k_p: Annotated[float, Unit("s", in_key=False), Plausible("gain k_p", 1e-7, 1e3, above_zero=True)] = 0.0007
    """P_set gain (s; pu frequency per (pu power / s)). kappa = m_p / k_p is the rate, 1/s."""
    k_q: Annotated[float, Unit("s", in_key=False), Plausible("gain k_q", 1e-5, 1e5, above_zero=True)] = 0.25
    """V_set gain (s; pu reactive droop per (pu voltage / s))."""
    alpha: Annotated[float, Plausible("gain alpha", 0.0, 1e4)] = 1.0
    """Weight of the voltage error in (15), GFM only."""
    beta_GFM: Annotated[float, Plausible("gain beta_GFM", 0.0, 1e4)] = 1.0
    """Weight of the var-sharing sum in (15)."""
    beta_GFL: Annotated[float, Plausible("gain beta_GFL", 0.0, 1e4)] = 1.0
    """Weight of the var-sharing sum of a GFL, (14). The paper has 1."""
    alpha_min: Annotated[float, Below("alpha", only_with="V_full"), Plausible("gain alpha_min", 0.0, 1e4)] = 0.0
    """Least weight of a small voltage error, with V_full_pu above 0; below alpha."""
    V_full: Annotated[float, Unit("pu"), Plausible("a voltage error", 0.0, 0.2)] = 0.0
    """Voltage error (pu) above which alpha counts in full. Below it, alpha falls in proportion, down to alpha_min. 0:
    always in full, as in the paper."""
    P_set_min: Annotated[float, Unit("pu"), Below("P_set_max"), Plausible("a limit of P_set", -1.2, 1.2)] = 0.0
    """Lower limit of P_set (pu), anti-windup."""
    P_set_max: Annotated[float, Unit("pu"), Plausible("a limit of P_set", -1.2, 2.0)] = 1.0
    """Upper limit of P_set (pu), anti-windup."""
    V_set_min: Annotated[
        float, Unit("pu"), Below("V_set_max"), Plausible("a limit of V_set", 0.5, 1.5, above_zero=True)
    ] = 0.9
    """Lower limit of V_set (pu), anti-windup."""
    V_set_max: Annotated[float, Unit("pu"), Plausible("a limit of V_set", 0.5, 1.5, above_zero=True)] = 1.1
    """Upper limit of V_set (pu), anti-windup."""


class DegradedCommunication(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How an agent handles late, lost and missing states, and its own saturation. The default is the paper's way.

    Equations, sources and costs are in docs/reference/link-faults.md.
    """

    stale: Literal["hold", "skip", "age-weighted"] = "hold"
    """Weight of a neighbour's state that is not new: 1 ("hold"), 0 ("skip"), or falling with its age beyond the usual
    age on the link ("age-weighted")."""
    T_age: Annotated[float, Unit("s"), Plausible("a time in which a state ages", 1e-3, 60.0, above_zero=True)] = 0.2
    """Time (s) in which the weight of an ageing state falls to 1/e, for "age-weighted"."""
    max_age: Annotated[float, Unit("s"), Plausible("the greatest age of a state", 0.0, 60.0)] = 0.0
    """Age (s) of a state beyond which it does not count. 0: no limit in simulated time, 0.25 s in real time."""
    weights: Literal["paper", "degree-normalised"] = "paper"
    """Weights c_ij of the neighbours: 1 ("paper"), or 1 over their number ("degree-normalised")."""
    kappa_c: Annotated[float, Unit("1/s"), Plausible("gain kappa_c", 1e-3, 1e4, above_zero=True)] = 12.0
    """Gain (1/s) of the consensus on m_p P_set, for "degree-normalised"; the leaders' gain stays m_p / k_p."""
    beta_c: Annotated[float, Plausible("factor beta_c", 0.0, 1e4)] = 8.0
    """Factor on beta_GFM and beta_GFL, for "degree-normalised"; the paper's is the number of neighbours."""
    anti_windup: Literal["clamp", "none", "conditional"] = "clamp"
    """Set-points of a saturated inverter: limited ("clamp"), free ("none", Remark 2 of the paper), or limited without
    further integration ("conditional")."""
    T_sat: Annotated[
        float, Unit("s"), Plausible("a time until an inverter counts as saturated", 1e-3, 60.0, above_zero=True)
    ] = 0.5
    """For "conditional": time (s) without progress towards its droop characteristic after which an inverter counts as
    saturated."""
    islands: Literal["switches", "frequency", "ignored"] = "switches"
    """Detection of neighbours in another island, which the sums leave out: by positions of switches ("switches"), by
    the drift of their angles ("frequency"), or none ("ignored"). An agent always knows if it is grid-connected."""
    slip_max: Annotated[
        float, Unit("cycles"), Plausible("the greatest slip within an island", 1e-4, 0.5, above_zero=True)
    ] = 0.01
    """For "frequency": drift (cycles) of a neighbour's angle above which it counts as in another island. Set it above
    the swings of angles within an island."""


Secondary = Literal["none", "GFM", "all"] | tuple[str, ...]
"""Which inverters run the secondary law: a rule, or their names."""

GraphRule = Literal["full", "none", "GFM-only", "clustered", "ring", "links"]
"""How nameplates become neighbours; "links" takes the listed pairs."""


class SharedQuantity(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A quantity that a law shares with its neighbours, beside set-points and vars; the record has it too."""

    name: Annotated[str, Example('"Omega"')]
    unit: str = ""
    low: Annotated[float, Below("high", or_equal=True)] = -SHARED_LIMIT
    """Lower end of its range, allowed: a neighbour's state beyond it is dropped, and the own law fails."""
    high: float = SHARED_LIMIT
    help: str = ""


class LawChoice(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The control law of an agent, and its carrier: a Python class, a program, or an FMU."""

    use: str = "consensus"
    """Registered name of a class, or `module:Class`; "consensus" is the paper's law."""
    command: Annotated[tuple[str, ...], Example('["./mylaw", "--fast"], the program first')] = ()
    """Program and arguments, in place of a class; one JSON line a tick on its standard input and output."""
    fmu: str = ""
    """Path of an FMU, in place of a class."""
    parameters: Annotated[dict[str, float | int | bool | str], NO_KEY] = {}
    """Parameters that do not keep their default."""
    shared: tuple[SharedQuantity, ...] = ()
    """Quantities that a program shares; a class declares them itself, as fields, and an FMU as outputs shared_NAME."""
    folder: str = ""
    """Folder of the module, the program or the FMU."""
    time_limit: Annotated[float, Unit("s"), Range(0.001, 60.0)] = 1.0
    """Longest time (s of real time) of one step; a law that takes longer has failed."""

    @property
    def name(self) -> str:
        """The law, for people."""
        return " ".join(self.command) or self.fmu or self.use


class Control(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The run's rule of control: the inverters that take part, and the communication graph.

    Case I: secondary "none". II: "GFM", graph "none". III: "GFM", graph "GFM-only".
    IV: "all", graph "full".
    """

    secondary: Secondary
    """Which inverters run the secondary law; the others keep their first set-points."""
    graph: str
    """Rule of the communication graph: a `GraphRule`, or the name of a plugged-in one."""
    own_graph: Plugin | None = None
    """A plugged-in rule."""
    links: tuple[tuple[str, str], ...] = ()
    """Undirected links for the rule "links"."""
    without: tuple[tuple[str, str], ...] = ()
    """Undirected links to remove from the rule's graph."""
    gains: Gains = Gains()
    """Gains of the law."""
    degraded_communication: DegradedCommunication = DegradedCommunication()
    """Options for degraded communication and saturation."""
    law: LawChoice = LawChoice()
    """Control law."""

    def acts(self, name: str, kind: str) -> bool:
        if isinstance(self.secondary, tuple):
            return name in self.secondary
        return self.secondary == "all" or (self.secondary == "GFM" and kind == "GFM")


class AgentConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Configuration of one agent process (JSON on its standard input)."""

    run: str
    """Name of the run, part of every key."""
    name: str
    """Name of the inverter, e.g. "inv1"."""
    kind: Literal["GFM", "GFL"]
    microgrid: str
    P_rated: float
    """W."""
    V_nom: float
    """V, line-to-neutral."""
    f_nom: float
    """Hz."""
    m_p: float
    """pu per pu."""
    m_q: float
    """pu per pu."""
    T_c: float
    """Control period (s)."""
    control: Control
    deadline: float
    """Longest wait for any message (s). Real time: for the plant's first sign of life; 0: no limit."""
    plant_wait: float = 0.0
    """Simulated time: longest wait (s) for the first sign of life of the plant, which may have to compile."""
    connect: tuple[str, ...]
    """Rendezvous endpoints, e.g. ("tcp/127.0.0.1:7447",)."""
    listen: tuple[str, ...] = ("tcp/127.0.0.1:0",)
    """Where other agents can connect; port 0 is any free one."""
    star: bool = False
    """Whether the plant relays all messages, in simulated time: the agents have one link each."""
    epoch: int = 1
    """Epoch of this process; see `gridpeers.wire.membership`."""
    clock: Literal["simulated", "realtime"] = "simulated"
    """Lock-step with the plant, or real time."""
    speed: float = 1.0
    """Real time: run time (s) per s, above 0."""
    clock_rate: float = 1.0
    """Rate of the agent's own clock: 1.0001 gains 100 ppm. Real time: the agent ticks that much more often; simulated:
    it takes a period for that much longer."""
    links: dict[str, Any] = {}
    """Emulated links to this agent: `gridpeers.scenarios.emulation.link_data`, as a tree: agents know no netem.
    Empty: none."""
    max_age: float = MAX_AGE
    """Age (s of run time) beyond which a measurement is not used; real time: nor a neighbour's state."""
    record: RecordLevel = "physics"
    """How much this process notes in its journal, which a recorder gets."""
    credentials: Credentials | None = None
    """Certificate of this process and members of its site; None: links are open."""
    inverters: tuple[str, ...] = ()
    """With certificates: names of all inverters of the feeder, whose agents may come later; else empty."""

    def by_own_clock(self) -> AgentConfig:
        """Return the configuration in simulated time, where a clock that is off makes the period seem longer."""
        return self if self.clock_rate == 1.0 else msgspec.structs.replace(self, T_c=self.T_c * self.clock_rate)


def nameplate_of(config: AgentConfig) -> Nameplate:
    return Nameplate(
        sender=config.name,
        epoch=config.epoch,
        seq=0,
        t=0.0,
        kind=config.kind,
        microgrid=config.microgrid,
        P_rated=config.P_rated,
        V_nom=config.V_nom,
        f_nom=config.f_nom,
        m_p=config.m_p,
        m_q=config.m_q,
    )


def check_nameplate(config: AgentConfig) -> None:
    """Raise ValueError if a value of an agent's nameplate is out of bounds, so that every receiver would reject it."""
    try:
        decode(encode(nameplate_of(config)))
    except RejectedError as rejected:
        raise ValueError(f"{config.name}: every participant would reject this nameplate: {rejected.text}") from None
