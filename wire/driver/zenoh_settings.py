"""Zenoh's settings for a session of a run, in lock-step and in wall-clock time. Pure.

`docs/protocol.md` has the measured reason of each setting.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

from gridpeers.wire.trust.credentials import Credentials

RUNTIME = "(rx: (worker_threads: 1), acc: (handover: app), net: (handover: app), tx: (handover: app))"
"""Few threads: one that receives, and one pool for the rest. Receiving in that pool too is a tenth faster, but then a
flood of messages can stall it."""

ONE_THREAD = "(rx: (handover: app), acc: (handover: app), net: (handover: app), tx: (handover: app))"
"""All in one pool of one thread, for the client of a relay. It passes nothing on, so receiving never waits for sending;
a message then wakes one thread of Zenoh instead of two."""

_POOLS = "app|acc|tx|rx|net"
_SETTING = rf"(?:(?:worker_threads|max_blocking_threads)\s*:\s*[1-9][0-9]{{0,2}}|handover\s*:\s*(?:{_POOLS}))\s*"
_POOL = rf"(?:{_POOLS})\s*:\s*\(\s*(?:{_SETTING}(?:,\s*{_SETTING})*,?\s*)?\)\s*"
_RUNTIME_FORM = re.compile(rf"\s*\(\s*(?:{_POOL}(?:,\s*{_POOL})*,?\s*)?\)\s*")

LEASE = 86_400_000
"""Time (ms) after which a silent link counts as dead, in lock-step. It is a day because it must not decide: the death
of a process closes its links at once, the deadlines of the lock-step detect a frozen one, and a whole run may be frozen
for hours."""

WALL_LEASE = 2_000
"""The same in wall-clock time: after a cut Zenoh must renew the link soon. Control does not wait for it."""

WAIT_BEFORE_CLOSE = 5_000_000
"""How long (us) a message that may not be dropped waits for a full link, in lock-step: Zenoh's default."""

WALL_WAIT_BEFORE_CLOSE = 200_000
"""The same in wall-clock time, where a waiting plant holds up the control of all others. Zenoh renews a closed link
when its other end reads again."""


class Profile(NamedTuple):
    """Settings that differ between the two kinds of time."""

    lease: int
    """Silence (ms) after which a link counts as dead."""
    retry: tuple[int, int, float]
    """Time between attempts to connect: first (ms), longest (ms), growth."""
    timeout: int
    """Longest time for a link to open (ms)."""
    wait_before_close: int
    """How long (us) a message that may not be dropped waits for a link that is full; then the link is closed."""
    may_drop: bool
    """Whether messages of which only the newest matters are dropped when a link is full."""


Clock = Literal["simulated", "wall"]

PROFILES: dict[Clock, Profile] = {
    "simulated": Profile(LEASE, (20, 50, 1.5), 10_000, WAIT_BEFORE_CLOSE, may_drop=False),
    "wall": Profile(WALL_LEASE, (100, 500, 2.0), 1_000, WALL_WAIT_BEFORE_CLOSE, may_drop=True),
}

MOST_BYTES = 8_000_000
"""Longest message that Zenoh puts together, in bytes; its default is 1 GiB for each link. Ours have
`gridpeers.wire.bounds.LONGEST_MESSAGE` at most, a configuration or a feeder's diagram more. After a longer one it
passes nothing more of that sender on that link."""


def zenoh_settings(
    listen: tuple[str, ...],
    connect: tuple[str, ...],
    *,
    gossip: bool,
    clock: Clock,
    rendezvous: bool,
    meets_all: bool,
    star: bool,
    credentials: Credentials | None,
) -> dict[str, Any]:
    """Return Zenoh's configuration of a session; parameters are those of `gridpeers.wire.driver.session.Session`."""
    in_star = star and not rendezvous
    config = _peer(() if in_star else listen, connect, gossip and not in_star, meets_all, PROFILES[clock])
    if star and rendezvous:
        config["mode"] = "router"
        config["scouting"]["delay"] = 0  # else it waits 0.5 s for others
    if credentials is not None:
        link, rules = credentials.zenoh_settings(star=star)
        config["transport"]["link"] |= link
        config["access_control"] = rules
    return config


def runtime_objection(text: str) -> str:
    """Return what is wrong with a value of the environment variable ZENOH_RUNTIME; empty if Zenoh can use it.

    Zenoh itself aborts a thread over a wrong one, at the first link or later.

    Examples
    --------
    >>> runtime_objection(RUNTIME), runtime_objection("(rx: (worker_threads: 2))")
    ('', '')
    >>> runtime_objection("(rx: (threads: 2))")[:62]
    'the environment variable ZENOH_RUNTIME is "(rx: (threads: 2))"'
    """
    bodies = [text, *re.findall(r"\(([^()]*)\)", text)]
    if _RUNTIME_FORM.fullmatch(text) and not any(map(_repeats, bodies)):
        return ""
    return (
        f'the environment variable ZENOH_RUNTIME is "{text:.200}", which Zenoh cannot use; unset it, or write e.g. '
        f"{RUNTIME}: pools app, acc, tx, rx and net, each at most once, with any of worker_threads and "
        "max_blocking_threads (1 to 999) and handover (the pool that does its work)"
    )


def _repeats(body: str) -> bool:
    """Return whether a key stands twice in a list of Zenoh's runtime."""
    keys: Sequence[str] = re.findall(r"(\w+)\s*:\s*" + (r"\(" if "(" in body else ""), body)
    return len(set(keys)) < len(keys)


def as_client(config: dict[str, Any]) -> dict[str, Any]:
    """Return the configuration of the same session as the client of the router that it has met."""
    return config | {"mode": "client", "listen": {"endpoints": []}}


def _peer(
    listen: tuple[str, ...], connect: tuple[str, ...], gossip: bool, meets_all: bool, profile: Profile
) -> dict[str, Any]:
    first, longest, growth = profile.retry
    return {
        "mode": "peer",
        "listen": {"endpoints": list(listen)},
        "open": {"return_conditions": {"connect_scouted": False, "declares": False}},
        "connect": {
            "endpoints": list(connect),
            "timeout_ms": -1,
            "exit_on_failure": False,
            "retry": {"period_init_ms": first, "period_max_ms": longest, "period_increase_factor": growth},
        },
        "scouting": {
            "multicast": {"enabled": False},
            # Of two peers that learn of each other the one with the greater id connects: no double links. A peer that
            # does not listen connects to all by itself.
            "gossip": {
                "enabled": gossip,
                "autoconnect_strategy": {
                    "peer": {"to_router": "always", "to_peer": "always" if meets_all else "greater-zid"}
                },
            },
        },
        "transport": {
            # No lowlatency, although it saves a fifth of a tick: while links open, a declaration could wait
            # for a link to become writable and hold the lock that all Zenoh threads wait for (4 starts in 100 hung).
            # Without QoS everything on a link keeps its order; discovery relies on that.
            "unicast": {
                "lowlatency": False,
                "qos": {"enabled": False},
                "open_timeout": profile.timeout,
                "accept_timeout": profile.timeout,
            },
            "link": {
                "tx": {
                    "lease": profile.lease,
                    "keep_alive": 4,
                    "queue": {"congestion_control": {"block": {"wait_before_close": profile.wait_before_close}}},
                },
                "rx": {"max_message_size": MOST_BYTES},
            },
            # Else Zenoh makes pools at the first message of more than 3 kB: 65 ms in which the plant misses its steps.
            "shared_memory": {"enabled": False},
        },
    }
