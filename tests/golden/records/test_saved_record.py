"""A record of a run in real time, saved once, is read and replayed by every later version."""

from __future__ import annotations

import pytest

from tests.command_line import invoke
from tests.golden.records.pin import RECORD, SAID


@pytest.mark.parametrize("command", SAID)
def test_a_saved_record_says_the_same_as_ever(command: tuple[str, ...]) -> None:
    """Each process decides from its journal as it did in the run, and `why` reads the same from it."""
    name, *words = command

    code, text = invoke(name, str(RECORD), *words)
    text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("still at work"))  # if slow

    assert text == SAID[command].read_text(encoding="utf-8")
    assert code == 0
