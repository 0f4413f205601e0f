"""Zenoh's threads as a user chooses them: a wrong choice is told before Zenoh aborts over it."""

from __future__ import annotations

import pytest

from gridpeers.wire.driver.session import Session, SessionError
from gridpeers.wire.driver.zenoh_settings import ONE_THREAD, RUNTIME, runtime_objection


@pytest.mark.parametrize(
    "text",
    [
        *(RUNTIME, ONE_THREAD, "()", "(rx: ())", "(rx:(worker_threads:2,max_blocking_threads:50))"),
        *(" ( rx : ( worker_threads : 1 , ) , ) ", "(app: (handover: rx), rx: (handover: app))"),
    ],
)
def test_what_zenoh_takes_is_taken(text: str) -> None:
    """With blanks and commas as people set them."""
    assert runtime_objection(text) == ""


@pytest.mark.parametrize(
    "text",
    [
        *("", "2", "rx: (worker_threads: 1)", "{rx: (worker_threads: 1)}", "(rx: (worker_threads: 1)"),
        *("(foo: (worker_threads: 1))", "(rx: (threads: 1))", "(rx: (handover: foo))", "(rx: (handover: app)) x"),
        *("(rx: (worker_threads: 0))", "(rx: (worker_threads: -1))", "(rx: (max_blocking_threads: 0))"),
        *("(rx: (), rx: ())", "(rx: (worker_threads: 1, worker_threads: 2))", "(rx: (worker_threads: 9999999999999))"),
    ],
)
def test_what_zenoh_would_abort_over_is_told(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the value, its form, and the way out; before Zenoh is asked to open anything."""
    monkeypatch.setenv("ZENOH_RUNTIME", text)

    with pytest.raises(SessionError, match="inv1: the environment variable ZENOH_RUNTIME is ") as told:
        Session("inv1")

    assert f'"{text}"' in str(told.value)
    assert f"unset it, or write e.g. {RUNTIME}" in str(told.value)
