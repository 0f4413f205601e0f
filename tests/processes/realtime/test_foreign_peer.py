"""Somebody who knows the endpoint of a run, and publishes everything that a message can be. The plant is a toy."""

from __future__ import annotations

import math
import random
from itertools import cycle, islice, pairwise
from pathlib import Path

from gridpeers.wire.driver.session import Session
from gridpeers.wire.messages import (
    AgentStatus,
    Command,
    Leave,
    LinkAcknowledgement,
    LinkReport,
    LinkRequest,
    Measurement,
    Nameplate,
    State,
    Stop,
    Waiting,
)
from tests.hostile.cases import Truth, hostile
from tests.toy.town import Town

THREE = ("inv1", "inv2", "inv3")

MESSAGES = 6_000
"""As many as are published at least: some seconds."""

REJECTED = 1000
"""As many of them as agents reject at least."""


def largest_step(rows: list[tuple[float, ...]]) -> float:
    """Largest change of a P_set (W) from one row to the next."""
    return max(abs(b - a) for row, after in pairwise(rows) for a, b in zip(row[5::6], after[5::6], strict=True))


def test_a_foreign_peer_ends_no_process_and_harms_no_control(tmp_path: Path) -> None:
    """Hostile messages and tokens on all keys, to everybody: the run goes on, and its history is finite and calm."""
    with Town(3, tmp_path).all() as town:
        town.until(lambda: town.t >= 1.5, "1.5 s")
        keys, name_of = (
            town.keys,
            {token.split("/")[-1]: token.split("/")[-2] for token in town.tokens if "/agent/" in token},
        )
        assert town.telemetry is not None
        epochs = {name: town.status[name].epoch for name in THREE} | {"plant": town.telemetry.epoch}
        truth: Truth = {
            keys.control: ("plant", (Stop, Waiting)),
            keys.command: ("", (Command,)),
            **{keys.measurement(name): ("plant", (Measurement,)) for name in THREE},
            **{keys.link_request(name): ("plant", (LinkRequest,)) for name in THREE},
            **{keys.state(name): (name, (State,)) for name in THREE},
            **{keys.leave(name): (name, (Leave,)) for name in THREE},
            **{keys.status(name): (name, (AgentStatus,)) for name in THREE},
            **{keys.report(name): (name, (LinkReport,)) for name in THREE},
            **{keys.link_acknowledgement(name): (name, (LinkAcknowledgement,)) for name in THREE},
            **{keys.stop_request(name, instance): ("plant", (Stop,)) for instance, name in name_of.items()},
            **{keys.nameplate(name, instance): (name, (Nameplate,)) for instance, name in name_of.items()},
        }
        foreigner = Session("foreigner", listen=("tcp/127.0.0.1:0",), connect=(town.endpoint,), clock="wall")
        try:
            town.until(lambda: foreigner.peers() >= len(THREE) + 1, "the foreigner meets everybody")
            before = len(town.rows)
            for token in (keys.alive_plant(1), keys.alive_agent("inv2", "x"), keys.alive_agent("nobody", "x")):
                foreigner.hold_token(token)
            flood = list(hostile(truth, epochs, random.Random(1)))[:MESSAGES]
            for i, (key, payload) in enumerate(flood):
                foreigner.publish(key, payload)
                if i % 1000 == 0:
                    foreigner.publish(keys.state("inv2"), b"\xff" * 100)
                    t = town.t
                    town.until(lambda t=t: town.t > t, "the run goes on")  # type: ignore[misc]
            more = cycle(flood)

            def counted() -> bool:
                for key, payload in islice(more, 100):  # of a full link Zenoh drops some
                    foreigner.publish(key, payload)
                return sum(town.status[name].rejected for name in THREE) > REJECTED

            town.until(counted, f"{REJECTED} are rejected")
            t = town.t
            town.until(lambda: town.t >= t + 1.0, "1 s more").together(THREE)
        finally:
            foreigner.close()
        rows = town.rows[before:]
        logs = {path.name: path.read_text() for path in tmp_path.glob("*.log")}

        assert [child.status for child in town.children] == [None] * 4
        assert len(flood) == MESSAGES
        assert all(math.isfinite(value) for row in rows for value in row)
        assert largest_step(rows) < 500.0
        assert max(abs(row[1] - 60.0) for row in rows) < 0.05
        assert [event.text for event in town.events if "left" in event.text or "died" in event.text] == []
    for name, log in logs.items():
        assert "Traceback" not in log, name
        assert "opens a new session" not in log, name
        assert len(log) < 20_000, name
        assert log.replace("\n", "").isprintable(), name
