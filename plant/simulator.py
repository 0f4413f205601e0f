"""Names of what can simulate the plant, without other imports: the command line offers them."""

from typing import Literal

OwnSimulator = Literal["gridpeers", "gridlabd"]
"""A simulator that the run starts itself: our own plant, or GridLAB-D (docs/plant.md)."""

Simulator = Literal[OwnSimulator, "helics"]
"""The same, or a federate of a HELICS co-simulation (docs/helics.md)."""
