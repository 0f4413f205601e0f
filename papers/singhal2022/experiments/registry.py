"""The experiments by name: what is run, and what makes a figure and a table of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from papers.singhal2022.experiments.communication import communication
from papers.singhal2022.experiments.data.swept import Swept
from papers.singhal2022.experiments.data.told import Told
from papers.singhal2022.experiments.delay import delay
from papers.singhal2022.experiments.flapping import flapping
from papers.singhal2022.experiments.handling import handling
from papers.singhal2022.experiments.loss import loss
from papers.singhal2022.experiments.output.result import Result
from papers.singhal2022.experiments.partition import partition
from papers.singhal2022.experiments.places import places
from papers.singhal2022.experiments.topology import topology


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
