"""The report's files: report.html, one page that holds its images; report.md with its figures; metrics.json."""

from __future__ import annotations

import base64
import os
import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from gridpeers import Verdict, theory
from gridpeers.measures import HEADINGS
from gridpeers.output_folders import set_status, versions, write_whole
from gridpeers.papers.singhal2022.communication_claims import graph_runs
from gridpeers.papers.singhal2022.paper_benchmarks import ComparedNumber, headline, numbers
from gridpeers.papers.singhal2022.reproduce.work import SETTINGS, PartResult, Work
from gridpeers.papers.singhal2022.tables import MQSI_FACTOR, V_RELATIVE, Cell, PaperTable


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """All contents of the report."""

    results: tuple[PartResult, ...]
    driver: str
    seed: int
    started: str
    """Date and time."""

    @property
    def verdicts(self) -> list[Verdict]:
        return [verdict for result in self.results for verdict in result.verdicts]

    @property
    def numbers(self) -> list[ComparedNumber]:
        return [number for result in self.results for number in numbers(result.found, result.tables)]

    @property
    def failed(self) -> bool:
        """True if a claim failed without a known reason. A number beyond its tolerance fails its column's claim."""
        return self.counts()["FAIL"] > 0

    def counts(self) -> dict[str, int]:
        """Return the number of claims by status."""
        statuses = [verdict.status for verdict in self.verdicts]
        return {status: statuses.count(status) for status in dict.fromkeys(("PASS", "FAIL", "MISS", *statuses))}

    @property
    def claims(self) -> str:
        """The number of claims that hold, in words."""
        counts = self.counts()
        held, missed, failed = (counts[status] for status in ("PASS", "MISS", "FAIL"))
        known = f"{missed} known deviation{'s' * (missed != 1)}"
        return f"{held} of {len(self.verdicts)} claims hold, {known}, {failed} failed."

    @property
    def took(self) -> str:
        elapsed, cpu = sum(result.elapsed_s for result in self.results), sum(result.cpu_s for result in self.results)
        return f"{elapsed:.0f} s, {cpu:.0f} s of processor time"


def settings(scenarios: Mapping[str, theory.ScenarioModel]) -> list[tuple[str, str, str]]:
    """Return each setting, its value with the unit, and its reason, for the scenarios of a report by their part."""
    first, reduced = next(iter(scenarios.values())), scenarios.get("reduced-communication")
    sets: dict[str, list[str]] = {}
    for name, scenario in scenarios.items():
        sets.setdefault(scenario.plant.load_set, []).append(name)
    load_sets = "; ".join(f'"{load_set}" in {", ".join(names)}' for load_set, names in sets.items())
    rows = []
    for one in SETTINGS:
        if one.case and reduced is None:
            continue
        gains = reduced.cases[one.case].gains if one.case and reduced else first.gains
        value = one.value.format(gains=gains, plant=first.plant, time=first.time, load_sets=load_sets)
        rows.append((one.name, value, one.why))
    return rows


class TableEntry(NamedTuple):
    """One number beside the paper's."""

    paper: str
    ours: str
    """With a digit more than the paper prints."""
    off: str
    """Ours less the paper's."""
    judged: tuple[tuple[str, bool], ...]
    """Every judgement: its measure, "" for the tolerance of its table, and whether it passes."""


_CASES = {"I": "no control", "II": "un-coordinated", "III": "GFM-coordinated", "IV": "fully coordinated"}


def lines(table: PaperTable, result: PartResult) -> dict[str, list[TableEntry]]:
    """Return the rows of a table by their case or island and event, in the paper's order."""
    rows: dict[str, list[TableEntry]] = {}
    for cell in table.cells:
        what = f"island of {cell.island}" if cell.island else f"{cell.case} {_CASES.get(cell.case, '')}".rstrip()
        label = f"{what}, {cell.event}" if len(table.events) > 1 else what
        rows.setdefault(label, []).append(_entry(cell, result))
    return rows


def tolerances(table: PaperTable) -> list[str]:
    """Return the tolerance of each column, and its reason."""
    found = []
    for quantity in table.quantities:
        cell = next(cell for cell in table.cells if cell.quantity == quantity)
        value = cell.tolerance.value
        bound = f"only compared by a factor of {MQSI_FACTOR:g}" if value is None else f"within {value:g}"
        found.append(f"{HEADINGS[quantity]}: {bound}; {cell.tolerance.reason}")
        if cell.relative is not None:
            own_size = f"{100 * V_RELATIVE:g} % of the paper's number, or half of its last digit"
            found.append(f"{HEADINGS[quantity]}, in proportion: {own_size}")
    return found


def _entry(cell: Cell, result: PartResult) -> TableEntry:
    reason = result.found.reason(cell)
    ours = float("nan") if reason else result.found.value(cell)
    digits, paper = cell.digits + 1, f"{cell.paper:.{cell.digits}f}"
    by = {
        "": cell.within(ours),
        f"{100 * V_RELATIVE:g} %": cell.within_relative(ours),
        f"factor {MQSI_FACTOR:g}": cell.within_factor(ours),
    }
    judged = tuple((name, holds) for name, holds in by.items() if holds is not None)
    if reason:
        return TableEntry(paper, reason.partition(":")[0], "-", judged)
    off = round(ours - cell.paper, digits) + 0.0  # no "-0.000"
    times = f" ({ours / cell.paper:.2g} times)" if cell.tolerance.value is None else ""
    return TableEntry(paper, f"{ours:.{digits}f}", f"{off:+.{digits}f}{times}", judged)


PAPER = (
    "Singhal, Vu, Du: Consensus Control for Coordinating Grid-Forming and Grid-Following Inverters in Microgrids. "
    "IEEE Transactions on Smart Grid, 2022"
)

_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent),
    autoescape=lambda name: name is not None and name.startswith("report.html"),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
_TEMPLATES.filters["base64"] = lambda path: base64.b64encode(path.read_bytes()).decode("ascii")
_TEMPLATES.globals |= {
    "paper": PAPER,
    "headings": HEADINGS,
    "headline": headline,
    "lines": lines,
    "tolerances": tolerances,
}


def render(template: str, whole: Reproduction, settings: Sequence[tuple[str, str, str]]) -> str:
    """Return the text of a report from its template in this folder; `settings`: those that the paper does not print."""
    data = {"whole": whole, "settings": settings, "machine": machine(), "versions": versions()}
    return _TEMPLATES.get_template(template).render(data)


def write(whole: Reproduction, work: Work, folder: Path) -> None:
    """Write the texts of a reproduction into the report's folder, which has the figures."""
    ours = settings(work.specs())
    for name in ("report.html", "report.md"):
        write_whole(folder / name, render(f"{name}.jinja", whole, ours))
    write_whole(folder / "metrics.json", metrics_json(whole))
    set_status(folder, "complete")


def machine() -> str:
    """Return processor, its cores that may be used, memory and system."""
    cpu = platform.processor() or platform.machine()
    with suppress(OSError, StopIteration):
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        cpu = next(line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name"))
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1  # not on macOS
    return f"{cpu}, {cores} core{'s' if cores > 1 else ''}; {platform.system()} {platform.release()}"


def metrics_json(whole: Reproduction) -> str:
    """Return the text of metrics.json: every number of the tables beside the paper's, every verdict, every measure."""
    claims = [
        {
            "part": result.part.name,
            "claim": verdict.claim.name,
            "text": verdict.claim.text,
            "source": verdict.claim.source,
            "status": verdict.status,
            "found": verdict.found,
            "reason": verdict.claim.known_miss if verdict.status == "MISS" else "",
        }
        for result in whole.results
        for verdict in result.verdicts
    ]
    topology = [
        {"links": run.links, "connected": run.connected}
        | asdict(run.settled)
        | {"MPSI": run.steady.MPSI, "f_error_Hz": run.steady.f_error_Hz}
        for result in whole.results
        for run in graph_runs(result.found)
    ]
    document = {
        "driver": whole.driver,
        "seed": whole.seed,
        "started": whole.started,
        "machine": machine(),
        "versions": versions(),
        "times_s": {result.part.name: {"wall": result.elapsed_s, "cpu": result.cpu_s} for result in whole.results},
        "tables": [
            _number(result, cell) for result in whole.results for table in result.tables for cell in table.cells
        ],
        "claims": claims,
        "runs": {result.part.name: result.metrics for result in whole.results if result.metrics},
        "topology": topology,
    }
    text = msgspec.json.encode(document, enc_hook=float)  # of numpy's numbers; nan becomes null
    return msgspec.json.format(text, indent=2).decode() + "\n"


def _number(result: PartResult, cell: Cell) -> dict[str, Any]:
    """Return a number beside the paper's; null where ours is not steady."""
    reason = result.found.reason(cell)
    ours = None if reason else result.found.value(cell)
    named = {name: getattr(cell, name) for name in ("table", "case", "event", "island", "quantity", "paper")}
    return {
        **named,
        "ours": ours,
        **({"reason": reason} if reason else {}),
        "tolerance": cell.tolerance.value,
        "within": result.found.within(cell),
        "within_relative": None if ours is None else cell.within_relative(ours),
        "within_factor": None if ours is None else cell.within_factor(ours),
    }
