"""The report of the whole paper: made from what was found, whole by itself, and honest about what misses."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from gridpeers.papers.singhal2022.paper_benchmarks import CLAIMS, within
from gridpeers.papers.singhal2022.reproduce.paper_report import Reproduction, lines, metrics_json, render, settings
from gridpeers.papers.singhal2022.reproduce.studies import graphs
from gridpeers.papers.singhal2022.reproduce.work import CHOICES, PARTS, PartResult, ReportPart, chosen
from gridpeers.papers.singhal2022.tables import TABLES, Cell, tables_of
from gridpeers.scenarios.results.claims import judge
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.sweep.axes import algebraic_connectivity
from tests.papers.singhal2022.test_claims import changed

ISLANDING: ReportPart = PARTS[0]
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c489"
    "0000000d49444154789c6360000002000001e221bc330000000049454e44ae426082"
)
"""The smallest picture."""


def result(folder: Path, f_error: float = 0.136) -> PartResult:
    """Islanding as the paper has it, but for one frequency error."""
    found = Findings(results=changed("I", "event1", f_error_Hz=f_error), P_set0=0.65, GFL=("inv2",))
    image = folder / "image.png"
    image.write_bytes(PIXEL)
    return PartResult(
        part=ISLANDING,
        found=found,
        verdicts=judge(found, CLAIMS["islanding"]),
        tables=tables_of("islanding"),
        figures=dict.fromkeys(ISLANDING.picture, image),
        sha256={"IV": "1b14ee14"},
        metrics={"seed": 1},
        elapsed_s=1.0,
        cpu_s=2.0,
    )


def whole(*results: PartResult) -> Reproduction:
    return Reproduction(results=results, driver="inprocess", seed=1, started="2026-01-01 12:00")


def test_the_page_needs_nothing_but_itself(tmp_path: Path) -> None:
    """It contains every image and fetches nothing: no script, no style sheet, no address."""
    page = render("report.html.jinja", whole(result(tmp_path)), settings({"islanding": load_scenario("islanding")[0]}))

    assert page.count("data:image/png;base64,") == len(ISLANDING.picture)
    assert not re.findall(r"https?://|<script|<link|src=\"(?!data:)|url\(", page)


@pytest.mark.parametrize("template", ["report.html.jinja", "report.md.jinja"])
def test_the_report_has_every_number_verdict_and_reason(tmp_path: Path, template: str) -> None:
    """The paper's number, ours with a digit more, the difference, each claim with its status and each known miss."""
    one = result(tmp_path)
    text = render(template, whole(one), [("k_p", "0.0007 s", "speed")])

    assert all(token in text for token in ("0.14", "0.136", "-0.004", "0.0007 s"))
    for verdict in one.verdicts:
        assert verdict.status in text
    assert "within 0.02; " in text
    assert "only compared by a factor of 2" in text
    assert "24 of 24 numbers" in text
    assert "8 numbers, all MQSI" in text
    assert "V_error: 8 of 8" in text


def test_a_number_beyond_its_tolerance_fails_the_report(tmp_path: Path) -> None:
    """It is marked in its cell, fails the claim on its column, and the command ends with 1."""
    off = whole(result(tmp_path, f_error=0.2))
    entry = next(iter(lines(TABLES[0], off.results[0]).values()))[0]

    assert entry == ("0.14", "0.200", "+0.060", (("", False),))
    assert off.failed
    assert within(off.numbers, Cell.within) == (23, 24)
    assert not whole(result(tmp_path)).failed


def test_a_missing_number_is_null(tmp_path: Path) -> None:
    """metrics.json is valid JSON also if an index has no value."""
    one = result(tmp_path)
    IV = {**one.found.results["IV"]}
    IV["event1"] = replace(IV["event1"], MQSI=float("nan"))
    found = replace(one.found, results={**one.found.results, "IV": IV})
    told = json.loads(metrics_json(whole(replace(one, found=found))))
    cell = next(c for c in told["tables"] if (c["case"], c["event"], c["quantity"]) == ("IV", "event1", "MQSI"))

    assert cell["ours"] is None
    assert len(told["tables"]) == 32


def test_every_claim_is_shown_and_every_figure_exists() -> None:
    """The figure of a claim is in the claim's own part; every experiment with claims has a part."""
    for part in PARTS:
        keys = {picture.key for picture in part.picture}
        assert {claim.figure for claim in CLAIMS.get(part.experiment, ())} <= keys | {""}
    assert {part.experiment for part in PARTS if part.experiment} == set(CLAIMS)
    assert {table.experiment for table in TABLES} == {part.experiment for part in chosen("tables")}
    assert all(chosen(choice) for choice in CHOICES)


def test_graphs_below_8_links_are_not_connected_and_all_others_are() -> None:
    """A graph of nine with fewer than eight links cannot be connected. Figure of topologies."""
    for edges in graphs(9, seed=1):
        assert (algebraic_connectivity(9, edges) > 1e-6) == (len(edges) >= 8)
