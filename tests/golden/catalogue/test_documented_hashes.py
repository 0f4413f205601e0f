"""Hashes of histories that a page shows are those that are pinned: a reader compares them with his own run's."""

import re
from pathlib import Path

import pytest

from tests.golden.catalogue.pins import read

ROOT = Path(__file__).parents[3]
PINS = read().pins
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
    assert shown == [(case, PINS[scenario, case].sha256) for case, _ in shown]
