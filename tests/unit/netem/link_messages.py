"""Links for the tests: nine inverters in three microgrids, and what becomes of a row of messages."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hypothesis import settings

from gridpeers.netem.channel import Channel, Fate
from gridpeers.netem.receiver import Receiver
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.pattern import Link

MICROGRIDS = {f"inv{i}": f"MG{(i + 2) // 3}" for i in range(1, 10)}
"""The nine inverters of the paper, three to a microgrid."""

steady = settings(derandomize=True, max_examples=50)
"""The same examples every time, and no limit on an example's time, which a busy machine would break."""

T_C = 0.02  # Distance of the messages (s)


def channel(seed: int = 1, src: str = "inv1", dst: str = "inv2", **kinds: Any) -> Channel:
    fault = Fault(on=f"{src} -> {dst}", **kinds)
    return Channel(Link(src, dst), fault.spans(src, dst, MICROGRIDS), seed)


def fates(judge: Channel, numbers: Iterable[int], size: int = 120) -> list[Fate]:
    return [judge.judge(seq, seq * T_C, size) for seq in numbers]


def delays(judge: Channel, n: int) -> list[float]:
    """Delay (s) of the first copy of each of n messages; no message is lost."""
    return [fate.deliveries[0][0] for fate in fates(judge, range(n))]


def receiver(*links: Fault, name: str = "inv2", **entries: Any) -> Receiver:
    return Receiver(name, Netem(links=links, **entries), MICROGRIDS)
