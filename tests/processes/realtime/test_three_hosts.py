"""Runs across hosts, and at a Zenoh router: cut off, moved, and back."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from tests.processes.hosts import Hosts, NoHostsError
from tests.processes.terminals import Desk

AT_ONCE = 8.0
"""Time (s) within which the others go on although links to a dead host are being closed, which used to take ten."""

CALM = '[time]\nend_s = 10.0\n[case.IV]\nsecondary = "all"\ngraph = "full"\n'


@pytest.fixture
def hosts() -> Iterator[Hosts]:
    try:
        with Hosts(3) as made:
            yield made
    except NoHostsError as error:
        pytest.skip(f"network namespaces cannot be made here: {error}")


def test_a_host_cut_off_is_welcome_again(hosts: Hosts, tmp_path: Path) -> None:
    """All nine share; without the third host six go on at 60 Hz; healed, nine again, without anybody's help.

    On the plant's own host agents and `watch` reach it over the loopback, and the other hosts all the same.
    """
    (tmp_path / "calm.toml").write_text(CALM)
    endpoint = f"tcp/{hosts.address(1)}:7447"
    with Desk(tmp_path, "--run", "sites", "--connect", endpoint, "--insecure") as desk:
        near = desk.open_bare("agent", "inv1", "inv2", "inv3", "--run", "sites", prefix=hosts.at(1))
        far = desk.open("agent", "inv4", "inv5", "inv6", prefix=hosts.at(2))
        cut_off = desk.open("agent", "inv7", "inv8", "inv9", prefix=hosts.at(3))
        plant = desk.open_bare(
            *("plant", "calm.toml", "--run", "sites", "--listen", "tcp/0.0.0.0:7447", "--wait", "20", "--insecure"),
            prefix=hosts.at(1),
        )
        for agent in (near, far, cut_off):
            agent.expect("joins at t = ")
        watch = desk.open_bare("watch", "--run", "sites", prefix=hosts.at(1))
        watch.expect(r"inv1 .* inv2-9 ")
        desk.open("event", "open", "13-152", prefix=hosts.at(2)).expect("open at t = ")
        watch.expect(r"inv1 +inv1 +60\.0")

        hosts.cut(3)
        cut_off.shows("inv7: no recent measurement; holds its set-points")
        watch.expect(r"inv1 .* inv2-6 ")
        for _ in range(3):
            plant.expect("inv[789] died; its inverter stays on primary droop")
        watch.expect(r"inv1 .* inv2-6 ", AT_ONCE)
        watch.expect(r"inv6 .* inv1-5 ", AT_ONCE)
        watch.expect(r"inv1 +inv1 +(60\.00|59\.99)")

        hosts.heal(3)
        for name in ("inv7", "inv8", "inv9"):
            cut_off.shows(f"{name}: goes on at t = ")
        watch.expect(r"inv1 .* inv2-9 ")
        watch.expect(r"inv9 .* inv1-8 ")

        status = desk.open("status", prefix=hosts.at(2))
        assert status.end() == 0
        assert re.search(r"inv[1-9] .*no agent", status.text) is None, status.text
        down = desk.open("down", prefix=hosts.at(2))

        assert down.end() == 0, down.text
        assert plant.end() == 0
        assert [agent.end() for agent in (near, far, cut_off)] == [0] * 3


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
    """All processes know only the router. Earlier ones wait for it. Without it nobody is heard; then all continue."""
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
    assert f"--run: a plant of run site already exists, at {router.endpoint}; end it" in second.text

    router.stop()
    for name, agent in agents.items():
        agent.expect(f"{name}: the plant is gone; holds its set-points and looks for it")
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
