"""Every message with every value, from anybody, to both sides under both kinds of time: nothing is believed.

A core that is flooded with them must do, to the byte, what one does that is not.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from gridpeers.wire.codec import KINDS
from gridpeers.wire.node import Fetch, Listen, Log
from tests.fuzz.mutation import EPOCH
from tests.hostile.cases import hostile
from tests.hostile.scenes import KEYS, NAMES, AgentScene, PlantScene, RealtimeAgentScene, RealtimePlantScene, Scene

TOKENS = tuple(
    f"gridpeers/toy/alive/{tail}"
    for tail in (
        "plant/0", "plant/8", "plant/x", "plant/99999999999999999999", "plant", "plant/8/9", "agent/inv2/x",
        "agent/inv9/x", "agent/\x1b[2J/x", "agent/inv2", "agent/inv1/\n", "recorder/x", "", "agent//", "x",
    )
)  # fmt: skip


def flood(side: Any, rng: random.Random) -> list[tuple[str, bytes]]:
    """A sixteenth of all that is hostile to a core, in some order."""
    truth = {key: (route.sender, route.types) for key, route in side.routes.items()}
    truth |= {KEYS.state("inv9"): ("inv9", ()), KEYS.telemetry: ("plant", ())}
    return list(hostile(truth, dict.fromkeys(("plant", *NAMES), EPOCH), rng))[::16]


@pytest.mark.parametrize("make", [RealtimeAgentScene, AgentScene, RealtimePlantScene, PlantScene])
def test_nothing_raises_and_nothing_false_is_believed(make: Callable[[], Scene]) -> None:
    """Set-points, rosters, neighbours' values, sessions, what is published: all as if nobody had said anything."""
    rng = random.Random(1)
    flooded, calm = make(), make()
    sent = 0
    for k, chunk in enumerate(_chunks(flood(flooded.side, rng), 30)):
        for key, payload in chunk:
            flooded.side.received(key, payload, flooded.now)
            sent += 1
        for scene in (flooded, calm):
            scene.honest(k)
    counts = flooded.side.rejects.counts
    lines = flooded.side.rejects.take_lines()

    assert sent > 3_000
    assert not flooded.side.finished
    assert len(calm.done) > 100
    assert flooded.done == calm.done
    assert "failed" not in counts, lines
    assert sent <= sum(counts.values())
    assert not calm.side.rejects.counts
    assert len(lines) <= len(KINDS)
    assert all(line.isprintable() and len(line) < 600 for line in lines)


@pytest.mark.parametrize("make", [RealtimeAgentScene, AgentScene, RealtimePlantScene, PlantScene])
def test_tokens_of_anybody_change_nothing(make: Callable[[], Scene]) -> None:
    """Whoever can connect can hold tokens: garbled, of other plants, of a namesake; what is decided stays the same."""
    flooded, calm = make(), make()
    for k in range(60):
        for token in TOKENS if k % 2 else ():
            flooded.side.appeared(token, flooded.now)
        for scene in (flooded, calm):
            scene.honest(k)
        for token in TOKENS if k % 3 else ():
            flooded.side.vanished(token, flooded.now)
    said = [action.text for action in flooded.done if isinstance(action, Log)]

    assert not flooded.side.finished
    assert _decided(flooded) == _decided(calm)
    assert all(text.isprintable() for text in said)


def _decided(scene: Scene) -> list[object]:
    """The states, measurements and rows that a core has published."""
    kinds = ("state", "measurement", "telemetry")
    done = [entry for entry in scene.done if isinstance(entry, tuple) and not isinstance(entry, Fetch | Listen | Log)]
    return [entry for entry in done if entry[0].split("/")[2] in kinds]


def _chunks(items: list[Any], size: int) -> Iterator[list[Any]]:
    for i in range(0, len(items), size):
        yield items[i : i + size]
