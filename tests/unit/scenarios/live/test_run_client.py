"""Waiting for a plant: what is told meanwhile."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from scenarios.live import run_client as client
from scenarios.live.run_address import address_of
from scenarios.live.run_client import NobodyError, RunClient
from wire.driver.inbox import Inbox
from wire.keys import Keys


class Clock:
    """Time that passes while somebody waits, and whose token comes meanwhile."""

    def __init__(self, comes: dict[float, str]) -> None:
        self.now, self._comes = 0.0, comes

    def take(self, count: int, seconds: float) -> list[tuple[str, str, bytes, float]]:
        """Wait as a session does: until somebody comes, or to the end."""
        end = self.now + seconds
        due = [t for t in self._comes if t <= end]
        self.now = min(due) if due else end
        return [("appeared", Keys(self._comes.pop(self.now)).alive_plant(1), b"", self.now)] if due else []


@pytest.fixture
def waiting(monkeypatch: pytest.MonkeyPatch) -> Callable[[dict[float, str], float], list[str]]:
    """Waits for the plant of run lab and gives what was told, each with its time, the last without if all ended ill."""

    def wait(comes: dict[float, str], longest: float) -> list[str]:
        clock, told = Clock(comes), list[str]()

        class Session:
            """Stands for Zenoh."""

            id, misplaced, inbox = "1", False, Inbox()
            subscribe = watch = close = staticmethod(lambda *_: None)
            peers = staticmethod(lambda: ["a plant"])
            take = staticmethod(clock.take)

        monkeypatch.setattr(client, "Session", lambda *_, **__: Session())
        monkeypatch.setattr(client, "monotonic", lambda: clock.now)
        try:
            RunClient(address_of("lab", None)).find_plant(longest, lambda line: told.append(f"{clock.now:g}: {line}"))
        except NobodyError as error:
            told.append(str(error))
        return told

    return wait


def test_a_plant_of_another_run_is_told_at_once_and_once(
    waiting: Callable[[dict[float, str], float], list[str]],
) -> None:
    """A --run that no run has is reported during the wait, which goes on, as the run may yet start."""
    told = waiting({0.5: "lab2", 3.0: "lab"}, 60.0)

    assert told == [
        "0.5: no plant yet of run lab at tcp/127.0.0.1:7447 (runs there: lab2); waits on",
        "2: no plant yet of run lab at tcp/127.0.0.1:7447; 2 of 60 s waited",
    ]


def test_a_wait_is_told_ever_more_rarely(waiting: Callable[[dict[float, str], float], list[str]]) -> None:
    """A minute of waiting is five lines, and the sixth says that it was in vain."""
    *reminders, last = waiting({}, 60.0)

    assert [line.partition(":")[0] for line in reminders] == ["2", "4", "8", "16", "32"]
    assert last.startswith("no plant of run lab at tcp/127.0.0.1:7447 within 60 s")
