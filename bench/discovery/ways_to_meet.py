"""Ways to meet: the settings of each session of a run, by the places of all."""

from __future__ import annotations

import socket
from collections.abc import Callable, Mapping
from typing import Any

from wire.driver.zenoh_settings import LEASE

HUB = -1
"""Number of the session that all can reach: the plant's place."""

ANY = "tcp/127.0.0.1:0"
"""Any free port."""

Config = dict[str, Any]


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


Way = Callable[[Places, int], Config]
"""Settings of a session by its number."""


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
