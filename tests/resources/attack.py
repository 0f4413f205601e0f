"""Somebody who reaches a run and sends without end: ``python -m tests.resources.attack < ATTACK.json``.

It says "linked" once it has links, then sends until standard input ends.
"""

from __future__ import annotations

import random
import sys
import threading
from collections.abc import Iterator
from itertools import count
from time import monotonic, sleep

import msgspec

from gridpeers.wire.driver.session import Session
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Command, Measurement, State, Stop
from tests.hostile.cases import packed, sound

LINKED = "linked"
RATE = 10_000.0  # Messages a second


class Attack(msgspec.Struct, kw_only=True):
    """What is sent, and where."""

    endpoint: str
    """Where the plant listens."""
    run: str
    """Name of the run."""
    names: tuple[str, ...]
    """Inverters."""
    kind: str
    """A key of `KINDS`, or "tokens": 400 processes that claim a name of the run, or one that nobody knows."""


Sending = Iterator[tuple[str, bytes]]


def foreign(attack: Attack, keys: Keys) -> Sending:
    """Yield sound states, measurements and stops of strangers, in an epoch that is nobody's; and random bytes."""
    rng = random.Random(1)
    places = [(keys.state(name), State, name) for name in attack.names]
    places += [(keys.measurement(name), Measurement, "plant") for name in attack.names]
    places += [(keys.control, Stop, "plant")]
    made = [
        (key, packed(sound(kind, sender=sender, epoch=666, seq=seq, t=1e3)))
        for key, kind, sender in places
        for seq in range(10**6, 10**6 + 20)
    ] + [(key, rng.randbytes(100)) for key, *_ in places]
    while True:
        yield rng.choice(made)


def commands(attack: Attack, keys: Keys) -> Sending:
    """Yield questions for the plant's status, each of another client."""
    for number in count():
        question = sound(Command, sender="visitor", epoch=0, seq=number, t=0.0)
        question |= {"verb": "status", "reply_to": f"z{number}", "link_command": {}}
        question.pop("load")
        yield keys.request, packed(question)


KINDS = {"foreign": foreign, "commands": commands}


def main() -> None:
    attack = msgspec.json.decode(sys.stdin.readline(), type=Attack)
    keys, names = Keys(attack.run), attack.names
    ending = threading.Event()
    session = Session("attacker", listen=("tcp/127.0.0.1:0",), connect=(attack.endpoint,), clock="realtime")
    while session.peers() <= len(names):
        session.take(1, 0.05)
    print(LINKED, flush=True)
    threading.Thread(target=lambda: (sys.stdin.read(), ending.set()), daemon=True).start()
    if attack.kind == "tokens":
        for i in range(400):
            session.hold_token(keys.alive_agent(names[i % len(names)] if i % 2 else f"who{i}", f"x{i}"))
        ending.wait()
    else:
        began = monotonic()
        for sent, (key, payload) in enumerate(KINDS[attack.kind](attack, keys)):
            if ending.is_set():
                break
            session.publish(key, payload)
            if (ahead := began + sent / RATE - monotonic()) > 0.002:
                sleep(ahead)
    session.close()


if __name__ == "__main__":
    main()
