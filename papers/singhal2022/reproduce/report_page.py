"""The report as one page of HTML that needs nothing else: its images are inside, and it prints on A4."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from gridpeers.benchmarks import HEADINGS, Verdict
from gridpeers.output_folders import versions
from papers.singhal2022.headline import headline
from papers.singhal2022.reproduce.grid import Entry, lines, tolerances
from papers.singhal2022.reproduce.reproduction import PartResult, Reproduction, machine
from papers.singhal2022.tables import PaperTable

_STYLE = (Path(__file__).parent / "page.css").read_text(encoding="utf-8")

PAPER = (
    "Singhal, Vu, Du: Consensus Control for Coordinating Grid-Forming and Grid-Following Inverters in Microgrids. "
    "IEEE Transactions on Smart Grid, 2022"
)


def html(whole: Reproduction, settings: Sequence[tuple[str, str, str]]) -> str:
    """Return the text of report.html."""
    body = [*_head(whole), *(line for result in whole.results for line in _part(result)), *_end(whole, settings)]
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>gridpeers reproduce</title>\n<style>\n{_STYLE}</style>\n</head>\n<body>\n" + "\n".join(body) + "\n"
        "</body>\n</html>\n"
    )


def _head(whole: Reproduction) -> Iterator[str]:
    counts = whole.counts()
    yield "<h1>The paper, reproduced</h1>"
    yield f'<p class="source">{escape(PAPER)}.</p>'
    yield '<div class="summary">'
    yield f"<p><b>{counts['PASS']}</b> of {len(whole.verdicts)} claims hold</p>"
    yield f"<p><b>{counts['MISS']}</b> missed, for a reason that is told</p>"
    yield f'<p class="{"bad" if counts["FAIL"] else ""}"><b>{counts["FAIL"]}</b> failed</p>'
    yield "</div>"
    if whole.numbers:
        yield "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in headline(whole.numbers)) + "</ul>"
    yield "<table class='contents'><tr><th>part</th><th>claims</th><th>took</th></tr>"
    for result in whole.results:
        statuses = [verdict.status for verdict in result.verdicts]
        marks = " ".join(f"{statuses.count(status)} {_mark(status)}" for status in dict.fromkeys(statuses))
        marks = marks or "ours, nothing to judge"
        yield (
            f'<tr><td><a href="#{result.part.name}">{escape(result.part.title)}</a></td><td>{marks}</td>'
            f"<td>{result.wall_s:.0f} s</td></tr>"
        )
    yield "</table>"
    yield (
        f"<p>gridpeers, driver {whole.driver}, seed {whole.seed}, {escape(whole.started)}. Every number below was "
        "computed in this run; nothing is stored. A digit more than the paper prints is shown of ours.</p>"
    )


def _part(result: PartResult) -> Iterator[str]:
    part = result.part
    yield f'<section id="{part.name}"><h2>{escape(part.title)}</h2><p>{escape(part.what)}</p>'
    for table in result.tables:
        yield from _table(table, result)
    figured = {picture.key for picture in result.figures}
    yield from _claims([verdict for verdict in result.verdicts if verdict.claim.figure not in figured])
    for picture, path in result.figures.items():
        yield "<figure>"
        yield f'<img alt="{escape(picture.title)}" src="data:image/png;base64,{_embedded(path)}">'
        yield f"<figcaption><p><b>{escape(picture.title)}.</b> {escape(picture.note)}</p>"
        yield from _claims([verdict for verdict in result.verdicts if verdict.claim.figure == picture.key])
        yield "</figcaption></figure>"
    yield "</section>"


def _table(table: PaperTable, result: PartResult) -> Iterator[str]:
    yield f'<h3>Table {table.number}. {escape(table.title)}</h3><table class="numbers"><thead><tr><th rowspan="2"></th>'
    yield "".join(f'<th colspan="3">{escape(HEADINGS[quantity])}</th>' for quantity in table.quantities)
    yield "</tr><tr>" + "<th>paper</th><th>ours</th><th>difference</th>" * len(table.quantities)
    yield "</tr></thead><tbody>"
    for line in lines(table, result):
        cells = "".join(
            f"<td>{entry.paper}</td><td>{entry.ours}</td><td>{entry.off} {_within(entry)}</td>"
            for entry in line.entries
        )
        yield f"<tr><th>{escape(line.label)}</th>{cells}</tr>"
    yield "</tbody></table>"
    yield "<p class='small'>" + "<br>".join(map(escape, tolerances(table))) + ".</p>"


def _claims(verdicts: Sequence[Verdict]) -> Iterator[str]:
    if not verdicts:
        return
    yield '<ul class="claims">'
    for verdict in verdicts:
        claim = verdict.claim
        reason = f'<br><span class="small">{escape(claim.known_miss)}</span>' if verdict.status == "MISS" else ""
        yield (
            f"<li>{_mark(verdict.status)} {escape(claim.text)} <span class='small'>({escape(claim.source)})</span>"
            f"<br><span class='found'>{escape(verdict.found)}</span>{reason}</li>"
        )
    yield "</ul>"


def _end(whole: Reproduction, settings: Sequence[tuple[str, str, str]]) -> Iterator[str]:
    yield "<section><h2>What is ours and not the paper's</h2><p>The paper does not print these. P_set, the limit of "
    yield "the GFM and the load set follow from its own tables; the others were chosen for speed and damping, none to "
    yield "make a single number fit. What misses is shown above, and discussed in docs/reproduction.md.</p>"
    yield "<table class='settings'><tr><th>setting</th><th>value</th><th>why</th></tr>"
    for row in settings:
        yield "<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>"
    yield "</table></section><section><h2>How it was computed</h2>"
    named = "; ".join(f"{name} {version}" for name, version in versions().items())
    yield f"<p>{escape(named)}.<br>{escape(machine())}.<br>"
    yield (
        f"Driver {whole.driver}, seed {whole.seed}. Topologies are always run in one process each. All took "
        f"{whole.wall_s:.0f} s, {whole.cpu_s:.0f} s of processor time.</p>"
    )
    yield (
        "<table class='settings'><tr><th>case</th><th>SHA-256 of its history.csv: the same for both drivers, in "
        "every "
        "order of starting processes</th></tr>"
    )
    for result in whole.results:
        for case, sha in result.sha256.items():
            yield f"<tr><td>{result.part.name}, {escape(case)}</td><td class='hash'>{sha}</td></tr>"
    yield "</table></section>"


def _mark(status: str) -> str:
    return f'<span class="mark {status.lower().replace(" ", "-")}">{status}</span>'


def _within(entry: Entry) -> str:
    """Return a mark for every judgement of a number."""
    marks = {True: '<span class="ok" title="within">✓</span>', False: '<span class="off" title="off">✗</span>'}
    return "; ".join(
        marks[holds] + (f' <span class="small">{escape(name)}</span>' if name else "") for name, holds in entry.judged
    )


def _embedded(path: Path) -> str:
    return base64.b64encode(path.read_bytes()).decode("ascii")
