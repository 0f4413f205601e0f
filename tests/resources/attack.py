"""Somebody who reaches a run and sends without end: ``python -m tests.resources.attack WHAT < ATTACK.json``.

It says "linked" once it has links, then sends until standard input ends, and says what it has sent.
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


class Attack(msgspec.Struct, kw_only=True):
    """What is sent, and where."""

    endpoint: str
    """Where the plant listens."""
    run: str
    """Name of the run."""
    names: tuple[str, ...]
    """Inverters."""
    kind: str
    """A key of `KINDS`, or tokens."""
    rate: float = 0.0
    """Messages a second; 0 is as fast as it goes."""
    epochs: dict[str, int] = {}
    """True epochs, for whoever copies them."""
    size: int = 0
    """Bytes of a long message."""
    tokens: int = 0
    """Tokens to hold."""
    links: int = 1
    """Links to wait for."""
    star: bool = False
    """Whether the run is a star: then one link leads to all."""


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


def copied(attack: Attack, keys: Keys) -> Sending:
    """Yield states in true epochs, as of somebody who listens and sends old ones again."""
    made = [
        (keys.state(name), packed(sound(State, sender=name, epoch=attack.epochs[name], seq=seq, t=0.0)))
        for name in attack.names
        for seq in range(20)
    ]
    rng = random.Random(1)
    while True:
        yield rng.choice(made)


def commands(attack: Attack, keys: Keys) -> Sending:
    """Yield questions for the plant's status, each of another client."""
    for number in count():
        question = sound(Command, sender="visitor", epoch=0, seq=number, t=0.0)
        question |= {"verb": "status", "reply_to": f"z{number}", "link_command": {}}
        question.pop("load")
        yield keys.request, packed(question)


def long(attack: Attack, keys: Keys) -> Sending:
    """Yield long messages of zeros on all keys of states."""
    payload = bytes(attack.size)
    while True:
        for name in attack.names:
            yield keys.state(name), payload


KINDS = {"foreign": foreign, "copied": copied, "commands": commands, "long": long}


def tokens(attack: Attack, keys: Keys, session: Session) -> int:
    """Hold tokens of thousands of processes that claim names of the run, and of others."""
    for i in range(attack.tokens):
        session.hold_token(keys.alive_agent(attack.names[i % len(attack.names)] if i % 2 else f"who{i}", f"x{i}"))
    return attack.tokens


def main() -> None:
    """Attack until standard input ends."""
    attack = msgspec.json.decode(sys.stdin.readline(), type=Attack)
    keys = Keys(attack.run)
    ending = threading.Event()
    if attack.star:
        session = Session("attacker", connect=(attack.endpoint,), star=True)
    else:
        session = Session("attacker", listen=("tcp/127.0.0.1:0",), connect=(attack.endpoint,), clock="wall")
    while session.peers() < attack.links:
        session.take(1, 0.05)
    print(LINKED, flush=True)
    threading.Thread(target=lambda: (sys.stdin.read(), ending.set()), daemon=True).start()
    sent = tokens(attack, keys, session) if attack.kind == "tokens" else 0
    began = monotonic()
    if attack.kind in KINDS:
        for key, payload in KINDS[attack.kind](attack, keys):
            if ending.is_set():
                break
            session.publish(key, payload)
            sent += 1
            ahead = began + sent / attack.rate - monotonic() if attack.rate else 0.0
            if ahead > 0.002:
                sleep(ahead)
    ending.wait()
    print(sent, flush=True)
    session.close()


if __name__ == "__main__":
    main()
