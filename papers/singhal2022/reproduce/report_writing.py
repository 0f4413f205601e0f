"""The report's files: report.html, one page that holds its images; report.md with its figures; metrics.json."""

from __future__ import annotations

import base64
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from gridpeers.benchmarks import HEADINGS
from gridpeers.output_folders import set_status, versions, write_whole
from gridpeers.papers.singhal2022.headline import headline
from gridpeers.papers.singhal2022.reproduce.report_tables import lines, tolerances
from gridpeers.papers.singhal2022.reproduce.reproduction import Reproduction, machine, metrics_json
from gridpeers.papers.singhal2022.reproduce.settings import settings
from gridpeers.papers.singhal2022.reproduce.work import FORMATS, Work

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
    """Return the text of a report.

    Parameters
    ----------
    template : {"report.html.jinja", "report.md.jinja"}
        Its template in this folder.
    whole : Reproduction
        The results.
    settings : Sequence[tuple[str, str, str]]
        Name, value and reason of each setting that is not the paper's.
    """
    data = {"whole": whole, "settings": settings, "machine": machine(), "versions": versions()}
    return _TEMPLATES.get_template(template).render(data)


def write(whole: Reproduction, work: Work, folder: Path) -> None:
    """Write all files of a reproduction.

    Parameters
    ----------
    whole : Reproduction
        The results.
    work : Work
        The runs, for the scenarios they had.
    folder : Path
        The report's folder.
    """
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
