"""Experiments on links that are late, lossy or down: one command each to a figure and a table with theory beside.

An experiment is a sweep of the catalogue, or a scenario with histories, and a function from its rows or histories to
a page and a table. docs/experiments.md tells what was found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gridpeers.papers.singhal2022.experiments.degraded_communication_experiment import degraded_communication
from gridpeers.papers.singhal2022.experiments.experiment_data import CaseData, SweepData
from gridpeers.papers.singhal2022.experiments.experiment_output import ExperimentResult
from gridpeers.papers.singhal2022.experiments.hostile_experiment import hostile
from gridpeers.papers.singhal2022.experiments.link_experiments import communication, delay, loss, places, topology
from gridpeers.papers.singhal2022.experiments.outage_experiments import flapping, partition


@dataclass(frozen=True)
class FromSweep:
    """An experiment on the rows of a sweep of `scenarios/catalogue/sweeps/`."""

    sweep: str
    make: Callable[[SweepData], ExperimentResult]


@dataclass(frozen=True)
class FromScenario:
    """An experiment on the histories of the cases of a scenario of `scenarios/catalogue/`."""

    scenario: str
    make: Callable[[CaseData], ExperimentResult]


EXPERIMENTS: Mapping[str, FromSweep | FromScenario] = {
    "delay": FromSweep("delay", delay),
    "loss": FromSweep("loss", loss),
    "places": FromSweep("places", places),
    "topology": FromSweep("topology-delay", topology),
    "flapping": FromScenario("flapping", flapping),
    "partition": FromScenario("partition", partition),
    "degraded-communication": FromSweep("degraded-communication", degraded_communication),
    "communication": FromSweep("communication-delay", communication),
    "hostile": FromSweep("hostile", hostile),
}
"""In the order of docs/experiments.md."""
