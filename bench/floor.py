"""The floor under lock-step: bare Zenoh, empty messages, the same sessions and the same mesh, and nothing to compute.

`measure` starts one hub and N peers. In each round the hub sends every peer an empty grant; a peer that has the grant
and the empty state of every other peer of the round before sends its own; the hub waits for all. What lock-step costs
more than this is messages with contents, the law, and the plant.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from time import monotonic, perf_counter

from scenarios.drivers.free_endpoint import free_endpoint
from wire.driver.session import Session

ROOT = "gridpeers/floor"
HELLO_PERIOD = 0.02
"""Distance of the greetings (s) by which all make sure to hear each other, before anything is measured."""


def measure(peers: int, rounds: int) -> float:
    """Return the time (s) of so many rounds with so many peers, their start not counted."""
    endpoint = free_endpoint()
    names = [f"p{i}" for i in range(peers)]
    command = [sys.executable, __file__, endpoint, str(rounds), json.dumps(names)]
    others = [subprocess.Popen([*command, name]) for name in names]
    try:
        hub = subprocess.run([*command, "hub"], stdout=subprocess.PIPE, check=True, timeout=120)
    finally:
        for other in others:
            try:
                other.wait(timeout=5)
            except subprocess.TimeoutExpired:
                other.kill()
    return float(hub.stdout)


class Peer:
    """One process of the floor, the hub or another."""

    def __init__(self, endpoint: str, names: list[str], name: str) -> None:
        self.name, self.others = name, [other for other in ("hub", *names) if other != name]
        hub = name == "hub"
        self.session = Session(
            name, listen=(endpoint if hub else "tcp/127.0.0.1:0",), connect=() if hub else (endpoint,)
        )
        self.seen: Counter[str] = Counter()
        for other in self.others:
            self.session.subscribe(f"{ROOT}/hello/{other}")
            self.session.subscribe(f"{ROOT}/state/{other}")
        if not hub:
            self.session.subscribe(f"{ROOT}/grant/{name}")

    def greet(self) -> None:
        """Return when all hear all."""
        complete: set[str] = set()
        heard: set[str] = set()
        while True:
            done = len(heard) == len(self.others)
            self.session.publish(f"{ROOT}/hello/{self.name}", b"1" if done else b"0")
            if done and len(complete) == len(self.others):
                return
            until = monotonic() + HELLO_PERIOD
            while (left := until - monotonic()) > 0:
                for _, key, payload, _ in self.session.inbox.take(1, left):
                    who = key.rpartition("/")[2]
                    if "/hello/" not in key:
                        self.seen[key] += 1
                        continue
                    heard.add(who)
                    if payload == b"1":
                        complete.add(who)

    def wait(self, counts: dict[str, int]) -> None:
        """Return when so many messages have come on each key; sleep until as many are there as are missing."""
        while missing := sum(max(0, count - self.seen[key]) for key, count in counts.items()):
            for _, key, _, _ in self.session.inbox.take(missing, 30.0):
                self.seen[key] += 1


def run(endpoint: str, rounds: int, names: list[str], name: str) -> None:
    """Be one process of the floor."""
    peer = Peer(endpoint, names, name)
    peer.greet()
    began = perf_counter()
    states = [f"{ROOT}/state/{other}" for other in names if other != name]
    grants = [f"{ROOT}/grant/{other}" for other in names]
    for k in range(rounds):
        if name == "hub":
            for grant in grants:
                peer.session.publish(grant, b"")
            peer.wait(dict.fromkeys(states, k + 1))
        else:
            peer.wait(dict.fromkeys(states, k) | {f"{ROOT}/grant/{name}": k + 1})
            peer.session.publish(f"{ROOT}/state/{name}", b"")
    if name == "hub":
        print(perf_counter() - began)
    peer.session.close()


if __name__ == "__main__":
    run(sys.argv[1], int(sys.argv[2]), json.loads(sys.argv[3]), sys.argv[4])
