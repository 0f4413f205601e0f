"""What those who only look on and record believe: commands, `watch`, the record of links; the tokens that they keep."""

from __future__ import annotations

import random
from collections.abc import Iterable
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from gridpeers.netem.ledger import LinkCounts
from gridpeers.scenarios.live import run_client as client
from gridpeers.scenarios.live.run_address import address_of
from gridpeers.scenarios.live.run_client import RunClient
from gridpeers.scenarios.live.run_monitor import RunMonitor, RunTokens
from gridpeers.scenarios.live.run_requests import read_config
from gridpeers.scenarios.live.watching import RunSubscriber, plain
from gridpeers.scenarios.results.link_record import LinkRecord
from gridpeers.wire.codec import RejectedError, decode, encode
from gridpeers.wire.driver.inbox import Inbox
from gridpeers.wire.keys import Keys
from gridpeers.wire.membership import MOST_PROCESSES
from gridpeers.wire.messages import MOST_INVERTERS, AgentStatus, LinkReport, LinkRequest, Message, Telemetry
from tests.hostile.cases import Truth, hostile
from tests.toy.toy_configs import agent_config
from tests.toy.toy_runs import by_link

KEYS = Keys("lab")
NAMES = ("inv1", "inv2")

Event = tuple[str, str, bytes, float]


class Line:
    """Stands for Zenoh: what the test puts on it comes in."""

    id, misplaced = "1", False

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.inbox = Inbox()
        self.subscribed: list[str] = []
        self.subscribe = self.subscribed.append

    def take(self, count: int, seconds: float) -> list[Event]:
        events, self.events = self.events, []
        return [*events, *self.inbox.take(0, 0.0)]

    def put(self, kind: str, tokens: Iterable[str]) -> None:
        """Let tokens appear or vanish, as far as the inbox has room."""
        for token in tokens:
            self.inbox.put((kind, token, b""))

    def __getattr__(self, name: str) -> Any:
        return lambda *_, **__: None


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Line:
    made = Line()
    monkeypatch.setattr(client, "Session", lambda *_, **__: made)
    return made


def telemetry(t: float, epoch: int = 7, inverters: tuple[str, ...] = NAMES) -> Telemetry:
    row = (t, *(60.0, 5e4, 0.0, 277.0, 5e4, 277.0) * len(inverters))
    return Telemetry(
        sender="plant", epoch=epoch, seq=0, t=t, inverters=inverters, rows=(row,), events=(), final=False,
        outcome="", reproducible=False,
    )  # fmt: skip


def is_status(message: bytes, key: str) -> bool:
    """Whether these are bytes of a status under its sender's key: a visitor does not know the epochs of agents."""
    try:
        found = decode(message)
    except RejectedError:
        return False
    return isinstance(found, AgentStatus) and key == KEYS.status(found.sender)


def test_a_visitor_shows_the_same_whatever_else_is_published(line: Line) -> None:
    """Telemetry of a plant that is not there, statuses under others' keys, nonsense: no line of the table changes."""
    at = RunClient(address_of("lab", None))
    monitor = RunMonitor("lab")
    subscriber = RunSubscriber(at, monitor)
    keys: Truth = {
        KEYS.telemetry: ("plant", (Telemetry, LinkReport, LinkRequest)),
        **{KEYS.status(name): (name, (AgentStatus,)) for name in NAMES},
    }
    line.events = [
        ("appeared", KEYS.alive_plant(7), b"", 0.0),
        ("message", KEYS.telemetry, encode(telemetry(1.0)), 0.0),
    ]
    subscriber.take(0.1)
    before = plain(monitor.snapshot((), 0.0))
    flood = list(hostile(keys, {"plant": 7, **dict.fromkeys(NAMES, 7)}, random.Random(1)))[::20]
    line.events = [("message", key, payload, 0.0) for key, payload in flood if not is_status(payload, key)]
    sent = len(line.events)
    subscriber.take(0.1)

    assert sent > 1_500
    assert plain(monitor.snapshot((), 0.0)) == before
    assert before.replace("\n", "").isprintable()


def test_a_picture_of_other_inverters_waits_for_their_values() -> None:
    """A plant with other inverters, that has no row yet, does not lend them the former's."""
    monitor = RunMonitor("lab")
    monitor.telemetry(telemetry(1.0), 0.0)
    monitor.telemetry(replace(telemetry(0.0, 8, ("inv1", "inv2", "inv3")), rows=()), 0.1)

    assert [entry.P for entry in monitor.snapshot((), 0.2).inverters] == [None, None, None]


@pytest.mark.parametrize("change", [{"P_rated": 0.0}, {"V_nom": -1.0}, {"name": "\x1b[2J"}, {"m_p": 1e300}])
def test_a_configuration_that_cannot_be_is_none(change: dict[str, Any]) -> None:
    """Nobody divides by a rating of 0, or prints a name that clears the screen."""
    config = agent_config("inv1")

    assert read_config(msgspec.json.encode(config)) == config
    assert read_config(msgspec.json.encode(replace(config, **change))) is None


COUNTS = LinkCounts(sent=1, duplicated=0, delivered=1, dropped={}, corrupted=0, in_flight=0)


def report(body: object, sender: str = "inv1") -> LinkReport:
    return LinkReport(sender=sender, epoch=1, seq=0, t=0.0, data=msgspec.msgpack.encode(body))


@pytest.mark.parametrize("body", [
    {"traces": [["inv2", "inv1", [1, 2], [0.0], ["cut"]]]},
    {"traces": [["inv2", "inv3", [1], [0.0], ["cut"]]]},
    {"traces": [["inv2", "inv1", [-1], [0.0], ["cut"]]]},
    {"counts": {"inv2": {**msgspec.to_builtins(COUNTS), "sent": -1}}},
    7,
])  # fmt: skip
def test_a_book_of_links_that_cannot_be_is_not_recorded(body: object) -> None:
    """Uneven rows, names that are none, links to somebody else: the rest of the record is as if it had not come."""
    record = LinkRecord()
    record(report(body))

    assert record.counts == {}
    assert dict(by_link(record)) == {}


def test_every_message_that_is_sent_can_be_read_by_a_visitor_of_that_plant(line: Line) -> None:
    """And by nobody who sees another plant's token."""
    at = RunClient(address_of("lab", None))
    line.events = [("appeared", KEYS.alive_plant(7), b"", 0.0)]
    list(at.take(0.0))
    said: Message = telemetry(1.0)

    assert at.read(KEYS.telemetry, encode(said)) == said
    assert at.read(KEYS.telemetry, encode(replace(telemetry(1.0), epoch=6))) is None
    assert at.read(KEYS.telemetry, b"nonsense") is None


def take_all(at: RunClient) -> None:
    assert list(at.take(0.0)) == []


def strangers(names: int, instances: int) -> list[str]:
    return [KEYS.alive_agent(f"who{name}", f"a{one}") for one in range(instances) for name in range(names)]


def test_a_watcher_subscribes_to_a_bounded_number_of_strangers_and_to_every_inverter(line: Line) -> None:
    """Each subscription is known to every process of the run; the run's own inverters have theirs whatever comes."""
    at, monitor = RunClient(address_of("lab", None)), RunMonitor("lab")
    subscriber = RunSubscriber(at, monitor)
    for turn in range(3):
        names = [KEYS.alive_agent(f"who{turn}-{name}", "a") for name in range(MOST_INVERTERS)]
        line.put("appeared", names)
        subscriber.take(0.0)
        line.put("vanished", names)
        subscriber.take(0.0)
    monitor.config(agent_config("inv1", 3))
    subscriber.take(0.0)
    statuses = [key for key in line.subscribed if key.startswith(KEYS.status(""))]

    assert len(statuses) == len(set(statuses)) == MOST_INVERTERS + 1
    assert statuses[-1] == KEYS.status("inv1")


def test_a_name_that_many_claim_keeps_no_other_out() -> None:
    """Nor do plants that hold many epochs, or runs that do not exist."""
    tokens = RunTokens("lab")
    for number in range(100):
        tokens.appeared(KEYS.alive_plant(number))
        tokens.appeared(Keys(f"run{number}").alive_plant(1))
        tokens.appeared(KEYS.alive_agent("inv1", f"a{number}"))
        tokens.appeared(KEYS.alive_recorder(f"r{number}"))
    tokens.appeared(KEYS.alive_agent("inv2", "a"))

    assert tokens.epochs == set(range(100))
    assert tokens.runs == {"lab", *(f"run{number}" for number in range(100))}
    assert dict(tokens.agents) == {"inv1": MOST_PROCESSES, "inv2": 1}


def test_what_has_gone_leaves_nothing() -> None:
    """Nor does the end of a token for which there was no room; of two plants of another run one stays."""
    tokens = RunTokens("lab")
    there = [
        KEYS.alive_plant(7),
        Keys("mine").alive_plant(1),
        Keys("mine").alive_plant(2),
        *strangers(1, MOST_PROCESSES + 1),
        KEYS.alive_agent("inv1", "a"),
    ]
    for key in there:
        tokens.appeared(key)
    tokens.vanished(Keys("mine").alive_plant(1))

    assert tokens.runs == {"lab", "mine"}
    assert dict(tokens.agents) == {"who0": MOST_PROCESSES, "inv1": 1}
    for key in there:
        tokens.vanished(key)
    assert (tokens.epochs, tokens.runs, tokens.agents) == (set(), set(), {})
