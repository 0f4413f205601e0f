"""What the loops of nodes and recorders do before they serve."""

from __future__ import annotations

import logging
from types import SimpleNamespace
from typing import Any, cast

from gridpeers.wire.driver.drive import drive
from gridpeers.wire.driver.inbox import MOST_TOKENS, Inbox
from gridpeers.wire.driver.session import Session
from gridpeers.wire.node import Core

EXCESS = 5
"""Strangers' tokens for which there is no room."""


class Crowded:
    """A session into whose run strangers have put tokens before it began."""

    def __init__(self, *words: Any, inbox: Inbox | None = None, **options: Any) -> None:
        self.inbox = inbox or Inbox()

    def __getattr__(self, name: str) -> Any:
        return lambda *words: ()

    def watch(self, key: str) -> None:
        for i in range(MOST_TOKENS + EXCESS):
            self.inbox.put(("appeared", key.replace("**", f"agent/stranger{i}/x").replace("*", f"x{i}"), b""))


def test_a_node_is_asked_about_strangers_whose_tokens_were_there_before_it() -> None:
    """Of the tokens that come with its first look a bounded number waits, too."""
    session = Crowded()
    core = SimpleNamespace(
        start=lambda now: None,
        subscriptions=(),
        watched="gridpeers/toy/alive/**",
        tokens=(),
        take_actions=lambda: [],
        finished=True,
        is_known=lambda key, payload: False,
        is_noted=lambda key: False,
    )
    drive(cast(Core, core), cast(Session, session), logging.getLogger("test"))

    assert [loss.number for loss in session.inbox.take_losses()] == [EXCESS]
