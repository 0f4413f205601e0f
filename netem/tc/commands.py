"""The commands that set faults on a network device, and those that take them off again."""

from __future__ import annotations

from typing import NamedTuple

from netem.relay.faults import Faults

PACKETS = 10_000
"""Limit of netem's queue (packets): it holds those that are delayed too, so 1000, its default, would lose some at
100 ms and more than 10 000 packets/s. `Faults.queue` (bytes) has no counterpart in it."""

BURST = 2_000
"""Bytes that the token bucket lets through at once: one packet of Ethernet."""

_RANDOM = 0xFFFFF000 + 56
"""Where classic BPF finds a random number of 32 bits: SKF_AD_OFF + SKF_AD_RANDOM of linux/filter.h."""

_SHOT, _OK = 2, 0
"""Verdicts on a packet: TC_ACT_SHOT drops it, TC_ACT_OK lets it pass (linux/pkt_cls.h)."""


class TcError(ValueError):
    """The kernel cannot, or may not, do it; the message says why and what to do instead."""


class Step(NamedTuple):
    """A command, and the one that undoes it, if no other does."""

    do: tuple[str, ...]
    undo: tuple[str, ...] = ()


def netem_steps(device: str, faults: Faults) -> tuple[Step, ...]:
    """Commands for a kernel with netem: for what leaves the device.

    Parameters
    ----------
    device : str
        E.g. "eth0". On "lo" both directions of everything on this host are meant.
    faults : Faults
        What to do to it; without a fault no command.

    Examples
    --------
    >>> " ".join(netem_steps("eth0", Faults(delay=0.1, jitter=0.02, loss=0.02))[0].do)
    'tc qdisc add dev eth0 root netem limit 10000 delay 100000us 20000us loss random 2%'
    """
    words: list[str] = []
    if faults.delay:
        words += ["delay", f"{faults.delay * 1e6:.0f}us"]
        if faults.jitter:
            words.append(f"{faults.jitter * 1e6:.0f}us")
    if faults.loss:
        words += ["loss", "random", _percent(faults.loss)]
    if faults.reorder:
        words += ["reorder", _percent(faults.reorder)]
    if faults.rate:
        words += ["rate", _rate(faults.rate)]
    if not words:
        return ()
    root = ("dev", device, "root")
    add = ("tc", "qdisc", "add", *root, "netem", "limit", str(PACKETS), *words)
    return (Step(add, ("tc", "qdisc", "delete", *root)),)


def steps_without_netem(device: str, faults: Faults) -> tuple[Step, ...]:
    """Commands for a kernel without netem: loss of what arrives at the device, rate of what leaves it.

    Lost is what arrives, not what leaves: of a packet dropped on its way out the own TCP is told, and does not take it
    for sent. So it belongs at the receiving end.

    Raises
    ------
    TcError
        If delay, jitter or reordering is asked for.

    Examples
    --------
    >>> for step in steps_without_netem("eth0", Faults(loss=0.02)):
    ...     print(" ".join(step.do))
    tc qdisc add dev eth0 clsact
    tc filter add dev eth0 ingress bpf direct-action bytecode 4,32 0 0 4294963256,53 1 0 85899346,6 0 0 2,6 0 0 0
    """
    if faults.delay or faults.reorder:
        raise TcError(
            f"{device}: without netem tc can lose packets and limit the rate, not delay them ({faults}); "
            "for a delay use python -m netem.relay between two endpoints, or faults on messages in the scenario"
        )
    steps: list[Step] = []
    if faults.loss:
        # load a random number; at least the threshold: skip one; drop; pass
        threshold = min(round(faults.loss * 2**32), 2**32 - 1)
        program = (f"32 0 0 {_RANDOM}", f"53 1 0 {threshold}", f"6 0 0 {_SHOT}", f"6 0 0 {_OK}")
        bytecode = ",".join((str(len(program)), *program))
        clsact, dropping = ("dev", device, "clsact"), ("dev", device, "ingress", "bpf", "direct-action", "bytecode")
        steps.append(Step(("tc", "qdisc", "add", *clsact), ("tc", "qdisc", "delete", *clsact)))
        steps.append(Step(("tc", "filter", "add", *dropping, bytecode)))
    if faults.rate:
        bucket = ("rate", _rate(faults.rate), "burst", str(BURST), "limit", f"{faults.queue:.0f}")
        root = ("dev", device, "root")
        steps.append(Step(("tc", "qdisc", "add", *root, "tbf", *bucket), ("tc", "qdisc", "delete", *root)))
    return tuple(steps)


def _percent(p: float) -> str:
    return f"{100.0 * p:.6g}%"


def _rate(rate: float) -> str:
    return f"{rate:.0f}bps"  # tc's "bps" are bytes per second
