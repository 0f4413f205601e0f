"""The faults of links under changes: without loss, and those of two configurations one after the other. Pure."""

from __future__ import annotations

from typing import TypeVar

from msgspec.structs import replace

from gridpeers.netem.schema.fault import KINDS, Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.partition import Partition

Entry = TypeVar("Entry", Fault, Partition)


def lossless(fault: Fault) -> Fault | None:
    """Return a fault without its loss; None if nothing is left of it.

    Examples
    --------
    >>> lossless(Fault(on="* -> inv1", loss=0.2)) is None, lossless(Fault(on="* -> inv1", loss=0.2, delay=0.1)).delay
    (True, Constant(fifo=False, delay_s=0.1))
    """
    models = fault.models()
    if "loss" not in models:
        return fault
    left = {kind: model for kind, model in models.items() if kind in KINDS and kind != "loss"}
    if not (left or fault.own):
        return None
    return Fault(on=fault.on, from_s=fault.from_s, to_s=fault.to_s, own=fault.own, **left)


def without_loss(netem: Netem) -> Netem:
    """Return faults without the loss of each; those that were loss alone are gone."""
    links = (lossless(fault) for fault in netem.links)
    return replace(netem, links=tuple(fault for fault in links if fault is not None))


def spliced(before: Netem, after: Netem, since: float) -> Netem:
    """Return faults that are those of one configuration up to a time (s), and those of another one from then on."""
    if before == after or since <= 0.0:
        return after
    return replace(
        before,
        links=_spliced(before.links, after.links, since),
        partitions=_spliced(before.partitions, after.partitions, since),
    )


def _spliced(before: tuple[Entry, ...], after: tuple[Entry, ...], since: float) -> tuple[Entry, ...]:
    """Return entries of both, those that both have once and whole."""
    found = [entry for entry in before if entry in after]
    for entry in before:
        if entry not in after and entry.from_s < since:
            until = since if entry.to_s is None else min(entry.to_s, since)
            found.append(replace(entry, to_s=until))
    for entry in after:
        if entry not in before and (entry.to_s is None or entry.to_s > since):
            found.append(replace(entry, from_s=max(entry.from_s, since)))
    return tuple(found)
