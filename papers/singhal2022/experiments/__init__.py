"""Experiments on links that are late, lossy or down: one command each to a figure and a table with theory beside.

An experiment is a sweep of the catalogue, or a scenario with histories, and a function from its rows or histories to
a page and a table. docs/understand/findings.md has the findings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from gridpeers.papers.singhal2022.experiments.experiment_output import ExperimentResult
from gridpeers.papers.singhal2022.experiments.hostile_experiment import hostile
from gridpeers.papers.singhal2022.experiments.link_experiments import delay, loss, places
from gridpeers.papers.singhal2022.experiments.outage_experiments import flapping, partition


@dataclass(frozen=True)
class Experiment:
    make: Callable[[Any], ExperimentResult]
    """Takes `SweepData` of a sweep, `CaseData` of a scenario."""
    sweep: str = ""
    """The sweep of `scenarios/catalogue/sweeps/` whose rows it draws."""
    scenario: str = ""
    """The scenario of `scenarios/catalogue/` whose histories it draws, without a sweep."""


EXPERIMENTS: Mapping[str, Experiment] = {
    "delay": Experiment(delay, sweep="delay"),
    "loss": Experiment(loss, sweep="loss"),
    "places": Experiment(places, sweep="places"),
    "flapping": Experiment(flapping, scenario="flapping"),
    "partition": Experiment(partition, scenario="partition"),
    "hostile": Experiment(hostile, sweep="hostile"),
}
"""In the order of the list."""
