"""Journals and link reports of one agent that nobody should write, for the checks of communication."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator
from typing import Any, cast

import msgspec
from msgspec.structs import replace

from gridpeers.lab.communication.communication_checks import CommunicationSummary
from gridpeers.netem.ledger import LinkTrace
from gridpeers.scenarios.emulation.link_data import report_data
from gridpeers.scenarios.record.record_file import RecordFile, RecordMessage
from gridpeers.wire.codec import CRC, encode
from gridpeers.wire.messages import LATEST, MOST_COUNT, PLANT, Journal, LinkReport, State
from tests.fuzz.mutation import NUMBERS, TEXTS
from tests.record.recorded_runs import toy_info
from tests.toy.toy_configs import toy_configs

T_END = 1.0  # End of the run (s)


class JournalFile:
    """A record with these parts of journals and link reports and nothing else; a `RecordFile` for a pass."""

    def __init__(self, parts: Iterable[tuple[str, bytes]], reports: Iterable[LinkReport], *, clock: str) -> None:
        plant, agents = toy_configs(3, end=T_END)
        self.info, self.t_end = toy_info(replace(plant, clock=clock), agents), T_END
        self.damage = ()
        self._parts, self._reports = parts, reports

    def messages(self, topics: object) -> Iterator[RecordMessage]:
        for number, (sender, data) in enumerate(self._parts):
            journal = Journal(sender=sender, epoch=1, seq=number, t=T_END, data=data)
            yield RecordMessage("journal", int(T_END * 1e9), number, bytes(encode(journal)))
        for number, report in enumerate(self._reports):
            yield RecordMessage("link_reports", int(T_END * 1e9), number, bytes(encode(report)))


def link_report(receiver: str, *traces: LinkTrace) -> LinkReport:
    (data,) = report_data(traces, {}, "")
    return LinkReport(sender=receiver, epoch=1, seq=0, t=T_END, data=data)


def judged(
    parts: Iterable[tuple[str, bytes]], reports: Iterable[LinkReport] = (), *, clock: str
) -> tuple[CommunicationSummary, int]:
    file = JournalFile(parts, reports, clock=clock)
    sums = CommunicationSummary(file.info, file.t_end).read(cast(RecordFile, file))
    return sums, sums.unreadable


def entries(payload: bytes) -> list[list[Any]]:
    state = bytes(encode(State(sender="inv1", epoch=1, seq=3, t=0.06, P_set=0.0, V_set=1.0, Q=0.0)))
    return [
        ["exchange", 3, [], [payload, state]],
        ["sent", 1.0, "state/inv1", state],
        ["received", 1.0, "state/inv1", payload, ""],
        ["heard", 1.0, "state/inv1", 1, 3, ""],
        ["decision", 3, 1, ["inv1", "inv3"], [2, None], ["", "silent"], [1.0, 0.0], [0, 0], 1.0, [0.02, None], [0.0]],
    ]


class Journals:
    """The pass of the checks over a record in which one journal, and reports of links, are made up."""

    def take(self, payload: bytes, rng: random.Random) -> str:
        made = entries(payload)
        for _ in range(rng.randrange(3)):
            entry = rng.choice(made)
            if rng.random() < 0.2:
                del entry[rng.randrange(len(entry) + 1) :]
            elif entry:
                entry[rng.randrange(len(entry))] = rng.choice((*NUMBERS, *TEXTS, payload, [], {}, None, [[payload]]))
        data = b"".join(map(msgspec.msgpack.encode, made))
        data = rng.choice((data, data[: rng.randrange(len(data))], payload[:-CRC] + data, data + payload[:-CRC]))
        parts = [(rng.choice(("inv1", PLANT)), data[:200_000])]
        reports = [link_report("inv1", _verdicts(rng)) for _ in range(rng.randrange(3))]
        sums, unreadable = judged(parts, reports, clock=rng.choice(("simulated", "realtime")))
        sums.finish()
        return "garbled" if unreadable else ""


def _verdicts(rng: random.Random) -> LinkTrace:
    numbers = [int(value) for value in NUMBERS if 0 <= value <= MOST_COUNT]
    times = [float(value) for value in NUMBERS if 0 <= value <= LATEST]
    count = rng.randrange(5)
    return LinkTrace(
        rng.choice(("inv2", "inv9", PLANT)),
        "inv1",
        tuple(rng.choices(numbers, k=count)),
        tuple(rng.choices(times, k=count)),
        tuple(rng.choices(("cut", "loss", 0.0, 1e300, ((0.1, None), (0.2, 7))), k=count)),
    )
