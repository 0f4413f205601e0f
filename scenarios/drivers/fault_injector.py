"""Process faults of a scenario in wall-clock time: agents are killed and paused for real, at their run time."""

from __future__ import annotations

import math
import signal
from collections.abc import Iterable, Mapping
from time import monotonic
from typing import Any, NamedTuple

from gridpeers.netem.schema.netem import NodeFault
from gridpeers.scenarios.drivers.children import Children
from gridpeers.scenarios.emulation.emulation_config import EmulationConfig


class ProcessFault(NamedTuple):
    """One signal to one process."""

    t: float
    """Run time (s)."""
    name: str
    number: signal.Signals


def process_faults(nodes: Iterable[NodeFault]) -> list[ProcessFault]:
    """Return the signals of entries `[[node]]` in the order of time; their other faults are emulated.

    Examples
    --------
    >>> faults = process_faults([NodeFault(name="inv3", pause=True, from_s=1.0, to_s=2.5)])
    >>> [(fault.t, fault.number.name) for fault in faults]
    [(1.0, 'SIGSTOP'), (2.5, 'SIGCONT')]
    """
    faults = []
    for node in nodes:
        if node.kill:
            faults.append(ProcessFault(node.from_s, node.name, signal.SIGKILL))
        if node.pause:
            faults.append(ProcessFault(node.from_s, node.name, signal.SIGSTOP))
            faults.append(ProcessFault(math.inf if node.to_s is None else node.to_s, node.name, signal.SIGCONT))
    return sorted(faults)


class FaultInjector:
    """Inject the process faults of a scenario into the children of a run; telemetry gives the run's time.

    Parameters
    ----------
    links : Mapping[str, Any]
        The tree `links` of the plant's configuration.
    speed : float
        Run time per wall time (s/s).
    """

    def __init__(self, links: Mapping[str, Any], speed: float) -> None:
        setup = EmulationConfig.of_tree(links) if links else None
        self._due = process_faults(setup.netem.nodes) if setup is not None and setup.real_nodes else []
        self._speed = speed
        self._offset: float | None = None
        """Run time minus wall time times the speed (s); None before the run begins."""
        self.killed: set[str] = set()
        """Agents that a fault has killed."""
        self._paused: set[str] = set()

    @property
    def names(self) -> set[str]:
        """Agents that a fault concerns."""
        return {fault.name for fault in self._due}

    def note_time(self, t: float, at: float) -> None:
        """Note that the run had reached t (s) at a time of `monotonic` (s).

        The latest value counts: a plant that falls behind postpones its schedule.
        """
        self._offset = t - at * self._speed

    @property
    def wait(self) -> float:
        """Time (s) until the next fault; infinite if there is none, or the run has not begun."""
        if not self._due or self._offset is None:
            return math.inf
        return max(0.0, (self._due[0].t - self._offset) / self._speed - monotonic())

    def inject(self, children: Children) -> None:
        """Inject the faults that are due."""
        while self._due and self.wait == 0.0:
            fault = self._due.pop(0)
            try:
                child = children[fault.name]
            except KeyError:  # its agent has not joined yet
                continue
            child.signal(fault.number)
            if fault.number is signal.SIGKILL:
                self.killed.add(fault.name)
            (self._paused.add if fault.number is signal.SIGSTOP else self._paused.discard)(fault.name)

    def end(self, children: Children) -> None:
        """Drop the faults that are left, and continue paused processes, so that they can leave."""
        self._due.clear()
        for name in self._paused:
            children[name].signal(signal.SIGCONT)
        self._paused.clear()
