"""A recorder that was out of reach gets what it has not got: from the plant's memory, in order, each message once."""

from __future__ import annotations

import random
from itertools import pairwise
from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.plant.recorder_feed import RecorderFeed
from gridpeers.scenarios.drivers.telemetry_stream import ASTRAY, TelemetryStream
from gridpeers.wire.messages import Answer, Command, LinkReport, Message, Telemetry
from tests.unit.plant.plant_lab import KEYS
from tests.unit.plant.realtime.realtime_lab import Lab, running


class Link:
    """The recorder of a plant on a fake clock; what is sent while its link is down is lost."""

    def __init__(self, lab: Lab) -> None:
        self.lab, self.stream = lab, TelemetryStream()
        self.up = True
        self.got: list[Message] = []
        self._taken = self._questions = 0

    def carry(self) -> None:
        """Deliver what the plant has sent since, and ask if something is missing."""
        while True:
            news = self.lab.sent[self._taken :]
            self._taken = len(self.lab.sent)
            for key, message in news if self.up else ():
                if key == KEYS.answer("me") and isinstance(message, Answer) and message.seq == self._questions:
                    self.stream.answered(message, self.lab.now)
                elif key == KEYS.telemetry and isinstance(message, Telemetry | LinkReport):
                    self.got += self.stream.take(message, self.lab.now)
            question = self.stream.question(self.lab.now)
            if question is None:
                return
            self._questions += 1
            if self.up:
                command = Command(
                    sender="me", epoch=1, seq=self._questions, t=0.0, verb="telemetry", argument=question, reply_to="me"
                )
                self.lab.hear(KEYS.command, command)

    @property
    def rows(self) -> list[float]:
        return [row[0] for message in self.got if isinstance(message, Telemetry) for row in message.rows]


def report(number: int) -> LinkReport:
    return LinkReport(sender="inv1", epoch=1, seq=0, t=0.0, data=str(number).encode())


@pytest.mark.parametrize("seed", range(2))
def test_a_recorder_that_was_cut_off_has_all_rows_and_reports_in_order_and_once(seed: int) -> None:
    """However often and long the link was down, and even if the last word fell into it."""
    draw = random.Random(seed)
    lab = running(end=None)
    link, reports = Link(lab), 0
    for _ in range(40):
        link.up = draw.random() < 0.6
        for _ in range(draw.randrange(1, 60)):
            lab.step()
            if draw.random() < 0.1:
                lab.hear(KEYS.report("inv1"), report(reports))
                reports += 1
            link.carry()
    link.up = True
    lab.step(200)
    link.carry()
    for _ in range(300):
        lab.step()
        link.carry()
    lab.node.close("enough", lab.now)
    for name in lab.toy.inverters:
        lab.token(name, gone=True)
    link.carry()

    assert [m.data for m in link.got if isinstance(m, LinkReport)] == [str(n).encode() for n in range(reports)]
    assert link.rows == pytest.approx([0.02 * k for k in range(len(link.rows))])
    last = link.got[-1]
    assert isinstance(last, Telemetry)
    assert last.final
    assert not link.stream.lost


def test_rows_beyond_the_plants_memory_are_a_known_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a longer absence the recorder continues with the kept rows, and notes the gap."""
    lab = running(end=None)
    monkeypatch.setattr(lab.node.feed, "_limit", 4_000)
    link = Link(lab)
    lab.step(50)
    link.carry()
    link.up = False
    for _ in range(40):
        lab.step(50)
        link.carry()
    link.up = True
    for _ in range(200):
        lab.step()
        link.carry()
    steps = {round((b - a) / 0.02) for a, b in pairwise(link.rows)}

    assert link.stream.lost
    assert min(steps) == 1
    assert len(steps) == 2


@pytest.mark.parametrize("argument", ["", "x", "-1", "1" * 30, "٣"])
def test_an_invalid_question_is_answered_and_changes_nothing(argument: str) -> None:
    """The plant answers and continues."""
    lab = running(end=None)
    lab.step(50)
    lab.take(Telemetry)
    answer = lab.ask("telemetry", argument)
    lab.step(5)

    assert not answer.ok
    assert "is no number of a Telemetry" in answer.text
    assert all(message.seq >= 5 for message in lab.take(Telemetry))


def test_a_plant_waits_at_its_end_for_a_recorder_that_is_out_of_reach() -> None:
    """For a moment only; one that went after the last word has all."""
    ends: list[Any] = []
    for lost in (True, False):
        lab = Lab(end=None, recorders=("me",))
        lab.node.appeared(KEYS.alive_recorder("me"), lab.now)
        lab.join(*lab.toy.inverters)
        lab.step(5)
        if lost:
            lab.node.vanished(KEYS.alive_recorder("me"), lab.now)
        lab.step(5)
        lab.node.close("enough", lab.now)
        for name in lab.toy.inverters:
            lab.token(name, gone=True)
        if not lost:
            lab.node.vanished(KEYS.alive_recorder("me"), lab.now)
        ends.append(lab.node.finished)
        for _ in range(2):  # what is waited for agents, then for recorders
            lab.node.expire(lab.node.deadline)
        ends.append(lab.node.finished)

    assert ends == [False, True, True, True]


def test_a_session_that_brings_nothing_is_opened_anew_ever_more_seldom() -> None:
    """Questions without an answer: the link may be stale on one side, or the plant frozen for long."""
    stream, now, opened = TelemetryStream(), 0.0, []
    first = Telemetry(
        sender="plant", epoch=1, seq=0, t=0.0, inverters=(), rows=(), events=(), final=False, outcome="",
        reproducible=False,
    )  # fmt: skip
    assert not stream.is_astray(1e6)
    stream.take(first, now)
    while now < 50.0:
        now += 0.5
        stream.question(now)
        if stream.is_astray(now):
            opened.append(now)
    stream.answered(Answer(sender="plant", epoch=1, seq=9, t=0.0, ok=True, text="1"), now)

    assert opened[0] == pytest.approx(1.5 + ASTRAY)
    assert [b - a for a, b in pairwise(opened)] == [6.0, 12.0, 24.0]
    assert stream.take(replace(first, seq=1, final=True), now)
    assert stream.question(now + 100.0) is None
    assert not stream.is_astray(now + 100.0)


@pytest.mark.parametrize("end", ["close", "interrupt"])
def test_the_end_of_a_run_does_not_wait_for_what_is_published_again(end: str) -> None:
    """If the run ends while a recorder is served, the plant sends the rest and the last message at once."""
    lab = running(end=None)
    lab.step(2000)
    assert lab.ask("telemetry", "0").ok
    lab.step(2)
    (lab.node.close if end == "close" else lab.node.interrupt)("enough", lab.now)
    lab.do()
    told: list[Telemetry] = lab.take(Telemetry)

    assert told[-1].final
    assert [message.seq for message in told[-150:]] == list(range(told[-1].seq - 149, told[-1].seq + 1))


def test_repeated_messages_are_the_kept_ones_within_a_bound() -> None:
    """Messages of any size, asked for at any time, come byte by byte and in order; those of one number together."""
    rng, sent = random.Random(1), list[tuple[int, bytes]]()
    got: list[bytes] = []
    feed = RecorderFeed((), got.append, limit=4000)
    for k in range(600):
        sent.append((k // 2, rng.randbytes(rng.choice((0, 10, 400, 1500)))))
        got.clear()
        feed.publish(*sent[-1])
        assert got == [sent[-1][1]]
        if rng.random() < 0.1:
            got.clear()
            first = feed.again_from(rng.randrange(k // 2 + 1))
            feed.replay()

            assert got == [payload for number, payload in sent if number >= first]
            assert sum(map(len, got)) <= 4000 + 2 * 1500
