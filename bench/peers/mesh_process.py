"""One process of a mesh (`bench.peers.mesh`), whose configuration is its argument; the hub prints the seconds."""

from __future__ import annotations

import sys
from collections import Counter
from time import monotonic, perf_counter

import msgspec

from bench.peers.mesh import DEADLINE, HUB, WARM_UP, MeshMember
from bench.peers.mesh_transports import ZenohTransport, ZeromqTransport, run_federate

GREETING = 0.05
"""Time (s) between two greetings, by which all make sure to hear each other before anything is measured."""


class MeshNode:
    """One process of a mesh that meets the others by greetings: all transports but HELICS."""

    def __init__(self, member: MeshMember, transport: ZenohTransport | ZeromqTransport) -> None:
        self._member, self._transport = member, transport
        self._seen: Counter[str] = Counter()
        for other in member.others:
            transport.subscribe(f"hello/{other}")
        for agent in member.heard:
            transport.subscribe(f"state/{agent}")
        for agent in member.agents:
            transport.subscribe(f"measurement/{agent}")

    def greet(self) -> None:
        """Return when all hear all."""
        others, transport = set(self._member.others), self._transport
        heard: set[str] = set()
        complete: set[str] = set()
        until = monotonic() + DEADLINE
        while monotonic() < until:
            done = heard == others
            transport.publish(f"hello/{self._member.name}", b"1" if done else b"0")
            if done and complete == others:
                return
            again = monotonic() + GREETING
            while (left := again - monotonic()) > 0.0 and not (heard == complete == others):
                for topic, payload in transport.take(1, left):
                    kind, _, name = topic.partition("/")
                    if kind != "hello":
                        self._seen[topic] += 1
                        continue
                    heard.add(name)
                    if payload == b"1":
                        complete.add(name)
        raise TimeoutError(f"{self._member.name}: no greeting of {', '.join(sorted(others - complete))}")

    def run(self) -> float:
        """Do all rounds; return the seconds of those that count."""
        member, publish = self._member, self._transport.publish
        states = [f"state/{agent}" for agent in member.heard]
        measurements = [f"measurement/{agent}" for agent in (member.heard if member.is_hub else member.agents)]
        own = [f"state/{agent}" for agent in member.agents]
        measurement, state = b"m" * member.measurement_size, b"s" * member.state_size
        began = 0.0
        for k in range(WARM_UP + member.rounds):
            if k == WARM_UP:
                began = perf_counter()
            if member.is_hub:
                for topic in measurements:
                    publish(topic, measurement)
                self._wait(dict.fromkeys(states, k + 1))
            else:
                self._wait(dict.fromkeys(states, k) | dict.fromkeys(measurements, k + 1))
                for topic in own:
                    publish(topic, state)
        return perf_counter() - began

    def _wait(self, counts: dict[str, int]) -> None:
        """Return when so many messages have come on each topic; sleep until as many are there as are missing."""
        seen = self._seen
        while missing := sum(count - seen[topic] for topic, count in counts.items() if seen[topic] < count):
            came = 0
            for topic, _ in self._transport.take(missing, DEADLINE):
                seen[topic] += 1
                came += 1
            if not came:
                raise TimeoutError(f"{self._member.name}: nothing came for {DEADLINE:g} s")


def main() -> None:
    """Be one process of a mesh."""
    member = msgspec.json.decode(sys.argv[1], type=MeshMember)
    if member.transport.startswith("helics"):
        seconds = run_federate(member)
    else:
        transport = (ZenohTransport if member.transport.startswith("zenoh") else ZeromqTransport)(member)
        node = MeshNode(member, transport)
        node.greet()
        seconds = node.run()
        transport.close()
    if member.name == HUB:
        print(seconds)


if __name__ == "__main__":
    main()
