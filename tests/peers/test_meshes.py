"""The bare meshes beside ours: that every rival runs. Their numbers are not judged here."""

import pytest

from bench.peers.mesh import full_graph, seconds_per_round
from bench.peers.parts import PACKAGE


@pytest.mark.parametrize("transport", PACKAGE)
def test_every_rival_does_the_rounds_of_a_mesh(transport: str) -> None:
    """Hub and agents meet, exchange all messages of some rounds, and end by themselves."""
    if PACKAGE[transport]:
        pytest.importorskip({"pyzmq": "zmq"}.get(PACKAGE[transport], PACKAGE[transport]))

    assert 0.0 < seconds_per_round(transport, full_graph(["a", "b"]), rounds=3, sizes=(200, 100)) < 10.0


def test_agents_of_one_process_share_its_messages() -> None:
    """Four agents in two processes do their rounds, though some neighbours are in the own process."""
    agents = full_graph(["a", "b", "c", "d"])

    assert seconds_per_round("zenoh", agents, rounds=3, sizes=(200, 100), processes=2) > 0.0
