"""No host's clock of the day decides anything: it may jump, stand still, or be far off.

Ruff bans them (TID251): who asks for the time of the day says there what for.
"""

from __future__ import annotations

import time
from itertools import pairwise
from pathlib import Path

import pytest

from gridpeers.wire.driver.process import new_epoch
from gridpeers.wire.messages import MOST_COUNT
from tests.toy.town import Town

BROKEN = """
import random
import time

YEARS = random.Random()


def jumping():
    "Any time from 1970 to 2100."
    return YEARS.uniform(0.0, 4.1e9)


time.time = jumping
time.time_ns = lambda: int(1e9 * jumping())
"""


def test_a_run_does_not_notice_clocks_that_jump(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By decades, whenever they are asked: no step is lost, and an agent that comes back is believed and used."""
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "sitecustomize.py").write_text(BROKEN)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "broken"))
    two = ("inv1", "inv2")
    with Town(2, tmp_path).all() as town:
        first = town.status["inv2"].epoch
        town.until(lambda: town.t >= 0.6, "rows")
        town.children["inv2"].signal(9)
        town.until_event("inv2", "inv2 died").start("inv2")
        town.until(lambda: town.status["inv2"].epoch != first, "the new process").together(two)
        steps = [b[0] - a[0] for a, b in pairwise(town.rows)]

        assert max(steps) == pytest.approx(0.02)


def test_an_epoch_is_new_though_the_clock_stands_still(monkeypatch: pytest.MonkeyPatch) -> None:
    """And it fits into its field, whatever the clock says."""
    for clock in (0, 10**18, -(10**18), 2**63 - 1):
        monkeypatch.setattr(time, "time_ns", lambda clock=clock: clock)
        epochs = {new_epoch() for _ in range(64)}

        assert len(epochs) > 32
        assert all(0 <= epoch <= MOST_COUNT for epoch in epochs)
