"""Measured delays from a CSV file."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridpeers.netem.models.delay import Trace
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.trace_file import with_traces
from tests.unit.netem.link_messages import MICROGRIDS

NAMES = list(MICROGRIDS)


def test_a_traces_file_is_read_from_the_scenarios_folder(tmp_path: Path) -> None:
    """The column delay_s becomes the trace, other columns and empty lines are free."""
    (tmp_path / "delays.csv").write_text("t_s, delay_s\n0,0.01\n\n1,0.02\n")
    netem, wrong = with_traces(Netem(links=(Fault(on="* -> *", delay=Trace(file="delays.csv")),)), tmp_path)

    assert not wrong
    assert netem.links[0].models()["delay"].delays_s == (0.01, 0.02)
    assert not netem.problems(NAMES, MICROGRIDS, 10.0)


def test_a_trace_with_decimal_commas_has_its_delays(tmp_path: Path) -> None:
    """One column and no separator: 0,012 is 12 ms, and was 0 s without a word."""
    (tmp_path / "d.csv").write_bytes("delay_s\r\n0,012\r\n0,5\r\n".encode("utf-16"))

    netem, wrong = with_traces(Netem(links=(Fault(on="* -> *", delay=Trace(file="d.csv")),)), tmp_path)

    assert not wrong
    assert netem.links[0].models()["delay"].delays_s == (0.012, 0.5)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (
            "delay_s\n0.01\nabc\n-0.1\n20\n",
            ['row 3: delay_s must be a number of seconds, got "abc"', "row 4:", "row 5: 20 s"],
        ),
        ("delay\n0.01\n", ['no column "delay_s"']),
        ("delay_s\n12\n13\n", ["are they in milliseconds?"]),
        ("delay_s\n", ["no row"]),
        ("t_s,delay_s\n0,1,0,012\n", ["row 2: 4 cells, but the header has 2"]),
        ("delay_s\n" + "x\n" * 30, [*[f"row {i}:" for i in range(2, 22)], "10 more rows"]),
        (None, ["there is no file"]),
    ],
)
def test_bad_rows_of_a_trace_are_named(tmp_path: Path, rows: str | None, words: list[str]) -> None:
    """Each problem has its row; a whole file in milliseconds is one problem."""
    if rows is not None:
        (tmp_path / "d.csv").write_text(rows)
    _, wrong = with_traces(Netem(links=(Fault(on="* -> *", delay=Trace(file="d.csv")),)), tmp_path)

    assert {problem.path for problem in wrong} == {"link[0].delay.file"}
    assert len(wrong) == len(words)
    assert all(word in problem.text for word, problem in zip(words, wrong, strict=True))
