"""The plan of a sweep: every run of it, checked, in order."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.schema import ScenarioModel


@dataclass(frozen=True)
class Run:
    """One case of one sample."""

    sample: int
    """Number of the sample, from 0, in the order of the axes."""
    case: str
    """Case that is run."""
    scenario: ScenarioModel
    """The sample's scenario, checked."""
    shown: Mapping[str, Any]
    """The sample's value of each parameter."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A checked sweep."""

    name: str
    """Name of the results' folder."""
    title: str
    """One line on the study."""
    text: str
    """The sweep file."""
    base: ScenarioModel
    """The scenario as it is without the sweep."""
    runs: Sequence[Run]
    """All runs: sample by sample, case by case."""
    fingerprint: str
    """SHA-256 of everything that decides the runs: scenarios, feeders, order. Two sweeps with one are the same."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Columns of the varied keys, in the order of the file."""
        return tuple(self.runs[0].shown)


def fingerprint(runs: Iterable[Run], feeders: Iterable[Feeder]) -> str:
    """Return the hash of runs and feeders; comments and layout of the files do not change it."""
    whole = hashlib.sha256()
    for run in runs:
        whole.update(msgspec.json.encode((run.sample, run.case, run.scenario, dict(run.shown))))
    for text in sorted(map(repr, feeders)):
        whole.update(text.encode())
    return whole.hexdigest()
