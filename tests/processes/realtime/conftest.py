"""A desk of terminals around a run without events."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from tests.processes.terminals import Desk

CALM = """
[time]
end_s = 1.0
[case.IV]
secondary = "all"
graph = "full"
"""
"""No event: what happens, the test does."""


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    """Terminals of one run, at a port of its own."""
    (tmp_path / "calm.toml").write_text(CALM)
    with Desk(tmp_path, "--run", "lab", "--connect", free_endpoint()) as terminals:
        yield terminals
