"""What a client of a run keeps of the tokens that anybody may hold."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from gridpeers.scenarios.live import run_client as client
from gridpeers.scenarios.live.run_address import address_of
from gridpeers.scenarios.live.run_client import RunClient
from gridpeers.scenarios.live.run_monitor import RunMonitor, RunTokens
from gridpeers.scenarios.live.watching import RunSubscriber
from gridpeers.wire.bounds import MOST_INVERTERS
from gridpeers.wire.driver.inbox import MOST_TOKENS, Inbox
from gridpeers.wire.keys import Keys
from gridpeers.wire.membership import MOST_PROCESSES
from gridpeers.wire.node import MOST_PLANTS
from tests.toy.toy_configs import agent_config

LAB, MINE = Keys("lab"), Keys("mine")


class Line:
    """Stands for Zenoh behind a real inbox: what the test puts on it waits there."""

    id, misplaced, moved = "1", False, False

    def __init__(self) -> None:
        self.inbox = Inbox()
        self.subscribed: list[str] = []
        self.subscribe = self.subscribed.append

    def appear(self, tokens: Iterable[str]) -> None:
        """Let tokens appear."""
        for token in tokens:
            self.inbox.put(("appeared", token, b""))

    def vanish(self, tokens: Iterable[str]) -> None:
        """Let tokens vanish."""
        for token in tokens:
            self.inbox.put(("vanished", token, b""))

    def take(self, count: int, seconds: float) -> list[Any]:
        """All that waits."""
        return self.inbox.take(0, 0.0)

    def __getattr__(self, name: str) -> Any:
        return lambda *_, **__: None


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Line:
    """The line of every client from now on."""
    made = Line()
    monkeypatch.setattr(client, "Session", lambda *_, **__: made)
    return made


def take_all(at: RunClient) -> None:
    """Let the client see all that has come."""
    assert list(at.take(0.0)) == []


def strangers(names: int, instances: int) -> list[str]:
    """Tokens of names that no run has."""
    return [LAB.alive_agent(f"who{name}", f"a{one}") for one in range(instances) for name in range(names)]


def test_a_client_keeps_a_bounded_number_of_tokens(line: Line) -> None:
    """Of strangers' tokens as many wait as with an agent, and each kind has the room that it has there."""
    at = RunClient(address_of("lab", None))
    line.appear([LAB.alive_plant(7), *strangers(3 * MOST_TOKENS, 1)])
    (loss,) = line.inbox.take_losses()

    assert loss.number == 2 * MOST_TOKENS + 1
    take_all(at)
    assert (at.plant, len(at.present)) == (True, MOST_INVERTERS)


def test_what_a_client_has_noted_is_seen_to_go_and_to_come_back_in_a_flood(line: Line) -> None:
    """`gridpeers watch` shows an agent as gone although thousands of strangers' tokens wait."""
    at = RunClient(address_of("lab", None))
    own = [LAB.alive_plant(7), LAB.alive_agent("inv1", "a"), LAB.alive_agent("inv2", "b")]
    line.appear(own)
    take_all(at)
    line.appear(strangers(MOST_INVERTERS // 2, 3 * MOST_TOKENS // MOST_INVERTERS * 2))
    line.vanish([own[0], own[2]])
    _ = list(at.take(0.0))

    assert (at.plant, "inv1" in at.present, "inv2" in at.present) == (False, True, False)
    line.appear([own[0], own[2]])
    take_all(at)
    assert (at.plant, {"inv1", "inv2"} <= set(at.present)) == (True, True)


def test_a_watcher_subscribes_to_a_bounded_number_of_strangers_and_to_every_inverter(line: Line) -> None:
    """Each subscription is known to every process of the run; the run's own inverters have theirs whatever comes."""
    at, monitor = RunClient(address_of("lab", None)), RunMonitor("lab")
    subscriber = RunSubscriber(at, monitor)
    for turn in range(3):
        names = [LAB.alive_agent(f"who{turn}-{name}", "a") for name in range(MOST_INVERTERS)]
        line.appear(names)
        subscriber.take(0.0)
        line.vanish(names)
        subscriber.take(0.0)
    monitor.config(agent_config("inv1", 3))
    subscriber.take(0.0)
    statuses = [key for key in line.subscribed if key.startswith(LAB.status(""))]

    assert len(statuses) == len(set(statuses)) == MOST_INVERTERS + 1
    assert statuses[-1] == LAB.status("inv1")


def test_each_kind_of_token_has_room_of_its_own() -> None:
    """Plants that hold many epochs, runs that do not exist, a name that many claim: none keeps the others out."""
    tokens = RunTokens("lab")
    for number in range(2 * MOST_PLANTS):
        tokens.appeared(LAB.alive_plant(number))
        tokens.appeared(Keys(f"run{number}").alive_plant(1))
        tokens.appeared(LAB.alive_agent("inv1", f"a{number}"))
        tokens.appeared(LAB.alive_recorder(f"r{number}"))
    tokens.appeared(LAB.alive_agent("inv2", "a"))

    assert tokens.epochs == set(range(MOST_PLANTS))
    assert tokens.runs == {"lab", *(f"run{number}" for number in range(MOST_PLANTS))}
    assert {name: len(of) for name, of in tokens.agents.items()} == {"inv1": MOST_PROCESSES, "inv2": 1}
    assert not tokens.is_noted(LAB.alive_recorder("r1"))


def test_what_has_gone_leaves_nothing() -> None:
    """Nor does the end of a token for which there was no room; of two plants of another run one stays."""
    tokens = RunTokens("lab")
    there = [
        LAB.alive_plant(7), MINE.alive_plant(1), MINE.alive_plant(2), *strangers(1, MOST_PROCESSES + 1),
        LAB.alive_agent("inv1", "a"),
    ]  # fmt: skip
    for key in there:
        tokens.appeared(key)
    tokens.vanished(MINE.alive_plant(1))

    assert tokens.runs == {"lab", "mine"}
    assert [key for key in there if not tokens.is_noted(key)] == [there[1], there[2 + MOST_PROCESSES + 1]]
    for key in there:
        tokens.vanished(key)
    assert (tokens.epochs, tokens.runs, tokens.agents) == (set(), set(), {})
    assert not any(map(tokens.is_noted, there))
