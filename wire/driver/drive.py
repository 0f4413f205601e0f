"""The loop of every process of a run: a sans-IO core in front, a Zenoh session behind."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from time import monotonic
from typing import Protocol

from wire.actions import Action, Fetch, Listen, Log, Publish
from wire.codec import RejectedMessages
from wire.driver.log_limit import limit_log
from wire.driver.session import Session


class Core(Protocol):
    """What the driver needs of a node (`wire.node`)."""

    rejects: RejectedMessages

    @property
    def token(self) -> str:
        """Key of the own token."""
        ...

    @property
    def subscriptions(self) -> tuple[str, ...]:
        """Keys to subscribe to."""
        ...

    @property
    def watched(self) -> str:
        """Tokens to watch."""
        ...

    @property
    def finished(self) -> bool:
        """Whether to close."""
        ...

    @property
    def messages_needed(self) -> int:
        """Number of messages without which it cannot go on before `until`."""
        ...

    @property
    def deadline(self) -> float | None:
        """When the deadline passes (s)."""
        ...

    def start(self, now: float) -> None:
        """Begin."""
        ...

    def take_actions(self) -> Sequence[Action | Log]:
        """What is to be done."""
        ...

    def appeared(self, key: str, now: float) -> None:
        """Note a token."""
        ...

    def vanished(self, key: str, now: float) -> None:
        """Note a lost token."""
        ...

    def received(self, key: str, payload: bytes, now: float) -> None:
        """Take a message, which came at `now`; it may have waited for its owner since."""
        ...

    def work(self, now: float) -> bool:
        """Do a piece of work, if there is one."""
        ...

    def expire(self, now: float) -> None:
        """Act on a passed deadline."""
        ...


class StoppedError(BaseException):
    """Another part of the process, or a signal, wants it to end.

    No `Exception`: a signal comes at any moment, also while a message is handled, whose errors are the message's own.
    """


def perform(actions: Sequence[Action | Log], session: Session, log: logging.Logger) -> None:
    """Do what a core asks for, in its order."""
    for action in actions:
        if isinstance(action, Publish):
            session.publish(action.key, action.payload)
        elif isinstance(action, Fetch):
            session.fetch(action.key)
        elif isinstance(action, Listen):
            session.subscribe(action.key)
        else:
            log.info("%s", action.text)


def drive(core: Core, session: Session, log: logging.Logger) -> None:
    """Begin, declare what a core needs and serve it until it is over; the rest as of `serve`.

    It begins first: one that begins again needs less than it did at the end of its last session. The token comes last
    of all that is declared: who sees it may count on the rest.
    """
    core.start(monotonic())
    for key in core.subscriptions:
        session.subscribe(key)
    session.watch(core.watched)
    session.hold_token(core.token)
    serve(core, session, log)


def serve(core: Core, session: Session, log: logging.Logger) -> None:
    """Serve a core that has begun until it is over.

    Parameters
    ----------
    core : Core
        What decides.
    session : Session
        What carries; the caller has made it answer whatever the core must answer.
    log : logging.Logger
        Where rejects are told, one line per kind.

    Raises
    ------
    StoppedError
        If a word to stop comes into the inbox.
    """
    take = session.take
    limit = limit_log(log)
    now = monotonic()
    while True:
        perform(core.take_actions(), session, log)
        if core.finished:
            for line in limit.left_out():
                log.info("%s", line)
            break
        if core.work(now):
            now = monotonic()
            continue
        until = core.deadline
        events = take(core.messages_needed, None if until is None else max(0.0, until - now))
        now = monotonic()
        for kind, key, payload, at in events:
            if kind == "message":
                core.received(key, payload, at)
            elif kind == "appeared":
                core.appeared(key, now)
            elif kind == "vanished":
                core.vanished(key, now)
            else:
                raise StoppedError(key)
        until = core.deadline  # what came in may have put it off
        if until is not None and now >= until:  # also when the inbox never runs empty
            core.expire(now)
        if core.rejects.has_lines:
            for line in core.rejects.take_lines():
                log.warning("%s", line)
