"""Emulated links in front of a node, and commands that change them in a live run."""

from __future__ import annotations

import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from gridpeers.agents.link_command_receiver import LinkCommandReceiver
from gridpeers.agents.realtime_agent import RealtimeAgent
from gridpeers.netem import fault_schedule
from gridpeers.netem.fault_schedule import MOST_SPANS, PAST, Heal, LinkSchedules
from gridpeers.netem.models.medium import Cut
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.netem.schema.pattern import links_among
from gridpeers.plant.realtime.realtime_plant import RealtimePlant
from gridpeers.plant.realtime.run_commands import LinkCommandSender
from gridpeers.scenarios.emulation.emulated_links import EmulatedLinks
from gridpeers.scenarios.emulation.link_data import EVERYTHING, EmulationConfig, LinkCommand, decode_statuses
from gridpeers.wire.codec import decode
from gridpeers.wire.links import CommandEffect
from gridpeers.wire.messages import LinkAcknowledgement, LinkRequest, Measurement, State
from tests.toy.toy_configs import agent_config, toy_configs
from tests.toy.toy_plant import ToyPlant
from tests.unit.agents import realtime_lab as agent_side
from tests.unit.plant.realtime import realtime_lab as plant_side

SETUP = EmulationConfig(netem=Netem(), microgrids={"inv1": "mg1", "inv2": "mg1", "inv3": "mg1"})

CUT = LinkCommand(fault=Fault(on="inv2 -> inv1", cut=True)).to_tree()


def agent_lab() -> agent_side.Lab:
    """The agent of inv1, which ticks and hears inv2, behind links without a fault."""
    lab = agent_side.Lab()
    lab.side = RealtimeAgent(replace(agent_config("inv1"), clock="wall"), "me", EmulatedLinks("inv1", SETUP))
    lab.side.start(lab.now)
    lab.token("plant")
    lab.meet("inv2")
    return lab


def link_command(lab: agent_side.Lab, number: int, t: float, tree: dict[str, Any] = CUT, life: int = 1) -> None:
    """A link command of the plant comes in."""
    message = LinkRequest(sender="plant", epoch=life, seq=number, t=t, link_command=tree, reply_to="z1")
    lab.hear(agent_side.KEYS.link_request("inv1"), message)


def answers(lab: agent_side.Lab) -> list[tuple[int, bool, str]]:
    """Answers of the agent so far."""
    return [(m.seq, m.ok, m.text) for m in lab.published if isinstance(m, LinkAcknowledgement)]


@given(st.integers(0, 10_000))
def test_every_agent_takes_every_command_once_and_in_turn(seed: int) -> None:
    """Every command arrives once, in spite of losses on either way and of restarts of the agent's process."""
    rng, taken, now = random.Random(seed), list[int](), 0.0
    wire: list[LinkRequest] = []

    class Note:
        def command(self, tree: dict[str, Any], t: float) -> CommandEffect:
            return CommandEffect("", (), "")

    class Taking(Note):
        def command(self, tree: dict[str, Any], t: float) -> CommandEffect:
            taken.append(tree["number"])
            return super().command(tree, t)

    def publish(key: str, payload: bytes) -> None:
        message = decode(payload)
        if key == plant_side.KEYS.link_request("inv1") and isinstance(message, LinkRequest):
            wire.append(message)

    plant = LinkCommandSender(1, plant_side.KEYS, Note(), publish)  # type: ignore[arg-type]
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
        sent, wire[:] = list(wire), []
        for command in sent:
            answer = agent.take(command, now) if rng.random() >= loss else None
            if answer is not None and rng.random() >= loss:
                plant.answered(answer)
    plant.send(("inv1",), now + 10.0)

    assert taken == [number + 1 for number in range(given_so_far)]
    assert wire == []


def test_a_command_holds_from_one_control_period_later_on_and_is_sent_before_the_measurement() -> None:
    """The plant tells everybody in the wake in which it hears of it; who joins later hears all before he measures."""
    lab = plant_side.Lab(2)
    config, _ = toy_configs(2, end=2.0)
    lab.side = RealtimePlant(replace(config, clock="wall"), lab.toy, EmulatedLinks("plant", SETUP))
    lab.side.start(lab.now)
    lab.join("inv1")
    lab.join("inv2")
    lab.step(3)
    lab.sent.clear()
    lab.now = lab.side.deadline
    answer = lab.ask("link", CUT)
    lab.step()
    kinds = [type(message) for key, message in lab.sent if key.endswith("/inv1")]
    requests = lab.take(LinkRequest)
    lab.token("inv2", gone=True)
    lab.join("inv2", instance="b", life=2)
    lab.step()
    again = [(key, m.seq) for key, m in lab.sent if isinstance(m, LinkRequest)]

    assert answer.ok
    assert answer.text == "inv2 -> inv1: cut"
    assert answer.data == {"number": 1, "t": 0.08, "asked": ["inv1", "inv2"], "receivers": ["inv1"]}
    assert kinds == [LinkRequest, Measurement]
    assert [(m.seq, m.t, m.link_command) for m in requests] == [(1, 0.08, CUT)] * len(requests) != []
    assert again == [(plant_side.KEYS.link_request("inv2"), 1)]
    assert not lab.ask("link", LinkCommand(fault=Fault(on="inv2 -> inv1", loss=20.0)).to_tree()).ok
    assert [event.text for event in lab.events("link")] == ["link command 1: inv2 -> inv1: cut, from t = 0.08 s on"]


def test_a_heal_names_only_links_that_have_a_fault_and_says_so_if_there_is_none() -> None:
    """Of all links the cut one is healed, once; a fault that the scenario has for later is none, and still comes."""
    later = Fault(on="inv1 -> plant", delay=0.1, from_s=5.0)
    setup = replace(SETUP, netem=Netem(links=(later,)))
    lab = plant_side.Lab(2)
    config, _ = toy_configs(2, end=9.0)
    links = EmulatedLinks("plant", setup)
    lab.side = RealtimePlant(replace(config, clock="wall"), ToyPlant(config), links)
    lab.side.start(lab.now)
    lab.join("inv1", "inv2")
    lab.ask("link", CUT)
    lab.step()
    heal = LinkCommand(heal=Heal(on=EVERYTHING, from_s=0.0)).to_tree()
    first = lab.ask("link", heal)
    lab.step()
    again = lab.ask("link", heal)
    lab.step()

    assert (first.text, first.data["receivers"]) == ("inv2 -> inv1: healed", ["inv1"])
    assert (again.text, again.data["receivers"]) == ("all links: no link has a fault, nothing to heal", [])
    assert [event.text.partition(", from")[0] for event in lab.events("link")[1:]] == [
        "link command 2: inv2 -> inv1: healed",
        "link command 3: all links: no link has a fault, nothing to heal",
    ]
    assert (links.impaired(4.9), links.impaired(5.0)) == ((), ("inv1",))


def test_a_link_with_a_fault_that_is_yet_to_come_was_not_impaired_before() -> None:
    """`link show` lists links that are impaired now or were, though messages over other links are counted as well."""
    fault = Fault(on="inv2 -> inv1", loss=0.5, from_s=2.0, to_s=3.0)
    links = EmulatedLinks("inv1", replace(SETUP, netem=Netem(links=(fault,))))
    for k in range(200):
        state = State(sender="inv2", epoch=1, seq=k, t=0.02 * k, P_set=0.0, V_set=277.0, Q=0.0)
        links.offer(state, b"state", state.t)

    assert [set(decode_statuses(links.status(t))) for t in (1.9, 2.0, 4.0)] == [set(), {"inv2"}, {"inv2"}]


def test_a_late_heal_looks_at_no_command_of_before_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many commands a run has had, the next one is held against each link once: a plant must not pause."""
    looks: list[object] = []
    plain = fault_schedule.changed

    def counted(*given: Any) -> Any:
        looks.append(given[1])
        return plain(*given)

    monkeypatch.setattr(fault_schedule, "changed", counted)
    links = EmulatedLinks("plant", SETUP)
    heal = LinkCommand(heal=Heal(on="inv2 -> inv1", from_s=0.0)).to_tree()
    costs = []
    for k in range(20):
        for tree in (CUT, heal):
            before = len(looks)
            effect = links.command(tree, 10.0 * k + (5.0 if tree is heal else 0.0))
            costs.append(len(looks) - before)
            assert effect.receivers == ("inv1",)

    assert max(costs) == len(links_among(SETUP.microgrids))


def test_an_unanswered_command_is_sent_again_and_the_answer_goes_to_who_gave_it() -> None:
    """A lost message costs a second, not the command."""
    lab = plant_side.Lab(2)
    config, _ = toy_configs(2, end=9.0)
    lab.side = RealtimePlant(replace(config, clock="wall"), ToyPlant(config), EmulatedLinks("plant", SETUP))
    lab.side.start(lab.now)
    lab.join("inv1", "inv2")
    lab.ask("link", CUT)
    answer = LinkAcknowledgement(sender="inv2", epoch=1, seq=1, t=0.0, ok=True, text="", reply_to="z1")
    lab.hear(plant_side.KEYS.link_acknowledgement("inv2"), answer)
    passed_on = [message for key, message in lab.sent if key == plant_side.KEYS.answer("z1")]
    lab.step()
    lab.sent.clear()
    lab.step(60)

    assert answer in passed_on
    assert [key for key, m in lab.sent if isinstance(m, LinkRequest)] == [plant_side.KEYS.link_request("inv1")]


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
            lab.state("inv2", k, k * agent_side.T_C)
        lab.go(agent_side.T_C)
    lab.go(0.5)
    during = lab.status().lost
    lab.token("plant", gone=True)
    lab.token("plant", epoch=2)
    lab.measure(0, epoch=2)
    lab.go(0.5)

    assert during == 39
    assert lab.status().lost == 39


PAUSE = NodeFault(name="inv1", from_s=1.7, to_s=2.7, pause=True)


def _arrivals(*links: Fault) -> dict[float, list[float]]:
    """Times (s) at which states of inv2 were sent, by the tick at which inv1, paused from 1.7 to 2.7 s, takes them."""
    config = EmulationConfig(netem=Netem(links=links, nodes=(PAUSE,)), microgrids={"inv1": "mg1", "inv2": "mg1"})
    side, found = EmulatedLinks("inv1", config), dict[float, list[float]]()
    sent = {k: State(sender="inv2", epoch=1, seq=k, t=0.1 * k, P_set=0.0, V_set=277.0, Q=0.0) for k in range(40)}
    for k, state in sent.items():
        side.offer(state, b"state", state.t)
        for arrival in side.due(0.1 * k + 1e-9):
            assert isinstance(arrival.message, State)
            found.setdefault(round(0.1 * k, 1), []).append(round(arrival.message.t, 1))
    return found


def test_a_paused_agent_takes_what_has_come_when_it_goes_on() -> None:
    """Nothing is taken during the pause, all of it at its end, and later messages at once."""
    found = _arrivals()

    assert [t for t in found if 1.65 < t < 2.65] == []
    assert found[2.7] == [round(0.1 * k, 1) for k in range(17, 28)]
    assert found[2.8] == [2.8]


def test_a_delay_goes_by_while_the_receiver_is_paused() -> None:
    """What a cut held until 2.1 s is there at 2.7 s: its link has long delivered it, and nothing waits behind."""
    found = _arrivals(Fault(on="inv2 -> inv1", from_s=1.5, to_s=2.1, cut=Cut(hold=True)))

    assert found[2.7] == [round(0.1 * k, 1) for k in range(15, 28)]
    assert found[2.8] == [2.8]


def test_a_message_that_is_still_on_its_way_at_the_end_of_a_pause_comes_later() -> None:
    """A link of 0.3 s delivers at 2.7 s what was sent by 2.4 s."""
    found = _arrivals(Fault(on="inv2 -> inv1", delay=0.3))

    assert found[2.7] == [round(0.1 * k, 1) for k in range(14, 25)]
    assert found[2.8] == [2.5]


MICROGRIDS = {"inv1": "mg1", "inv2": "mg1", "inv3": "mg2"}
ENTRIES = (Fault(on="inv1 -> inv2", delay=0.1, from_s=100.0), Fault(on="inv3 <-> *", loss=0.1, from_s=2.0, to_s=900.0))
PATTERNS = ("inv1 <-> inv2", "* <-> *", "* -> inv3", "plant <-> inv1", "{*, plant} <-> {*, plant}")


def _commands(end: float) -> list[tuple[dict[str, Any], float]]:
    """Commands every five seconds or so, of which some hold from a little before the one that came first."""
    rng, t, commands = random.Random(7), 1.0, list[tuple[dict[str, Any], float]]()
    while t < end:
        t += rng.uniform(-3.0, 13.0)
        tree: dict[str, Any] = {"heal": {"on": rng.choice(PATTERNS), "from_s": 0.0}}
        if rng.random() < 0.6:
            kind: dict[str, Any] = rng.choice([{"cut": True}, {"loss": 0.2}, {"delay": 0.05}])
            tree = {"fault": {"on": rng.choice(PATTERNS), **kind}}
            tree |= {"for_s": rng.uniform(1.0, 20.0)} if rng.random() < 0.5 else {}
        commands.append((tree, max(0.0, t)))
    return commands


def _effects_and_arrivals(commands: list[tuple[dict[str, Any], float]]) -> list[Any]:
    """What each command does, as people are told, and which of the messages after it come when."""
    config = EmulationConfig(netem=Netem(links=ENTRIES), microgrids=MICROGRIDS)
    links, found, seq = EmulatedLinks("inv1", config), list[Any](), 0
    for tree, t in commands:
        found.append(links.command(tree, t))
        for sender in ("inv2", "inv3"):
            seq += 1
            links.offer(State(sender=sender, epoch=1, seq=seq, t=t, P_set=0.0, V_set=277.0, Q=0.0), b"state", t)
        found += [(arrival.src, arrival.delay) for arrival in links.due(t + 0.2)]
        found.append(links.impaired(t))
    return [*found, links.status(commands[-1][1])]


def test_a_run_with_many_commands_says_and_does_the_same_without_the_faults_that_are_long_over(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A heal names the same links, and every message has the same fate, whatever is forgotten meanwhile."""
    commands = _commands(900.0)
    bounded = _effects_and_arrivals(commands)
    monkeypatch.setattr(fault_schedule, "MOST_SPANS", len(commands))

    assert len(commands) > 150
    assert bounded == _effects_and_arrivals(commands)


def test_a_change_that_comes_out_of_order_keeps_no_old_fault() -> None:
    """After one at 1000 s and a late one of 30 s, the next one forgets all that ended before 940 s."""
    schedules, link = LinkSchedules(Netem(), MICROGRIDS), links_among(MICROGRIDS)[0]
    on, count = f"{link.src} -> {link.dst}", MOST_SPANS + 4
    for k in range(count):
        schedules.apply(Fault(on=on, cut=Cut(), from_s=float(k), to_s=k + 0.5))
    for t in (1000.0, 30.0):
        schedules.apply(Fault(on=on, delay=0.1, from_s=t, to_s=t + 1.0))
    assert len(schedules.of(link).spans) == count + 2
    schedules.apply(Heal(on=on, from_s=1000.5))

    assert [span.from_s for span in schedules.of(link).spans] == [1000.0]


def test_links_of_the_whole_run_keep_a_bounded_number_of_faults_however_long_it_is() -> None:
    """Every process has the schedules of all links: of each some faults stay, and those of the last minute."""
    commands, most = _commands(3600.0), 0
    schedules = LinkSchedules(Netem(links=ENTRIES), MICROGRIDS)
    for tree, t in commands:
        to_s = t + tree.get("for_s", 5.0)
        if "fault" in tree:
            schedules.apply(Fault(on=tree["fault"]["on"], cut=Cut(), from_s=t, to_s=to_s))
        else:
            schedules.apply(Heal(on=tree["heal"]["on"], from_s=t))
        most = max(most, *(len(schedules.of(link).spans) for link in links_among(MICROGRIDS)))

    assert MOST_SPANS <= most <= MOST_SPANS + PAST / 5.0
