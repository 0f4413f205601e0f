"""Runs that meet at a Zenoh router: a rendezvous that is not the plant."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from tests.processes.terminals import Desk

CALM = '[time]\nend_s = 10.0\n[case.IV]\nsecondary = "all"\ngraph = "full"\n'


class Router:
    """A Zenoh router on the loopback, that can be taken away and brought back."""

    def __init__(self) -> None:
        self.endpoint = free_endpoint()
        self._session: Any = None

    def start(self) -> None:
        """Start it, at the same endpoint as before."""
        config = {
            "mode": "router",
            "listen": {"endpoints": [self.endpoint]},
            "scouting": {"multicast": {"enabled": False}},
        }
        self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))

    def stop(self) -> None:
        """End it."""
        if self._session is not None:
            self._session.close()
        self._session = None


@pytest.fixture
def router() -> Iterator[Router]:
    """A router, as on a site where plant and agents do not know each other's addresses."""
    made = Router()
    yield made
    made.stop()


@pytest.fixture
def desk(tmp_path: Path, router: Router) -> Iterator[Desk]:
    """Terminals whose commands know the router alone."""
    (tmp_path / "calm.toml").write_text(CALM)
    with Desk(tmp_path, "--run", "site", "--connect", router.endpoint) as made:
        yield made


def test_all_meet_at_a_router_that_comes_last_dies_and_comes_back(desk: Desk, router: Router) -> None:
    """All know the router alone. Who was there before it waits; while it is dead nobody is heard; then all go on."""
    agents = {name: desk.open("agent", name) for name in ("inv1", "inv4", "inv7")}
    for name, agent in agents.items():
        agent.expect(f"{name}: no plant yet")
    plant = desk.open("plant", "calm.toml", "--listen", "tcp/127.0.0.1:0", "--wait", "0")
    plant.expect("t = 0; speed")
    router.start()
    for name, agent in agents.items():
        agent.expect(f"{name}: joins at t = ")
    watch = desk.open("watch")
    watch.expect(r"inv1 .* inv4,7 ")
    second = desk.open("plant", "calm.toml", "--listen", "tcp/127.0.0.1:0")
    assert second.end() == 2
    assert f"--run: a plant of run site is there already, at {router.endpoint}; end it" in second.text

    router.stop()
    for name, agent in agents.items():
        agent.expect(f"{name}: the plant is gone; holds, and seeks it again")
    watch.expect("the plant has been silent for")
    router.start()
    for name, agent in agents.items():
        agent.expect(f"{name}: goes on at t = ")
    watch.expect(r"inv1 .* inv4,7 ")
    code, text = desk.type("stop", "inv4")
    assert code == 0, text
    plant.expect("inv4 left; its inverter is off the network")
    code, text = desk.type("down")

    assert code == 0, text
    assert plant.end() == 0
    assert [agent.end() for agent in agents.values()] == [0, 0, 0]
