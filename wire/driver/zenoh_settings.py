"""Zenoh's settings for a session of a run, in lock-step and in real time. Pure.

`docs/protocol.md` has the measured reason of each setting.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

RUNTIME = "(rx: (worker_threads: 1), acc: (handover: app), net: (handover: app), tx: (handover: app))"
"""Few threads: one that receives, and one pool for the rest. Receiving in that pool too is a tenth faster, but then a
flood of messages can stall it."""

ONE_THREAD = "(rx: (handover: app), acc: (handover: app), net: (handover: app), tx: (handover: app))"
"""All in one pool of one thread, for the client of a relay. It passes nothing on, so receiving never waits for sending;
a message then wakes one thread of Zenoh instead of two."""


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
    # The lease is a day because it must not decide: the death of a process closes its links at once, the deadlines of
    # the lock-step detect a frozen one, and a whole run may be frozen for hours.
    "simulated": Profile(86_400_000, (20, 50, 1.5), 10_000, 5_000_000, may_drop=False),
    # After a cut Zenoh must renew the link soon; control does not wait for it. A plant that waits for a full link holds
    # up the control of all others, and Zenoh renews a closed link when its other end reads again.
    "wall": Profile(2_000, (100, 500, 2.0), 1_000, 200_000, may_drop=True),
}

MOST_BYTES = 8_000_000
"""Longest message that Zenoh puts together, in bytes; its default is 1 GiB for each link. After a longer one it passes
nothing more of that sender on that link."""


def zenoh_settings(
    listen: tuple[str, ...], connect: tuple[str, ...], *, gossip: bool, clock: Clock, meets_all: bool
) -> dict[str, Any]:
    """Return Zenoh's configuration of a peer; parameters are those of `gridpeers.wire.driver.session.Session`."""
    profile = PROFILES[clock]
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
