"""Live run: ten processes in real time; a link becomes late, an agent leaves, and Python reads the run.

    python examples/live_run.py [tcp/127.0.0.1:7447]

docs/learn/live-run.md shows the same commands in terminals.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import gridpeers as gp

ENDPOINT = sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"
COMMAND = [sys.executable, "-m", "gridpeers"]


def gridpeers(*words: str) -> None:
    """Run one command, and show it with its output."""
    print("$ gridpeers", *words, flush=True)
    subprocess.run([*COMMAND, *words, "--connect", ENDPOINT], check=True)


with tempfile.TemporaryDirectory() as parent:
    folder = Path(parent) / "record"
    up = [*COMMAND, "up", "islanding", "--listen", ENDPOINT, "--out", str(folder)]
    with subprocess.Popen(up, stdout=subprocess.PIPE, text=True) as run:
        try:
            for line in run.stdout:
                print(line, end="", flush=True)
                if "switch 13-152 opened" in line:  # the microgrids are an island now
                    break
            gridpeers("link", "set", "inv1 <-> inv4", "--delay", "0.1", "--for", "2")
            gridpeers("stop", "inv2")
            gridpeers("status")
            gridpeers("down")
            run.communicate(timeout=90)  # its report takes some seconds
        finally:
            run.terminate()

    result = gp.read(folder)
    print(result.events.to_string(index=False))
    result.plot("plug-n-play").savefig("live_run.png")
    print(f"P of inv2 at the end: {result.history['inv2']['P'].iloc[-1]:.0f} W")
