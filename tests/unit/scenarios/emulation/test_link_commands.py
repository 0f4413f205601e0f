"""Emulated links in front of a node, and commands that change them in a live run."""

from __future__ import annotations

import random
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from gridpeers.agents.agent_node import AgentNode
from gridpeers.agents.upkeep import LinkCommandReceiver
from gridpeers.netem.fault_schedule import Heal
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.plant.plant_node import PlantNode
from gridpeers.plant.realtime.run_commands import LinkCommandSender
from gridpeers.scenarios.emulation.emulated_links import EmulatedLinks
from gridpeers.scenarios.emulation.link_data import EVERYTHING, EmulationConfig, LinkCommand
from gridpeers.wire.codec import decode
from gridpeers.wire.links import CommandEffect
from gridpeers.wire.messages import PLANT, LinkAcknowledgement, LinkRequest, Measurement, State
from gridpeers.wire.node import Publish
from gridpeers.wire.post import Post
from tests.toy.toy_configs import agent_config
from tests.unit.agents import realtime_lab as agent_side
from tests.unit.plant.plant_lab import KEYS
from tests.unit.plant.realtime import realtime_lab as plant_side

SETUP = EmulationConfig(netem=Netem(), microgrids={"inv1": "mg1", "inv2": "mg1", "inv3": "mg1"})

CUT = LinkCommand(fault=Fault(on="inv2 -> inv1", cut=True)).to_tree()


def agent_lab() -> agent_side.Lab:
    """The agent of inv1, which ticks and hears inv2, behind links without a fault."""
    lab = agent_side.Lab()
    lab.side = AgentNode(replace(agent_config("inv1"), clock="realtime"), "me", EmulatedLinks("inv1", SETUP))
    lab.side.start(lab.now)
    lab.token("plant")
    lab.meet("inv2")
    return lab


def plant_lab(setup: EmulationConfig = SETUP) -> plant_side.Lab:
    """The plant with the agents of two inverters, behind links."""
    lab = plant_side.Lab(2)
    lab.node = PlantNode(lab.node.config, lab.toy, EmulatedLinks("plant", setup))
    lab.node.start(lab.now)
    lab.join("inv1", "inv2")
    return lab


def link_command(lab: agent_side.Lab, number: int, t: float, tree: dict[str, Any] = CUT, life: int = 1) -> None:
    message = LinkRequest(sender="plant", epoch=life, seq=number, t=t, link_command=tree, reply_to="z1")
    lab.hear(agent_side.KEYS.link_request("inv1"), message)


def answers(lab: agent_side.Lab) -> list[tuple[int, bool, str]]:
    return [(m.seq, m.ok, m.text) for m in lab.published if isinstance(m, LinkAcknowledgement)]


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_every_agent_takes_every_command_once_and_in_turn(seed: int) -> None:
    """Every command arrives once, in spite of losses on either way and of restarts of the agent's process."""
    rng, taken, now = random.Random(seed), list[int](), 0.0

    class Note:
        def command(self, tree: dict[str, Any], t: float) -> CommandEffect:
            return CommandEffect("", (), "")

    class Taking(Note):
        def command(self, tree: dict[str, Any], t: float) -> CommandEffect:
            taken.append(tree["number"])
            return super().command(tree, t)

    post = Post(PLANT, "toy", 1)
    plant = LinkCommandSender(post, Note(), lambda payload: None)  # type: ignore[arg-type]
    agent: Any = LinkCommandReceiver("inv1", 1, Taking())  # type: ignore[arg-type]
    given_so_far = 0
    for step in range(60):
        loss = 0.5 if step < 45 else 0.0
        now += 0.4
        if rng.random() < 0.3 and step < 45:
            given_so_far += 1
            plant.give({"number": given_so_far}, now, "z1")
        if rng.random() < 0.05 and step < 45:
            plant.forget("inv1")
            agent = LinkCommandReceiver("inv1", 1, Taking())  # type: ignore[arg-type]
            taken.clear()
        plant.send(("inv1",), now)
        for action in post.take_actions():
            assert isinstance(action, Publish)
            command = decode(action.payload)
            if not isinstance(command, LinkRequest):
                continue
            answer = agent.take(command, now) if rng.random() >= loss else None
            if answer is not None and rng.random() >= loss:
                plant.on_answer(answer, b"", now)
    plant.send(("inv1",), now + 10.0)

    assert taken == [number + 1 for number in range(given_so_far)]
    assert post.take_actions() == []


def test_a_command_holds_from_one_control_period_later_on_and_is_sent_before_the_measurement() -> None:
    """The plant tells everybody in the wake in which it hears of it; who joins later hears all before he measures."""
    lab = plant_lab()
    lab.step(3)
    lab.sent.clear()
    assert lab.node.deadline is not None
    lab.now = lab.node.deadline
    answer = lab.ask("link", CUT)
    lab.step()
    kinds = [type(message) for key, message in lab.sent if key.endswith("/inv1")]
    requests = lab.take(LinkRequest)
    lab.token("inv2", gone=True)
    lab.join("inv2", instance="b", epoch=2)
    lab.step()
    again = [(key, m.seq) for key, m in lab.sent if isinstance(m, LinkRequest)]

    assert answer.ok
    assert answer.text == "inv2 -> inv1: cut"
    assert answer.data == {"number": 1, "t": 0.08, "asked": ["inv1", "inv2"], "receivers": ["inv1"]}
    assert kinds == [LinkRequest, Measurement]
    assert [(m.seq, m.t, m.link_command) for m in requests] == [(1, 0.08, CUT)] * len(requests) != []
    assert again == [(KEYS.link_request("inv2"), 1)]
    assert not lab.ask("link", LinkCommand(fault=Fault(on="inv2 -> inv1", loss=20.0)).to_tree()).ok
    assert [event.text for event in lab.events("command")] == ["link command 1: inv2 -> inv1: cut, from t = 0.08 s on"]


def test_a_heal_counts_the_links_that_have_a_fault_and_says_so_if_there_is_none() -> None:
    """Of all links the cut one is healed, once; a fault that the scenario has for later is none, and still comes."""
    later = Fault(on="inv1 -> plant", delay=0.1, from_s=5.0)
    lab = plant_lab(replace(SETUP, netem=Netem(links=(later,))))
    lab.ask("link", CUT)
    lab.step()
    heal = LinkCommand(heal=Heal(on=EVERYTHING, from_s=0.0)).to_tree()
    first = lab.ask("link", heal)
    lab.step()
    again = lab.ask("link", heal)
    lab.step()

    assert (first.text, first.data["receivers"]) == ("all links: 1 link healed", ["inv1"])
    assert (again.text, again.data["receivers"]) == ("all links: no link has a fault", [])
    assert [event.text.partition(", from")[0] for event in lab.events("command")[1:]] == [
        "link command 2: all links: 1 link healed",
        "link command 3: all links: no link has a fault",
    ]
    links = lab.node.links
    assert links is not None
    assert (links.impaired(4.9), links.impaired(5.0)) == ((), ("inv1",))


def test_an_agent_acts_at_its_next_tick_after_the_command_came() -> None:
    """Messages sent before a cut count, later ones do not; healed, they do again."""
    lab = agent_lab()
    lab.measure(0)
    lab.state("inv2", 0, 0.0, P_set=60e3)
    link_command(lab, 1, 0.02)
    lab.measure(1)
    lab.state("inv2", 1, 0.02, P_set=90e3)
    lab.go(0.0)
    before = lab.age("inv2")
    link_command(lab, 2, 0.04, LinkCommand(heal=Heal(on="* -> inv1", from_s=0.0)).to_tree())
    lab.measure(2)
    lab.state("inv2", 2, 0.04, P_set=70e3)
    lab.go(0.02)

    assert (before, lab.age("inv2")) == (0.02, 0.0)
    assert answers(lab) == [(1, True, "inv2 -> inv1"), (2, True, "inv2 -> inv1")]


def test_before_the_plant_has_spoken_nothing_of_a_neighbour_is_used() -> None:
    """An agent that is started again might otherwise hear through a link that was cut meanwhile."""
    lab = agent_lab()
    lab.state("inv2", 0, 3.0, P_set=90e3)
    link_command(lab, 1, 2.0)
    lab.measure(150)
    lab.state("inv2", 1, 3.0, P_set=90e3)
    lab.go(0.0)

    assert lab.age("inv2") == float("inf")
    assert lab.status().impaired == ("inv2",)


def test_another_plant_begins_without_the_commands_of_the_former() -> None:
    """Its run starts at 0: what held from 30 s on would come again; and what its ghost commands is refused."""
    lab = agent_lab()
    link_command(lab, 1, 0.0)
    lab.measure(0)
    lab.go(0.0)
    first = lab.status().impaired
    lab.token("plant", gone=True)
    lab.token("plant", epoch=2)
    lab.measure(0, epoch=2)
    link_command(lab, 2, 0.0, life=1)
    lab.go(0.5)
    link_command(lab, 1, 0.0, LinkCommand(fault=Fault(on="inv3 -> inv1", cut=True)).to_tree(), life=2)
    lab.measure(1, epoch=2)
    lab.go(0.5)

    assert (first, lab.status().impaired) == (("inv2",), ("inv3",))
    assert lab.side.rejects.counts["ghost"] == 1


def test_what_links_drop_counts_as_lost() -> None:
    """Whoever watches sees it while it lasts: the numbers of who sent them show only what the wire has lost."""
    lab = agent_lab()
    link_command(lab, 1, 0.0)
    for k in range(1, 40):
        lab.measure(k)
        if k != 20:  # that one is lost before it comes to the link
            lab.state("inv2", k, k * 0.02)
        lab.go(0.02)
    lab.go(0.5)
    during = lab.status().lost
    lab.token("plant", gone=True)
    lab.token("plant", epoch=2)
    lab.measure(0, epoch=2)
    lab.go(0.5)

    assert during == 39
    assert lab.status().lost == 39


PAUSE = NodeFault(name="inv1", from_s=1.7, to_s=2.7, pause=True)


def test_a_paused_agent_takes_what_has_come_when_it_goes_on() -> None:
    """Nothing is taken during the pause, all of it at its end, and later messages at once."""
    config = EmulationConfig(netem=Netem(nodes=(PAUSE,)), microgrids={"inv1": "mg1", "inv2": "mg1"})
    side, found = EmulatedLinks("inv1", config), dict[float, list[float]]()
    for k in range(40):
        side.offer(State(sender="inv2", epoch=1, seq=k, t=0.1 * k, P_set=0.0, V_set=277.0, Q=0.0), b"state", 0.1 * k)
        for arrival in side.due(0.1 * k + 1e-9):
            found.setdefault(round(0.1 * k, 1), []).append(round(arrival.message.t, 1))

    assert [t for t in found if 1.65 < t < 2.65] == []
    assert found[2.7] == [round(0.1 * k, 1) for k in range(17, 28)]
    assert found[2.8] == [2.8]
