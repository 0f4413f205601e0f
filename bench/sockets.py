"""2 % loss on the wire is delay on TCP and loss on UDP. A figure for docs/netem.md, and its numbers.

Two Zenoh sessions over TCP and two over UDP, a message of 100 bytes each per control period, at the same times: on a
loopback that loses nothing, on one where the kernel loses 2 % of the packets (in a network namespace, by `tc`), and
through `netem.relay`, whose TCP is a model.

    .venv/bin/python -m bench.sockets [--figure docs/images/sockets.png]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from bench.harness import machine
from bench.ping import TICK
from netem.relay import Relay
from tests.processes.relay.relay_pair import LOST, Pair, free_endpoint, measure

P = 0.02
"""Probability that a packet is lost."""

STYLES = {
    "no loss": ("#7a7a7a", "-"),
    "2 % lost by the kernel": ("#0072b2", "-"),
    "2 % lost by the relay": ("#d55e00", "--"),
}
"""Colour and dash pattern (Okabe and Ito's palette)."""

BEYOND = 1e3
"""Time (s) far to the right of the figure, for what never comes."""

TITLES = ("TCP: all come, some late", "UDP: what is lost never comes")

MessageTimes = list[float]


def lose(loss: float) -> None:
    """Have the kernel drop a share of the packets that arrive at this namespace's loopback, by a BPF filter.

    A filter, as not every kernel has the queueing discipline netem; on arrival, as TCP learns of a packet that is
    dropped on its way out. The program loads a random number of 32 bits, and drops the packet if it is below a bound.
    """
    program = f"4,32 0 0 4294963256,53 1 0 {round(loss * 2**32)},6 0 0 2,6 0 0 0"
    subprocess.run(["tc", "qdisc", "add", "dev", "lo", "clsact"], check=True)
    drop = ["bpf", "direct-action", "bytecode", program]
    subprocess.run(["tc", "filter", "add", "dev", "lo", "ingress", *drop], check=True)


def on_lossy_loopback(loss: float, count: int) -> list[MessageTimes]:
    """Return the times (s) over TCP and over UDP on this namespace's loopback, which loses packets meanwhile."""
    with Pair(free_endpoint("tcp")) as stream, Pair(free_endpoint("udp")) as datagrams:
        for pair in (stream, datagrams):
            pair.greet()
        lose(loss)
        heal = ["tc", "qdisc", "delete", "dev", "lo", "clsact"]
        return measure([stream, datagrams], count, TICK, lambda: subprocess.run(heal, check=True))


def by_kernel(loss: float, count: int) -> list[MessageTimes]:
    """Return the times (s) as `on_lossy_loopback` measures them, in a network namespace of their own; needs root."""
    name = f"gpsockets{os.getpid()}"
    subprocess.run(["ip", "netns", "add", name], check=True)
    try:
        subprocess.run(["ip", "-n", name, "link", "set", "lo", "up"], check=True)
        probe = [sys.executable, __file__, "--inside", str(loss), "--messages", str(count)]
        done = subprocess.run(["ip", "netns", "exec", name, *probe], check=True, stdout=subprocess.PIPE)
    finally:
        subprocess.run(["ip", "netns", "delete", name], check=True)
    return [[LOST if time is None else time for time in times] for times in json.loads(done.stdout)]


def by_relay(loss: float, count: int, seed: int) -> list[MessageTimes]:
    """Return the times (s) over TCP and over UDP through relays that lose."""
    tcp, udp = free_endpoint("tcp"), free_endpoint("udp")
    with (
        Relay("tcp/127.0.0.1:0", tcp, seed=seed) as first,
        Relay("udp/127.0.0.1:0", udp, seed=seed) as second,
        Pair(tcp, first.endpoint) as stream,
        Pair(udp, second.endpoint) as datagrams,
    ):
        for pair, relay in ((stream, first), (datagrams, second)):
            pair.greet()
            relay.do(f"loss {loss}")
        return measure([stream, datagrams], count, TICK, lambda: [relay.do("loss 0") for relay in (first, second)])


def describe(label: str, times: MessageTimes) -> str:
    """Return one line of numbers; the times are those of the messages that came."""
    came = np.array([time for time in times if time < LOST]) * 1e3
    p50, p90, p99 = np.percentile(came, [50, 90, 99])
    lost = len(times) - len(came)
    return (
        f"{label:30} {lost:5} of {len(times)} lost ({100 * lost / len(times):.1f} %)   "
        f"p50 {p50:6.2f}   p90 {p90:6.2f}   p99 {p99:6.1f}   max {came.max():6.1f} ms"
    )


def draw(results: dict[str, list[MessageTimes]], path: Path) -> None:
    """Draw the share of messages that are not there yet, over the time since they were sent."""
    page: Any = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False}
    with mpl.rc_context(page):
        figure = Figure(figsize=(8.0, 3.4), layout="constrained")
        axes = figure.subplots(1, 2, sharex=True, sharey=True)
        for number, (ax, title) in enumerate(zip(axes, TITLES, strict=True)):
            for label, both in results.items():
                times = np.minimum(np.sort(both[number]), BEYOND)
                missing = 1.0 - np.arange(1, len(times) + 1) / len(times)
                colour, dash = STYLES[label]
                share = np.maximum(100.0 * missing, 1e-9)  # none missing is below the edge of a logarithmic axis
                ax.step(1e3 * times, share, where="post", label=label, color=colour, linestyle=dash, linewidth=1.8)
            ax.axhline(100 * P, color="#cccccc", linewidth=0.8, zorder=0)
            ax.set(xscale="log", yscale="log", xlim=(0.05, 1000), ylim=(0.05, 110), title=title)
            ax.set_xlabel("time since it was sent (ms)")
            ax.grid(True, color="#eeeeee", linewidth=0.6)
        axes[0].set_ylabel("messages not there yet (%)")
        axes[0].set_yticks([0.1, 1, 2, 10, 100], ["0.1", "1", "2", "10", "100"])
        axes[0].set_xticks([0.1, 1, 10, 20, 100, 1000], ["0.1", "1", "10", "20", "100", "1000"])
        axes[1].legend(loc="upper right")
        figure.savefig(path, dpi=110)


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=1500, help="of each pair (default 1500: half a minute)")
    parser.add_argument("--seed", type=int, default=1, help="of the relay (default 1)")
    parser.add_argument("--figure", type=Path, help="where to draw it")
    parser.add_argument("--inside", type=float, metavar="P", help="measure on this namespace's loopback, which loses P")
    options = parser.parse_args()
    if options.inside is not None:
        took = on_lossy_loopback(options.inside, options.messages)
        print(json.dumps([[None if time == LOST else time for time in one] for one in took]))
        return
    results: dict[str, list[MessageTimes]] = {}
    print(machine())
    try:
        results["no loss"] = by_kernel(0.0, options.messages)
        results["2 % lost by the kernel"] = by_kernel(P, options.messages)
    except (FileNotFoundError, subprocess.CalledProcessError) as error:
        print(f"the kernel loses no packets for us, so there is the relay alone: {error}")
        results["no loss"] = by_relay(0.0, options.messages, options.seed)
    results["2 % lost by the relay"] = by_relay(P, options.messages, options.seed)
    for label, both in results.items():
        for transport, times in zip(("TCP", "UDP"), both, strict=True):
            print(describe(f"{transport}, {label}", times))
    if options.figure is not None:
        draw(results, options.figure)


if __name__ == "__main__":
    main()
