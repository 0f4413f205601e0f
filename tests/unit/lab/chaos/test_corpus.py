"""Failures that chaos has found: those that were mended stay mended, and the limits of the law are still its limits."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridpeers.lab.chaos.chaos_run import run_scenario
from tests.unit.lab.chaos.bases import base_in

CORPUS = Path(__file__).parent / "corpus"

HEAD = "# Violates "
"""Begins the first line of a limit, before words of the sentence with which its check fails."""


@pytest.mark.parametrize("file", sorted((CORPUS / "mended").glob("*.toml")), ids=lambda file: file.stem)
def test_a_mended_failure_passes(file: Path) -> None:
    """The scenario of each failure of the past violates nothing."""
    assert run_scenario(base_in(file)).violated == {}


@pytest.mark.parametrize("name", ["returns-cut", "returns-partition", "var_sharing-kill", "rating-kill-after-lie"])
def test_a_limit_of_the_law_is_still_one(name: str) -> None:
    """The limits that docs/chaos.md explains violate their checks, with the words in their first line."""
    file = CORPUS / "limits" / f"{name}.toml"
    first = file.read_text(encoding="utf-8").partition("\n")[0]
    assert first.startswith(HEAD)

    check = file.stem.partition("-")[0]
    sentence = run_scenario(base_in(file)).violated.get(check, "nothing")

    assert first.removeprefix(HEAD) in sentence, (
        f"{file.stem} does not show its limit any more: it violates {sentence}; "
        "if the law does better now, take it out of the corpus and of docs/chaos.md"
    )
