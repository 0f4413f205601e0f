"""Configuration of the plant process (JSON on its standard input)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec

from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.inverters.inverter_model import Kind, Method
from gridpeers.plant.inverters.inverter_registry import ParameterSet, model_of
from gridpeers.wire.journal import RecordLevel
from gridpeers.wire.messages import LoadSetting
from gridpeers.wire.schema.table_schema import Example, Plausible, Unit
from gridpeers.wire.trust.credentials import Credentials


class SyncCheck(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Synchronism check of a switch that joins two live islands: the largest differences across it.

    At 0 they are those of IEEE 1547-2018, Table 5, for a smaller island of up to 500 kVA, up to 1500 kVA, or more.
    """

    angle: Annotated[float, Unit("deg"), Plausible("a window of angles", 0.0, 180.0)] = 0.0
    """Largest difference of angle (deg); 0: 20, 15 or 10 by rating."""
    f: Annotated[float, Unit("Hz"), Plausible("a window of frequencies", 0.0, 10.0)] = 0.0
    """Largest difference of frequency (Hz); 0: 0.3, 0.2 or 0.1 by rating at 60 Hz, in proportion at another nominal
    frequency."""
    V: Annotated[float, Unit("pu"), Plausible("a window of voltages", 0.0, 1.0)] = 0.0
    """Largest difference of voltage (pu of nominal); 0: 0.10, 0.05 or 0.03 by rating."""
    timeout: Annotated[float, Unit("s"), Plausible("the longest wait for synchronism", 0.0, 3600.0)] = 10.0
    """Longest wait (s) of a scheduled switch for synchronism."""


class Protection(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips of inverters by voltage or frequency, and their return to service: IEEE 1547-2018."""

    category: Literal["II", "III", "off"] = "III"
    """Abnormal operating performance category, which gives the default trip settings; "off": no inverter trips."""
    trips: Annotated[dict[str, tuple[float, float]], Example("{ UV2 = [0.5, 0.2] }")] = {}
    """Trip settings that replace the defaults, e.g. { UV2 = [0.5, 0.2] }: threshold (pu or Hz), and clearing time in
    seconds. Names are OV2, OV1, UV1, UV2, OF2, OF1, UF1 and UF2. If the nominal frequency is not 60 Hz, default
    frequencies are in proportion."""
    enter_service: Annotated[
        float, Unit("s"), Plausible("the delay of entering service", 0.01, 3600.0, above_zero=True)
    ] = 5.0
    """Time (s) of normal voltage and frequency before a tripped inverter returns. Normal is 0.917 to 1.05 pu, and 59.5
    to 60.1 Hz, in proportion at another nominal frequency. The default of the standard is 300 s."""


class SwitchEvent(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A switch operated at a time of the scenario."""

    t: float  # time (s), a multiple of h
    switch: str  # name, e.g. "13-152" or "sw1_2"
    action: Literal["open", "close"]
    synchronised: bool = False  # whether a switch that would join two live islands waits until they are in step


class LoadEvent(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Another power of a load from a scheduled time on."""

    t: float  # time (s), a multiple of h
    load: str  # name of the load, or of its bus
    setting: LoadSetting  # its power at nominal voltage; what is None stays as it is


class PowerLimit(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Available power of a grid-following inverter from a scheduled time on, e.g. under clouds."""

    t: float  # time (s), a multiple of h
    inverter: str  # name of a GFL, e.g. "inv2".
    P_max: float  # upper bound of its P reference from then on (W)


class ScheduledAction(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A scheduled leave (with the inverter), death (without it) or join of an agent."""

    t: float  # time (s), a multiple of T_c
    inverter: str  # name, e.g. "inv2".
    action: Literal["leave", "die", "join"]


class InverterChange(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Values of one inverter that replace the feeder's table; None keeps the table's."""

    m_p: float | None = None  # P-f droop (pu frequency per pu power)
    m_q: float | None = None  # Q-V droop (pu voltage per pu reactive power)
    P_rated: float | None = None  # rated power (W)
    parameters: str | None = None  # name of the feeder's set of parameters, in place of the one that its table names
    own: ParameterSet = {}  # parameters that replace those of that set and of its kind


class FeederChanges(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Changes of a scenario to the tables of its feeder."""

    f_nom: float | None = None  # nominal frequency (Hz); None is the feeder's
    load_factor: float = 1.0  # factor on all loads, real and reactive power
    m_p_factor: float = 1.0  # factor on the P-f droops of all inverters without an m_p below
    m_q_factor: float = 1.0  # factor on the Q-V droops of all inverters without an m_q below
    inverters: dict[str, InverterChange] = {}  # changes by inverter


class PlantSettings(msgspec.Struct, frozen=True, kw_only=True):
    """All settings that determine the plant's numbers; of older records, others are passed over."""

    simulator: str = "gridpeers"  # what simulates the plant: a name in `gridpeers.plant.simulators.SIMULATORS`
    simulators: dict[str, dict[str, Any]] = {}  # own table of each simulator that the scenario has, as a tree
    feeder: str = "microgrid123"  # name of a feeder in `plant/data`, or a path to a folder of the same layout
    load_set: str = "main"  # which load table of the feeder: "main" or "event2"
    h: float = 0.002  # integration step (s)
    method: Method = "first-order"  # method of time stepping
    P_set0: float = 0.647  # first P_set of every inverter (pu of its rating)
    V_set0: float = 1.0  # first V_set of every inverter (pu of its nominal voltage)
    gfm: Any = GfmDroop()  # an `InverterModel`: that of the GFM that have no other; in JSON, its parameters
    gfl: Any = Gfl()  # that of the GFL
    protection: Protection = Protection()
    events: tuple[SwitchEvent, ...] = ()  # switches operated on schedule
    sync_check: SyncCheck = SyncCheck()
    limits: tuple[PowerLimit, ...] = ()  # scheduled changes of available power
    loads: tuple[LoadEvent, ...] = ()  # scheduled changes of loads
    changes: FeederChanges = FeederChanges()  # changes to the feeder's tables
    spares: tuple[str, ...] = ()  # spare inverters of the run, off at the start

    def __post_init__(self) -> None:
        for name in ("gfm", "gfl"):
            if isinstance(values := getattr(self, name), dict):
                kind: Kind = "GFM" if name == "gfm" else "GFL"
                msgspec.structs.force_setattr(self, name, model_of(values, kind))


OnLawFailure = Literal["droop", "stop"]


class PlantConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Configuration of the plant process (JSON on its standard input)."""

    run: str  # name of the run, part of every key
    settings: PlantSettings
    agents: tuple[str, ...]  # agents the plant waits for before tick 0
    agent_processes: int | msgspec.UnsetType = msgspec.UNSET
    """Processes that carry these agents, each with one link to the plant; unset, as in a record: one each."""
    schedule: tuple[ScheduledAction, ...] = ()  # an agent that joins need not be among `agents`
    bridged: str | bool = False
    """Of older records: programs outside gave set-points to inverters without an agent."""
    T_c: float  # control period (s), a multiple of h
    end: float | None  # duration of the run (s), a multiple of T_c; None, in real time: until a person ends it
    record_step: float  # distance of the recorded rows (s): a multiple of h that divides T_c
    deadline: float  # longest wait for any agent (s)
    listen: tuple[str, ...]  # endpoints the plant listens on; the rendezvous of the run
    links: dict[str, Any] = {}
    """Emulated links to the plant (`gridpeers.scenarios.emulation.link_data`), a tree: the plant knows no netem."""
    connect: tuple[str, ...] = ()  # endpoints the plant connects to, beside listening
    star: bool = False  # whether the plant relays all messages, in simulated time: the agents have one link each
    recorders: tuple[str, ...] = ()  # recorders of the telemetry that the plant waits for before tick 0
    epoch: int = 1  # epoch of this process; see `gridpeers.wire.membership`
    clock: Literal["simulated", "realtime"] = "simulated"  # lock-step with the agents, or real time
    speed: float = 1.0  # real time: run time (s) per s, above 0
    max_age: float = 0.25  # real time: age (s of run time) beyond which agents do not use a neighbour's state
    wait_for_agents: float = 10.0  # real time: longest wait (s) for the agents before the plant starts
    strict: bool = False  # real time: whether the run breaks when it cannot keep pace
    agent_configs: dict[str, dict[str, Any]] = {}  # real time: configurations of agents that join, by inverter
    record: RecordLevel = "physics"  # how much this process notes in its journal, which a recorder gets
    credentials: Credentials | None = None  # certificate of this process and members of its site; None: links are open
    on_law_failure: OnLawFailure = "droop"  # what follows when the law of an agent fails
    feeder_map: dict[str, Any] = {}  # real time: the one-line diagram, `scenarios.live.feeder_map`
