from __future__ import annotations

from dataclasses import dataclass, field

from msgspec.structs import replace

from gridpeers.scenarios.drivers.telemetry_stream import QUIET, TelemetryEndpoint, TelemetryStream
from gridpeers.wire.codec import encode
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Answer, LinkReport, LinkRequest, Telemetry
from tests.hostile.cases import sound_message

KEYS = Keys("demo")


def telemetry(seq: int, epoch: int = 7, sender: str = "plant") -> Telemetry:
    return sound_message(Telemetry, sender=sender, epoch=epoch, seq=seq, t=0.0)


@dataclass
class Recorder:
    """A recorder beside a plant of epoch 7."""

    core: TelemetryEndpoint
    taken: list[object] = field(default_factory=list)

    def hear(self, message: Telemetry | LinkReport | LinkRequest | Answer, key: str = KEYS.telemetry) -> None:
        self.core.received(key, encode(message), 0.0)
        self.taken += self.core.take()


def recorder(stream: TelemetryStream | None = None) -> Recorder:
    return Recorder(TelemetryEndpoint("fleet", "demo", stream or TelemetryStream(acknowledges=True)))


def test_who_speaks_before_the_plant_does_not_take_its_place() -> None:
    """Whoever knows the endpoint can publish as the plant; without the token of that epoch nobody records it."""
    it = recorder()
    it.hear(telemetry(0, epoch=6))
    it.core.appeared(KEYS.alive_plant(7))
    it.hear(telemetry(0, epoch=6))
    it.hear(telemetry(0))
    it.core.appeared(KEYS.alive_plant(6))
    it.hear(telemetry(1, epoch=6))

    assert it.taken == [telemetry(0)]
    assert it.core.rejects.counts == {"unexpected": 2, "ghost": 1}


def test_a_report_that_the_plant_passes_on_is_taken_and_an_order_of_anybody_else_is_not() -> None:
    """Reports keep the name of the agent that made them; all else on the key is of the plant."""
    it = recorder()
    it.core.appeared(KEYS.alive_plant(7))
    report = LinkReport(sender="inv1", epoch=3, seq=0, t=0.0, data=b"book")
    order = LinkRequest(sender="inv1", epoch=3, seq=1, t=0.0, link_command={}, reply_to="z1")
    it.hear(report)
    it.hear(order)
    it.hear(telemetry(0, sender="inv1"))
    it.hear(replace(telemetry(0), others=1))

    assert it.taken == [report, replace(telemetry(0), others=1)]
    assert it.core.rejects.counts == {"foreign": 2}


def test_only_the_answer_to_the_last_question_counts() -> None:
    """An answer that nobody waits for any more would put the order out of step; one that nobody asked for is told."""
    it = recorder(TelemetryStream())
    it.core.appeared(KEYS.alive_plant(7))
    it.hear(telemetry(0))
    asked = it.core.question(now=QUIET + 1.0)
    for seq, first in ((0, "9"), (1, "1")):
        it.hear(Answer(sender="plant", epoch=7, seq=seq, t=0.0, ok=True, text=first), KEYS.answer("fleet"))
    it.hear(telemetry(1))

    assert asked is not None
    assert it.taken == [telemetry(0), telemetry(1)]
    assert it.core.rejects.counts == {"unexpected": 1}
