"""The equipment of a feeder: frozen rows that `gridpeers.plant.tables` reads and `gridpeers.plant.network` uses."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import msgspec

from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart, is_behind
from gridpeers.plant.inverters.inverter_model import InverterModel, Kind
from gridpeers.plant.inverters.inverter_registry import PUBLISHED_SETS, ParameterSet, with_own

Phase = Literal["A", "B", "C"]
PHASES: tuple[Phase, ...] = ("A", "B", "C")  # order of the phases in every table and vector

NODES = "ABC456789DEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
"""Letters of a bus's nodes 1, 2, 3, ... in a feeder from another program: the phases, then neutrals and the like."""


F_NOM = 60.0  # nominal frequency (Hz) of a feeder without one in its data


class Bus(msgspec.Struct, frozen=True, kw_only=True):
    """A connection point of equipment; one node per phase."""

    name: str  # name, as in the feeder's drawings: "13", "150r"
    phases: str  # the phases that exist here, in order: "ABC", "AC", "B"
    V_nom: float  # nominal voltage (V, line-to-neutral)
    zone: str = ""  # its part of the feeder, for drawings only
    x: float = 0.0  # place in the drawing (drawing units)
    y: float = 0.0  # place in the drawing (drawing units)


class LineConfig(msgspec.Struct, frozen=True, kw_only=True):
    """A kind of line: conductors and spacing, per length, at nominal frequency, earth return reduced."""

    name: str  # name, to which lines refer
    phases: str  # phases of the rows and columns
    Z: tuple[tuple[complex, ...], ...]  # series impedance matrix (ohm/km)
    B: tuple[tuple[float, ...], ...]  # shunt susceptance matrix (S/km)


class Line(msgspec.Struct, frozen=True, kw_only=True):
    """A line section between two buses of equal nominal voltage."""

    name: str
    from_bus: str
    to_bus: str
    phases: str
    config: str  # name of its `LineConfig`
    length: float


class Switch(msgspec.Struct, frozen=True, kw_only=True):
    """An ideal switch: closed, it merges two nodes on each of its phases; open, it has no effect."""

    name: str  # its buses: "13-152"
    alias: str  # a second name ("sw1_2"), or empty
    from_bus: str
    to_bus: str
    phases: str  # phases that it switches together
    closed: bool

    @property
    def names(self) -> tuple[str, ...]:
        """All its names: its buses in either order, and its alias."""
        return (self.name, f"{self.to_bus}-{self.from_bus}", *((self.alias,) if self.alias else ()))

    @property
    def event_name(self) -> str:
        """Its name in events: its buses; the alias alone where an import has put a bus behind it."""
        return self.alias if self.alias and is_behind(self.to_bus) else self.name

    @property
    def full_name(self) -> str:
        """Its name in sentences: both of its names, if it has another one than in events."""
        return f"{self.alias} ({self.name})" if self.alias not in ("", self.event_name) else self.event_name


class Load(msgspec.Struct, frozen=True, kw_only=True):
    """A spot load of one kind: constant impedance (Z), current (I) or power (P)."""

    bus: str
    connection: Literal["Y", "D"]  # Y: phases to ground. D: between phases A-B, B-C, C-A.
    model: Literal["Z", "I", "P"]  # Z: power goes with V^2, I: with V, P: constant
    S: tuple[complex, complex, complex]  # power at nominal voltage (VA) on phases A, B, C (Y) or A-B, B-C, C-A (D)


class Capacitor(msgspec.Struct, frozen=True, kw_only=True):
    """A shunt capacitor bank, each phase to ground."""

    bus: str
    Q: tuple[float, float, float]  # reactive power at rated voltage (var) on phases A, B, C
    V_rated: float  # rated voltage (V, line-to-neutral)


class Regulator(msgspec.Struct, frozen=True, kw_only=True):
    """A step voltage regulator at a fixed tap: an ideal autotransformer, V_to = ratio V_from."""

    name: str  # name; phases with different taps are separate rows of one name
    from_bus: str  # side without taps
    to_bus: str  # regulated side
    phases: str  # phases on this tap
    ratio: float  # V_to / V_from, 1 + tap * tap_step


class Transformer(msgspec.Struct, frozen=True, kw_only=True):
    """A three-phase two-winding transformer whose rated voltages are the nominal voltages of its buses."""

    name: str
    from_bus: str
    to_bus: str
    connection: Literal["D-D", "Yg-Yg"]  # windings; neither shifts the phase
    S_rated: float  # rated power (VA, three phases)
    z: complex  # series impedance (pu of the rating)


class Source(msgspec.Struct, frozen=True, kw_only=True):
    """The substation: a stiff three-phase voltage."""

    bus: str
    V_pu: float  # voltage (pu of the bus's nominal voltage)
    angle: float  # angle of phase A (rad)


class InverterRow(msgspec.Struct, frozen=True, kw_only=True):
    """An inverter's nameplate and bus."""

    name: str  # name, unique: "inv1"
    kind: Kind  # grid-forming or grid-following
    bus: str  # bus of its terminals; each of its nodes has one inverter at most
    microgrid: str
    P_rated: float  # rated power (W, of all its phases), base of its per-unit values
    V_nom: float  # nominal terminal voltage (V, line-to-neutral)
    m_p: float  # P-f droop (pu frequency per pu power)
    m_q: float  # Q-V droop (pu voltage per pu reactive power)
    phases: Literal["ABC", "A", "B", "C"] = "ABC"  # phases of the bus at which it stands: all three, or one
    neutral: str = ""  # node of the bus to which its phases return, by its letter; empty for earth
    spare: bool = False  # whether it stays off until an agent joins for it
    parameters: str = ""  # name of a published set; empty for none
    own: ParameterSet = {}  # parameters that a scenario gives it

    @property
    def node(self) -> tuple[str, str]:
        return self.bus, self.phases[0]


class Tables(msgspec.Struct, frozen=True, kw_only=True):
    """All tables of a feeder with one load set, checked by `gridpeers.plant.tables.read_feeder`."""

    name: str
    load_set: str  # name of the load set: "main" is from loads_main.csv
    buses: tuple[Bus, ...]  # buses; their order is that of the nodes in every vector
    lines: tuple[Line, ...] = ()
    line_configs: tuple[LineConfig, ...] = ()
    switches: tuple[Switch, ...] = ()
    loads: tuple[Load, ...] = ()
    capacitors: tuple[Capacitor, ...] = ()
    regulators: tuple[Regulator, ...] = ()
    transformers: tuple[Transformer, ...] = ()
    inverters: tuple[InverterRow, ...] = ()
    source: Source | None  # the substation, or None in a feeder with inverters alone
    f_nom: float = F_NOM  # nominal frequency (Hz) of the impedances
    elements: tuple[LinearElement, ...] = ()  # of feeders that were written for another program
    load_parts: tuple[LoadPart, ...] = ()  # loads of such feeders
    notes: tuple[str, ...] = ()  # notes of the import of such a feeder: commands that were not run, and the like
    places: dict[str, str] = {}
    """File and line of each element, load and "bus NAME" of such a feeder, where its import knows them."""
    spares: tuple[InverterRow, ...] = ()  # inverters that stay off until an agent joins for them

    def parameters_of(self, row: InverterRow, gfm: InverterModel, gfl: InverterModel) -> InverterModel:
        """Return the model of one inverter: its own parameters, then those of its set, then its kind's."""
        return with_own(gfm if row.kind == "GFM" else gfl, PUBLISHED_SETS.get(row.parameters, {}) | row.own)

    def demands(self) -> Iterator[tuple[str, str, complex]]:
        """Yield the bus, the phases ("A", or "AB" between two) and the nominal power (VA) of each branch of a load."""
        for load in self.loads:
            branches = ("A", "B", "C") if load.connection == "Y" else ("AB", "BC", "CA")
            yield from ((load.bus, branch, S) for branch, S in zip(branches, load.S, strict=True) if S)
        yield from ((part.bus, "".join(part.ends), part.S) for part in self.load_parts)

    def load_by_bus(self) -> dict[str, float]:
        """Return the real power (W) of the loads at each bus that has any, at nominal voltage."""
        return self._by_bus(1.0)

    def generation_by_bus(self) -> dict[str, float]:
        """Return the real power (W) of constant generation, loads of negative power, at each bus that has any."""
        return self._by_bus(-1.0)

    def _by_bus(self, sign: float) -> dict[str, float]:
        power: dict[str, float] = {}
        for bus, _, S in self.demands():
            if S.real * sign > 0.0:
                power[bus] = power.get(bus, 0.0) + S.real * sign
        return power

    def branches(self) -> Iterator[tuple[str, str, int]]:
        """Yield the two buses of every branch, switches left out, and its number of phases."""
        yield from ((line.from_bus, line.to_bus, len(line.phases)) for line in self.lines)
        yield from ((row.from_bus, row.to_bus, 3) for row in self.transformers)
        yield from ((row.from_bus, row.to_bus, len(row.phases)) for row in self.regulators)
        for element in self.elements:
            buses = [bus for bus, _ in element.nodes]
            others = [bus for bus in dict.fromkeys(buses) if bus != buses[0]]
            yield from ((buses[0], other, min(buses.count(buses[0]), 3)) for other in others)
