"""All parts one after the other: each is run as `gridpeers run` does, its folder kept, its figures taken from there."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Any

from msgspec.structs import replace

from gridpeers.benchmarks import Findings, judge
from gridpeers.folders import new_folder
from gridpeers.theory import Feeder
from papers.singhal2022.benchmarks import ISLANDING
from papers.singhal2022.claims import CLAIMS
from papers.singhal2022.reproduce import banks, topology
from papers.singhal2022.reproduce.found import Result
from papers.singhal2022.reproduce.parts import Part
from papers.singhal2022.tables import tables_of
from scenarios.run import Driver, Request, run
from scenarios.spec import Scenario, load_scenario

Tell = Callable[[str, float], None]
"""Told what is being done, and how much of all is done."""


class Work:
    """The runs of some parts.

    Parameters
    ----------
    parts : tuple[Part, ...]
        What to run.
    driver : Driver
        How; the topologies are always run without processes.
    folder : Path
        Takes the runs' folders.
    seed : int or None
        In place of the scenarios' own.
    jobs : int
        Runs of the topologies at a time.
    """

    def __init__(self, parts: tuple[Part, ...], driver: Driver, folder: Path, seed: int | None, jobs: int) -> None:
        self.parts, self.driver, self.folder, self.jobs = parts, driver, folder, jobs
        self._loaded: dict[str, tuple[Scenario, Feeder]] = {}
        for part in parts:
            scenario, feeder = load_scenario("islanding" if part.name in _STUDIES else part.name)
            self._loaded[part.name] = (scenario if seed is None else replace(scenario, seed=seed)), feeder
        self._before = 0.0

    @property
    def seed(self) -> int:
        """Seed of the first part; all scenarios of the catalogue have the same."""
        return next(iter(self._loaded.values()))[0].seed

    def scenario(self, part: str) -> Scenario:
        """Scenario of a part."""
        return self._loaded[part][0]

    @property
    def total_s(self) -> float:
        """Seconds that are simulated in all runs together."""
        return sum(self._length(part) for part in self.parts)

    def do(self, tell: Tell, *, figures: bool) -> Iterator[Result]:
        """Run part after part, telling how many seconds of all runs have been simulated.

        Raises
        ------
        BrokenRunError
            If a run broke; those before are done, and their folders stay.
        """
        for part in self.parts:
            with _timed() as took:
                do = {"topology": self._topology, "var-sharing": self._banks}.get(part.name, self._scenario)
                found, sha256, metrics, plots = do(part, tell)
            self._before += self._length(part)
            yield Result(
                part=part,
                found=found,
                verdicts=judge(found, CLAIMS[part.experiment]) if part.experiment else (),
                tables=tables_of(part.experiment),
                figures={picture: plots / picture.file for picture in part.pictures} if figures else {},
                sha256=sha256,
                metrics=metrics,
                wall_s=took["wall"],
                cpu_s=took["cpu"],
            )

    def _length(self, part: Part) -> float:
        if part.name == "topology":
            return topology.END_S * sum(1 for _ in topology.graphs(9, self.seed))
        scenario = self.scenario(part.name)
        if part.name == "var-sharing":
            return scenario.time.end_s * len(banks.BANKS) * len(banks.CASES)
        return scenario.time.end_s * len(scenario.cases)

    def _scenario(self, part: Part, tell: Tell) -> _Done:
        scenario, feeder = self._loaded[part.name]
        folder = new_folder(self.folder / part.name, scenario.name, _never)
        order = list(scenario.cases)

        def note(case: str, t: float, end: float) -> None:
            tell(f"{part.name}, case {case}", self._before + order.index(case) * end + t)

        report = run(Request(scenario=scenario, feeder=feeder, driver=self.driver, folder=folder), note)
        metrics = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
        sha256 = {case: values["history_sha256"] for case, values in metrics["cases"].items()}
        return report.found, sha256, metrics, folder / "plots"

    def _topology(self, part: Part, tell: Tell) -> _Done:
        folder = new_folder(self.folder / part.name, part.name, _never)

        def note(done: int, of: int) -> None:
            tell(f"topology, {done} of {of} graphs", self._before + done * topology.END_S)

        found = topology.study(self.seed, note, jobs=self.jobs)

        from gridpeers.figures import save
        from papers.singhal2022.figures.topologies import (
            topologies,  # matplotlib takes longer to import than a case to run
        )

        save(topologies(found.graphs), folder, Path(part.pictures[0].file).stem)
        return found, {}, None, folder

    def _banks(self, part: Part, tell: Tell) -> _Done:
        folder = new_folder(self.folder / part.name, part.name, _never)
        scenario = self.scenario(part.name)

        def note(done: int, of: int) -> None:
            tell(f"{part.name}, {done} of {of} runs", self._before + done * scenario.time.end_s)

        runs = banks.study(scenario, folder, note, self.jobs)
        paper: dict[tuple[str, str], float] = {}
        ours: dict[str, dict[tuple[str, str], float]] = {}
        for one in runs:
            for event in banks.EVENTS:
                cell = ISLANDING.number(one.case, event, "MQSI")
                assert cell is not None
                paper[one.case, event] = cell.paper
                ours.setdefault(one.variant, {})[one.case, event] = one.MQSI[event]

        from gridpeers.figures import save
        from papers.singhal2022.figures.var_sharing import var_sharing  # as above

        save(var_sharing(paper, ours, banks.CASES, banks.EVENTS), folder, Path(part.pictures[0].file).stem)
        told = [{"variant": one.variant, "case": one.case, "MQSI": dict(one.MQSI)} for one in runs]
        return Findings(results={}), {}, told, folder


_Done = tuple[Findings, dict[str, str], Any, Path]
"""What was found, hashes by case, metrics, and the folder of the figures."""

_STUDIES = ("topology", "var-sharing")
"""Parts that are many short runs of the islanding, without a folder for each."""


@contextmanager
def _timed() -> Iterator[dict[str, float]]:
    """Wall time and processor time (s) of what is done inside, by this process and those that ended meanwhile."""
    took: dict[str, float] = {}
    wall, cpu = perf_counter(), sum(os.times()[:4])
    yield took
    took["wall"], took["cpu"] = perf_counter() - wall, sum(os.times()[:4]) - cpu


_never: Any = None
"""No time is needed for the name of a folder that is given."""
