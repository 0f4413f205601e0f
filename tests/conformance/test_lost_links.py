"""Runs in wall-clock time in which a link brings nothing at all: the message account does not close."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gridpeers.agents.session_health import SessionHealth
from gridpeers.lab.communication.communication_checks import LINKED_WITHIN, MessageAccount, summarise
from tests.record.fake_clock import fake_clock_record

LOST = ("inv1", "inv2")


@pytest.mark.parametrize("lost", [True, False])
def test_a_link_that_never_brings_anything_is_missed(
    tmp_path: Path, lost: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No state of inv1 gets to inv2, from the beginning to the end, and inv2 does not notice; all else arrives."""
    monkeypatch.setattr(SessionHealth, "problem", lambda *given, **named: "")

    def delay(src: str, dst: str, key: str, number: int) -> float | None:
        return None if lost and (src, dst) == LOST and key.startswith("state/") else 0.001

    record = fake_clock_record(tmp_path / "case", end=LINKED_WITHIN + 3.0, delay=delay)
    case: Any = SimpleNamespace(communication=summarise(record.path))
    found = list(MessageAccount()(case))

    assert [(one.agent, one.text) for one in found] == [("inv2", "states of inv1 neither heard nor lost")] * lost
    assert all(one.t is not None and LINKED_WITHIN < one.t < LINKED_WITHIN + 0.5 for one in found)
