"""Checks of a run with disturbances: what control promises once the last of them has ended (docs/chaos.md)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from gridpeers.scenarios.checks.check_registry import ALWAYS, RETURNS, check_name
from gridpeers.wire.plugins.plugin import table_of

WITHIN_S = 4.0
"""Time (s) after the last change within which a run is to be restored. Set-points come back from their bounds at the
rate of the law, and vars, the slowest, settle within 3 s after a large step."""

JUDGED_S = 0.8

REJOINED_S = 1.0
"""Longest time (s) after a cut until a value from over there is used: in simulated time nothing has to connect again,
and no delay is longer."""

LATEST_S = 0.5
"""Time (s) after the last change from which on no decision uses a stale value: as long as the longest delay."""

_AFTER: Mapping[str, Mapping[str, Any]] = {
    "frequency": {"within_s": WITHIN_S},
    "voltage": {"within_s": WITHIN_S},
    "power_sharing": {"after_s": WITHIN_S, "with_killed": False},
    "var_sharing": {"after_s": WITHIN_S, "with_killed": False},
    "rating": {"with_killed": False},
    "steady": {"after_s": WITHIN_S},
}

RESTORED = frozenset({*_AFTER, "oscillation", RETURNS})
"""Checks of what control restores; the others hold whatever is done to a run."""

TAIL_S = 2.0

_ALWAYS: Mapping[str, Mapping[str, Any]] = {"heal": {"within_s": REJOINED_S}, "oscillation": {"tail_s": TAIL_S}}


def chaos_checks(
    own: Iterable[str | Mapping[str, Any]], changed_s: float, since_s: float
) -> list[str | dict[str, Any]]:
    """Return the checks of a run with disturbances, as entries of its scenario, from its own entries.

    The scenario's own keys of a check stay: its limits, but for those above, and that it is off. The run is to be
    restored from the last change (s of run time) on, or from later if inverters trip.
    """
    entries = {check_name(entry): entry if isinstance(entry, str) else dict(entry) for entry in own}
    limits_of: dict[str, Mapping[str, Any]] = {
        **{name: {**limits, "since_s": round(since_s, 9)} for name, limits in _AFTER.items()},
        "stale_values": {"since_s": round(changed_s + LATEST_S, 9)},
        **_ALWAYS,
    }
    for name in ALWAYS:
        given = table_of(entries.get(name, name))
        if name in limits_of and not given.get("off"):
            entries[name] = {**given, **limits_of[name]}
    entries.setdefault(RETURNS, RETURNS)
    return list(entries.values())
