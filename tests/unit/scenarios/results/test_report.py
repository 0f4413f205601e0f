"""The end of a run: a summary of one screen, and a report; colours on a terminal only."""

import io
from dataclasses import replace

import pytest
from rich.cells import cell_len

from gridpeers.papers.singhal2022.paper_benchmarks import CLAIMS, ISLANDING
from gridpeers.scenarios.checks.check_verdict import CheckVerdict, Violation
from gridpeers.scenarios.console import terminal
from gridpeers.scenarios.results.claims import NO_BENCHMARK, judge
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.results.metrics import Steady
from gridpeers.scenarios.results.report import RunReport, plain, show, show_summary
from tests.papers.singhal2022.test_claims import changed


def report(*, judged: bool = True, f_error: float = 0.137) -> RunReport:
    """A report whose numbers are the paper's, but for one frequency error."""
    found = Findings(results=changed("I", "event1", f_error_Hz=f_error), P_set0=0.65, GFL=("inv2",))
    return RunReport(
        scenario="islanding",
        titles={"I": "no control"},
        findings=found,
        verdicts=judge(found, CLAIMS["islanding"]) if judged else (),
        benchmark=ISLANDING if judged else NO_BENCHMARK,
        notes=["case I: inv3 [died] at t = 2 s"],
        folder="runs/islanding/x/",
    )


def test_ours_stand_beside_the_papers() -> None:
    """A cell shows our number with a digit more than the paper's beside it."""
    text = plain(report())

    assert "0.137 | 0.14" in text
    assert "I: no control" in text
    assert "PASS" in text
    assert text.endswith("Results: runs/islanding/x/\n")


def test_a_number_that_is_off_is_marked_and_fails() -> None:
    """The cell carries a mark, the claim says FAIL and by how much."""
    text = plain(report(f_error=0.2))

    assert "0.200 | 0.14 !" in text
    assert "largest difference 0.0600 Hz (case I, event1)" in text
    assert "FAIL" in text


@pytest.mark.parametrize("coloured", [True, False])
def test_colours_are_for_terminals_only(coloured: bool) -> None:
    """In a pipe no control character is printed; the words are the same."""
    out = io.StringIO()

    show(report(), terminal(file=out, force_terminal=coloured, width=160))

    assert ("\x1b[" in out.getvalue()) == coloured
    assert "inv3 [died] at t = 2 s" in out.getvalue()
    if not coloured:
        assert out.getvalue() == plain(report())


def test_tables_of_many_events_fit_a_terminal() -> None:
    """Each event and case has a row of its own, so that no line is longer than 80 characters."""
    few = report(judged=False)
    steady = few.findings.results["IV"]["event1"]
    found = Findings(results={"IV": {f"event{i}": steady for i in range(1, 7)}}, P_set0=0.65, GFL=("inv2",))
    lines = plain(replace(few, findings=found, notes=[], folder="")).splitlines()

    assert max(map(cell_len, lines)) <= 80
    assert [line.split()[0] for line in lines if "0.80 s" in line] == [f"event{i}" for i in range(1, 7)]


def test_what_several_islands_share_together_is_not_told() -> None:
    """Each shares for itself: the whole has a dash for it, the islands their numbers, and a line says why."""
    whole = Steady(f_error_Hz=0.027, MPSI=0.093, V_error=0.01, MQSI=0.492, t_restore_s=None, p={})
    part = Steady(f_error_Hz=0.041, MPSI=0.019, V_error=0.09, MQSI=0.135, t_restore_s=0.37, p={})
    found = Findings(results={"IV": {"e": whole}}, islands={"IV": {"e": {"inv1": part}}})
    text = plain(RunReport(scenario="own", titles={}, findings=found, verdicts=(), notes=(), folder="here/"))

    rows = [line.split() for line in text.splitlines()]
    assert [row[2:] for row in rows if row[1:2] == ["IV"]] == [["0.027", "-", "-"], ["0.0100", "-"]]
    assert [row[4:] for row in rows if row[1:2] == ["island"]] == [["0.041", "0.019", "0.37", "s"], ["0.0900", "0.135"]]
    assert text.count("-: several islands, each of which shares for itself") == 2
    assert "-:" not in plain(report())


def summary(of: RunReport, *, coloured: bool = False) -> list[str]:
    out = io.StringIO()
    show_summary(of, terminal(file=out, force_terminal=coloured, width=80), "gridpeers up islanding")
    return out.getvalue().splitlines()


def verdicts(**failed: str) -> dict[str, tuple[CheckVerdict, ...]]:
    """Verdicts of cases that fail the check of their name; of no name they pass it."""
    found = {case: Violation(text="abs(f - 60)", agent="inv1", t=3.0) for case in failed}
    return {
        case: (
            CheckVerdict(check=check or "steady", status="failed" if check else "passed", violations=(found[case],)),
        )
        for case, check in failed.items()
    }


def test_the_first_line_is_the_answer_and_the_last_the_next_command() -> None:
    """A case that is built to fail is no failure; one line counts the claims of the paper."""
    of = replace(report(), checks=verdicts(I="frequency", IV=""), expected={"I": ("frequency",)})

    lines = summary(of)

    assert lines[0] == "islanding: case IV keeps all limits; case I breaks some as expected"
    assert lines[3:5] == [
        "I: no control  0.137 Hz     0.000     0.300        never  as expected",
        "IV             0.000 Hz     0.000     0.050       0.90 s  kept",
    ]
    assert "12 of 12 claims of the paper hold" in lines
    assert lines[-3:-1] == [
        "figure  runs/islanding/x/plots/overview.png",
        "report  runs/islanding/x/report.txt (1 note)",
    ]
    assert lines[-1] in ("next    gridpeers view runs/islanding/x", "next    gridpeers up islanding")


def test_unexpected_failures_come_first_and_red_and_the_next_command_explains_the_first() -> None:
    of = replace(report(f_error=0.2), checks=verdicts(I="frequency", IV=""))

    lines = summary(of)

    assert lines[0] == "islanding: 1 claim failed; case I breaks limits; case IV keeps all limits"
    assert lines[1] == "FAILED  case I: frequency: abs(f - 60): inv1"
    assert lines[2].startswith("FAILED  all eight abs(f-60) within 0.01 Hz of Table I: 7 of 8")
    assert lines[-1] == "next    gridpeers why runs/islanding/x/I inv1 3.00"
    assert all(line.startswith("\x1b[") for line in summary(of, coloured=True)[:3])


@pytest.mark.parametrize("measured", [True, False])
def test_a_summary_fits_one_screen_whatever_the_run(measured: bool) -> None:
    """Many cases with long titles and many failures, or no event to measure after: the report has what is left out."""
    cases = {f"case{i}": "frequency" if i % 3 else "" for i in range(30)}
    steady = report().findings.results["IV"]
    found = Findings(results=dict.fromkeys(cases, steady if measured else {}))
    of = replace(report(), titles=dict.fromkeys(cases, "[red]微电网 " * 9), checks=verdicts(**cases), findings=found)

    lines = summary(of)

    assert len(lines) <= 14
    assert max(map(len, lines)) <= 80
    assert lines[0] == "islanding: 20 cases break limits; 10 cases keep all limits"
    assert sum("more failures: see the report" in line or "more cases: see the report" in line for line in lines) == 2
