"""Measure the latencies of a run in real time: until a new agent counts, and until a lost one is noticed.

The run has nine agents and the plant on the paper's feeder, islanded, fully coordinated, at speed 1. One agent is
killed, started, stopped, started, frozen and woken, again and again; another, on a host of its own (a network
namespace), is cut off and healed. Where the lost agent's inverter stays on, nothing would have to be restored: there
the load changes by a third at the same moment (switch 60-160 opens or closes).

    .venv/bin/python -m bench.latency [--repeat 20] [--quick]
"""

from __future__ import annotations

import argparse
import ctypes
import os
import signal
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Literal

from bench.harness import load, machine, say
from bench.ping import TICK, one_way, round_trip
from bench.run_observer import HOLD, RUN, NotInTimeError, RunObserver, describe
from scenarios.drivers.free_endpoint import free_endpoint
from scenarios.results.metrics import F_BAND, MPSI_BAND
from tests.processes.hosts import Hosts, NoHostsError

HURT, CUT = "inv2", "inv5"
"""The agent whose process is hurt, and the one whose link is: both grid-following."""

LOAD_SWITCH = "60-160"
"""Opens on the passive zone, a third of the load."""

BOTH_WAYS = 5.0
"""Longest wait (s) for an agent that all use again to use all; then it is started anew, and counted."""

AFTERMATH = 2.5
"""Time (s) after which a link that was silent is either alive or given up: more than Zenoh's lease."""

CLONE_NEWNET = 0x40000000

LEGEND = f"""
used       an AgentStatus of a neighbour lists it among those in its sums: by the first neighbour, by all eight
noticed    no longer so: by the first neighbour, by all eight
restored   the first time from which, for {HOLD:g} s, all rows of the plant have each GFM within {F_BAND:g} Hz of 60 Hz
           and MPSI < {MPSI_BAND:g}. After a start: of all nine. After a stop: of the other eight, which take its load.
           After kill -9, SIGSTOP, cut: of the other eight; the lost one's inverter stays on primary droop at its
           last set-points and is not judged. What they restore from is the change of load at the same moment
again      SIGCONT, or healing, -> used by the first neighbour, by all eight, and all eight used by it too
deaf       the cut lasts about 1.5 s, until the others are restored; with TCP's back-off a link may then be silent for
           longer than Zenoh's lease of 2 s. Counted once links have settled: a pair of agents that do not use each
           other within {AFTERMATH + BOTH_WAYS:g} s more, then one is restarted; and the observer, which no longer
           hears the status of an agent and opens a new session
one-way    handed to Zenoh -> in the receiving thread of another process, at the rate of ticks ({TICK * 1e3:g} ms)
All times in ms, from the act of the observer to the arrival of its effect at the observer; both share the machine."""


class Budget:
    """The measurements.

    Parameters
    ----------
    observer : RunObserver
        What is measured.
    hosts : Hosts or None
        The hosts; None where there is but one, and nothing can be cut.
    """

    def __init__(self, observer: RunObserver, hosts: Hosts | None) -> None:
        self.observer, self.hosts = observer, hosts
        self.samples: dict[str, list[float]] = defaultdict(list)
        self.tokens: dict[str, int] = defaultdict(int)
        """Number of times that the token was still there when the last neighbour noticed."""
        self.halves: dict[str, int] = defaultdict(int)
        """Number of times that an agent that was back did not hear all others again."""
        self.deaf: dict[str, int] = defaultdict(int)
        """Number of times that the observer's own link was dead afterwards, and it opened a new session."""
        self._open = False

    def once(self) -> None:
        """Everything, one time."""
        kill, stop = signal.SIGKILL, signal.SIGTERM
        self._lose("kill -9", HURT, lambda: self.observer.signal(HURT, kill))
        self._start("start, inverter on droop (killed before)")
        self._lose("proper stop (SIGTERM)", HURT, lambda: self.observer.signal(HURT, stop), off=True)
        self._start("start, inverter off (stopped before)")
        self._lose("hang (SIGSTOP)", HURT, lambda: self.observer.signal(HURT, signal.SIGSTOP))
        self._again("hang (SIGSTOP)", HURT, lambda: self.observer.signal(HURT, signal.SIGCONT))
        if self.hosts is not None:
            self._lose("cut", CUT, self._cut)
            self._again("cut", CUT, self._heal)

    def _start(self, label: str) -> None:
        observer = self.observer
        self._ended(HURT)
        observer.mark(observer.names)
        began = monotonic()
        observer.start(HURT)
        observer.until(lambda: observer.tokens.get(HURT, 0.0) > began, f"the token of {HURT}")
        token = observer.tokens[HURT]
        used = observer.turned(HURT, True)
        restored = observer.restored(observer.names, observer.event("roster", f"{HURT} joined"))
        for part, at in zip(
            ("token seen", "used (first)", "used (all)", "restored"), (token, *used, restored), strict=True
        ):
            self.samples[f"{label}: {part}"].append(at - began)

    def _lose(self, label: str, name: str, hurt: Callable[[], float], *, off: bool = False) -> None:
        observer = self.observer
        observer.at_rest()
        others = [other for other in observer.names if other != name]
        observer.mark(others)
        began = hurt()
        if not off:
            verb: Literal["open", "close"] = "close" if self._open else "open"
            self._open = not self._open
            observer.switch(LOAD_SWITCH, verb)
        noticed = observer.turned(name, False)
        self.tokens[label] += name in observer.tokens
        since = observer.event("inverter", f"{name} disconnected") if off else observer.event("switch", "")
        restored = observer.restored(others, since)
        for part, at in zip(("noticed (first)", "noticed (all)", "restored"), (*noticed, restored), strict=True):
            self.samples[f"{label}: {part}"].append(at - began)

    def _again(self, label: str, name: str, help_it: Callable[[], float]) -> None:
        self.observer.mark(self.observer.names)
        began = help_it()
        first, last = self.observer.turned(name, True)
        self.samples[f"{label}: again (first)"].append(first - began)
        self.samples[f"{label}: again (all)"].append(last - began)
        observer = self.observer
        try:
            observer.all_use(*observer.names, patience=BOTH_WAYS)
            self.samples[f"{label}: again (both ways)"].append(max(at for at, *_ in observer.turns) - began)
        except NotInTimeError:
            say(f"{name} is back, but not both ways")
        healed = observer.t
        observer.until(lambda: observer.t > healed + AFTERMATH, "the lease is over")
        self.deaf[label] += observer.listen_again()
        try:
            observer.all_use(*observer.names, patience=BOTH_WAYS)
            self.halves[label] += 0
        except NotInTimeError as error:
            self.halves[label] += 1
            say(f"{name} is started anew: {error}")
            observer.signal(name, signal.SIGTERM)
            observer.turned(name, False)
            self._ended(name)
            observer.start(name)
            observer.turned(name, True)

    def _ended(self, name: str) -> None:
        self.observer.until(lambda: self.observer.children[name].status is not None, f"{name} ends")

    def _cut(self) -> float:
        assert self.hosts is not None
        began = monotonic()
        self.hosts.cut(2)
        return began

    def _heal(self) -> float:
        assert self.hosts is not None
        began = monotonic()
        self.hosts.heal(2)
        return began

    def print(self) -> None:
        """Print what there is."""
        group = ""
        for label, values in self.samples.items():
            what, _, part = label.partition(": ")
            if what != group:
                group = what
                print(f"\n{what}")
                if what in self.tokens:
                    print(f"  token still there when all had noticed {self.tokens[what]:6}")
                if what in self.halves:
                    print(f"  two agents deaf to each other          {self.halves[what]:6}")
                    print(f"  observer deaf to an agent              {self.deaf[what]:6}")
            print(f"  {part:38}{describe(values)}")


@contextmanager
def two_hosts() -> Iterator[Hosts | None]:
    """Be on the first of two hosts, and everything that is started too; None where namespaces are not allowed."""
    try:
        with Hosts(2) as hosts:
            name = hosts.at(1)[-1]
            with Path(f"/var/run/netns/{name}").open() as namespace:
                if ctypes.CDLL(None, use_errno=True).setns(namespace.fileno(), CLONE_NEWNET) != 0:
                    raise NoHostsError(os.strerror(ctypes.get_errno()))
            yield hosts
    except NoHostsError as error:
        print(f"no cut: network namespaces cannot be made here: {error}")
        yield None


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--repeat", type=int, default=20, help="how often each is done")
    parser.add_argument("--quick", action="store_true", help="three times, and fewer messages: does it work?")
    arguments = parser.parse_args()
    repeat, messages = (3, 100) if arguments.quick else (max(1, arguments.repeat), 500)
    print(machine())
    print(f"load (1, 5, 15 min) before {load()}")
    print(f"islanding, case IV, islanded, speed 1: plant and nine agents, a process each; {repeat} repetitions")
    failed = ""
    with tempfile.TemporaryDirectory() as folder, two_hosts() as hosts:
        address = "127.0.0.1" if hosts is None else hosts.address(1)
        elsewhere = {} if hosts is None else {CUT: (f"tcp/{hosts.address(2)}:0", hosts.at(2))}
        listen = f"tcp/{address}:0"
        observer = RunObserver(Path(folder), free_endpoint(listen), listen, elsewhere)
        say("the run starts")
        with observer:
            size, key = observer.size, observer.keys.state("probe")
            say(f"{messages} messages of {size} bytes while it runs")
            run = one_way(size, messages, key=key, receiver=(listen,), sender=(listen,), connect=(observer.endpoint,))
            budget = Budget(observer, hosts)
            try:
                for i in range(repeat):
                    say(f"repetition {i + 1} of {repeat}")
                    budget.once()
            except NotInTimeError as error:
                failed = f"broke off: {error}"
            pacing = None if observer.telemetry is None else observer.telemetry.pacing
        loaded = load()
        say("the same messages without the run")
        bare = one_way(size, messages, key=key, receiver=(free_endpoint(listen),), sender=(listen,), connect=())
        trips = round_trip(size, 10 * messages, key=f"gridpeers/{RUN}/state/ping", endpoint=free_endpoint(listen))
    print(f"load at the end of the run {loaded}")
    if pacing is not None:
        late = (
            f"{pacing.late} of {pacing.steps} steps late, p99 {1e3 * pacing.p99:.1f} ms, put off {pacing.slipped:.2f} s"
        )
        print(f"the plant's pace: {late}")
    print(f"\n{'(ms)':40}{'n':>6} {'p50':>9} {'p95':>9} {'max':>9}", end="")
    budget.print()
    print(f"\none message of {size} bytes, as a State")
    print(f"  {'one-way at tick rate, run going on':38}{describe(run)}")
    print(f"  {'one-way at tick rate, no run':38}{describe(bare)}")
    print(f"  {'bare Zenoh ping, half a round trip':38}{describe([trip / 2.0 for trip in trips])}")
    print(LEGEND)
    if failed:
        print(failed, file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except NotInTimeError as error:
        sys.exit(str(error))
