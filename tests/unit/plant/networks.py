"""Feeders and switch states that the tests of the network share."""

from __future__ import annotations

from typing import Any

from gridpeers.plant.equipment import Bus, Tables
from gridpeers.plant.network import Network

PAPER_ISLANDS = ("13-152", "sw1_2", "sw2_3")  # Switches whose opening leaves three microgrids


def opened(network: Network, *switches: str) -> frozenset[str]:
    """Switches that are still closed after opening some of the first ones."""
    return network.closed0 - {network.switch_name(text) for text in switches}


def zones(network: Network, *names: str) -> frozenset[str]:
    return frozenset(bus.name for bus in network.feeder.buses if bus.zone in names)


def feeder(**tables: Any) -> Tables:
    """A feeder of which only some tables have rows."""
    empty: dict[str, Any] = dict.fromkeys(("lines", "line_configs", "switches", "loads", "capacitors"), ())
    empty |= dict.fromkeys(("regulators", "transformers", "inverters"), ())
    return Tables(name="test", load_set="test", **(empty | {"source": None} | tables))


def three_phase_bus(name: str, V_nom: float = 2400.0) -> Bus:
    return Bus(name=name, phases="ABC", V_nom=V_nom)


def diagonal(value: Any) -> Any:
    """Matrix of a line configuration whose phases do not couple."""
    return tuple(tuple(value * (row == column) for column in range(3)) for row in range(3))
