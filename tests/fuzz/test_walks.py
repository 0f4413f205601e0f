"""Random walks through the phases of both nodes: events of honest peers, in an order that nobody foresees."""

from __future__ import annotations

import random
from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_node import AGENT_PHASES, AgentNode
from gridpeers.plant.plant_config import ScheduledAction
from gridpeers.plant.plant_node import PHASES, PlantNode
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.messages import Command, Leave, Message, Prepare, Ready, Stop
from gridpeers.wire.node import Fetch, Publish
from tests.hostile.scenes import EPOCH, KEYS, NAMES, T_C, measurement, plate, state
from tests.toy.toy_configs import agent_config, toy_configs
from tests.toy.toy_plant import ToyPlant


def node_of(kind: type, clock: Any, rng: random.Random) -> Any:
    if kind is AgentNode:
        return AgentNode(replace(agent_config("inv1"), epoch=EPOCH, clock=clock), "a")
    config, _ = toy_configs(3, spares=("inv3",) if rng.random() < 0.5 else ())
    moves = [ScheduledAction(t=0.04, inverter="inv3", action="join")] if len(config.agents) < 3 else []
    recorders = ("history",) if rng.random() < 0.3 else ()
    config = replace(config, epoch=EPOCH, recorders=recorders, clock=clock, schedule=tuple(moves))
    return PlantNode(config, ToyPlant(config))


def walk(node: Any, rng: random.Random) -> set[str]:
    """Give a node events until it has finished, with its driver's part; return the phases that it was in."""
    now, heard, roster, asked, seen = 100.0, 0, 0, list[str](), set[str]()
    late, often = rng.choice((0.02, 0.5)), ("measurement", "state", "ready", "token", "token", "answer", "deadline") * 4
    node.start(now)
    for _ in range(300):
        seen.add(node.phases.now if isinstance(node, AgentNode) else node.phase)
        tick, used = heard if isinstance(node, AgentNode) else node.stepper.tick, node.post.used
        now += rng.choice((0.0, 0.001, T_C, T_C, 0.5))
        name, event = rng.choice(NAMES), rng.choice((*often, "plant", "plant", "prepare", "recorder", "leave", "stop"))
        own: dict[str, Any] = dict(sender=name, epoch=EPOCH, t=0.0)
        plant: dict[str, Any] = dict(sender="plant", epoch=EPOCH, t=0.0)
        tokens = {"token": KEYS.alive_agent(name, "a"), "plant": KEYS.alive_plant(EPOCH)}
        tokens["recorder"] = KEYS.alive_recorder("history")
        messages: dict[str, tuple[str, Message]] = {
            "measurement": (KEYS.measurement("inv1"), measurement(tick)),
            "state": (KEYS.state(name), state(name, max(0, tick - rng.choice((0, 0, 1, 1, 2))))),
            "ready": (KEYS.ready(name), Ready(seq=roster, **own)),
            "leave": (KEYS.leave(name), Leave(seq=tick, **own)),
            "prepare": (KEYS.control, Prepare(seq=roster, roster=NAMES, instances=("a", "a", "a"), **plant)),
            "stop": (KEYS.stop_request("inv1", "a"), Stop(seq=tick, reason="enough", **plant)),
            "down": (KEYS.command, Command(seq=1, verb="down", reply_to="me", **own)),
        }
        if event in tokens:
            (node.appeared if rng.random() < 0.9 else node.vanished)(tokens[event], now)
        elif event == "answer" and asked:
            key = asked.pop(rng.randrange(len(asked)))
            node.received(key, encode(plate(KEYS.parts(key)[1])), now)
        elif event == "deadline" and node.deadline is not None:
            now = min(max(now, node.deadline), now + 100.0) if rng.random() < late else now
            node.expire(now)
        elif event in messages and (event != "stop" or rng.random() < 0.2):
            for key, message in [messages[event], *([messages["down"]] if event == "stop" else [])]:
                node.received(key, encode(message), now)
            heard += event == "measurement" and node.post.used > used
            roster += event == "prepare" and node.post.used > used
        working = True
        while working:
            actions = node.take_actions()
            asked += [action.key for action in actions if isinstance(action, Fetch)]
            sent = [decode(action.payload) for action in actions if isinstance(action, Publish)]
            roster = max([roster, *(message.seq for message in sent if isinstance(message, Prepare))])
            working = not node.finished and node.work(now)
        assert not node.rejects.counts["failed"], node.take_rejects()
        if node.finished:
            break
    return seen


@pytest.mark.parametrize("clock", ["simulated", "wall"])
@pytest.mark.parametrize(("kind", "phases"), [(AgentNode, AGENT_PHASES), (PlantNode, PHASES)])
def test_no_order_of_honest_events_leads_out_of_the_table_of_phases(kind: type, phases: Any, clock: str) -> None:
    """A transition that the table lacks would be a PhaseError; the walks meet the phases of this kind of time."""
    walks = (random.Random(seed) for seed in range(60))
    seen = set[str]().union(*(walk(node_of(kind, clock, rng), rng) for rng in walks))
    others = {"simulated": {"leaving", "holding"}, "wall": {"meeting", "preparing", "joining", "holding"}}[clock]
    assert seen | others | {"over"} >= {*phases}
