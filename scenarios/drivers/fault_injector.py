"""What a scenario lets befall processes in wall-clock time: killed and paused for real, at their run time."""

from __future__ import annotations

import math
import signal
from collections.abc import Iterable
from time import monotonic
from typing import NamedTuple

from netem.spec.node_fault import NodeFault
from scenarios.drivers.children import Children
from scenarios.emulation.emulation_config import Setup


class _Blow(NamedTuple):
    """One signal to one process."""

    t: float
    """When (s of run time)."""
    name: str
    number: signal.Signals


def blows(nodes: Iterable[NodeFault]) -> list[_Blow]:
    """Signals that do to processes what entries `[[node]]` say, in the order of time; the rest is emulated.

    Examples
    --------
    >>> [(b.t, b.number.name) for b in blows([NodeFault(name="inv3", pause=True, from_s=1.0, to_s=2.5)])]
    [(1.0, 'SIGSTOP'), (2.5, 'SIGCONT')]
    """
    found = []
    for node in nodes:
        if node.kill:
            found.append(_Blow(node.from_s, node.name, signal.SIGKILL))
        if node.pause:
            found.append(_Blow(node.from_s, node.name, signal.SIGSTOP))
            found.append(_Blow(math.inf if node.to_s is None else node.to_s, node.name, signal.SIGCONT))
    return sorted(found)


class FaultInjector:
    """Does to the children of a run what its scenario says; the run's time is known from telemetry.

    Parameters
    ----------
    links : str
        What the configurations say of links and nodes.
    speed : float
        Run time per wall time (s/s).
    """

    def __init__(self, links: str, speed: float) -> None:
        setup = Setup.of_text(links) if links else None
        real = setup is not None and setup.real_nodes
        self._due = blows(setup.netem.nodes) if setup is not None and real else []
        self._speed = speed
        self._offset: float | None = None
        """Run time minus that of the wall times the speed (s), as far as is known."""
        self.killed: set[str] = set()
        """Who has died by this."""
        self._paused: set[str] = set()

    def heard(self, t: float, at: float) -> None:
        """Note that the run had come to t (s) at a time of `monotonic` (s).

        The last word counts: a plant that falls behind puts its time off.
        """
        self._offset = t - at * self._speed

    @property
    def wait(self) -> float:
        """Time (s) until the next one; infinite if there is none, or the run has not begun."""
        if not self._due or self._offset is None:
            return math.inf
        return max(0.0, (self._due[0].t - self._offset) / self._speed - monotonic())

    def strike(self, children: Children) -> None:
        """Do what is due."""
        while self._due and self.wait == 0.0:
            blow = self._due.pop(0)
            try:
                child = children[blow.name]
            except KeyError:  # it has not joined yet, so there is nobody to be hurt
                continue
            child.signal(blow.number)
            if blow.number is signal.SIGKILL:
                self.killed.add(blow.name)
            (self._paused.add if blow.number is signal.SIGSTOP else self._paused.discard)(blow.name)

    def end(self, children: Children) -> None:
        """Let go on who is paused, so that it can leave; nothing happens any more."""
        self._due.clear()
        for name in self._paused:
            children[name].signal(signal.SIGCONT)
        self._paused.clear()
