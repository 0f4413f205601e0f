"""Zenoh's settings for a session of a run, in simulated time and in real time, each with its reason. Pure."""

from __future__ import annotations

from typing import Any, Literal

RUNTIME = "(rx: (worker_threads: 1), acc: (handover: app), net: (handover: app), tx: (handover: app))"
"""Few threads: one that receives, and one pool for the rest. Receiving in that pool too is a tenth faster, but then a
flood of messages can stall it."""

ONE_THREAD = "(rx: (handover: app), acc: (handover: app), net: (handover: app), tx: (handover: app))"
"""All in one pool of one thread, for the client of a relay. It passes nothing on, so receiving never waits for sending;
a message then wakes one thread of Zenoh instead of two."""


Clock = Literal["simulated", "realtime"]

MOST_BYTES = 8_000_000
"""Longest message that Zenoh puts together, in bytes; its default is 1 GiB for each link. After a longer one it passes
nothing more of that sender on that link."""


def zenoh_settings(
    listen: tuple[str, ...], connect: tuple[str, ...], *, gossip: bool, clock: Clock, meets_all: bool
) -> dict[str, Any]:
    """Return Zenoh's configuration of a peer; parameters are those of `gridpeers.wire.driver.session.Session`."""
    realtime = clock == "realtime"
    first, longest, growth = (100, 500, 2.0) if realtime else (20, 50, 1.5)
    open_within = 1_000 if realtime else 10_000
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
                "open_timeout": open_within,
                "accept_timeout": open_within,
            },
            "link": {
                "tx": {
                    # In simulated time a day, because it must not decide: the death of a process closes its links at
                    # once, the deadlines of the lock-step detect a frozen one, and a whole run may be frozen for hours.
                    "lease": 2_000 if realtime else 86_400_000,
                    "keep_alive": 4,
                    # A message that may not be dropped waits so long (us) for a full link; then the link is closed. A
                    # plant that waits holds up the control of all others in real time.
                    "queue": {
                        "congestion_control": {"block": {"wait_before_close": 200_000 if realtime else 5_000_000}}
                    },
                },
                "rx": {"max_message_size": MOST_BYTES},
            },
            # Else Zenoh makes pools at the first message of more than 3 kB: 65 ms in which the plant misses its steps.
            "shared_memory": {"enabled": False},
        },
    }
