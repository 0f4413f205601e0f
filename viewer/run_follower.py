"""Follow a run for the page, in a thread of its own: a peer like `gridpeers watch`."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from time import monotonic

import msgspec

from gridpeers.scenarios.emulation.link_data import decode_statuses
from gridpeers.scenarios.live.feeder_map import read_feeder_map
from gridpeers.scenarios.live.run_client import RunClient
from gridpeers.scenarios.live.run_monitor import PlantStatus
from gridpeers.scenarios.live.watching import RunSubscriber
from gridpeers.viewer.run_view import Cursor, Frame, RunView
from gridpeers.wire.codec import encode
from gridpeers.wire.messages import Answer, Command, LinkAcknowledgement

PAUSE = 0.1  # Longest wait (s) for a message; then the page is looked after
ACCOUNTS = 0.5  # Time (s) between two questions for the accounts of emulated links, while any has a fault

STATUS = 5.0
"""Time (s) between two questions for the plant's status, which are also asked when a switch has moved, and for the
one-line diagram until it has come."""

AGAIN = 0.1  # Least time (s) between two questions for it


class RunFollower:
    """Feed a run's messages into a `RunView`, and read frames from it. Only its thread uses the client."""

    def __init__(self, client: RunClient) -> None:
        self._client = client
        self._view, self._lock = RunView(client.where.run), threading.Lock()
        self._on_news: Callable[[], None] = lambda: None
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._asked_status = self._asked_accounts = self._ask_map_at = float("-inf")
        self._had_plant = False

    def __enter__(self) -> RunFollower:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._thread.join()

    def on_news(self, call: Callable[[], None]) -> None:
        """Set the function that is called, in the follower's thread, when there may be something new."""
        self._on_news = call

    def frame(self, cursor: Cursor) -> tuple[Frame, Cursor]:
        """Return what is new since a cursor, and the next cursor; from any thread."""
        with self._lock:
            return self._view.frame(cursor, monotonic())

    def feeder_map(self) -> msgspec.Raw | None:
        with self._lock:
            return None if self._view.feeder_map is None else msgspec.Raw(msgspec.json.encode(self._view.feeder_map))

    def _follow(self) -> None:
        subscriber = RunSubscriber(self._client, self._view, self._take_other, self._lock)
        while not self._ending.is_set():
            heard = subscriber.take(PAUSE)
            now = monotonic()
            with self._lock:
                self._view.presence(plant=self._client.plant, agents=self._client.present, now=now)
                self._view.forget_silent(now)
                questions = self._questions(now)
            for verb in questions:
                self._ask(verb)
            if self._client.plant and (not self._had_plant or (now >= self._ask_map_at and self.feeder_map() is None)):
                self._ask_map_at = now + STATUS
                self._client.fetch(self._client.keys.feeder_map)
            self._had_plant = self._client.plant
            if heard or questions:
                self._on_news()

    def _questions(self, now: float) -> list[str]:
        if not self._client.plant:
            return []
        asked = []
        if now - self._asked_status >= (AGAIN if self._view.wants_status else STATUS):
            self._asked_status = now
            asked.append("status")
        if self._view.any_impaired and now - self._asked_accounts >= ACCOUNTS:
            self._asked_accounts = now
            asked.append("links")
        return asked

    def _ask(self, verb: str) -> None:
        tree = {"sender": "visitor", "epoch": 0, "seq": 0, "t": 0.0, "verb": verb, "reply_to": self._client.id}
        command = Command(**tree)  # type: ignore[arg-type]  # the fields above
        self._client.publish(self._client.keys.for_verb(verb), encode(command))

    def _take_other(self, key: str, payload: bytes) -> None:
        if key == self._client.keys.feeder_map:
            diagram = read_feeder_map(payload)
            with self._lock:
                self._view.feeder_map = diagram or self._view.feeder_map
            self._on_news()
            return
        message = self._client.read(key, payload)
        with contextlib.suppress(msgspec.DecodeError), self._lock:
            if isinstance(message, Answer) and message.ok and "phase" in message.data:
                self._view.plant_status(msgspec.convert(message.data, PlantStatus))
            elif isinstance(message, LinkAcknowledgement) and message.ok and message.data:
                self._view.accounts(message.sender, decode_statuses(message.data))
        self._on_news()
