"""Keys as the entries of a journal have them, without `gridpeers/<run>/`: kind, name, and who sends on them. Pure."""

from __future__ import annotations

from gridpeers.wire.messages import PLANT

EACH_TICK = ("measurement", "state", "set_points")
"""Kinds of keys with a message a tick."""

IN_TELEMETRY = ("telemetry", "journal", "report")
"""Kinds of keys whose messages the record has anyway: the plant publishes them for recorders."""

CONDITION = ("status", "answer")
"""Kinds of keys by which a node says how it does; a status decides what events the plant tells."""

TO_LINKS = ("link_request", "command")
"""Kinds of keys on which commands to emulated links come, among others."""


def kind_of(key: str) -> str:
    """Return the kind of a key.

    Examples
    --------
    >>> kind_of("set_points/inv1"), kind_of("telemetry")
    ('set_points', 'telemetry')
    """
    return key.partition("/")[0]


def name_of(key: str) -> str:
    """Return the inverter that a key is about; empty if it is about none.

    Examples
    --------
    >>> name_of("set_points/inv1"), name_of("telemetry")
    ('inv1', '')
    """
    return key.partition("/")[2]


def sender_of(key: str) -> str:
    """Return who sends measurements or states on a key.

    Examples
    --------
    >>> sender_of("measurement/inv1"), sender_of("state/inv1")
    ('plant', 'inv1')
    """
    return PLANT if kind_of(key) == "measurement" else name_of(key)


def stream_of(key: str) -> str:
    """Return the stream to which measurements or states on a key belong: all states of an agent are one.

    Examples
    --------
    >>> stream_of("set_points/inv1"), stream_of("state/inv1"), stream_of("measurement/inv1")
    ('state/inv1', 'state/inv1', 'measurement/inv1')
    """
    kind, _, name = key.partition("/")
    return f"{'measurement' if kind == 'measurement' else 'state'}/{name}"
