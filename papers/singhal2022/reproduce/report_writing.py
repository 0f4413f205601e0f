"""The report's files: report.html, report.md with its figures, metrics.json."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from gridpeers.benchmarks import HEADINGS, Verdict
from gridpeers.output_folders import set_status, versions, write_whole
from papers.singhal2022.headline import headline
from papers.singhal2022.reproduce.grid import Entry, lines, tolerances
from papers.singhal2022.reproduce.report_page import PAPER, html
from papers.singhal2022.reproduce.reproduction import PartResult, Reproduction, machine, metrics_json
from papers.singhal2022.reproduce.settings import settings
from papers.singhal2022.reproduce.work import FORMATS, Work

_MARKS = {True: "yes", False: "**NO**"}


def markdown(whole: Reproduction, settings: Sequence[tuple[str, str, str]]) -> str:
    """Return the text of report.md."""
    head = [
        "# The paper, reproduced",
        "",
        f"{PAPER}.",
        "",
        *(f"- {line}" for line in (*headline(whole.numbers), whole.claims)),
        "",
        f"Driver {whole.driver}, seed {whole.seed}, {whole.started}; {whole.wall_s:.0f} s, {whole.cpu_s:.0f} s of "
        f"processor time. {machine()}. {'; '.join(f'{name} {version}' for name, version in versions().items())}.",
        "",
    ]
    parts = [line for result in whole.results for line in _part(result)]
    end = ["## What is ours and not the paper's", "", *_rows(("setting", "value", "why"), settings), ""]
    hashes = [
        (f"{result.part.name}, {case}", f"`{sha}`") for result in whole.results for case, sha in result.sha256.items()
    ]
    return "\n".join([*head, *parts, *end, "## Hashes", "", *_rows(("case", "SHA-256 of history.csv"), hashes)]) + "\n"


def _part(result: PartResult) -> Iterator[str]:
    yield from (f"## {result.part.title}", "", result.part.what, "")
    for table in result.tables:
        header = [""]
        for quantity in table.quantities:
            header += [f"{HEADINGS[quantity]}: paper", "ours", "difference", "within"]
        rows = [
            (line.label, *(text for e in line.entries for text in (e.paper, e.ours, e.off, _within(e))))
            for line in lines(table, result)
        ]
        yield from (f"### Table {table.number}. {table.title}", "", *_rows(header, rows), "")
        yield from (*(f"- {text}" for text in tolerances(table)), "")
    figured = {picture.key for picture in result.figures}
    yield from _claims([verdict for verdict in result.verdicts if verdict.claim.figure not in figured])
    for picture, path in result.figures.items():
        yield from (f"![{picture.title}](figures/{path.name})", "", f"**{picture.title}.** {picture.note}".strip(), "")
        yield from _claims([verdict for verdict in result.verdicts if verdict.claim.figure == picture.key])


def _within(entry: Entry) -> str:
    """Return every judgement of a number."""
    return "; ".join(f"{name} {_MARKS[holds]}".strip() for name, holds in entry.judged)


def _claims(verdicts: Sequence[Verdict]) -> Iterator[str]:
    for verdict in verdicts:
        reason = f" — {verdict.claim.known_miss}" if verdict.status == "MISS" else ""
        yield f"- **{verdict.status}** {verdict.claim.text} ({verdict.claim.source}): {verdict.found}{reason}"
    if verdicts:
        yield ""


def _rows(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    yield "| " + " | ".join(header) + " |"
    yield "|" + "---|" * len(header)
    for row in rows:
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |"


def write(whole: Reproduction, work: Work, folder: Path) -> None:
    """Write all files of a reproduction.

    Parameters
    ----------
    whole : Reproduction
        What came of it.
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
    write_whole(folder / "report.html", html(whole, ours))
    write_whole(folder / "report.md", markdown(whole, ours))
    write_whole(folder / "metrics.json", metrics_json(whole))
    set_status(folder, "complete")
