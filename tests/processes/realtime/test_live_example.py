"""examples/live_run.py, in real time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from gridpeers.scenarios.drivers.free_endpoint import free_endpoint

SCRIPT = Path(__file__).parents[3] / "examples" / "live_run.py"


def test_a_live_run_is_changed_by_commands_and_read_at_its_end(tmp_path: Path) -> None:
    """A link is made late, an agent leaves, and the record has both."""
    done = subprocess.run(
        [sys.executable, str(SCRIPT), free_endpoint()],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )

    assert done.returncode == 0, done.stdout + done.stderr
    assert "inv2 left; its inverter is off the network" in done.stdout
    assert "link command 1: inv1 <-> inv4: delay 0.1 s" in done.stdout
    assert "P of inv2 at the end: 0 W" in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["live_run.png"]
