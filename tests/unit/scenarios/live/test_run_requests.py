"""Requests to a plant: silence and answers to others are no answers, and errors name a command that reaches the run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import msgspec
import pytest

from gridpeers.netem.fault_schedule import Heal
from gridpeers.scenarios.emulation.link_data import LinkCommand
from gridpeers.scenarios.live import run_requests
from gridpeers.scenarios.live.run_address import RUN, Access, RunAddress
from gridpeers.scenarios.live.run_client import NobodyError, RunClient
from gridpeers.scenarios.live.run_requests import (
    ask,
    command_links,
    configurations,
    free_configurations,
    links_of_run,
    plant_status,
    request,
)
from gridpeers.wire.codec import decode
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Answer, AnyMessage, Command, LinkAcknowledgement
from tests.toy.toy_configs import agent_config

KEYS = Keys("demo")


class Lost:
    """Stands for a client at a plant of inv1 and inv2, whose first questions are lost; time passes while it waits."""

    id, where, keys = "z1", type("Where", (), {"credentials": None, "__str__": lambda self: "run demo"})(), KEYS

    def __init__(self, lost: int = 0) -> None:
        self.now, self.asked, self._lost = 0.0, 0, lost
        self._coming: list[tuple[str, bytes] | Answer] = []

    def _arrives(self) -> bool:
        self.asked += 1
        self._lost -= 1
        return self._lost < 0

    def publish(self, key: str, payload: bytes) -> None:
        command = decode(payload)
        assert isinstance(command, Command)
        data = {"phase": "running", "t": 1.0, "speed": 1.0, "pacing": PACING, "agents": ["inv1"], "absent": ["inv2"]}
        if self._arrives():
            self._coming.append(
                Answer(sender="plant", epoch=1, seq=command.seq, t=1.0, ok=True, text="running", data=data)
            )

    def fetch(self, key: str) -> None:
        if self._arrives():
            self._coming += [(KEYS.config(name), msgspec.json.encode(agent_config(name))) for name in ("inv1", "inv2")]

    def take(self, seconds: float) -> Iterator[tuple[str, bytes, float]]:
        if not self._coming:
            self.now += seconds
        elif isinstance(self._coming[0], Answer):
            yield "answer", b"", self.now
        else:
            yield (*self._coming.pop(0), self.now)

    def read(self, key: str, payload: bytes) -> AnyMessage | None:
        return cast(Answer, self._coming.pop(0)) if key == "answer" else None


PACING = {"steps": 1, "late": 0, "p50": 0.0, "p95": 0.0, "p99": 0.0, "worst": 0.0, "slipped": 0.0}


@pytest.fixture
def lossy(monkeypatch: pytest.MonkeyPatch) -> type[Lost]:
    """Makes clients whose clock is the module's own."""
    clock: list[Lost] = []

    class Timed(Lost):
        def __init__(self, lost: int = 0) -> None:
            super().__init__(lost)
            clock[:] = [self]

    monkeypatch.setattr(run_requests, "monotonic", lambda: clock[0].now)
    return Timed


def test_a_question_that_was_lost_is_asked_again(lossy: type[Lost]) -> None:
    """A second later, and again: the status, and a configuration; a command that changes something is given once."""
    client = lossy(3)
    assert plant_status(cast(RunClient, client)).agents == ("inv1",)
    assert (client.asked, client.now) == (4, pytest.approx(3.0))

    client = lossy(3)
    assert configurations(cast(RunClient, client), "inv2").keys() == {"inv1", "inv2"}
    assert (client.asked, client.now) == (4, pytest.approx(3.0))

    client = lossy(1)
    with pytest.raises(NobodyError, match="has not answered within 10 s"):
        ask(cast(RunClient, client), "open", "sw1")
    assert client.asked == 1


def test_no_answer_is_not_taken_for_a_no(lossy: type[Lost]) -> None:
    """Neither an inverter nor emulated links are said to be missing, once the wait has ended."""
    with pytest.raises(NobodyError, match="the plant of run demo is there but has not answered within 30 s"):
        free_configurations(cast(RunClient, lossy(1000)), ("inv1",), 30.0)
    with pytest.raises(NobodyError, match="no answer: the plant of run demo has not sent the configuration of inv1"):
        configurations(cast(RunClient, lossy(1000)), "inv1", 30.0)
    with pytest.raises(NobodyError, match="no answer: the plant of run demo has not sent a configuration within"):
        links_of_run(cast(RunClient, lossy(1000)))


def test_an_inverter_that_the_plant_does_not_have_is_told_at_once(lossy: type[Lost]) -> None:
    """Its status names all inverters: nobody waits for a configuration that cannot come."""
    client = lossy()
    with pytest.raises(NobodyError, match='no inverter "inv3" in run demo; inverters are inv1, inv2'):
        free_configurations(cast(RunClient, client), ("inv3",), 60.0)
    assert client.now == 0.0


class Client:
    """Stands for a client at a plant: before each true answer come those to a viewer's questions in its name."""

    id, where, keys = "z1", "run demo", Keys("demo")

    def __init__(self, **data: Any) -> None:
        self._data = {"number": 3, "t": 2.0, "asked": ["inv2"], "receivers": ["inv2"]} | data
        self.numbers: list[int] = []
        self._waiting: list[AnyMessage] = []

    def publish(self, key: str, payload: bytes) -> None:
        """Take a command, and answer it after others."""
        command = decode(payload)
        assert isinstance(command, Command)
        self.numbers.append(command.seq)
        common: dict[str, Any] = {"epoch": 1, "t": 2.0}
        for number in (0, 1):
            self._waiting += [
                Answer(sender="plant", seq=number, ok=False, text="lie", data={}, **common),
                LinkAcknowledgement(sender="inv2", seq=0, ok=True, text="lie", reply_to=self.id, **common),
            ]
        self._waiting += [
            Answer(sender="plant", seq=command.seq, ok=True, text="true", data=self._data, **common),
            LinkAcknowledgement(sender="inv2", seq=2, ok=True, text="old", reply_to=self.id, **common),
            LinkAcknowledgement(sender="inv2", seq=3, ok=False, text="true", reply_to=self.id, **common),
        ]

    def take(self, seconds: float) -> Iterator[tuple[str, bytes, float]]:
        if self._waiting:
            yield "", b"", 0.0

    def read(self, key: str, payload: bytes) -> AnyMessage:
        return self._waiting.pop(0)


def test_only_the_answer_to_the_own_command_counts() -> None:
    """By its number, which nobody else knows; and only acknowledgements of the number that this answer names."""
    client = Client()

    answer, acknowledgements = request(client, lambda answer: {"inv2"}, verb="link", link_command={})  # type: ignore[arg-type]

    assert (answer.text, [each.text for each in acknowledgements.values()]) == ("true", ["true"])


def test_an_answer_of_another_form_is_told_in_one_line() -> None:
    """Of a plant of another version, or of whoever speaks as one on open links: nothing else is raised."""
    with pytest.raises(NobodyError, match=r"run demo cannot be read: .* `phase`; has it another"):
        plant_status(Client())  # type: ignore[arg-type]
    for number, found in ((True, "bool"), ([3], "array")):
        with pytest.raises(NobodyError, match=rf"Expected `int`, got `{found}` - at `\$.number`; has it another"):
            command_links(Client(number=number), LinkCommand(heal=Heal(on="*", from_s=0.0)))  # type: ignore[arg-type]


@pytest.mark.parametrize(("where", "typed"), [
    (RunAddress(run=RUN, connect=("tcp/127.0.0.1:7447",)), "gridpeers stop inv2"),
    (
        RunAddress(run="lab", connect=("tls/10.0.0.1:7447",), access=Access(keys=Path("site"))),
        "gridpeers stop inv2 --run lab --connect tls/10.0.0.1:7447 --keys site",
    ),
])  # fmt: skip
def test_the_other_agent_of_a_name_is_stopped_where_it_is(
    where: RunAddress, typed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`gridpeers stop inv2` alone would stop an agent of the default run, or find no plant."""
    monkeypatch.setattr(run_requests, "plant_status", lambda *_: SimpleNamespace(agents=("inv2",), inverters=("inv2",)))

    with pytest.raises(NobodyError) as error:
        free_configurations(SimpleNamespace(where=where), ("inv2",))  # type: ignore[arg-type]

    assert f"({typed})" in str(error.value)
