"""All that takes bytes from others: the codec, every core, and the readers of what cores pass on.

Each receiver takes any bytes and raises nothing. Where a function has an error of its own for bad input, its receiver
catches that error and no other.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Protocol

import msgspec
from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_node import AgentNode
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.telemetry_stream import TelemetryEndpoint, TelemetryStream
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.emulation.link_data import EmulationConfig, data_of, decode_statuses
from gridpeers.scenarios.live.feeder_map import read_feeder_map
from gridpeers.scenarios.live.run_client import RunClient
from gridpeers.scenarios.live.run_monitor import PlantStatus
from gridpeers.scenarios.record.journal_reader import entries_of, values_of
from gridpeers.scenarios.results.record import Recorder, RecordError
from gridpeers.viewer.run_view import Cursor, RunView
from gridpeers.wire.codec import CRC, RejectedError, decode, encode
from gridpeers.wire.keys import Keys, epoch_of, run_of_plant
from gridpeers.wire.messages import AgentStatus, Answer, LinkAcknowledgement, LinkReport, Telemetry
from tests.fuzz.journals import Journals
from tests.fuzz.mutation import EPOCH
from tests.hostile.scenes import (
    KEYS,
    NAMES,
    AgentScene,
    PlantScene,
    RealtimeAgentScene,
    RealtimePlantScene,
    Scene,
    meet,
)
from tests.toy.toy_configs import agent_config

LIFE = 2_000  # Messages after which a core is made anew: a false one may have ended what it does
TICK = 200  # Messages between two ticks of its honest peers


class Receiver(Protocol):
    """What takes bytes."""

    def take(self, payload: bytes, rng: random.Random) -> str: ...


class Codec:
    """Decode, and encode again what was decoded."""

    def take(self, payload: bytes, rng: random.Random) -> str:
        try:
            message = decode(payload)
        except RejectedError as rejected:
            return rejected.kind
        again = encode(message)
        assert encode(decode(bytes(again))) == again
        return ""


class Core:
    """A node in the middle of a run, with honest peers beside the one who sends this."""

    def __init__(self, make: Callable[[], Scene]) -> None:
        self._make = make
        self._begin()

    def _begin(self) -> None:
        self._scene, self._taken, self._tick = self._make(), 0, 0
        self._keys = [*self._scene.side.routes, KEYS.state("inv9"), KEYS.telemetry, "x"]
        self._counts: Counter[str] = self._scene.side.rejects.counts

    def take(self, payload: bytes, rng: random.Random) -> str:
        side, before = self._scene.side, self._counts.total()
        kinds = self._counts.copy()
        side.received(self._key(payload, rng), payload, self._scene.now)
        if rng.random() < 0.01:
            self._token(payload, rng)
        self._taken += 1
        if self._taken % TICK == 0:
            self._scene.honest(self._tick)
            self._tick += 1
            self._check()
        if side.finished or self._taken >= LIFE:
            self._check()
            self._begin()
        if self._counts.total() == before:
            return ""
        assert self._counts["failed"] == kinds["failed"], side.rejects.take_lines()
        return next(iter((self._counts - kinds) or {"": 1}))

    def _key(self, payload: bytes, rng: random.Random) -> str:
        try:
            message = decode(payload)
        except RejectedError:
            return rng.choice(self._keys)
        fitting = [
            key
            for key, route in self._scene.side.routes.items()
            if isinstance(message, route.types) and route.sender in ("", message.sender)
        ]
        return rng.choice(fitting if fitting and rng.random() < 0.8 else self._keys)

    def _token(self, payload: bytes, rng: random.Random) -> None:
        text = payload[:20].decode("latin-1")
        tails = (f"plant/{EPOCH}", "agent/inv2/b", f"agent/{text}/x", f"agent/inv3/{text}", f"plant/{text}", text)
        token = f"gridpeers/toy/alive/{rng.choice(tails)}"
        (self._scene.side.appeared if rng.random() < 0.8 else self._scene.side.vanished)(token, self._scene.now)

    def _check(self) -> None:
        self._scene.take()
        lines = self._scene.side.rejects.take_lines()
        assert not self._counts["failed"], lines
        assert all(len(line) < 1_000 and line.isprintable() for line in lines), lines
        self._scene.done.clear()


LATE = EmulationConfig(
    netem=Netem(links=(Fault(on="* <-> *", delay=0.03, loss=0.1, corrupt=0.1, duplicate=0.2),)),
    microgrids={name: "mg1" for name in NAMES},
).to_tree()
"""Links that delay, lose, copy and corrupt."""


class LinkedAgentScene(RealtimeAgentScene):
    """inv1 in real time, behind emulated links, with a journal."""

    def __init__(self) -> None:
        super().__init__()
        config = replace(agent_config("inv1"), clock="realtime", epoch=EPOCH, links=LATE, record="all")
        self.side = AgentNode(config, "a", links_of("inv1", LATE))
        self.side.start(self.now)
        meet(self, *NAMES[1:])


class Recording:
    """A recorder of a run: what it takes off the wire, and what it does with it."""

    def __init__(self, stream: bool) -> None:
        self._stream = stream
        self._begin()

    def _begin(self) -> None:
        self._endpoint = TelemetryEndpoint("history", "toy", TelemetryStream(acknowledges=not self._stream))
        self._endpoint.appeared(KEYS.alive_plant(EPOCH))
        self._recorder: Recorder | None = Recorder(gaps=True)
        self._keys, self._taken = [*self._endpoint.post.routes], 0

    def take(self, payload: bytes, rng: random.Random) -> str:
        counts = self._endpoint.rejects.counts
        before = counts.copy()
        now = self._taken * 0.01
        self._endpoint.received(rng.choice(self._keys), payload, now)
        self._endpoint.question(now)
        for message in self._endpoint.take():
            try:
                if self._recorder is not None:
                    self._recorder(message)
            except RecordError:
                self._recorder = None
        assert counts["failed"] == 0, self._endpoint.rejects.take_lines()
        self._taken += 1
        if self._taken >= LIFE:
            self._begin()
        return next(iter(counts - before), "")


class View:
    """A person's view of a run: what `gridpeers view` and `watch` make of what comes."""

    def __init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        self._client = SimpleNamespace(keys=Keys("toy"), _tokens=SimpleNamespace(epochs={EPOCH}))
        self._view, self._taken = RunView("toy"), 0
        self._view.presence(plant=True, agents=NAMES, now=0.0)

    def take(self, payload: bytes, rng: random.Random) -> str:
        keys = (KEYS.telemetry, KEYS.answer("visitor"), *(KEYS.status(name) for name in NAMES))
        now = self._taken * 0.01
        message = RunClient.read(self._client, rng.choice(keys), payload)  # type: ignore[arg-type]
        try:
            if isinstance(message, Telemetry):
                self._view.telemetry(message, now)
            elif isinstance(message, AgentStatus):
                self._view.status(message, now)
            elif isinstance(message, Answer):
                self._view.plant_status(msgspec.convert(message.data, PlantStatus))
            elif isinstance(message, LinkAcknowledgement):
                self._view.accounts(message.sender, decode_statuses(message.data))
        except msgspec.DecodeError:
            return "garbled"
        self._taken += 1
        if self._taken % TICK == 0:
            self._view.forget_silent(now)
            msgspec.json.encode(self._view.frame(Cursor(), now))
        if self._taken >= LIFE:
            self._begin()
        return "" if message is not None else "unread"


class Readers:
    """Readers of what cores pass on unread, and of configurations: each has one error for bad input."""

    def take(self, payload: bytes, rng: random.Random) -> str:
        body = payload[:-CRC]
        text = body.decode("latin-1")
        readers: tuple[tuple[Callable[[], Any], tuple[type[Exception], ...]], ...] = (
            (lambda: list(entries_of(body)), (ValueError,)),
            (lambda: values_of(payload), ()),
            (lambda: data_of(LinkReport(sender="inv1", epoch=1, seq=0, t=0.0, data=body)), (msgspec.DecodeError,)),
            (lambda: decode_statuses(body), (msgspec.DecodeError,)),
            (lambda: read_feeder_map(body), ()),
            (lambda: msgspec.json.decode(body, type=AgentConfig), (msgspec.DecodeError, UnicodeDecodeError)),
            (lambda: msgspec.json.decode(body, type=PlantConfig), (msgspec.DecodeError, UnicodeDecodeError)),
            (lambda: (epoch_of(text), run_of_plant(text), KEYS.parts(text)), ()),
        )
        read, errors = rng.choice(readers)
        try:
            read()
        except errors:
            return "garbled"
        return ""


def receivers() -> dict[str, Receiver]:
    return {
        "codec": Codec(),
        "agent, real time": Core(RealtimeAgentScene),
        "agent, real time, links": Core(LinkedAgentScene),
        "agent, simulated time": Core(AgentScene),
        "plant, real time": Core(RealtimePlantScene),
        "plant, simulated time": Core(PlantScene),
        "recorder, real time": Recording(stream=True),
        "recorder, simulated time": Recording(stream=False),
        "view": View(),
        "readers": Readers(),
        "checks": Journals(),
    }
