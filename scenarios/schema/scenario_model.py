"""A scenario file as types: what may be written, in which unit, and what holds when nothing is written.

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

AS_RUN = "as_run"
"""Table that a run adds to its copy of the scenario; it is skipped when the copy is read."""

PluginKey = str | dict[str, Any]
"""What is plugged in: a registered name or `module:Name`, or a table with it as `use`, and parameters."""

LawKey = str | dict[str, Any]
"""A control law: a registered name, `module:Class`, or a table with one of use, command, fmu, and parameters."""


LONGEST_RUN = 3600.0
"""Longest run of a scenario (s)."""


class Time(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Table `[time]`: how long, and in which steps."""

    end_s: Annotated[
        float,
        Unit("s"),
        MultipleOf("T_c_s"),
        Plausible("the duration of a run", 0.001, LONGEST_RUN, above_zero=True),
    ]
    """Duration of the run (s), a multiple of T_c_s."""
    T_c_s: Annotated[float, Unit("s"), Plausible("a control period", 0.0005, 2.0, above_zero=True)] = 0.02
    """Control period (s): each agent decides once in it."""
    h_s: Annotated[
        float,
        Unit("s"),
        Divides("T_c_s"),
        Plausible("an integration step", 1e-5, 0.02, above_zero=True),
    ] = 0.002
    """Integration step of the plant (s); divides T_c_s."""
    method: Method = "first-order"
    """Method of time stepping of the plant: "first-order", GridLAB-D's own; or "second-order", at 2 ms ten
    times as accurate as the other at 0.25 ms (with GFL as voltage sources), at 2.5 times its time a step."""
    record_s: Annotated[
        float,
        Unit("s"),
        MultipleOf("h_s"),
        Divides("T_c_s"),
        Plausible("the distance of recorded rows", 1e-5, 2.0, above_zero=True),
    ] = 0.01
    """Distance of the rows in history.csv (s): a multiple of h_s that divides T_c_s."""


class InverterTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table `[plant.inverter.NAME]`: changes of one inverter of the feeder's table.

    It is taken as it stands: the factors of `[plant]` do not act on it. Beside the keys below it takes those of the
    inverter's kind, `[plant.gfm]` or `[plant.gfl]`: they replace what its set and the table of its kind say.
    """

    m_p_pu: Annotated[float | None, Unit("pu"), Plausible("a P-f droop", 0.001, 0.2)] = None
    """P-f droop (pu frequency per pu power)."""
    m_q_pu: Annotated[float | None, Unit("pu"), Plausible("a Q-V droop", 0.001, 0.5)] = None
    """Q-V droop (pu voltage per pu reactive power)."""
    P_rated_kW: Annotated[float | None, Unit("kW"), Plausible("a rating", 0.1, 1e6)] = None
    """Rated power (kW), the base of its per-unit values."""
    parameters: Annotated[str | None, Example('"regfm_a1"')] = None
    """Name of a published set of parameters ("regfm_a1", "regfm_a1_vflag0"), in place of the one that inverters.csv
    names; "" is none."""
    own: Annotated[OwnParameters, INLINE, ChosenBy("model", chosen_own)] = OwnParameters()
    """Parameters of its kind, in its table."""


class PlantTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Table `[plant]`: the feeder, its loads, and where the inverters start."""

    simulator: str = OURS
    """Simulator of the plant: "gridpeers"; "gridlabd", GridLAB-D in its delta mode; or "helics", a federate of a HELICS
    co-simulation (docs/how-to/cosimulation.md)."""
    feeder: str = "microgrid123"
    """Name of a feeder that comes with gridpeers, or a path to a folder of the same layout, seen from this file."""
    load_set: str = "main"
    """Which load table of the feeder: "main" or "event2"."""
    P_set0_pu: Annotated[float, Unit("pu"), Plausible("a power set-point", 0.0, 1.2)] = 0.647
    """First P_set of every inverter (pu of its rating)."""
    V_set0_pu: Annotated[float, Unit("pu"), Plausible("a voltage set-point", 0.8, 1.2, above_zero=True)] = 1.0
    """First V_set of every inverter (pu of its nominal voltage)."""
    f_nom_Hz: Annotated[float | None, Unit("Hz"), Plausible("a nominal frequency", 16.0, 400.0)] = None
    """Nominal frequency (Hz); without it the feeder's. At another one than the feeder's its equipment stays, and its
    reactances go with the frequency (plant/data/README.md)."""
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
    """A load in the table `load` of an `[[event]]`: its power from then on, in all its phases in proportion.

    It takes a factor, or one or both of P_kW and Q_kvar; of these the one that is left out stays as it is.
    """

    factor: Annotated[float | None, FACTOR] = None
    """Factor on the real and the reactive power of the feeder's table; 1 is as in the beginning."""
    P_kW: Annotated[float | None, Unit("kW")] = None
    """Real power at nominal voltage (kW): from 0 to ten times all loads of the feeder."""
    Q_kvar: Annotated[float | None, Unit("kvar")] = None
    """Reactive power at nominal voltage (kvar), up to ten times all loads of the feeder."""


class Event(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An entry of `[[event]]`: what happens at once. It opens a measuring window that lasts to the next one."""

    label: str
    """Name of the window in metrics.json, e.g. "event1"."""
    t_s: Annotated[float, Unit("s"), Plausible("the time of an event", 0.0, LONGEST_RUN, above_zero=True)]
    """When (s), a multiple of h_s, or of T_c_s if agents leave or join; after 0 and before end_s."""
    open: Annotated[tuple[str, ...], Example('["13-152"]')] = ()
    """Switches to open, e.g. ["13-152"]."""
    close: Annotated[tuple[str, ...], Example('["13-152"]')] = ()
    """Switches to close."""
    synchronised: bool = False
    """Whether each switch to close that would join two live islands waits until they are in step, within
    `[plant.sync_check]`; else it joins them as they stand."""
    leave: Annotated[tuple[str, ...], Example('["inv2"]')] = ()
    """Inverters whose agents end, e.g. ["inv2"]; each takes its inverter off the network."""
    join: Annotated[tuple[str, ...], Example('["inv2"]')] = ()
    """Inverters whose agents are started: those that have left, and spare ones. Each comes on line at no load."""
    P_max_kW: Annotated[dict[str, float], Example("{ inv2 = 275 }")] = {}
    """What grid-following inverters have available from then on (kW), e.g. { inv2 = 275 }; in the beginning it is
    P_max_pu of `[plant.gfl]`."""
    load: Annotated[dict[str, LoadChange], Example("{ 48 = { factor = 1.5 } }")] = {}
    """What loads take from then on, by the load's bus (its name in an imported feeder), e.g. { 48 = { factor = 1.5 },
    65 = { P_kW = 0, Q_kvar = 0 } }; in a live run `gridpeers load 48 --factor 1.5` does the same."""


class Case(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table `[case.NAME]`: one run of the experiment, under one rule of control."""

    title: str = ""
    """A few words for tables and plots."""
    expected_failures: Annotated[tuple[str, ...], Example('["frequency"]')] = ()
    """Checks that this case is built to fail, e.g. ["frequency", "var_sharing"] without secondary control: the summary
    of a run does not list them as failures."""
    secondary: Annotated[Secondary, Example('["inv1", "inv4"]')]
    """Which inverters run the secondary law (12)-(15): "none", "GFM", "all", or a list, e.g. ["inv1", "inv4"]. The
    others keep their first set-points, and whoever listens to them by the graph hears these."""
    graph: PluginKey
    """Who listens to whom: "full", "none", "GFM-only", "clustered", "ring", "links" as listed, or a rule of your own,
    "mine:my_graph" or { use = "mine:MyGraph", k = 2 } (`gridpeers doc graphs`)."""
    links: Annotated[tuple[tuple[str, str], ...], Example('[["inv1", "inv4"]]')] = ()
    """Undirected links for the graph "links", e.g. [["inv1", "inv4"], ["inv4", "inv7"]]."""
    without: Annotated[tuple[tuple[str, str], ...], Example('[["inv1", "inv4"]]')] = ()
    """Undirected links that are missing from what the graph has, e.g. [["inv4", "inv7"]]."""
    without_agent: Annotated[tuple[str, ...], Example('["inv2"]')] = ()
    """Inverters that have no agent in this case, beside those that have none in any."""
    P_max_kW: Annotated[dict[str, dict[str, float]], Example("{ clouds = { inv2 = 225 } }")] = {}
    """What inverters have available from an event on (kW), in this case only and in place of what the event says, by
    the event's label: { clouds = { inv2 = 225 } }."""
    law: LawKey = ""
    """Control law of this case only, as `law` at the top; without it, that one."""
    gains: Annotated[Gains, INHERITED] = Gains()
    """Table `[case.NAME.gains]`: gains of this case only; what it leaves out comes from `[gains]`."""
    degraded_communication: Annotated[DegradedCommunication, INHERITED] = DegradedCommunication()
    """Table of this case only; what it leaves out comes from `[degraded_communication]`."""
    netem: Annotated[Netem, INLINE] = Netem()
    """Entries `[[case.NAME.link]]`, `[[case.NAME.partition]]`, `[[case.NAME.node]]`: of this case only."""


class Processes(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Table `[processes]`: how the processes of the run find and await each other. It decides no number."""

    deadline_s: Annotated[float, Unit("s"), Plausible("a deadline", 0.1, 600.0, above_zero=True)] = 20.0
    """Longest wait for any message (s of real time); then the run ends and names who was missing."""
    port: Annotated[int, Plausible("a port", 0, 65535)] = 0
    """TCP port of the plant on the loopback, the rendezvous of the run; 0 takes a free one."""


NEEDS_KEYS = (
    'security = "mtls": say --keys DIR, the folder with the certificates; gridpeers keys init DIR makes it, and '
    "gridpeers keys issue NAME ... --keys DIR the certificates of agents"
)
"""Error of a scenario that asks for certificates, where none were given."""


class ScenarioModel(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The keys outside any table come first in the file."""

    name: str = ""
    """Name of the run folder; without it, that of the file."""
    title: str = ""
    """One line for `gridpeers list`."""
    paper: PluginKey = ""
    """Benchmark whose published numbers and claims the run is judged by: "islanding", "intermittency", "communication",
    "switching", "plug-n-play", "wind-up", those of the paper, or your own as "module:Name"; "" judges nothing."""
    seed: Annotated[int, Plausible("a seed", 0, 2**63 - 1)] = 1
    """Seed of everything drawn at random: the fates of messages on links with faults."""
    security: Literal["none", "mtls"] = "none"
    """"mtls": links between processes are mutual TLS, and a run needs --keys DIR, a folder with certificates
    (docs/how-to/several-hosts.md); "none": links are open, unless --keys is given. A run in one process has no
    links."""
    record: RecordLevel = "all"
    """What the record run.mcap of each case has: "all", decisions of agents with their inputs but no arrivals
    ("decisions"), or rows and events alone ("physics")."""
    metrics: Annotated[tuple[PluginKey, ...], Example('["mine:Name"]')] = ()
    """Metrics of your own, measured in every window: ["mine:nadir_Hz", { use = "mine:Within", band_Hz = 0.05, name =
    "within_50mHz" }] (`gridpeers doc metrics`)."""
    claims: Annotated[tuple[PluginKey, ...], Example('["mine:Name"]')] = ()
    """Claims of your own that the run is judged by: ["mine:restored"] (`gridpeers doc claims`)."""
    checks: Annotated[tuple[PluginKey, ...], Example('["mine:Name"]')] = ()
    """Checks of your own, and other limits for those that judge every run: ["mine:Calm", { use = "frequency", within_s
    = 1.0 }, { use = "rating", off = true }] (`gridpeers doc checks`)."""
    without_agent: Annotated[tuple[str, ...], Example('["inv2"]')] = ()
    """Inverters that have no agent, in every case, e.g. ["inv2"]: the plant runs them on primary droop at their first
    set-points, other agents do not hear of them, and the sharing indices leave them out."""
    time: Time
    """Table `[time]`."""
    plant: PlantTable = PlantTable()
    """Table `[plant]`."""
    protection: Protection = Protection()
    """Table `[protection]`: when inverters trip, and when they come back."""
    law: LawKey = "consensus"
    """Control law that the agents run: a name that `gridpeers doc laws` lists, "mine:Mine" for the class Mine of
    mine.py beside this file, or a table `[law]` with one of use, command = ["./mylaw"] (any program), fmu = "law.fmu",
    and with the law's parameters; time_limit_s is the longest time of one step."""
    on_law_failure: OnLawFailure = "droop"
    """What follows when a law, or a graph of your own, fails: "droop", its inverter goes on on primary droop, as real
    hardware would, and the check "law_failed" fails; "stop", the run ends there. The run has failed in both cases."""
    gains: Gains = Gains()
    """Table `[gains]`: of the law "consensus", for every case."""
    degraded_communication: DegradedCommunication = DegradedCommunication()
    """Table `[degraded_communication]`: what agents make of bad links and of saturation, for every case."""
    processes: Processes = Processes()
    """Table `[processes]`."""
    events: tuple[Event, ...] = msgspec.field(default=(), name="event")
    """Entries `[[event]]`, in the order of time."""
    netem: Annotated[Netem, INLINE] = Netem()
    """Entries `[[link]]`, `[[partition]]`, `[[node]]`: what links and agents suffer, in every case."""
    cases: dict[str, Case] = msgspec.field(name="case")
    """Tables `[case.NAME]`, at least one."""
