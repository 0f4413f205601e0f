"""Histories of the catalogue are pinned: nothing moves them but a change of behaviour, with its reason."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.golden.catalogue.pins import cases, environment, read, run_case

PINNED = read()
PINS = PINNED.here()


@pytest.mark.parametrize(("name", "case"), cases())
def test_a_case_gives_the_pinned_history(name: str, case: str) -> None:
    """Every case gives the pinned bytes; in another numerical environment, the pinned last row to 1e-7."""
    pin = run_case(name, case)

    if environment() == PINNED.environment:
        assert pin == PINS[name, case], 'if it should move: python -m tests.golden.catalogue.pin "the reason"'
    else:
        assert pin.last == pytest.approx(PINS[name, case].last, rel=1e-7, abs=1e-4)


def test_every_case_is_pinned_and_nothing_else() -> None:
    """A new case is pinned with its first commit, and a removed one leaves no pin behind."""
    assert set(PINNED.pins) == set(PINS) == set(cases())


def test_every_move_has_a_reason() -> None:
    """Each time the pins moved, somebody said why and which scenarios."""
    assert PINNED.moved
    assert all(len(entry["reason"]) > 20 and entry["scenarios"] for entry in PINNED.moved)


ROOT = Path(__file__).parents[3]
HASH = re.compile(r"\b[0-9a-f]{64}\b")
SHOWN = re.compile(r"(?P<sha256>[0-9a-f]{64})  [^ ]*?(?P<case>[^/ ]+)/history\.csv")
"""A line of the output of sha256sum."""
TEXTS = {
    page.name: page.read_text(encoding="utf-8") for page in [*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md"]
}
BLOCKS = [
    pytest.param(block, id=name)
    for name, text in TEXTS.items()
    for block in re.findall(r"^```\w*\n(.*?)^```", text, re.S | re.M)
    if HASH.search(block)
]


def test_hashes_stand_beside_the_commands_that_give_them() -> None:
    """Each hash on a page is in a block of commands and output, so that the test below sees it; there are some."""
    in_blocks = sum(len(HASH.findall(block)) for (block,) in (parameter.values for parameter in BLOCKS))

    assert in_blocks == sum(len(HASH.findall(text)) for text in TEXTS.values()) > 0


@pytest.mark.parametrize("block", BLOCKS)
def test_a_hash_that_a_page_shows_is_pinned(block: str) -> None:
    """It is that of its case, in the scenario that the block runs; when pins move, the page follows."""
    (scenario,) = set(re.findall(r"gridpeers run (\S+)", block))
    lines = [line for line in block.splitlines() if HASH.search(line)]

    shown = [(found["case"], found["sha256"]) for line in lines if (found := SHOWN.fullmatch(line))]

    assert len(shown) == len(lines)
    assert shown == [(case, PINNED.pins[scenario, case].sha256) for case, _ in shown]


def f_error(case: str) -> float:
    """Frequency error (Hz) of the first inverter at the end of a case."""
    return abs(PINNED.pins["hostile", case].last[0] - 60.0)


def test_one_liar_holds_the_frequency_of_the_paper_s_law_off_nominal() -> None:
    """Five times the band of 0.01 Hz, with all values plausible in form; a small lie does it too, past plausibility."""
    assert f_error("truth") < 1e-4
    assert f_error("one") > 0.05
    assert f_error("small") > 0.03


def test_each_defence_stops_what_it_is_made_for_and_no_more() -> None:
    """Plausibility stops a large lie; W-MSR stops F liars on a robust graph, not F + 1, and not on the sparse graph."""
    assert max(f_error(case) for case in ("plausible", "trimmed", "two-trimmed")) < 1e-3
    assert f_error("two") > 0.05
    assert f_error("sparse") > 0.05
