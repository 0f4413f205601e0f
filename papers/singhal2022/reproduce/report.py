"""The report's files: report.html, one page that holds its images; report.md with its figures; metrics.json."""

from __future__ import annotations

import base64
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from gridpeers.benchmarks import HEADINGS, Quantity
from gridpeers.output_folders import set_status, versions, write_whole
from gridpeers.papers.singhal2022.paper_benchmarks import headline
from gridpeers.papers.singhal2022.reproduce.reproduction import PartResult, Reproduction, machine, metrics_json
from gridpeers.papers.singhal2022.reproduce.work import FORMATS, Work
from gridpeers.papers.singhal2022.tables import MQSI_FACTOR, V_RELATIVE, Cell, PaperTable
from gridpeers.theory import ScenarioModel


def settings(scenarios: dict[str, ScenarioModel]) -> list[tuple[str, str, str]]:
    """Return each setting, its value with the unit, and its reason, for the scenarios of a report by their part."""
    first = next(iter(scenarios.values()))
    gains, time, gfm, gfl = first.gains, first.time, first.plant.gfm, first.plant.gfl
    sets: dict[str, list[str]] = {}
    for name, scenario in scenarios.items():
        sets.setdefault(scenario.plant.load_set, []).append(name)
    rows = [
        (
            "places of inverters, capacitors, loads",
            f"feeder {first.plant.feeder}",
            "the paper names the IEEE 123-node feeder, but not the buses; plant/data/README.md tells ours",
        ),
        (
            "load set",
            "; ".join(f'"{load_set}" in {", ".join(names)}' for load_set, names in sets.items()),
            '"event2" drops 1.35 MW at event 2; 0.14 and 0.07 Hz of Table I together imply 1.365 MW; "main" lets '
            "each microgrid stand alone",
        ),
        ("first P_set", f"{first.plant.P_set0_pu:g} pu", "follows from Table I by algebra: 0.65 pu on every unit"),
        (
            "control period T_c",
            f"{time.T_c_s:g} s",
            "f, MPSI and V_error do not depend on it, MQSI and speed do: docs/reproduction.md has 5 to 100 ms",
        ),
        ("k_p", f"{gains.k_p:g} s", 'm_p / k_p = 14 1/s: the speed that "in less than 1 s" asks for'),
        (
            "k_q, alpha, beta",
            f"{gains.k_q:g}, {gains.alpha:g}, {gains.beta_GFM:g}",
            "the simplest choice that settles vars within some seconds; the paper's (14) has no weight",
        ),
        (
            "limits of P_set",
            f"{gains.P_set_min:g} to {gains.P_set_max:g} pu",
            "the paper has none and accepts wind-up (Remark 2); they act below 200 kW only, see wind-up",
        ),
        (
            "filters",
            f"GFM {gfm.R_f:g} + j{gfm.X_f:g} pu, GFL {gfl.R_f:g} + j{gfl.X_f:g} pu",
            "usual values of GridLAB-D's models",
        ),
        ("limit of the GFM", f"{gfm.P_max:g} pu", "follows from the 0.08 Hz of cases II and III in Table I"),
        (
            "apparent power of the GFL",
            f"{gfl.S_max:g} pu",
            "at 1.0 pu nothing would be left for vars above 0.95 pu of real power",
        ),
        (
            "lags of the GFL",
            f"P {gfl.T_pf:g} s, Q {gfl.T_qf:g} s, V {gfl.T_vf:g} s, f {gfl.T_ff:g} s",
            "GridLAB-D's defaults for P are too slow for consensus within 1 s",
        ),
    ]
    reduced = scenarios.get("reduced-communication")
    if reduced is not None:
        own = reduced.cases["reduced"].gains
        rows.append(
            (
                "re-tuned alpha, beta",
                f"{own.alpha:g}, {own.beta_GFM:g}",
                "the best of a grid of 30 points by a rule fixed before (docs/reproduction.md)",
            )
        )
    return rows


class Entry(NamedTuple):
    """One number beside the paper's."""

    paper: str
    ours: str
    """With a digit more than the paper prints."""
    off: str
    """Ours less the paper's."""
    judged: tuple[tuple[str, bool], ...]
    """Every judgement: its measure, "" for the tolerance of its table, and whether it passes."""


class GridRow(NamedTuple):
    """One row: a case (or an island) after one event."""

    label: str
    entries: tuple[Entry, ...]


def lines(table: PaperTable, result: PartResult) -> tuple[GridRow, ...]:
    """Return the rows of a table, in the paper's order."""
    rows: dict[str, dict[Quantity, Cell]] = {}
    titles = titles_of(result)
    several = len({cell.event for cell in table.cells}) > 1
    for cell in table.cells:
        what = f"island of {cell.island}" if cell.island else titles.get(cell.case, cell.case)
        rows.setdefault(f"{what}, {cell.event}" if several else what, {})[cell.quantity] = cell
    return tuple(
        GridRow(label, tuple(_entry(cells[quantity], result) for quantity in table.quantities))
        for label, cells in rows.items()
    )


def titles_of(result: PartResult) -> dict[str, str]:
    """Return the case names for people."""
    words = {"I": "no control", "II": "un-coordinated", "III": "GFM-coordinated", "IV": "fully coordinated"}
    return {case: f"{case} {words[case]}" if case in words else case for case in result.found.results}


def tolerances(table: PaperTable) -> list[str]:
    """Return the tolerance of each column, and its reason."""
    found = []
    for quantity in table.quantities:
        cell = next(cell for cell in table.cells if cell.quantity == quantity)
        value = cell.tolerance.value
        bound = f"compared by a factor of {MQSI_FACTOR.value:g} only" if value is None else f"within {value:g}"
        found.append(f"{HEADINGS[quantity]}: {bound}; {cell.tolerance.reason}")
        if cell.relative is not None:
            found.append(f"{HEADINGS[quantity]}, beside its own size: {100 * V_RELATIVE.value:g} % {V_RELATIVE.reason}")
    return found


def _entry(cell: Cell, result: PartResult) -> Entry:
    ours, reason = result.found.value(cell), result.found.reason(cell)
    digits, paper = cell.digits + 1, f"{cell.paper:.{cell.digits}f}"
    if reason:
        return Entry(paper, reason.partition(":")[0], "-", _judged(cell, float("nan")))
    off = round(ours - cell.paper, digits) + 0.0  # no "-0.000"
    times = f" ({ours / cell.paper:.2g} times)" if cell.tolerance.value is None else ""
    return Entry(paper, f"{ours:.{digits}f}", f"{off:+.{digits}f}{times}", _judged(cell, ours))


def _judged(cell: Cell, ours: float) -> tuple[tuple[str, bool], ...]:
    by = {
        "": cell.within(ours),
        f"{100 * V_RELATIVE.value:g} %": cell.within_relative(ours),
        f"factor {MQSI_FACTOR.value:g}": cell.within_factor(ours),
    }
    return tuple((name, holds) for name, holds in by.items() if holds is not None)


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
    """Return the text of a report by its template in this folder; `settings` are those that are not the paper's."""
    data = {"whole": whole, "settings": settings, "machine": machine(), "versions": versions()}
    return _TEMPLATES.get_template(template).render(data)


def write(whole: Reproduction, work: Work, folder: Path) -> None:
    """Write all files of a reproduction into the report's folder."""
    (folder / "figures").mkdir()
    results = []
    for result in whole.results:
        figures = {}
        for picture, path in result.figures.items():
            for kind in FORMATS:
                shutil.copyfile(path.with_suffix(f".{kind}"), folder / "figures" / f"{picture.key}.{kind}")
            figures[picture] = folder / "figures" / f"{picture.key}.png"
        results.append(replace(result, figures=figures))
    whole = replace(whole, results=tuple(results))
    ours = settings({part.name: work.spec(part.name) for part in work.parts})
    for name in ("report.html", "report.md"):
        write_whole(folder / name, render(f"{name}.jinja", whole, ours))
    write_whole(folder / "metrics.json", metrics_json(whole))
    set_status(folder, "complete")
