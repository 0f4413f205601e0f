"""Keys; and docs/reference/protocol.md, from which people write agents of their own, against the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.agents.agent_config import AgentConfig, Control
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.keys import KEY_SPECS, Keys, check_name, is_token
from gridpeers.wire.messages import (
    Leave,
    LinkAcknowledgement,
    LinkRequest,
    Measurement,
    Message,
    Nameplate,
    Prepare,
    Ready,
    State,
    Stop,
    Waiting,
)

zenoh = pytest.importorskip("zenoh")

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "protocol.md").read_text()
SECTION = PAGE.split("## Write an agent of your own")[1].split("\n## ")[0]
NEEDED = (Nameplate, Ready, State, Leave, LinkAcknowledgement, Prepare, Measurement, Stop, Waiting, LinkRequest)


def words(text: str) -> set[str]:
    return set(re.findall(r"`([^`]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL)))


def test_the_bytes_on_the_page_are_those_of_the_codec() -> None:
    """The example is a whole message, byte for byte."""
    rows = re.findall(r"^((?:[0-9a-f]{2} )+)", SECTION, re.MULTILINE)
    payload = bytes.fromhex("".join(rows))
    ready = Ready(sender="inv2", epoch=7, seq=0, t=0.0)

    assert decode(payload) == ready
    assert encode(ready) == payload


@pytest.mark.parametrize("message", NEEDED)
def test_every_field_that_an_agent_meets_is_on_the_page(message: type[Message]) -> None:
    """A new field of a message needs a sentence on the page for authors of other agents."""
    assert message.__name__ in words(SECTION)
    assert set(message.__struct_fields__) - words(SECTION) == set()


@pytest.mark.parametrize("config", [AgentConfig, Control])
def test_every_field_of_the_configuration_is_on_the_page(config: type[AgentConfig | Control]) -> None:
    """The plant's answer to an agent's request."""
    named = words(SECTION)
    named |= {word.removeprefix("control.") for word in named}

    assert set(config.__struct_fields__) - named == set()


def test_every_key_of_an_agent_is_on_the_page() -> None:
    """These are all keys on which an agent publishes, subscribes, asks or answers, except the optional ones."""
    kinds = {spec.expression.split("/")[2] for spec in KEY_SPECS if "agent" in (*spec.writers, *spec.readers)}
    told = {word.split("/")[0] for word in words(SECTION)}

    assert kinds - told == {"report", "journal", "status", "request", "answer"}  # which may be left out


@pytest.mark.parametrize("bad", ["", "a/b", "a*", "a b", "$x", "what?", "#1", "@x", "ä", "x" * 65])
def test_names_that_zenoh_would_refuse_or_hide_are_refused(bad: str) -> None:
    """The error names the field, the value and what would be right."""
    with pytest.raises(ValueError, match=r"run: .* cannot be part of a Zenoh key; use 1 to 64 letters"):
        Keys(bad)


@given(st.from_regex(r"[A-Za-z0-9_.-]{1,64}", fullmatch=True))
def test_every_name_that_is_accepted_makes_a_key(name: str) -> None:
    check_name("run", name)

    zenoh.KeyExpr(Keys(name).state(name))


def test_tokens_are_told_from_texts_that_somebody_has_made_up() -> None:
    """The longest names make tokens. A text that no process of a run could hold is no token."""
    keys = Keys("d" * 64)
    tokens = keys.alive_plant(1), keys.alive_agent("n" * 64, "a" * 64), keys.alive_recorder("r" * 64)
    made_up = f"{tokens[0]}/{'x' * 65}", f"{tokens[1]}/more", f"{tokens[2]}/", "x/" * 1_000

    assert [*map(is_token, tokens), *map(is_token, made_up)] == [True] * 3 + [False] * 4


def test_parts_are_those_of_the_own_run_only() -> None:
    """A key of another run has no parts, even if the names of the runs begin alike."""
    assert Keys("demo").parts(Keys("demo").state("inv1")) == ("state", "inv1")
    assert Keys("demo").parts(Keys("demo2").state("inv1")) == ()
