"""State of a run as a client knows it: from the plant's telemetry, the agents' status, tokens and configurations.

Pure: messages and the time are arguments.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import msgspec

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.scenarios.console import in_order, short
from gridpeers.wire.keys import Keys, epoch_of, run_of_plant
from gridpeers.wire.membership import MOST_PROCESSES
from gridpeers.wire.messages import MOST_INVERTERS, AgentStatus, Pacing, PlantEvent, Telemetry


class RunTokens:
    """The tokens that are there; those of agents as far as there is room for them."""

    def __init__(self, run: str) -> None:
        self._run, self._keys = run, Keys(run)
        self._plants: dict[str, int] = {}
        """Epoch of each plant of the run, by its token."""
        self._others: dict[str, str] = {}
        """Run of each other plant, by its token."""
        self._names: dict[str, str] = {}
        """Name of each process of an agent, by its token."""
        self.agents = Counter[str]()
        """How many processes have the name of each agent."""

    @property
    def epochs(self) -> set[int]:
        return set(self._plants.values())

    @property
    def runs(self) -> set[str]:
        return {*self._others.values(), *([self._run] if self._plants else ())}

    def appeared(self, key: str) -> None:
        match self._keys.parts(key):
            case ("alive", "plant", part) if (epoch := epoch_of(part)) is not None:
                self._plants[key] = epoch
            case ("alive", "agent", name, _) if key not in self._names and (
                self.agents[name] < MOST_PROCESSES if name in self.agents else len(self.agents) < MOST_INVERTERS
            ):
                self._names[key] = name
                self.agents[name] += 1
            case () if run := run_of_plant(key):
                self._others[key] = run

    def vanished(self, key: str) -> None:
        self._plants.pop(key, None)
        self._others.pop(key, None)
        if (name := self._names.pop(key, None)) is not None:
            self.agents[name] -= 1
            if not self.agents[name]:
                del self.agents[name]


class PlantStatus(msgspec.Struct, frozen=True, kw_only=True):
    """The plant's answer to "status", as far as it is shown; see `gridpeers.plant.realtime.run_commands`."""

    phase: str
    """gathering, running or closing."""
    t: float
    speed: float
    pacing: Pacing
    agents: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()
    events: tuple[PlantEvent, ...] = ()
    """The latest events, oldest first."""
    impaired: tuple[str, ...] = ()
    """Agents whose link to or from the plant has an emulated fault."""
    switches: dict[str, bool] = {}
    """True for a closed switch, by its name."""
    loads: dict[str, tuple[float, float]] = {}
    """Real (W) and reactive power (var) at nominal voltage of each load that was set during the run."""

    @property
    def inverters(self) -> tuple[str, ...]:
        return self.agents + self.absent


OLD = 0.2  # Age (s) from which it is coloured: ten control periods of 20 ms, half of the oldest used age

V_LOW, V_HIGH = 0.95, 1.05  # Range of normal terminal voltages (pu): range A of ANSI C84.1

SILENT = 1.5  # An agent whose status is older than this (s of real time) is silent: it sends three in this time
_PER_INVERTER = 6  # Values of one inverter in a row of telemetry


@dataclass(frozen=True, kw_only=True)
class InverterStatus:
    name: str
    island: str = ""
    """Name of its island: "grid", or the first inverter in it; "" if unknown."""
    f: float | None = None  # Hz
    P: float | None = None  # kW
    P_set: float | None = None  # kW
    P_share: float | None = None  # pu of its rating
    Q: float | None = None  # kvar
    V: float | None = None  # pu of nominal
    V_set: float | None = None  # pu of nominal
    ages: dict[str, float] = field(default_factory=dict)
    """Age (s) of the latest state of each neighbour that it uses."""
    hears: int | None = None
    late: bool = False
    """The latest state of one of them is `OLD`."""
    off_voltage: bool = False
    """V is beyond `V_LOW` to `V_HIGH`."""
    received: int | None = None
    sent: int | None = None
    lost: int | None = None
    """Messages that were sent to it and never arrived."""
    impaired: tuple[str, ...] = ()
    """Senders whose links to it have an emulated fault."""
    note: str = ""
    """A note for the reader: "no agent", "not heard here; the plant hears it", "waits for ...", "silent for 3 s"."""


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    run: str
    t: float | None = None
    pace: str = ""
    speed: float = 1.0
    impaired: tuple[str, ...] = ()
    inverters: tuple[InverterStatus, ...] = ()
    events: tuple[str, ...] = ()


def line_of(event: PlantEvent) -> str:
    return f"{event.t:8.2f} s  {re.sub(r',? at t = [0-9.e+]+ s$', '', event.text)}"


def repeated(event: PlantEvent) -> bool:
    """Return whether an event of the plant says the same as this command, which takes effect in the next step."""
    return event.kind == "command" and re.match("(switch|load) (?!.*: close in step)", event.text) is not None


class RunMonitor:
    def __init__(self, run: str) -> None:
        self._run = run
        self._configs: dict[str, AgentConfig] = {}
        self._telemetry: Telemetry | None = None
        self._heard_at = 0.0
        self._row: tuple[float, ...] = ()
        self._t: float | None = None
        self._pacing: Pacing | None = None
        self._impaired: tuple[str, ...] = ()
        self._plant_status: PlantStatus | None = None
        self._events: deque[PlantEvent] = deque(maxlen=100)
        self._status: dict[str, tuple[AgentStatus, float]] = {}
        self.members: set[str] = set()
        """Inverters whose agents take part, as the plant says."""

    @property
    def inverters(self) -> tuple[str, ...]:
        first = self._telemetry.inverters if self._telemetry else ()
        others = {*self._status, *self._configs}.difference(first)
        return (*first, *sorted(others, key=lambda name: (len(name), name)))

    @property
    def has_configs(self) -> bool:
        return self._telemetry is None or self._configs.keys() >= set(self._telemetry.inverters)

    def config(self, config: AgentConfig) -> None:
        self._configs[config.name] = config

    def plant_status(self, status: PlantStatus) -> None:
        self._plant_status, self._impaired = status, status.impaired
        self.members = set(status.agents)
        if status.phase != "gathering":
            self._t, self._pacing = status.t, status.pacing
        self._events.extend(event for event in status.events if event not in self._events)

    def telemetry(self, message: Telemetry, now: float) -> None:
        before = self._telemetry
        if before is not None and message.epoch != before.epoch:
            self._events.clear()
            self.members.clear()
            self._plant_status = None
        elif before is not None and message.t < before.t:
            return  # published again for a recorder that has missed it
        if before is not None and message.inverters != before.inverters:
            self._row = ()
        self._telemetry, self._heard_at, self._t = message, now, message.t
        self._pacing, self._impaired = message.pacing or self._pacing, message.impaired
        if message.rows:
            self._row = message.rows[-1]
        for event in message.events:
            if event in self._events:
                continue
            self._events.append(event)
            match = re.match(rf"{re.escape(event.subject)} (joined|left|died)\b", event.text)
            if event.kind == "roster" and match:
                (self.members.add if match[1] == "joined" else self.members.discard)(event.subject)

    def status(self, message: AgentStatus, now: float) -> None:
        self._status[message.sender] = (message, now)

    def snapshot(self, present: Collection[str], now: float, *, current: bool = True) -> Snapshot:
        """Return a snapshot at a time (s) of the client's clock, without the plant's values if they are not current."""
        pace, latest = self._pace(), self._telemetry
        if latest is not None and latest.final:
            pace, current = "the run has ended" + (f": {latest.outcome}" if latest.outcome else ""), False
        elif latest is not None and now - self._heard_at > SILENT:
            pace, current = f"the plant has been silent for {now - self._heard_at:.0f} s", False
        names = dict.fromkeys((*self.inverters, *in_order(present)))
        return Snapshot(
            run=self._run,
            t=self._t,
            pace=pace,
            speed=1.0 if self._plant_status is None else self._plant_status.speed,
            impaired=self._impaired if current else (),
            inverters=tuple(self._inverter(name, name in present, current, now) for name in names),
            events=tuple(line_of(event) for event in self._events if not repeated(event)),
        )

    def _inverter(self, name: str, present: bool, current: bool, now: float) -> InverterStatus:
        status, at = self._status.get(name, (None, now))
        if not present or now - at > SILENT:
            status = None
        known: dict[str, Any] = {"note": self._note(name, present, status, now - at)}
        config, latest = self._configs.get(name), self._telemetry
        if current and self._row and latest is not None and name in latest.inverters:
            start = 1 + _PER_INVERTER * latest.inverters.index(name)
            f, P, Q, V, P_set, V_set = self._row[start : start + _PER_INVERTER]
            known |= {"f": f, "P": P / 1e3, "Q": Q / 1e3, "P_set": P_set / 1e3}
            if config is not None:
                V_pu = V / config.V_nom
                known |= {"P_share": P / config.P_rated, "V": V_pu, "V_set": V_set / config.V_nom}
                known["off_voltage"] = not V_LOW <= V_pu <= V_HIGH
        if status is not None:
            ages = dict(zip(status.neighbours, status.ages, strict=False))
            used = {neighbour: age for neighbour, age in ages.items() if neighbour in status.used}
            known |= {"ages": used, "hears": len(status.used), "late": any(age >= OLD for age in used.values())}
            known |= {key: getattr(status, key) for key in ("island", "received", "sent", "lost", "impaired")}
        return InverterStatus(name=name, **known)

    def _pace(self) -> str:
        pacing, plant = self._pacing, self._plant_status
        if pacing is None or pacing.steps == 0:
            return "waits for its agents" if plant is not None and plant.phase == "gathering" else ""
        speed = f"speed {plant.speed:g}   " if plant is not None else ""
        text = f"{speed}pace: {100.0 * (1.0 - pacing.late / pacing.steps):.2f} % of steps in time"
        text += f" (p50 {1e3 * pacing.p50:.1f} ms, p99 {1e3 * pacing.p99:.1f} ms)"
        return text + (f", fell behind by {pacing.slipped:.1f} s" if pacing.slipped > 0.0 else "")

    def _note(self, name: str, present: bool, status: AgentStatus | None, age: float) -> str:
        if not present:
            return "not heard here; the plant hears it" if name in self.members else "no agent"
        if status is None:
            return f"silent for {age:.0f} s" if name in self._status else "has not reported yet"
        if status.phase != "running":
            return f"waits for {status.waits_for}" if status.waits_for else status.phase
        unused = [neighbour for neighbour in status.neighbours if neighbour not in status.used]
        islands = {sender: message.island for sender, (message, _) in self._status.items()}
        apart = [neighbour for neighbour in unused if islands.get(neighbour, "") not in ("", status.island)]
        silent = [neighbour for neighbour in unused if neighbour not in apart]
        parts = (f"apart: {short(apart)}" if apart else "", f"without {short(silent)}" if silent else "")
        return "; ".join(filter(None, parts))
