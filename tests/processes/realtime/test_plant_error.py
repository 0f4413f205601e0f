"""A plant process in which something breaks that nobody thought of."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from time import monotonic
from typing import Literal

import pytest
from msgspec.structs import replace

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_process import run_plant
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.driver.session import Session
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Command, Stop
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_plant import ToyPlant

HAS_ALL = Command(sender="visitor", epoch=1, seq=1, t=0.0, verb="telemetry", argument="99", reply_to="visitor")


class Broken(ToyPlant):
    """Divides by zero in its first step."""

    def advance(self) -> None:
        """Go one control period on, in vain."""
        raise ZeroDivisionError("no step")


@pytest.mark.parametrize("clock", ["wall", "simulated"])
def test_agents_are_told_to_close_whatever_broke_the_plant(clock: Literal["wall", "simulated"]) -> None:
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
