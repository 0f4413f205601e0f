"""Compare two runs: their scenarios, metrics and histories."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from gridpeers.runs.result import Result, Results, html, shown_in_notebooks
from gridpeers.runs.running import read
from gridpeers.scenarios.schema.scenario_errors import ScenarioError
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.sweep.paths import flatten
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.wording import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RunSource = Result | Results | str | Path  # A result, results of several cases, or the folder of either


def compare(a: RunSource, b: RunSource, *, names: tuple[str, str] = ("a", "b")) -> Comparison:
    """Compare two results or run folders; `names` are two different words for them in tables and figures.

    Runs with several cases are compared in their common cases. Two single cases need no common name.
    """
    if len(names) != 2 or names[0] == names[1]:
        raise ScenarioError([f'names: give two different words, such as ("before", "after"), got {names!r:.60}'])
    first, second = map(_cases_of, (a, b))
    if len(first) == len(second) == 1:
        return Comparison({"": (*first.values(), *second.values())}, names)  # type: ignore[dict-item]
    both = [case for case in first if case in second]
    if not both:
        cases = f"the first has {', '.join(first)}, the second {', '.join(second)}"
        ways = f"run one case of each ({command_line('run')} --case), or choose in Python: "
        ways += f'gridpeers.compare(a["{next(iter(first))}"], b["{next(iter(second))}"])'
        raise ScenarioError([f"the runs share no case: {cases}; {ways}"])
    return Comparison({case: (first[case], second[case]) for case in both}, names)


def _cases_of(run: RunSource) -> Mapping[str, Result]:
    run = read(run) if isinstance(run, str | Path) else run
    if not isinstance(run, Result | Results):
        raise ScenarioError([f"compare: needs results or folders of runs, got {run!r:.60}"])
    return {run.case: run} if isinstance(run, Result) else run


class Comparison:
    """Two runs side by side; `gridpeers.compare` returns it."""

    def __init__(self, pairs: dict[str, tuple[Result, Result]], names: tuple[str, str]) -> None:
        self._pairs = pairs
        self.names = names
        """Words for the two runs."""

    @cached_property
    def table(self) -> pd.DataFrame:
        """Metrics of both runs and their difference (second minus first): a row per (window, metric) or (case, ...).

        Sharing indices have no value in a window with several islands; `Result.islands` has those of each island.
        """
        frames = {case: _table(*pair, self.names) for case, pair in self._pairs.items()}
        if list(frames) == [""]:
            return frames[""]
        table = pd.concat(frames, names=["case"])
        table.attrs["units"] = next(iter(frames.values())).attrs["units"]
        return table

    @cached_property
    def changes(self) -> pd.DataFrame:
        """Keys of the scenarios that differ, with both values; empty where a scenario lacks the key."""
        first, second = (_keys(pair) for pair in zip(*self._pairs.values(), strict=True))
        keys = [key for key in dict.fromkeys((*first, *second)) if first.get(key) != second.get(key)]
        rows = {key: [str(of.get(key, "")) for of in (first, second)] for key in keys}
        return pd.DataFrame.from_dict(rows, orient="index", columns=list(self.names)).rename_axis("key")

    @property
    def same(self) -> bool:
        """Whether the histories are equal, byte by byte."""
        return all(first.sha256 == second.sha256 for first, second in self._pairs.values())

    def plot(self) -> Figure:
        """Draw f, MPSI, V and MQSI of both runs, case by case."""
        from gridpeers.scenarios.results.plots.run_figures import comparison

        shown_in_notebooks()
        named = {case: zip(self.names, pair, strict=True) for case, pair in self._pairs.items()}
        return comparison([(case, {name: run.drawing() for name, run in runs}) for case, runs in named.items()])

    def __str__(self) -> str:
        """Return the text that the command `gridpeers compare` prints."""
        changes = self.changes.to_string() if len(self.changes) else "The scenarios are the same."
        table = self.table.to_string(float_format=lambda value: f"{value:.5g}", na_rep="-")
        verdict = "The histories are the same, byte by byte." if self.same else "The histories differ."
        return "\n\n".join((*self.failures(), changes, table, verdict))

    def failures(self) -> Iterator[str]:
        """Yield a line for each run with a failed law, whose numbers are those of droop."""
        for case, pair in self._pairs.items():
            for name, run in zip(self.names, pair, strict=True):
                if len(failed := run.failures):
                    yield f"FAILED  {name}, case {case or run.case}: {failed['agent'][0]}: {failed['why'][0]}"

    def _repr_html_(self) -> str:
        return html(repr(self), self.plot(), self.changes, self.table)

    def __repr__(self) -> str:
        return f"<Comparison of {' and '.join(self.names)}: {counted(len(self._pairs), 'case')}>"


def _table(a: Result, b: Result, names: tuple[str, str]) -> pd.DataFrame:
    columns = [run.metrics.drop(columns="reasons").stack(future_stack=True) for run in (a, b)]
    frame = pd.concat(columns, axis=1, keys=names, sort=False).rename_axis(["window", "metric"])
    frame["difference"] = frame[names[1]] - frame[names[0]]
    frame.attrs["units"] = dict(a.metrics.attrs["units"])
    return frame


def _keys(runs: tuple[Result, ...]) -> dict[str, Any]:
    spec = runs[0].spec
    tables = tomllib.loads(to_toml(spec, {}))
    tables.pop("as_run", None)
    cases = tables.pop("case")
    tables["case"] = cases[runs[0].case] if len(runs) == 1 else {run.case: cases[run.case] for run in runs}
    return dict(flatten(tables))
