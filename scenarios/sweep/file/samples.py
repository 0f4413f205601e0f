"""Every sample's scenario, checked before anything starts; a problem is noted once, with its samples."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.loading import check_tables
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.sweep.file.axes import Setting
from gridpeers.scenarios.sweep.file.paths import PathError, Tree, put
from gridpeers.scenarios.sweep.file.plan import Run

MOST_LISTED = 20
"""Most problems of samples in a message: the rest is more of the same."""


class BaseScenario(NamedTuple):
    """The scenario that is varied."""

    tree: Tree
    """Its tables."""
    path: Path
    """Its file: relative paths start there."""
    scenario: ScenarioModel
    """Checked."""
    feeder: Feeder
    """Its feeder."""


class _SampleProblems(Problems):
    """Problems of one sample, by key."""

    def __init__(self) -> None:
        super().__init__("")
        self.noted: list[tuple[str, str]] = []

    def add(self, path: str, text: str) -> None:
        super().add(path, text)
        self.noted.append((path, text))

    def add_plain(self, text: str) -> None:
        super().add_plain(text)
        self.noted.append(("", text))


def checked_runs(
    base: BaseScenario,
    fixed: Mapping[str, Any],
    settings: Sequence[Setting],
    cases: Sequence[str],
    origin: Mapping[str, str],
    problems: Problems,
) -> tuple[list[Run], Sequence[Feeder]]:
    """Check every sample, and return its runs and all feeders; both are of use only when no problem is noted.

    Parameters
    ----------
    base : BaseScenario
        The scenario that is varied.
    fixed : Mapping[str, Any]
        Keys that are set in every sample, by path.
    settings : Sequence[Setting]
        The samples.
    cases : Sequence[str]
        Cases that are run.
    origin : Mapping[str, str]
        Key of the sweep file by key of the scenario.
    problems : Problems
        Takes the problems, each at the key of the sweep file that it comes from.
    """
    runs: list[Run] = []
    feeders: dict[tuple[str, str], Feeder] = {}
    wrong: dict[tuple[str, str], list[int]] = {}
    reader = lru_cache(maxsize=None)(read_feeder)
    for i, setting in enumerate(settings):
        tree, noted = copy.deepcopy(base.tree), _SampleProblems()
        for path, value in {**fixed, **setting.put}.items():
            try:
                put(tree, path, copy.deepcopy(value))
            except PathError as error:
                noted.add(path, str(error))
        scenario, feeder = check_tables(tree, base.path, noted, reader)
        if not scenario.events and not noted.touch("event"):
            noted.add("event", "the scenario has no [[event]], and only what follows an event is measured; write one")
        for problem in noted.noted:
            wrong.setdefault(problem, []).append(i)
        if not noted.noted and feeder is not None:
            feeders[scenario.plant.feeder, scenario.plant.load_set] = feeder
            chosen = msgspec.structs.replace(scenario, cases={case: scenario.cases[case] for case in cases})
            runs += [Run(i, case, chosen, setting.shown) for case in cases]
    for (path, text), numbers in list(wrong.items())[:MOST_LISTED]:
        at = _origin(path, origin)
        inside = f"{path}: " if path and not at.endswith(path) else ""
        problems.add(at, inside + text + _in_samples(numbers, settings))
    if len(wrong) > MOST_LISTED:
        problems.add("", f"and {len(wrong) - MOST_LISTED} more problems of this kind in other samples")
    return runs, tuple(feeders.values())


def _origin(path: str, origin: Mapping[str, str]) -> str:
    """Return the key of the sweep file that a key of the scenario was set by, or a table around it."""
    around = [key for key in origin if path == key or path.startswith((f"{key}.", f"{key}["))]
    return origin[max(around, key=len)] if around else path


def _in_samples(numbers: Sequence[int], settings: Sequence[Setting]) -> str:
    """Return which samples a problem is in, with the values of the first."""
    count = len(settings)
    if len(numbers) == count:
        return f" (in all {count} samples)" if count > 1 else ""
    values = settings[numbers[0]].shown
    listed = ", ".join(f"{key} = {json.dumps(value)}" for key, value in values.items() if key != "graph.edges")
    more = f"; and in {len(numbers) - 1} more of {count}" if len(numbers) > 1 else ""
    return f" (sample {numbers[0]}: {listed}{more})"
