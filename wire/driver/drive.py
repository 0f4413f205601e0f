"""The loop of every process of a run: a sans-IO core in front, a Zenoh session behind."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from time import monotonic

from gridpeers.wire.driver.session import Session
from gridpeers.wire.node import Action, Core, Fetch, Listen, Log, Publish, WithdrawToken
from gridpeers.wire.timing import RateLimit


class LogLimit(logging.Filter):
    """Omit repeated lines from a log, and count them."""

    def __init__(self) -> None:
        super().__init__()
        self._limit = RateLimit()
        self.left_out = self._limit.left_out

    def filter(self, record: logging.LogRecord) -> bool:
        line = self._limit.admit(record.getMessage(), monotonic())
        if line is not None:
            record.msg, record.args = line, ()
        return line is not None


def limit_log(log: logging.Logger) -> LogLimit:
    """Let a log omit repeated lines; a second call changes nothing."""
    limit = next((each for each in log.filters if isinstance(each, LogLimit)), None) or LogLimit()
    log.addFilter(limit)
    return limit


class StoppedError(BaseException):
    """Request to end, from another part of the process or a signal.

    It is no `Exception`: a signal may come while a node handles a message, and a node catches the errors of that.
    """


def perform(actions: Sequence[Action | Log], session: Session, log: logging.Logger) -> None:
    for action in actions:
        if isinstance(action, Publish):
            session.publish(action.key, action.payload)
        elif isinstance(action, Fetch):
            session.fetch(action.key, action.reply_key)
        elif isinstance(action, Listen):
            session.subscribe(action.key)
        elif isinstance(action, WithdrawToken):
            session.withdraw_token(action.key)
        else:
            log.info("%s", action.text)


def drive(core: Core, session: Session, log: logging.Logger) -> None:
    """Start a core, declare its keys and serve it until it has finished, as `serve` does.

    The token is declared last: whoever sees it may rely on the rest.
    """
    core.start(monotonic())
    for key in core.subscriptions:
        session.subscribe(key)
    session.watch(core.watched)
    for token in core.tokens:
        session.hold_token(token)
    serve(core, session, log)


def serve(core: Core, session: Session, log: logging.Logger) -> None:
    """Serve a started core until it has finished; raise StoppedError if another thread asks the process to stop."""
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
        deadline = core.deadline
        events = take(core.messages_needed, None if deadline is None else max(0.0, deadline - now))
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
        for loss in session.inbox.take_losses():
            core.lost(loss, now)
        deadline = core.deadline  # a message may have postponed it
        if deadline is not None and now >= deadline:  # also when the inbox never runs empty
            core.expire(now)
        for line in (*session.take_lines(), *core.take_rejects()):
            log.warning("%s", line)
