"""How many sessions find each other: the time until each hears its neighbours, its links, and waves of churn.

`--sessions` sessions, hosted by `--processes` processes of their own and all opened at once, form the graph of
`--neighbours` neighbours each (a ring with chords). A session hears a neighbour once it has its liveliness token and a
message of it; every session sends one ten times a second. Then come `--waves` waves: ten sessions close, ten others
open in their place, and all must hear their neighbours again within `--deadline` s, or the wave counts as hanging.

    .venv/bin/python -m bench.discovery [--ways flat,hub] [--sessions 100] [--processes 4] [--neighbours 4] [--waves 30]
"""

from __future__ import annotations

import json
import os
import random
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from statistics import median
from time import monotonic, sleep
from typing import Any

from bench.harness import machine, options
from wire.driver.session import load_zenoh
from wire.driver.zenoh_settings import LEASE

HUB = -1
"""Number of the session that all can reach: the plant's place."""

LEFT = 10
"""Sessions that close in a wave, and that open."""

Config = dict[str, Any]


def _peer(listen: str, connect: list[str], *, mode: str = "peer", gossip: bool = False, **more: Any) -> Config:
    """Return the settings of a session, as the product has them, but for what differs from way to way."""
    return {
        "mode": mode,
        "listen": {"endpoints": [listen] if listen else []},
        "open": {"return_conditions": {"connect_scouted": False, "declares": False}},
        "connect": {
            "endpoints": connect,
            "timeout_ms": -1,
            "exit_on_failure": False,
            "retry": {"period_init_ms": 20, "period_max_ms": 200, "period_increase_factor": 1.5},
        },
        "scouting": {
            "multicast": {"enabled": False},
            "gossip": {
                "enabled": gossip,
                "autoconnect_strategy": {
                    "peer": {"to_router": "always", "to_peer": more.pop("to_peer", "greater-zid")}
                },
                **more.pop("scouting", {}),
            },
        },
        "transport": {
            "unicast": {"qos": {"enabled": False}, "accept_pending": 1000, "max_sessions": 2000},
            "link": {"tx": {"lease": LEASE, "keep_alive": 4}},
            "shared_memory": {"enabled": False},
        },
        **more,
    }


class Places:
    """Endpoints and graph of a run."""

    def __init__(self, sessions: int, processes: int, neighbours: int) -> None:
        self.count, self.processes = sessions, processes
        held = [socket.socket() for _ in range(sessions + processes + 1)]
        for one in held:
            one.bind(("127.0.0.1", 0))
        ports = [one.getsockname()[1] for one in held]
        for one in held:
            one.close()
        self.own = [f"tcp/127.0.0.1:{port}" for port in ports[:sessions]]
        self.hub = f"tcp/127.0.0.1:{ports[sessions]}"
        self.gates = [f"tcp/127.0.0.1:{port}" for port in ports[sessions + 1 :]]
        half = neighbours // 2
        self.near = [
            sorted({(i + step) % sessions for k in range(1, half + 1) for step in (k, -k)} - {i})
            for i in range(sessions)
        ]

    def process(self, i: int) -> int:
        """Process of a session: neighbours on the ring stay together."""
        return max(0, i) * self.processes // self.count


ANY = "tcp/127.0.0.1:0"
Way = Callable[[Places, int], Config]


def _flat(places: Places, i: int) -> Config:
    return _peer(places.hub, [], gossip=True) if i == HUB else _peer(ANY, [places.hub], gossip=True)


def _flat_always(places: Places, i: int) -> Config:
    return _flat(places, i) | {"scouting": _peer("", [], gossip=True, to_peer="always")["scouting"]}


def _multihop(places: Places, i: int) -> Config:
    scouting = _peer("", [], gossip=True, scouting={"multihop": True})["scouting"]
    return _flat(places, i) | {"scouting": scouting}


def _hub_of_clients(places: Places, i: int) -> Config:
    return _peer(places.hub, [], mode="router") if i == HUB else _peer("", [places.hub], mode="client")


def _peer_of_clients(places: Places, i: int) -> Config:
    return _peer(places.hub, []) if i == HUB else _peer("", [places.hub], mode="client")


def _hub_of_peers(places: Places, i: int) -> Config:
    return _peer(places.hub, [], mode="router") if i == HUB else _peer(ANY, [places.hub])


def _lists(places: Places, i: int) -> Config:
    if i == HUB:
        return _peer(places.hub, [])
    return _peer(places.own[i], [places.hub, *(places.own[j] for j in places.near[i] if j < i)])


def _regions(places: Places, i: int) -> Config:
    """One region a process, a mesh by gossip; the first session of each is its gateway to the others."""
    return _gated(places, i, lambda gate, name: _peer(ANY, [gate], gossip=True, region_name=name))


def _regions_of_clients(places: Places, i: int) -> Config:
    return _gated(places, i, lambda gate, name: _peer("", [gate], mode="client", region_name=name))


def _gated(places: Places, i: int, member: Callable[[str, str], Config]) -> Config:
    if i == HUB:
        return _peer(places.hub, [], gossip=True)
    process = places.process(i)
    name = f"mg{process}"
    if i == 0 or places.process(i - 1) != process:
        south = [{"filters": [{"region_names": [name]}]}]
        others = [gate for gate in places.gates[:process]]
        return _peer(places.gates[process], [places.hub, *others], gossip=True, gateway={"south": south})
    return member(places.gates[process], name)


WAYS: Mapping[str, tuple[str, Way]] = {
    "flat": ("peers, gossip from a rendezvous, greater-zid: ours for nine", _flat),
    "always": ("the same, both connect: Zenoh's default", _flat_always),
    "multihop": ("as flat, gossip.multihop", _multihop),
    "regions": ("a region a process: meshed inside by gossip, one gateway each", _regions),
    "region-clients": ("a region a process: clients of its gateway", _regions_of_clients),
    "hub": ("clients of one router in the wheel", _hub_of_clients),
    "peer-hub": ("clients of one peer", _peer_of_clients),
    "hub-peers": ("peers of one router, no gossip", _hub_of_peers),
    "lists": ("peers that connect to their neighbours and a rendezvous by lists, no gossip", _lists),
}
"""Ways to meet, by name."""


# ---------------------------------------------------------------- a process of sessions


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


# ---------------------------------------------------------------- the run


class Run:
    """All processes of one way."""

    def __init__(self, way: Way, places: Places) -> None:
        self._way, self._places = way, places
        command = [sys.executable, "-m", "bench.discovery", "worker"]
        self._hosts = [
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            for _ in range(places.processes + 1)
        ]
        self.lives = dict.fromkeys(range(places.count), 1)
        for k in range(len(self._hosts)):
            self._ask(k, [["state"]])

    def _ask(self, k: int, questions: list[list[Any]]) -> list[Any]:
        host = self._hosts[k]
        assert host.stdin is not None
        assert host.stdout is not None
        answers = []
        for question in questions:
            host.stdin.write(json.dumps(question) + "\n")
            host.stdin.flush()
            line = host.stdout.readline()
            if not line:  # it was ended, as it did not answer in time
                raise SystemExit
            answers.append(json.loads(line))
        return answers

    def _ask_all(self, questions: dict[int, list[list[Any]]], deadline: float) -> dict[int, list[Any]]:
        """Ask processes at once; those that do not answer in time are left out."""
        answers: dict[int, list[Any]] = {}
        threads = [
            threading.Thread(target=lambda k=k: answers.update({k: self._ask(k, questions[k])}), daemon=True)
            for k in questions
        ]
        until = monotonic() + deadline
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(max(0.0, until - monotonic()))
        return dict(answers)

    def change(self, what: str, numbers: list[int], deadline: float) -> bool:
        """Open or close sessions; return whether that was done in time."""
        questions: dict[int, list[list[Any]]] = {}
        for i in numbers:
            k = self._places.processes if i == HUB else self._places.process(i)
            near = [] if i == HUB else self._places.near[i]
            more = [self.lives.get(i, 1), self._way(self._places, i), near] if what == "open" else []
            questions.setdefault(k, []).append([what, str(i), *more])
        answers = self._ask_all(questions, deadline)
        return len(answers) == len(questions) and all(all(done) for done in answers.values())

    def until_all_hear(self, since: float, deadline: float) -> tuple[float | None, list[int], int]:
        """Return the time (s) until all heard their neighbours, the links of each, and how many are still deaf."""
        until = monotonic() + deadline
        links: list[int] = []
        deaf = self._places.count
        while monotonic() < until:
            states = self._ask_all({k: [["state"]] for k in range(self._places.processes)}, until - monotonic())
            if len(states) < self._places.processes:
                break
            deaf, links = 0, []
            for (state,) in states.values():
                links += state["links"].values()
                for i, seen in state["seen"].items():
                    known = {(kind, j): life for kind, j, life in seen}
                    near = self._places.near[int(i)]
                    wanted = [(kind, j) for j in near for kind in ("alive", "state")]
                    deaf += any(known.get(one, 0) < self.lives[one[1]] for one in wanted)
            if not deaf and sum(len(state["seen"]) for (state,) in states.values()) == self._places.count:
                return max(state["last"] for (state,) in states.values()) - since, links, 0
            sleep(0.05)
        return None, links, deaf

    def end(self) -> float:
        """End all processes; return their CPU time (s)."""
        spent = 0.0
        for host in self._hosts:
            fields = Path(f"/proc/{host.pid}/stat").read_text().rpartition(")")[2].split()
            spent += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
            host.kill()
            host.wait()
        return spent


def measure(name: str, places: Places, waves: int, deadline: float) -> str:
    """Measure one way; return its row."""
    text, way = WAYS[name]
    run = Run(way, places)
    try:
        run.change("open", [HUB], deadline)
        since = monotonic()
        run.change("open", list(range(places.count)), deadline)
        took, links, deaf = run.until_all_hear(since, deadline)
        if took is None:
            return f"{name:15} not within {deadline:g} s: {deaf} of {places.count} do not hear all neighbours   {text}"
        rng, times, hung = random.Random(1), [], 0
        gates = [i for i in range(places.count) if i == 0 or places.process(i - 1) != places.process(i)]
        for _ in range(waves):
            left = rng.sample([i for i in range(places.count) if i not in gates], LEFT)
            since = monotonic()
            ok = run.change("close", left, deadline)
            for i in left:
                run.lives[i] += 1
            ok = ok and run.change("open", left, deadline)
            again, _, _ = run.until_all_hear(since, deadline) if ok else (None, [], 0)
            if again is None:
                hung += 1
                break  # what hangs once hangs
            times.append(again)
        churn = f"{median(times):.2f} (most {max(times):.2f})" if times else "-"
        spent = run.end()
        row = f"{name:15}{took:9.2f}{median(links):8g} (most {max(links)}){churn:>22}{len(times):4}{hung:6}{spent:9.1f}"
        return f"{row}   {text}"
    finally:
        with suppress(OSError):
            run.end()


def main() -> None:
    """Measure and print."""
    if sys.argv[1:] == ["worker"]:
        worker()
        return
    given = options(__doc__, ways=",".join(WAYS), sessions=100, processes=4, neighbours=4, waves=30, deadline=20)
    print(machine())
    print(f"{given.sessions} sessions in {given.processes} processes, {given.neighbours} neighbours each\n")
    print(f"{'way':15}{'meet (s)':>9}{'links':>8}{'':11}{'churn: wave (s)':>22}{'ok':>4}{'hung':>6}{'CPU (s)':>9}")
    for name in given.ways.split(","):
        print(
            measure(name, Places(given.sessions, given.processes, given.neighbours), given.waves, given.deadline),
            flush=True,
        )


if __name__ == "__main__":
    main()
