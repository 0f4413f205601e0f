"""A scenario file as types: keys, units, ranges and defaults.

A key that is a time, a voltage, a power or a frequency ends in its unit (`_s`, `_pu`, `_Hz`); `gridpeers doc scenario`
prints this file's sentences.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, Literal

import msgspec

from gridpeers.agents.agent_config import DegradedCommunication, Gains, Secondary
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.equipment.named_loads import FACTOR
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.inverters.inverter_model import Method
from gridpeers.plant.inverters.inverter_registry import OwnParameters, chosen, chosen_own
from gridpeers.plant.plant_config import OnLawFailure, Protection, SyncCheck
from gridpeers.plant.simulators import OURS, tables
from gridpeers.wire.journal import RecordLevel
from gridpeers.wire.schema.table_schema import (
    INHERITED,
    INLINE,
    ChosenBy,
    Divides,
    Example,
    MultipleOf,
    NamedTables,
    Plausible,
    Unit,
)

AS_RUN = "as_run"  # Table that a run adds to its copy of the scenario; it is skipped when the copy is read

PluginKey = str | dict[str, Any]
"""What is plugged in: a registered name or `module:Name`, or a table with it as `use`, and parameters."""

LawKey = str | dict[str, Any]
"""A control law: a registered name, `module:Class`, or a table with one of use, command, fmu, and parameters."""


LONGEST_RUN = 3600.0  # Longest run of a scenario (s)


class Time(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Table `[time]`: how long, and in which steps."""

    end_s: Annotated[
        float, Unit("s"), MultipleOf("T_c_s"), Plausible("the duration of a run", 0.001, LONGEST_RUN, above_zero=True)
    ]
    """Duration of the run (s), a multiple of T_c_s."""
    T_c_s: Annotated[float, Unit("s"), Plausible("a control period", 0.0005, 2.0, above_zero=True)] = 0.02
    """Control period (s): each agent decides once in it."""
    h_s: Annotated[
        float, Unit("s"), Divides("T_c_s"), Plausible("an integration step", 1e-5, 0.02, above_zero=True)
    ] = 0.002
    """Integration step of the plant (s); divides T_c_s."""
    method: Method = "first-order"
    """Time stepping of the plant: "first-order", as in GridLAB-D; or "second-order", which takes 2.5 times as long a
    step. With GFL as voltage sources, its error at 2 ms is a tenth of that of "first-order" at 0.25 ms."""
    record_s: Annotated[
        float,
        Unit("s"),
        MultipleOf("h_s"),
        Divides("T_c_s"),
        Plausible("the distance of recorded rows", 1e-5, 2.0, above_zero=True),
    ] = 0.01
    """Time between two rows of history.csv (s): a multiple of h_s that divides T_c_s."""


class InverterTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table `[plant.inverter.NAME]`: changes of one inverter of the feeder's table.

    The factors of `[plant]` do not apply to these values. The table also takes the keys of the inverter's kind,
    `[plant.gfm]` or `[plant.gfl]`; they override the published set and the table of the kind.
    """

    m_p_pu: Annotated[float | None, Unit("pu"), Plausible("a P-f droop", 0.001, 0.2)] = None
    """P-f droop (pu frequency per pu power)."""
    m_q_pu: Annotated[float | None, Unit("pu"), Plausible("a Q-V droop", 0.001, 0.5)] = None
    """Q-V droop (pu voltage per pu reactive power)."""
    P_rated_kW: Annotated[float | None, Unit("kW"), Plausible("a rating", 0.1, 1e6)] = None
    """Rated power (kW), the base of its per-unit values."""
    parameters: Annotated[str | None, Example('"regfm_a1"')] = None
    """Published set of parameters, "regfm_a1" or "regfm_a1_vflag0", in place of the one in inverters.csv; "": no
    set."""
    own: Annotated[OwnParameters, INLINE, ChosenBy("model", chosen_own)] = OwnParameters()
    """Parameters of its kind, in its table."""


class PlantTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Table `[plant]`: the feeder, its loads, and where the inverters start."""

    simulator: str = OURS
    """Simulator of the plant: "gridpeers"; "gridlabd", GridLAB-D in its delta mode; or "helics", a federate of a HELICS
    co-simulation (docs/how-to/cosimulation.md)."""
    feeder: str = "microgrid123"
    """Feeder: a name that comes with gridpeers, or the path of a folder of tables, relative to this file."""
    load_set: str = "main"
    """Load table of the feeder, e.g. "main" or "event2"."""
    P_set0_pu: Annotated[float, Unit("pu"), Plausible("a power set-point", 0.0, 1.2)] = 0.647
    """First P_set of every inverter (pu of its rating)."""
    V_set0_pu: Annotated[float, Unit("pu"), Plausible("a voltage set-point", 0.8, 1.2, above_zero=True)] = 1.0
    """First V_set of every inverter (pu of its nominal voltage)."""
    f_nom_Hz: Annotated[float | None, Unit("Hz"), Plausible("a nominal frequency", 16.0, 400.0)] = None
    """Nominal frequency (Hz); without it, the feeder's. At another frequency the equipment stays the same, and its
    reactances scale with the frequency (plant/data/README.md)."""
    load_factor: Annotated[float, Plausible("a factor on the loads", 0.0, 10.0)] = 1.0
    """Factor on all loads of the feeder, real and reactive power."""
    m_p_factor: Annotated[float, Plausible("a factor on droops", 0.01, 100.0)] = 1.0
    """Factor on the P-f droops of all inverters."""
    m_q_factor: Annotated[float, Plausible("a factor on droops", 0.01, 100.0)] = 1.0
    """Factor on the Q-V droops of all inverters."""
    inverter: dict[str, InverterTable] = {}
    """Tables `[plant.inverter.NAME]`: changes of single inverters of the feeder's table."""
    gfm: Annotated[GfmDroop, ChosenBy("model", partial(chosen, "GFM"))] = GfmDroop()
    """Table `[plant.gfm]`: parameters of the grid-forming inverters."""
    gfl: Annotated[Gfl, ChosenBy("model", partial(chosen, "GFL"))] = Gfl()
    """Table `[plant.gfl]`: parameters of the grid-following inverters."""
    simulators: Annotated[dict[str, msgspec.Struct], NamedTables(tables)] = {}
    """Tables `[plant.NAME]`: of simulators by their names, e.g. `[plant.helics]`."""
    sync_check: SyncCheck = SyncCheck()
    """Table `[plant.sync_check]`: how far two islands may be apart when an event joins them `synchronised`."""


class LoadChange(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """Change of a load in the table `load` of an `[[event]]`; all phases of the load change in proportion.

    Give a factor, or P_kW, Q_kvar or both; a power that is not given stays.
    """

    factor: Annotated[float | None, FACTOR] = None
    """Factor on the real and reactive power of the feeder's table; 1 restores them."""
    P_kW: Annotated[float | None, Unit("kW")] = None
    """Real power at nominal voltage (kW): from 0 to ten times all loads of the feeder."""
    Q_kvar: Annotated[float | None, Unit("kvar")] = None
    """Reactive power at nominal voltage (kvar), up to ten times all loads of the feeder."""


class Event(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An entry of `[[event]]`: changes at one time. It opens a window of measurement that lasts to the next event."""

    label: str
    """Name of the window in metrics.json, e.g. "event1"."""
    t_s: Annotated[float, Unit("s"), Plausible("the time of an event", 0.0, LONGEST_RUN, above_zero=True)]
    """Time (s): a multiple of h_s, or of T_c_s if agents leave or join; after 0 and before end_s."""
    open: Annotated[tuple[str, ...], Example('["13-152"]')] = ()
    """Switches to open, e.g. ["13-152"]."""
    close: Annotated[tuple[str, ...], Example('["13-152"]')] = ()
    """Switches to close."""
    synchronised: bool = False
    """true: a switch that would join two live islands waits until they are in step, within `[plant.sync_check]`;
    false: it joins them at once."""
    leave: Annotated[tuple[str, ...], Example('["inv2"]')] = ()
    """Inverters whose agents end, e.g. ["inv2"]; each takes its inverter off the network."""
    join: Annotated[tuple[str, ...], Example('["inv2"]')] = ()
    """Inverters whose agents start: those that left, and spare ones. Each starts without load."""
    P_max_kW: Annotated[dict[str, float], Example("{ inv2 = 275 }")] = {}
    """Available power of grid-following inverters from then on (kW), e.g. { inv2 = 275 }; at the start it is P_max_pu
    of `[plant.gfl]`."""
    load: Annotated[dict[str, LoadChange], Example("{ 48 = { factor = 1.5 } }")] = {}
    """Power of loads from then on, by the load's bus (its name in an imported feeder), e.g. { 48 = { factor = 1.5 },
    65 = { P_kW = 0, Q_kvar = 0 } }; in a live run `gridpeers load 48 --factor 1.5` does the same."""


class Case(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table `[case.NAME]`: one run of the experiment, under one rule of control."""

    title: str = ""
    """A few words for tables and plots."""
    expected_failures: Annotated[tuple[str, ...], Example('["frequency"]')] = ()
    """Checks that this case is built to fail, e.g. ["frequency", "var_sharing"] without secondary control. The
    summary of a run and `--require-checks` do not count them as failures."""
    secondary: Annotated[Secondary, Example('["inv1", "inv4"]')]
    """Inverters that run the secondary law (12)-(15): "none", "GFM", "all", or a list, e.g. ["inv1", "inv4"]. The other
    agents keep their first set-points, and still send them."""
    graph: PluginKey
    """Links between agents: "full", "none", "GFM-only", "clustered", "ring", "links" (the pairs in links), or a graph
    of your own, e.g. "mine:my_graph" or { use = "mine:MyGraph", k = 2 } (`gridpeers doc graphs`)."""
    links: Annotated[tuple[tuple[str, str], ...], Example('[["inv1", "inv4"]]')] = ()
    """Undirected links for the graph "links", e.g. [["inv1", "inv4"], ["inv4", "inv7"]]."""
    without: Annotated[tuple[tuple[str, str], ...], Example('[["inv1", "inv4"]]')] = ()
    """Undirected links to remove from the graph, e.g. [["inv4", "inv7"]]."""
    without_agent: Annotated[tuple[str, ...], Example('["inv2"]')] = ()
    """Inverters without an agent in this case, in addition to those without one in every case."""
    P_max_kW: Annotated[dict[str, dict[str, float]], Example("{ clouds = { inv2 = 225 } }")] = {}
    """Available power (kW) in this case only: the label of an event, and the values that replace its P_max_kW, e.g. {
    clouds = { inv2 = 225 } }."""
    law: LawKey = ""
    """Control law of this case only; without it, the key `law` at the top."""
    gains: Annotated[Gains, INHERITED] = Gains()
    """Table `[case.NAME.gains]`, for this case only; `[gains]` supplies the other keys."""
    degraded_communication: Annotated[DegradedCommunication, INHERITED] = DegradedCommunication()
    """Table `[case.NAME.degraded_communication]`, for this case only; `[degraded_communication]` supplies the other
    keys."""
    netem: Annotated[Netem, INLINE] = Netem()
    """Entries `[[case.NAME.link]]`, `[[case.NAME.partition]]`, `[[case.NAME.node]]`: of this case only."""


class Processes(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Table `[processes]`: connections between the processes of a run. It changes no result."""

    deadline_s: Annotated[float, Unit("s"), Plausible("a deadline", 0.1, 600.0, above_zero=True)] = 20.0
    """Longest wait for a message (s of real time); then the run ends and names the missing processes."""
    port: Annotated[int, Plausible("a port", 0, 65535)] = 0
    """TCP port of the plant on the loopback, where the processes meet; 0 takes a free one."""


NEEDS_KEYS = (
    'security = "mtls": give --keys DIR, the folder with the certificates; gridpeers keys init DIR makes it, and '
    "gridpeers keys issue NAME ... --keys DIR issues those of agents"
)
"""Error of a scenario that asks for certificates, where none were given."""


class ScenarioModel(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The keys outside any table come first in the file."""

    name: str = ""
    """Name of the run folder; without it, the name of the file."""
    title: str = ""
    """One line for `gridpeers list`."""
    paper: PluginKey = ""
    """Benchmark, the numbers and claims of a publication that judge the run: "islanding", "intermittency",
    "communication", "switching", "plug-n-play" and "wind-up" of the paper, or your own as "module:Name"; "": none."""
    seed: Annotated[int, Plausible("a seed", 0, 2**63 - 1)] = 1
    """Seed of all random draws: the fates of messages on links with faults."""
    security: Literal["none", "mtls"] = "none"
    """Links between processes: "mtls", mutual TLS, for which a run needs --keys DIR, a folder with certificates
    (docs/how-to/several-hosts.md); "none", open links unless --keys is given. A run in one process has no links."""
    record: RecordLevel = "all"
    """Contents of run.mcap of each case: "all"; "decisions", without the arrival times of messages; or "physics",
    without messages and decisions."""
    metrics: Annotated[tuple[PluginKey, ...], Example('["mine:Name"]')] = ()
    """Further metrics of every window, also your own: ["S_max_pu", "mine:nadir_Hz", { use = "mine:Within", band_Hz =
    0.05, name = "within_50mHz" }] (`gridpeers doc metrics`)."""
    claims: Annotated[tuple[PluginKey, ...], Example('["mine:Name"]')] = ()
    """Claims of your own that judge the run: ["mine:restored"] (`gridpeers doc claims`)."""
    checks: Annotated[tuple[PluginKey, ...], Example('["mine:Name"]')] = ()
    """Checks of your own, and other limits of the checks of every run: ["mine:Calm", { use = "frequency", within_s =
    1.0 }] (`gridpeers doc checks`)."""
    without_agent: Annotated[tuple[str, ...], Example('["inv2"]')] = ()
    """Inverters without an agent in every case, e.g. ["inv2"]. They stay on primary droop at their first set-points.
    Other agents do not know them, and the sharing indices leave them out."""
    time: Time
    """Table `[time]`."""
    plant: PlantTable = PlantTable()
    """Table `[plant]`."""
    protection: Protection = Protection()
    """Table `[protection]`: when inverters trip, and when they return."""
    law: LawKey = "consensus"
    """Control law of the agents: a name from `gridpeers doc laws`, or "mine:Mine" for the class Mine of mine.py beside
    this file. A table `[law]` takes one of use, command = ["./mylaw"] (a program) and fmu = "law.fmu". It also takes
    the parameters of the law, and time_limit_s, the longest time of one step."""
    on_law_failure: OnLawFailure = "droop"
    """Consequence of an error in a law, or in a graph of your own. "droop": the inverter of that agent stays on primary
    droop, and the check "law_failed" fails. "stop": the run ends at the error. Both fail the run."""
    gains: Gains = Gains()
    """Table `[gains]`: of the law "consensus", for every case."""
    degraded_communication: DegradedCommunication = DegradedCommunication()
    """Table `[degraded_communication]`: how agents treat bad links and saturation, for every case."""
    processes: Processes = Processes()
    """Table `[processes]`."""
    events: tuple[Event, ...] = msgspec.field(default=(), name="event")
    """Entries `[[event]]`, in the order of time."""
    netem: Annotated[Netem, INLINE] = Netem()
    """Entries `[[link]]`, `[[partition]]`, `[[node]]`: faults of links and agents, in every case."""
    cases: dict[str, Case] = msgspec.field(name="case")
    """Tables `[case.NAME]`, at least one."""
