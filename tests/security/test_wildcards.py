"""Members that ask for more than is theirs: by wildcards, by tokens and by queryables of others.

Everything on a link keeps its order: what is allowed comes last, and proves that the rest has had its chance.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.security.intruder import Intruder, credentials
from tests.toy.town import Town

pytest.importorskip("cryptography", reason="certificates need the extra keys")
zenoh = pytest.importorskip("zenoh")

WIDE = ("**", "gridpeers/**", "gridpeers/*/*/inv1", "gridpeers/toy/measurement/*", "@/**")
"""What a curious member subscribes to."""


def overheard(town: Town, intruder: Intruder, own: str) -> set[str]:
    heard: set[str] = set()
    inbox = intruder.session.inbox

    def note(sample: Any) -> None:
        heard.add(str(sample.key_expr))
        inbox.put(("word", "", b""))

    remote = zenoh.Locality.REMOTE
    kept = [intruder.raw.declare_subscriber(key, note, allowed_origin=remote) for key in (*WIDE, own)]
    begun = town.t
    town.until(lambda: own in heard and town.t >= begun + 0.5, f"a message on {own}")
    for subscriber in kept:
        subscriber.undeclare()
    return heard


def test_wildcards_do_not_widen_what_a_member_hears(town: Town, lab: Path) -> None:
    """An agent hears states of the others, a viewer telemetry and statuses; neither a measurement nor a set-point."""
    with Intruder(town.endpoint, credentials(lab, "inv3")) as agent:
        assert overheard(town, agent.linked(4), town.keys.state("inv1")) == {town.keys.state("inv1")}
    with Intruder(town.endpoint, credentials(lab, "viewer")) as viewer:
        assert overheard(town, viewer.linked(4), town.keys.telemetry) <= {
            town.keys.telemetry, *map(town.keys.status, ("inv1", "inv2")),
        }  # fmt: skip


def test_nobody_sees_a_token_that_a_member_holds_for_another(town: Town, lab: Path) -> None:
    """Neither an agent's nor a plant's nor one with a wildcard; only the member's own appears."""
    keys = town.keys
    others = (keys.alive_agent("inv1", "z6"), keys.alive_plant(6), keys.alive_recorder("z6"), keys.any_alive)
    with Intruder(town.endpoint, credentials(lab, "inv3")) as intruder:
        intruder.linked(4)
        held = [intruder.raw.liveliness().declare_token(key) for key in (*others, keys.alive_agent("inv3", "z6"))]
        town.until(lambda: keys.alive_agent("inv3", "z6") in town.tokens, "the own token")
        assert town.tokens.isdisjoint(others)
        for token in held:
            token.undeclare()


def test_an_agent_gets_no_configuration_but_its_own(town: Town, lab: Path) -> None:
    """It asks for another configuration, for all, and for its own. Only the last is answered."""
    own, others = town.keys.config("inv3"), (town.keys.config("inv1"), town.keys.config("*"))
    for name in ("inv1", "inv3"):
        town.session.answer(town.keys.config(name), b"{}")
    answered: set[str] = set()
    with Intruder(town.endpoint, credentials(lab, "inv3")) as intruder:
        intruder.linked(4)

        def come() -> bool:
            for key in (*others, own):
                intruder.session.fetch(key)
            answered.update(key for kind, key, _, _ in intruder.session.take(1, 0.2) if kind == "message")
            return own in answered

        town.until(come, "the own configuration")
    assert answered == {own}
