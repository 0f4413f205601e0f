"""The experiments by name: what is run, and what makes a figure and a table of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from scenarios.experiments.communication import communication
from scenarios.experiments.delay import delay
from scenarios.experiments.flapping import flapping
from scenarios.experiments.handling import handling
from scenarios.experiments.loss import loss
from scenarios.experiments.partition import partition
from scenarios.experiments.places import places
from scenarios.experiments.result import Result
from scenarios.experiments.swept import Swept
from scenarios.experiments.told import Told
from scenarios.experiments.topology import topology


@dataclass(frozen=True)
class FromSweep:
    """An experiment on the rows of a sweep."""

    sweep: str
    """Name in `scenarios/catalogue/sweeps/`."""
    make: Callable[[Swept], Result]


@dataclass(frozen=True)
class FromScenario:
    """An experiment on the histories of a scenario's cases."""

    scenario: str
    """Name in `scenarios/catalogue/`."""
    make: Callable[[Told], Result]


EXPERIMENTS: Mapping[str, FromSweep | FromScenario] = {
    "delay": FromSweep("delay", delay),
    "loss": FromSweep("loss", loss),
    "places": FromSweep("places", places),
    "topology": FromSweep("topology-delay", topology),
    "flapping": FromScenario("flapping", flapping),
    "partition": FromScenario("partition", partition),
    "handling": FromSweep("handling", handling),
    "communication": FromSweep("communication-delay", communication),
}
"""In the order of docs/experiments.md."""
