"""Every sample's scenario, checked before anything starts; what is wrong is told once, with the samples it is in."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec

from plant.equipment import Feeder
from plant.tables import read_feeder
from scenarios.schema import Scenario
from scenarios.schema.loading import check_tables
from scenarios.schema.scenario_errors import Problems
from scenarios.sweep.file.axes import Setting
from scenarios.sweep.file.paths import PathError, Tree, put, steps
from scenarios.sweep.file.plan import Run

MOST_TOLD = 20
"""Most problems of samples that are told: the rest is more of the same."""


class _Noted(Problems):
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


class Samples:
    """Makes the runs of a sweep from its base and its settings.

    Parameters
    ----------
    tree : dict
        Tables of the base scenario.
    path : Path
        Its file.
    fixed : Mapping[str, Any]
        Keys that are set in every sample.
    cases : Sequence[str]
        Cases that are run.
    """

    def __init__(self, tree: Tree, path: Path, fixed: Mapping[str, Any], cases: Sequence[str]) -> None:
        self._tree, self._path, self._fixed, self._cases = tree, path, fixed, cases
        self._wrong: dict[tuple[str, str], list[tuple[int, Mapping[str, Any]]]] = {}
        self.feeders: dict[tuple[str, str], Feeder] = {}
        """Every feeder that is used, by name and load set."""

    def runs(self, settings: Iterable[Setting]) -> list[Run]:
        """Check every sample and make its runs; of use only when nothing was noted."""
        reader = lru_cache(maxsize=None)(read_feeder)
        made = []
        for i, setting in enumerate(settings):
            scenario = self._checked(i, setting, reader)
            if scenario is not None:
                made += [Run(i, case, scenario, setting.shown) for case in scenario.cases]
        return made

    def tell(self, origin: Mapping[str, str], problems: Problems, count: int) -> None:
        """Note everything that is wrong at the key of the sweep file that it comes from.

        Parameters
        ----------
        origin : Mapping[str, str]
            Key of the sweep file by key of the scenario.
        problems : Problems
            Those of the sweep file.
        count : int
            How many samples were checked.
        """
        for (path, text), where in list(self._wrong.items())[:MOST_TOLD]:
            at = _origin(path, origin)
            inside = f"{path}: " if path and not at.endswith(path) else ""
            problems.add(at, inside + text + _in_samples(where, count))
        if len(self._wrong) > MOST_TOLD:
            problems.add("", f"and {len(self._wrong) - MOST_TOLD} more problems of this kind in other samples")

    def _checked(self, i: int, setting: Setting, reader: Any) -> Scenario | None:
        tree, noted = copy.deepcopy(self._tree), _Noted()
        for path, value in {**self._fixed, **setting.put}.items():
            try:
                put(tree, path, copy.deepcopy(value))
            except PathError as error:
                noted.add(path, str(error))
        scenario, feeder = check_tables(tree, self._path, noted, reader)
        if not scenario.events and not noted.touch("event"):
            noted.add("event", "the scenario has no [[event]], and only what follows an event is measured; write one")
        for path, text in noted.noted:
            self._wrong.setdefault((path, text), []).append((i, setting.shown))
        if noted.noted or feeder is None:
            return None
        self.feeders[scenario.plant.feeder, scenario.plant.load_set] = feeder
        return msgspec.structs.replace(scenario, cases={case: scenario.cases[case] for case in self._cases})


def _origin(path: str, origin: Mapping[str, str]) -> str:
    """Key of the sweep file that a key of the scenario was set by, or by which a table around it was."""
    try:
        way = steps(path) if path else []
    except PathError:
        return origin.get(path, path)
    best = max((key for key in origin if _begins(way, key)), key=lambda key: len(steps(key)), default=None)
    return path if best is None else origin[best]


def _begins(way: list[str | int], key: str) -> bool:
    try:
        head = steps(key)
    except PathError:
        return False
    return way[: len(head)] == head


def _in_samples(where: Sequence[tuple[int, Mapping[str, Any]]], count: int) -> str:
    """Which samples a problem is in, with the values of the first."""
    if len(where) == count:
        return f" (in all {count} samples)" if count > 1 else ""
    number, values = where[0]
    listed = ", ".join(f"{key} = {json.dumps(value)}" for key, value in values.items() if key != "graph.edges")
    more = f"; and in {len(where) - 1} more of {count}" if len(where) > 1 else ""
    return f" (sample {number}: {listed}{more})"
