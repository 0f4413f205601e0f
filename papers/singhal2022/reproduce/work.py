"""The parts of the report (parts.toml), run one after the other as `gridpeers run` does, with their figures."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Literal

import msgspec

import gridpeers as gp
from gridpeers import Findings, Verdict, judge, theory
from gridpeers.cli.progress import TellPart
from gridpeers.papers.singhal2022.figures import topologies
from gridpeers.papers.singhal2022.paper_benchmarks import CLAIMS
from gridpeers.papers.singhal2022.reproduce.studies import END_S, Tell, graphs, topology_study
from gridpeers.papers.singhal2022.tables import PaperTable, tables_of


class Picture(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    key: str
    """Its name in claims, and its file's name."""
    title: str
    """Its contents, and the figure of the paper that it reproduces."""
    note: str = ""
    """A hint for the reader, besides the claims."""
    plot: str = ""
    """Name of the figure of the run (`gridpeers.Results.plot`); a study has the one figure."""


class ReportPart(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A part of the reproduction: one experiment, the paper's or ours."""

    name: str
    """Name for `--only`: that of the scenario, or "topology"."""
    title: str
    what: str
    """The course of events, in a sentence or two."""
    picture: tuple[Picture, ...]
    experiment: str = ""
    """Key `paper` of the scenario, by which the paper's tables and claims are found; empty if the part is ours."""
    tables: bool = False
    """True if the paper prints a table of the experiment."""


class ReportSetting(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A setting of ours that the paper does not print."""

    name: str
    value: str
    """Its value with the unit: a format of the tables of the first scenario."""
    why: str
    case: str = ""
    """Case of the part reduced-communication whose gains are shown; without that part the setting is left out."""


class _Parts(msgspec.Struct, forbid_unknown_fields=True):
    part: tuple[ReportPart, ...]
    setting: tuple[ReportSetting, ...]


_READ = msgspec.toml.decode(Path(__file__).with_name("parts.toml").read_bytes(), type=_Parts)
PARTS, SETTINGS = _READ.part, _READ.setting

CHOICES = ("tables", "figures", *(part.name for part in PARTS))  # Values of `--only`


def chosen(only: str | None) -> tuple[ReportPart, ...]:
    """Return the parts that are to be run."""
    if only in (None, "figures"):
        return PARTS
    return tuple(part for part in PARTS if (part.tables if only == "tables" else part.name == only))


TOPOLOGY = "topology"  # The part that is many short runs of the islanding, without a folder for each


@dataclass(frozen=True, kw_only=True)
class PartResult:
    """Findings, verdicts and files of one part."""

    part: ReportPart
    found: Findings
    verdicts: Sequence[Verdict]
    tables: tuple[PaperTable, ...]
    figures: Mapping[Picture, Path]
    """Image of each of its figures that the report shows."""
    sha256: Mapping[str, str]
    """Hash of each case's history.csv, by case."""
    metrics: Any
    """Contents of its metrics.json; None for the topologies."""
    elapsed_s: float
    cpu_s: float
    """Processor time (s) of all its processes."""

    def verdicts_beside(self, figure: str) -> list[Verdict]:
        """Return the verdicts to show below a figure, by its key; "" for those of claims without a shown figure."""
        figured = {picture.key for picture in self.figures}
        shown = [(one.claim.figure if one.claim.figure in figured else "", one) for one in self.verdicts]
        return [verdict for key, verdict in shown if key == figure]


class Work:
    """The runs of some parts, each in `runs/PART` of a folder; the topologies are always run without processes.

    `seed` is in place of the scenarios' own; `jobs` is for the studies of many runs, as of `gridpeers.sweep`.
    """

    def __init__(
        self,
        parts: tuple[ReportPart, ...],
        driver: Literal["processes", "inprocess"],
        folder: Path,
        seed: int | None,
        jobs: int | None,
    ) -> None:
        self.parts, self.driver, self.folder, self.jobs = parts, driver, folder, jobs
        changes = {} if seed is None else {"seed": seed}
        self._loaded = {
            part.name: gp.load("islanding" if part.name == TOPOLOGY else part.name).replace(changes) for part in parts
        }

    @property
    def seed(self) -> int:
        """Seed of the first part; all scenarios of the catalogue have the same."""
        return next(iter(self._loaded.values())).spec.seed

    def specs(self) -> dict[str, theory.ScenarioModel]:
        """Return the keys of the scenario of each part."""
        return {part: scenario.spec for part, scenario in self._loaded.items()}

    @property
    def total_s(self) -> float:
        """Seconds that are simulated in all runs together."""
        return sum(self._length(part) for part in self.parts)

    def do(self, tell: TellPart, *, figures: bool) -> Iterator[PartResult]:
        """Run part after part, telling how many seconds of all runs have been simulated, and draw into `figures/`.

        BrokenRunError if a run broke; those before are done, and their folders stay.
        """
        before = 0.0
        for part in self.parts:
            yield self._part(part, before, tell, figures)
            before += self._length(part)

    def _part(self, part: ReportPart, before: float, tell: TellPart, figures: bool) -> PartResult:
        elapsed, cpu = perf_counter(), sum(os.times()[:4])
        length = self._length(part)
        do = self._topology if part.name == TOPOLOGY else self._scenario
        found, sha256, metrics, plot = do(
            part,
            self.folder / "runs" / part.name,
            lambda run, share: tell(f"{part.name}, {run}", before + share * length),
        )
        pictures = part.picture if figures else ()
        files = [
            gp.figures.save(plot(picture.plot), self.folder / "figures", picture.key, ("png", "pdf", "svg"))
            for picture in pictures
        ]
        return PartResult(
            part=part,
            found=found,
            verdicts=judge(found, CLAIMS[part.experiment]) if part.experiment else (),
            tables=tables_of(part.experiment),
            figures={picture: png for picture, (png, *_) in zip(pictures, files, strict=True)},
            sha256=sha256,
            metrics=metrics,
            elapsed_s=perf_counter() - elapsed,
            cpu_s=sum(os.times()[:4]) - cpu,
        )

    def _length(self, part: ReportPart) -> float:
        """Return the seconds that are simulated in all runs of a part."""
        if part.name == TOPOLOGY:
            return END_S * sum(1 for _ in graphs(9, self.seed))
        scenario = self._loaded[part.name].spec
        return scenario.time.end_s * len(scenario.cases)

    def _scenario(self, part: ReportPart, folder: Path, tell: Tell) -> _PartOutput:
        scenario = self._loaded[part.name]
        order = list(scenario.cases)

        def note(case: str, t: float, end: float) -> None:
            tell(f"case {case}", (order.index(case) + t / end) / len(order))

        run = scenario.run(driver=self.driver, progress=note, folder=folder)
        return run.findings, run.sha256, run.numbers, run.plot

    def _topology(self, part: ReportPart, folder: Path, tell: Tell) -> _PartOutput:
        found = topology_study(self.seed, tell, jobs=self.jobs)
        return found, {}, None, lambda _: topologies(found.graphs)


_PartOutput = tuple[Findings, dict[str, str], Any, Callable[[str], Any]]
"""Findings, hashes by case, metrics, and the function that returns a figure by its name."""
