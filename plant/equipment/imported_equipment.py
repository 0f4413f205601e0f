"""Equipment of feeders that were written for another program: elements by their admittance, loads by their law."""

from __future__ import annotations

import msgspec

BEHIND = "~"  # Part of the name of a bus that an import adds, after the name of the bus with its voltage and place


OVERVOLTAGE = 1.2  # voltage (pu) above which generation disconnects: OV2 of IEEE 1547-2018
HIGH = 1.1  # voltage (pu) above which what it usually has is taken for nominal: the nominal voltage is wrong


def cut_off(usual: float) -> float:
    """Return the `LoadPart.V_off_above` of generation that usually has this voltage (pu).

    Other programs have no such limit, and an island in which generation prevails then has no voltage at which to rest.
    """
    return OVERVOLTAGE * (usual if usual > HIGH else 1.0)


def bus_behind(bus: str, element: str) -> str:
    return f"{bus}{BEHIND}{element}"


def is_behind(bus: str) -> bool:
    """Return whether an import has added a bus, which the other program does not have."""
    return BEHIND in bus


class LinearElement(msgspec.Struct, frozen=True, kw_only=True):
    """Anything linear between nodes, by its primitive admittance matrix: a line, a transformer, a capacitor."""

    name: str  # name, unique: "transformer.sub"
    nodes: tuple[tuple[str, str], ...]  # nodes (bus, phase) of its rows; whatever leads to ground has no row
    Y: tuple[tuple[complex, ...], ...]  # admittance (S); it need not be symmetric


class LoadPart(msgspec.Struct, frozen=True, kw_only=True):
    """A load between two nodes of a bus, or a node and ground, whose power goes with a power of the voltage.

    Beyond its limits it is no such load any more: above `V_max` it is the impedance that takes the same power there;
    below `V_min` its current falls in proportion to the voltage, to the nominal impedance at `V_low` and below.
    """

    name: str  # name of the load it is a part of
    bus: str  # where it is connected
    ends: tuple[str, str]  # its two phases; the second is empty for ground
    S: complex  # power at nominal voltage (VA)
    V_nom: float  # nominal voltage across it (V)
    exponents: tuple[float, float]  # of the voltage, for P and Q: 0 constant power, 1 current, 2 impedance
    V_low: float = 0.0
    """Voltage (pu) below which it is its nominal impedance. If it is `V_min`, the current stays as at `V_min` below."""
    V_min: float = 0.0  # voltage (pu) below which it is limited; 0: nowhere
    V_max: float = 0.0  # voltage (pu) above which it is limited; 0: nowhere
    edge: float = 0.0  # exponent of its current at the limits: 0 of constant power, 1 current, 2 impedance
    V_off: float = 0.0
    """Voltage (pu) below which it switches off: half of it is off there, all of it 0.01 pu below; 0: nowhere."""
    V_off_above: float = 0.0  # the same for voltages above; 0: nowhere

    @property
    def is_impedance(self) -> bool:
        return self.exponents == (2.0, 2.0) and self.V_off == self.V_off_above == 0.0
