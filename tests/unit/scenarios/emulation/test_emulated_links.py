"""Faults of nodes at the ends of emulated links, and what hours of live commands leave behind."""

from __future__ import annotations

import random
from typing import Any

import pytest

from gridpeers.netem import fault_schedule
from gridpeers.netem.fault_schedule import MOST_SPANS, PAST, Heal, LinkSchedules
from gridpeers.netem.models.medium import Cut
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.netem.schema.pattern import links_among
from gridpeers.scenarios.emulation.emulated_links import EmulatedLinks
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.wire.messages import State

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
