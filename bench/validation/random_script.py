"""A random feeder as a script for OpenDSS: a network of medium voltage, and low voltage behind transformers."""

from __future__ import annotations

import random
from math import sqrt
from typing import Literal, NamedTuple

Kind = Literal["GFM", "GFL"]
Shape = Literal["radial", "meshed"]

MV, LV = 12.47, 0.4
"""Voltages (kV, line-to-line)."""

TO_GROUND, TO_NEUTRAL, DELTA = "ground", "neutral", "delta"
"""The nodes to which the loads of a bus are connected."""

ANTIFLOAT = "ppm_antifloat=10000"
"""Of a delta winding that feeds: 1 ppm, the default, resonates with a few meters of cable, 100 with a few hundred; the
neutral is then at up to 38 pu, and rounding moves it by 1e-4 pu, in either engine and here."""

LIMITS = ("vminpu=0.8 vmaxpu=1.2", "vminpu=0.8 vmaxpu=1.2", "")
"""Voltages within which loads keep their law; the last are the engine's own, 0.95 and 1.05 pu."""

CONNECTIONS = (
    *("wye-wye", "wye-wye", "delta-wye", "delta-wye", "wye-delta", "floating wye-delta", "delta-delta"),
    *("four", "four", "one phase"),
)
"""Of transformers; some are drawn twice as often."""

UNEVEN = """New LineCode.uneven nphases=3 units=km rmatrix=(0.22 | 0.10 0.21 | 0.09 0.09 0.23)
~ xmatrix=(0.63 | 0.31 0.65 | 0.26 0.24 0.64) cmatrix=(11 | -3 10 | -2 -1 9)
New LineCode.four nphases=4 units=km rmatrix=(0.25 | 0.05 0.25 | 0.05 0.05 0.25 | 0.05 0.05 0.05 0.28)
~ xmatrix=(0.70 | 0.62 0.70 | 0.60 0.62 0.70 | 0.61 0.60 0.61 0.71) cmatrix=(30 | -6 30 | -6 -6 30 | -7 -7 -7 31)
"""


class Place(NamedTuple):
    """An inverter of a random feeder."""

    kind: Kind
    bus: str
    phases: Literal["ABC", "A", "B", "C"]
    P_rated: float
    """W"""
    neutral: str
    """Number of the node to which it returns; empty for earth."""


class RandomFeeder(NamedTuple):
    """A script with what happens to it."""

    script: str
    switch: str
    """Line that opens."""
    load: str
    """Load that changes."""
    power: tuple[float, float]
    """Its power from then on (kW, kvar)."""
    inverters: tuple[Place, ...]


class _Bus(NamedTuple):
    name: str
    kV: float
    loads: str
    """`TO_GROUND`, `TO_NEUTRAL` or `DELTA`."""
    nodes: str = "123"


def random_feeder(seed: int, shape: Shape) -> RandomFeeder:
    """Return the feeder of a seed, whose network of medium voltage may have meshes: the same one at every call."""
    return _Draw(random.Random(f"feeder {seed} {shape}"), shape).feeder()


class _Draw:
    """Draws the elements of one feeder."""

    def __init__(self, rng: random.Random, shape: Shape) -> None:
        self._rng, self._shape = rng, shape
        self._lines: list[str] = []
        self._loads: dict[str, tuple[float, float]] = {}
        self._buses: list[_Bus] = []
        self._count = 0
        self._kvar = 0

    def feeder(self) -> RandomFeeder:
        """Draw it."""
        rng = self._rng
        f_nom = rng.choice((50, 60))
        z2 = "z2=[0.3 0.8]" if rng.random() < 0.3 else ""
        head = f"""Clear
Set DefaultBaseFrequency={f_nom}
New Circuit.random bus1=s basekv={MV} pu={rng.uniform(1.0, 1.04):.3f} angle={rng.randrange(-90, 90)}
~ z1=[0.1 0.5] {z2} z0=[{rng.uniform(0.1, 0.5):.2f} {rng.uniform(0.4, 1.5):.2f}]
{UNEVEN}"""
        trunk = self._trunk()
        for bus in rng.choices(trunk, k=rng.randint(1, 4)):
            self._low_voltage(bus)
        for bus in trunk:
            if rng.random() < 0.5:
                self._load(bus)
        if not self._loads:
            self._load(trunk[-1])
        sections = [name for name in self._lines if name.startswith("New Line.trunk")]
        switch = rng.choice((sections[0], *sections)).split()[1].lower()
        load = rng.choice(list(self._loads))
        factor = rng.uniform(0.4, 1.5)
        kW, kvar = self._loads[load]
        tail = f"Set VoltageBases=({MV} {LV} 0.208)\nCalcVoltageBases\nSolve\n"
        return RandomFeeder(
            script=head + "\n".join(self._lines) + "\n" + tail,
            switch=switch,
            load=load,
            power=(round(factor * kW, 3), round(factor * kvar, 3)),
            inverters=self._inverters(trunk),
        )

    # ---------------------------------------------------------------- networks

    def _trunk(self) -> list[_Bus]:
        """Draw the network of medium voltage; some of its sections are no lines, and not symmetric."""
        rng = self._rng
        buses = [_Bus("s", MV, TO_GROUND)]
        for k in range(rng.randint(2, 7)):
            bus = _Bus(f"m{k}", MV, TO_GROUND)
            self._section(rng.choice(buses[1:][-3:] or buses), bus, f"trunk{k}", line=k == 0)
            buses.append(bus)
        if self._shape == "meshed":
            for k in range(rng.randint(1, 3)):
                one, other = rng.sample(buses if rng.random() < 0.2 else buses[1:], 2)
                self._section(one, other, f"mesh{k}", line=False)
        for bus in buses[1:]:
            if rng.random() < 0.3:
                self._end(bus)
            if rng.random() < 0.3:
                self._lateral(bus)
        if rng.random() < 0.3:
            bus = rng.choice(buses)
            phases = rng.choice((f"bus1={bus.name} phases=3", f"bus1={bus.name}.2 phases=1"))
            kV = MV if "phases=3" in phases else MV / sqrt(3.0)
            self._kvar = rng.randrange(20, 150)
            self._lines.append(f"New Capacitor.k {phases} kvar={self._kvar} kv={kV:.5g}")
        self._buses += buses[1:]
        return buses[1:]

    def _section(self, one: _Bus, other: _Bus, name: str, *, line: bool) -> None:
        rng = self._rng
        ends, length = f"bus1={one.name} bus2={other.name}", rng.uniform(0.2, 3.0)
        kind = rng.random()
        if not line and kind < 0.25:
            z1, z2, z0 = ([round(rng.uniform(0.1, 0.9), 2), round(rng.uniform(0.2, 1.2), 2)] for _ in range(3))
            self._lines.append(f"New Reactor.{name} {ends} phases=3 z1={z1} z2={z2} z0={z0}".replace(",", ""))
        elif kind < 0.6:
            self._lines.append(f"New Line.{name} {ends} linecode=uneven length={length:.3f} units=km")
        else:
            self._lines.append(f"New Line.{name} {ends} phases=3 {self._cable()} length={length:.3f} units=km")

    def _cable(self, scale: float = 1.0) -> str:
        """Parameters of a symmetrical line (ohm, nF per km), often without its capacitance."""
        rng = self._rng
        r1, x1 = (round(scale * rng.uniform(0.08, 0.4), 3) for _ in range(2))
        C = rng.choice(((0, 0), (0, 0), (rng.randrange(9, 300), rng.randrange(5, 200))))
        return f"r1={r1} x1={x1} r0={3 * r1:.3f} x0={rng.choice((2, 3)) * x1:.3f} c1={C[0]} c0={C[1]}"

    def _end(self, bus: _Bus) -> None:
        """Draw a cable whose end is open."""
        ends = f"bus1={bus.name} bus2={self._name('e')}"
        if bus.nodes == "1234":
            ends = ends.replace(" ", ".1.2.3.4 ") + ".1.2.3.4"
            self._lines.append(f"New Line.{self._name('end')} {ends} linecode=four length=0.05 units=km")
            return
        self._lines.append(f"New Line.{self._name('end')} {ends} phases=3 {self._cable()} length=0.3 units=km")

    def _lateral(self, bus: _Bus) -> None:
        """Draw a lateral of one or two phases with a load."""
        rng, far = self._rng, self._name("l")
        nodes = rng.choice(("1", "2", "3", "12", "23"))
        dots = "".join(f".{node}" for node in nodes)
        ends = f"bus1={bus.name}{dots} bus2={far}{dots} phases={len(nodes)}"
        length = rng.uniform(0.1, 1.0) if bus.kV == MV else rng.uniform(0.01, 0.05)
        self._lines.append(f"New Line.{self._name('lateral')} {ends} {self._cable()} length={length:.3f} units=km")
        if rng.random() < 0.8 or bus.loads == DELTA:
            self._load(_Bus(far, bus.kV, bus.loads, nodes))

    def _low_voltage(self, bus: _Bus) -> None:
        """Draw a transformer of some connection, and a network behind it."""
        rng, low = self._rng, self._name("v")
        name, kVA = self._name("t"), rng.choice((100, 250, 400, 630))
        tap, xhl, losses = rng.choice((1.0, 1.0, 1.025, 0.975)), rng.uniform(3, 6), rng.uniform(0.5, 1.5)
        common = f"New Transformer.{name} phases=3 windings=2 xhl={xhl:.2f} %loadloss={losses:.2f}"
        common += f" kvs=({MV} {LV}) kvas=({kVA} {kVA}) taps=(1 {tap})"
        if rng.random() < 0.3:
            common += f" %noloadloss={rng.uniform(0.1, 0.4):.2f} %imag={rng.uniform(0.2, 1.0):.2f}"
        connection = rng.choice(CONNECTIONS)
        lines, ends = self._lines, f"buses=({bus.name} {low})"
        if connection.endswith("delta"):
            common += f" {ANTIFLOAT}"
        far = _Bus(low, LV, DELTA if connection.endswith("delta") else TO_GROUND)
        if connection == "one phase":
            self._single_phase(bus, low, name)
            return
        if connection == "floating wye-delta":
            lines.append(f"{common} buses=({bus.name}.1.2.3.4 {low}) conns=(wye delta)")
        elif connection == "four":
            far = _Bus(low, LV, TO_NEUTRAL, "1234")
            first = rng.choice(("wye", "delta"))
            lines.append(f"{common} buses=({bus.name} {low}.1.2.3.4) conns=({first} wye)")
            R, X = round(rng.uniform(0.01, 2.0), 3), round(rng.uniform(0.0, 0.2), 3)
            lines.append(f"New Reactor.{name} bus1={low}.4 bus2={low}.0 phases=1 r={R} x={X}")
        else:
            first, second = connection.split("-")
            lead = " leadlag=lead" if rng.random() < 0.3 else ""
            lines.append(f"{common} {ends} conns=({first} {second}){lead}")
        self._buses.append(far)
        before = [far]
        for _ in range(rng.randint(0, 3)):
            one, other = rng.choice(before), far._replace(name=self._name("w"))
            length = rng.uniform(0.02, 0.15)
            if far.loads == TO_NEUTRAL:
                ends = f"bus1={one.name}.1.2.3.4 bus2={other.name}.1.2.3.4 linecode=four"
                if rng.random() < 0.3:
                    R = round(rng.uniform(1.0, 20.0), 2)
                    lines.append(f"New Reactor.{other.name} bus1={other.name}.4 bus2={other.name}.0 phases=1 r={R} x=0")
            else:
                ends = f"bus1={one.name} bus2={other.name} " + rng.choice(
                    ("linecode=uneven", f"phases=3 {self._cable()}")
                )
            lines.append(f"New Line.{self._name('service')} {ends} length={length:.3f} units=km")
            before.append(other)
            self._buses.append(other)
            if far.loads != TO_NEUTRAL and rng.random() < 0.4:
                self._lateral(other)
        for each in before:
            if rng.random() < 0.7:
                self._load(each)
            if rng.random() < 0.3:
                self._end(each)

    def _single_phase(self, bus: _Bus, low: str, name: str) -> None:
        """Draw a transformer of one phase, between a phase and ground or two phases, with a load behind it."""
        rng = self._rng
        node = rng.choice("123")
        first, kV = rng.choice(((f".{node}", MV / sqrt(3.0)), ({"1": ".1.2", "2": ".2.3", "3": ".3.1"}[node], MV)))
        self._lines.append(
            f"New Transformer.{name} phases=1 windings=2 xhl=2.5 %loadloss=1 buses=({bus.name}{first} {low}.{node}) "
            f"kvs=({kV:.6g} {LV / sqrt(3.0):.6g}) kvas=(50 50)"
        )
        far = _Bus(low, LV, TO_GROUND, node)
        self._load(far)
        if rng.random() < 0.5:
            ends = f"bus1={low}.{node} bus2={self._name('w')}.{node} phases=1"
            self._lines.append(f"New Line.{self._name('service')} {ends} {self._cable()} length=0.04 units=km")

    # ---------------------------------------------------------------- loads and inverters

    def _load(self, bus: _Bus) -> None:
        """Draw a load of some law at the phases of a bus."""
        rng, name = self._rng, self._name("load")
        nodes = bus.nodes.replace("4", "")
        largest = 90.0 if bus.kV == MV else 12.0
        kW = round(rng.uniform(0.2, 1.0) * largest, 2)
        kvar = round(kW * rng.uniform(-0.1, 0.5), 2)
        model, limits = rng.choice((1, 1, 1, 2, 5)), rng.choice(LIMITS)
        if bus.loads == DELTA and len(nodes) == 1:
            return  # no node to connect to
        if len(nodes) == 3 and rng.random() < 0.6:
            delta = " conn=delta" if bus.loads == DELTA or (bus.loads == TO_GROUND and rng.random() < 0.3) else ""
            where = f"bus1={bus.name}{'.1.2.3.4' if bus.loads == TO_NEUTRAL else ''} phases=3 kv={bus.kV}{delta}"
        elif bus.loads == DELTA or (len(nodes) > 1 and rng.random() < 0.3):
            pair = rng.choice([pair for pair in ("12", "23", "31") if set(pair) <= set(nodes)])
            where = f"bus1={bus.name}.{pair[0]}.{pair[1]} phases=1 conn=delta kv={bus.kV}"
            kW, kvar = kW / 2.0, kvar / 2.0
        else:
            other = ".4" if bus.loads == TO_NEUTRAL else ""
            where = f"bus1={bus.name}.{rng.choice(nodes)}{other} phases=1 kv={bus.kV / sqrt(3.0):.6g}"
            kW, kvar = kW / 3.0, kvar / 3.0
        self._loads[f"load.{name}"] = kW, kvar
        self._lines.append(f"New Load.{name} {where} kw={kW:.4f} kvar={kvar:.4f} model={model} {limits}".rstrip())

    def _inverters(self, trunk: list[_Bus]) -> tuple[Place, ...]:
        """Draw a GFM of medium voltage that can feed all alone, and others at buses with a neutral or an earth."""
        rng, total = self._rng, 1e3 * sum(kW for kW, _ in self._loads.values())
        places = [Place("GFM", rng.choice(trunk).name, "ABC", round(2.0 * total + 3e3 * self._kvar + 1e5), "")]
        earthed = [bus for bus in self._buses if bus.loads != DELTA and bus.name != places[0].bus]
        for bus in rng.sample(earthed, min(len(earthed), rng.randint(0, 3))):
            kind: Kind = rng.choice(("GFM", "GFL", "GFL"))
            neutral = "4" if bus.loads == TO_NEUTRAL else ""
            if bus.kV == LV and rng.random() < 0.5:
                places.append(
                    Place("GFL", bus.name, rng.choice(("A", "B", "C")), round(rng.uniform(3e3, 8e3)), neutral)
                )
            else:
                most = total if bus.kV == MV else min(total, 4e4)
                places.append(Place(kind, bus.name, "ABC", round(rng.uniform(0.3, 1.0) * most + 1e4), neutral))
        return tuple(places)

    def _name(self, stem: str) -> str:
        self._count += 1
        return f"{stem}{self._count}"
