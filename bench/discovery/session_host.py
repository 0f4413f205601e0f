"""A process of sessions: opens and closes them as it is told, and says what each has heard."""

from __future__ import annotations

import json
import os
import sys
import threading
from contextlib import suppress
from time import monotonic, sleep
from typing import Any

from bench.discovery.ways_to_meet import Config
from wire.driver.session import load_zenoh


class Worker:
    """The sessions of one process; answers each line of JSON with one."""

    def __init__(self) -> None:
        load_zenoh()
        import zenoh

        self._zenoh = zenoh
        self._lock = threading.Lock()
        self._sessions: dict[int, Any] = {}
        self._life: dict[int, int] = {}
        self._puts: dict[int, Any] = {}
        self._seen: dict[int, dict[tuple[str, int], int]] = {}
        """By session: the latest life of each neighbour by token and by message."""
        self._last = 0.0
        """When something new was heard last (s, monotonic)."""
        threading.Thread(target=self._send, daemon=True).start()

    def open(self, number: str, life: int, config: Config, near: list[int]) -> bool:
        """Open a session and declare."""
        i = int(number)
        session = self._zenoh.open(self._zenoh.Config.from_json5(json.dumps(config)))
        seen: dict[tuple[str, int], int] = {}
        for j in near:
            session.declare_subscriber(f"d/{j}/state", self._heard(seen, "state", j))
            session.liveliness().declare_subscriber(f"d/{j}/alive/*", self._token(seen, j), history=True)
        publisher = session.declare_publisher(f"d/{i}/state")
        token = session.liveliness().declare_token(f"d/{i}/alive/{life}")
        with self._lock:
            self._sessions[i], self._life[i], self._seen[i] = (session, token), life, seen
            self._puts[i] = publisher
        return True

    def close(self, number: str) -> bool:
        """Close a session; return whether that came to an end."""
        i = int(number)
        with self._lock:
            self._puts.pop(i, None)
            session, _ = self._sessions.pop(i)
            self._seen.pop(i)
        try:
            session.close()
        except self._zenoh.ZError:  # Zenoh gives up after 10 s
            return False
        return True

    def state(self) -> Config:
        """Return what each session has heard, its links, and when something new was heard last."""
        with self._lock:
            everyone = dict(self._sessions)
            seen = {i: [[kind, j, life] for (kind, j), life in known.items()] for i, known in self._seen.items()}
        links = {i: len(one.info.peers_zid()) + len(one.info.routers_zid()) for i, (one, _) in everyone.items()}
        return {"seen": seen, "links": links, "last": self._last}

    def _heard(self, seen: dict[tuple[str, int], int], kind: str, j: int) -> Any:
        def take(sample: Any) -> None:
            self._note(seen, kind, j, int(sample.payload.to_bytes()))

        return take

    def _token(self, seen: dict[tuple[str, int], int], j: int) -> Any:
        def take(sample: Any) -> None:
            if sample.kind == self._zenoh.SampleKind.PUT:
                self._note(seen, "alive", j, int(str(sample.key_expr).rpartition("/")[2]))

        return take

    def _note(self, seen: dict[tuple[str, int], int], kind: str, j: int, life: int) -> None:
        if seen.get((kind, j), -1) < life:
            seen[kind, j] = life
            self._last = monotonic()

    def _send(self) -> None:
        while True:
            with self._lock:
                puts = [(put, self._life[i]) for i, put in self._puts.items()]
            for put, life in puts:
                with suppress(self._zenoh.ZError):  # it closes just now
                    put.put(str(life).encode())
            sleep(0.1)


def worker() -> None:
    """Serve."""
    host = Worker()
    for line in sys.stdin:
        what, *arguments = json.loads(line)
        print(json.dumps(getattr(host, what)(*arguments)), flush=True)
    os._exit(0)
