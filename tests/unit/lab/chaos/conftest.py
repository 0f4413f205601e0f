"""Campaigns draw few schedules, where a test does not look at them: to draw 25 takes as long as ten small runs."""

from __future__ import annotations

import pytest

from gridpeers.lab.chaos import campaign, schedules


@pytest.fixture
def few_schedules(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (campaign, schedules):
        monkeypatch.setattr(module, "BATCH", 4)
