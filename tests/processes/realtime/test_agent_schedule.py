"""Agents that leave and join on schedule, and agents whose plant breaks."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import monotonic
from typing import Literal

import pytest
from msgspec.structs import replace

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_process import run_plant
from gridpeers.scenarios.drivers.children import Child
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.run_request import Outcome
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.driver.session import Session
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Command, Stop
from tests.toy.toy_configs import Schedule, toy_configs
from tests.toy.toy_plant import ToyPlant
from tests.toy.toy_runs import ProcessRun, exists

AWAY: Schedule = ((0.2, "inv2", "leave"), (0.3, "inv2", "join"))


def run_of(folder: Path, schedule: Schedule, clock: str) -> tuple[ProcessRun, Outcome]:
    """A short run of the toy in simulated or real time."""
    plant, agents = toy_configs(3, end=0.4 if clock == "simulated" else 3.0, schedule=schedule)
    run = ProcessRun(
        replace(plant, clock=clock),  # type: ignore[arg-type]
        [replace(agent, clock=clock) for agent in agents],  # type: ignore[arg-type]
        folder,
    )
    return run, run()


def lives(run: ProcessRun, name: str) -> tuple[Child, ...]:
    assert run.children is not None
    return run.children.lives(name)


@pytest.mark.parametrize(
    ("clock", "schedule"), [("simulated", AWAY), ("realtime", ((0.4, "inv2", "leave"), (0.8, "inv2", "join")))]
)
def test_the_process_ends_and_a_new_one_is_started(tmp_path: Path, clock: str, schedule: Schedule) -> None:
    """The leaver's process ends well before the new one starts, both end with status 0, and each has its own log."""
    run, outcome = run_of(tmp_path, schedule, clock)
    first, second = lives(run, "inv2")
    moved = [event.text.split()[1].rstrip(",") for event in outcome.events if event.kind == "inverter"]

    assert outcome.broke == ""
    assert outcome.reproducible == (clock == "simulated")
    assert (first.status, second.status) == (0, 0)
    assert first.pid != second.pid
    assert not exists(second.pid)
    assert moved == ["disconnected", "connected"]
    assert "leaves at t = " in first.log.read_text()
    assert second.log.name == "inv2-2.log"
    assert second.log.exists()
    assert all(len(lives(run, name)) == 1 for name in ("inv1", "inv3", "plant"))


HAS_ALL = Command(sender="visitor", epoch=1, seq=1, t=0.0, verb="telemetry", argument="99", reply_to="visitor")


class Broken(ToyPlant):
    """Divides by zero in its first step."""

    def advance(self) -> None:
        raise ZeroDivisionError("no step")


@pytest.mark.parametrize("clock", ["realtime", "simulated"])
def test_agents_are_told_to_close_whatever_broke_the_plant(clock: Literal["realtime", "simulated"]) -> None:
    """An error that is no PlantError, too, ends the run with a Stop to all: no agent outlives its plant."""
    endpoint = free_endpoint()
    config, _ = toy_configs(1, end=5.0)
    config = replace(config, clock=clock, listen=(endpoint,), agents=(), recorders=("visitor",))
    keys = Keys(config.run)
    visitors: list[Session] = []

    def build(plant_config: PlantConfig) -> Broken:
        visitors.append(Session("visitor", connect=(endpoint,), clock=clock))
        visitors[0].subscribe(keys.control)
        visitors[0].hold_token(keys.alive_recorder("visitor"))  # who sees it has heard of the subscription
        return Broken(plant_config)

    try:
        with ThreadPoolExecutor(1) as pool:
            outcome = pool.submit(run_plant, config, build)
            reasons: list[str] = []
            deadline = monotonic() + 60.0
            while not reasons and monotonic() < deadline:
                heard = visitors[0].take(1, 0.1) if visitors else ()
                messages = [decode(payload) for kind, _, payload, _ in heard if kind == "message"]
                reasons += [message.reason for message in messages if isinstance(message, Stop)]
            for visitor in visitors:
                if clock == "simulated":  # there the plant waits until its recorder says that it has everything
                    visitor.publish(keys.request, encode(HAS_ALL))
                visitor.close()  # a recorder that stayed would have the plant wait for it
    finally:
        for visitor in visitors:
            visitor.close()

    assert outcome.result() == "plant at t = 0 s: ZeroDivisionError: no step"
    assert reasons == [outcome.result()]
