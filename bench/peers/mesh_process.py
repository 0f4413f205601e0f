"""One process of a mesh (`bench.peers.mesh`), whose configuration is its argument; the hub prints the seconds.

Bare Zenoh has sessions of the settings that decide the cost of ours, callbacks that only count, and nothing of ours:
`zenoh` has a link for each pair of processes; in `zenoh-star` the hub relays all messages, as our plant does. ZeroMQ
has publishers and subscribers over Unix domain sockets (ipc), every process connected to every other. In HELICS each
process is a federate that publishes and asks for the next time.
"""

from __future__ import annotations

import json
import os
import sys
from _thread import allocate_lock
from collections import Counter, deque
from contextlib import suppress
from pathlib import Path
from time import monotonic, perf_counter, sleep
from typing import Any

import msgspec
import zenoh

from bench.peers.mesh import DEADLINE, HUB, WARM_UP, MeshMember
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint

RUNTIME = "(rx: (worker_threads: 1), acc: (handover: app), net: (handover: app), tx: (handover: app))"
"""Threads of Zenoh as in `wire/driver/zenoh_settings.py`; with the defaults a tick takes longer."""

ONE_THREAD = "(rx: (handover: app), acc: (handover: app), net: (handover: app), tx: (handover: app))"
"""Threads of a member that reaches the others through the hub, as our agents do through the plant."""


class ZenohTransport:
    """One session over TCP: of a full mesh, found by gossip, or of a star."""

    def __init__(self, member: MeshMember) -> None:
        star = member.transport == "zenoh-star"
        os.environ.setdefault("ZENOH_RUNTIME", ONE_THREAD if star and not member.is_hub else RUNTIME)
        address = Path(member.folder) / "address"
        if member.is_hub:
            endpoint = free_endpoint()
            listen, connect = endpoint, []
        else:
            listen, connect = "tcp/127.0.0.1:0", [_read(address)]
        mode = "peer" if not star else "router" if member.is_hub else "client"
        config = {
            "mode": mode,
            "listen": {"endpoints": [] if mode == "client" else [listen]},
            "connect": {"endpoints": connect, "timeout_ms": -1, "exit_on_failure": False},
            "scouting": {"delay": 0 if star else 500, "multicast": {"enabled": False}, "gossip": {"enabled": not star}},
            "transport": {
                "unicast": {"qos": {"enabled": False}},
                "link": {"tx": {"lease": 60_000}},
                "shared_memory": {"enabled": False},
            },
        }
        self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        if member.is_hub:
            _tell(address, listen)
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._declared: list[Any] = []
        self._came: deque[tuple[str, bytes]] = deque()
        self._needed = 1
        self._wake = allocate_lock()
        self._wake.acquire()

    def subscribe(self, topic: str) -> None:
        """Take in the messages of a topic, in Zenoh's receiving thread."""
        came, wake = self._came, self._wake

        def on_sample(sample: zenoh.Sample) -> None:
            came.append((topic, sample.payload.to_bytes()))
            if len(came) >= self._needed:
                with suppress(RuntimeError):  # awake already
                    wake.release()

        handler: Any = zenoh.handlers.Callback(on_sample, indirect=False)
        self._declared.append(
            self._session.declare_subscriber(f"mesh/{topic}", handler, allowed_origin=zenoh.Locality.REMOTE)
        )

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a message."""
        publisher = self._publishers.get(topic)
        if publisher is None:
            publisher = self._publishers[topic] = self._session.declare_publisher(
                f"mesh/{topic}",
                congestion_control=zenoh.CongestionControl.BLOCK,
                allowed_destination=zenoh.Locality.REMOTE,
            )
        publisher.put(payload)

    def take(self, needed: int, timeout: float) -> list[tuple[str, bytes]]:
        """Wait for so many messages; return those that came."""
        came = self._came
        self._wake.acquire(blocking=False)
        self._needed = needed
        if len(came) < needed:
            self._wake.acquire(timeout=timeout)
        return [came.popleft() for _ in range(len(came))]

    def close(self) -> None:
        """Leave."""
        self._session.close()  # type: ignore[no-untyped-call]  # as zenoh declares it


def _tell(address: Path, endpoint: str) -> None:
    """Write the hub's endpoint, whole or not at all."""
    partial = address.with_suffix(".partial")
    partial.write_text(endpoint)
    partial.rename(address)


def _read(address: Path) -> str:
    """Return the hub's endpoint once it listens."""
    until = monotonic() + DEADLINE
    while not address.exists():
        if monotonic() > until:
            raise TimeoutError("the hub does not listen")
        sleep(0.005)
    return address.read_text()


class ZeromqTransport:
    """A publishing socket and a subscribing socket."""

    def __init__(self, member: MeshMember) -> None:
        import zmq

        self._zmq = zmq
        self._context = zmq.Context()
        self._out = self._context.socket(zmq.PUB)
        self._in = self._context.socket(zmq.SUB)
        for socket in (self._out, self._in):
            socket.setsockopt(zmq.SNDHWM, 0)
            socket.setsockopt(zmq.RCVHWM, 0)
            socket.setsockopt(zmq.LINGER, 1000)
        folder = Path(member.folder)
        self._out.bind(f"ipc://{folder / member.name}")
        for other in member.others:
            self._in.connect(f"ipc://{folder / other}")  # it waits for a socket that is not there yet

    def subscribe(self, topic: str) -> None:
        """Take in the messages of a topic."""
        self._in.setsockopt(self._zmq.SUBSCRIBE, f"{topic} ".encode())

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a message."""
        self._out.send(f"{topic} ".encode() + payload)

    def take(self, needed: int, timeout: float) -> list[tuple[str, bytes]]:
        """Wait for so many messages; return those that came."""
        came: list[tuple[str, bytes]] = []
        until = monotonic() + timeout
        while len(came) < needed:
            if not self._in.poll(max(0, round(1e3 * (until - monotonic())))):
                break
            try:
                while True:
                    topic, _, payload = self._in.recv(self._zmq.NOBLOCK).partition(b" ")
                    came.append((topic.decode(), payload))
            except self._zmq.Again:
                continue
        return came

    def close(self) -> None:
        """Leave."""
        self._out.close()
        self._in.close()
        self._context.term()


BROKER_LEAVES = 2000
"""Longest time (ms) for the broker to see all federates off."""


def run_federate(member: MeshMember) -> float:
    """Be one federate; return the seconds of the rounds that count.

    Values go as in `bench.peers.mesh_process`, but a federate sees those of the round before: this is generous to
    HELICS, as in lock-step an agent waits for the measurement of the same tick.
    """
    import helics

    core = member.transport.removeprefix("helics-")
    broker: Any = None
    address = Path(member.folder) / "address"
    if member.is_hub:
        port = free_endpoint().rpartition(":")[2]
        options = f"-f {1 + len(member.hosts)} --loglevel=no_print --localinterface=tcp://127.0.0.1:{port}"
        broker = helics.helicsCreateBroker(core, "", options)
        if not helics.helicsBrokerIsConnected(broker):
            raise RuntimeError(f"no {core} broker at port {port}")
        _tell(address, helics.helicsBrokerGetAddress(broker))
    where = _read(address)
    info = helics.helicsCreateFederateInfo()
    helics.helicsFederateInfoSetCoreTypeFromString(info, core)
    options = f"--federates=1 --loglevel=no_print --broker_address={where}"
    helics.helicsFederateInfoSetCoreInitString(
        info, f"{options} --localinterface={'tcp://' * (core == 'zmq')}127.0.0.1"
    )
    helics.helicsFederateInfoSetFlagOption(info, helics.HELICS_FLAG_UNINTERRUPTIBLE, True)
    federate = helics.helicsCreateValueFederate(member.name, info)
    raw = helics.HELICS_DATA_TYPE_STRING
    topics = [f"measurement/{agent}" for agent in member.heard] if member.is_hub else []
    topics += [f"state/{agent}" for agent in member.agents]
    outputs = [helics.helicsFederateRegisterGlobalPublication(federate, topic, raw, "") for topic in topics]
    wanted = [f"state/{agent}" for agent in member.heard] + [f"measurement/{agent}" for agent in member.agents]
    inputs = [helics.helicsFederateRegisterSubscription(federate, topic, "") for topic in wanted]
    text = "x" * (member.measurement_size if member.is_hub else member.state_size)
    helics.helicsFederateEnterExecutingMode(federate)
    began = 0.0
    for k in range(WARM_UP + member.rounds):
        if k == WARM_UP:
            began = perf_counter()
        for output in outputs:
            helics.helicsPublicationPublishString(output, text)
        helics.helicsFederateRequestTime(federate, float(k + 1))
        for each in inputs:
            if helics.helicsInputIsUpdated(each):
                helics.helicsInputGetString(each)
    seconds = perf_counter() - began
    helics.helicsFederateDisconnect(federate)
    if broker is not None:
        helics.helicsBrokerWaitForDisconnect(broker, BROKER_LEAVES)
    helics.helicsCloseLibrary()
    return seconds


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
