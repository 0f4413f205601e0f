"""The load beside a measurement: what the bench's own processes take is not that of other programs."""

import subprocess
import sys

from bench.peers.machine_use import own_time

BURN = """
import time
while time.process_time() < 0.4:
    pass
print("done", flush=True)
input()
"""


def test_the_processor_time_of_a_child_is_ours_while_it_lives_and_when_it_has_ended() -> None:
    """Servers of plant and agents live on between cases: as other programs they would spoil the verdict on the load."""
    before = own_time()
    with subprocess.Popen([sys.executable, "-c", BURN], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == b"done\n"

        assert own_time() - before > 0.35

        child.communicate(b"\n")

    assert 0.35 < own_time() - before < 5.0
