"""One hop of a State from agent to agent, split: from the message as an object to the message as an object.

Two processes with a session each, as agents have them. Zenoh stamps the times at which a message enters and leaves it
(`TimestampInstrumentationBuilder`); the rest is stamped here: before `encode`, before `put`, in the callback, when the
owner of the inbox wakes, and after `decode`. Both processes read the host's clock. Percentiles of each part are of all
messages; those of the parts do not add up, their means do.

    .venv/bin/python -m bench.hops [--count 2000] [--every_us 3000]
"""

# ruff: noqa: SLF001 - the stamps need Zenoh's own objects, which a session of ours does not show

from __future__ import annotations

import json
import subprocess
import sys
from statistics import mean, quantiles
from time import sleep, time_ns
from typing import Any

from bench.harness import machine, options
from scenarios.drivers.free_endpoint import free_endpoint
from wire.codec import decode, encode
from wire.driver.foreign import keep_thread_state
from wire.driver.inbox import Inbox
from wire.driver.session import Session
from wire.messages import State

KEY = "gridpeers/hops/state/inv1"
WARM_UP = 100
"""Messages that are not counted: links and caches are new."""

LONGEST = 10.0
"""Longest wait for a message (s)."""

PARTS = (
    "encode",
    "put: Python to Zenoh",
    "Zenoh: route and queue, the socket, and over there to the router",
    "Zenoh: to the subscriber",
    "callback: Zenoh to Python, in its thread",
    "waking the owner of the inbox",
    "decode, with checks of bounds and CRC-32",
)
"""The parts, between one time stamp and the next."""


def state(k: int, began: int) -> State:
    """Return a state that carries the time before its encoding (ns since the start, exact as a float)."""
    return State(sender="inv1", epoch=1, seq=k, t=0.02 * k, P_set=float(began), V_set=277.1, Q=1.2e4, island="inv1")


def send(endpoint: str, count: int, every: float, epoch: int) -> None:
    """Send so many states, one every so many seconds, as soon as somebody hears them."""
    session = Session("inv1", connect=(endpoint,), listen=("tcp/127.0.0.1:0",))
    builder = session._zenoh.TimestampInstrumentationBuilder()
    stamps = builder.set_send(True).set_route(True).set_receive(True).build()
    session.prepare(KEY)
    publisher: Any = session._publishers[KEY]
    while not publisher.matching_status.matching:
        sleep(0.01)
    puts = []
    for k in range(count + WARM_UP):
        payload = encode(state(k, time_ns() - epoch))
        puts.append(time_ns() - epoch)
        publisher.put(payload, timestamp_instrumentation=stamps)
        sleep(every)
    print(json.dumps(puts))
    session.close()


def receive(session: Session, inbox: Inbox, count: int, epoch: int) -> list[list[int]]:
    """Return the time stamps (ns) of each message but those of the sender's `put`."""
    samples: list[tuple[Any, int]] = []
    rows: list[list[int]] = []

    def on_sample(sample: Any) -> None:
        keep_thread_state()
        called = time_ns() - epoch
        samples.append((sample, called))
        inbox.put(("message", KEY, sample.payload.to_bytes()))

    handler = session._zenoh.handlers.Callback(on_sample, indirect=False)
    subscriber = session._session.declare_subscriber(KEY, handler)
    while len(rows) < count + WARM_UP:
        events = inbox.take(1, LONGEST)
        if not events:
            raise TimeoutError(f"nothing came for {LONGEST:g} s")
        for _, _, payload, _ in events:
            woken = time_ns() - epoch
            message = decode(payload)
            decoded = time_ns() - epoch
            assert isinstance(message, State)
            sample, called = samples[len(rows)]
            inside = [ns_of(record.timestamp(), epoch) for record in sample.timestamp_stack.records]
            rows.append([round(message.P_set), inside[0], inside[-2], inside[-1], called, woken, decoded])
    subscriber.undeclare()  # type: ignore[no-untyped-call]
    return rows


def ns_of(timestamp: object, epoch: int) -> int:
    """Return a time stamp of Zenoh (NTP64: seconds since 1970 in units of 2^-32 s) in ns since the epoch."""
    return (int(str(timestamp).partition("/")[0]) * 1_000_000_000 >> 32) - epoch


def main() -> None:
    """Measure and print."""
    given = options(__doc__, count=2000, every_us=3000)
    endpoint, epoch = free_endpoint(), time_ns()
    session = Session("inv2", listen=(endpoint,))
    command = [sys.executable, "-m", "bench.hops", "send", endpoint]
    command += [str(given.count), str(given.every_us / 1e6), str(epoch)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as sender:
        rows = receive(session, session.inbox, given.count, epoch)
        assert sender.stdout is not None
        puts = json.loads(sender.stdout.read())
    session.close()
    stamps = [[row[0], put, *row[1:]] for row, put in zip(rows, puts, strict=True)][WARM_UP:]
    print(machine())
    size = len(encode(state(given.count, time_ns() - epoch)))
    print(f"a State of {size} bytes, one every {given.every_us} us, {given.count} messages\n")
    print(f"{'us':68}{'mean':>8}{'p50':>8}{'p99':>8}")
    spans = {part: [(row[i + 1] - row[i]) / 1e3 for row in stamps] for i, part in enumerate(PARTS)}
    spans["one hop, object to object"] = [(row[-1] - row[0]) / 1e3 for row in stamps]
    for part, took in spans.items():
        cut = quantiles(took, n=100)
        print(f"{part:68}{mean(took):8.1f}{cut[49]:8.1f}{cut[98]:8.1f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["send"]:
        send(sys.argv[2], int(sys.argv[3]), float(sys.argv[4]), int(sys.argv[5]))
    else:
        main()
