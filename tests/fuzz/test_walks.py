"""Random walks through the phases of both nodes: events of honest peers, in an order that nobody foresees."""

from __future__ import annotations

import random
from itertools import product
from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_node import AGENT_PHASES, AgentNode
from gridpeers.plant.plant_config import ScheduledAction
from gridpeers.plant.plant_node import PHASES, PlantNode
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.messages import Command, Leave, Message, Prepare, Ready, Stop
from gridpeers.wire.node import Fetch, Publish
from gridpeers.wire.phases import Phases, PhaseTable
from tests.hostile.scenes import EPOCH, KEYS, NAMES, T_C, measurement, plate, state
from tests.toy.toy_configs import agent_config, toy_configs
from tests.toy.toy_plant import ToyPlant

RECORDER = KEYS.alive_recorder("history")


def node_of(kind: type, clock: Any, rng: random.Random) -> Any:
    if kind is AgentNode:
        return AgentNode(replace(agent_config("inv1"), epoch=EPOCH, clock=clock), "a")
    config, _ = toy_configs(3, spares=("inv3",) if rng.random() < 0.5 else ())
    moves = (ScheduledAction(t=0.04, inverter="inv3", action="join"),) if len(config.agents) < 3 else ()
    recorders = ("history",) if rng.random() < 0.3 else ()
    config = replace(config, epoch=EPOCH, recorders=recorders, clock=clock, schedule=moves)
    return PlantNode(config, ToyPlant(config))


def walk(node: Any, rng: random.Random) -> None:
    """Give a node events until it has finished, with its driver's part."""
    now, heard, roster, asked = 100.0, 0, 0, list[str]()
    late = rng.choice((0.02, 0.5))
    often: tuple[str, ...] = ("measurement", "state", "ready", "token", "token", "answer", "deadline") * 4
    seldom = "plant", "plant", "prepare", "recorder", "leave", "stop", "quit"
    steps = rng.choice(((0.0, 0.001, T_C, T_C, 0.5), (T_C,)))
    if isinstance(node, AgentNode) and steps == (T_C,):
        often = ("measurement", "deadline", "deadline", "token") * 12  # no neighbour is heard
    node.start(now)
    for _ in range(400):
        tick, used = heard if isinstance(node, AgentNode) else node.stepper.tick, node.post.used
        now += rng.choice(steps)
        name, event = rng.choice(NAMES), rng.choice(often + seldom)
        own: dict[str, Any] = dict(sender=name, epoch=EPOCH, t=0.0)
        plant: dict[str, Any] = dict(sender="plant", epoch=EPOCH, t=0.0)
        tokens = {"token": KEYS.alive_agent(name, "a"), "plant": KEYS.alive_plant(EPOCH), "recorder": RECORDER}
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
        elif event == "quit" and rng.random() < 0.2:
            node.leave("enough") if isinstance(node, AgentNode) else node.interrupt("enough", now)
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
        if isinstance(node, AgentNode) and node.session_broken:
            node.start(now)
        if node.finished:
            break


@pytest.mark.parametrize(("kind", "table"), [(AgentNode, AGENT_PHASES), (PlantNode, PHASES)])
def test_no_order_of_honest_events_leads_out_of_the_table_of_phases(
    kind: type, table: PhaseTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A transition that the table lacks would be a PhaseError, and one that never happens is none."""
    seen, on = set[tuple[str, str]](), Phases.on

    def noted(phases: Phases, event: str) -> None:
        seen.add((phases.now, event))
        on(phases, event)

    monkeypatch.setattr(Phases, "on", noted)
    for seed, clock in product(range(60), ("simulated", "realtime")):
        rng = random.Random(seed)
        walk(node_of(kind, clock, rng), rng)
    all_of = {(phase, event) for phase, events in table.items() for event in events}
    assert seen >= {it for it in all_of if "hold" not in it and "holding" not in it}  # a recorder would stand still
